"""Poses that explain measured quadratures best: weighted nonlinear least squares, many poses at once.

The unknowns of a pose are its position and its orientation R, six numbers. With q = Rᵀ(x − p) the sensor's place in the
rotor's frame, c(q) the rotor's field there and G its gradient, a small motion of the rotor by dπ and a small turn δ,
both in its own frame, change the field at the sensor by

    d(R c) = R (−G dπ + (G [q]× − [c]×) δ).

δ_x and δ_y move the axis, δ_z is the phase. Levenberg–Marquardt steps are damped where information is singular: one
sensor near β = 0 or 90°, where two branches meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.localization.orientation import small_turn
from magfem.localization.rotor import Rotor
from magfem.localization.sensor import SensorArray
from magfem.typing import Booleans, Floats, Integers, Points

MOST_ITERATIONS = 200
SMALL_STEP = 1e-11  # of the distance, and rad
NEGLIGIBLE = 1e-8
"""Gain of a step in the misfit that no noise would notice. Where the misfit is small this last step left an error that
is the square of a negligible one: Gauss–Newton converges quadratically there."""

PATIENCE = 50  # steps after which a thousand times that gain counts as none: valleys of wrong branches are long
LIGHT = 1e-3  # damping below which a step with little gain tells of a minimum, not of the damping
HOPEFUL, FALLING = 3, 0.5  # steps before a candidate is given up; share of what it is behind that a step must gain
FIRST_DAMPING = 1e-4  # of the mean of the normal matrix' diagonal
LONGEST_STEP = 0.3  # of the distance, and rad
_ONE = np.eye(6)
CLOSEST = 1e-3  # of the first distance: nothing comes nearer to a sensor


@dataclass(frozen=True, eq=False)
class Measured:
    """What s sensors measured: quadratures (..., s, 6) T, C before S, and whitening (..., s, 6, 6) 1/T.

    Both in the sensors' frames; whitening is the inverse of a Cholesky factor of the covariance: W Σ Wᵀ = 1.
    """

    quadratures: Floats
    whitening: Floats


@dataclass(frozen=True, eq=False)
class Refined:
    """position (..., 3) m, frame (..., 3, 3), misfit (...): the sum of squared residuals, each over its deviation.

    information: (..., 6, 6), of position in the common frame (m) and small turns about the rotor's axes (rad).
    converged, iterations: (...).
    """

    position: Points
    frame: Floats
    misfit: Floats
    information: Floats
    converged: Booleans
    iterations: Integers


def refine(
    rotor: Rotor,
    array: SensorArray,
    measured: Measured,
    position: Points,
    frame: Floats,
    give_up: float = np.inf,
) -> Refined:
    """The poses nearest to the starts `position` (..., 3) m, `frame` (..., 3, 3) that explain `measured` best.

    The leading axes of `measured` broadcast to those of the starts, whose last are candidates of one pose.  give_up: a
    candidate whose misfit is by so much above that of another, and hardly falls, is left where it is, not converged.
    """
    lead = position.shape[:-1]
    count = int(np.prod(lead))
    p, R = position.reshape(-1, 3).copy(), frame.reshape(-1, 3, 3).copy()
    target = np.broadcast_to(measured.quadratures, (*lead, *measured.quadratures.shape[-2:])).reshape(count, -1, 6)
    weight = np.broadcast_to(measured.whitening, (*lead, *measured.whitening.shape[-3:])).reshape(count, -1, 6, 6)
    misfit, converged, iterations = np.empty(count), np.zeros(count, dtype=bool), np.zeros(count, dtype=np.int64)
    group = np.arange(count) // (lead[-1] if lead else 1)  # candidates of one pose
    least = np.full(group[-1] + 1 if count else 0, np.inf)  # the least misfit so far, by pose

    # Below, arrays are of the candidates under way: `going` are their numbers.
    going = np.arange(count)
    now = _Candidates(p, R, *linearised(rotor, array, p, R, target, weight))
    J = np.empty_like(now.J)
    distance = _distance(p, array)
    size = np.concatenate([np.repeat(distance[:, None], 3, axis=1), np.ones((count, 3))], axis=1)  # of what is a step
    closest = CLOSEST * distance
    damping, growth = np.full(count, FIRST_DAMPING), np.full(count, 2.0)
    for iteration in range(MOST_ITERATIONS):
        normal, gradient, value = now.normal_equations(size)
        step, length = _damped_step(normal, gradient, damping)
        moved = now.moved(step * size)
        tried = _Candidates(*moved, *linearised(rotor, array, *moved, target[going], weight[going]))
        tried_value = np.einsum("ni,ni->n", tried.residual, tried.residual)
        better = (tried_value <= value) & (_distance(moved[0], array) > closest)
        gain = value - tried_value
        small = length < SMALL_STEP
        little = NEGLIGIBLE if iteration < PATIENCE else 1e3 * NEGLIGIBLE
        flat = better & (gain < np.maximum(little, 1e-14 * tried_value)) & (damping <= LIGHT)
        stuck = ~better & (damping > 1e8)
        np.minimum.at(least, group[going], np.where(better, tried_value, value))
        behind = value - least[group[going]]
        hopeless = (behind > give_up) & (gain < FALLING * behind) & (iteration >= HOPEFUL)

        now = now.replaced(better, tried)
        value = np.where(better, tried_value, value)
        damping, growth = _next_damping(damping, growth, better, gain, step, normal, gradient)
        done = small | flat | stuck | hopeless
        if done.any() or iteration == MOST_ITERATIONS - 1:
            p[going], R[going], J[going] = now.position, now.frame, now.J
            misfit[going], iterations[going] = value, iteration + 1
            # Rejected small steps end at a minimum as well: rounding is all that is left.
            ended = small | flat | (stuck & (length < 1e-6))
            converged[going[ended]] = True
            keep = ~done
            if not keep.any():
                break
            going, now, size, closest = going[keep], now.only(keep), size[keep], closest[keep]
            damping, growth = damping[keep], growth[keep]
    U, _, V = np.linalg.svd(R)
    R = U @ V  # many small turns leave a matrix that is a rotation to a few roundings
    J[..., :3] = J[..., :3] @ np.swapaxes(R, -1, -2)  # from the rotor's frame to the common one
    return Refined(
        position=p.reshape(*lead, 3),
        frame=R.reshape(*lead, 3, 3),
        misfit=misfit.reshape(lead),
        information=(np.swapaxes(J, -1, -2) @ J).reshape(*lead, 6, 6),
        converged=converged.reshape(lead),
        iterations=iterations.reshape(lead),
    )


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Poses (n, 3), (n, 3, 3) with their whitened J (n, m, 6) and residuals (n, m)."""

    position: Points
    frame: Floats
    J: Floats
    residual: Floats

    def normal_equations(self, size: Floats) -> tuple[Floats, Floats, Floats]:
        """JᵀJ (n, 6, 6) and Jᵀr (n, 6) for steps in units of `size` (n, 6), and rᵀr (n,): one product for all."""
        both = np.concatenate([self.J * size[:, None, :], self.residual[..., None]], axis=-1)
        product = np.swapaxes(both, -1, -2) @ both
        return product[:, :6, :6], product[:, :6, 6], product[:, 6, 6]

    def moved(self, step: Floats) -> tuple[Points, Floats]:
        """The poses after steps (n, 6) m and rad in their own frames."""
        place = self.position + (self.frame @ step[:, :3, None])[..., 0]
        return place, self.frame @ small_turn(step[:, 3:])

    def replaced(self, better: Booleans, other: _Candidates) -> _Candidates:
        """Those of `other` where they are better."""
        if better.all():
            return other
        whole = better[:, None, None]
        return _Candidates(
            np.where(better[:, None], other.position, self.position),
            np.where(whole, other.frame, self.frame),
            np.where(whole, other.J, self.J),
            np.where(better[:, None], other.residual, self.residual),
        )

    def only(self, keep: Booleans) -> _Candidates:
        return _Candidates(self.position[keep], self.frame[keep], self.J[keep], self.residual[keep])


