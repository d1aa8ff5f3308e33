"""What a field is: the interface that everything downstream sees, and placed, scaled and summed fields."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError, OutsideRegionError, UnitMismatchError
from magfem.fields.region import Intersection, PlacedRegion, Region
from magfem.typing import ArrayLike, Booleans, Hessians, Jet, Outside, Points, Tensors, Vectors

if TYPE_CHECKING:
    from magfem.fields.terms import Terms

Unit: TypeAlias = Literal["T", "T/A"]
OUTSIDE = ("raise", "nan", "extrapolate")


@runtime_checkable
class Field(Protocol):
    """A magnetic flux density in air and its derivatives, in T, or in T/A for a coil per ampere.

    `points` (..., 3) m, in the field's own frame, broadcast over leading axes. `outside` says what happens at
    points where the field makes no promise: "raise" (OutsideRegionError), "nan" or "extrapolate".
    """

    @property
    def region(self) -> Region: ...
    @property
    def unit(self) -> Unit: ...
    def B(self, points: ArrayLike, outside: Outside = "raise") -> Vectors: ...
    def gradient(self, points: ArrayLike, outside: Outside = "raise") -> Tensors: ...
    def hessian(self, points: ArrayLike, outside: Outside = "raise") -> Hessians: ...
    def jet(self, points: ArrayLike, order: int = 1, outside: Outside = "raise") -> Jet: ...


class Evaluated(ABC):
    """A field that evaluates its jet at plain (n, 3) points; everything else of the interface follows here."""

    if TYPE_CHECKING:  # subclasses give these as properties or as dataclass fields

        @property
        def region(self) -> Region:
            """Where the field holds."""

        @property
        def unit(self) -> Unit:
            """ "T", or "T/A" for a field per ampere."""

    @property
    def scalable(self) -> bool:
        """Whether the field is proportional to its sources; false for iron, and magnets with coils."""
        return True

    @abstractmethod
    def evaluate(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m, whatever the region; `order` 0, 1 or 2."""

    def jet(self, points: ArrayLike, order: int = 1, outside: Outside = "raise") -> Jet:
        """B (..., 3) T, gradient (..., 3, 3) T/m and, for order 2, hessian (..., 3, 3, 3) T/m², in one pass.

        Raises InputError for points that are not (..., 3) numbers, OutsideRegionError as `outside` says.
        """
        if order not in (0, 1, 2):
            raise InputError(f"order must be 0, 1 or 2, got {order!r}")
        array = as_points(points)
        if array.ndim == 1 and outside in OUTSIDE and (outside == "extrapolate" or self.region.contains(array)):
            return tuple(part[0] for part in self.evaluate(array[None], order))  # one point, the short way
        flat = array.reshape(-1, 3)
        promised = promised_points(flat, self.region, outside)
        lead = array.shape[:-1]
        parts = self.evaluate(flat, order) if flat.size else [np.empty((0, *(3,) * r)) for r in (1, 2, 3)]
        jet = []
        for part in parts[: order + 1]:
            if not promised.all():
                part = np.where(promised.reshape(-1, *[1] * (part.ndim - 1)), part, np.nan)
            jet.append(part.reshape(lead + part.shape[1:]))
        return tuple(jet)

    def B(self, points: ArrayLike, outside: Outside = "raise") -> Vectors:
        """Flux density (..., 3) T at `points` (..., 3) m."""
        return self.jet(points, 0, outside)[0]

    def gradient(self, points: ArrayLike, outside: Outside = "raise") -> Tensors:
        """Gradient (..., 3, 3) T/m, [..., i, j] = ∂B_i/∂x_j."""
        return self.jet(points, 1, outside)[1]

    def hessian(self, points: ArrayLike, outside: Outside = "raise") -> Hessians:
        """Hessian (..., 3, 3, 3) T/m², [..., i, j, k] = ∂²B_i/∂x_j∂x_k."""
        return self.jet(points, 2, outside)[2]

    def at(self, pose: RigidTransform) -> Placed:
        """This field moved by `pose`, which maps its frame to the new one. Raises InputError for what is no pose."""
        if not isinstance(pose, RigidTransform):
            raise InputError(
                f"a field is placed by a scipy.spatial.transform.RigidTransform, got {type(pose).__name__}: "
                "RigidTransform.from_translation([x, y, z]) moves it without turning it"
            )
        return Placed(self, pose)

    def __mul__(self, factor: float) -> Scaled:
        return Scaled(self, factor, "T")

    __rmul__ = __mul__

    def __neg__(self) -> Scaled:
        return Scaled(self, -1.0, self.unit)

    # Below, the other operand may be any Field, Evaluated or not; what is no field at all is a TypeError.

    def __add__(self, other: Field) -> Summed:
        return Summed((self, other)) if isinstance(other, Field) else NotImplemented

    def __radd__(self, other: Field) -> Summed:
        return Summed((other, self)) if isinstance(other, Field) else NotImplemented

    def __sub__(self, other: Field) -> Summed:
        return Summed((self, Scaled(other, -1.0, other.unit))) if isinstance(other, Field) else NotImplemented

    def __rsub__(self, other: Field) -> Summed:
        return Summed((other, -self)) if isinstance(other, Field) else NotImplemented


