"""The dissertation's own localization of a rotating magnet (eqs. 6.7 to 6.14, Fig. S6.7), kept as a baseline.

From samples to a pose, as printed:

1. The static field is the zero bin of the Fourier transform, the mean; what is left is the rotor's.
2. Its plane: the normal ω_b with the least sum of |ω_b · b̂_i| over the samples' directions (6.7).
3. Its ellipse: a conic by least squares through the samples in that plane; the semi-axes are b_max and b_min.
4. b_ratio = |b_max| / |b_min|, no more than 2.
5. β in [0°, 90°] whose isoline function b_ratio(β) is nearest (6.8); from it |p_e(|b_max|, β)| (6.9) and α(β) (6.10).
6. The pose, by turns R_min(ψ) about b_min through ψ, which stay in the magnetization plane:

       p̂_m = c_1 R_min(c_2 α) ω_b                          (6.11)
       p_m = |p_e| p̂_m                                     (6.12)
       ω_m = c_2 R_min(c_2 (α − β + c_2 π/2)) ω_b          (6.13)

7. The signs c_1 and c_2 for which p̂_m is nearest to the prior position's direction (6.14).

**Why 6.11 and 6.13 hold.** Seen from the rotor, let the sensor be at the polar angle θ in the plane of moment (x) and
axis (z), 0 ≤ θ ≤ 90°. As the moment passes, a dipole's field there is b_max ∝ (3 cos²θ − 1, 0, 3 cos θ sin θ); a
quarter of a turn later it is b_min ∝ (0, −1, 0). So the field turns about ω_b = b_max × b_min, along (3 cos θ sin θ, 0,
1 − 3 cos²θ), which makes the angle α with p_e, tan α = 2 cot θ. A turn about b_min = −y runs from x towards z, just as
θ does, so that ω_b stands at the polar angle θ − α: p̂_e = R_min(α) ω_b, and the axis, at 90°, is R_min(α − θ + π/2)
ω_b. The rotor is seen at −p_e: c_1 = −1, c_2 = +1. Changing c_2 mirrors the pose in the plane of the field. In 6.13 as
printed c_2 = −1 gives −R_min(−(α − θ) + π/2) = R_min(−(α − θ) − π/2), half a turn about b_min being −1 in the plane:
6.13 is ω_m = R_min(c_2 (α − θ + π/2)) ω_b, the mirror image, and right for both signs. The field of a dipole is even in
p, hence c_1 in 6.11 and none in 6.13.

What is not right in 6.13 is that β stands there for θ: see `isolines`, whose `parametrisation` mends it.

**What the printed text leaves open.** The sign of ω_b (6.7 has ±), which 6.13 hands on to ω_m: here it is taken from
the sense in which successive samples turn, so that the rotor turns right-handed about `axis`; that needs more than two
samples a turn. The sign of b_min is arbitrary and c_2 takes it up.

Of the prior, 6.14 uses the direction alone. A wrong c_2 turns p̂_m by 2α and the axis by twice 90° − (θ − α), about as a
line 37° at θ = 45° and nothing at 0° and 90° (the text says 90°).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import as_points
from magfem.localization.ellipse_fit import principal_axes
from magfem.localization.isolines import IsolineFunctions
from magfem.localization.plane_fit import least_absolute_normal, perpendicular_pair
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points, Vectors

BRANCHES: Integers = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
"""(c_1, c_2) of the four branches."""
LARGEST_RATIO = 2.0
"""b_ratio of a dipole is between 1 and this."""

_ROUNDING = 1e-13  # of the static field: what is less is no motion
_FEWEST = 6  # samples: five numbers of the conic, and the mean


@dataclass(frozen=True, eq=False)
class FieldEllipse:
    """The ellipse that a rotating field's samples trace (6.3.6).

    static: (..., 3) T.  axis: (..., 3) unit, about which the field turns right-handed.  greatest, least: (..., 3) T,
    the semi-axes b_max and b_min, each up to its sign; NaN where the samples' conic is no ellipse.
    """

    static: Vectors
    axis: Vectors
    greatest: Vectors
    least: Vectors

    @property
    def strength(self) -> Floats:
        """|b_max| (...) T, the isoline's field strength."""
        strength: Floats = np.linalg.norm(self.greatest, axis=-1)
        return strength

    @property
    def ratio(self) -> Floats:
        """|b_max| / |b_min| (...) as measured, before it is limited to 2."""
        ratio: Floats = self.strength / np.linalg.norm(self.least, axis=-1)
        return ratio