def _damped_step(normal: Floats, gradient: Floats, damping: Floats) -> tuple[Floats, Floats]:
    """Steps (n, 6), no longer than is safe, and how long (n,) they would have been."""
    # One scale for all six: small pivots are just what damping is for.
    spread = np.einsum("nii->n", normal) * (damping / 6)
    step = -np.linalg.solve(normal + spread[:, None, None] * _ONE, gradient[..., None])[..., 0]
    length = np.abs(step).max(axis=-1)
    return step * np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))[:, None], length


def _next_damping(
    damping: Floats, growth: Floats, better: Booleans, gain: Floats, step: Floats, normal: Floats, gradient: Floats
) -> tuple[Floats, Floats]:
    """Nielsen's rule: less damping the better the linear prediction was, and ever more when steps fail."""
    predicted = -np.einsum("ni,ni->n", step, 2 * gradient + (normal @ step[..., None])[..., 0])
    ratio = np.clip(gain / np.maximum(predicted, 1e-300), -1.0, 1.0)
    less = np.maximum(damping * np.maximum(0.1, 1 - (2 * ratio - 1) ** 3), 1e-15)
    return np.where(better, less, growth * damping), np.where(better, 2.0, 2 * growth)


def _distance(p: Points, array: SensorArray) -> Floats:
    """(n,) m from positions (n, 3) to the nearest sensor."""
    away = p[:, None, :] - array.positions
    return np.asarray(np.sqrt(np.einsum("nsi,nsi->ns", away, away).min(axis=-1)))


