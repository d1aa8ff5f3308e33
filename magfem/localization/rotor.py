"""A field model that turns about an axis, and what of its field varies once per turn.

At a fixed place the field of a turning magnet is b₀ + C cos φ + S sin φ and, very near, terms in 2φ, 3φ and so on.
C and S are harmonic fields themselves, and S is C turned by a quarter about the axis. A diametric cylinder that turns
about its own axis has no higher terms at all: every harmonic of its field has order 1.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import InputError
from magfem.fields import Field, Region, Summed
from magfem.fields.field import Placed, Scaled
from magfem.fields.term_kinds import HARMONIC
from magfem.fields.terms import Terms, frame_about
from magfem.fitting import load_model
from magfem.localization.real_numbers import real_numbers
from magfem.typing import ArrayLike, Floats, Points, Tensors, Vectors

_FORTH = np.array([np.eye(3), [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])  # no turn, a quarter turn
_BACK = np.swapaxes(_FORTH, -1, -2)
_FEWEST_COPIES = 16
_ON_AXIS = 1e-12  # of sines and of m


@dataclass(frozen=True, eq=False)
class Rotor:
    """A magnet that turns right-handed about +z of its frame, its moment across the axis along +x at angle zero.

    field: the whole field, T, in this frame at angle zero.  turning: the part of it that varies once per turn: the
    field C above.  moment: A·m², across the axis: of a moment m tilted against the axis, m sin(tilt).  along: A·m², the
    part along the axis, whose field does not vary.
    """

    field: Field
    turning: Field
    moment: float
    along: float

    @property
    def region(self) -> Region:
        """Where the field model holds, in the rotor's frame."""
        return self.field.region

    def quadratures(self, points: Points) -> tuple[Vectors, Vectors, Tensors, Tensors]:
        """C, S (..., 3) T at `points` (..., 3) m of the rotor's frame, and their gradients (..., 3, 3) T/m.

        Whatever the region: harmonics fall off as they should beyond it, and `Pose.inside` tells.
        """
        B, gradient = self.stacked_quadratures(points)
        return B[..., 0, :], B[..., 1, :], gradient[..., 0, :, :], gradient[..., 1, :, :]

    def stacked_quadratures(self, points: Points) -> tuple[Vectors, Tensors]:
        """The same as two arrays: C and S (..., 2, 3) T, and their gradients (..., 2, 3, 3) T/m."""
        seen = (_BACK @ points[..., None, :, None])[..., 0]  # S is C turned by a quarter: where C is looked at for it
        B, gradient = self.turning.jet(seen, 1, outside="extrapolate")
        return (_FORTH @ B[..., None])[..., 0], _FORTH @ gradient @ _BACK

    def steady(self, points: Points) -> tuple[Vectors, Tensors]:
        """b₀ (..., 3) T at `points` (..., 3) m of the rotor's frame, the mean over a turn, and its gradient T/m.

        It comes of a moment along the axis, and of even harmonics very near; a diametric cylinder has none.
        """
        points = np.asarray(points, dtype=float)
        if self.turning is self.field:
            return np.zeros(points.shape), np.zeros((*points.shape, 3))
        angles = 2 * np.pi * np.arange(copies := _copies(self.field)) / copies
        turns = Rotation.from_rotvec(angles[:, None] * np.array([0.0, 0.0, 1.0])).as_matrix()
        seen = np.einsum("cij,...i->c...j", turns, points)
        B, gradient = self.field.jet(seen, 1, outside="extrapolate")
        turned = np.einsum("cij,c...jk,clk->...il", turns, gradient, turns)
        return np.einsum("cij,c...j->...i", turns, B) / copies, turned / copies


Model: TypeAlias = Rotor | Field | str | os.PathLike[str]
"""A rotor, a field model of one, or the model's name or file."""


def as_rotor(model: Model, rotation_axis: ArrayLike = (0.0, 0.0, 1.0)) -> Rotor:
    """The rotor of a field model, a catalogue name or a model file.

    rotation_axis: (3,) in the model's frame; about +z unless stated. A rotor is given back as it is. Raises InputError
    for a model without a moment across the axis, one per ampere, or an axis that is none.
    """
    if isinstance(model, Rotor):
        return model
    if isinstance(model, str | os.PathLike):
        model = load_model(str(model))
    if not isinstance(model, Field):
        raise InputError(f"a rotor is a field model or its name, got {type(model).__name__}")
    if model.unit != "T":
        raise InputError("a rotor's field must be in T: multiply a coil's model by its current in A first")
    words = "rotation_axis must be three numbers, not all zero"
    axis = real_numbers(rotation_axis, words)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        raise InputError(f"{words}, got {rotation_axis!r}")
    axis = axis / np.abs(axis).max()
    axis /= np.linalg.norm(axis)
    moment = _moment(model)
    along = float(moment @ axis)
    across = float(np.linalg.norm(moment - along * axis))
    if not across > 1e-9 * np.linalg.norm(moment):
        raise InputError(
            "the model's magnetic moment lies along the rotation axis: its field does not vary as it turns; state "
            "rotation_axis in the model's frame"
        )
    frame = frame_about(axis, moment)
    field: Field = model
    if not np.allclose(frame, np.eye(3), atol=1e-14):
        field = Placed(model, RigidTransform.from_rotation(Rotation.from_matrix(frame.T)))
    return Rotor(field, _turning(field), across, along)


def _moment(model: Field) -> Floats:
    stated = getattr(model, "moment", None)
    if stated is None and isinstance(terms := getattr(model, "lowered", None), Terms):
        stated = terms.moment
    if stated is None:
        raise InputError("a rotor's model must state its magnetic moment: use a fitted model or a DipoleField")
    return np.asarray(stated, dtype=float)


def _turning(field: Field) -> Field:
    """The part of `field` with azimuthal order 1 about z: the average of turned copies, weighted with a cosine.

    The average leaves all orders out but 1 and those next to multiples of the number of copies; this is more than the
    highest degree, beyond which harmonics about the axis have no orders.
    """
    terms = getattr(field, "lowered", None)
    if isinstance(terms, Terms) and _of_order_one(terms):
        return field
    copies = _copies(field)
    angles = 2 * np.pi * np.arange(copies) / copies
    turned = [
        Scaled(
            Placed(field, RigidTransform.from_rotation(Rotation.from_rotvec([0.0, 0.0, angle]))),
            2 * np.cos(angle) / copies,
            "T",
        )
        for angle in angles
    ]
    return Summed(tuple(turned))


def _copies(field: Field) -> int:
    terms = getattr(field, "lowered", None)
    highest = int(terms.degree.max()) if isinstance(terms, Terms) else 0
    return max(_FEWEST_COPIES, highest + 2)


def _of_order_one(terms: Terms) -> bool:
    """Whether all there is of the field are harmonics of order 1 about the z axis, from centres on it."""
    centred = np.all(np.abs(terms.centre[:, :2]) < _ON_AXIS)
    upright = np.all(np.abs(terms.frame[:, :2, 2]) < _ON_AXIS)
    return bool(
        centred
        and upright
        and np.all(terms.kind == HARMONIC)
        and np.all((terms.order == 1) | (terms.coefficient == 0.0))
    )
