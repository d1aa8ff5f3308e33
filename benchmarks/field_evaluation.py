"""Sources and field models at a million points, and at one: `python benchmarks/field_evaluation.py [section …]`.

The process keeps to one core and counts its processor time; what is compared takes turns, so that a busy machine
disturbs little, and disturbs all alike. Beside every source stands magpylib's closed form of the same object, where it
has one, or of the magnet that the source models: B alone, for magpylib has no derivatives. What a gradient would cost
it is five evaluations: B, and central differences along x and y; div B = 0 and curl B = 0 give the rest. What is slow
is timed at fewer points and scaled.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import process_time, thread_time_ns
from typing import Any

import magpylib
import numpy as np
from tables import alternate, show

import magfem
from magfem.fields.term_kinds import INTERIOR, OBLATE
from magfem.fields.terms import Terms, charge_discs, closed_path, concatenate, harmonics, loops

MILLION, FEWER, REPEATS = 1_000_000, 50_000, 7
DIFFERENCES = 5
"""Evaluations of B that a gradient costs a program without derivatives, B itself among them."""

Magpylib = Callable[[], Any]


def on_one_core() -> None:
    """Keep this process to one of its cores, where the system allows it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def points_of(name: str = "ring_magnet_4x1.5x1") -> np.ndarray:
    """A million points of a device's region, nearer to the device more."""
    region = magfem.load_model(name).region
    return region.layers(np.random.default_rng(0), 1000, MILLION // 1000).reshape(-1, 3)


# Single kinds of sources


@dataclass(frozen=True)
class Source:
    """Sources in the size of the ring (of the rotor, where they are transverse), and magpylib's.

    wanted: points per second, 10⁶, that are the target.  fewer: at how many points ours is timed.  same: whether
    magpylib's is the same object, which is then checked, or only of the same kind.  across: whether the points are
    the rotor's rather than the ring's.
    """

    name: str
    terms: Terms
    peer: str = ""
    magpylib: Magpylib | None = None
    wanted: float | None = None
    fewer: int = MILLION
    same: bool = False
    across: bool = False


def six_poles() -> Source:
    terms = harmonics(2e-3, range(1, 7), [0] * 6, [False] * 6, [0.1, 0.02, -0.03, 0.01, 0.004, -0.002])
    return Source("six poles", terms, "Dipole: one pole", lambda: magpylib.misc.Dipole(moment=(0, 0, 1e-2)), 10)


def twenty_loops() -> Source:
    heights, radii = np.meshgrid(np.linspace(-0.5e-3, 0.5e-3, 10), [2e-3, 0.75e-3], indexing="ij")
    heights, radii = heights.ravel(), radii.ravel()
    currents = np.random.default_rng(1).normal(size=20) * 50
    centres = np.column_stack([np.zeros((20, 2)), heights])

    def peer() -> Any:
        made = [
            magpylib.current.Circle(diameter=2 * r, current=i, position=(0, 0, z))
            for r, i, z in zip(radii, currents, heights, strict=True)
        ]
        return magpylib.Collection(made)

    return Source("20 coaxial loops", loops(centres, radii, currents), "20 Circle", peer, 1.5, same=True)


def rotor_magnet() -> Any:
    return magpylib.magnet.Cylinder(dimension=(1e-3, 3e-3), polarization=(1.42, 0, 0))


def disc_magnet() -> Any:
    return magpylib.magnet.Cylinder(dimension=(4e-3, 1e-3), polarization=(0, 0, 1.35))


def transverse(parts: tuple[bool, ...]) -> Source:
    """Order 1 (|m| = 1), degrees 1 to 9: cosines, or sines as well."""
    degree, sine = [n for part in parts for n in range(1, 10)], [part for part in parts for _ in range(9)]
    values = np.random.default_rng(2).normal(size=len(degree)) * 0.1
    which = "cosines" if len(parts) == 1 else "cosines and sines"
    terms = harmonics(1.58e-3, degree, [1] * len(degree), sine, values)
    return Source(f"order 1 to degree 9, {which}", terms, "Cylinder, across its axis", rotor_magnet, 5, across=True)


def oblate_discs() -> Source:
    index = [(n, True) for n in range(4)] + [(n, False) for n in range(1, 5)]
    degree, imaginary = [n for n, _ in index], [part for _, part in index]
    values = np.random.default_rng(3).normal(size=8) * 0.1
    discs = [harmonics(1.4e-3, degree, [0] * 8, imaginary, values, [0, 0, z], kind=OBLATE) for z in (-4e-4, 0, 4e-4)]
    return Source("three oblate discs to degree 4", concatenate(discs), "Cylinder, along its axis", disc_magnet)


def path() -> Source:
    """A flat spiral of ten turns and the way back below it, 1000 corners."""
    angle = np.linspace(0, 20 * np.pi, 998)
    radius = np.linspace(0.5e-3, 2e-3, 998)
    spiral = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(998, 0.2e-3)])
    nodes = np.concatenate([spiral, [[2e-3, 0, -0.2e-3], [0.5e-3, 0, -0.2e-3]]])
    closed = np.concatenate([nodes, nodes[:1]])
    peer = lambda: magpylib.current.Polyline(vertices=closed, current=1.0)  # noqa: E731
    return Source("closed path of 1000 nodes", closed_path(nodes), "Polyline", peer, fewer=20_000, same=True)


