"""A solved coil: its field per ampere everywhere in space, its error statement, and the numbers of its circuits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fem.coil_currents import CoilCurrents
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fields.field import Evaluated, Field, Scaled, Summed, Unit
from magfem.fields.filament import Filaments
from magfem.fields.region import Everywhere, Region
from magfem.fields.region_json import region_to_dict
from magfem.files import write_folder, write_json
from magfem.geometry import Coil, describe
from magfem.mesh.coil_surfaces import coil_surfaces, quadrilaterals
from magfem.mesh.export import write_cells
from magfem.typing import ArrayLike, Floats, Jet, Points
from magfem.units import describe as words
from magfem.units import quoted

FORMAT = "magfem-coil-solution"


@dataclass(frozen=True, eq=False, repr=False)
class SolvedCircuit(Evaluated):
    """One circuit of a coil that carries 1 A: a Field in T/A.

    model: how the current was found: "sheet", "solid", "filament", "winding", or several joined by " and ".
    model_error: estimated share of B at the region's clearance that this leaves out.
    resistance: Ω, leads included; resistance_error: half the distance of its bounds, relative; lead_resistance: Ω,
    what leads add.  crowding: largest current density over the mean one in the narrowest section.
    section: m², the smallest section of metal that carries the whole current.
    """

    name: str
    currents: CoilCurrents
    model: str
    model_error: float
    resistance: float
    resistance_error: float
    lead_resistance: float
    crowding: float
    section: float
    unknowns: int

    @property
    def region(self) -> Region:
        return Everywhere()

    @property
    def unit(self) -> Unit:
        return "T/A"

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²/A."""
        return self.currents.moment

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.currents.jet(points, order)

    @property
    def quantities(self) -> dict[str, Any]:
        """The circuit's numbers, SI units."""
        return {
            "model": self.model,
            "model_error": self.model_error,
            "moment": self.moment.tolist(),
            "resistance": self.resistance,
            "resistance_error": self.resistance_error,
            "lead_resistance": self.lead_resistance,
            "current_density": self.crowding / self.section,
            "crowding": self.crowding,
        }


