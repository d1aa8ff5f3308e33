"""What the motor's own stator adds to the field of its rotor, and what that does to a localized pose (Fig. S6.6b).

The stator's two coils carry I cos φ (inner) and I sin φ (outer). Their field at any place is I (b_inner cos φ + b_outer
sin φ): it turns with the rotor, at the same frequency, so that no filter tells them apart. The rotor's moment follows
the stator's field, averaged over the rotor, as a compass needle would: in 1 mT it would swing in about six
milliseconds, so that at some turns per second it lies along the field. Two things reach the sensor:

*The field that is added.* Far away it is that of a moment. Its part that turns with the rotor adds to the rotor's
moment, which the dissertation reckons with: m becomes m + m_s, m_s = I (m_inner,x + m_outer,y)/2, and the distance
comes out short by the share m_s/(3m). The part that turns the other way, I (m_inner,x − m_outer,y)/2, is the smaller
the more alike the coils are. Nearer, the turns at a coil's two ends run opposite ways round the motor, an axial
quadrupole: beside the motor's ends, on its axis, the stator is strongest against the rotor.

*The turning that is uneven.* The coils' fields in the rotor are neither equal nor quite perpendicular, so the stator's
field there is an ellipse, and a needle that follows it does not turn evenly: its angle is φ + ε sin(2φ + …). The
rotor's moment then has a part of the share ε/2 that turns the other way: it makes b_ratio wrong, hence β, α and the
axis. Currents in the inverse ratio of the coils' fields mend part of it, and a phase that makes up for the angle
between them the rest. `localize(swing=True)` finds the swing in the samples, by the third harmonic that it makes, and
undoes it. Friction, which adds a lag, is left out.

The coils' models are closed paths of current (Biot–Savart along the lines of the solved current). Their regions are
where they were checked, 0.3 to 2.7 mm from the stator, but a path's field is exact wherever the path is thin beside the
distance, and the more so the farther: `outside="extrapolate"` is right here, down to the dipole far away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fitting import load_model
from magfem.localization.localize import localize
from magfem.localization.real_numbers import real_numbers
from magfem.localization.rotor import Model, Rotor, as_rotor
from magfem.localization.sensor import Sensor
from magfem.typing import ArrayLike, Floats, Points, Vectors

CURRENT = 0.2
"""A, the amplitude of 6.1.2."""
ROTOR_SIZE = (1e-3, 3e-3)
"""m, diameter and length (6.3.2)."""
DISTANCES: Floats = np.geomspace(5e-3, 40e-3, 25)
"""m from the rotor's centre."""
DIRECTIONS: dict[str, Vectors] = {
    "along the inner coil’s field": np.array([1.0, 0.0, 0.0]),
    "along the outer coil’s field": np.array([0.0, 1.0, 0.0]),
    "45° above both": np.array([0.5, 0.5, np.sqrt(0.5)]),
    "along the axis": np.array([0.0, 0.0, 1.0]),
}
"""Unit vectors in the motor's frame: the axis along +z, the inner coil's field along +x, the outer coil's along +y."""

_THETA = np.radians(45.0)  # where one sensor tells poses well
_AZIMUTHS = np.radians(np.arange(0.0, 360.0, 30.0))
_PHASES = 2 * np.pi * np.arange(64) / 64
_QUIET = Sensor(noise=1e-9)  # T; poses of noiseless samples are looked for


