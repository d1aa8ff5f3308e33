"""What magnets are wanted to do: point somewhere, be turned some way, be somewhere; errors and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.cross_matrix import cross_matrix
from magfem.errors import InputError
from magfem.rod.sections import three
from magfem.typing import ArrayLike, Floats, Points

_OPPOSITE = 0.05  # rad: an axis nearer to the opposite of a goal is turned as if it were so far from it

POSITION_SCALE = 0.05
"""m that weigh as much as one rad."""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """Of one magnet, counted from the base.

    direction: (3,) where its z, the rod's axis, shall point; any length but zero.  rotation: its whole orientation.
    position: (3,) m of its centre.  State a direction or a rotation, a position, or both.
    """

    magnet: int
    direction: ArrayLike | None = None
    rotation: Rotation | None = None
    position: ArrayLike | None = None

    def __post_init__(self) -> None:
        if self.direction is None and self.rotation is None and self.position is None:
            raise InputError("a goal needs a direction, a rotation or a position")
        if isinstance(self.magnet, bool) or not isinstance(self.magnet, int | np.integer):
            raise InputError(f"goal: magnet must be a whole number, counted from 0, got {self.magnet!r}")
        if self.rotation is not None and not (isinstance(self.rotation, Rotation) and self.rotation.single):
            raise InputError("goal: rotation must be one scipy.spatial.transform.Rotation")
        if self.direction is not None and self.rotation is not None:
            raise InputError("a goal has either a direction or a rotation")
        if self.direction is not None and not np.linalg.norm(three("goal", "direction", self.direction)) > 0:
            raise InputError("goal: direction must not be zero")
        if self.position is not None:
            three("goal", "position", self.position)

    @property
    def rows(self) -> int:
        """How many numbers its error has."""
        return 2 * (self.direction is not None) + 3 * (self.rotation is not None) + 3 * (self.position is not None)


@dataclass(frozen=True, eq=False)
class GoalError:
    """Of all goals at once, r rows.

    vector: (r,) rad, positions over POSITION_SCALE.  slope: (r, m, 6) of `vector` by every magnet's shift and turn.
    angles: rad that each goal's direction or rotation is off, 0 without.  distances: m that its position is.
    """

    vector: Floats
    slope: Floats
    angles: Floats
    distances: Floats

    @property
    def size(self) -> float:
        """rad, the largest angle, or distance over POSITION_SCALE."""
        return float(max(self.angles.max(initial=0.0), self.distances.max(initial=0.0) / POSITION_SCALE))


def goal_error(goals: Sequence[Goal], positions: Points, frames: Floats) -> GoalError:
    """How far magnets at `positions` (m, 3) with `frames` (m, 3, 3) are from the goals.

    Directions: the azimuthal equidistant map about the wanted one, (θ / sin θ) (t₁·a, t₂·a), whose length is the angle
    θ itself; it has no arc cosine, whose slope is infinite at the goal. Rotations: the logarithm of R Rᵀ_wanted.
    """
    count = len(positions)
    rows, slopes, angles, distances = [], [], [], []
    for goal in goals:
        if not 0 <= goal.magnet < count:
            raise InputError(f"a goal is for magnet {goal.magnet}, and the rod has {count}, counted from 0")
        angle = distance = 0.0
        if goal.direction is not None:
            vector, derivative, angle = _direction_error(np.asarray(goal.direction, float), frames[goal.magnet, :, 2])
            rows.append(vector)
            slopes.append(_slope(count, goal.magnet, turn=derivative))
        if goal.rotation is not None:
            turned = frames[goal.magnet] @ goal.rotation.as_matrix().T
            vector = Rotation.from_matrix(turned).as_rotvec()
            angle = float(np.linalg.norm(vector))
            rows.append(vector)
            slopes.append(_slope(count, goal.magnet, turn=_inverse_left_jacobian(vector)))
        if goal.position is not None:
            vector = (positions[goal.magnet] - np.asarray(goal.position, float)) / POSITION_SCALE
            distance = float(np.linalg.norm(vector)) * POSITION_SCALE
            rows.append(vector)
            slopes.append(_slope(count, goal.magnet, shift=np.eye(3) / POSITION_SCALE))
        angles.append(angle)
        distances.append(distance)
    return GoalError(np.concatenate(rows), np.concatenate(slopes), np.array(angles), np.array(distances))


def _slope(count: int, magnet: int, shift: Floats | None = None, turn: Floats | None = None) -> Floats:
    rows = len(shift if shift is not None else turn if turn is not None else [])
    slope = np.zeros((rows, count, 6))
    if shift is not None:
        slope[:, magnet, :3] = shift
    if turn is not None:
        slope[:, magnet, 3:] = turn
    return slope


def _direction_error(wanted: Floats, axis: Floats) -> tuple[Floats, Floats, float]:
    """(2,), its derivative (2, 3) by a turn of `axis`, and the angle, rad."""
    d = wanted / np.linalg.norm(wanted)
    D = cross_matrix(d)
    t1 = D[:, np.argmin(np.abs(d))]  # d × the axis that is farthest from it
    t1 = t1 / np.linalg.norm(t1)
    T = np.stack([t1, D @ t1])
    flat = T @ axis
    cosine, sine = float(d @ axis), float(np.linalg.norm(flat))
    angle = theta = float(np.arctan2(sine, cosine))
    if cosine < 0 and sine < _OPPOSITE:  # any way round is as good: take the one begun, or the first
        flat = flat * (_OPPOSITE / sine) if sine > 0 else np.array([_OPPOSITE, 0.0])
        sine, cosine = _OPPOSITE, -float(np.sqrt(1 - _OPPOSITE**2))
        theta, axis = float(np.arctan2(sine, cosine)), flat @ T + cosine * d
    if sine < 1e-4:
        factor, change = 1.0, -1 / 3  # θ / sin θ = 1 + θ²/6
    else:
        factor = theta / sine
        change = (cosine * theta / sine - 1) / sine**2  # d(θ / sin θ)/d cos θ
    by_axis = factor * T + change * np.outer(flat, d)
    return factor * flat, by_axis @ -cross_matrix(axis), angle


def _inverse_left_jacobian(e: Floats) -> Floats:
    """Of the rotation vector of exp([δ]×) exp([e]×) by δ, (3, 3)."""
    theta = float(np.linalg.norm(e))
    E = cross_matrix(e)
    if theta < 1e-4:
        return np.eye(3) - 0.5 * E + E @ E / 12
    half = theta / 2
    inverse: Floats = np.eye(3) - 0.5 * E + (1 - half / np.tan(half)) / theta**2 * E @ E
    return inverse
