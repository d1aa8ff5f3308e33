"""What a rod is made of: flexible sections and rigid magnets, in order from the base to the tip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, pi
from typing import TypeAlias

import numpy as np

from magfem.errors import InputError
from magfem.typing import ArrayLike, Floats

Curvature: TypeAlias = ArrayLike | Callable[[Floats], Floats]
"""(3,) 1/m, or a function of arc length (n,) m from the section's start that gives (n, 3)."""

ELEMENTS, TORQUE_ELEMENTS, MAGNETIC_ELEMENTS = 16, 64, 256
"""Of a flexible section, by default; of one with moments per length and of a hard-magnetic one, which act at nodes."""


@dataclass(frozen=True)
class CrossSection:
    """Area (m²), second moments of area about its x and y axes and the torsion constant (m⁴)."""

    area: float
    second_moment_x: float
    second_moment_y: float
    torsion_constant: float

    def __post_init__(self) -> None:
        for name in ("area", "second_moment_x", "second_moment_y", "torsion_constant"):
            positive("cross-section", name, getattr(self, name))

    @classmethod
    def disc(cls, radius: float) -> CrossSection:
        """A full circle of `radius` m."""
        return cls.tube(0.0, radius)

    @classmethod
    def tube(cls, inner_radius: float, outer_radius: float) -> CrossSection:
        """A circular ring, radii in m."""
        if not (is_number(inner_radius) and is_number(outer_radius) and 0 <= inner_radius < outer_radius):
            raise InputError(
                f"cross-section: a tube needs 0 ≤ inner radius < outer radius, got {inner_radius!r} and "
                f"{outer_radius!r} m"
            )
        second = pi / 4 * (outer_radius**4 - inner_radius**4)
        return cls(pi * (outer_radius**2 - inner_radius**2), second, second, 2 * second)

    @classmethod
    def rectangle(cls, width: float, height: float) -> CrossSection:
        """Sides in m along x and y; the torsion constant by Saint-Venant's series (Timoshenko & Goodier, § 109)."""
        if not (is_number(width) and is_number(height) and width > 0 and height > 0):
            raise InputError(f"cross-section: a rectangle needs two positive sides, got {width!r} and {height!r} m")
        a, b = max(width, height), min(width, height)
        odd = np.arange(1, 200, 2)
        series = float(np.sum(np.tanh(odd * pi * a / (2 * b)) / odd**5))
        torsion = a * b**3 * (1 / 3 - 64 / pi**5 * b / a * series)
        return cls(width * height, width * height**3 / 12, height * width**3 / 12, torsion)


