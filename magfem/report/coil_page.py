"""The report page of a coil: what its template is given, and the template filled in."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from magfem.fem.coil_solution import CoilSolution, SolvedCircuit
from magfem.fem.drive import quadrature
from magfem.fields import Field
from magfem.geometry import Coil, describe
from magfem.report import coil_pictures, numbers
from magfem.report.coil_numbers import (
    conductor_numbers,
    coupling,
    deviation,
    field_per_watt,
    homogeneous_volume,
    largest_current,
)
from magfem.report.coil_scenes import FEW
from magfem.report.environment import environment
from magfem.report.subject import CoilSubject
from magfem.report.workplace import Workplace, workplace
from magfem.typing import Floats
from magfem.units import format_quantity
from magfem.version import __version__

log = logging.getLogger("magfem")

TEMPLATE = "coil_page.html.j2"
_HOMOGENEOUS = 0.01
_SEARCH = 32  # points along the side of a plane in which the largest field is looked for
_BALL_LIMIT = 10.0  # deviations above, which only tell that the centre has no field, are not printed


@dataclass(frozen=True)
class CircuitRow:
    """One circuit's numbers at the centre. B: (3,) T/A, slope: largest singular value of the gradient, T/m/A.

    current: largest allowed, A; None without a limit.
    """

    name: str
    solved: SolvedCircuit
    B: Floats
    slope: float
    volume: float  # m³, where B deviates by less than 1 %
    current: float | None

    @property
    def size(self) -> float:
        """|B| at the centre, T/A."""
        return float(np.linalg.norm(self.B))

    @property
    def per_watt(self) -> float:
        """T/√W at the centre."""
        return field_per_watt(self.size, self.solved.resistance)

    @property
    def density(self) -> float:
        """Largest current density at 1 A, A/m²."""
        return self.solved.crowding / self.solved.section


def render(subject: CoilSubject) -> str:
    """The whole page as HTML; nothing in it is loaded from outside."""
    place = workplace(subject.solution.geometry)
    pictures = coil_pictures.draw(subject.solution, place)
    log.info("report: page")
    filters = {"quantity": _quantity, "plain": numbers.quantity}
    return environment(filters).get_template(TEMPLATE).render(context(subject, place), pictures=pictures)


def context(subject: CoilSubject, place: Workplace) -> dict[str, Any]:
    """What the template reads, but for the pictures."""
    solution = subject.solution
    geometry = solution.geometry
    rows = [_row(solution, circuit, place) for circuit in solution.circuits[: _told(solution)]]
    limit = geometry.conductor.current_density_limit
    return {
        "title": subject.title,
        "subject": subject,
        "solution": solution,
        "place": place,
        "device": coil_facts(geometry),
        "card": describe(geometry)["card"],
        "conductors": conductor_numbers(geometry)[: _told(solution)],
        "rows": rows,
        "model": " and ".join(sorted({circuit.model for circuit in solution.circuits})),
        "limit": limit,
        "total": float(np.linalg.norm(solution.B(place.centre))),
        "inductance": _inductance(solution),
        "places": _places(solution, place),
        "heights": _heights(solution, place),
        "turning": _turning(solution, place),
        "settings": json.dumps(solution.settings, ensure_ascii=False),
        "version": __version__,
        "python": _python(subject, place),
    }


def _quantity(value: float, unit: str, digits: int = 4) -> Markup:
    """An SI value with a prefix; the machine-readable value keeps all digits."""
    return Markup('<data value="{}">{}</data>').format(repr(float(value)), numbers.quantity(value, unit, digits))


def _told(solution: CoilSolution) -> int:
    """Circuits that are told one by one: of many, the first stands for all."""
    return len(solution.circuits) if len(solution.circuits) <= FEW else 1


def coil_facts(geometry: Coil) -> dict[str, Any]:
    """Facts of the device by their names."""
    keys = (*geometry.dimensions, *getattr(geometry, "optional", ()))
    lengths = [(key, getattr(geometry, key)) for key in keys]
    facts = [(key.replace("_", " "), numbers.size(value, 6)) for key, value in lengths if value is not None]
    for key in ("turns", "layers", "rows", "columns"):
        value = getattr(geometry, key, None)
        if value is not None and not (key == "layers" and value == 1):
            facts.append((key, f"{value:g}"))
    conductor = geometry.conductor
    facts += [
        ("circuits", str(len(geometry.circuits))),
        ("volume of metal", f"{numbers.number(geometry.volume * 1e9, 4)} mm³, leads apart"),
        ("metal", f"{conductor.material} at {conductor.temperature - 273.15:.4g} °C"),
        ("resistivity", format_quantity(conductor.resistivity, "resistivity")),
        ("hull", geometry.hull.describe()),
    ]
    return {"kind": geometry.kind.replace("_", " "), "source": geometry.source, "facts": facts}


def _row(solution: CoilSolution, circuit: SolvedCircuit, place: Workplace) -> CircuitRow:
    B, gradient = circuit.jet(place.centre, 1)
    limit = solution.geometry.conductor.current_density_limit
    density = circuit.crowding / circuit.section
    return CircuitRow(
        name=circuit.name,
        solved=circuit,
        B=B,
        slope=float(np.linalg.svd(gradient, compute_uv=False)[0]),
        volume=homogeneous_volume(circuit, place.centre, place.reach, _HOMOGENEOUS),
        current=None if limit is None else largest_current(density, limit),
    )


def _inductance(solution: CoilSolution) -> dict[str, Any]:
    """The matrix, or the ranges of its entries where it is large."""
    matrix = solution.inductance
    names = [circuit.name for circuit in solution.circuits]
    count = len(names)
    away = [abs(float(matrix[i, j])) for i in range(count) for j in range(i)]
    factor = coupling(matrix)
    return {
        "names": names,
        "matrix": matrix if count <= FEW else None,
        "self": (float(matrix.diagonal().min()), float(matrix.diagonal().max())),
        "mutual": max(away, default=0.0),
        "coupling": max((abs(float(factor[i, j])) for i in range(count) for j in range(i)), default=0.0),
        "energy": solution.energy(np.ones(count)),
    }


def _whole(solution: CoilSolution) -> list[tuple[str, Field]]:
    """The fields that tables tell of: circuits where there are few, else all together."""
    if 1 < len(solution.circuits) <= FEW:
        return [(circuit.name, circuit) for circuit in solution.circuits]
    return [("" if len(solution.circuits) == 1 else "all", solution)]


def _places(solution: CoilSolution, place: Workplace) -> list[dict[str, Any]]:
    """Mean, range and deviation of |B| in every place of the workplace."""
    found = []
    for name, field in _whole(solution):
        for part in place.places:
            B = field.B(part.points)
            size = np.linalg.norm(B, axis=-1)
            apart = float(deviation(B, field.B(place.centre)).max())
            found.append(
                {
                    "circuit": name,
                    "words": part.words,
                    "mean": float(size.mean()),
                    "least": float(size.min()),
                    "most": float(size.max()),
                    "deviation": apart if apart < _BALL_LIMIT else None,
                }
            )
    return found


def _heights(solution: CoilSolution, place: Workplace) -> list[dict[str, Any]]:
    """Over the middle of a flat coil: B and its derivative upwards at every height; largest |B| in the plane."""
    found = []
    for height, plane in zip(place.heights, place.planes, strict=False):
        point = np.array([0.0, 0.0, plane.height])
        B, gradient = solution.jet(point, 1)
        _, points = plane.points(_SEARCH)
        found.append(
            {
                "height": height,
                "B": float(B[2]),
                "slope": float(gradient[2, 2]),
                "largest": float(np.linalg.norm(solution.B(points), axis=-1).max()),
            }
        )
    return found


def _turning(solution: CoilSolution, place: Workplace) -> dict[str, Any] | None:
    """Two circuits driven a quarter period apart: the ellipse that B traces, at the centre and in the last place."""
    if len(solution.circuits) != 2:
        return None
    drive = quadrature(solution, 1.0)
    most, least = (float(value) for value in drive.semi_axes(place.centre))
    everywhere = place.places[-1]
    large, small = drive.semi_axes(everywhere.points)
    first, second = (circuit.B(place.centre) for circuit in solution.circuits)
    sizes = np.linalg.norm(first), np.linalg.norm(second)
    angle = np.degrees(np.arccos(np.clip(first @ second / (sizes[0] * sizes[1]), -1, 1)))
    return {
        "most": most,
        "least": least,
        "words": everywhere.words,
        "mean": (float(large.mean()), float(small.mean())),
        "range": (float(small.min()), float(large.max())),
        "power": drive.power,
        "angle": float(angle),
    }


def _python(subject: CoilSubject, place: Workplace) -> str:
    """A few lines that solve the coil and evaluate its field, comments aligned."""
    x, y, z = (float(f"{value:.4g}") for value in place.centre)
    first = subject.solution.circuits[0].name
    currents = "[1.0]" if len(subject.solution.circuits) == 1 else f'{{"{first}": 1.0}}'
    lines = [
        ("import magfem", ""),
        (f"coil = magfem.solve(magfem.load_geometry({json.dumps(subject.usage, ensure_ascii=False)}))", ""),
        (f"field = coil.driven({currents})", "A; the coil itself is a field in T/A"),
        (f"B, gradient = field.jet([{x:g}, {y:g}, {z:g}])", "m in; T and T/m out"),
        (
            "coil.inductance, coil.power(1.0)" if len(subject.solution.circuits) == 1 else "coil.inductance",
            "H, W" if len(subject.solution.circuits) == 1 else "H",
        ),
    ]
    column = max(len(code) for code, comment in lines if comment) + 2
    return "\n".join(f"{code:{column}}# {comment}" if comment else code for code, comment in lines)