def two_charge_discs() -> Source:
    terms = charge_discs([[0, 0, 0.5e-3], [0, 0, -0.5e-3]], 2e-3, [1.35, -1.35])
    return Source("two charge discs", terms, "Cylinder, along its axis", disc_magnet, same=True)


def interior() -> Source:
    index = [(n, m, part) for n in range(1, 6) for m in range(n + 1) for part in (False, True)[: 1 + (m > 0)]]
    degree, order, sine = (list(column) for column in zip(*index, strict=True))
    values = np.random.default_rng(4).normal(size=len(index)) * 0.1
    return Source(
        f"interior harmonics to degree 5 ({len(index)})", harmonics(8e-3, degree, order, sine, values, kind=INTERIOR)
    )


def sources() -> None:
    """Kinds of sources as `Terms.jet` evaluates them, beside magpylib."""
    points = points_of(), points_of("rotor_1x3")
    listed = [six_poles(), twenty_loops(), transverse((False,)), transverse((False, True))]
    listed += [oblate_discs(), path(), two_charge_discs(), interior()]
    rows = []
    for source in listed:
        own = points[source.across]
        few, fewest = own[:: MILLION // source.fewer], own[:: MILLION // min(FEWER, source.fewer)]
        runs: list[Callable[[], object]] = [partial(source.terms.jet, few, order) for order in (0, 1)]
        counts = [len(few)] * 2
        if source.magpylib is not None:
            theirs = source.magpylib()
            slow = fewest if len(source.terms.nodes) == 0 else fewest[::20]
            runs.append(partial(theirs.getB, slow))
            counts.append(len(slow))
            if source.same:
                assert np.allclose(theirs.getB(slow), source.terms.jet(slow, 0)[0], rtol=1e-6, atol=1e-9), source.name
        alternate(runs, 1)
        seconds = alternate(runs, REPEATS, process_time)
        speeds = [count / taken / 1e6 for count, taken in zip(counts, seconds, strict=True)]
        row = [source.name, *(f"{speed:.3g}" for speed in speeds[:2]), f"≥ {source.wanted:g}" if source.wanted else "–"]
        if len(speeds) == 3:
            ratios = speeds[0] / speeds[2], DIFFERENCES * speeds[1] / speeds[2]
            row += [source.peer, f"{speeds[2]:.3g}", f"{speeds[2] / DIFFERENCES:.3g}", *(f"{r:.3g}" for r in ratios)]
        else:
            row += ["–"] * 5
        rows.append(row)
    header = [
        "sources",
        "B",
        "B + gradient",
        "target",
        "magpylib",
        "B",
        "B + gradient",
        "ratio, B",
        "ratio, B + gradient",
    ]
    show(f"10⁶ points per CPU second on one core, median of {REPEATS}", header, rows)


# Whole models


def ring_segment() -> Any:
    """The ring as magpylib has it."""
    return magpylib.magnet.CylinderSegment(dimension=(0.75e-3, 2e-3, 1e-3, 0, 360), polarization=(0, 0, 1.35))


def ring_difference() -> Any:
    """The ring as a cylinder less its bore: magpylib's faster way."""
    cylinder = magpylib.magnet.Cylinder
    return magpylib.Collection(
        cylinder(dimension=(4e-3, 1e-3), polarization=(0, 0, 1.35)),
        cylinder(dimension=(1.5e-3, 1e-3), polarization=(0, 0, -1.35)),
    )


def models() -> None:
    """The committed models through their public interface, region included, beside magpylib's rigid magnets."""
    rows = []
    for name, peers in (
        ("ring_magnet_4x1.5x1", {"CylinderSegment": ring_segment(), "Cylinder − Cylinder": ring_difference()}),
        ("rotor_1x3", {"Cylinder": rotor_magnet()}),
    ):
        model, points = magfem.load_model(name), points_of(name)
        few = points[:: MILLION // FEWER]
        runs: list[Callable[[], object]] = [partial(model.jet, points, order) for order in range(3)]
        runs += [partial(source.getB, few) for source in peers.values()]
        alternate(runs, 1)
        seconds = alternate(runs, REPEATS, process_time)
        labels = ["magfem, B", "magfem, B + gradient", "magfem, B + gradient + hessian"]
        labels += [f"magpylib {label}, B" for label in peers]
        seconds[3:] = [taken * MILLION / FEWER for taken in seconds[3:]]
        fastest = min(seconds[3:])
        for label, taken in zip(labels, seconds, strict=True):
            rows.append([name, label, f"{taken:.2f}", f"{MILLION / taken / 1e6:.2f}", f"{fastest / taken:.1f}"])
    header = ["device", "what", "CPU s per 10⁶ points", "10⁶ points per CPU s", "times magpylib's fastest"]
    show(f"Models, median of {REPEATS}", header, rows)


# One point


def single() -> None:
    """Calls with one point, as a control loop makes them."""
    ring, rotor, bigmag = (
        magfem.load_model("ring_magnet_4x1.5x1"),
        magfem.load_model("rotor_1x3"),
        magfem.load_system("bigmag"),
    )
    near, far, origin = np.array([0.5e-3, 0.2e-3, 3e-3]), np.array([0.5e-3, 0.2e-3, 6e-3]), np.zeros(3)
    currents = np.linspace(-3.0, 3.0, 6)
    fixed = bigmag.at(currents)
    cylinder, dipole = disc_magnet(), magpylib.misc.Dipole(moment=(0, 0, 1e-2))
    calls = {
        f"ring, {ring.lowered.kind.size} loops: `model.jet(point)`": lambda: ring.jet(near),
        "ring: `model.B(point)`": lambda: ring.B(near),
        f"rotor, {rotor.lowered.degree.size} harmonics: `model.jet(point)`": lambda: rotor.jet(far),
        "rotor: `model.B(point)`": lambda: rotor.B(far),
        "BigMag, 6 coils: `system.B(point, currents)`": lambda: bigmag.B(origin, currents),
        "BigMag at fixed currents: `field.jet(point)`": lambda: fixed.jet(origin),
        "BigMag: `system.unit_fields(point)`": lambda: bigmag.unit_fields(origin),
        "magpylib Cylinder: `getB(point)`": lambda: cylinder.getB(near),
        "magpylib Dipole: `getB(point)`": lambda: dipole.getB(near),
    }
    rows = []
    for label, call in calls.items():
        taken = microseconds(call)
        rows.append([label, f"{min(taken):.1f}", f"{median(taken):.1f}"])
    show("One point, µs of processor time per call", ["call", "least", "median"], rows)


def microseconds(call: Callable[[], object], blocks: int = 200, each: int = 100) -> list[float]:
    """µs per call in each of many blocks of calls."""
    for _ in range(each):
        call()
    taken = []
    for _ in range(blocks):
        started = thread_time_ns()
        for _ in range(each):
            call()
        taken.append((thread_time_ns() - started) / each / 1e3)
    return taken


SECTIONS = {"sources": sources, "models": models, "single": single}

if __name__ == "__main__":
    on_one_core()
    for chosen in sys.argv[1:] or SECTIONS:
        SECTIONS[chosen]()
