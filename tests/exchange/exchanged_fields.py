"""Fields of every kind of source for the exports, and points to compare them at."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.fields import Evaluated, Shell
from magfem.fields.field import Field, Unit
from magfem.fields.hull import BoxHull, CylinderHull
from magfem.fields.region import Region
from magfem.fields.term_kinds import HARMONIC, INTERIOR, NAMES, OBLATE
from magfem.fields.terms import (
    HIGHEST_DEGREE,
    Terms,
    charge_discs,
    closed_path,
    concatenate,
    frame_about,
    harmonics,
    loops,
    uniform,
)
from magfem.typing import Floats, Jet, Points

SHELL = Shell(CylinderHull(diameter=4e-3, length=1e-3), clearance=0.5e-3, extent=6e-3)
TILTED = frame_about(np.array([0.3, -0.5, 0.8]), np.array([1.0, 0.4, 0.1]))
POSE = RigidTransform.from_components([1e-3, -2e-3, 0.5e-3], Rotation.from_rotvec([0.4, -1.3, 0.9]))


@dataclass(frozen=True)
class TermsField(Evaluated):
    """Terms with a region: the shape of every fitted model."""

    lowered: Terms
    region: Region = SHELL
    unit: Unit = "T"
    name: str = "terms"
    report: dict[str, Any] = field(default_factory=dict)

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.lowered.jet(points, order)


def _every_harmonic(top: int) -> tuple[list[int], list[int], list[bool]]:
    sides = [(order, sine) for order in range(top + 1) for sine in (False, True) if order or not sine]
    chosen = [(degree, *side) for degree in range(1, top + 1) for side in sides if side[0] <= degree]
    degrees, orders, sines = zip(*chosen, strict=True)
    return list(degrees), list(orders), list(sines)


def _oblate() -> Terms:
    degree, sine = [0, 1, 1, 2, 4, 7], [True, False, True, True, False, True]
    values = [0.3, -0.2, 0.05, 0.02, 0.01, 3e-4]
    return harmonics(1.1e-3, degree, [0] * 6, sine, values, [1e-4, 0, -2e-4], TILTED, OBLATE)


def _octagon() -> Points:
    angle = np.arange(8) * np.pi / 4
    return np.column_stack([2e-3 * np.cos(angle), 1.5e-3 * np.sin(angle), 3e-4 * (-1.0) ** np.arange(8)])


def _kinds() -> dict[str, Terms]:
    rng = np.random.default_rng(1)
    centres = np.column_stack([np.zeros((4, 2)), np.linspace(-4e-4, 4e-4, 4)])
    every = _every_harmonic(6)
    signs = np.array([1.0, -1.0])
    return {
        "loops": loops(centres, np.full(4, 2e-3), rng.normal(size=4) * 100),
        "tilted loop": loops([[3e-4, 2e-4, -1e-4]], 1.7e-3, 60.0, TILTED),
        "axial harmonics": harmonics(1.5e-3, [1, 2, 3, 6], [0] * 4, [False] * 4, [0.3, 0.1, -0.05, 0.01]),
        "transverse harmonics": harmonics(1e-3, [1, 3, 5], [1] * 3, [False, True, False], [0.4, 0.1, 0.02]),
        "all harmonics": harmonics(1e-3, *every, rng.normal(size=len(every[0])) * 0.1, [1e-4, 2e-4, 0], TILTED),
        "one harmonic of degree 24": harmonics(2e-3, [24], [17], [True], [0.7]),
        "interior harmonics": harmonics(5e-3, *every, rng.normal(size=len(every[0])) * 0.1, None, TILTED, INTERIOR),
        "uniform": uniform([0.01, -0.02, 0.03]),
        "oblate": _oblate(),
        "closed path": closed_path(_octagon(), 12.0, [1e-4, -1e-4, 2e-4], TILTED),
        "charge discs": charge_discs([[0, 0, 5e-4], [0, 0, -5e-4]], 2e-3, 1.2 * signs),
        "tilted charge discs": charge_discs((5e-4 * signs)[:, None] * TILTED[:, 2], 1.5e-3, 0.9 * signs, TILTED),
    }


KINDS = _kinds()
KINDS["everything"] = concatenate(list(KINDS.values()))
assert set(KINDS["everything"].kind) == set(NAMES)  # a new kind of term must come here, and to every export


def fields() -> dict[str, Field]:
    """Every kind, placed, scaled and summed ones, and the committed models."""
    terms = {name: TermsField(part, name=name) for name, part in KINDS.items()}
    top = HIGHEST_DEGREE
    for kind, name in ((HARMONIC, "exterior"), (INTERIOR, "interior")):
        highest = harmonics(4e-3, [top] * 3, [0, 1, top], [False, True, True], [0.1, 0.2, 0.3], kind=kind)
        terms[f"{name} harmonics of the highest degree"] = TermsField(highest)
    box = TermsField(KINDS["uniform"], Shell(BoxHull((2e-3, 3e-3, 1e-3)), 0.5e-3, 9e-3))
    composed = terms["everything"].at(POSE) * -0.5 + box
    committed = {name: magfem.load_model(name) for name in ("ring_magnet_4x1.5x1", "rotor_1x3")}
    return {**terms, "placed, scaled and summed": composed, **committed}


FIELDS = fields()


def points_of(name: str, count: int = 500) -> Points:
    """Random points (count, 3) m of a shell that all kinds' sources lie within, or of the model's own region."""
    model = FIELDS[name]
    region = model.region if isinstance(model.region, Shell) else Shell(SHELL.hull, 2e-3, 6e-3)
    chosen: Points = region.layers(np.random.default_rng(3), 25, math.ceil(count / 25)).reshape(-1, 3)[:count]
    return chosen


def worst(found: Floats, true: Floats) -> float:
    """Largest |found − true| / |true|, each point's vector or tensor by its norm."""
    axes = tuple(range(1, true.ndim))
    difference = np.sqrt(np.sum((found - true) ** 2, axis=axes))
    return float((difference / np.sqrt(np.sum(true**2, axis=axes)).clip(1e-300)).max())
