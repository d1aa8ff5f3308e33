"""What the samples of windows say about poses near given ones, and steps towards the likelier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.localization.motion import Likelihoods
from magfem.localization.orientation import rotation_matrix
from magfem.localization.refinement import Measured, linearised
from magfem.localization.rotor import Rotor
from magfem.localization.sensor import SensorArray
from magfem.typing import Floats, Points

LONGEST_TURN = 0.3
"""rad that one step may turn an axis by, and the share of the distance that it may move a position by."""

UNIT_LENGTH = 0.3
"""Standard deviation that the axis' length is given in every window. All windows together hold it well; were it much
smaller, the evidence would count every radial acceleration of an axis that turns against the process noise."""


@dataclass(frozen=True, eq=False)
class Windows:
    """What w windows measured, by which rotor and sensors."""

    rotor: Rotor
    array: SensorArray
    measured: Measured


@dataclass(frozen=True, eq=False)
class PhaseStep:
    """How the phase, which no track keeps, follows a change (w, 6) of position and axis: by `own` + `slope` · change.

    own: (w,) rad.  slope: (w, 6).
    """

    own: Floats
    slope: Floats


def likelihoods(seen: Windows, p: Points, R: Floats, weight: Floats) -> tuple[Likelihoods, PhaseStep]:
    """ℓ of every window, times its weight (w,), about poses (w, 3) m, (w, 3, 3), with the phase eliminated."""
    J, residual = linearised(seen.rotor, seen.array, p, R, seen.measured.quadratures, seen.measured.whitening)
    J[..., :3] = np.einsum("wkj,wij->wki", J[..., :3], R)
    J, residual = J * np.sqrt(weight)[:, None, None], residual * np.sqrt(weight)[:, None]
    # A small change da of the axis is the turn δ_x = −ŷ·da, δ_y = x̂·da about the rotor's axes.
    B = np.zeros((len(p), 6, 7))
    B[:, :3, :3] = np.eye(3)
    B[:, 3, 3:6] = -R[:, :, 1]
    B[:, 4, 3:6] = R[:, :, 0]
    B[:, 5, 6] = 1.0
    J = J @ B
    H = np.einsum("wki,wkj->wij", J, J)
    g = np.einsum("wki,wk->wi", J, residual)
    own = np.maximum(H[:, 6, 6], np.finfo(float).tiny)
    ratio = H[:, 6, :6] / own[:, None]
    information = H[:, :6, :6] - ratio[:, :, None] * H[:, None, 6, :6]
    gradient = g[:, :6] - ratio * g[:, 6:]
    misfit = np.einsum("wk,wk->w", residual, residual) - g[:, 6] ** 2 / own
    axis = R[:, :, 2]
    information[:, 3:, 3:] += axis[:, :, None] * axis[:, None, :] / UNIT_LENGTH**2
    return (
        Likelihoods(np.concatenate([p, axis], axis=-1), gradient, information, misfit),
        PhaseStep(-g[:, 6] / own, -ratio),
    )


def moved(seen: Windows, p: Points, R: Floats, state: Floats, phase: PhaseStep) -> tuple[Points, Floats, Floats]:
    """Poses moved towards states (w, 12), by no more than is safe, and the changes (w,) that were wanted."""
    dp, da = state[:, :3] - p, state[:, 3:6] - R[:, :, 2]
    along = np.einsum("wi,wij->wj", da, R)
    distance = np.linalg.norm(p[:, None, :] - seen.array.positions, axis=-1).min(axis=-1)
    wanted = np.maximum(np.linalg.norm(dp, axis=-1) / distance, np.linalg.norm(along[:, :2], axis=-1))
    short = np.minimum(1.0, LONGEST_TURN / np.maximum(wanted, 1e-300))
    change = np.concatenate([dp, da], axis=-1) * short[:, None]
    turn = phase.own + np.einsum("wi,wi->w", phase.slope, change)
    turn = np.clip(turn, -LONGEST_TURN, LONGEST_TURN)
    delta = np.stack([-along[:, 1] * short, along[:, 0] * short, turn], axis=-1)
    return p + change[:, :3], R @ rotation_matrix(delta), np.maximum(wanted, np.abs(turn))


def misfit(seen: Windows, p: Points, R: Floats) -> Floats:
    """(w,) sum of squared residuals, each over its deviation."""
    _, residual = linearised(seen.rotor, seen.array, p, R, seen.measured.quadratures, seen.measured.whitening)
    return np.asarray(np.einsum("wk,wk->w", residual, residual))
