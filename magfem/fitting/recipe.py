"""Fit recipes: which device or which samples, which family, how good."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Region, Shell
from magfem.fitting.alignment import alignment_of
from magfem.fitting.families import (
    FAMILIES,
    SAMPLE_FAMILIES,
    check_options,
    family_of,
    members,
    suitable_families,
)
from magfem.fitting.families.options import is_number, is_whole, shown
from magfem.fitting.least_squares import Ridge
from magfem.fitting.measurement import Loss, Weighting
from magfem.fitting.objective import Objective
from magfem.fitting.readings import Reading, check_readings
from magfem.geometry import Coil, Geometry
from magfem.geometry.limits import InvalidValue

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
                raise InputError(f"{complaint}, got {shown(getattr(self, key))}")
        alignment_of(self.free, 1.0)
        for family in self._families if self.options else []:
            check_options(family, self.options)
        for key, circuit in (("terms.circuit", self.options.get("circuit")), ("circuit", self.circuit)):
            if circuit is not None and self.geometry is not None:
                _check_circuit(self.geometry, circuit, key)
        region = self.region or (self.geometry.region if self.geometry else None)
        check_readings(self.measurements)
        if region:
            check_places(self.measurements, region)
        if self.family in FAMILIES and self.geometry and region:
            options = self.family_options(self.family)
            if next(members(self.family, self.geometry, region, options), None) is None:
                raise InputError(
                    f"{self.geometry.name}: no model of the family {self.family} is small enough in the region "
                    f"{region.describe()}; a larger clearance takes fewer sources"
                )

    @property
    def _families(self) -> list[str]:
        """What the recipe's options are for."""
        if self.family == SEARCH:
            return suitable_families(self.geometry) if self.geometry else list(SAMPLE_FAMILIES)
        return [self.suiting_family]

    @property
    def suiting_family(self) -> str:
        """The family that the recipe names, else what suits its device or its lack of one."""
        return self.family or (family_of(self.geometry) if self.geometry else "interior_harmonics")

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
    "geometry": (
        lambda value: value is None or isinstance(value, Geometry),
        "geometry must be a device, such as magfem.load_geometry reads",
    ),
    "family": (
        lambda value: value is None or _is_one_of(value, SEARCH, DEVICE, *FAMILIES, *SAMPLE_FAMILIES),
        f"unknown family; known: {SEARCH}, {', '.join(FAMILIES)}; for samples {DEVICE}, {', '.join(SAMPLE_FAMILIES)}",
    ),
    "options": (lambda value: _is_named(value), "options must be a dict of the family's options by name"),
    "region": (lambda value: value is None or isinstance(value, Shell), "region must be a Shell about the device"),
    "circuit": (lambda value: value is None or _is_text(value), "circuit must be the name of a circuit"),
    "target_B": (lambda value: _is_target(value), "target_B must be a relative error between 0 and 1"),
    "target_gradient": (lambda value: _is_target(value), "target_gradient must be a relative error between 0 and 1"),
    "objective": (
        lambda value: _is_one_of(value, "layers", "absolute", "relative"),
        'objective must be "layers", "absolute" or "relative"',
    ),
    "most_parameters": (
        lambda value: value is None or is_whole(value, 1),
        "most_parameters must be a whole number, 1 or more",
    ),
    "seed": (lambda value: is_whole(value, 0), "seed must be a whole number, 0 or more"),
    "dimension": (lambda value: value is None or is_whole(value, 2, 3), "dimension must be 2 or 3"),
    "resolution": (lambda value: is_number(value) and value > 0, "resolution must be positive and finite"),
    "name": (lambda value: value is None or _is_text(value), "name must be a text, not blank"),
    "source": (lambda value: isinstance(value, str), "source must be a text"),
    "weighting": (
        lambda value: value is None or _is_one_of(value, "sigma", "absolute", "relative"),
        'weighting must be "sigma", "absolute" or "relative"',
    ),
    "ridge": (
        lambda value: value is None or _is_one_of(value, "none", "evidence", "leave-one-out"),
        'ridge must be "none", "evidence" or "leave-one-out"',
    ),
    "loss": (lambda value: _is_one_of(value, "squares", "huber"), 'loss must be "squares" or "huber"'),
    "heldout": (
        lambda value: value is None or _is_one_of(value, "samples", "regions"),
        'heldout must be "samples" or "regions"',
    ),
    "background": (lambda value: isinstance(value, bool), "background must be true or false"),
    "free": (
        lambda value: _is_named(value) and all(one is None or _is_pair(one) for one in value.values()),
        "free must be a dict of two bounds, or None for sensible ones, by a parameter's name",
    ),
    "samples": (lambda value: value is None or isinstance(value, SamplesFile), "samples must be a SamplesFile"),
    "measurements": (
        lambda value: isinstance(value, tuple | list) and all(isinstance(one, Reading) for one in value),
        "measurements must be a tuple of Reading",
    ),
}


def _is_one_of(value: Any, *texts: str) -> bool:
    return isinstance(value, str) and value in texts


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _is_named(value: Any) -> bool:
    return isinstance(value, Mapping) and all(isinstance(name, str) for name in value)


def _is_pair(value: Any) -> bool:
    return isinstance(value, tuple | list | np.ndarray) and len(value) == 2 and all(map(is_number, value))


def _is_target(value: Any) -> bool:
    return value is None or (is_number(value) and 0 < value < 1)


def complaint_about(key: str, value: Any) -> str:
    """What is wrong with a recipe's value; empty when nothing is."""
    if key not in _RULES:
        return ""
    holds, sentence = _RULES[key]
    return "" if holds(value) else sentence


def check_for_fields(recipe: Recipe) -> None:
    """Raise InputError when the recipe's family describes measured samples, not the field of a device."""
    if recipe.family == DEVICE or recipe.family in SAMPLE_FAMILIES:
        raise InvalidValue(
            f"the family {recipe.family} is for measured samples: name their file, or one of {', '.join(FAMILIES)}",
            "family",
        )


def check_places(measurements: Sequence[Reading], region: Region) -> None:
    """Raise InvalidValue for single readings outside the region that the model holds in."""
    for number, one in enumerate(measurements):
        if not region.contains(one.position):
            x, y, z = 1e3 * one.position
            raise InvalidValue(
                f"the measurement at ({x:.4g}, {y:.4g}, {z:.4g}) mm lies outside the model's region, "
                f"{region.describe()}",
                f"measurement[{number}].position",
            )


def _check_circuit(geometry: Geometry, name: str, key: str) -> None:
    known = [circuit.name for circuit in geometry.circuits] if isinstance(geometry, Coil) else []
    if name not in known:
        has = f"it has {', '.join(known)}" if known else "it is no coil"
        raise InvalidValue(f"{geometry.name} has no circuit {name!r}; {has}", key)
