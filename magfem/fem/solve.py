"""From a device to its solution."""

from __future__ import annotations

from numbers import Integral, Real

from magfem.errors import InputError
from magfem.fem import solve_coil, solve_magnets
from magfem.fem.coil_solution import CoilSolution
from magfem.fem.solution import Solution
from magfem.fem.solve_coil import Conduction
from magfem.geometry import Coil, Geometry, Magnets, check_device
from magfem.units import describe


def solve(
    geometry: Geometry,
    dimension: int | None = None,
    resolution: float = 1.0,
    tolerance: float | None = None,
    conduction: Conduction | None = None,
) -> Solution | CoilSolution:
    """Solve a device by finite elements.

    dimension: for magnets 3, or 2 where the field is one of revolution (None: 2 wherever possible); coils have
    none, their current is solved where it flows.
    resolution: factor on the fineness of the mesh; doubling it halves every element.
    tolerance: relative; refines from `resolution` until the stated error of B is below it.
    conduction: for coils of foil "filament", "sheet" or "solid" (None: what thickness and clearance ask for).

    The stated error compares with a second solution on elements twice as large, over random points of the
    device's region. Raises InputError for what cannot be solved, MeshError and ConvergenceError.
    """
    check_device(geometry, "solve")
    dimension = choose_dimension(geometry, dimension)
    check_resolution(resolution, geometry, dimension)
    if tolerance is not None and not (is_number(tolerance) and 0 < tolerance < 1):
        raise InputError(f"tolerance must be a relative error between 0 and 1, got {describe(tolerance)}")
    if isinstance(geometry, Coil):
        return solve_coil.solve_coil(geometry, resolution, tolerance, conduction)
    if conduction is not None:
        raise InputError("conduction is a choice for coils: leave it out for magnets")
    assert isinstance(geometry, Magnets)
    assert dimension is not None
    return solve_magnets.solve_magnets(geometry, dimension, resolution, tolerance)


def choose_dimension(geometry: Geometry, dimension: int | None) -> int | None:
    """The dimension that `solve` takes, None for coils; InputError for one that the device cannot be solved in."""
    if dimension is not None and (not isinstance(dimension, Integral) or dimension not in (2, 3)):
        raise InputError(f"dimension must be 2 or 3, got {describe(dimension)}")
    if dimension == 2 and not geometry.axisymmetric:
        raise InputError("only bodies of revolution with axial magnetisation can be solved in dimension 2: use 3")
    if isinstance(geometry, Coil):
        if dimension is not None:
            raise InputError(
                "dimension is a choice for magnets: a coil's current is solved where it flows, leave it out"
            )
        return None
    if dimension is None:
        return 2 if geometry.axisymmetric else 3
    return int(dimension)


def check_resolution(resolution: float, geometry: Geometry, dimension: int | None) -> None:
    """Raise InputError unless `resolution` lies within what the device can be meshed in."""
    low, high = resolutions(geometry, dimension)
    if not (is_number(resolution) and low <= resolution <= high):
        where = "for coils" if dimension is None else f"in dimension {dimension}"
        raise InputError(f"resolution must lie between {low:g} and {high:g} {where}, got {describe(resolution)}")


def resolutions(geometry: Geometry, dimension: int | None) -> tuple[float, float]:
    """The smallest and the largest resolution of a device in a dimension, None for coils."""
    return solve_coil.RESOLUTIONS if dimension is None else solve_magnets.RESOLUTIONS[dimension]


def is_number(value: object) -> bool:
    """Whether a value is a real number, NumPy's included."""
    return isinstance(value, Real) and not isinstance(value, bool)
