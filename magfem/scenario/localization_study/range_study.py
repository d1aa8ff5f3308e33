"""Fig. S6.11: errors of direction and axis over the distance, for sensors of different noise, and their reach."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.localization import as_rotor, localize, pose_bound, simulated_samples
from magfem.scenario.localization_study.noise import UNIFORM, Noise, quantities
from magfem.scenario.localization_study.poses import drawn_poses, pose_errors, root_mean_square
from magfem.scenario.localization_study.sampling import Sampling, read_frequency, read_sampling
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats

log = logging.getLogger("magfem")

NANO, MILLI = 1e9, 1e3
REACH = np.radians(10.0)
"""Mean error of the direction up to which a sensor is said to reach."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RangeStudy:
    """What is asked. noises: (k,) T, largest values of uniform noise.  distances: (m,) m.  beta: (2,) rad, from, to."""

    model: str
    noises: Floats
    distances: Floats
    beta: Floats
    draws: int
    frequency: float
    sampling: Sampling
    seed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class RangeErrors:
    """(k, m) at each noise and distance, rad: means and standard deviations of errors, and root-mean-square bounds."""

    study: RangeStudy
    direction: Floats
    direction_deviation: Floats
    axis: Floats
    axis_deviation: Floats
    direction_bound: Floats
    axis_bound: Floats

    def reach(self, noise: int) -> float:
        """m, where the mean error of the direction crosses `REACH`; infinite where it does not."""
        errors, distances = self.direction[noise], self.study.distances
        above = np.flatnonzero(errors > REACH)
        if not above.size:
            return float("inf")
        k = int(above[0])
        if k == 0:
            return float(distances[0])
        low, high = np.log(errors[k - 1]), np.log(errors[k])
        share = (np.log(REACH) - low) / (high - low)
        return float(np.exp(np.log(distances[k - 1]) + share * np.log(distances[k] / distances[k - 1])))


def read(table: Table) -> RangeStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "noises", "distances", "beta", "draws", "frequency", "rate"),
        *("duration", "seed"),
    )
    beta, distances = quantities(table, "beta", "angle"), quantities(table, "distances", "length")
    if beta.shape != (2,):
        raise table.error("beta must be two angles, from and to", "beta")
    if distances.size < 2 or not np.all(np.diff(distances) > 0) or not distances[0] > 0:
        raise table.error("distances must be two or more that increase", "distances")
    sampling = read_sampling(table)
    return RangeStudy(
        model=table.text("model"),
        noises=quantities(table, "noises", "flux density"),
        distances=distances,
        beta=beta,
        draws=whole_number(table, "draws", 200, 2),
        frequency=read_frequency(table, sampling),
        sampling=sampling,
        seed=whole_number(table, "seed", 0, 0),
    )


def run(study: RangeStudy) -> RangeErrors:
    """All noises, each at all distances."""
    rotor, times = as_rotor(study.model), study.sampling.times
    found = []
    for number, size in enumerate(study.noises):
        log.info("study: noise up to %.4g nT", size * NANO)
        generator = np.random.default_rng(study.seed + number)
        noise = Noise(float(size), UNIFORM)
        shape = (study.distances.size, study.draws)
        beta = generator.uniform(study.beta[0], study.beta[1], shape)
        true = drawn_poses(np.broadcast_to(study.distances[:, None], shape), beta, generator)
        # Far beyond the model's region, where what is left of the field is its dipole's.
        clean = simulated_samples(
            rotor,
            true.position,
            true.axis,
            study.sampling.times,
            study.frequency,
            phase=true.phase,
            outside="extrapolate",
        )
        sensor = noise.sensor
        pose = localize(
            noise.added(clean, generator),
            study.sampling.times,
            rotor,
            study.frequency,
            sensor,
            near=true.position,
            strict=False,
        )
        bound = pose_bound(rotor, true.position, true.axis, sensor, times=times, frequency=study.frequency)
        errors = pose_errors(pose.position, pose.axis, true)
        found.append(
            (
                errors.direction.mean(axis=1),
                errors.direction.std(axis=1),
                errors.axis.mean(axis=1),
                errors.axis.std(axis=1),
                root_mean_square(bound.direction, axis=1),
                root_mean_square(bound.axis, axis=1),
            )
        )
    stacked = [np.stack(one) for one in zip(*found, strict=True)]
    return RangeErrors(
        study=study,
        direction=stacked[0],
        direction_deviation=stacked[1],
        axis=stacked[2],
        axis_deviation=stacked[3],
        direction_bound=stacked[4],
        axis_bound=stacked[5],
    )


def compared(found: RangeErrors) -> tuple[Comparison, ...]:
    """How far each sensor reaches, and how much less noise a longer way asks for."""
    published = {5000: "43 mm with the sensor at hand, 4000 nT", 10: "beyond 200 mm by less noise"}
    rows = []
    for k, noise in enumerate(found.study.noises):
        reach = found.reach(k)
        far = f", not within {found.study.distances[-1] * MILLI:.4g} mm" if np.isinf(reach) else ""
        rows.append(
            Comparison(
                quantity=f"noise up to {noise * NANO:.4g} nT: distance where the direction’s mean error is 10°{far}",
                found=float(MILLI * min(reach, found.study.distances[-1])),
                unit="mm",
                published=published.get(round(float(noise) * NANO), ""),
            )
        )
    return tuple(rows)


def arrays(found: RangeErrors) -> dict[str, Floats]:
    """For data.npz, SI."""
    names = ("direction", "direction_deviation", "axis", "axis_deviation", "direction_bound", "axis_bound")
    return {"noises": found.study.noises, "distances": found.study.distances} | {n: getattr(found, n) for n in names}
