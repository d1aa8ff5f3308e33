"""Where a calibration begins: phases and reading matrices from the quadratures alone, by linear least squares.

With C − iS as one complex vector, a phase is a factor exp(iφ): the readings of a pose are exp(iφ) M f, f the model's
field. Fields of all poses count alike here, for near ones depend most on places that are not known yet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.localization.calibration_fit import Readings
from magfem.localization.calibration_readings import Layout, Motion, Unknowns, readings
from magfem.localization.gain_split import split_gain
from magfem.localization.rotor import Rotor
from magfem.typing import Complexes, Floats

ROUNDS = 3  # of phases and matrices in turn
CLEARLY = 0.25  # how much less another mounting must leave than the nominal one to be believed


def first_guess(rotor: Rotor, motion: Motion, at: Unknowns, layout: Layout, measured: Readings) -> Unknowns:
    """`at`, with phases where they are not known, and with reading matrices where they are to be found.

    Where phases are unknown, all 24 ways to mount a sensor along its nominal axes are tried. All readings reversed are
    half a turn in every phase then: a sensor is left-handed or right-handed as it nominally is.
    """
    plain = replace(at, matrix=np.broadcast_to(np.eye(3), at.matrix.shape), offset=np.zeros_like(at.offset))
    values, _ = readings(rotor, motion, plain, layout)
    f, h = _complex(values), _complex(measured.values)
    size = np.where(measured.used, np.linalg.norm(f, axis=-1), np.inf)[..., None]
    f, h = f / size, h / size
    open_phase = layout.each_phase or "phase" in layout.find
    matrices = at.matrix
    if layout.find & {"gain", "rotation"}:
        matrices = np.array(
            [_matrix(f[:, j], h[:, j], at.matrix[j], at.gain[j], layout, open_phase) for j in range(layout.sensors)]
        )
    if not open_phase:
        return replace(at, matrix=matrices)
    return replace(at, matrix=matrices, phase=at.phase + _phase(f, h, matrices, layout))


def _complex(values: Floats) -> Complexes:
    """C − iS of readings (..., 9)."""
    return np.asarray(values[..., 3:6] - 1j * values[..., 6:])


def _phase(f: Complexes, h: Complexes, matrices: Floats, layout: Layout) -> Floats:
    """φ (k,) rad that turns fields (k, s, 3), read by matrices (s, 3, 3), best to what was read."""
    likeness = np.einsum("sij,ksj,ksi->k", matrices, f.conj(), h)
    if not layout.each_phase:
        likeness = np.full(likeness.shape, likeness.sum())
    return np.asarray(np.arctan2(likeness.imag, likeness.real))


def _matrix(f: Complexes, h: Complexes, nominal: Floats, gain: Floats, layout: Layout, open_phase: bool) -> Floats:
    """One sensor's matrix (3, 3) from fields (k, 3) and readings (k, 3); the nominal one where these are too few."""
    best, least = nominal, np.inf
    mountings = Rotation.create_group("O").as_matrix() if open_phase else np.eye(3)[None]
    mountings = mountings[np.argsort(-np.einsum("nii->n", mountings), kind="stable")]  # the nominal one first
    for mounting in mountings:
        matrix = nominal @ mounting
        for _ in range(ROUNDS if open_phase else 1):
            angle = _phase(f[:, None], h[:, None], matrix[None], layout) if open_phase else np.zeros(len(f))
            turned = np.exp(1j * angle)[:, None] * f
            rows, read = np.concatenate([turned.real, turned.imag]), np.concatenate([h.real, h.imag])
            found, _, rank, values = np.linalg.lstsq(rows, read, rcond=None)
            if rank < 3 or values[-1] < 1e-3 * values[0]:
                return nominal
            matrix = found.T if "gain" in layout.find else gain @ split_gain(np.linalg.inv(gain) @ found.T)[1]
            if open_phase and np.linalg.det(matrix) * np.linalg.det(nominal) < 0:
                matrix = -matrix
        left = float(np.sum((rows @ matrix.T - read) ** 2))
        if not np.isfinite(least) or left < CLEARLY * least:
            best, least = matrix, left
    return best