@dataclass(frozen=True, eq=False)
class Stator:
    """Two coils about the rotor.

    inner, outer: their fields, T/A, in the motor's frame.  current: A, the amplitude.  diameter, length: m, of the
    rotor.
    """

    inner: Field
    outer: Field
    current: float = CURRENT
    diameter: float = ROTOR_SIZE[0]
    length: float = ROTOR_SIZE[1]

    def quadratures(self, points: Points) -> tuple[Vectors, Vectors]:
        """The field's parts in cos φ and sin φ (..., 3) T at `points` (..., 3) m."""
        return (
            self.current * self.inner.B(points, outside="extrapolate"),
            self.current * self.outer.B(points, outside="extrapolate"),
        )

    def inside(self) -> tuple[Vectors, Vectors]:
        """The field's parts in cos φ and sin φ (3,) T, averaged over the rotor, which is what turns it."""
        along, weights = np.polynomial.legendre.leggauss(8)
        across, ring = np.polynomial.legendre.leggauss(3)
        turn = 2 * np.pi * np.arange(12) / 12
        radius, height, angle = np.meshgrid(
            self.diameter / 2 * np.sqrt((1 + across) / 2), self.length / 2 * along, turn, indexing="ij"
        )
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
        share = np.multiply.outer(np.multiply.outer(ring, weights), np.ones(turn.size)) / (4 * turn.size)
        cosine, sine = (np.einsum("rza,rzai->i", share, part) for part in self.quadratures(points))
        return cosine, sine

    def field_angle(self, phases: ArrayLike) -> Floats:
        """The direction rad of that average across the axis, at phases φ rad of the currents."""
        cosine, sine = self.inside()
        phase = np.asarray(phases, dtype=float)
        return np.asarray(
            np.arctan2(
                cosine[1] * np.cos(phase) + sine[1] * np.sin(phase), cosine[0] * np.cos(phase) + sine[0] * np.sin(phase)
            )
        )


@dataclass(frozen=True, eq=False)
class FieldComparison:
    """The greatest field of a turn along directions. distances: (d,) m. rotor, stator: (k, d) T at `directions` (k)."""

    directions: tuple[str, ...]
    distances: Floats
    rotor: Floats
    stator: Floats

    @property
    def ratio(self) -> Floats:
        """b_r / b_s (k, d)."""
        return np.asarray(self.rotor / self.stator)


@dataclass(frozen=True, eq=False)
class PoseBias:
    """Errors of localized poses over distances (d,), without noise, the greatest of all azimuths, at β = 45°.

    distance: (d,) relative, with its sign, the mean of the azimuths.  position: (d,) relative to the distance.
    direction, axis: (d,) rad.
    """

    distances: Floats
    distance: Floats
    position: Floats
    direction: Floats
    axis: Floats


@dataclass(frozen=True, eq=False)
class StatorInfluence:
    """Fig. S6.6b and what follows from it.

    added: the bias by the stator's field alone, the rotor turning evenly.  uneven: with the rotor following the
    stator's field as well.  mended: the same with the swing found from the samples, `localize(swing=True)`.
    added_moment: m_s/m, the share by which the stator adds to the rotor's moment.  unevenness: ε rad, the amplitude of
    the rotor's swing twice a turn.
    """

    current: float
    fields: FieldComparison
    added: PoseBias
    uneven: PoseBias
    mended: PoseBias
    added_moment: float
    unevenness: float


def stator_influence(
    rotor: Model = "rotor_1x3",
    inner: Field | str = "stator_1.6x5.5_inner",
    outer: Field | str = "stator_1.6x5.5_outer",
    current: float = CURRENT,
    distances: ArrayLike = DISTANCES,
) -> StatorInfluence:
    """The stator's field beside the rotor's, and the bias that it makes of localized poses.

    inner, outer: the coils' fields in T/A, in the motor's frame.  current: A.  distances: (d,) m.

    Raises InputError for a coil that is not per ampere, or distances that are not beyond the stator, 4 mm.
    """
    magnet = as_rotor(rotor)
    coils = [load_model(coil) if isinstance(coil, str) else coil for coil in (inner, outer)]
    if any(coil.unit != "T/A" for coil in coils):
        raise InputError("a stator's coils need fields in T/A, per ampere")
    far = np.atleast_1d(real_numbers(distances, "distances must be numbers (k,) in m"))
    if far.ndim != 1 or not np.isfinite(far).all() or far.min(initial=np.inf) < 4e-3:
        raise InputError("distances must be numbers (d,) in m, at least 4 mm: nearer is within the motor")
    if not (np.isfinite(current) and current > 0):
        raise InputError(f"current must be a positive amplitude in A, got {current!r}")
    stator = Stator(coils[0], coils[1], float(current))
    even, following = _PHASES, stator.field_angle(_PHASES)
    moments = [_moment(coil) for coil in coils]
    return StatorInfluence(
        current=stator.current,
        fields=field_comparison(magnet, stator, far),
        added=pose_bias(magnet, stator, far, even),
        uneven=pose_bias(magnet, stator, far, following),
        mended=pose_bias(magnet, stator, far, following, swing=True),
        added_moment=float(stator.current * (moments[0][0] + moments[1][1]) / 2 / magnet.moment),
        unevenness=float(np.abs(np.mean(2 * _swing(following, even) * np.exp(-2j * even)))),
    )


