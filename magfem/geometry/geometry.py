"""What every device offers to the stages on its right: magnets on one side, coils on the other."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, runtime_checkable

from magfem.errors import InputError
from magfem.fields.hull import Hull
from magfem.fields.region import Shell
from magfem.geometry.body import Body
from magfem.geometry.card import CardOrigin
from magfem.geometry.circuit import Circuit
from magfem.geometry.conductor import Conductor
from magfem.typing import Floats
from magfem.units import describe


@runtime_checkable
class Geometry(Protocol):
    """A device in its source frame: z is the axis of revolution or the coil's normal, the origin its centre."""

    kind: ClassVar[str]  # as cards write it
    dimensions: ClassVar[tuple[str, ...]]  # names of the lengths that a card's [dimensions] holds

    @property
    def name(self) -> str:
        """For people."""
        ...

    @property
    def source(self) -> str:
        """Where the device's numbers come from; empty when not said."""
        ...

    @property
    def origin(self) -> CardOrigin | None:
        """The card it was read from; None when made in Python."""
        ...

    @property
    def volume(self) -> float:
        """Of all magnets or of the conductor, m³."""
        ...

    @property
    def hull(self) -> Hull:
        """The convex hull, from which distances are counted."""
        ...

    @property
    def region(self) -> Shell:
        """Where a model of this device must hold."""
        ...

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution about z."""
        ...

    def tables(self) -> dict[str, Any]:
        """The card's tables but [region], ready for TOML."""
        ...


@runtime_checkable
class Magnets(Geometry, Protocol):
    """Permanent magnets: solids, each of one material."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The solids, each with its material, volume and area."""
        ...

    @property
    def area(self) -> float:
        """Surface of all bodies, m²."""
        ...

    @property
    def moment(self) -> Floats:
        """Magnetic moment if magnetised rigidly, (3,) A·m²."""
        ...

    @property
    def feature_size(self) -> float:
        """The smallest thickness that a mesh must resolve, m."""
        ...

    def build(self, occ: Any) -> dict[str, list[int]]:
        """Make the solids in `occ`, which is `gmsh.model.occ` (m); volume tags by body name."""
        ...

    def build_meridian(self, occ: Any) -> dict[str, list[int]]:
        """Make the half section, x = rho and y = z, in `occ`; surface tags by body name. Axisymmetric ones only."""
        ...


@runtime_checkable
class Coil(Geometry, Protocol):
    """Current-carrying conductors in air."""

    @property
    def circuits(self) -> tuple[Circuit, ...]:
        """What can be driven on its own: one for most coils, two for a stator, many for an array."""
        ...

    @property
    def conductor(self) -> Conductor:
        """The metal of all circuits."""
        ...


def check_device(value: object, verb: str) -> None:
    """Raise InputError, which says what `verb` takes, unless `value` is a device."""
    if not isinstance(value, Geometry) or isinstance(value, type):
        raise InputError(f"{verb} takes a device: magfem.load_geometry('ring_magnet_4x1.5x1'), got {describe(value)}")
