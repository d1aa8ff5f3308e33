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
_FEWEST = 10  # degrees of freedom that local fits need to say something
_JUDGED = 0.05  # of a row left free: the others have nearly a parameter of their own
_ENOUGH = 0.5  # of all rows left free: then saturation is sought position by position
_DISTINCT = 0.02  # of the cubic column: share that the linear model must leave for a loss to be told
_ROUNDS = 3  # the fields per ampere that the cubic columns are made of settle at once
_LINEAR = 0.01  # the loss that the stated currents keep below, three standard deviations included


@dataclass(frozen=True)
class LocalFit:
    """What linear fits at single positions leave of values (n, m).

    rows: (r,) of the samples whose position was measured often enough, residual: (r, m) of them.  free: (r,) the share
    of each row that no parameter took.
    """

    rows: Integers
    residual: Floats
    free: Floats

    @property
    def freedom(self) -> float:
        """Degrees of freedom of one column."""
        return float(self.free.sum())


def local_fit(group: Integers, drive: Floats, values: Floats) -> LocalFit | None:
    """Least squares of values (n, m) against the drives (n, D) within every group (n,); None when little is left."""
    order = np.argsort(group, kind="stable")
    bounds = np.flatnonzero(np.diff(group[order], prepend=-1, append=-2))
    counts = np.diff(bounds)
    scaled = drive / np.maximum(np.abs(drive).max(axis=0), 1e-300)
    found: list[tuple[Integers, Floats, Floats]] = []
    for size in np.unique(counts[counts > 1]):
        rows = order[bounds[:-1][counts == size][:, None] + np.arange(size)]  # (k, size)
        u, s, _ = np.linalg.svd(scaled[rows], full_matrices=False)
        u = np.where((s > 1e-6 * s[:, :1])[:, None, :], u, 0.0)
        residual = values[rows] - u @ (np.swapaxes(u, 1, 2) @ values[rows])
        free = 1.0 - np.sum(u**2, axis=2)
        found.append((rows.ravel(), residual.reshape(rows.size, -1), free.ravel()))
    if not found:
        return None
    rows, residual, free = (np.concatenate(parts) for parts in zip(*found, strict=True))
    fit = LocalFit(rows, residual, free)
    return fit if fit.freedom >= _FEWEST else None


def repeated_noise(place: Integers, currents: Floats, B: Floats) -> float | None:
    """Standard deviation (T) of a component among rows of one position and the same currents; None without such."""
    step = 1e-9 * max(float(np.abs(currents).max()), 1e-300)
    keys = np.column_stack([place, np.round(currents / step)])
    group = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    local = local_fit(group, np.ones((len(B), 1)), B)
    return None if local is None else float(np.sqrt(np.sum(local.residual**2) / (3 * local.freedom)))


def linearity_floor(
    place: Integers, drive: Floats, B: Floats, residual: Floats, freedom: float, noise: float | None
) -> dict[str, Any]:
    """What is not linear in the currents, of measurements B (n, 3) T at their places (n,) and drives (n, D).

    residual: (n, 3) T of the calibration, with its degrees of freedom, for want of positions measured often enough.
    noise: of a component, T, where it is known apart from any model. Returns |ΔB| in T and relative to |B|.
    """
    local = local_fit(place, drive, B)
    if local is None:
        shown, rows, degrees = residual, np.arange(len(B)), freedom
    else:
        judged = local.free > _JUDGED
        rows, degrees = local.rows[judged], 3 * local.freedom
        shown = local.residual[judged] / np.sqrt(local.free[judged])[:, None]  # as one measurement deviates
    total = float(np.sum((residual if local is None else local.residual) ** 2))
    variance = total / max(degrees, 1.0)
    relative = relative_errors(B[rows] + shown, B[rows], layered=False)
    floor: dict[str, Any] = {
        "from": "the calibration's residual" if local is None else "positions measured more than once",
        "rows": len(rows),
        "rms": float(np.sqrt(3 * variance)),
        "max": float(np.linalg.norm(shown, axis=1).max()),
        "relative_rms": float(np.sqrt(np.mean(relative**2))),
        "relative_max": float(relative.max()),
        "noise": None if noise is None else float(np.sqrt(3)) * noise,
        "beyond_noise": None,
        "significant": None,
    }
    if noise is not None:
        floor["beyond_noise"] = float(np.sqrt(max(3 * (variance - noise**2), 0.0)))
        # The pooled variance has the relative deviation √(2/ν).
        floor["significant"] = bool(variance > noise**2 * (1 + _SIGMAS * np.sqrt(2 / max(degrees, 1.0))))
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

    Where most positions were measured often enough, what is linear there is taken away position by position, which
    needs no model of space; else by the calibration, whose own error then adds to the deviations.
    """
    coils = len(names)
    currents = design.drive[:, :coils]
    largest = np.abs(currents).max(axis=0)
    cube = largest * (currents / largest) ** 3  # A: the factor is then the loss at the largest current
    functions = len(inverse) // design.drive.shape[1]
    local = local_fit(design.place, design.drive, residual)
    by_position = local is not None and 3 * local.freedom >= _ENOUGH * residual.size
    freedom = 3 * local.freedom if local is not None and by_position else residual.size - effective
    target = local.residual.ravel() if local is not None and by_position else (residual * design.weight).ravel()
    at_small_currents, factors, deviation = per_ampere, np.zeros(coils), np.full(coils, np.nan)
    for _ in range(_ROUNDS):
        columns = -at_small_currents * cube[:, None, :]
        carried = inverse @ design.adjoint(columns, functions)  # (p, C), what the linear model makes of them
        if local is not None and by_position:
            alone = local_fit(design.place, design.drive, columns.reshape(len(columns), -1))
            assert alone is not None
            left, whole = alone.residual.reshape(-1, coils), columns[alone.rows].reshape(-1, coils)
        else:
            modelled = np.stack([design.field(one) for one in carried.T], axis=-1)
            left, whole = ((one * design.weight[..., None]).reshape(-1, coils) for one in (columns - modelled, columns))
        enough = freedom - coils >= _FEWEST
        told, normal = _told(left, np.linalg.norm(whole, axis=0) if enough else np.full(coils, np.inf))
        factors = np.zeros(coils)
        factors[told] = normal @ (left[:, told].T @ target)
        at_small_currents = per_ampere - design.per_ampere(carried @ factors)[..., :coils]
        rest = target - left @ factors
        variance = float(rest @ rest) / max(freedom - int(told.sum()), 1.0)
        if not by_position:
            variance = max(variance, known_variance or 0.0)
        deviation = np.full(coils, np.nan)
        deviation[told] = np.sqrt(variance * np.diag(normal))
    found = zip(names, largest.tolist(), factors.tolist(), deviation.tolist(), strict=True)
    losses = [_coil(*one) for one in found]
    return {"coils": losses, "saturates": [loss["name"] for loss in losses if loss["significant"]]}


def _told(columns: Floats, size: Floats) -> tuple[Booleans, Floats]:
    """Which columns (m, C) the linear model and the others leave enough of, and the inverse of their normal matrix."""
    told: Booleans = np.asarray(np.linalg.norm(columns, axis=0) > _DISTINCT * size)
    while told.any():
        normal = np.asarray(np.linalg.pinv(columns[:, told].T @ columns[:, told], hermitian=True), dtype=float)
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
