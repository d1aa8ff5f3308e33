"""Writing MPEM files: solid harmonics exactly (`axial_multipoles`), other terms by a fit (`harmonic_fit`).

`mag_manip` reads either A_Coeff or B_Coeff of a source and wants the other one as `~`; `mpem` says what they mean.
"""

from __future__ import annotations

import json
import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from magfem.actuation.axial_multipoles import AxialMultipole, axial_multipoles
from magfem.actuation.coil_system import CoilSystem
from magfem.actuation.harmonic_fit import as_harmonics
from magfem.actuation.mpem import OFFSET
from magfem.errors import ConvergenceError, InputError
from magfem.fields.field import Field
from magfem.fields.region import Region, Shell
from magfem.fields.region_parts import bounding_box
from magfem.fields.terms import Terms
from magfem.fields.workspace_region import Ball, Box
from magfem.files import write_text
from magfem.fitting.about import facts
from magfem.typing import ArrayLike, Floats
from magfem.units import format_quantity, one_line

log = logging.getLogger("magfem")

TOLERANCE = 0.01
"""Largest relative error of B that a fit may leave, unless told otherwise."""


@dataclass(frozen=True)
class MpemExport:
    """What was written.

    exact: whether every term went over as it is, up to rounding.  maximum, rms: relative errors of B (norm of
    `fields.norms`) at points of the region that were not fitted, the worst coil's, the maximum with a margin as in
    `harmonic_fit`; zero when exact.
    residuals: (maximum, rms) by coil.  sources: how many the file has.  region: where the residual was measured.
    """

    path: Path
    exact: bool
    maximum: float
    rms: float
    residuals: dict[str, tuple[float, float]]
    sources: int
    region: str


def write_mpem(
    source: CoilSystem | Field,
    path: str | Path,
    workspace: Region | None = None,
    tolerance: float = TOLERANCE,
    strict: bool = True,
    joints: ArrayLike | None = None,
) -> MpemExport:
    """Write a coil system, or one coil's model, as an MPEM calibration file.

    source: a system; a model in T/A becomes a system of one coil, a field in T a background (`Offset`) without
    coils.  workspace: a Ball or Box where the file is to hold; by default the system's workspace or the model's
    region. `Workspace_Dimensions` are the box, the cube within the ball, or the box around a shell about a body.
    tolerance: of the fit, if one is needed, relative.  strict: whether a larger residual is refused
    (ConvergenceError) or written all the same.  joints: (j,) rad or m, of a system whose coils move: the file holds
    there alone, and its first lines say so.

    Raises InputError for a field without terms, and where no workspace is known.
    """
    header = []
    if isinstance(source, CoilSystem):
        values, moving = source.checked_joints(joints).tolist(), source.joints
        if moving:
            stated = zip(moving, values, strict=True)
            places = [f"{one.name} = {format_quantity(value, one.dimension)}" for one, value in stated]
            header = [f"With the joints at {', '.join(places)}."]
        source = source.fixed(joints)
    elif joints is not None:
        raise InputError("joints are those of a coil system, and this is one field")
    name, parts, region = _parts(source)
    region = workspace or region
    box = _workspace_box(region)
    fits = {label: as_harmonics(terms, region, tolerance) for label, terms in parts.items()}
    worst = max(fits, key=lambda label: fits[label].maximum)
    maximum, rms = fits[worst].maximum, fits[worst].rms
    exact = maximum == 0
    outcome = "exact" if exact else f"fitted, relative error of B at most {maximum:.1e}, {rms:.1e} RMS"
    if maximum > tolerance and strict:
        raise ConvergenceError(
            f"axial multipoles describe {worst} of {name} to {maximum:.2g} of B at best, more than the tolerance of "
            f"{tolerance:.2g}: choose a smaller workspace or a larger tolerance"
        )
    file = Path(path)
    lines = [f"{name}, written by magfem.", f"Per ampere, in T/A; {outcome}; region: {region.describe()}.", *header]
    written = {label: axial_multipoles(fit.terms) for label, fit in fits.items()}
    write_text(file, _text(name, written, box, lines))
    count = sum(map(len, written.values()))
    log.info("mpem: %d sources, %s", count, outcome)
    residuals = {label: (fit.maximum, fit.rms) for label, fit in fits.items()}
    return MpemExport(file, exact, maximum, rms, residuals, count, region.describe())


def _parts(source: CoilSystem | Field) -> tuple[str, dict[str, Terms], Region]:
    """Name, terms by the file's names of coils, and where the file is to hold."""
    if isinstance(source, CoilSystem):
        labels = _labels([coil.name for coil in source.coils])
        parts = {label: coil.terms for label, coil in zip(labels, source.coils, strict=True)}
        if source.background is not None:
            parts[OFFSET] = source.background
        return source.name, parts, source.workspace
    terms: Terms | None = getattr(source, "lowered", None)
    if not isinstance(source, Field) or terms is None:
        raise InputError("write_mpem takes a coil system, a fitted model, or a field made of such")
    return facts(source)["name"], {"Coil_0" if source.unit == "T/A" else OFFSET: terms}, source.region


def _labels(names: list[str]) -> list[str]:
    """The coils' names where they are of the usual form, else Coil_0, Coil_1, …"""
    usual = all(re.fullmatch(r"Coil_\w+", name, re.ASCII) and OFFSET not in name for name in names)
    return names if usual else [f"Coil_{k}" for k in range(len(names))]


def _workspace_box(region: Region) -> Box:
    """The file's workspace."""
    if isinstance(region, Box):
        return region
    if isinstance(region, Ball):
        half = region.radius / np.sqrt(3)
        low, high = np.array(region.centre) - half, np.array(region.centre) + half
        return Box(tuple(low.tolist()), tuple(high.tolist()))
    if isinstance(region, Shell):
        low, high = bounding_box(region)
        return Box(tuple(low.tolist()), tuple(high.tolist()))
    raise InputError(f"an MPEM file states a workspace: give a Ball or a Box instead of {region.describe()}")


def _text(name: str, coils: dict[str, list[AxialMultipole]], box: Box, header: list[str]) -> str:
    lines = [f"# {one_line(line)}" for line in header]
    lines += [f"System_Name: {json.dumps(one_line(name), ensure_ascii=False)}", "Workspace_Dimensions:"]
    lines += [f"  - [{_number(low)}, {_number(high)}]" for low, high in zip(box.low, box.high, strict=True)]
    lines += ["Coil_List:", *(f"  - {label}" for label in coils)]
    for label, sources in coils.items():
        lines += [f"{label}:", "  Source_List:", *(f"    - Src_{k}" for k in range(len(sources)))]
        for k, source in enumerate(sources):
            used, other = ("A_Coeff", "B_Coeff") if source.interior else ("B_Coeff", "A_Coeff")
            lines += [
                f"  Src_{k}:",
                f"    {other}: ~",
                f"    {used}: {_numbers(source.coefficients)}",
                f"    Source_Direction: {_numbers(source.direction)}",
                f"    Source_Position: {_numbers(source.position)}",
            ]
    return "\n".join(lines) + "\n"


def _numbers(values: Floats) -> str:
    return f"[{', '.join(map(_number, values.tolist()))}]"


def _number(value: float) -> str:
    """A float with all its bits, and always with a dot: to YAML 1.1, 1e-07 is a text."""
    text = repr(float(value))
    mantissa, exponent, power = text.partition("e")
    return text if "." in mantissa else f"{mantissa}.0{exponent}{power}"
