"""Poses that explain measured quadratures best: weighted nonlinear least squares, many poses at once.

The unknowns of a pose are its position and its orientation R, six numbers. With q = Rᵀ(x − p) the sensor's place in the
rotor's frame, c(q) the rotor's field there and G its gradient, a small motion of the rotor by dπ and a small turn δ,
both in its own frame, change the field at the sensor by

    d(R c) = R (−G dπ + (G [q]× − [c]×) δ).

δ_x and δ_y move the axis, δ_z is the phase. Levenberg–Marquardt steps are damped where information is singular: one
sensor near β = 0 or 90°, where two branches meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.localization.orientation import rotation_matrix
from magfem.localization.rotor import Rotor
from magfem.localization.sensor import SensorArray
from magfem.typing import Booleans, Floats, Integers, Points

MOST_ITERATIONS = 200
SMALL_STEP = 1e-11  # of the distance, and rad
NEGLIGIBLE = 1e-8
"""Gain of a step in the misfit that no noise would notice. Where the misfit is small this last step left an error that
is the square of a negligible one: Gauss–Newton converges quadratically there."""

PATIENCE = 50  # steps after which a thousand times that gain counts as none: valleys of wrong branches are long
LIGHT = 1e-3  # damping below which a step with little gain tells of a minimum, not of the damping
HOPEFUL, FALLING = 3, 0.5  # steps before a candidate is given up; share of what it is behind that a step must gain
FIRST_DAMPING = 1e-4  # of the mean of the normal matrix' diagonal
LONGEST_STEP = 0.3  # of the distance, and rad
CLOSEST = 1e-3  # of the first distance: nothing comes nearer to a sensor


@dataclass(frozen=True, eq=False)
class Measured:
    """What s sensors measured: quadratures (..., s, 6) T, C before S, and whitening (..., s, 6, 6) 1/T.

    Both in the sensors' frames; whitening is the inverse of a Cholesky factor of the covariance: W Σ Wᵀ = 1.
    """

    quadratures: Floats
    whitening: Floats


@dataclass(frozen=True, eq=False)
class Refined:
    """position (..., 3) m, frame (..., 3, 3), misfit (...): the sum of squared residuals, each over its deviation.

    information: (..., 6, 6), of position in the common frame (m) and small turns about the rotor's axes (rad).
    converged, iterations: (...).
    """

    position: Points
    frame: Floats
    misfit: Floats
    information: Floats
    converged: Booleans
    iterations: Integers


def refine(
    rotor: Rotor,
    array: SensorArray,
    measured: Measured,
    position: Points,
    frame: Floats,
    give_up: float = np.inf,
) -> Refined:
    """The poses nearest to the starts `position` (..., 3) m, `frame` (..., 3, 3) that explain `measured` best.

    The leading axes of `measured` broadcast to those of the starts, whose last are candidates of one pose.  give_up: a
    candidate whose misfit is by so much above that of another which has converged, and hardly falls, is left where it
    is, not converged.
    """
    lead = position.shape[:-1]
    count = int(np.prod(lead))
    p, R = position.reshape(-1, 3).copy(), frame.reshape(-1, 3, 3).copy()
    target = np.broadcast_to(measured.quadratures, (*lead, *measured.quadratures.shape[-2:])).reshape(count, -1, 6)
    weight = np.broadcast_to(measured.whitening, (*lead, *measured.whitening.shape[-3:])).reshape(count, -1, 6, 6)
    scale = np.linalg.norm(p[:, None, :] - array.positions, axis=-1).min(axis=-1)
    least = CLOSEST * scale

    J, residual = linearised(rotor, array, p, R, target, weight)
    misfit = np.einsum("ni,ni->n", residual, residual)
    damping, growth = np.full(count, FIRST_DAMPING), np.full(count, 2.0)
    converged, iterations = np.zeros(count, dtype=bool), np.zeros(count, dtype=np.int64)
    active = np.arange(count)
    rivals = np.full((max(count // lead[-1], 1) if lead else 1), np.inf)  # the least misfit that has converged, by pose
    pose_of = np.arange(count) // (lead[-1] if lead else 1)
    for _ in range(MOST_ITERATIONS):
        size = np.ones((active.size, 6))
        size[:, :3] = scale[active, None]
        scaled = J * size[:, None, :]
        normal = np.einsum("nki,nkj->nij", scaled, scaled)
        gradient = np.einsum("nki,nk->ni", scaled, residual)
        spread = np.einsum("nii->n", normal) / 6  # one scale for all: small pivots are just what damping is for
        step = -np.linalg.solve(normal + (damping[active] * spread)[:, None, None] * np.eye(6), gradient[..., None])[
            ..., 0
        ]
        length = np.abs(step).max(axis=-1)
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))[:, None]
        tried_p = p[active] + scale[active, None] * np.einsum("nij,nj->ni", R[active], step[:, :3])
        tried_R = R[active] @ rotation_matrix(step[:, 3:])
        tried_J, tried_residual = linearised(rotor, array, tried_p, tried_R, target[active], weight[active])
        tried = np.einsum("ni,ni->n", tried_residual, tried_residual)
        near = np.linalg.norm(tried_p[:, None, :] - array.positions, axis=-1).min(axis=-1)
        better = (tried <= misfit[active]) & (near > least[active])
        gain = misfit[active] - tried
        small = length < SMALL_STEP
        little = np.where(iterations[active] < PATIENCE, NEGLIGIBLE, 1e3 * NEGLIGIBLE)
        flat = better & (gain < np.maximum(little, 1e-14 * tried)) & (damping[active] <= LIGHT)
        stuck = ~better & (damping[active] > 1e8)
        behind = misfit[active] - rivals[pose_of[active]]
        hopeless = (behind > give_up) & (gain < FALLING * behind) & (iterations[active] >= HOPEFUL)
        done = small | flat | stuck | hopeless
        taken = active[better]
        p[taken], R[taken], misfit[taken] = tried_p[better], tried_R[better], tried[better]
        J[better], residual[better] = tried_J[better], tried_residual[better]
        # Nielsen's rule: less damping the better the linear prediction was, and ever more when steps fail.
        predicted = -np.einsum("ni,ni->n", step, 2 * gradient + np.einsum("nij,nj->ni", normal, step))
        ratio = np.clip(gain / np.maximum(predicted, 1e-300), -1.0, 1.0)
        less = damping[active] * np.maximum(0.1, 1 - (2 * ratio - 1) ** 3)
        damping[active] = np.where(better, np.maximum(less, 1e-15), growth[active] * damping[active])
        growth[active] = np.where(better, 2.0, 2 * growth[active])
        iterations[active] += 1
        # Rejected small steps end at a minimum as well: rounding is all that is left.
        ended = small | flat | (stuck & (length < 1e-6))
        converged[active[ended]] = True
        np.minimum.at(rivals, pose_of[active[ended]], misfit[active[ended]])
        if done.all():
            break
        keep = ~done
        active, J, residual = active[keep], J[keep], residual[keep]
    U, _, V = np.linalg.svd(R)
    R = U @ V  # many small turns leave a matrix that is a rotation to a few roundings
    J, _ = linearised(rotor, array, p, R, target, weight)
    J[..., :3] = np.einsum("nkj,nij->nki", J[..., :3], R)  # from the rotor's frame to the common one
    return Refined(
        position=p.reshape(*lead, 3),
        frame=R.reshape(*lead, 3, 3),
        misfit=misfit.reshape(lead),
        information=np.einsum("nki,nkj->nij", J, J).reshape(*lead, 6, 6),
        converged=converged.reshape(lead),
        iterations=iterations.reshape(lead),
    )


def quadratures_at(rotor: Rotor, array: SensorArray, position: Points, frame: Floats) -> Floats:
    """(..., s, 6) T: C and S that the sensors see, in their own frames, of rotors at `position` with `frame`."""
    return _modelled(rotor, array, position.reshape(-1, 3), frame.reshape(-1, 3, 3))[0].reshape(
        *position.shape[:-1], -1, 6
    )


def information(rotor: Rotor, array: SensorArray, position: Points, frame: Floats, whitening: Floats) -> Floats:
    """(..., 6, 6) Fisher information of position in the common frame (m) and turns about the rotor's axes (rad)."""
    lead = position.shape[:-1]
    p, R = position.reshape(-1, 3), frame.reshape(-1, 3, 3)
    _, J = _modelled(rotor, array, p, R)
    J[..., :3] = np.einsum("nskj,nij->nski", J[..., :3], R)
    J = np.broadcast_to(whitening, (*lead, len(array.sensors), 6, 6)).reshape(len(p), -1, 6, 6) @ J
    found: Floats = np.einsum("nski,nskj->nij", J, J).reshape(*lead, 6, 6)
    return found


