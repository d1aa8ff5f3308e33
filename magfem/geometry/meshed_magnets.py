"""Permanent magnets whose shape is a mesh made elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from magfem.constants import MU_0
from magfem.errors import CardError, InputError
from magfem.fields.hull import PolytopeHull
from magfem.geometry.body import Body
from magfem.geometry.body_surfaces import BodySurfaces
from magfem.geometry.card import CardOrigin, Table
from magfem.geometry.catalogue import folder
from magfem.geometry.device import Device, header_from_card, two_digits
from magfem.geometry.limits import LONGEST, SHORTEST, InvalidValue
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.mesh_file import read_bodies
from magfem.typing import Floats, Points
from magfem.units import describe, format_quantity, quantity, shortened

_OFF_CENTRE = 3.0
"""Radius of the ball about the origin over that of the ball around the bodies, at most."""


@dataclass(frozen=True, kw_only=True)
class MeshedMagnets(Device):
    """Magnets bounded by the facets of an external mesh, in its frame but for `shift`; facets are the truth.

    surfaces: of all bodies, m.  materials: one for each of `surfaces.names`.  file, unit: what the card's [mesh]
    says.  sha256: of the mesh file.  The card that goes with solutions and models holds the surfaces themselves,
    in a table [surfaces] at its end, so that they are read back without the mesh file.
    """

    kind = "meshed_magnets"
    dimensions: ClassVar[tuple[str, ...]] = ()

    surfaces: BodySurfaces
    materials: tuple[PermanentMagnet, ...]
    file: str = ""
    unit: str = "m"
    sha256: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.surfaces, BodySurfaces):
            raise InputError(f"{self.words}: surfaces must be BodySurfaces, got {describe(self.surfaces)}")
        if len(self.materials) != len(self.surfaces.names):
            raise InputError(f"{self.words}: materials must be one for each of {', '.join(self.surfaces.names)}")
        self.check_header()
        self.surfaces.check()
        corners = self.corners
        low, high = corners.min(axis=0), corners.max(axis=0)
        largest = float((high - low).max())
        if not SHORTEST <= largest <= LONGEST:
            shortest, longest, got = (format_quantity(value, "length") for value in (SHORTEST, LONGEST, largest))
            raise InvalidValue(
                f"{self.words}: in this unit the bodies' largest dimension is {got}, which must lie between {shortest} "
                f"and {longest}",
                "mesh.unit",
            )
        centre = (low + high) / 2
        if self.hull.radius > _OFF_CENTRE * float(np.linalg.norm(corners - centre, axis=1).max()):
            words = ", ".join(f'"{format_quantity(value, "length")}"' for value in centre)
            raise InvalidValue(
                f"{self.words}: the bodies lie far from the origin; add origin = [{words}] to make their middle "
                "the device's origin",
                "mesh.origin",
            )
        self.check_region(largest)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the magnets that a whole card describes, from its [surfaces] or else the mesh file. Raises CardError."""
        values = header_from_card(card, "mesh", "bodies", "surfaces")
        mesh, tables = card.table("mesh"), card.table("bodies")
        mesh.only("file", "unit", "origin", "ignore")
        if not tables.values:
            raise card.error("name the mesh's bodies: a table [bodies.NAME] for each", "bodies")
        numbers: dict[str, int | None] = {}
        materials = []
        for name in tables.values:
            table = tables.table(name)
            numbers[name] = _number(table)
            rest = Table(table.origin, {k: v for k, v in table.values.items() if k != "id"}, table.path)
            try:
                materials.append(PermanentMagnet.from_card(rest))
            except InvalidValue as error:
                raise rest.error(str(error), error.key.rpartition(".")[2]) from None
        file, unit = mesh.text("file"), mesh.text("unit")
        try:
            scale = quantity(f"1 {unit}", "length")
        except InputError:
            raise mesh.error(f'unit must be one of length, such as "mm", got {describe(unit)}', "unit") from None
        if "surfaces" in card:
            surfaces, digest = _stored(card.table("surfaces"), tuple(numbers))
        else:
            surfaces, digest = _from_file(card, mesh, numbers, scale)
            card_text = card.origin.text.rstrip("\n") + _stored_text(surfaces, digest)
            values["origin"] = CardOrigin(card.origin.path, card.origin.sha256, card_text)
        with card.locating():
            return cls(**values, surfaces=surfaces, materials=tuple(materials), file=file, unit=unit, sha256=digest)

    def tables(self) -> dict[str, Any]:
        return {
            "mesh": {"file": self.file or "none", "unit": self.unit},
            "bodies": {
                name: material.table() for name, material in zip(self.surfaces.names, self.materials, strict=True)
            },
            "surfaces": {"sha256": self.sha256, "data": self.surfaces.to_text()},
        }

    @property
    def corners(self) -> Points:
        """Nodes (n, 3) m of all facets."""
        used = np.unique(self.surfaces.facets)
        return self.surfaces.points[used]

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies with volume and area of their facets; thickness is 3 volume / area (half a cube's edge)."""
        found = []
        for index, (name, material) in enumerate(zip(self.surfaces.names, self.materials, strict=True)):
            volume, area = self.surfaces.volume(index), self.surfaces.area(index)
            nodes = self.surfaces.points[np.unique(self.surfaces.of_body(index))]
            middle = (nodes.min(axis=0) + nodes.max(axis=0)) / 2
            radius = float(np.linalg.norm(nodes - middle, axis=1).max())
            found.append(Body(name, material, volume, area, thickness=3 * volume / area, radius=radius))
        return tuple(found)

    @property
    def volume(self) -> float:
        """Of all bodies, m³."""
        return sum(body.volume for body in self.bodies)

    @property
    def area(self) -> float:
        """Whole surfaces of all bodies, m²."""
        return sum(body.area for body in self.bodies)

    @property
    def moment(self) -> Floats:
        """Magnetic moment if magnetised rigidly, remanence·volume/µ₀ summed over the bodies, (3,) A·m²."""
        total: Floats = np.sum([body.material.remanence_vector * (body.volume / MU_0) for body in self.bodies], axis=0)
        return total

    @property
    def feature_size(self) -> float:
        """Three times volume over area of the thinnest body, m."""
        return min(body.thickness for body in self.bodies)

    @cached_property
    def hull(self) -> PolytopeHull:
        """The convex hull of all nodes, from which distances are counted."""
        return PolytopeHull(tuple(map(tuple, self.corners.tolist())))

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): from half the radius around the origin to three times it."""
        return two_digits(self.hull.radius / 2), two_digits(3 * self.hull.radius)

    @property
    def axisymmetric(self) -> bool:
        """Never: facets are not of revolution."""
        return False

    def build(self, occ: Any) -> dict[str, list[int]]:
        """An external mesh is no solid of OpenCASCADE: `magfem.mesh.external.mesh_in_air` meshes it."""
        raise InputError(f"{self.name}: the shape is a mesh, not a solid that can be built")

    def build_meridian(self, occ: Any) -> dict[str, list[int]]:
        """Facets have no half section."""
        raise InputError(f"{self.name}: the shape is a mesh, not a body of revolution")


def _number(table: Table) -> int | None:
    value = table.values.get("id")
    if value is not None and (isinstance(value, bool) or not isinstance(value, int)):
        raise table.error(f"id must be a whole number, got {describe(value)}", "id")
    return value


def _from_file(card: Table, mesh: Table, numbers: dict[str, int | None], scale: float) -> tuple[BodySurfaces, str]:
    """The surfaces in m, about the card's origin, and the file's hash."""
    ignored = mesh.values.get("ignore", [])
    if not isinstance(ignored, list) or not all(isinstance(name, str) for name in ignored):
        raise mesh.error(f'ignore must be a list of names such as ["yoke"], got {describe(ignored)}', "ignore")
    path = _beside(card.origin.path, mesh.text("file"))
    try:
        surfaces = read_bodies(path, numbers, scale, tuple(ignored))
        digest = sha256(path.read_bytes()).hexdigest()
    except CardError:
        raise
    except (InputError, OSError) as error:
        raise mesh.error(f"{shortened(mesh.text('file'))}: {error}", "file") from None
    return replace(surfaces, points=surfaces.points - _origin(mesh)), digest


def _beside(card: str, file: str) -> Path:
    """The mesh file, relative to the card's folder; cards of the catalogue are shown as `geometries/name.toml`."""
    home = Path(card).parent
    if not (home / file).is_file() and home == Path("geometries"):
        home = folder("geometries")
    return home / file


def _origin(mesh: Table) -> Floats:
    """The point (3,) m of the file that is the device's origin."""
    value = mesh.values.get("origin", ["0 m"] * 3)
    if not isinstance(value, list) or len(value) != 3:
        raise mesh.error(
            f'origin must be three lengths such as ["0 mm", "0 mm", "5 mm"], got {describe(value)}', "origin"
        )
    try:
        return np.array([quantity(part, "length") for part in value])
    except InputError as error:
        raise mesh.error(str(error), "origin") from None


def _stored(table: Table, names: tuple[str, ...]) -> tuple[BodySurfaces, str]:
    table.only("sha256", "data")
    try:
        return BodySurfaces.from_text(names, table.text("data")), str(table.value("sha256"))
    except CardError:
        raise
    except InputError as error:
        raise table.error(str(error), "data") from None


def _stored_text(surfaces: BodySurfaces, digest: str) -> str:
    return f'\n\n[surfaces]  # what was read from the mesh file\nsha256 = "{digest}"\ndata = "{surfaces.to_text()}"\n'
