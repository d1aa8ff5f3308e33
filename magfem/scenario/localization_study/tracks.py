"""Fig. 6.7: a rotor followed along cubic, helical, sinusoidal and random paths, by several methods."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.geometry.card import Table
from magfem.localization import Sensor, as_rotor, simulated_samples, track
from magfem.localization.isolines import isoline_functions
from magfem.localization.published import track_as_published
from magfem.scenario.angles import between
from magfem.scenario.localization_study.noise import Noise, read_noise
from magfem.scenario.localization_study.poses import root_mean_square
from magfem.scenario.localization_study.sampling import Sampling, read_frequency, read_sampling
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats, Points, Vectors

log = logging.getLogger("magfem")

MILLI = 1e3
WRONG = (0.3, np.radians(45.0))
"""Of the distance, and rad: a pose farther off than this is of a wrong branch."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackStudy:
    """What is asked.

    spacing: m between the two sensors, along x about the origin.  windows: on each path, of `sampling`, one after the
    other.  random_paths: how many of these.  nearest, farthest: m from the middle of the sensors, of all paths.
    """

    model: str
    noise: Noise
    spacing: float
    windows: int
    random_paths: int
    nearest: float
    farthest: float
    frequency: float
    sampling: Sampling
    seed: int

    @property
    def sensors(self) -> tuple[Sensor, Sensor]:
        """The pair."""
        places = [[x, 0.0, 0.0] for x in (-self.spacing / 2, self.spacing / 2)]
        first, second = (
            Sensor(
                pose=RigidTransform.from_translation(place),
                noise=self.noise.deviation,
                resolution=self.noise.resolution,
            )
            for place in places
        )
        return first, second


@dataclass(frozen=True, eq=False, kw_only=True)
class Followed:
    """What one method makes of a path: positions (w, 3) m and axes (w, 3)."""

    position: Points
    axis: Vectors


@dataclass(frozen=True, eq=False, kw_only=True)
class PathResult:
    """A path, and what is found of it: alone each window, smoothed, and as published with one sensor."""

    name: str
    position: Points
    axis: Vectors
    alone: Followed
    smoothed: Followed
    published: Followed
    process_noise: tuple[float, float]
    ambiguous: bool

    def errors(self, found: Followed) -> tuple[Floats, Floats, Floats]:
        """(w,) m of the position, rad of the direction from the middle of the sensors, rad of the axis."""
        off = np.linalg.norm(found.position - self.position, axis=-1)
        return off, between(_unit(found.position), _unit(self.position)), between(found.axis, self.axis)

    def wrong(self, found: Followed) -> int:
        """How many windows have a wrong branch."""
        off, _, turned = self.errors(found)
        return int(np.count_nonzero((off > WRONG[0] * np.linalg.norm(self.position, axis=-1)) | (turned > WRONG[1])))


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracks:
    """All paths."""

    study: TrackStudy
    paths: tuple[PathResult, ...]


def read(table: Table) -> TrackStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "spacing", "windows", "window", "random_paths", "nearest"),
        *("farthest", "frequency", "rate", "seed", "sensor"),
    )
    nearest, farthest = table.quantity("nearest", "length"), table.quantity("farthest", "length")
    if not 5e-3 < nearest < farthest < np.inf:
        raise table.error("farthest must be beyond nearest, and nearest beyond 5 mm", "farthest")
    sampling = read_sampling(table, "window")
    return TrackStudy(
        model=table.text("model"),
        noise=read_noise(table.table("sensor")),
        spacing=table.quantity("spacing", "length"),
        windows=whole_number(table, "windows", 100, 8),
        random_paths=whole_number(table, "random_paths", 2, 0),
        nearest=nearest,
        farthest=farthest,
        frequency=read_frequency(table, sampling),
        sampling=sampling,
        seed=whole_number(table, "seed", 0, 0),
    )


