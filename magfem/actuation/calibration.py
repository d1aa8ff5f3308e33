"""From measurements to a coil system: the fields of all coils and the background at once, from any currents.

    B(p, I) = Σ_j I_j Σ_k c_jk φ_k(p) + Σ_k b_k φ_k(p)

with φ_k interior solid harmonics about the middle of the workspace, so that every coil's field is free of sources
there, and the background is what a probe shows without currents (the `Offset` of MPEM files). Or with the models of a
system that is known beforehand, a gain for each coil, and harmonics for what they leave. All coefficients are found by
one linear least squares; the degree is the smallest that predicts parts of space that were left out as well as the best
does, within one standard error.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from magfem.actuation.calibration_report import calibration_report, gain_report
from magfem.actuation.coil_system import CoilSystem, SystemCoil
from magfem.actuation.current_design import CurrentDesign, values_of
from magfem.actuation.current_fit import (
    CurrentFit,
    field_deviation,
    fit_degrees,
    fit_gains,
    harmonic_units,
    smallest_of_the_best,
)
from magfem.actuation.distinguishable import check_samples, places
from magfem.errors import InputError
from magfem.fields.field import as_points, promised_points
from magfem.fields.region import Region
from magfem.fields.terms import HIGHEST_DEGREE, Terms, concatenate
from magfem.fields.workspace_region import Ball, Box, bounding_ball
from magfem.fitting.held_out import regions
from magfem.fitting.least_squares import Ridge
from magfem.fitting.provenance import versions_and_date
from magfem.samples import SystemSamples
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Floats, Outside, Points, Vectors

log = logging.getLogger("magfem")

_STAGES = ((1, 2, 3, 4), (5, 6), (7, 8), (9, 10))
"""Degrees tried; the next ones only while the highest so far predicts best."""

_FILLED = 0.75  # of the measured components: more parameters than that are not tried
_MOST_PARAMETERS = 1500
_THICK = 0.02  # of the extent: a plane of samples still has a volume
_ROUND = 0.9  # of half the box's diagonal: samples that stay within fill a ball


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """A coil system from measurements, and how good it is.

    system: coils per ampere, background in T, workspace; its `report` and `provenance` travel in its file.
    functions: the K functions that were fitted, each alone at coefficient one.  covariance: of their (K, D)
    coefficients, flattened; D counts the coils, and the background as the last if there is one.
    """

    system: CoilSystem
    functions: tuple[Terms, ...]
    covariance: Floats

    @property
    def report(self) -> dict[str, Any]:
        """What the calibration found out about itself, JSON-ready."""
        return self.system.report

    def __repr__(self) -> str:
        heldout = self.report["heldout"]["B"]["absolute_rms"]
        return f"<Calibration of {self.system.name!r}: {self.report['label']}, {1e3 * heldout:.2g} mT RMS held out>"

    def deviation(self, points: ArrayLike, currents: ArrayLike, outside: Outside = "raise") -> Vectors:
        """Standard deviation of B (..., 3) T at `points` (..., 3) m, for the same currents (c,) A everywhere.

        What the noise of the measurements makes of the coefficients; not what the functions cannot describe:
        `report["uncertainty"]` says whether that dominates. Raises as `CoilSystem.B` does.
        """
        amperes = self.system.checked_currents(currents)
        if amperes.ndim != 1:
            raise InputError(f"deviations are for one set of currents, shape (c,), got {amperes.shape}")
        array = as_points(points)
        flat = array.reshape(-1, 3)
        promised = promised_points(flat, self.system.region, outside)
        drive = np.append(amperes, 1.0)[: len(self.covariance) // len(self.functions)]
        deviation = field_deviation(self.functions, self.covariance, flat, drive)
        deviation[~promised] = np.nan
        return deviation.reshape(array.shape)


@one_thread_for_algebra()
def calibrate(
    samples: SystemSamples,
    *,
    name: str = "",
    coil_names: Sequence[str] | None = None,
    workspace: Ball | Box | None = None,
    degrees: Sequence[int] | int | None = None,
    background: bool = True,
    prior: CoilSystem | None = None,
    correct: bool = True,
    ridge: Ridge = "evidence",
) -> Calibration:
    """A coil system from measurements at many positions and any currents.

    Parameters
    ----------
    samples : rows of position, currents and B; weighted by their standard deviations where these are stated.
    name, coil_names : of the system and its coils; by default Coil_0, Coil_1, …, or the prior's.
    workspace : where the system is to hold, and about whose middle harmonics are taken; by default the prior's, or what
        the samples fill, a ball or a box.
    degrees : highest degree of the harmonics, or several to try; by default 1 to 10, as far as higher ones predict
        better.
    background : whether there is a field that does not depend on the currents.
    prior : a system whose coils' models are taken as they are, each times a gain; its own background is not used.
    correct : with a prior, whether harmonics are added where they predict held-out regions better.
    ridge : of the harmonics, as in `fitting.least_squares`: "evidence", "leave-one-out" or "none".

    Raises InputError for what cannot be told: coils whose currents depend on each other, a background that is like the
    currents, too few positions or rows.
    """
    if prior is not None and prior.joints:
        raise InputError(
            f"the coils of {prior.name} move: give prior=system.fixed(joints), at the joint values of the measurement"
        )
    names = _names(samples.coils, coil_names, prior)
    positions, place = places(samples)
    check_samples(samples, positions, names, background)
    workspace = workspace or (_known(prior.workspace) if prior else None) or _filled(positions)
    middle = bounding_ball(workspace)
    assert middle is not None
    centre = np.array(middle.centre)
    radius = float(np.linalg.norm(positions - centre, axis=1).max())
    drive = np.column_stack([samples.currents, np.ones(samples.count)]) if background else samples.currents
    weight = np.ones_like(samples.B) if samples.sigma is None else 1.0 / samples.sigma
    variance = None if samples.sigma is None else 1.0
    part = regions(positions)[place]

    def design(functions: Sequence[Terms]) -> CurrentDesign:
        return CurrentDesign(values_of(functions, positions), place, drive, weight)

    tried: list[CurrentFit] = []
    own: list[Terms] = []
    rest = samples.B
    if prior is not None:
        models = [coil.terms for coil in prior.coils]
        units = harmonic_units(1, radius, centre)
        gains = fit_gains(models, units, design([*models, *units]), samples.B, part, variance)
        tried.append(gains)
        own = [model.scaled(float(gains.table[k, k])) for k, model in enumerate(models)]
        # Harmonics describe what is left of the coils' own models: factor and correction cannot be told apart at once.
        alone = np.where(np.arange(len(gains.table))[:, None] < len(models), gains.table, 0.0)
        rest = samples.B - gains.design.field(alone.ravel())
    if prior is None or correct:
        for stage in _stages(degrees, samples, positions, drive.shape[1]):
            units = harmonic_units(max(stage), radius, centre)
            tried += fit_degrees(units, design(units), rest, part, stage, ridge, variance)
            if min(tried, key=lambda one: one.score).degree < max(stage):
                break
    if not tried:
        raise InputError(
            f"{samples.count} rows at {len(positions)} positions are too few for {samples.coils} coils"
            f"{' and a background' if background else ''} [{samples.source}]"
        )
    chosen = smallest_of_the_best(tried)
    corrected = bool(own) and chosen.degree > 0
    fields = [chosen.of_drive(k) for k in range(samples.coils)]
    # Of the prior's models the gains' fit holds them already, a correction holds what comes on top.
    terms = [_sum(own[k] if corrected else None, one) for k, one in enumerate(fields)]
    system = CoilSystem(
        name=name or (prior.name if prior else f"calibration of {samples.source or 'a system'}"),
        coils=_coils(names, terms, workspace, prior),
        background=chosen.of_drive(samples.coils) if background else None,
        workspace=workspace,
        source=f"calibrated from {samples.source or 'samples'}",
    )
    report = calibration_report(samples, system, positions, place, tried, chosen, rest)
    if prior is not None:
        report["gains"] = gain_report(tried[0], names)
    provenance = {
        "source": "measured samples",
        "samples": {"source": samples.source, "rows": samples.count, "positions": len(positions)},
        "prior": prior.name if prior else None,
        **versions_and_date(),
    }
    _tell(report)
    return Calibration(replace(system, report=report, provenance=provenance), chosen.functions, chosen.covariance)


def _names(coils: int, given: Sequence[str] | None, prior: CoilSystem | None) -> list[str]:
    if prior is not None and len(prior.coils) != coils:
        raise InputError(f"the samples have currents of {coils} coils, and {prior.name} has {len(prior.coils)}")
    if given is None:
        return [coil.name for coil in prior.coils] if prior else [f"Coil_{k}" for k in range(coils)]
    if len(given) != coils:
        raise InputError(f"the samples have currents of {coils} coils, and {len(given)} names are given")
    return list(given)


def _stages(
    degrees: Sequence[int] | int | None, samples: SystemSamples, positions: Points, drives: int
) -> Iterator[list[int]]:
    """Degrees to try one after the other, as many as the samples can decide."""
    wanted = _STAGES if degrees is None else (((degrees,) if isinstance(degrees, int) else tuple(degrees)),)
    if not all(stage and all(1 <= degree <= HIGHEST_DEGREE for degree in stage) for stage in wanted):
        raise InputError(f"degrees of harmonics are whole numbers from 1 to {HIGHEST_DEGREE}, got {degrees!r}")
    for stage in wanted:
        feasible = []
        for degree in sorted(set(stage)):
            count = degree * (degree + 2)
            enough = count <= _FILLED * 3 * len(positions) and count * drives <= _FILLED * 3 * samples.count
            if enough and count * drives <= _MOST_PARAMETERS:
                feasible.append(degree)
        if feasible:
            yield feasible


def _known(workspace: Region) -> Ball | Box | None:
    return workspace if isinstance(workspace, Ball | Box) else None


def _filled(positions: Points) -> Ball | Box:
    """What positions (q, 3) fill: a ball where none is near a corner of the box about them, else that box."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    thick = _THICK * float((high - low).max())
    flat = high - low < thick
    low, high = np.where(flat, low - thick / 2, low), np.where(flat, high + thick / 2, high)
    centre, half = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    reach = float(np.linalg.norm(positions - centre, axis=1).max())
    if reach < _ROUND * half and not flat.any():
        x, y, z = centre.tolist()
        return Ball((x, y, z), reach)
    return Box(tuple(low.tolist()), tuple(high.tolist()))


def _coils(
    names: Sequence[str], terms: Sequence[Terms], workspace: Ball | Box, prior: CoilSystem | None
) -> tuple[SystemCoil, ...]:
    limits = [coil.current_limit for coil in prior.coils] if prior else [None] * len(names)
    return tuple(
        SystemCoil(name, one, workspace, current_limit=limit)
        for name, one, limit in zip(names, terms, limits, strict=True)
    )


def _sum(first: Terms | None, second: Terms | None) -> Terms:
    """The sum of what there is."""
    return concatenate([one for one in (first, second) if one is not None])


def _tell(report: dict[str, Any]) -> None:
    """The result in a line, and what to beware of."""
    rms = report["heldout"]["B"]["absolute_rms"]
    log.info(
        "calibrate: %s, %d parameters, held-out residual %.2g mT", report["label"], report["parameters"], 1e3 * rms
    )
    if report["uncertainty"]["bias_dominates"]:
        log.warning("calibrate: the model's own error is larger than the noise: deviations say too little")
    for coil in report["saturation"]["saturates"]:
        log.warning("calibrate: %s saturates: its field is not linear in its current", coil)
