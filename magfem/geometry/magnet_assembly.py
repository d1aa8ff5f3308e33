"""Magnet assemblies: any single magnets, each in its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any, ClassVar, Self

import numpy as np

from magfem.fields.hull import PolytopeHull
from magfem.geometry.block_magnet import BlockMagnet
from magfem.geometry.card import Table
from magfem.geometry.cylinder_magnet import CylinderMagnet
from magfem.geometry.cylinder_segment_magnet import CylinderSegmentMagnet
from magfem.geometry.device import header_from_card, length_text
from magfem.geometry.disc_magnet import DiscMagnet
from magfem.geometry.limits import InvalidValue, check_number, check_thickness
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import PermanentMagnet, read_direction
from magfem.geometry.overlap import overlapping
from magfem.geometry.part import NOWHERE, Part
from magfem.geometry.repetition import MOST
from magfem.geometry.ring_magnet import RingMagnet
from magfem.geometry.single_magnet import SingleMagnet
from magfem.geometry.sphere_magnet import SphereMagnet
from magfem.geometry.vectors import Vector, is_triple, three_angles, three_lengths, three_numbers, triple
from magfem.units import describe, format_quantity, quoted

KINDS: dict[str, type[SingleMagnet]] = {
    kind.kind: kind
    for kind in (RingMagnet, CylinderMagnet, DiscMagnet, BlockMagnet, SphereMagnet, CylinderSegmentMagnet)
}
"""What an assembly may hold."""

_FARTHEST = 1e6  # largest dimensions from the origin, at which 1e-10 of them is left to rounding


@dataclass(frozen=True)
class PlacedMagnet:
    """A single magnet of its own frame, turned about its origin and then moved."""

    magnet: SingleMagnet
    position: Vector = NOWHERE  # m
    rotation: Vector = NOWHERE  # rotation vector, rad
    name: str = ""  # empty: `magnet_1`, `magnet_2` … by place in the assembly


@dataclass(frozen=True, kw_only=True)
class MagnetAssembly(MagneticSolids):
    """Single magnets in their places; they may touch, not overlap. Raises InputError when they do.

    Every magnet's direction of magnetisation is that of its own frame: it turns with the magnet.
    """

    kind = "magnet_assembly"
    dimensions: ClassVar[tuple[str, ...]] = ()

    magnets: tuple[PlacedMagnet, ...]

    def __post_init__(self) -> None:
        self.check_header()
        if not (isinstance(self.magnets, list | tuple) and self.magnets):
            raise InvalidValue(f"{self.words}: magnets must be one or more, got {describe(self.magnets)}", "magnets")
        if len(self.magnets) > MOST:
            raise InvalidValue(f"{self.words}: magnets must be at most {MOST}, got {len(self.magnets)}", "magnets")
        object.__setattr__(self, "magnets", tuple(self._named(k, one) for k, one in enumerate(self.magnets)))
        names = [one.name for one in self.magnets]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise InvalidValue(f"{self.words}: two magnets are called {quoted(name)}", f"magnets[{k}].name")
        corners = self.corners
        largest = float(np.ptp(corners, axis=0).max())
        for k, part in enumerate(self.parts):
            check_thickness(self.words, f"magnets[{k}]", part.name, part.shape.thickness, largest)
        for k, one in enumerate(self.magnets):
            if max(map(abs, one.position)) > _FARTHEST * largest:
                raise InvalidValue(
                    f"{self.words}: position of {quoted(one.name)} must lie within "
                    f"{format_quantity(_FARTHEST * largest, 'length')} of the origin, a million times the assembly's "
                    f"size, or rounding spoils its shape, got {format_quantity(max(one.position, key=abs), 'length')}",
                    f"magnets[{k}].position",
                )
        if pair := overlapping(self.parts):
            raise InvalidValue(
                f"{self.words}: {quoted(pair[0])} and {quoted(pair[1])} overlap; magnets may touch only", "magnets"
            )
        self.check_region(largest)

    def _named(self, k: int, placed: PlacedMagnet) -> PlacedMagnet:
        """The magnet under a name, its place checked."""
        key = f"magnets[{k}]"
        if not (isinstance(placed, PlacedMagnet) and isinstance(placed.magnet, tuple(KINDS.values()))):
            raise InvalidValue(
                f"{self.words}: magnets must be PlacedMagnet of one of {', '.join(KINDS)}, got {describe(placed)}", key
            )
        if not isinstance(placed.name, str):
            raise InvalidValue(f"{self.words}: name must be a text, got {describe(placed.name)}", f"{key}.name")
        for part in ("position", "rotation"):
            value = getattr(placed, part)
            if not is_triple(value):
                raise InvalidValue(
                    f"{self.words}: {part} must be three numbers, got {describe(value)}", f"{key}.{part}"
                )
            for component in value:
                check_number(self.words, f"{key}.{part}", component)
        return replace(
            placed,
            position=triple(placed.position),
            rotation=triple(placed.rotation),
            name=placed.name or f"magnet_{k + 1}",
        )

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the assembly that a whole card describes. Raises CardError."""
        values = header_from_card(card, "material", "magnets")
        entries = card.value("magnets")
        if not (isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries)):
            raise card.error(f"magnets must be tables, each headed [[magnets]], got {describe(entries)}", "magnets")
        shared = card.table("material") if "material" in card else None
        magnets = tuple(
            _magnet_from_card(Table(card.origin, entry, f"magnets[{k}]"), shared) for k, entry in enumerate(entries)
        )
        with card.locating():
            return cls(**values, magnets=magnets)

    def tables(self) -> dict[str, Any]:
        return {
            "magnets": [
                {
                    "kind": one.magnet.kind,
                    "name": one.name,
                    "position": [length_text(value) for value in one.position],
                    "rotation": [f"{value!r} rad" for value in one.rotation],
                    **one.magnet.tables(),
                }
                for one in self.magnets
            ]
        }

    @property
    def parts(self) -> tuple[Part, ...]:
        """One for each magnet, under its name."""
        return tuple(
            Part(one.name, one.magnet.shape, one.magnet.material, one.position, one.rotation) for one in self.magnets
        )

    @property
    def hull(self) -> PolytopeHull:
        """The convex hull of the magnets' corners, from which distances are counted; round ones have 48 of them."""
        return PolytopeHull(tuple(map(tuple, self.corners.tolist())))