def run(study: TrackStudy) -> Tracks:
    """All paths, one after the other."""
    paths: list[tuple[str, Callable[[TrackStudy], tuple[Points, Vectors]]]] = [
        ("cubic", cubic),
        ("helical", helical),
        ("sinusoidal", sinusoidal),
    ]
    for k in range(study.random_paths):
        paths.append((f"random {k + 1}", lambda one, k=k: random_path(one, one.seed + 100 + k)))  # type: ignore[misc]
    found = []
    for number, (name, path) in enumerate(paths):
        log.info("study: %s path", name)
        every = replace(study, windows=study.windows * study.sampling.times.size)  # a pose for every sample
        found.append(_followed(study, name, *path(every), study.seed + number))
    return Tracks(study=study, paths=tuple(found))


def _followed(study: TrackStudy, name: str, places: Points, axes: Vectors, seed: int) -> PathResult:
    """What is found of a magnet that goes on moving while samples are taken, at places and about axes (w · n, 3)."""
    rotor, sensors, times = as_rotor(study.model), study.sensors, study.sampling.times
    generator = np.random.default_rng(seed)
    phase = generator.uniform(-np.pi, np.pi, study.windows)
    places, axes = (one.reshape(study.windows, times.size, 3) for one in (places, axes))
    quiet = [one.pose for one in sensors]  # the noise is added below
    clean = np.concatenate(
        [
            simulated_samples(rotor, places[:, k], axes[:, k], times[k : k + 1], study.frequency, quiet, phase=phase)
            for k in range(times.size)
        ],
        axis=-2,
    )
    # What is true of a window is where the magnet is in its middle.
    before, after = (times.size - 1) // 2, times.size // 2
    position, axis = 0.5 * (places[:, before] + places[:, after]), _unit(axes[:, before] + axes[:, after])
    samples = study.noise.added(clean, generator)
    starts = study.sampling.duration * np.arange(len(position))
    found = track(samples, times, rotor, study.frequency, sensors, starts=starts, strict=False)
    centre = sensors[0].pose.translation
    old = track_as_published(samples[:, 0], times, isoline_functions(study.model), position[0] - centre)
    return PathResult(
        name=name,
        position=position,
        axis=axis,
        alone=Followed(position=found.poses.position, axis=found.poses.axis),
        smoothed=Followed(position=found.position, axis=found.axis),
        published=Followed(position=old.position + centre, axis=old.axis),
        process_noise=(float(found.noise.position), float(found.noise.axis)),
        ambiguous=found.ambiguous,
    )


def cubic(study: TrackStudy) -> tuple[Points, Vectors]:
    """Seven edges of a cube above the sensors, as near and as far as asked; the axis is held."""
    # A cube of side a whose lower face is at height h: the middles of its lower edges are at √(h² + a²/4), the upper
    # corners at √((h + a)² + a²/2) from the origin.
    a = study.farthest / 2
    for _ in range(60):
        h = np.sqrt(study.nearest**2 - a**2 / 4)
        a = np.sqrt(max(study.farthest**2 - a**2 / 2, 0.0)) - h
    low, high, s = h, h + a, a / 2
    corners = np.array(
        [
            [-s, -s, low],
            [s, -s, low],
            [s, s, low],
            [-s, s, low],
            [-s, s, high],
            [s, s, high],
            [s, -s, high],
            [-s, -s, high],
        ]
    )
    along = np.linspace(0, 7, study.windows)
    edge = np.minimum(along.astype(int), 6)
    part = (along - edge)[:, None]
    return corners[edge] * (1 - part) + corners[edge + 1] * part, np.tile([0.6, 0.0, 0.8], (study.windows, 1))


def helical(study: TrackStudy) -> tuple[Points, Vectors]:
    """Two turns of 8 mm radius, rising; the axis along the way."""
    u, radius = np.linspace(0, 1, study.windows), 8e-3
    low, high = np.sqrt(study.nearest**2 - radius**2), np.sqrt(study.farthest**2 - radius**2)
    position = np.stack(
        [radius * np.cos(4 * np.pi * u), radius * np.sin(4 * np.pi * u), low + (high - low) * u], axis=-1
    )
    return position, _unit(np.gradient(position, axis=0))


