"""Localization: times per pose, ours and the published algorithm in turns: `python benchmarks/localization.py`.

One sensor, 600 samples at 20 Hz with 3 µT of noise, a rotor of 1 × 3 mm; then two sensors, tracks, and windows followed
live. The process keeps to one core and counts its processor time.
"""

from __future__ import annotations

import os
from time import process_time

import numpy as np
from scipy.spatial.transform import RigidTransform
from tables import alternate, show

from magfem.localization import (
    ProcessNoise,
    Sensor,
    as_rotor,
    demodulate,
    dipole_poses,
    follow,
    localize,
    simulated_samples,
    track,
)
from magfem.localization.isolines import isoline_functions
from magfem.localization.published import localize_as_published

TIMES = np.arange(600) / 20
POSITION, AXIS = np.array([8e-3, -6e-3, 20e-3]), np.array([0.6, 0.0, 0.8])
SENSOR = Sensor(noise=3e-6, resolution=1e-7)
PAIR = [Sensor(pose=RigidTransform.from_translation([x, 0, 0]), noise=3e-6, resolution=1e-7) for x in (-0.01, 0.01)]
BATCH = 20_000
REPEATS = 60


def main() -> None:
    """All tables."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    rotor, isolines = as_rotor("rotor_1x3"), isoline_functions("rotor_1x3")
    eight = as_rotor("rotor_1x3_dissertation")
    one = simulated_samples(rotor, POSITION, AXIS, TIMES, 1.0, SENSOR, seed=1)
    two = simulated_samples(rotor, POSITION, AXIS, TIMES[:40], 1.0, PAIR, seed=2)

    def closed() -> None:
        field = demodulate(one, TIMES, 1.0, noise=3e-6)
        dipole_poses(field.cosine, field.sine, rotor.moment)

    runs = {
        "closed form, signal included": (closed, "0.5"),
        "refined by the rotor's model": (lambda: localize(one, TIMES, rotor, 1.0, SENSOR, near=POSITION), "2"),
        "the same, eight-source model of 24 terms": (
            lambda: localize(one, TIMES, eight, 1.0, SENSOR, near=POSITION),
            "",
        ),
        "the same, frequency unknown": (lambda: localize(one, TIMES, rotor, None, SENSOR, near=POSITION), ""),
        "two sensors, 40 samples": (lambda: localize(two, TIMES[:40], rotor, 1.0, PAIR), "2"),
        "published algorithm": (lambda: localize_as_published(one, TIMES, isolines, near=POSITION), ""),
    }
    for run, _ in runs.values():
        run()
    taken = alternate([run for run, _ in runs.values()], REPEATS, process_time)
    published = taken[-1]
    show(
        "One pose",
        ["", "ms", "target", "published / this"],
        [
            [name, f"{1e3 * seconds:.2f}", target, f"{published / seconds:.1f}"]
            for (name, (_, target)), seconds in zip(runs.items(), taken, strict=True)
        ],
    )

    rng = np.random.default_rng(3)
    C, S = rng.normal(size=(2, BATCH, 3)) * 1e-5
    windows = np.repeat(one[None, :40], 2000, axis=0) + 1e-7 * rng.normal(size=(2000, 40, 3))
    batches = {
        "closed form, from quadratures": (lambda: dipole_poses(C, S, rotor.moment), BATCH, "20 000"),
        "closed form, from 40 samples": (lambda: _from_samples(windows, rotor.moment), 2000, "20 000"),
        "refined, from 40 samples": (lambda: localize(windows, TIMES[:40], rotor, 1.0, SENSOR, strict=False), 2000, ""),
        "published algorithm, from 40 samples": (
            lambda: localize_as_published(windows, TIMES[:40], isolines, near=POSITION),
            2000,
            "",
        ),
    }
    taken = alternate([run for run, _, _ in batches.values()], 5, process_time)
    show(
        "Many poses at once",
        ["", "poses/s", "target"],
        [
            [name, f"{count / seconds:,.0f}".replace(",", " "), target]
            for (name, (_, count, target)), seconds in zip(batches.items(), taken, strict=True)
        ],
    )

    u = np.linspace(0, 1, 100)
    path = np.stack([8e-3 * np.cos(9 * u), 8e-3 * np.sin(9 * u), 20e-3 + 12e-3 * u], axis=-1)
    seen = simulated_samples(rotor, path, AXIS, TIMES[:40], 1.0, PAIR, seed=4)
    noise = ProcessNoise(1e-8, 1e-6)
    first = follow(None, seen[0], TIMES[:40], rotor, 1.0, PAIR, noise=noise)
    later = {
        "track of 100 windows, process noise found": lambda: track(
            seen, TIMES[:40], rotor, 1.0, PAIR, starts=2.0 * np.arange(100)
        ),
        "one window more, live": lambda: follow(first, seen[1], TIMES[:40], rotor, 1.0, PAIR, start=2.0, noise=noise),
    }
    taken = alternate(list(later.values()), 7, process_time)
    show("Tracks", ["", "ms"], [[name, f"{1e3 * one:.1f}"] for name, one in zip(later, taken, strict=True)])


def _from_samples(windows: np.ndarray, moment: float) -> None:
    field = demodulate(windows, TIMES[:40], 1.0)
    dipole_poses(field.cosine, field.sine, moment)


if __name__ == "__main__":
    main()
