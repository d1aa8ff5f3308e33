"""Fit recipes: which device or which samples, which family, how good."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fitting.alignment import alignment_of
from magfem.fitting.families import FAMILIES, SAMPLE_FAMILIES, check_options, family_of, members
from magfem.fitting.least_squares import Ridge
from magfem.fitting.measurement import Loss, Weighting
from magfem.fitting.objective import Objective
from magfem.fitting.readings import Reading
from magfem.geometry import Coil, Geometry

SEARCH, DEVICE = "search", "device"
"""Instead of a family's name: all families that describe the device; for samples, the device's own field, scaled."""


_TARGETS = {"winding_loops": (2e-4, 2e-3), "closed_paths": (1e-3, 1e-2)}
"""Of families that would take very many sources for less, by name: B and gradient."""


@dataclass(frozen=True)
class SamplesFile:
    """Measured samples in a file: its path, what its columns are (`read_samples`), deviations in T or None."""

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    sigma: float | None = None


@dataclass(frozen=True)
class Recipe:
    """What to fit and how well.

    geometry: the device; None takes the source's.  family: a name of `families.FAMILIES`, or "search" for the best of
    all that describe the device; None takes what suits it.  options: of the family, by name.  region: where the model
    must hold; None takes the device's.  circuit: of a coil with several, by name.  target_B, target_gradient: relative
    errors to stay below; None takes 5e-5 and 5e-4, or those of the family in `_TARGETS`.  objective: "layers" (B and
    gradient, near and far alike), "absolute" (B in T, 2.8) or "relative" (every point of B against itself, 5.3).
    most_parameters: None for no limit.  seed: of the sample points.  dimension, resolution: how the command line solves
    the device first.  name: the model's; None takes the device's.  source: where the recipe's choices come from.

    For samples: weighting "sigma", "absolute" or "relative" (None: by what they state); ridge "none", "evidence" (the
    default) or "leave-one-out"; loss "squares" or "huber"; heldout "samples" or "regions" (None: by their number);
    background, a static field to be found as well; free, the parameters of `alignment.NAMES` that are free, with
    bounds or None for sensible ones; samples, where the command line finds them.  measurements: single components that
    the whole model is scaled to.
    """

    geometry: Geometry | None = None
    family: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    region: Shell | None = None
    circuit: str | None = None
    target_B: float | None = None
    target_gradient: float | None = None
    objective: Objective = "layers"
    most_parameters: int | None = None
    seed: int = 0
    dimension: int | None = None
    resolution: float = 1.0
    name: str | None = None
    source: str = ""
    weighting: Weighting | None = None
    ridge: Ridge | None = None
    loss: Loss = "squares"
    heldout: str | None = None
    background: bool = False
    free: Mapping[str, tuple[float, float] | None] = field(default_factory=dict)
    samples: SamplesFile | None = None
    measurements: tuple[Reading, ...] = ()

    def __post_init__(self) -> None:
        for key in _RULES:
            if complaint := complaint_about(key, getattr(self, key)):
                raise InputError(f"{complaint}, got {getattr(self, key)!r}")
        if self.circuit is not None and self.geometry is not None:
            _check_circuit(self.geometry, self.circuit)
        alignment_of(self.free, 1.0)
        if self.options and self.family not in (SEARCH, DEVICE):
            suiting = family_of(self.geometry) if self.geometry else "interior_harmonics"
            check_options(self.family or suiting, self.options)
        if self.family in FAMILIES and self.geometry:
            region = self.region or self.geometry.region
            next(members(self.family, self.geometry, region, self.family_options(self.family)))

    @property
    def targets(self) -> dict[str, float]:
        """Relative errors to stay below, by quantity."""
        B, gradient = _TARGETS.get(self.family or "", (5e-5, 5e-4))
        return {
            "B": B if self.target_B is None else self.target_B,
            "gradient": gradient if self.target_gradient is None else self.target_gradient,
        }

    def family_options(self, family: str) -> dict[str, Any]:
        """What the family is called with."""
        circuit = {"circuit": self.circuit} if family == "closed_paths" and self.circuit else {}
        return {**self.options, **circuit}

    def of(self, geometry: Geometry) -> Recipe:
        """The recipe for a device, its region and its family settled."""
        region, family = self.region or geometry.region, self.family or family_of(geometry)
        return replace(self, geometry=geometry, region=region, family=family)


_RULES: dict[str, tuple[Callable[[Any], bool], str]] = {
    "family": (
        lambda value: value in (None, SEARCH, DEVICE) or value in FAMILIES or value in SAMPLE_FAMILIES,
        f"unknown family; known: {SEARCH}, {', '.join(FAMILIES)}; for samples {DEVICE}, {', '.join(SAMPLE_FAMILIES)}",
    ),
    "target_B": (lambda value: value is None or 0 < value < 1, "target_B must be a relative error between 0 and 1"),
    "target_gradient": (
        lambda value: value is None or 0 < value < 1,
        "target_gradient must be a relative error between 0 and 1",
    ),
    "objective": (
        lambda value: value in ("layers", "absolute", "relative"),
        'objective must be "layers", "absolute" or "relative"',
    ),
    "weighting": (
        lambda value: value in (None, "sigma", "absolute", "relative"),
        'weighting must be "sigma", "absolute" or "relative"',
    ),
    "ridge": (
        lambda value: value in (None, "none", "evidence", "leave-one-out"),
        'ridge must be "none", "evidence" or "leave-one-out"',
    ),
    "loss": (lambda value: value in ("squares", "huber"), 'loss must be "squares" or "huber"'),
    "heldout": (lambda value: value in (None, "samples", "regions"), 'heldout must be "samples" or "regions"'),
    "most_parameters": (
        lambda value: value is None or (value >= 1 and value == int(value)),
        "most_parameters must be a whole number, 1 or more",
    ),
    "seed": (lambda value: 0 <= value < math.inf and value == int(value), "seed must be a whole number, 0 or more"),
    "dimension": (lambda value: value in (None, 2, 3), "dimension must be 2 or 3"),
    "resolution": (lambda value: 0 < value < math.inf, "resolution must be positive and finite"),
}


def complaint_about(key: str, value: Any) -> str:
    """What is wrong with a recipe's value; empty when nothing is."""
    if key not in _RULES:
        return ""
    holds, sentence = _RULES[key]
    return "" if holds(value) else sentence


def _check_circuit(geometry: Geometry, name: str) -> None:
    known = [circuit.name for circuit in geometry.circuits] if isinstance(geometry, Coil) else []
    if name not in known:
        has = f"it has {', '.join(known)}" if known else "it is no coil"
        raise InputError(f"{geometry.name} has no circuit {name!r}; {has}")
