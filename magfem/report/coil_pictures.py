"""Which pictures the report of a coil has, drawn one after the other."""

from __future__ import annotations

import logging

import numpy as np

from magfem.fem.coil_solution import CoilSolution
from magfem.fields import Field
from magfem.geometry import Coil
from magfem.report.coil_outline import is_flat
from magfem.report.coil_scenes import FEW, coil_picture, pieces
from magfem.report.figures import Picture, field_map
from magfem.report.figures.coil_lines import line_figure
from magfem.report.figures.current_density import density_figures, density_map
from magfem.report.figures.homogeneity import homogeneity_figure
from magfem.report.figures.planes import Plane
from magfem.report.surface import Surface
from magfem.report.workplace import Workplace
from magfem.typing import Floats

_COUNTS = (56, 30)  # samples along the side of a map: near a coil of foil each of them is an integral
log = logging.getLogger("magfem")


def draw(solution: CoilSolution, place: Workplace) -> dict[str, tuple[Picture, ...]]:
    """The pictures of every section by its name; sections without a picture are left out."""
    geometry = solution.geometry
    log.info("report: device")
    found: dict[str, tuple[Picture, ...]] = {"device": (coil_picture(geometry),)}
    outlines = () if is_flat(geometry) else shells(geometry)
    log.info("report: field in planes")
    found["planes"] = tuple(
        _map(field, words, plane, outlines) for field, words in _fields(solution) for plane in place.planes
    )
    log.info("report: field along lines")
    curves = [(words, field, direction(field, place.centre)) for field, words in _fields(solution)]
    found["lines"] = tuple(line_figure(curves, line, f"through the point {place.words}") for line in place.lines)
    log.info("report: homogeneity")
    field, whose = _fields(solution)[0]
    level = [plane for plane in place.planes if _holds(plane, place)]
    found["homogeneity"] = tuple(homogeneity_figure(field, place.centre, plane, outlines, whose) for plane in level)
    maps: list[Picture] = []
    for circuit, solved in list(zip(geometry.circuits, solution.circuits, strict=True))[: _densities(solution)]:
        density = density_map(circuit, solved.currents.sheets)
        if density is not None and solved.unknowns:
            maps += density_figures(density, circuit.name)
    if maps:
        found["current"] = tuple(maps)
    return found


def direction(field: Field, point: Floats) -> Floats:
    """Unit vector (3,) of a field at a point (3,) m, without what rounding adds to its zeros; z where it vanishes."""
    B = field.B(point)
    size = float(np.linalg.norm(B))
    if size == 0:
        return np.array([0.0, 0.0, 1.0])
    unit: Floats = np.round(B / size, 4) + 0.0
    return unit / np.linalg.norm(unit)


def _fields(solution: CoilSolution) -> list[tuple[Field, str]]:
    """Every circuit apart where there are few, else all of them together."""
    if 1 < len(solution.circuits) <= FEW:
        return [(circuit, circuit.name) for circuit in solution.circuits]
    return [(solution, "1 A in every circuit" if len(solution.circuits) > 1 else "")]


def _densities(solution: CoilSolution) -> int:
    """How many circuits' current is drawn: of many equal ones, one stands for all."""
    return len(solution.circuits) if len(solution.circuits) <= FEW else 1


def _holds(plane: Plane, place: Workplace) -> bool:
    """Whether the centre lies in the plane."""
    return abs(float(place.centre["xyz".index(plane.normal_axis)]) - plane.height) < 1e-12


def _map(field: Field, words: str, plane: Plane, outlines: tuple[Surface, ...]) -> Picture:
    whose = f" of {words}" if words else ""
    number = f"_{plane.height * 1e6:.0f}" if plane.height else ""
    key = words.replace(" ", "_")
    name = f"field_{plane.horizontal}{plane.vertical}{number}{'_' + key if key else ''}"
    edges = "; outlined in white, the conductors" if outlines else ""
    return field_map(
        field,
        outlines,
        plane,
        name,
        f"|B| per ampere{whose} and field lines in the {plane.words}{edges}.",
        _COUNTS,
    )


def shells(geometry: Coil) -> tuple[Surface, ...]:
    """The turns' surfaces as triangles, a surface for every circuit."""
    found = []
    for circuit, parts in zip(geometry.circuits, pieces(geometry), strict=True):
        turns = [(points, cells) for points, cells, lead in parts if not lead]
        offsets = np.cumsum([0, *(len(points) for points, _ in turns[:-1])])
        points = np.concatenate([points for points, _ in turns])
        cells = np.concatenate([cells + offset for (_, cells), offset in zip(turns, offsets, strict=True)])
        triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
        found.append(Surface(circuit.name, points, triangles))
    return tuple(found)