def field_comparison(rotor: Rotor, stator: Stator, distances: Floats) -> FieldComparison:
    """The greatest fields of a turn along `DIRECTIONS`."""
    points = np.stack(list(DIRECTIONS.values()))[:, None, :] * distances[:, None]
    cosine, sine, *_ = rotor.quadratures(points)
    return FieldComparison(
        tuple(DIRECTIONS), distances, _greatest(cosine, sine), _greatest(*stator.quadratures(points))
    )


def pose_bias(rotor: Rotor, stator: Stator, distances: Floats, angles: Floats, swing: bool = False) -> PoseBias:
    """Localize the rotor by what a sensor sees of it and of the stator, at `distances` (d,) m.

    angles: (n,) rad, where the rotor is at evenly spaced phases of the currents.
    """
    towards = np.stack(
        [
            np.cos(_THETA) * np.cos(_AZIMUTHS),
            np.cos(_THETA) * np.sin(_AZIMUTHS),
            np.full(_AZIMUTHS.shape, np.sin(_THETA)),
        ],
        axis=-1,
    )
    points = towards * distances[:, None, None]  # (d, a, 3), the sensor in the motor's frame
    phases = 2 * np.pi * np.arange(angles.size) / angles.size
    samples = _turning(rotor.quadratures(points)[:2], angles) + _turning(stator.quadratures(points), phases)
    found = localize(samples, phases / (2 * np.pi), rotor, 1.0, _QUIET, near=-points, swing=swing)
    off = found.position + points
    apart = distances[:, None]
    return PoseBias(
        distances,
        (np.linalg.norm(found.position, axis=-1) / apart - 1).mean(axis=1),
        (np.linalg.norm(off, axis=-1) / apart).max(axis=1),
        _between(found.position, -points).max(axis=1),
        _between(found.axis, np.broadcast_to([0.0, 0.0, 1.0], points.shape)).max(axis=1),
    )


def _turning(quadratures: tuple[Vectors, Vectors], angles: Floats) -> Floats:
    """Samples (..., n, 3) of a field at angles (n,)."""
    cosine, sine = quadratures
    samples: Floats = cosine[..., None, :] * np.cos(angles)[:, None] + sine[..., None, :] * np.sin(angles)[:, None]
    return samples


def _greatest(cosine: Vectors, sine: Vectors) -> Floats:
    return np.asarray(np.linalg.norm(np.stack([cosine, sine], axis=-1), ord=2, axis=(-2, -1)))


def _between(one: Vectors, other: Vectors) -> Floats:
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), (one * other).sum(axis=-1)))


def _swing(angles: Floats, phases: Floats) -> Floats:
    """The difference of angles in (−π, π]."""
    return np.asarray(np.angle(np.exp(1j * (angles - phases))))


def _moment(coil: Field) -> Vectors:
    """A·m² per ampere, by the field far away: at 10 m on three axes a dipole's own component is 2k m."""
    far = 10.0
    along = coil.B(far * np.eye(3), outside="extrapolate")
    return np.asarray(np.diagonal(along) * far**3 / 2e-7)
