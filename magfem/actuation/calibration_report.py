"""What a calibration finds out about itself, JSON-ready, in T and A.

`training`, `heldout`: errors of B in the norm of `fields.norms` and of |ΔB| in T.  `uncertainty`: noise of one
component and what the model leaves beyond it.  `linearity`, `saturation`: see `actuation.linearity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from magfem.actuation.coil_system import CoilSystem
from magfem.actuation.current_design import values_of
from magfem.actuation.current_fit import CurrentFit
from magfem.actuation.linearity import linearity_floor, repeated_noise, saturation
from magfem.fields.norms import relative_errors
from magfem.fields.workspace_region import bounding_ball
from magfem.samples import SystemSamples
from magfem.typing import Floats, Integers, Points

_SAFETY = 1.5  # on the largest held-out error: other points may hit a little harder
_SIGMAS = 3.0


def calibration_report(
    samples: SystemSamples,
    system: CoilSystem,
    positions: Points,
    place: Integers,
    tried: Sequence[CurrentFit],
    chosen: CurrentFit,
    target: Floats,
) -> dict[str, Any]:
    """All of it.

    positions: (q, 3) m.  place: (n,) of every sample.  target: (n, 3) T, what harmonics were fitted to.
    """
    solved, design = chosen.solved, chosen.design
    parameters = chosen.table.ravel()
    residual = (samples.B if chosen.degree == 0 else target) - design.field(parameters)
    training, heldout = _errors(samples.B, residual), _errors(samples.B, chosen.left_out)
    worst = int(np.argmax(np.linalg.norm(chosen.left_out, axis=1)))
    known = _known_noise(samples, place)
    names = [coil.name for coil in system.coils]
    ball = bounding_ball(system.workspace)
    assert ball is not None
    centre = np.array(ball.centre)[None]
    freedom = max(residual.size - solved.effective, 1.0)
    per_ampere = values_of([coil.terms for coil in system.coils], positions)[place]
    inverse = chosen.covariance / solved.variance if solved.variance > 0 else np.zeros_like(chosen.covariance)
    variance = None if samples.sigma is None else 1.0
    loss = saturation(design, per_ampere, residual, inverse, variance, solved.effective, names)
    return {
        "label": chosen.label,
        "degree": chosen.degree,
        "rows": samples.count,
        "positions": len(positions),
        "parameters": chosen.parameters,
        "effective_parameters": solved.effective,
        "condition": solved.condition,
        "ridge": solved.ridge,
        "objective": "absolute" if samples.sigma is None else "sigma",
        "held_out": "regions",
        "training": training,
        "heldout": heldout,
        "bound": {"B": _SAFETY * heldout["B"]["max"], "absolute": _SAFETY * heldout["B"]["absolute_max"]},
        "worst": {"row": worst, "point": samples.points[worst].tolist(), "currents": samples.currents[worst].tolist()},
        "candidates": [_headline(one) for one in tried],
        "uncertainty": _uncertainty(samples, tried, chosen, residual, known),
        "background": _background(system, chosen, centre),
        "centre": centre[0].tolist(),
        "coils": [_coil(name, system, chosen, k, centre, samples) for k, name in enumerate(names)],
        "linearity": linearity_floor(place, design.drive, samples.B, residual, freedom, known),
        "saturation": loss,
    }


def gain_report(fit: CurrentFit, names: Sequence[str]) -> list[dict[str, Any]]:
    """The factor of every given model, with its standard deviation."""
    drives = fit.table.shape[1]
    deviation = np.sqrt(np.diag(fit.covariance))
    return [
        {"name": name, "gain": float(fit.table[k, k]), "deviation": float(deviation[k * (drives + 1)])}
        for k, name in enumerate(names)
    ]


def _errors(B: Floats, residual: Floats) -> dict[str, Any]:
    """Residuals (n, 3) T of measurements B: relative, all points as one layer, and in T."""
    relative = relative_errors(B + residual, B, layered=False)
    size = np.linalg.norm(residual, axis=1)
    return {
        "points": len(B),
        "B": {
            "max": float(relative.max()),
            "rms": float(np.sqrt(np.mean(relative**2))),
            "absolute_max": float(size.max()),
            "absolute_rms": float(np.sqrt(np.mean(size**2))),
        },
    }


def _headline(one: CurrentFit) -> dict[str, Any]:
    return {
        "label": one.label,
        "degree": one.degree,
        "parameters": one.parameters,
        "condition": one.solved.condition,
        "heldout_rms": float(np.sqrt(np.mean(np.sum(one.left_out**2, axis=1)))),
        "score": float(np.sqrt(one.score)),
    }


def _known_noise(samples: SystemSamples, place: Integers) -> float | None:
    """Of a component, T, as far as it is known apart from any model."""
    if samples.sigma is not None:
        return float(np.sqrt(np.mean(samples.sigma**2)))
    return repeated_noise(place, samples.currents, samples.B)


def _uncertainty(
    samples: SystemSamples, tried: Sequence[CurrentFit], chosen: CurrentFit, residual: Floats, known: float | None
) -> dict[str, Any]:
    """Noise of one component, what the model leaves beyond it, T, and whether that is more than the noise."""
    rows = residual.size
    spread = float(np.sqrt(np.sum((residual * chosen.design.weight) ** 2) / max(rows - chosen.solved.effective, 1.0)))
    typical = 1.0 if samples.sigma is None else float(np.sqrt(np.mean(samples.sigma**2)))
    if samples.sigma is not None:
        noise, ground = 1.0, "the samples' deviations"
    elif known is not None:
        noise, ground = known, "rows measured more than once"
    else:
        noise, ground = min([float(np.sqrt(one.solved.variance)) for one in tried] + [spread]), "the richest candidates"
    beyond = float(np.sqrt(max(spread**2 - noise**2, 0.0)))
    return {
        "noise": noise * typical,
        "noise_from": ground,
        "model_error": beyond * typical,
        "standardised_residual": spread / noise if noise > 0 else None,
        "bias_dominates": beyond > noise,
    }


def _background(system: CoilSystem, fit: CurrentFit, centre: Points) -> dict[str, Any] | None:
    """What is there without currents, at the centre (1, 3)."""
    drives = fit.table.shape[1]
    if drives == len(system.coils):
        return None
    value = np.zeros(3) if system.background is None else system.background.jet(centre, 0)[0][0]
    deviation = fit.deviation(centre, np.eye(drives)[-1])[0]
    significant = bool(np.any(np.abs(value) > _SIGMAS * deviation))
    return {"centre": value.tolist(), "deviation": deviation.tolist(), "significant": significant}


def _coil(
    name: str, system: CoilSystem, fit: CurrentFit, k: int, centre: Points, samples: SystemSamples
) -> dict[str, Any]:
    """What one coil gives at the centre (1, 3), T/A."""
    return {
        "name": name,
        "field_per_ampere": system.coils[k].terms.jet(centre, 0)[0][0].tolist(),
        "deviation": fit.deviation(centre, np.eye(fit.table.shape[1])[k])[0].tolist(),
        "largest_current": float(np.abs(samples.currents[:, k]).max()),
    }
