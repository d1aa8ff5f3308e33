"""Fig. 6.6c: errors of poses on isolines of the rotor's field, over β, beside the bound and the published algorithm."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.localization import Rotor, as_rotor, localize, pose_bound, simulated_samples
from magfem.localization.isolines import isoline_functions
from magfem.localization.published import localize_as_published
from magfem.scenario.localization_study.noise import Noise, quantities, read_noise
from magfem.scenario.localization_study.poses import (
    drawn_poses,
    isoline_distance,
    pose_errors,
    root_mean_square,
)
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Booleans, Floats

log = logging.getLogger("magfem")

NAMES = ("position", "distance", "direction", "axis", "beta")
WELL_TOLD = (np.radians(25.0), np.radians(75.0))  # of β, by the dissertation's 6.1.3
CHECKED = (9e-6, 101e-6)  # T, isolines whose limits are checked: 6 µT is where a tenth of the poses become singular
MILLI, MICRO = 1e3, 1e6


@dataclass(frozen=True, eq=False, kw_only=True)
class IsolineStudy:
    """What is asked.

    model: of the rotor.  strengths: (k,) T.  beta: (m,) rad.  draws, published_draws: poses at each of them.  frequency,
    rate: Hz.  duration: s.
    """

    model: str
    strengths: Floats
    beta: Floats
    noise: Noise
    draws: int
    published_draws: int
    frequency: float
    rate: float
    duration: float
    seed: int

    @property
    def times(self) -> Floats:
        """(n,) s."""
        return np.arange(round(self.duration * self.rate)) / self.rate


@dataclass(frozen=True, eq=False, kw_only=True)
class IsolineErrors:
    """Root mean squares over the draws, (k, m) at each strength and β, in m and rad.

    distance: (k, m) m, where the isolines are.  found, published: by name in `NAMES`; those of the published algorithm
    on the first draws.  first: what `localize` makes of these.  bound: position, distance, direction, axis.  singular:
    (k, m), share of the poses.  signal_to_noise: (k, m) dB.
    """

    study: IsolineStudy
    distance: Floats
    found: Mapping[str, Floats]
    first: Mapping[str, Floats]
    published: Mapping[str, Floats]
    bound: Mapping[str, Floats]
    singular: Floats
    signal_to_noise: Floats

    @property
    def well_told(self) -> Booleans:
        """(m,) the β that sensors tell well."""
        return np.asarray((self.study.beta >= WELL_TOLD[0] - 1e-9) & (self.study.beta <= WELL_TOLD[1] + 1e-9))


def read(table: Table) -> IsolineStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "strengths", "beta", "draws", "published_draws", "frequency"),
        *("rate", "duration", "seed", "sensor"),
    )
    return IsolineStudy(
        model=table.text("model"),
        strengths=quantities(table, "strengths", "flux density"),
        beta=quantities(table, "beta", "angle"),
        noise=read_noise(table.table("sensor")),
        draws=whole_number(table, "draws", 200, 2),
        published_draws=whole_number(table, "published_draws", 50, 2),
        frequency=table.quantity("frequency", "frequency"),
        rate=table.quantity("rate", "frequency"),
        duration=table.quantity("duration", "time"),
        seed=whole_number(table, "seed", 0, 0),
    )


def run(study: IsolineStudy) -> IsolineErrors:
    """All isolines, one after the other."""
    rotor, isolines = as_rotor(study.model), isoline_functions(study.model)
    rows = []
    for number, strength in enumerate(study.strengths):
        log.info("study: isoline of %.3g µT", strength * MICRO)
        rows.append(_isoline(study, rotor, isolines, float(strength), study.seed + number))

    def stacked(name: str) -> dict[str, Floats]:
        return {key: np.stack([row[name][key] for row in rows]) for key in rows[0][name]}

    return IsolineErrors(
        study=study,
        found=stacked("found"),
        first=stacked("first"),
        published=stacked("published"),
        bound=stacked("bound"),
        **stacked("said"),
    )


def _isoline(
    study: IsolineStudy, rotor: Rotor, isolines: object, strength: float, seed: int
) -> dict[str, dict[str, Floats]]:
    generator = np.random.default_rng(seed)
    r = isoline_distance(rotor, np.asarray(strength), study.beta)
    true = drawn_poses(r[:, None], np.broadcast_to(study.beta[:, None], (len(r), study.draws)), generator)
    clean = simulated_samples(rotor, true.position, true.axis, study.times, study.frequency, phase=true.phase)
    samples = study.noise.added(clean, generator)
    sensor = study.noise.sensor
    pose = localize(samples, study.times, rotor, study.frequency, sensor, near=true.position, strict=False)
    bound = pose_bound(rotor, true.position, true.axis, sensor, times=study.times, frequency=study.frequency)
    few = slice(0, min(study.published_draws, study.draws))
    old = localize_as_published(samples[:, few], study.times, isolines, near=true.position[:, few])  # type: ignore[arg-type]
    errors = pose_errors(pose.position, pose.axis, true)
    some = type(true)(*(one[:, few] for one in (true.position, true.axis, true.beta, true.phase)))
    published = pose_errors(old.position, old.axis, some)
    return {
        "found": {name: root_mean_square(getattr(errors, name), axis=1) for name in NAMES},
        "first": {name: root_mean_square(getattr(errors, name)[:, few], axis=1) for name in NAMES},
        "published": {name: root_mean_square(getattr(published, name), axis=1) for name in NAMES},
        "bound": {name: root_mean_square(getattr(bound, name), axis=1) for name in NAMES[:4]},
        "said": {
            "distance": r,
            "singular": pose.singular.mean(axis=1),
            "signal_to_noise": pose.fields[0].signal_to_noise.mean(axis=1),
        },
    }


def compared(found: IsolineErrors) -> tuple[Comparison, ...]:
    """Against the bound, the published algorithm and what was measured."""
    band, rows = found.well_told, []
    for k, strength in enumerate(found.study.strengths):
        at = f"{strength * MICRO:.3g} µT"
        checked = CHECKED[0] < strength < CHECKED[1] and band.any()
        for name in ("position", "direction", "axis") if band.any() else ():
            ratio = root_mean_square(found.found[name][k, band]) / root_mean_square(found.bound[name][k, band])
            rows.append(
                Comparison(
                    quantity=f"{name} error over the Cramér–Rao bound, {at}, β 25–75°",
                    found=float(ratio),
                    at_most=1.2 if checked else None,
                )
            )
        for name, least in (("position", 3.0), ("axis", 4.0)) if band.any() else ():
            ratio = root_mean_square(found.published[name][k, band]) / root_mean_square(found.first[name][k, band])
            rows.append(
                Comparison(
                    quantity=f"{name} error of the published algorithm over ours, {at}, β 25–75°",
                    found=float(ratio),
                    at_least=least if checked else None,
                )
            )
    for name, scale, unit, published in (
        ("distance", MILLI, "mm", "≤ 7 mm, measured"),
        ("direction", 180 / np.pi, "deg", "≤ 11°, measured"),
        ("axis", 180 / np.pi, "deg", "≤ 23°, measured"),
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
    for name, values in (("found", found.found), ("published", found.published), ("bound", found.bound)):
        data |= {f"{name}_{key}": one for key, one in values.items()}
    return data | {"singular": found.singular, "signal_to_noise": found.signal_to_noise}