@dataclass(frozen=True, eq=False, repr=False)
class CoilSolution(Evaluated):
    """The solution of a coil; a Field in T/A, with 1 A in every circuit, inside the conductor too.

    error: stated bounds `B` and `gradient`, relative, over the device's region (the norm of `fields.norms`), and
    `model`, the estimated share of B that the description of the conductor leaves out.
    stats: unknowns, cells, quality, seconds, peak_bytes.  settings: resolution and conduction.
    """

    geometry: Coil
    circuits: tuple[SolvedCircuit, ...]
    error: dict[str, Any]
    stats: dict[str, Any]
    settings: dict[str, Any]
    stored_inductance: Floats | None = None  # of a solution that was read back

    def __repr__(self) -> str:
        return (
            f"<CoilSolution of {self.geometry.name!r}: {len(self.circuits)} circuit(s), resolution "
            f"{self.settings['resolution']:g}, stated error {self.error['B']:.1e} in B, "
            f"{self.error['gradient']:.1e} in the gradient>"
        )

    @property
    def region(self) -> Region:
        """Everywhere; the stated error holds in the device's region."""
        return Everywhere()

    @property
    def unit(self) -> Unit:
        return "T/A"

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²/A."""
        moment: Floats = np.sum([circuit.moment for circuit in self.circuits], axis=0)
        return moment

    def evaluate(self, points: Points, order: int) -> Jet:
        jets = [circuit.evaluate(points, order) for circuit in self.circuits]
        return tuple(np.sum(parts, axis=0) for parts in zip(*jets, strict=True))

    def circuit(self, name: str) -> SolvedCircuit:
        """The field per ampere of one circuit. Raises InputError for a name that the coil does not have."""
        for circuit in self.circuits:
            if circuit.name == name:
                return circuit
        names = ", ".join(quoted(circuit.name) for circuit in self.circuits)
        raise InputError(f"{self.geometry.name} has no circuit {quoted(str(name))}; it has {names}")

    def driven(self, currents: Mapping[str, float] | Sequence[float] | Floats) -> Field:
        """The field in T at stated currents (A), by circuit name (others carry none) or one for each in order."""
        if isinstance(currents, Mapping):
            chosen = [self.circuit(name) for name in currents]
            values = list(currents.values())
        else:
            values = self._one_each(currents).tolist()
            chosen = list(self.circuits)
        if not values:
            raise InputError(f"{self.geometry.name}: at least one circuit must be named with its current")
        fields = tuple(Scaled(circuit, value, "T") for circuit, value in zip(chosen, values, strict=True))
        return fields[0] if len(fields) == 1 else Summed(fields)

    @cached_property
    def inductance(self) -> Floats:
        """Self- and mutual inductances (c, c) H of the circuits, in order; computed on first use."""
        if self.stored_inductance is not None:
            return self.stored_inductance
        from magfem.fem.inductance import inductance_matrix

        return inductance_matrix([circuit.currents for circuit in self.circuits])

    def _one_each(self, currents: ArrayLike) -> Floats:
        """One current (A) for each circuit. Raises InputError for another number of them."""
        values = np.asarray(currents, dtype=float).ravel()
        if values.size != len(self.circuits):
            raise InputError(f"{self.geometry.name} has {len(self.circuits)} circuits, got {values.size} currents")
        return values

    def energy(self, currents: ArrayLike) -> float:
        """Stored magnetic energy (J) at one current (A) for each circuit: ½ Iᵀ L I."""
        current = self._one_each(currents)
        return float(0.5 * current @ self.inductance @ current)

    def power(self, currents: ArrayLike) -> float:
        """Heat (W) at one current (A) for each circuit: Σ R I²."""
        current = self._one_each(currents)
        return float(sum(circuit.resistance * i**2 for circuit, i in zip(self.circuits, current, strict=True)))

    @property
    def quantities(self) -> dict[str, Any]:
        """Numbers of the solve, SI units: moment, inductance, and those of every circuit by name."""
        return {
            "moment": self.moment.tolist(),
            "inductance": self.inductance.tolist(),
            "resistance": [circuit.resistance for circuit in self.circuits],
            "field_energy": self.energy(np.ones(len(self.circuits))),
            "circuits": {circuit.name: circuit.quantities for circuit in self.circuits},
        }

    @property
    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        return {
            "format": FORMAT,
            "version": 1,
            "device": describe(self.geometry),
            "settings": self.settings,
            "error": self.error,
            "quantities": self.quantities,
            "stats": self.stats,
            "region": region_to_dict(self.geometry.region),
        }

    def save(self, folder: str | Path) -> None:
        """Write solution.vtu (for ParaView), fields.npz (every bit) and summary.json, or nothing at all.

        A folder of a former solution is replaced; one that holds any other file is left alone (InputError).
        """
        from magfem.fem.solution import FILES

        write_folder(Path(folder), self._fill, FILES)

    def _fill(self, folder: Path) -> None:
        write_json(folder / "summary.json", self.summary)
        arrays: dict[str, Any] = {"inductance": self.inductance}
        for number, circuit in enumerate(self.circuits):
            arrays |= {f"circuit{number}_{key}": value for key, value in _arrays(circuit.currents).items()}
        np.savez(folder / "fields.npz", **arrays)
        surfaces = coil_surfaces(self.geometry, self.settings["resolution"])
        points, cells, owner = quadrilaterals(surfaces)
        names = tuple(surface.name for surface in surfaces)
        flux_density = {"B": self.evaluate(points, 0)[0]}  # T, at 1 A in every circuit
        write_cells(folder / "solution.vtu", points, {"quad9": cells}, {"quad9": owner}, names, None, flux_density)


def coil_solution(summary: dict[str, Any], arrays: dict[str, Any], geometry: Coil) -> CoilSolution:
    """From what `CoilSolution.save` wrote; KeyError, TypeError, ValueError … when it is not whole."""
    for value in (summary["settings"]["resolution"], summary["error"]["B"], summary["error"]["gradient"]):
        if type(value) not in (int, float):
            raise ValueError(f"resolution and stated errors must be numbers, got {words(value)}")
    circuits = []
    for number, (name, known) in enumerate(summary["quantities"]["circuits"].items()):
        prefix = f"circuit{number}_"
        own = {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
        circuits.append(
            SolvedCircuit(
                name=name,
                currents=_currents(own),
                model=known["model"],
                model_error=known["model_error"],
                resistance=known["resistance"],
                resistance_error=known["resistance_error"],
                lead_resistance=known["lead_resistance"],
                crowding=known["crowding"],
                section=known["crowding"] / known["current_density"],
                unknowns=0,
            )
        )
    return CoilSolution(
        geometry=geometry,
        circuits=tuple(circuits),
        error=summary["error"],
        stats=summary["stats"],
        settings=summary["settings"],
        stored_inductance=_checked(arrays["inductance"], (len(circuits), len(circuits)), "inductance"),
    )


def _arrays(currents: CoilCurrents) -> dict[str, Floats]:
    return {
        "sheets_nodes": currents.sheets.nodes,
        "sheets_stream": currents.sheets.stream,
        "faces_nodes": currents.faces.nodes,
        "faces_stream": currents.faces.stream,
        "within_nodes": currents.within.nodes,
        "within_stream": currents.within.stream,
        "start": currents.filaments.start,
        "end": currents.filaments.end,
        "current": currents.filaments.current,
        "offset": currents.offset,
        "windings": currents.windings,
        "excess": np.array(currents.excess),
    }


_SHAPES: dict[str, tuple[int | None, ...]] = {
    "sheets_nodes": (None, 9, 3),
    "sheets_stream": (None, 9),
    "faces_nodes": (None, 9, 3),
    "faces_stream": (None, 9),
    "within_nodes": (None, 9, 3),
    "within_stream": (None, 9),
    "start": (None, 3),
    "end": (None, 3),
    "current": (None,),
    "offset": (None, 3),
    "windings": (None, 6),
    "excess": (),
}


def _checked(array: Floats, shape: tuple[int | None, ...], name: str) -> Floats:
    """An array of finite numbers of a shape (None: any count); ValueError for another."""
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
    if array.dtype != float or not fits or not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite numbers of shape {shape}, got {array.dtype} of shape {array.shape}")
    return array


def _currents(arrays: dict[str, Floats]) -> CoilCurrents:
    arrays = {name: _checked(arrays[name], shape, name) for name, shape in _SHAPES.items()}
    for kind in ("sheets", "faces", "within"):
        if len(arrays[f"{kind}_nodes"]) != len(arrays[f"{kind}_stream"]):
            raise ValueError(f"{kind}_nodes and {kind}_stream must be of one length")
    if len({len(arrays[name]) for name in ("start", "end", "current", "offset")}) > 1:
        raise ValueError("start, end, current and offset must be of one length")
    return CoilCurrents(
        sheets=SheetCurrents(arrays["sheets_nodes"], arrays["sheets_stream"]),
        faces=SheetCurrents(arrays["faces_nodes"], arrays["faces_stream"]),
        within=SheetCurrents(arrays["within_nodes"], arrays["within_stream"]),
        filaments=Filaments(arrays["start"], arrays["end"], arrays["current"]),
        offset=arrays["offset"],
        windings=arrays["windings"],
        excess=float(arrays["excess"]),
    )
