"""A solved device: its field everywhere in space, its error statement, and the numbers that the solve gives."""

from __future__ import annotations

import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import CardError, InputError
from magfem.fem.coil_solution import FORMAT as COIL_FORMAT
from magfem.fem.coil_solution import CoilSolution, coil_solution
from magfem.fem.discrete import Currents
from magfem.fem.meridian_currents import MeridianCurrents
from magfem.fem.surface_currents import SurfaceCurrents
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.fields.region_json import region_to_dict
from magfem.files import read_json, write_folder, write_json
from magfem.geometry import Coil, Magnets, describe, geometry_from_text
from magfem.mesh.export import write_mesh
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats, Jet, Points
from magfem.units import describe as words
from magfem.units import one_line

__all__ = ["FILES", "Solution", "describe", "load_solution"]

FILES = frozenset({"solution.vtu", "fields.npz", "summary.json"})
"""What a saved solution consists of."""


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Evaluated):
    """The finite-element solution of a device; a Field in T, inside the bodies too.

    error: stated bounds `B` and `gradient`, relative, over the device's region (the norm of `fields.norms`).
    quantities: numbers of the solve in SI units.  stats: unknowns, cells, seconds, peak_bytes, iterations.
    geometry: what was solved; `error` holds in its region.  settings: dimension and resolution.
    """

    geometry: Magnets
    currents: Currents
    mesh: Mesh
    potential: Floats  # (n,) A at the mesh's nodes
    flux_density: Floats  # (e, d) T in every cell's middle, by differentiating: for pictures only
    error: dict[str, Any]
    quantities: dict[str, Any]
    stats: dict[str, Any]
    settings: dict[str, Any]

    def __repr__(self) -> str:
        return (
            f"<Solution of {self.geometry.name!r}: dimension {self.settings['dimension']}, resolution "
            f"{self.settings['resolution']:g}, stated error {self.error['B']:.1e} in B, "
            f"{self.error['gradient']:.1e} in the gradient>"
        )

    @property
    def region(self) -> Region:
        """Everywhere; the stated error holds in the device's region."""
        return Everywhere()

    @property
    def unit(self) -> Unit:
        return "T"

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²."""
        return self.currents.moment

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.currents.jet(points, order)

    @property
    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        return {
            "format": "magfem-solution",
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
        write_folder(Path(folder), self._fill, FILES)

    def _fill(self, folder: Path) -> None:
        write_json(folder / "summary.json", self.summary)
        arrays: dict[str, Any] = {
            "points": self.mesh.points,
            "cells": self.mesh.cells,
            "body": self.mesh.body,
            "names": np.array(self.mesh.names),
            "radius": np.array(self.mesh.radius),
            "potential": self.potential,
            "flux_density": self.flux_density,
        }
        np.savez(folder / "fields.npz", **arrays, **{f"currents_{k}": v for k, v in vars(self.currents).items()})
        write_mesh(
            self.mesh,
            folder / "solution.vtu",
            point_data={"potential": self.potential},
            cell_data={"B": _three(self.flux_density)},
        )


def load_solution(folder: str | Path) -> Solution | CoilSolution:
    """Read back what `Solution.save` wrote.

    Raises InputError when the folder is not a saved solution, CardError (file and reason) when it is not whole.
    """
    if not isinstance(folder, str | os.PathLike):
        raise InputError(f'load_solution takes the folder of a solution: "runs/ring", got {words(folder)}')
    folder = Path(folder)
    summary = read_json(folder / "summary.json", "a solution's summary.json")
    if not isinstance(summary, dict) or summary.get("format") not in ("magfem-solution", COIL_FORMAT):
        raise InputError(f"this folder holds no saved solution [{folder}]")
    try:
        with open(folder / "fields.npz", "rb") as file, np.load(file) as stored:
            arrays = dict(stored)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"the solution's fields cannot be read: {error} [{folder / 'fields.npz'}]") from None
    try:
        if summary["format"] == COIL_FORMAT:
            card = summary["device"]["card"]
            coil = geometry_from_text(card["text"], card["path"])
            if not isinstance(coil, Coil):
                raise ValueError(f"its card describes no coil but a {coil.kind}")
            return coil_solution(summary, arrays, coil)
        return _solution(summary, arrays)
    except CardError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        reason = f"missing key {error}" if isinstance(error, KeyError) else one_line(str(error))
        raise CardError(f"not a whole solution: {reason}", str(folder)) from None


def _solution(summary: dict[str, Any], arrays: dict[str, Any]) -> Solution:
    """From the content of summary.json and fields.npz; KeyError, TypeError, ValueError … when they are not whole."""
    dimension, width = summary["settings"]["dimension"], arrays["points"].shape[1]
    if dimension != width:
        raise ValueError(f"settings.dimension is {words(dimension)}, its mesh has dimension {width}")
    for value in (summary["settings"]["resolution"], summary["error"]["B"], summary["error"]["gradient"]):
        if type(value) not in (int, float):
            raise ValueError(f"resolution and stated errors must be numbers, got {words(value)}")
    currents = {k.removeprefix("currents_"): v for k, v in arrays.items() if k.startswith("currents_")}
    card = summary["device"]["card"]
    geometry = geometry_from_text(card["text"], card["path"])
    if not isinstance(geometry, Magnets):
        raise ValueError(f"its card describes no magnet but a {geometry.kind}")
    return Solution(
        geometry=geometry,
        currents=SurfaceCurrents(**currents) if dimension == 3 else MeridianCurrents(**currents),
        mesh=Mesh(
            points=arrays["points"],
            cells=arrays["cells"],
            body=arrays["body"],
            names=tuple(str(name) for name in arrays["names"]),
            radius=float(arrays["radius"]),
        ),
        potential=arrays["potential"],
        flux_density=arrays["flux_density"],
        error=summary["error"],
        quantities=summary["quantities"],
        stats=summary["stats"],
        settings=summary["settings"],
    )


def _three(vectors: Floats) -> Floats:
    """Vectors (n, 2) of the half plane as (n, 3); (n, 3) stay."""
    return vectors if vectors.shape[1] == 3 else np.column_stack([vectors, np.zeros(len(vectors))])
