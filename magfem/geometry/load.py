"""From the name or path of a device card to the device."""

from __future__ import annotations

import os
from collections.abc import Callable
from difflib import get_close_matches

from magfem.errors import InputError
from magfem.geometry.block_magnet import BlockMagnet
from magfem.geometry.card import Table, parse_table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.geometry.coil_array import CoilArray
from magfem.geometry.cylinder_magnet import CylinderMagnet
from magfem.geometry.cylinder_segment_magnet import CylinderSegmentMagnet
from magfem.geometry.disc_magnet import DiscMagnet
from magfem.geometry.geometry import Geometry
from magfem.geometry.halbach_array import HalbachArray
from magfem.geometry.halbach_ring import HalbachRing
from magfem.geometry.helmholtz_pair import HelmholtzPair
from magfem.geometry.loop_coil import LoopCoil
from magfem.geometry.magnet_assembly import MagnetAssembly
from magfem.geometry.magnet_stack import MagnetStack
from magfem.geometry.meander_coil import MeanderCoil
from magfem.geometry.meshed_magnets import MeshedMagnets
from magfem.geometry.planar_spiral_coil import PlanarSpiralCoil
from magfem.geometry.racetrack_coil import RacetrackCoil
from magfem.geometry.rectangular_coil import RectangularCoil
from magfem.geometry.ring_magnet import RingMagnet
from magfem.geometry.saddle_coil import SaddleCoil
from magfem.geometry.solenoid import Solenoid
from magfem.geometry.sphere_magnet import SphereMagnet
from magfem.geometry.stator import Stator
from magfem.units import describe, quoted

KINDS: dict[str, Callable[[Table], Geometry]] = {
    CylinderMagnet.kind: CylinderMagnet.from_card,
    MeshedMagnets.kind: MeshedMagnets.from_card,
    RingMagnet.kind: RingMagnet.from_card,
    DiscMagnet.kind: DiscMagnet.from_card,
    MagnetStack.kind: MagnetStack.from_card,
    BlockMagnet.kind: BlockMagnet.from_card,
    SphereMagnet.kind: SphereMagnet.from_card,
    CylinderSegmentMagnet.kind: CylinderSegmentMagnet.from_card,
    HalbachRing.kind: HalbachRing.from_card,
    HalbachArray.kind: HalbachArray.from_card,
    MagnetAssembly.kind: MagnetAssembly.from_card,
    Solenoid.kind: Solenoid.from_card,
    HelmholtzPair.kind: HelmholtzPair.from_card,
    LoopCoil.kind: LoopCoil.from_card,
    RacetrackCoil.kind: RacetrackCoil.from_card,
    SaddleCoil.kind: SaddleCoil.from_card,
    PlanarSpiralCoil.kind: PlanarSpiralCoil.from_card,
    RectangularCoil.kind: RectangularCoil.from_card,
    MeanderCoil.kind: MeanderCoil.from_card,
    Stator.kind: Stator.from_card,
    CoilArray.kind: CoilArray.from_card,
}
"""Reader of the whole card by the card's `kind`."""


def load_geometry(name_or_path: str | os.PathLike[str]) -> Geometry:
    """The device of a catalogue name such as `ring_magnet_4x1.5x1`, or of a path to a device card.

    Raises InputError for a name that the catalogue does not have, CardError for a card that is wrong.
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise InputError(f"expected a device card's name or path, got {describe(name_or_path)}")
    where = ("geometries", name_or_path, ".toml")
    return _device(read_table(resolve(*where), short_path(*where)))


def geometry_from_text(text: str, shown: str) -> Geometry:
    """The device of a card's text; `shown` is how messages name it. Raises CardError."""
    return _device(parse_table(text.encode(), shown))


def _device(card: Table) -> Geometry:
    return KINDS[_kind(card)](card)


def _kind(card: Table) -> str:
    if "kind" not in card and (misspelt := get_close_matches("kind", card.values, n=1)):
        raise card.error(f'unknown key {quoted(misspelt[0])}; did you mean "kind"?', misspelt[0])
    kind = card.text("kind")
    if kind not in KINDS:
        nearest = get_close_matches(kind, KINDS, n=1)
        advice = f"did you mean {quoted(nearest[0])}?" if nearest else f"known: {', '.join(KINDS)}"
        raise card.error(f"unknown kind {quoted(kind)}; {advice}", "kind")
    return kind