@dataclass(frozen=True, eq=False)
class PublishedPose:
    """Poses by the published algorithm, in the sensor's frame, over leading axes (...).

    position: (..., 3) m, the rotor seen from the sensor.  axis: (..., 3) unit, about which it turns right-handed.
    signs: (..., 2) c_1 and c_2 of the branch chosen.  positions, axes: (..., 4, 3) of all branches, as `BRANCHES`.
    beta, alpha: (...) rad, the isoline angles.  ratio: (...) limited to 1 … 2.  ellipse: what was measured.

    All are NaN where the samples trace no ellipse, which `found` tells.
    """

    position: Points
    axis: Vectors
    signs: Integers
    positions: Points
    axes: Vectors
    beta: Floats
    alpha: Floats
    ratio: Floats
    ellipse: FieldEllipse

    @property
    def strength(self) -> Floats:
        """|b_max| (...) T."""
        return self.ellipse.strength

    @property
    def found(self) -> Booleans:
        """(...) whether there is a pose."""
        return np.isfinite(self.beta)


def localize_as_published(
    samples: ArrayLike, times: ArrayLike, isolines: IsolineFunctions, near: ArrayLike
) -> PublishedPose:
    """Poses of a rotor from samples (..., n, 3) T of one sensor at times (n,) s; NaN samples are missing.

    near: (..., 3) m, the prior position that chooses the branch (6.14). There is no starting from nothing: the
    algorithm cannot tell its four branches by itself.

    Raises InputError for arrays that do not fit, or fewer than six samples.
    """
    prior = as_points(near)
    if not np.linalg.norm(prior, axis=-1).all():
        raise InputError("the prior position must not be the sensor's own place: it has no direction there")
    ellipse = field_ellipse(samples, times)
    try:
        np.broadcast_shapes(prior.shape, ellipse.axis.shape)
    except ValueError:
        raise InputError(
            f"near must be positions that go with the samples' leading axes {ellipse.axis.shape[:-1]}, "
            f"got shape {prior.shape}"
        ) from None
    return _chosen(ellipse, isolines, prior)


def track_as_published(
    samples: ArrayLike, times: ArrayLike, isolines: IsolineFunctions, start: ArrayLike
) -> PublishedPose:
    """Poses (k,) along a track from samples (k, n, 3) T, each found position the next one's prior (Fig. S6.7).

    start: (3,) m, where the rotor is at first. A window without a pose leaves the prior as it was. A wrong branch is
    handed on, as the dissertation observes (Fig. 6.7).

    Raises as `localize_as_published` does.
    """
    prior = as_points(start)
    ellipse = field_ellipse(samples, times)
    if ellipse.axis.ndim != 2 or prior.shape != (3,) or not prior.any():
        raise InputError("a track needs samples (k, n, 3) and one start (3,) apart from the sensor")
    every = _branches(ellipse, isolines)
    priors = np.empty((ellipse.axis.shape[0], 3))
    for k, places in enumerate(every[2]):
        priors[k] = prior
        if np.isfinite(places).all():
            prior = places[_nearest(places, prior)]
    return _chosen(ellipse, isolines, priors)