def quadratures_at(rotor: Rotor, array: SensorArray, position: Points, frame: Floats) -> Floats:
    """(..., s, 6) T: C and S that the sensors see, in their own frames, of rotors at `position` with `frame`."""
    return _modelled(rotor, array, position.reshape(-1, 3), frame.reshape(-1, 3, 3))[0].reshape(
        *position.shape[:-1], -1, 6
    )


def information(rotor: Rotor, array: SensorArray, position: Points, frame: Floats, whitening: Floats) -> Floats:
    """(..., 6, 6) Fisher information of position in the common frame (m) and turns about the rotor's axes (rad)."""
    lead = position.shape[:-1]
    p, R = position.reshape(-1, 3), frame.reshape(-1, 3, 3)
    _, J = _modelled(rotor, array, p, R)
    J[..., :3] = np.einsum("nskj,nij->nski", J[..., :3], R)
    J = np.broadcast_to(whitening, (*lead, len(array.sensors), 6, 6)).reshape(len(p), -1, 6, 6) @ J
    found: Floats = np.einsum("nski,nskj->nij", J, J).reshape(*lead, 6, 6)
    return found


def linearised(
    rotor: Rotor, array: SensorArray, p: Points, R: Floats, target: Floats, weight: Floats
) -> tuple[Floats, Floats]:
    """Whitened J (n, 6s, 6) and residuals (n, 6s) of poses (n, 3), (n, 3, 3)."""
    modelled, J = _modelled(rotor, array, p, R)
    residual = (weight @ (modelled - target)[..., None])[..., 0]
    return (weight @ J).reshape(len(p), -1, 6), residual.reshape(len(p), -1)


def _modelled(rotor: Rotor, array: SensorArray, p: Points, R: Floats) -> tuple[Floats, Floats]:
    """Quadratures (n, s, 6) in the sensors' frames and J (n, s, 6, 6), all motions in the rotor's frame."""
    q = (array.positions - p[:, None, :]) @ R
    B, G = rotor.stacked_quadratures(q)  # (n, s, 2, 3), (n, s, 2, 3, 3)
    turn = (np.swapaxes(array.axes, -1, -2) @ R[:, None])[:, :, None]  # from the rotor's frame to the sensors'
    J = np.empty((*B.shape, 6))
    J[..., :3] = -G
    J[..., 3:] = G @ cross_matrix(q)[:, :, None] - cross_matrix(B)
    shape = (*q.shape[:2], 6)
    return (turn @ B[..., None]).reshape(shape), (turn @ J).reshape(*shape, 6)