@dataclass(frozen=True)
class Placed(Evaluated):
    """A field seen from the frame that `pose` places it in."""

    field: Field
    pose: RigidTransform

    @property
    def region(self) -> Region:
        return PlacedRegion(self.field.region, self.pose)

    @property
    def unit(self) -> Unit:
        return self.field.unit

    @property
    def scalable(self) -> bool:
        return _scalable(self.field)

    @cached_property
    def lowered(self) -> Terms | None:
        terms = _lowered(self.field)
        return None if terms is None else terms.placed(self.pose)

    def evaluate(self, points: Points, order: int) -> Jet:
        if self.lowered is not None:
            return self.lowered.jet(points, order)
        rotation = self.pose.rotation.as_matrix()
        jet = self.field.jet(self.pose.inv().apply(points), order, outside="extrapolate")
        turned = ["ia,na->ni", "ia,jb,nab->nij", "ia,jb,kc,nabc->nijk"]
        return tuple(
            np.einsum(rule, *[rotation] * (rank + 1), part, optimize=True)
            for rank, (rule, part) in enumerate(zip(turned, jet, strict=False))
        )


@dataclass(frozen=True)
class Scaled(Evaluated):
    """A field times a number: a current in A for a coil's T/A, a plain factor for a linear magnet's T.

    Multiplying a field per ampere gives a field in T; a field that is not linear in its sources (iron,
    magnets with coils at stated currents) raises UnitMismatchError.
    """

    field: Field
    factor: float
    unit: Unit

    def __post_init__(self) -> None:
        if not isinstance(self.factor, (int, float, np.floating, np.integer)):
            raise InputError(f"a field is scaled by a number, got {type(self.factor).__name__}")
        if not math.isfinite(self.factor):
            raise InputError(f"a field is scaled by a finite number, got {self.factor}")
        if not _scalable(self.field):
            raise UnitMismatchError(
                "this field was solved at stated currents and is not proportional to them: solve it at the "
                "wanted currents instead of scaling it"
            )

    @property
    def region(self) -> Region:
        return self.field.region

    @cached_property
    def lowered(self) -> Terms | None:
        terms = _lowered(self.field)
        return None if terms is None else terms.scaled(self.factor)

    def evaluate(self, points: Points, order: int) -> Jet:
        if self.lowered is not None:
            return self.lowered.jet(points, order)
        jet = self.field.jet(points, order, outside="extrapolate")
        return tuple(self.factor * part for part in jet)


@dataclass(frozen=True)
class Summed(Evaluated):
    """The sum of fields of one unit; it holds where all of them hold."""

    fields: tuple[Field, ...]

    def __post_init__(self) -> None:
        if not self.fields:
            raise InputError("a sum of fields needs at least one field")
        units = [field.unit for field in self.fields]
        if len(set(units)) > 1:
            raise UnitMismatchError(
                "fields in T and in T/A cannot be added: multiply the coil's field by its current in A first"
            )

    @property
    def region(self) -> Region:
        return Intersection(tuple(field.region for field in self.fields))

    @property
    def unit(self) -> Unit:
        return self.fields[0].unit

    @property
    def scalable(self) -> bool:
        return all(_scalable(field) for field in self.fields)

    @cached_property
    def lowered(self) -> Terms | None:
        parts = [_lowered(field) for field in self.fields]
        terms = [part for part in parts if part is not None]
        return reduce(add, terms) if len(terms) == len(parts) else None

    def evaluate(self, points: Points, order: int) -> Jet:
        if self.lowered is not None:
            return self.lowered.jet(points, order)
        jets = [field.jet(points, order, outside="extrapolate") for field in self.fields]
        return tuple(np.sum(parts, axis=0) for parts in zip(*jets, strict=True))


def as_points(points: ArrayLike) -> Points:
    """`points` as a float array (..., 3) m; InputError says what is wrong with them."""
    try:
        given = np.asarray(points)
    except (TypeError, ValueError):  # ragged
        given = np.asarray(None)
    if given.dtype.kind not in "fiub":
        raise InputError("points must be real numbers, shape (..., 3), in m")
    array = given.astype(float, copy=False)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"points must have shape (..., 3), got {array.shape}")
    if not (all(map(math.isfinite, array.tolist())) if array.ndim == 1 else np.isfinite(array).all()):
        raise InputError("points must be finite numbers")
    return array


def promised_points(points: Points, region: Region, outside: Outside) -> Booleans:
    """Which of `points` (n, 3) get a value: all for "extrapolate", those of the region for "nan"."""
    if outside not in OUTSIDE:
        raise InputError(f'outside must be "raise", "nan" or "extrapolate", got {outside!r}')
    everything = np.ones(points.shape[0], dtype=bool)
    if outside == "extrapolate" or not points.size:
        return everything
    inside = region.contains(points)
    if outside == "raise" and not inside.all():
        worst = points[np.flatnonzero(~inside)[0]] * 1e3
        raise OutsideRegionError(
            f"{np.count_nonzero(~inside)} of {points.shape[0]} points lie outside the field's region "
            f"({region.describe()}), the first at ({worst[0]:.4g}, {worst[1]:.4g}, {worst[2]:.4g}) mm; "
            'pass outside="nan" or "extrapolate" to go on'
        )
    return inside


def _scalable(field: Field) -> bool:
    return bool(getattr(field, "scalable", True))


def _lowered(field: Field) -> Terms | None:
    """The field's terms, one flat array that one compiled call evaluates; None for fields that have none."""
    terms: Terms | None = getattr(field, "lowered", None)
    return terms
