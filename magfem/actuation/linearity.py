"""Is the field linear in the currents? A floor from positions that were measured more than once, and saturation.

**Floor.** At one position B = d·β with d = (I, 1), whatever the field's shape in space: no model of space takes part.
What a least squares fit of that leaves, pooled over all such positions, is noise and all that is not linear.

**Saturation.** An iron core gives b = a I (1 − (I/I_s)²) to third order: odd in the current, and less of it the more
flows. Its last term joins the linear model as one more column for each coil, −I_j³ β_j(p), whose factor is
1/I_s²; linear coefficients and factors are found together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.actuation.current_design import CurrentDesign
from magfem.fields.norms import relative_errors
from magfem.typing import Booleans, Floats, Integers

SIGNIFICANT_LOSS = 0.005
"""Of a coil's field at its largest current: less is not called saturation."""

_SIGMAS = 3.0
_FEWEST = 30  # degrees of freedom (components) that a floor needs
_DISTINCT = 0.02  # of the cubic column: share that the linear model must leave for a loss to be told
_ROUNDS = 3  # the fields per ampere that the cubic columns are made of settle at once
_LINEAR = 0.01  # the loss that the stated currents keep below, three standard deviations included


@dataclass(frozen=True)
class LocalFit:
    """Residuals (m, 3) T of the fits at single positions, scaled to the deviation of one measurement; their rows (m,).

    freedom: degrees of freedom, components.  variance: pooled, of one component, T².
    """

    residual: Floats
    rows: Integers
    freedom: int
    variance: float


def local_fit(group: Integers, drive: Floats, B: Floats) -> LocalFit | None:
    """Least squares of B (n, 3) against the drives (n, D) within every group (n,); None when too little is left over."""
    order = np.argsort(group, kind="stable")
    bounds = np.flatnonzero(np.diff(group[order], prepend=-1, append=-2))
    counts = np.diff(bounds)
    scaled = drive / np.maximum(np.abs(drive).max(axis=0), 1e-300)
    freedom, total = 0, 0.0
    found: list[Floats] = []
    of: list[Integers] = []
    for size in np.unique(counts[counts > 1]):
        rows = order[bounds[:-1][counts == size][:, None] + np.arange(size)]  # (k, size)
        u, s, _ = np.linalg.svd(scaled[rows], full_matrices=False)
        u = np.where((s > 1e-6 * s[:, :1])[:, None, :], u, 0.0)
        free = 1.0 - np.sum(u**2, axis=2)
        residual = B[rows] - u @ (np.swapaxes(u, 1, 2) @ B[rows])
        freedom += 3 * int(round(float(free.sum())))
        total += float(np.sum(residual**2))
        judged = free > 0.05  # the others have nearly a parameter of their own
        found.append(residual[judged] / np.sqrt(free[judged])[:, None])
        of.append(rows[judged])
    if freedom < _FEWEST:
        return None
    return LocalFit(np.concatenate(found), np.concatenate(of), freedom, total / freedom)


def repeated_noise(place: Integers, currents: Floats, B: Floats) -> float | None:
    """Standard deviation (T) of a component among rows of one position and the same currents; None without such."""
    step = 1e-9 * max(float(np.abs(currents).max()), 1e-300)
    keys = np.column_stack([place, np.round(currents / step)])
    group = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    local = local_fit(group, np.ones((len(B), 1)), B)
    return None if local is None else float(np.sqrt(local.variance))