def field_ellipse(samples: ArrayLike, times: ArrayLike) -> FieldEllipse:
    """The ellipse of samples (..., n, 3) T at times (n,) s in any order; NaN samples are missing (6.7, 6.3.6).

    Raises InputError for arrays that do not fit, or fewer than six samples.
    """
    given, moments = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    if given.ndim < 2 or given.shape[-1] != 3:
        raise InputError(f"samples must have shape (..., n, 3), got {given.shape}")
    if moments.shape != given.shape[-2:-1] or not np.isfinite(moments).all():
        raise InputError(
            f"times must be {given.shape[-2]} finite numbers, one for each sample, got shape {moments.shape}"
        )
    given = given[..., moments.argsort(kind="stable"), :]
    present = np.asarray(np.isfinite(given).all(axis=-1))
    count = present.sum(axis=-1)
    if count.min(initial=_FEWEST) < _FEWEST:
        raise InputError(f"an ellipse needs at least {_FEWEST} samples of all three axes, got {count.min()}")
    static = np.where(present[..., None], given, 0.0).sum(axis=-2) / count[..., None]
    moving = np.where(present[..., None], given - static[..., None, :], 0.0)
    size = np.linalg.norm(moving, axis=-1, keepdims=True)
    moving = np.where(size > _ROUNDING * np.linalg.norm(static, axis=-1)[..., None, None], moving, 0.0)
    axis = least_absolute_normal(np.divide(moving, size, out=np.zeros_like(moving), where=size > 0))
    turned = np.cross(moving[..., :-1, :], moving[..., 1:, :]).sum(axis=-2)  # missing samples are zero
    axis = axis * np.where((turned * axis).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    frame = np.stack(perpendicular_pair(axis), axis=-1)  # (..., 3, 2), with the axis right-handed
    flat = np.where(present[..., None], moving @ frame, np.nan)
    greatest, least = principal_axes(flat)
    return FieldEllipse(
        static, axis, np.einsum("...ij,...j->...i", frame, greatest), np.einsum("...ij,...j->...i", frame, least)
    )


def branches(
    field_axis: Vectors, least: Vectors, distance: ArrayLike, alpha: ArrayLike, theta: ArrayLike
) -> tuple[Points, Vectors]:
    """Positions (..., 4, 3) m and axes (..., 4, 3) of the four branches by 6.11 to 6.13, in the order of `BRANCHES`.

    field_axis: (..., 3) unit.  least: (..., 3), any length and sign.  distance: m; alpha, theta: rad, (...).
    """
    distances, alphas, thetas = (np.asarray(part, dtype=float)[..., None] for part in (distance, alpha, theta))
    c_1, c_2 = BRANCHES.T
    direction = c_1[:, None] * _turned(field_axis, least, c_2 * alphas)
    axes = c_2[:, None] * _turned(field_axis, least, c_2 * (alphas - thetas + c_2 * np.pi / 2))
    return distances[..., None] * direction, axes


def _branches(ellipse: FieldEllipse, isolines: IsolineFunctions) -> tuple[Floats, Floats, Points, Vectors, Floats]:
    """β, α, positions, axes and the limited ratio."""
    ratio = np.clip(ellipse.ratio, 1.0, LARGEST_RATIO)
    beta = isolines.beta_of_ratio(ratio)
    alpha = isolines.angle(beta)
    distance = isolines.distance(ellipse.strength, beta)
    return beta, alpha, *branches(ellipse.axis, ellipse.least, distance, alpha, beta), ratio


def _chosen(ellipse: FieldEllipse, isolines: IsolineFunctions, prior: Points) -> PublishedPose:
    beta, alpha, positions, axes, ratio = _branches(ellipse, isolines)
    shape = np.broadcast_shapes(prior.shape, ellipse.axis.shape)[:-1]
    positions, axes = (np.broadcast_to(part, (*shape, 4, 3)) for part in (positions, axes))
    best = _nearest(positions, prior)
    position, axis = (np.take_along_axis(part, best[..., None, None], axis=-2)[..., 0, :] for part in (positions, axes))
    return PublishedPose(position, axis, BRANCHES[best], positions, axes, beta, alpha, ratio, ellipse)


def _nearest(positions: Points, prior: Points) -> Integers:
    """The branch (...) of positions (..., 4, 3) at the least angle from the prior (..., 3)."""
    cosines = (positions * prior[..., None, :]).sum(axis=-1)  # all four at one distance
    nearest: Integers = np.nan_to_num(cosines, nan=-np.inf).argmax(axis=-1)
    return nearest


def _turned(vectors: Vectors, axes: Vectors, angles: Floats) -> Vectors:
    """Vectors (..., 3) turned about perpendicular axes (..., 3) of any length through angles (..., b): (..., b, 3)."""
    unit = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    across = np.cross(unit, vectors)
    turned: Vectors = (
        vectors[..., None, :] * np.cos(angles)[..., None] + across[..., None, :] * np.sin(angles)[..., None]
    )
    return turned
