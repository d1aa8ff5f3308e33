"""Fig. S6.6: the sensor's noise, and the stator's field beside the rotor's with what it does to poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.localization.stator_influence import StatorInfluence, stator_influence
from magfem.scenario.localization_study.noise import Noise, read_noise
from magfem.scenario.localization_study.sampling import Sampling, read_sampling
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats

_MICRO = 1e6


@dataclass(frozen=True, eq=False, kw_only=True)
class StatorStudy:
    """What is asked.

    model, inner, outer: of the rotor and of the stator's coils.  current: A, the amplitude.  noise: of the sensor,
    whose signal is simulated for `duration` s at `rate` Hz.
    """

    model: str
    inner: str
    outer: str
    current: float
    noise: Noise
    sampling: Sampling
    seed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class StatorResult:
    """times (n,) s and signal (n, 3) T of the sensor in a static field, mean-corrected; the stator's influence."""

    study: StatorStudy
    times: Floats
    signal: Floats
    influence: StatorInfluence


def read(table: Table) -> StatorStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "inner", "outer", "current", "rate", "duration", "seed", "sensor")
    )
    sampling = read_sampling(table)
    return StatorStudy(
        model=table.text("model"),
        inner=table.text("inner"),
        outer=table.text("outer"),
        current=table.quantity("current", "current"),
        noise=read_noise(table.table("sensor")),
        sampling=sampling,
        seed=whole_number(table, "seed", 0, 0),
    )


def run(study: StatorStudy) -> StatorResult:
    """The signal and the influence."""
    times = study.sampling.times
    earth = np.array([18e-6, 2e-6, 45e-6])  # T, about that of Twente
    signal = study.noise.added(np.tile(earth, (times.size, 1)), np.random.default_rng(study.seed))
    return StatorResult(
        study=study,
        times=times,
        signal=signal - signal.mean(axis=0),
        influence=stator_influence(study.model, study.inner, study.outer, study.current),
    )


def compared(found: StatorResult) -> tuple[Comparison, ...]:
    """Noise, ratio of the fields, and the bias of poses."""
    influence = found.influence
    ratio = influence.fields.ratio
    return (
        Comparison(
            quantity="noise of the sensor, largest",
            found=float(_MICRO * np.abs(found.signal).max()),
            unit="µT",
            published="2–4 µT measured, “about 3 µT peak”",
        ),
        Comparison(
            quantity="noise of the sensor, standard deviation",
            found=float(_MICRO * found.signal.std()),
            unit="µT",
        ),
        Comparison(
            quantity="rotor’s field over the stator’s, least",
            found=float(ratio.min()),
            published="“one to two orders”",
            at_least=10.0,
        ),
        Comparison(quantity="rotor’s field over the stator’s, largest", found=float(ratio.max())),
        Comparison(
            quantity="moment that the stator adds",
            found=float(100 * influence.added_moment),
            unit="%",
            published="“negligible”",
        ),
        Comparison(
            quantity="bias of the distance by the added field, largest",
            found=float(100 * np.abs(influence.added.distance).max()),
            unit="%",
        ),
        Comparison(
            quantity="bias of the axis by the added field, largest",
            found=float(np.degrees(influence.added.axis.max())),
            unit="deg",
        ),
        Comparison(
            quantity="swing of a rotor that follows the stator’s field, twice a turn",
            found=float(np.degrees(influence.unevenness)),
            unit="deg",
        ),
        Comparison(
            quantity="bias of the axis when it does, β = 45°, worst azimuth",
            found=float(np.degrees(influence.uneven.axis.max())),
            unit="deg",
        ),
        Comparison(
            quantity="the same with the swing found from the samples and undone",
            found=float(np.degrees(influence.mended.axis.max())),
            unit="deg",
            at_most=1.0,
        ),
    )


def arrays(found: StatorResult) -> dict[str, Floats]:
    """For data.npz, SI."""
    influence = found.influence
    return {
        "times": found.times,
        "signal": found.signal,
        "distances": influence.fields.distances,
        "rotor": influence.fields.rotor,
        "stator": influence.fields.stator,
        "added_axis_bias": influence.added.axis,
        "uneven_axis_bias": influence.uneven.axis,
        "mended_axis_bias": influence.mended.axis,
    }
