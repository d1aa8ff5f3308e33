"""Figs. 6.4e–f and S6.8: the isoline functions of the published algorithm, and how errors spread through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.localization import as_rotor, demodulate, dipole_poses, simulated_samples
from magfem.localization.isoline_curves import IsolineCurves
from magfem.localization.isoline_curves import curves as isoline_curves
from magfem.localization.isolines import isoline_functions
from magfem.localization.published import localize_as_published
from magfem.scenario.angles import between
from magfem.scenario.localization_study.noise import quantities
from magfem.scenario.localization_study.poses import isoline_distance
from magfem.scenario.localization_study.study import Comparison
from magfem.typing import Floats

_BETA = np.radians(np.arange(10.0, 81.0, 1.0))  # where biases are looked for
_AT = 100e-6  # T


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveStudy:
    """What is asked: of which rotor's model, at which strengths (k,) T."""

    model: str
    strengths: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves:
    """The curves, and the largest axis bias without noise (rad): as published, mended, and of the closed form."""

    study: CurveStudy
    curves: IsolineCurves
    bias: Floats
    mended_bias: Floats
    dipole_bias: Floats


def read(table: Table) -> CurveStudy:
    """From a recipe. Raises CardError."""
    table.only("kind", "study", "name", "source", "model", "strengths")
    return CurveStudy(model=table.text("model"), strengths=quantities(table, "strengths", "flux density"))


def run(study: CurveStudy) -> Curves:
    """The curves, and noiseless poses on the isoline of 100 µT through both parametrisations."""
    rotor = as_rotor(study.model)
    r = isoline_distance(rotor, np.asarray(_AT), _BETA)
    away = np.stack([np.cos(_BETA), np.zeros(_BETA.shape), np.sin(_BETA)], axis=-1)
    position, axis = -r[:, None] * away, np.array([0.0, 0.0, 1.0])
    times = np.arange(40) / 20
    samples = simulated_samples(rotor, position, axis, times, 1.0)
    biases = []
    for parametrisation in ("eccentric", "polar"):
        functions = isoline_functions(study.model, parametrisation)
        old = localize_as_published(samples, times, functions, near=position)
        biases.append(between(old.axis, np.broadcast_to(axis, old.axis.shape)))
    field = demodulate(samples, times, 1.0)
    poses = dipole_poses(field.cosine, field.sine, rotor.moment)
    nearest = between(poses.axis, axis).min(axis=-1)
    return Curves(
        study=study,
        curves=isoline_curves(study.model, strengths=study.strengths),
        bias=biases[0],
        mended_bias=biases[1],
        dipole_bias=nearest,
    )


def compared(found: Curves) -> tuple[Comparison, ...]:
    """What the text says of the curves, and the bias that the parametrisation makes."""
    curves = found.curves
    quarter = curves.beta < np.pi / 2
    told = quarter & (curves.beta > np.radians(25)) & (curves.beta < np.radians(75))
    slope = np.abs(curves.fitted.ratio_slope)
    return (
        Comparison(quantity="largest field ratio", found=float(curves.field_ratio.max()), published="2, a dipole’s"),
        Comparison(quantity="least field ratio", found=float(curves.field_ratio.min()), published="1, a dipole’s"),
        Comparison(
            quantity="|dβ/db_ratio|, the largest of β 25–75°",
            found=float(np.degrees(1 / slope[told]).max()),
            unit="deg",
            published="“least sensitive” for β 25–75°",
        ),
        Comparison(
            quantity="fit of |p_e| by ellipses and power laws: largest error",
            found=float(100 * np.abs(curves.distance / curves.field_distance - 1).max()),
            unit="%",
        ),
        Comparison(
            quantity="fit of b_ratio by eight Fourier terms: largest error",
            found=float(np.abs(curves.fitted.ratio - curves.field_ratio).max()),
        ),
        Comparison(
            quantity="fit of α by twenty cosines: largest error",
            found=float(np.degrees(np.abs(curves.fitted.angle - curves.field_angle).max())),
            unit="deg",
        ),
        Comparison(
            quantity="largest axis error without noise at 100 µT, β 10–80°: as published (eccentric β in 6.13)",
            found=float(np.degrees(found.bias.max())),
            unit="deg",
        ),
        Comparison(
            quantity="the same with the polar angle",
            found=float(np.degrees(found.mended_bias.max())),
            unit="deg",
        ),
        Comparison(
            quantity="the same by the closed form of a dipole",
            found=float(np.degrees(found.dipole_bias.max())),
            unit="deg",
        ),
    )


def arrays(found: Curves) -> dict[str, Floats]:
    """For data.npz, SI."""
    curves = found.curves
    return {
        "beta": curves.beta,
        "strengths": curves.strengths,
        "distance": curves.distance,
        "field_distance": curves.field_distance,
        "ratio": curves.fitted.ratio,
        "field_ratio": curves.field_ratio,
        "angle": curves.fitted.angle,
        "field_angle": curves.field_angle,
        "ratio_slope": curves.fitted.ratio_slope,
        "angle_slope": curves.fitted.angle_slope,
        "bias_beta": _BETA,
        "bias": found.bias,
        "mended_bias": found.mended_bias,
        "dipole_bias": found.dipole_bias,
    }