def sinusoidal(study: TrackStudy) -> tuple[Points, Vectors]:
    """Over the sensors at the nearest distance's height, to and fro by 4 mm; the axis along the way."""
    u, swing = np.linspace(-1, 1, study.windows), 4e-3
    height = np.sqrt(study.nearest**2 - swing**2 / 2)
    half = np.sqrt(study.farthest**2 - height**2)
    position = np.stack([half * u, swing * np.sin(2 * np.pi * u), np.full(u.shape, height)], axis=-1)
    return position, _unit(np.gradient(position, axis=0))


def random_path(study: TrackStudy, seed: int) -> tuple[Points, Vectors]:
    """Sums of a few waves of random height, pressed between the nearest and the farthest distance; so is the axis."""
    generator = np.random.default_rng(seed)
    u = np.linspace(0, 1, study.windows)[:, None]
    middle = (study.nearest + study.farthest) / 2
    swing = np.array([6e-3, 6e-3, 3e-3])
    wander = sum(
        generator.normal(size=3) * swing / k * np.sin(2 * np.pi * (k * u + generator.uniform(size=3))) for k in (1, 2)
    )
    position = np.array([0.0, 0.0, middle]) + wander
    r = np.linalg.norm(position, axis=-1, keepdims=True)
    half = (study.farthest - study.nearest) / 2
    position = position / r * (middle + half * np.tanh((r - middle) / half))
    axis = generator.normal(size=3) + 0.5 * generator.normal(size=3) * np.sin(
        2 * np.pi * (u + generator.uniform(size=3))
    )
    return position, _unit(axis)


def compared(found: Tracks) -> tuple[Comparison, ...]:
    """Smoothed tracks against their limits, and the published algorithm beside them."""
    rows = []
    for one in found.paths:
        off, _, turned = one.errors(one.smoothed)
        old = one.errors(one.published)
        rows += [
            Comparison(
                quantity=f"{one.name}: RMS error of the position, smoothed",
                found=float(MILLI * root_mean_square(off)),
                unit="mm",
                at_most=1.0,
            ),
            Comparison(
                quantity=f"{one.name}: RMS error of the axis, smoothed",
                found=float(np.degrees(root_mean_square(turned))),
                unit="deg",
                at_most=3.0,
            ),
            Comparison(
                quantity=f"{one.name}: windows of a wrong branch, smoothed",
                found=float(one.wrong(one.smoothed)),
                at_most=0.0,
            ),
            Comparison(
                quantity=f"{one.name}: RMS error of the direction, published algorithm with one sensor",
                found=float(np.degrees(root_mean_square(old[1]))),
                unit="deg",
                published="5–15° measured",
            ),
            Comparison(
                quantity=f"{one.name}: RMS error of the axis, published algorithm with one sensor",
                found=float(np.degrees(root_mean_square(old[2]))),
                unit="deg",
                published="10–40° measured",
            ),
            Comparison(
                quantity=f"{one.name}: windows of a wrong branch, published algorithm with one sensor",
                found=float(one.wrong(one.published)),
            ),
        ]
    return tuple(rows)


def arrays(found: Tracks) -> dict[str, Floats]:
    """For data.npz, SI."""
    data: dict[str, Floats] = {}
    for one in found.paths:
        key = one.name.replace(" ", "_")
        data |= {f"{key}_position": one.position, f"{key}_axis": one.axis}
        for name in ("alone", "smoothed", "published"):
            method: Followed = getattr(one, name)
            data |= {f"{key}_{name}_position": method.position, f"{key}_{name}_axis": method.axis}
    return data


def _unit(vectors: Vectors) -> Vectors:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
