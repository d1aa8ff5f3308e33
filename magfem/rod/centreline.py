"""The centreline of a rod: position, direction, curvature and frames along its arc length."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.rod.centreline_basis import CentrelineBasis
from magfem.rod.moving_frame import rotation_minimising
from magfem.typing import ArrayLike, Booleans, Floats, Points, Vectors

_FRAME_STEPS = 192  # for rotation-minimising frames; their error falls with the fourth power


@dataclass(frozen=True, eq=False, repr=False)
class Centreline:
    """p(s) = base + Σ c_k φ_k(s), or base + s·base_tangent + Σ c_k φ_k(s).

    base: (3,) m.  base_tangent: unit (3,), or None where it was free.  coefficients: (K, 3) m.  covariance: (3K, 3K)
    m², of `coefficients.ravel()`, from the residuals of the fit; zeros when there was none.  noise: standard
    deviation of the data, one coordinate, in their unit (m; pixels for views).  used: which data the fit kept.
    gap: how far the curve strays from the nearest of them, in their unit: a stretch that was not seen, or, in pictures,
    a rod that points into a camera, whose end nothing holds.  iterations: of the fit.

    Methods take arc lengths (...,) m between 0 and the rod's length and raise InputError outside.
    """

    basis: CentrelineBasis
    base: Floats
    base_tangent: Floats | None
    coefficients: Floats
    covariance: Floats
    noise: float = 0.0
    used: Booleans = field(default_factory=lambda: np.ones(0, bool))
    gap: float = 0.0
    iterations: int = 0

    def __repr__(self) -> str:
        tip = ", ".join(f"{1e3 * value:.4g}" for value in self.position(self.length))
        return f"<Centreline: {1e3 * self.length:.4g} mm, tip at ({tip}) mm, {self.coefficients.shape[0]} functions>"

    @property
    def length(self) -> float:
        """Of the rod, m."""
        return self.basis.length

    @cached_property
    def pieces(self) -> Floats:
        """(4, P, degree + 1, 3): Legendre coefficients of the curve, without its base, and of three derivatives."""
        found = self.basis.tables @ self.coefficients
        if self.base_tangent is not None:
            breaks = self.basis.breaks
            found[0, :, 0] += (breaks[1:] + breaks[:-1])[:, None] / 2 * self.base_tangent
            found[0, :, 1] += np.diff(breaks)[:, None] / 2 * self.base_tangent
            found[1, :, 0] += self.base_tangent
        return found

    def derivatives(self, s: ArrayLike, order: int) -> list[Vectors]:
        """p and its first `order` ≤ 3 derivatives with respect to s, each (..., 3)."""
        arc = self._arc(s)
        piece, values = self.basis.local(arc.ravel())
        found = np.einsum("nd,jndc->jnc", values, self.pieces[: order + 1, piece])
        found[0] += self.base
        return list(found.reshape(order + 1, *arc.shape, 3))

    def position(self, s: ArrayLike) -> Points:
        """(..., 3) m."""
        return self.derivatives(s, 0)[0]

    def tangent(self, s: ArrayLike) -> Vectors:
        """(..., 3) unit vectors towards the tip: the exact derivative of the curve."""
        return _unit(self.derivatives(s, 1)[1])

    def curvature_binormal(self, s: ArrayLike) -> Vectors:
        """(..., 3) 1/m: t × dt/ds in world axes, of length κ (eq. 3.9) along the axis about which the rod bends.

        Zero on straight stretches, and smooth through them, unlike any frame of normals.
        """
        _, first, second = self.derivatives(s, 2)
        found: Vectors = np.cross(first, second) / np.linalg.norm(first, axis=-1, keepdims=True) ** 3
        return found

    def curvature(self, s: ArrayLike) -> Floats:
        """κ (...,) 1/m, eq. 3.9."""
        found: Floats = np.linalg.norm(self.curvature_binormal(s), axis=-1)
        return found

    def torsion(self, s: ArrayLike) -> Floats:
        """τ (...,) 1/m: (p' × p'')·p''' / |p' × p''|². Eq. 3.9 prints p'' for the last factor, which gives zero always.

        Raises InputError where the curve is straight: it has no torsion there.
        """
        _, first, second, third = self.derivatives(s, 3)
        binormal = np.cross(first, second)
        size = self._bent(first, binormal)
        found: Floats = np.sum(binormal * third, axis=-1) / size**2
        return found

    def frenet_frames(self, s: ArrayLike) -> Floats:
        """(..., 3, 3): columns r, b, t of eqs. 3.7 and 3.10. Raises InputError where the curve is straight.

        There normal and binormal are undefined, and they flip through inflections: `frames` has neither trouble.
        """
        _, first, second = self.derivatives(s, 2)
        binormal = np.cross(first, second)
        b, t = binormal / self._bent(first, binormal)[..., None], _unit(first)
        return np.stack([np.cross(b, t), b, t], axis=-1)

    def frames(self, s: ArrayLike, base: Rotation | None = None) -> Floats:
        """(..., 3, 3): rotation-minimising frames, columns d1, d2, t; defined on straight stretches as well.

        They do not turn about the tangent, as an elastic rod without torsion does not. base: orientation at s = 0,
        whose z must be the tangent there to 1e-6; by default the smallest turn of +z to the tangent.
        """
        arc = self._arc(s)
        grid = np.union1d(np.linspace(0, self.length, _FRAME_STEPS + 1), arc.ravel())
        points, tangents = self.derivatives(grid, 1)
        found = rotation_minimising(points, _unit(tangents), base)[np.searchsorted(grid, arc.ravel())]
        return found.reshape(*arc.shape, 3, 3)

    def curvature_vector(self, s: ArrayLike, base: Rotation | None = None) -> Vectors:
        """u (..., 3) 1/m of eq. 3.11 in the axes of `frames`: what a rod takes as its intrinsic curvature.

        Its third component, twist, is zero. In Frenet's frame the same curve has u = (0, κ, τ).
        """
        found: Vectors = np.einsum("...ij,...i->...j", self.frames(s, base), self.curvature_binormal(s))
        found[..., 2] = 0.0
        return found

    def position_covariance(self, s: ArrayLike) -> Floats:
        """(..., 3, 3) m², of the data's noise; what the polynomial cannot follow is not in it."""
        arc = self._arc(s)
        return self._spread(self.basis.functions(arc.ravel())).reshape(*arc.shape, 3, 3)

    def tangent_covariance(self, s: ArrayLike) -> Floats:
        """(..., 3, 3) rad², of rank 2: deviations of a unit vector are normal to it."""
        arc = self._arc(s)
        first = self.derivatives(arc.ravel(), 1)[1]
        speed = np.linalg.norm(first, axis=-1)[:, None, None]
        t = first / speed[:, 0]
        turn = (np.eye(3) - t[:, :, None] * t[:, None, :]) / speed
        found = turn @ self._spread(self.basis.functions(arc.ravel(), 1)) @ turn
        return np.asarray(found.reshape(*arc.shape, 3, 3))

    def _spread(self, functions: Floats) -> Floats:
        count = functions.shape[1]
        found: Floats = np.einsum(
            "nk,kalb,nl->nab", functions, self.covariance.reshape(count, 3, count, 3), functions, optimize=True
        )
        return found

    def _arc(self, s: ArrayLike) -> Floats:
        arc = np.asarray(s, dtype=float)
        margin = 1e-9 * self.length
        if not np.all((arc >= -margin) & (arc <= self.length + margin)):
            raise InputError(f"centreline: arc lengths must lie between 0 and the rod's length {self.length:g} m")
        return np.asarray(np.clip(arc, 0.0, self.length))

    def _bent(self, first: Vectors, binormal: Vectors) -> Floats:
        size: Floats = np.linalg.norm(binormal, axis=-1)
        if np.any(size * self.length <= 1e-9 * np.linalg.norm(first, axis=-1) ** 3):
            raise InputError(
                "centreline: Frenet's frame is undefined where the rod is straight; use the rotation-minimising frames"
            )
        return size


def _unit(vectors: Vectors) -> Vectors:
    found: Vectors = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found