@dataclass(frozen=True, kw_only=True)
class FlexibleSection:
    """A stretch of elastic rod.

    length: m.  radius: m of its full circle, or of the tube's outside with `inner_radius`; or any `cross_section`.
    youngs_modulus: Pa.  poisson_ratio: for G = E / 2(1 + ν), or `shear_modulus` Pa itself.  density: kg/m³, of its
    weight.  intrinsic_curvature: (3,) 1/m without load, in the section's axes, or a function of arc length; its third
    component is twist.  intrinsic_strain: (3,), dp/ds in the section's axes without load.  force_per_length: (3,) N/m
    and moment_per_length: (3,) N, in world axes, whatever the shape.  magnetic_moment_per_length: (3,) A·m in the
    section's axes, of a hard-magnetic section.  elements: how many it is divided into (default 16, with moments per
    length 64, hard-magnetic 256); the shape's error falls with their fourth power, that of torques along the section
    with their square.
    Source of the constitutive law: dissertation, eq. 2.2; K = diag(EI_x, EI_y, GJ), diag(GA, GA, EA).
    """

    length: float
    radius: float | None = None
    youngs_modulus: float
    density: float = 0.0
    poisson_ratio: float = 0.5
    shear_modulus: float | None = None
    inner_radius: float = 0.0
    cross_section: CrossSection | None = None
    intrinsic_curvature: Curvature = (0.0, 0.0, 0.0)
    intrinsic_strain: ArrayLike = (0.0, 0.0, 1.0)
    force_per_length: ArrayLike = (0.0, 0.0, 0.0)
    moment_per_length: ArrayLike = (0.0, 0.0, 0.0)
    magnetic_moment_per_length: ArrayLike = (0.0, 0.0, 0.0)
    elements: int | None = None

    def __post_init__(self) -> None:
        positive("flexible section", "length", self.length)
        positive("flexible section", "youngs_modulus", self.youngs_modulus)
        not_negative("flexible section", "density", "kg/m³", self.density)
        if not (is_number(self.poisson_ratio) and -1 < self.poisson_ratio <= 0.5):
            raise InputError(
                f"flexible section: poisson_ratio must lie above -1 and up to 0.5, got {self.poisson_ratio!r}"
            )
        if self.shear_modulus is not None:
            positive("flexible section", "shear_modulus", self.shear_modulus)
        if (self.radius is None) == (self.cross_section is None):
            raise InputError("flexible section: state either radius (m) or cross_section")
        if not isinstance(self.cross_section, CrossSection | None):
            raise InputError(
                f"flexible section: cross_section is a CrossSection, got {type(self.cross_section).__name__}"
            )
        if self.elements is not None and not (type(self.elements) is int and 2 <= self.elements <= 4096):
            raise InputError(f"flexible section: elements must be a whole number from 2 to 4096, got {self.elements!r}")
        _ = self.section
        if not callable(self.intrinsic_curvature):
            three("flexible section", "intrinsic_curvature", self.intrinsic_curvature)
        for name in ("intrinsic_strain", "force_per_length", "moment_per_length", "magnetic_moment_per_length"):
            three("flexible section", name, getattr(self, name))
        if not three("flexible section", "intrinsic_strain", self.intrinsic_strain)[2] > 0:
            raise InputError("flexible section: intrinsic_strain must point along +z, such as (0, 0, 1)")

    @property
    def divisions(self) -> int:
        """How many elements it is divided into."""
        if self.elements is not None:
            return self.elements
        if np.any(np.asarray(self.magnetic_moment_per_length, float)):
            return MAGNETIC_ELEMENTS
        return TORQUE_ELEMENTS if np.any(np.asarray(self.moment_per_length, float)) else ELEMENTS

    @property
    def section(self) -> CrossSection:
        """Its cross-section."""
        if self.cross_section is not None:
            return self.cross_section
        assert self.radius is not None
        return CrossSection.tube(self.inner_radius, self.radius)

    @property
    def stiffness(self) -> Floats:
        """(6,) EI_x, EI_y, GJ (N·m²), GA, GA, EA (N)."""
        E, own = self.youngs_modulus, self.section
        G = E / (2 * (1 + self.poisson_ratio)) if self.shear_modulus is None else self.shear_modulus
        bending = [E * own.second_moment_x, E * own.second_moment_y, G * own.torsion_constant]
        return np.array([*bending, G * own.area, G * own.area, E * own.area])


@dataclass(frozen=True, kw_only=True)
class MagnetSection:
    """A rigid magnet, as long as it is in the rod; the rod's axis goes through it along z.

    length: m.  moment: (3,) A·m² in its own axes, or a number for one along its z.  mass: kg, at its centre.
    field_points: at how many Gauss points along its length the field is taken; one, its centre, is enough where the
    field's curvature over the magnet is small.
    """

    length: float
    moment: ArrayLike
    mass: float = 0.0
    field_points: int = 1

    def __post_init__(self) -> None:
        not_negative("magnet section", "length", "m", self.length)
        not_negative("magnet section", "mass", "kg", self.mass)
        if type(self.field_points) is not int or not 1 <= self.field_points <= 16:
            raise InputError(
                f"magnet section: field_points must be a whole number from 1 to 16, got {self.field_points!r}"
            )
        _ = self.moment_vector

    @property
    def moment_vector(self) -> Floats:
        """(3,) A·m² in the magnet's axes."""
        if isinstance(self.moment, int | float | np.number | np.ndarray) and np.ndim(self.moment) == 0:
            return three("magnet section", "moment", (0.0, 0.0, self.moment))  # type: ignore[arg-type]
        return three("magnet section", "moment", self.moment)


def positive(what: str, name: str, value: float) -> None:
    """Raise InputError unless `value` is positive and finite."""
    if not (is_number(value) and value > 0):
        raise InputError(f"{what}: {name} must be positive and finite, got {value!r}")


def not_negative(what: str, name: str, unit: str, value: float) -> None:
    """Raise InputError unless `value` is finite and not negative."""
    if not (is_number(value) and value >= 0):
        raise InputError(f"{what}: {name} must be finite and not negative ({unit}), got {value!r}")


def is_number(value: object) -> bool:
    """Whether `value` is one finite real number."""
    return isinstance(value, int | float | np.floating | np.integer) and isfinite(value)


def three(what: str, name: str, value: ArrayLike) -> Floats:
    """`value` as (3,) finite floats; InputError otherwise."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InputError(f"{what}: {name} must be three finite numbers, got {value!r}")
    return array