def linearised(
    rotor: Rotor, array: SensorArray, p: Points, R: Floats, target: Floats, weight: Floats
) -> tuple[Floats, Floats]:
    """Whitened J (n, 6s, 6) and residuals (n, 6s) of poses (n, 3), (n, 3, 3)."""
    modelled, J = _modelled(rotor, array, p, R)
    residual = (weight @ (modelled - target)[..., None])[..., 0]
    return (weight @ J).reshape(len(p), -1, 6), residual.reshape(len(p), -1)


def _modelled(rotor: Rotor, array: SensorArray, p: Points, R: Floats) -> tuple[Floats, Floats]:
    """Quadratures (n, s, 6) in the sensors' frames and J (n, s, 6, 6), all motions in the rotor's frame."""
    q = (array.positions - p[:, None, :]) @ R
    B, G = rotor.stacked_quadratures(q)  # (n, s, 2, 3), (n, s, 2, 3, 3)
    turn = (np.swapaxes(array.axes, -1, -2) @ R[:, None])[:, :, None]  # from the rotor's frame to the sensors'
    J = np.empty((*B.shape, 6))
    J[..., :3] = -G
    J[..., 3:] = G @ cross_matrix(q)[:, :, None] - cross_matrix(B)
    shape = (*q.shape[:2], 6)
    return (turn @ B[..., None]).reshape(shape), (turn @ J).reshape(*shape, 6)
