"""Where a rotor is, how it lies, how sure that is, and what else it could be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from magfem.localization.frequency import Frequency
from magfem.localization.orientation import orientation
from magfem.localization.real_numbers import real_numbers
from magfem.localization.signal import RotatingField
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points, Vectors

BY_CHANCE = 1e-6
"""Probability of a misfit by noise alone below which it is told."""

SCATTERED = 1.5
"""Of its stated noise: samples that scatter less than so much more are not worth a warning."""


@dataclass(frozen=True, eq=False)
class Branch:
    """One pose that explains the samples.

    position: (..., 3) m.  axis: (..., 3), the rotation is right-handed about it.  phase: (...) rad.  covariance:
    (..., 6, 6), of position (m) and of small turns about the rotor's own x, y and z axes at time zero (rad): the
    first two move the axis, the third is the phase.  log_likelihood: (...).
    """

    position: Points
    axis: Vectors
    phase: Floats
    covariance: Floats
    log_likelihood: Floats

    @property
    def position_deviation(self) -> Floats:
        """(...) m, root of the mean square distance from the true position that the covariance states."""
        return np.asarray(np.sqrt(np.einsum("...ii->...", self.covariance[..., :3, :3])))

    @property
    def axis_deviation(self) -> Floats:
        """(...) rad, root of the mean square angle from the true axis that the covariance states."""
        return np.sqrt(self.covariance[..., 3, 3] + self.covariance[..., 4, 4])


@dataclass(frozen=True, eq=False)
class Pose(Branch):
    """The pose of a turning magnet, seen from the sensor, or in the common frame of several sensors.

    What `Branch` holds is that of the best branch.  branches: all that were found, best first. Where some of many poses
    have fewer of them, what fills up has a log_likelihood of −∞.  turning: the rotation frequency.  fields: what each
    sensor saw.  ambiguous: (...) whether another branch is about as likely, as always with one sensor,
    and with `near` about as near to it.  singular:
    (...) whether the branches ±β meet within what noise makes of β (β near 0 or 90° with one sensor): the covariance
    is not to be trusted there.  inside: (...) whether all sensors are where the rotor's model holds.  converged,
    iterations: (...).  residual: (...) root of the mean square of the standardised residuals; about √(1 − 1/s) with s
    sensors.
    """

    branches: tuple[Branch, ...]
    turning: Frequency
    fields: tuple[RotatingField, ...]
    ambiguous: Booleans
    singular: Booleans
    inside: Booleans
    converged: Booleans
    iterations: Integers
    residual: Floats

    @property
    def frequency(self) -> Floats:
        """(...) Hz at time zero."""
        return self.turning.at_zero

    @property
    def distance(self) -> Floats:
        """(...) m, from the origin."""
        return np.asarray(np.linalg.norm(self.position, axis=-1))

    @property
    def scattered(self) -> Booleans:
        """(...) whether the samples of a sensor scatter more about an even rotation than its stated noise says."""
        told = [np.zeros(np.shape(self.residual), dtype=bool)]
        for one in self.fields:
            freedom = np.maximum(one.count - 3, 0).sum(axis=-1)
            square = np.sum(np.maximum(one.count - 3, 0) * (one.residual / one.noise) ** 2, axis=-1)
            told.append(square > np.maximum(SCATTERED**2 * freedom, chi2.isf(BY_CHANCE, np.maximum(freedom, 1))))
        return np.asarray(np.any(told, axis=0))

    @property
    def contradicted(self) -> Booleans:
        """(...) whether sensors see what no pose explains. One alone, six numbers for six unknowns, cannot."""
        count = 6 * len(self.fields)
        if count == 6:
            return np.zeros(np.shape(self.residual), dtype=bool)
        return np.asarray(count * self.residual**2 > chi2.isf(BY_CHANCE, count - 6))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to beware of, in words; empty when all is well."""
        of = f" of {self.singular.size} poses" if self.singular.size > 1 else ""
        said = (
            (~self.converged, "the refinement did not converge"),
            (~self.inside, "a sensor lies outside the region that the rotor's model was fitted for"),
            (
                self.singular,
                "the sensor is near the rotation plane or near the axis, where one sensor is blind to beta",
            ),
            (
                self.scattered,
                "the samples scatter more than their noise: another magnet, an uneven rotation or a full sensor is not "
                "in the covariance",
            ),
            (
                self.contradicted,
                "the sensors contradict each other: look at their poses, gains and noise, and at the magnet's model",
            ),
            (self.ambiguous, "another branch is as likely: state where the rotor is about, or use a second sensor"),
        )
        return tuple((f"{np.count_nonzero(flag)}{of}: " if of else "") + words for flag, words in said if np.any(flag))

    def moment_direction(self, time: ArrayLike = 0.0) -> Vectors:
        """(..., 3) unit vector of the magnetic moment across the axis at `time` (...) s, broadcast with the poses.

        A rotor that is stopped and locked at that time bends in the plane of this direction and the axis.
        """
        t = real_numbers(time, "a time must be real numbers in s")
        angle = self.phase + self.turning.angle(t)
        return orientation(np.broadcast_to(self.axis, (*np.shape(angle), 3)), angle)[..., 0]