def linearity_floor(
    place: Integers, drive: Floats, B: Floats, residual: Floats, freedom: float, noise: float | None
) -> dict[str, Any]:
    """What is not linear in the currents, of measurements B (n, 3) T at their places (n,) and drives (n, D).

    residual: (n, 3) T of the calibration, with its degrees of freedom, for want of positions measured often enough.
    noise: of a component, T, where it is known apart from any model.
    """
    local = local_fit(place, drive, B)
    if local is None:
        shown, rows, degrees = residual, np.arange(len(B)), freedom
        variance = float(np.sum(residual**2)) / max(freedom, 1.0)
    else:
        shown, rows, variance, degrees = local.residual, local.rows, local.variance, float(local.freedom)
    relative = relative_errors(B[rows] + shown, B[rows], layered=False)
    size = np.linalg.norm(shown, axis=1)
    floor: dict[str, Any] = {
        "from": "the calibration's residual" if local is None else "positions measured more than once",
        "rows": len(rows),
        "rms": float(np.sqrt(3 * variance)),
        "max": float(size.max()),
        "relative_rms": float(np.sqrt(np.mean(relative**2))),
        "relative_max": float(relative.max()),
        "noise": None if noise is None else float(np.sqrt(3)) * noise,
        "beyond_noise": None,
        "significant": None,
    }
    if noise is not None:
        floor["beyond_noise"] = float(np.sqrt(max(3 * (variance - noise**2), 0.0)))
        # The pooled variance has the relative deviation √(2/ν).
        floor["significant"] = bool(variance > noise**2 * (1 + _SIGMAS * np.sqrt(2 / degrees)))
    return floor


def saturation(
    design: CurrentDesign,
    per_ampere: Floats,
    residual: Floats,
    inverse: Floats,
    known_variance: float | None,
    effective: float,
    names: Sequence[str],
) -> dict[str, Any]:
    """The cubic loss of every coil at the largest current that it was driven with.

    per_ampere: (n, 3, C) T/A at the samples and residual: (n, 3) T, of the linear fit.  inverse: (p, p) of its normal
    matrix.  known_variance: of the weighted rows.  effective: how many parameters the data decided.
    """
    coils = len(names)
    currents = design.drive[:, :coils]
    largest = np.abs(currents).max(axis=0)
    cube = largest * (currents / largest) ** 3  # A: the factor is then the loss at the largest current
    functions = len(inverse) // design.drive.shape[1]
    target = (residual * design.weight).ravel()
    at_small_currents, factors, deviation = per_ampere, np.zeros(coils), np.full(coils, np.nan)
    for _ in range(_ROUNDS):
        columns = -at_small_currents * cube[:, None, :]
        carried = inverse @ design.adjoint(columns, functions)  # (p, C), what the linear model makes of them
        left = columns - np.stack([design.field(one) for one in carried.T], axis=-1)
        weighted = (left * design.weight[..., None]).reshape(-1, coils)
        size = np.linalg.norm((columns * design.weight[..., None]).reshape(-1, coils), axis=0)
        told, normal = _told(weighted, size)
        factors = np.zeros(coils)
        factors[told] = normal @ (weighted[:, told].T @ target)
        at_small_currents = per_ampere - design.per_ampere(carried @ factors)[..., :coils]
        rest = target - weighted @ factors
        spread = float(rest @ rest) / max(rest.size - effective - int(told.sum()), 1.0)
        variance = spread if known_variance is None else known_variance
        deviation = np.full(coils, np.nan)
        deviation[told] = np.sqrt(variance * np.diag(normal))
    found = zip(names, largest.tolist(), factors.tolist(), deviation.tolist(), strict=True)
    losses = [_coil(*one) for one in found]
    return {"coils": losses, "saturates": [loss["name"] for loss in losses if loss["significant"]]}


def _told(columns: Floats, size: Floats) -> tuple[Booleans, Floats]:
    """Which columns (m, C) the linear model and the others leave enough of, and the inverse of their normal matrix."""
    told = np.linalg.norm(columns, axis=0) > _DISTINCT * size
    while told.any():
        normal = np.linalg.pinv(columns[:, told].T @ columns[:, told], hermitian=True)
        alone = np.diag(normal) * (_DISTINCT * size[told]) ** 2 < 1.0
        if alone.all():
            return told, normal
        told[np.flatnonzero(told)[~alone]] = False
    return told, np.empty((0, 0))


def _coil(name: str, largest: float, loss: float, deviation: float) -> dict[str, Any]:
    known = bool(np.isfinite(deviation))
    significant = known and loss > _SIGMAS * deviation and loss > SIGNIFICANT_LOSS
    most = max(loss, 0.0) + _SIGMAS * deviation
    return {
        "name": name,
        "largest_current": largest,
        "loss": loss if known else None,
        "deviation": deviation if known else None,
        "significant": significant,
        "linear_up_to": largest * min(1.0, float(np.sqrt(_LINEAR / max(most, 1e-300)))) if known else None,
    }
