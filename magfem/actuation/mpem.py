"""MPEM calibration files: axial multipole sources in YAML, as ETH's `mag_manip` and Tesla use them.

Every coil is a list of sources with a position p, a direction d and coefficients A_n or B_n, n = 1, 2, …:

    Φ = Σ_n (A_n rⁿ + B_n / r^{n+1}) P_n(cos θ),    B = −∇Φ,

per ampere, in T/A, with r the distance from p and θ the angle to d, which is normalised on loading. A coil whose name
holds `Offset` adds its field once, in T, whatever the currents. Source: Petruska, Edelmann, Nelson 2017, IEEE Trans.
Magn. 53 (7), and `electromagnet_calibration.cpp`, `scalorPotential.cpp` of Tesla_core_public.

In `Terms` these are harmonics of order 0: g_n = B_n / a^{n+2} outside and g_n = A_n a^{n−1} inside. The reference
radius a is a power of two, so that no bit of a coefficient is lost.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from magfem.actuation.coil_system import CoilSystem, SystemCoil
from magfem.errors import CardError, InputError
from magfem.fields.term_kinds import HARMONIC, INTERIOR
from magfem.fields.terms import HIGHEST_DEGREE, Terms, concatenate, frame_about, harmonics
from magfem.fields.workspace_region import Box
from magfem.typing import Floats
from magfem.units import describe, one_line, quoted

OFFSET = "Offset"
"""What the name of the background's coil holds."""

_NOTHING = ("~", "", "null")


def read_mpem(file: Path, shown: str) -> CoilSystem:
    """The coil system of an MPEM file; `shown` is how messages name it. Raises CardError (file and key)."""
    content = _parsed(file, one_line(shown))
    top = _Node(content, shown)
    workspace = _workspace(top)
    centre = (np.array(workspace.low) + workspace.high) / 2
    names = top.get("Coil_List").texts()
    coils: list[SystemCoil] = []
    background: Terms | None = None
    for name in names:
        coil = top.get(name)
        terms = concatenate([_source(coil.get(source), centre) for source in coil.get("Source_List").texts()])
        if OFFSET not in name:
            coils.append(SystemCoil(name, terms))
        elif background is None:
            background = terms
        else:
            raise coil.error("a second background: one coil at most is named Offset")
    try:
        return CoilSystem(top.get("System_Name").text(), tuple(coils), background, workspace, f"MPEM file {file.name}")
    except InputError as error:
        raise top.error(str(error), "Coil_List") from None


def reference_radius(distance: float) -> float:
    """A power of two (m) near a distance: coefficients are turned into T and back without rounding."""
    return 2.0 ** round(math.log2(distance)) if distance > 0 else 1.0


def _source(node: _Node, centre: Floats) -> Terms:
    """One source as exterior and interior harmonics about its direction."""
    position, direction = (np.array(node.get(key).numbers()) for key in ("Source_Position", "Source_Direction"))
    for key, value in (("Source_Position", position), ("Source_Direction", direction)):
        if value.shape != (3,):
            raise node.error(f"{key} must be three numbers, got {value.size}", key)
    if not direction.any():
        raise node.error("Source_Direction must not be zero", "Source_Direction")
    radius = reference_radius(float(np.linalg.norm(position - centre)))
    frame = frame_about(direction / np.abs(direction).max())  # whose square neither overflows nor vanishes
    parts = []
    for key, kind in (("A_Coeff", INTERIOR), ("B_Coeff", HARMONIC)):
        given = np.array(node.get(key).numbers()) if key in node else np.empty(0)
        if given.size > HIGHEST_DEGREE:
            raise node.error(f"{key} has {given.size} coefficients, and {HIGHEST_DEGREE} is the highest degree", key)
        if given.size:
            degree = np.arange(1, given.size + 1)
            scaled = given * radius ** (degree - 1.0) if kind == INTERIOR else given / radius ** (degree + 2.0)
            zero = [0] * given.size
            parts.append(harmonics(radius, degree.tolist(), zero, [False] * given.size, scaled, position, frame, kind))
    if not parts:
        raise node.error("a source needs A_Coeff or B_Coeff")
    return concatenate(parts)


def _workspace(top: _Node) -> Box:
    """The box between the limits of x, y and z."""
    rows = top.get("Workspace_Dimensions")
    limits = np.array(rows.numbers())
    if limits.shape != (6,):
        raise rows.error("three pairs of limits in m, such as [[-0.01, 0.01], [-0.01, 0.01], [-0.01, 0.01]]")
    low, high = limits[::2].tolist(), limits[1::2].tolist()
    try:
        return Box(tuple(low), tuple(high))
    except InputError:
        raise rows.error("each pair must be two finite limits in m, the lower one first") from None


def _parsed(file: Path, name: str) -> Any:
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise CardError("no such file", name) from None
    except IsADirectoryError:
        raise CardError("expected an MPEM file, got a directory", name) from None
    except UnicodeDecodeError:
        raise CardError("not UTF-8 text", name) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise CardError(f"cannot be read: {reason or 'not a path'}", name) from None
    try:
        return yaml.load(text, Loader=yaml.BaseLoader)  # plain texts, lists and tables: 1e-7 and 007 as they stand
    except yaml.MarkedYAMLError as error:
        place = f": line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise CardError(f"not valid YAML: {one_line(error.problem or 'cannot be parsed')}", f"{name}{place}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise CardError(f"not valid YAML: {one_line(str(error).splitlines()[0])}", name) from None


class _Node:
    """A part of the file and where it stands, so that every complaint names file and key."""

    def __init__(self, value: Any, shown: str, path: str = "") -> None:
        self.value, self.shown, self.path = value, shown, path

    def __contains__(self, key: str) -> bool:
        return isinstance(self.value, dict) and self.value.get(key, "~") not in _NOTHING

    def error(self, message: str, key: str = "") -> CardError:
        dotted = ".".join(part for part in (self.path, key) if part)
        return CardError(message, one_line(f"{self.shown}: {dotted}" if dotted else self.shown))

    def get(self, key: str) -> _Node:
        if not isinstance(self.value, dict):
            raise self.error(f"expected a table of an MPEM file, got {describe(self.value)}")
        if key not in self.value:
            raise self.error(f"missing key {quoted(key)}", key)
        return _Node(self.value[key], self.shown, ".".join(part for part in (self.path, key) if part))

    def text(self) -> str:
        """A name."""
        if not isinstance(self.value, str) or self.value in _NOTHING:
            raise self.error(f"expected a name, got {describe(self.value)}")
        return self.value

    def texts(self) -> list[str]:
        """A list of names that differ, at least one."""
        if not isinstance(self.value, list) or not self.value:
            raise self.error(f"expected a list of names, got {describe(self.value)}")
        names = [_Node(one, self.shown, self.path).text() for one in self.value]
        if len(set(names)) < len(names):
            raise self.error("a name stands twice in the list")
        return names

    def numbers(self, depth: int = 2) -> list[float]:
        """Numbers in a list, in a column of lists, or one alone."""
        if isinstance(self.value, list) and depth > 0:
            return [number for one in self.value for number in _Node(one, self.shown, self.path).numbers(depth - 1)]
        try:
            number = float(self.value)
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            raise self.error(f"expected finite numbers, got {describe(self.value)}")
        return [number]