def _magnet_from_card(entry: Table, shared: Table | None) -> PlacedMagnet:
    entry.only("kind", "name", "dimensions", "position", "rotation", "material", "magnetisation")
    kind = entry.text("kind")
    if kind not in KINDS:
        raise entry.error(f"an assembly holds {', '.join(KINDS)}, got {quoted(kind)}", "kind")
    values = KINDS[kind].dimensions_from_card(entry)
    material = _material(entry, shared)
    with entry.locating():
        magnet = KINDS[kind](**values, material=material)
    return PlacedMagnet(
        magnet,
        three_lengths(entry, "position") if "position" in entry else NOWHERE,
        _rotation(entry) if "rotation" in entry else NOWHERE,
        entry.text("name") if "name" in entry else "",
    )


def _material(entry: Table, shared: Table | None) -> PermanentMagnet:
    """The entry's own material, else the shared one, in the entry's own direction if it states one."""
    if "material" in entry:
        if "magnetisation" in entry:
            raise entry.error("state magnetisation within the magnet's own material", "magnetisation")
        with entry.locating():
            return PermanentMagnet.from_card(entry.table("material"))
    if shared is None:
        raise entry.error("missing a material: one for all magnets, or each its own", "material")
    if "magnetisation" not in entry:
        with Table(entry.origin, {}).locating():
            return PermanentMagnet.from_card(shared)
    with entry.locating():
        direction = read_direction(entry)
    rest: Mapping[str, object] = {key: value for key, value in shared.values.items() if key != "magnetisation"}
    with Table(entry.origin, {}).locating():
        return PermanentMagnet.from_card(Table(shared.origin, rest, shared.path), direction)


def _rotation(entry: Table) -> Vector:
    """Rotation vector (rad) of either three angles or a table of axis and angle. Raises CardError."""
    if not isinstance(entry.value("rotation"), dict):
        return three_angles(entry, "rotation")
    table = entry.table("rotation")
    table.only("axis", "angle")
    axis = np.array(three_numbers(table, "axis"))
    largest = float(np.abs(axis).max())
    if not 0 < largest < np.inf:
        raise table.error("axis must be three finite numbers that are not all zero", "axis")
    axis /= largest  # squares neither overflow nor vanish
    angle = table.quantity("angle", "angle")
    if not abs(angle) <= 2 * pi * (1 + 1e-9):
        raise table.error("angle must lie within ±360°", "angle")
    x, y, z = (axis / np.linalg.norm(axis) * angle).tolist()
    return x, y, z
