"""From refined candidates to a pose: which are branches of their own, which is best, and how sure each is."""

from __future__ import annotations

import numpy as np

from magfem.errors import InputError
from magfem.localization.orientation import phase_of
from magfem.localization.pose import Branch, Pose
from magfem.localization.real_numbers import real_numbers
from magfem.localization.refinement import Measured, Refined
from magfem.localization.rotor import Rotor
from magfem.localization.sensor import SensorArray
from magfem.localization.signal import RotatingField
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points

MOST_BRANCHES = 4

AS_LIKELY = 3.0
"""Branches are about as likely when their log likelihoods differ by less: a factor of twenty."""

PLAUSIBLE = 10.0
"""Within this log likelihood of the best a branch may be preferred for lying near where the rotor was."""

FARTHEST = 1e6  # m, of a place that a magnet may be at

CLEARLY = 0.3
"""A branch is clearly nearer to a prior than another when it is by so much of the distance, or rad."""


def best_pose(
    fields: tuple[RotatingField, ...],
    rotor: Rotor,
    array: SensorArray,
    measured: Measured,
    refined: Refined,
    clamped: Booleans,
    near: ArrayLike | Branch | None,
) -> Pose:
    """The likeliest of refined candidates (..., k), or that nearest to `near` of those as likely, with all branches.

    clamped: (..., k) whether a candidate's start had a ratio of singular values that no dipole has. Raises InputError
    for a prior that is no place.
    """
    # log det of the covariance is −2 log det of its whitening, a triangular matrix.
    log_determinant = -2 * np.log(np.abs(np.einsum("...saa->...sa", measured.whitening))).sum(axis=(-2, -1))
    constant = -0.5 * (log_determinant + 6 * len(fields) * np.log(2 * np.pi))
    log_likelihood = constant[..., None] - 0.5 * refined.misfit
    # What was given up is no branch; where nothing converged, all that there is must do.
    ended = refined.converged | ~refined.converged.any(axis=-1, keepdims=True)
    log_likelihood = np.where(ended, log_likelihood, -np.inf)
    apart = _apart(refined, near)
    order, distinct = _ranked(refined, log_likelihood, apart, near is not None)
    kept = int(min(MOST_BRANCHES, distinct.sum(axis=-1).max()))
    order, distinct = order[..., :kept], np.take_along_axis(distinct, order, axis=-1)[..., :kept]

    position = np.take_along_axis(refined.position, order[..., None], axis=-2)
    frame = np.take_along_axis(refined.frame, order[..., None, None], axis=-3)
    information = np.take_along_axis(refined.information, order[..., None, None], axis=-3)
    likelihood = np.where(distinct, np.take_along_axis(log_likelihood, order, axis=-1), -np.inf)
    covariance = _covariance(information, fields[0])
    phase = phase_of(frame)
    branches = tuple(
        Branch(position[..., k, :], frame[..., k, :, 2], phase[..., k], covariance[..., k, :, :], likelihood[..., k])
        for k in range(kept)
    )
    best = branches[0]
    rivals = likelihood[..., 1:] > best.log_likelihood[..., None] - AS_LIKELY
    if near is not None:  # a branch as likely but far from where the rotor is about is none to be in doubt about
        sorted_apart = np.take_along_axis(apart, order, axis=-1)
        rivals &= sorted_apart[..., 1:] < sorted_apart[..., :1] + CLEARLY
    one = len(fields) == 1
    away = np.einsum("...ij,...si->...sj", frame[..., 0, :, :], array.positions - best.position[..., None, :])
    first = order[..., :1]
    misfit = np.take_along_axis(refined.misfit, first, axis=-1)[..., 0]
    return Pose(
        best.position,
        best.axis,
        best.phase,
        best.covariance,
        best.log_likelihood,
        branches=branches,
        turning=fields[0].turning,
        fields=fields,
        ambiguous=np.asarray(rivals.any(axis=-1)),
        singular=np.asarray(
            _singular(best, away[..., 0, :], np.asarray(clamped.any(axis=-1)))
            if one
            else np.zeros(misfit.shape, dtype=bool)
        ),
        inside=np.asarray(rotor.region.contains(away).all(axis=-1)),
        converged=np.take_along_axis(refined.converged, first, axis=-1)[..., 0],
        iterations=np.take_along_axis(refined.iterations, first, axis=-1)[..., 0],
        residual=np.sqrt(misfit / (6 * len(fields))),
    )


