"""Fig. 6.6c: errors of poses on isolines of the rotor's field, over β, beside the bound and the published algorithm."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.localization import Rotor, as_rotor, localize, pose_bound, simulated_samples
from magfem.localization.isolines import IsolineFunctions, isoline_functions
from magfem.localization.published import localize_as_published
from magfem.scenario.localization_study.noise import Noise, quantities, read_noise
from magfem.scenario.localization_study.poses import (
    drawn_poses,
    isoline_distance,
    pose_errors,
    root_mean_square,
)
from magfem.scenario.localization_study.sampling import Sampling, read_frequency, read_sampling
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats

log = logging.getLogger("magfem")

NAMES = ("position", "distance", "direction", "axis", "beta")
WELL_TOLD = (np.radians(25.0), np.radians(75.0))  # of β, by the dissertation's 6.1.3
CHECKED = (9e-6, 101e-6)  # T, isolines whose limits are checked: 6 µT is where a tenth of the poses become singular
MILLI, MICRO, DEGREE = 1e3, 1e6, 180 / np.pi


@dataclass(frozen=True, eq=False, kw_only=True)
class IsolineStudy:
    """What is asked.

    model: of the rotor.  strengths: (k,) T.  beta: (m,) rad.  draws: poses at each of them.  band_draws: poses on each
    isoline with β of 25–75°, drawn evenly.  frequency, rate: Hz.  duration: s.  limits: on these, at the isolines of
    `CHECKED`: `bound` for errors over the bound, `published_position` and `published_axis` for those of the published
    algorithm over ours.
    """

    model: str
    strengths: Floats
    beta: Floats
    noise: Noise
    draws: int
    band_draws: int
    frequency: float
    sampling: Sampling
    seed: int
    limits: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class IsolineErrors:
    """Root mean squares over the draws, (k, m) at each strength and β, in m and rad.

    distance: (k, m) m, where the isolines are.  found, published: by name in `NAMES`, ours and the published
    algorithm's on the same samples.  bound: position, distance, direction, axis.  singular: (k, m), share of the poses.
    signal_to_noise: (k, m) dB.  band_found, band_published, band_bound: (k,), over β of 25–75°.
    """

    study: IsolineStudy
    distance: Floats
    found: Mapping[str, Floats]
    published: Mapping[str, Floats]
    bound: Mapping[str, Floats]
    singular: Floats
    signal_to_noise: Floats
    band_found: Mapping[str, Floats]
    band_published: Mapping[str, Floats]
    band_bound: Mapping[str, Floats]


def read(table: Table) -> IsolineStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "strengths", "beta", "draws", "band_draws", "frequency"),
        *("rate", "duration", "seed", "sensor", "limits"),
    )
    sampling = read_sampling(table)
    return IsolineStudy(
        model=table.text("model"),
        strengths=quantities(table, "strengths", "flux density"),
        beta=quantities(table, "beta", "angle"),
        noise=read_noise(table.table("sensor")),
        draws=whole_number(table, "draws", 200, 2),
        band_draws=whole_number(table, "band_draws", 1000, 2),
        frequency=read_frequency(table, sampling),
        sampling=sampling,
        seed=whole_number(table, "seed", 0, 0),
        limits=_limits(table),
    )


def _limits(table: Table) -> dict[str, float]:
    if "limits" not in table:
        return {}
    limits = table.table("limits")
    limits.only("bound", "published_position", "published_axis")
    return {key: limits.number(key) for key in limits.values}


def run(study: IsolineStudy) -> IsolineErrors:
    """All isolines, one after the other."""
    rotor, isolines = as_rotor(study.model), isoline_functions(study.model)
    rows, bands = [], []
    for number, strength in enumerate(study.strengths):
        log.info("study: isoline of %.3g µT", strength * MICRO)
        generator = np.random.default_rng(study.seed + number)
        beta = np.broadcast_to(study.beta[:, None], (study.beta.size, study.draws))
        rows.append(_isoline(study, rotor, isolines, float(strength), beta, generator))
        band = generator.uniform(*WELL_TOLD, (1, study.band_draws))
        bands.append(_isoline(study, rotor, isolines, float(strength), band, generator))

    def stacked(found: list[dict[str, dict[str, Floats]]], name: str) -> dict[str, Floats]:
        return {key: np.stack([one[name][key] for one in found]) for key in found[0][name]}

    def over_band(name: str) -> dict[str, Floats]:
        return {key: values[:, 0] for key, values in stacked(bands, name).items()}

    said = stacked(rows, "said")
    return IsolineErrors(
        study=study,
        distance=said["distance"],
        found=stacked(rows, "found"),
        published=stacked(rows, "published"),
        bound=stacked(rows, "bound"),
        singular=said["singular"],
        signal_to_noise=said["signal_to_noise"],
        band_found=over_band("found"),
        band_published=over_band("published"),
        band_bound=over_band("bound"),
    )


def _isoline(
    study: IsolineStudy,
    rotor: Rotor,
    isolines: IsolineFunctions,
    strength: float,
    beta: Floats,
    generator: np.random.Generator,
) -> dict[str, dict[str, Floats]]:
    """Root mean squares along the second axis of poses at `beta` (m, draws)."""
    r = isoline_distance(rotor, np.asarray(strength), beta)
    true = drawn_poses(r, beta, generator)
    clean = simulated_samples(rotor, true.position, true.axis, study.sampling.times, study.frequency, phase=true.phase)
    samples = study.noise.added(clean, generator)
    sensor = study.noise.sensor
    pose = localize(samples, study.sampling.times, rotor, study.frequency, sensor, near=true.position, strict=False)
    bound = pose_bound(rotor, true.position, true.axis, sensor, times=study.sampling.times, frequency=study.frequency)
    old = localize_as_published(samples, study.sampling.times, isolines, near=true.position)
    errors, published = pose_errors(pose.position, pose.axis, true), pose_errors(old.position, old.axis, true)
    return {
        "found": {name: root_mean_square(getattr(errors, name), axis=1) for name in NAMES},
        "published": {name: root_mean_square(getattr(published, name), axis=1) for name in NAMES},
        "bound": {name: root_mean_square(getattr(bound, name), axis=1) for name in NAMES[:4]},
        "said": {
            "distance": r.mean(axis=1),
            "singular": pose.singular.mean(axis=1),
            "signal_to_noise": pose.fields[0].signal_to_noise.mean(axis=1),
        },
    }


def compared(found: IsolineErrors) -> tuple[Comparison, ...]:
    """Against the bound, the published algorithm and what was measured."""
    rows = []
    limits = found.study.limits
    for k, strength in enumerate(found.study.strengths):
        at = f"{strength * MICRO:.3g} µT, β 25–75°"
        checked = CHECKED[0] < strength < CHECKED[1]
        for name in ("position", "direction", "axis"):
            rows.append(
                Comparison(
                    quantity=f"RMS error in {name} over the Cramér–Rao bound, {at}",
                    found=float(found.band_found[name][k] / found.band_bound[name][k]),
                    at_most=limits.get("bound") if checked else None,
                )
            )
        for name in ("position", "axis"):
            rows.append(
                Comparison(
                    quantity=f"RMS error in {name}, the published algorithm’s over ours, {at}",
                    found=float(found.band_published[name][k] / found.band_found[name][k]),
                    at_least=limits.get(f"published_{name}") if checked else None,
                )
            )
        for name, scale, unit in (("position", MILLI, "mm"), ("direction", DEGREE, "deg"), ("axis", DEGREE, "deg")):
            rows.append(
                Comparison(
                    quantity=f"RMS error in {name}, {at}", found=float(scale * found.band_found[name][k]), unit=unit
                )
            )
    for name, scale, unit, published in (
        ("distance", MILLI, "mm", "≤ 7 mm, measured"),
        ("direction", DEGREE, "deg", "≤ 11°, measured"),
        ("axis", DEGREE, "deg", "≤ 23°, measured"),
    ):
        for by, values in (("ours", found.found), ("the published algorithm’s", found.published)):
            rows.append(
                Comparison(
                    quantity=f"largest RMS error in {name} over all isolines and β, {by}",
                    found=float(scale * values[name].max()),
                    unit=unit,
                    published=published,
                )
            )
    rows.append(
        Comparison(
            quantity="least signal-to-noise ratio",
            found=float(found.signal_to_noise.min()),
            unit="dB",
            published="≥ 10 dB at 6 µT",
        )
    )
    rows.append(
        Comparison(quantity="farthest", found=float(MILLI * found.distance.max()), unit="mm", published="≤ 43 mm")
    )
    return tuple(rows)


def arrays(found: IsolineErrors) -> dict[str, Floats]:
    """For data.npz, SI."""
    data = {"strengths": found.study.strengths, "beta": found.study.beta, "distance": found.distance}
    for name, values in (
        ("found", found.found),
        ("published", found.published),
        ("bound", found.bound),
        ("band_found", found.band_found),
        ("band_published", found.band_published),
        ("band_bound", found.band_bound),
    ):
        data |= {f"{name}_{key}": one for key, one in values.items()}
    return data | {"singular": found.singular, "signal_to_noise": found.signal_to_noise}
