"""What a coil system can do where, within its current limits: field, force on a magnet, condition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from magfem.actuation.inverse import checked_limits
from magfem.actuation.wrench import field_to_wrench
from magfem.actuation.zonotope import farthest, reach_along, reach_in_every_direction
from magfem.errors import InputError
from magfem.fields.field import as_points
from magfem.fields.workspace_region import bounding_ball
from magfem.typing import ArrayLike, Floats, Points

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem

_BLOCK = 512  # points at a time: pairs of coils make large arrays


@dataclass(frozen=True, eq=False)
class WorkspaceMap:
    """Numbers at points (..., 3) m; NaN where the system makes no promise.

    field_everywhere: T, the largest |B| (...) that can be had in any direction whatever, that is in the worst one.
    field_best: T, in the best one.  field_along: T, in the direction asked for, or None.
    force_everywhere, force_best, force_along: N, the same of the force on the moment asked for, or None; the torque
    that comes with it is not asked about.
    condition: (...) of the eight rows of `unit_fields`, the gradient's times `length`: the largest singular value over
    the last of as many as there are coils, at most eight.  smallest: (...) T, that singular value at the limits.
    The background takes no part: these are what the currents can change.
    """

    points: Points
    length: float
    field_everywhere: Floats
    field_best: Floats
    field_along: Floats | None
    force_everywhere: Floats | None
    force_best: Floats | None
    force_along: Floats | None
    condition: Floats
    smallest: Floats


def workspace_map(
    system: CoilSystem,
    points: ArrayLike,
    joints: ArrayLike | None = None,
    moment: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    limits: ArrayLike | None = None,
    length: float | None = None,
) -> WorkspaceMap:
    """What the system can do at `points` (..., 3) m at these joints, exactly: bounded currents make a zonotope.

    moment: (3,) A·m², in the system's axes.  direction: (3,), of field and force.  limits: (c,) A or one for all; None
    takes the coils' own.  length: m, by which gradients count as fields; None takes half the workspace's radius.
    Raises InputError for wrong input, and when a coil has no limit.
    """
    array = as_points(points)
    bounds = checked_limits(system, limits)
    if not system.coils or not np.isfinite(bounds).all():
        raise InputError("what can be achieved depends on current limits: give limits, or state them in the card")
    if length is None:
        ball = bounding_ball(system.workspace)
        length = 0.5 * ball.radius if ball is not None else 0.01
    if not 0 < length < np.inf:
        raise InputError("length must be positive and finite")
    magnet = None if moment is None else _three(moment, "moment")
    towards = None if direction is None else _three(direction, "direction")
    unit = system.unit_fields(array, joints, outside="nan").reshape(-1, 8, len(bounds)) * bounds
    inside = np.flatnonzero(np.isfinite(unit).all(axis=(1, 2)))
    names = ["field_everywhere", "field_best", "condition", "smallest"]
    names += ["force_everywhere", "force_best"] if magnet is not None else []
    if towards is not None:
        towards = towards / np.linalg.norm(towards)
        names += ["field_along", "force_along"] if magnet is not None else ["field_along"]
    found = {name: np.full(len(unit), np.nan) for name in names}
    for begin in range(0, inside.size, _BLOCK):
        block = inside[begin : begin + _BLOCK]
        rows = unit[block]
        made = {"field": rows[:, :3]}
        if magnet is not None:
            made["force"] = field_to_wrench(magnet)[:3] @ rows
        for what, generators in made.items():
            found[f"{what}_everywhere"][block] = reach_in_every_direction(generators)
            found[f"{what}_best"][block] = farthest(generators)
            if towards is not None:
                found[f"{what}_along"][block] = reach_along(generators, towards)
        values = np.linalg.svd(rows * np.append(np.ones(3), np.full(5, length))[:, None], compute_uv=False)
        found["smallest"][block] = values[:, -1]
        with np.errstate(divide="ignore", invalid="ignore"):
            found["condition"][block] = np.where(values[:, -1] > 0, values[:, 0] / values[:, -1], np.inf)
    lead = array.shape[:-1]
    shaped: dict[str, Floats | None] = {"field_along": None, "force_everywhere": None, "force_best": None}
    shaped |= {"force_along": None} | {name: values.reshape(lead) for name, values in found.items()}
    return WorkspaceMap(array, float(length), **shaped)  # type: ignore[arg-type]


def _three(given: ArrayLike, name: str) -> Floats:
    try:
        vector = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not 0 < np.linalg.norm(vector) < np.inf:
        raise InputError(f"{name} must be three finite numbers that are not all zero")
    return vector