def _apart(refined: Refined, near: ArrayLike | Branch | None) -> Floats:
    """(..., k) how far candidates are from where the rotor is about, as shares of the distance and in rad.

    Without a prior, a preference that is always the same: in front of the sensor, z > 0, and the axis nearest to +z.
    """
    position, axis = refined.position, refined.frame[..., 2]
    if near is None:
        return np.asarray(-np.sign(position[..., 2]) + 0.1 * (1 - axis[..., 2]))
    words = "near must be positions (..., 3) in m, or a pose"
    where = near.position if isinstance(near, Branch) else real_numbers(near, words)
    if where.shape[-1:] != (3,) or not np.all(np.abs(where) < FARTHEST):
        raise InputError(words)
    if not _fits(where.shape[:-1], position.shape[:-2]):
        raise InputError(
            f"near {where.shape} does not fit poses with leading axes {position.shape[:-2]}: state one, or one for each"
        )
    size = np.linalg.norm(position, axis=-1)
    apart = np.linalg.norm(position - where[..., None, :], axis=-1) / np.maximum(size, 1e-12)
    if isinstance(near, Branch):
        apart = apart + np.linalg.norm(axis - near.axis[..., None, :], axis=-1)
    return np.asarray(apart)


def _fits(shape: tuple[int, ...], lead: tuple[int, ...]) -> bool:
    """Whether arrays of `shape` broadcast to `lead`, and not beyond."""
    try:
        return np.broadcast_shapes(shape, lead) == lead
    except ValueError:
        return False


def _ranked(refined: Refined, log_likelihood: Floats, apart: Floats, prior: bool) -> tuple[Integers, Booleans]:
    """The order (..., k) of the candidates, best first, and which of them (..., k) are no repetitions of a better one.

    Log likelihoods are compared in steps of a tenth, so that rounding does not order what is equal. With a prior all
    that are plausible are ordered by how far they are from it.
    """
    position, axis = refined.position, refined.frame[..., 2]
    best = log_likelihood.max(axis=-1, keepdims=True)
    behind = np.floor((best - log_likelihood) / 0.1 + 1e-6)
    if prior:
        behind = np.where(best - log_likelihood < PLAUSIBLE, 0.0, behind)
    order = np.lexsort((apart, behind), axis=-1)
    sorted_position = np.take_along_axis(position, order[..., None], axis=-2)
    sorted_axis = np.take_along_axis(axis, order[..., None], axis=-2)
    size = np.linalg.norm(sorted_position, axis=-1)[..., :, None]
    same = np.linalg.norm(sorted_position[..., :, None, :] - sorted_position[..., None, :, :], axis=-1) < 1e-4 * size
    same &= np.linalg.norm(sorted_axis[..., :, None, :] - sorted_axis[..., None, :, :], axis=-1) < 1e-3
    repeated = np.any(np.tril(same, -1), axis=-1) | np.isinf(np.take_along_axis(log_likelihood, order, axis=-1))
    # Repetitions go to the end.
    last = np.argsort(repeated, axis=-1, kind="stable")
    order = np.take_along_axis(order, last, axis=-1)
    distinct = np.empty(order.shape, dtype=bool)
    np.put_along_axis(distinct, order, ~np.take_along_axis(repeated, last, axis=-1), axis=-1)
    return order, distinct


def _covariance(information: Floats, field: RotatingField) -> Floats:
    """(..., k, 6, 6), with what an uncertain frequency adds to the phase at time zero."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", information), np.finfo(float).tiny))
    scaled = information / (size[..., :, None] * size[..., None, :])
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, 1e-15)  # where information is singular, a covariance that is huge and finite
    covariance = np.einsum("...ik,...k,...jk->...ij", vectors, 1 / values, vectors)
    covariance = covariance / (size[..., :, None] * size[..., None, :])
    turning = field.turning
    covariance[..., 5, 5] += (2 * np.pi * turning.middle * np.asarray(turning.deviation))[..., None] ** 2
    return np.asarray(covariance)


def _singular(best: Branch, away: Points, clamped: Booleans) -> Booleans:
    """Whether β is within two of its deviations of 0 or 90°; `away` (..., 3) is the sensor in the rotor's frame."""
    towards = away / np.linalg.norm(away, axis=-1, keepdims=True)
    beta = np.arcsin(np.minimum(np.abs(towards[..., 2]), 1.0))
    deviation = best.axis_deviation
    return np.asarray(clamped | (beta < 2 * deviation) | (np.pi / 2 - beta < 2 * deviation))
