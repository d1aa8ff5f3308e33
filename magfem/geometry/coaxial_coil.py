"""What coils of revolution share: windings about the z axis."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from magfem.fields.hull import CylinderHull
from magfem.geometry.circuit import CoaxialWinding
from magfem.geometry.device import two_digits
from magfem.geometry.limits import InvalidValue, check_thickness
from magfem.geometry.winding_window import WindingWindow
from magfem.geometry.wound_coil import WoundCoil
from magfem.units import format_quantity


@dataclass(frozen=True, kw_only=True)
class CoaxialCoil(WoundCoil):
    """Windings about z, all of one section. Positive current turns right-handed about +z."""

    inner_diameter: float  # m
    outer_diameter: float  # m
    length: float  # m, of one window, along z

    def check_shape(self, largest: float) -> None:
        if self.inner_diameter >= self.outer_diameter:
            raise InvalidValue(
                f"{self.words}: inner_diameter must be smaller than outer_diameter "
                f"({format_quantity(self.outer_diameter, 'length')}), "
                f"got {format_quantity(self.inner_diameter, 'length')}",
                "dimensions.inner_diameter",
            )
        check_thickness(self.words, "dimensions.inner_diameter", "the winding", self.window.build, largest)

    @property
    def window(self) -> WindingWindow:
        return WindingWindow(0.5 * (self.outer_diameter - self.inner_diameter), self.length)

    @property
    @abstractmethod
    def height(self) -> float:
        """Of the whole coil along z, m."""

    def winding(self, centre: float, turns: float) -> CoaxialWinding:
        """The winding of the coil's section about `centre` (m) on z; negative turns are left-handed."""
        return CoaxialWinding(
            inner_radius=0.5 * self.inner_diameter,
            outer_radius=0.5 * self.outer_diameter,
            length=self.length,
            centre=centre,
            turns=turns,
            wire_area=self.wire_area,
        )

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution about z."""
        return True

    @property
    def hull(self) -> CylinderHull:
        """The convex hull, from which distances are counted."""
        return CylinderHull(self.outer_diameter, self.height)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m), to two digits.

        The extent is 1.5 times the largest dimension, the clearance 1/8 of the outer diameter or 1/16 of the height,
        whichever is larger: the same as for magnets of this shape.
        """
        nearest = max(self.outer_diameter / 8, self.height / 16)
        return two_digits(nearest), two_digits(1.5 * max(self.outer_diameter, self.height))
