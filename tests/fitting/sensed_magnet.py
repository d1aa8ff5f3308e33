"""A disc magnet seen by a three-axis sensor, made with magpylib: what alignments are tested on."""

from __future__ import annotations

from collections.abc import Mapping

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from magfem.fitting.alignment import GROUPS, alignment_of
from magfem.fitting.families import charged_faces
from magfem.fitting.measurement import Loss, MeasuredFit, Measurement, Weighting, solve_measurement
from magfem.geometry import AXIAL, CylinderMagnet, PermanentMagnet
from magfem.samples import Samples
from magfem.typing import Floats, Points

DISC = CylinderMagnet(
    diameter=8e-3, length=2e-3, material=PermanentMagnet(1.2, 1.0, AXIAL), clearance=2e-3, extent=20e-3
)
GRID: Points = np.stack(
    np.meshgrid(np.linspace(-8e-3, 8e-3, 7), np.linspace(-8e-3, 8e-3, 7), [6e-3, 9e-3, 12e-3], indexing="ij"), axis=-1
).reshape(-1, 3)


def read_by_sensor(
    true: Mapping[str, float], points: Points = GRID, background: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Floats:
    """What the sensor reads at nominal points (n, 3), T, for true values by the names of `alignment.NAMES`."""
    values = {name: 0.0 for group in GROUPS.values() for name in group} | {"gain": 1.0} | dict(true)

    def group(name: str) -> Floats:
        return np.array([values[one] for one in GROUPS[name]])

    magnet = magpylib.magnet.Cylinder(
        polarization=(0, 0, 1.2),
        dimension=(8e-3, 2e-3),
        position=group("centre"),
        orientation=Rotation.from_rotvec(group("tilt")),
    )
    turn = Rotation.from_rotvec(group("turn"))
    elements = [*group("offsets").reshape(2, 3), np.zeros(3)]
    components = [turn.inv().apply(magnet.getB(points + element))[:, k] for k, element in enumerate(elements)]
    read: Floats = values["gain"] * np.stack(components, axis=-1) + background
    return read


def solved(
    samples: Samples,
    free: Mapping[str, tuple[float, float] | None],
    background: bool = False,
    weighting: Weighting = "sigma",
    loss: Loss = "squares",
) -> MeasuredFit:
    """The strength of the disc's charged faces, exact for it, and the free parameters."""
    faces = next(charged_faces(DISC, DISC.region))
    alignment = alignment_of(free, float(np.linalg.norm(samples.extent)))
    return solve_measurement(Measurement(samples, faces, alignment, background, weighting, "none", loss))


def deviations_away(fit: MeasuredFit, true: Mapping[str, float]) -> Floats:
    """(q,) how far the free parameters are from the truth, in their stated deviations."""
    linear = len(fit.solved.parameters)
    away = fit.theta - np.array([true.get(name, 0.0) for name in fit.measurement.free])
    return np.asarray(away / np.sqrt(np.diag(fit.covariance))[linear:])
