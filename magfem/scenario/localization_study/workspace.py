"""The workspace of a single sensor and of several: maps of the Cramér–Rao bound, and where the branch is safe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.geometry.card import Table
from magfem.localization import Sensor, Workspace, as_rotor, place_sensors, workspace
from magfem.scenario.localization_study.noise import Noise, quantities, read_noise
from magfem.scenario.localization_study.sampling import Sampling, read_frequency, read_sampling
from magfem.scenario.localization_study.study import Comparison
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats

MILLI = 1e3
_LEAST_DISTANCE = 8e-3  # m from a sensor: nearer a motor would touch it


@dataclass(frozen=True, eq=False, kw_only=True)
class WorkspaceStudy:
    """What is asked.

    spacings: (k,) m, of pairs of sensors along x, zero for a single one.  width, depth: m, of the map in x and z.
    points: along x.  position, axis: m and rad that the workspace keeps.  placed: sensors placed best in a square of
    side `plate`, for the half of the map that is nearest.
    """

    model: str
    noise: Noise
    spacings: Floats
    width: float
    depth: float
    points: int
    position: float
    axis: float
    placed: int
    plate: float
    frequency: float
    sampling: Sampling
    seed: int


@dataclass(frozen=True, eq=False, kw_only=True)
class WorkspaceMaps:
    """x (n,), z (m,) m; a map of (n, m) for each spacing; the placed sensors, the bound there, and that of the line."""

    study: WorkspaceStudy
    x: Floats
    z: Floats
    maps: tuple[Workspace, ...]
    placed: tuple[Sensor, ...]
    placed_bound: float
    line_bound: float


def read(table: Table) -> WorkspaceStudy:
    """From a recipe. Raises CardError."""
    table.only(
        *("kind", "study", "name", "source", "model", "spacings", "width", "depth", "points", "position", "axis"),
        *("placed", "plate", "frequency", "rate", "duration", "seed", "sensor"),
    )
    sampling = read_sampling(table)
    return WorkspaceStudy(
        model=table.text("model"),
        noise=read_noise(table.table("sensor")),
        spacings=quantities(table, "spacings", "length"),
        width=table.quantity("width", "length"),
        depth=table.quantity("depth", "length"),
        points=whole_number(table, "points", 41, 5, 1001),
        position=table.quantity("position", "length"),
        axis=table.quantity("axis", "angle"),
        placed=whole_number(table, "placed", 3, 1, 64),
        plate=table.quantity("plate", "length"),
        frequency=read_frequency(table, sampling),
        sampling=sampling,
        seed=whole_number(table, "seed", 0, 0),
    )


def run(study: WorkspaceStudy) -> WorkspaceMaps:
    """A map for each arrangement, and the best places on a plate."""
    rotor = as_rotor(study.model)
    x = np.linspace(-study.width / 2, study.width / 2, study.points)
    z = np.linspace(_LEAST_DISTANCE, study.depth, max(5, round(study.points * study.depth / study.width)))
    points = np.stack([*np.meshgrid(x, [0.0], z, indexing="ij")], axis=-1)[:, 0]
    maps = [
        workspace(rotor, points, _line(study, spacing), times=study.sampling.times, frequency=study.frequency)
        for spacing in study.spacings
    ]
    near = np.random.default_rng(study.seed).uniform(
        [-study.width / 4, -study.width / 4, study.depth / 4],
        [study.width / 4, study.width / 4, study.depth * 0.75],
        (40, 3),
    )
    half = study.plate / 2
    deviation = float(np.hypot(study.noise.deviation, study.noise.resolution / np.sqrt(12)))
    placed = place_sensors(
        rotor,
        near,
        study.placed,
        [-half, -half, 0.0],
        [half, half, 0.0],
        noise=deviation,
        times=study.sampling.times,
        frequency=study.frequency,
        seed=study.seed,
    )
    line = [
        Sensor(pose=RigidTransform.from_translation([at, 0.0, 0.0]), noise=deviation)
        for at in np.linspace(-half, half, study.placed)
    ]
    beside = workspace(rotor, near, line, times=study.sampling.times, frequency=study.frequency)
    return WorkspaceMaps(
        study=study,
        x=x,
        z=z,
        maps=tuple(maps),
        placed=placed.sensors,
        placed_bound=placed.objective,
        line_bound=float(np.sqrt(np.mean(beside.position**2))),
    )


def _line(study: WorkspaceStudy, spacing: float) -> list[Sensor]:
    places = [0.0] if spacing == 0 else [-spacing / 2, spacing / 2]
    return [
        Sensor(
            pose=RigidTransform.from_translation([at, 0.0, 0.0]),
            noise=study.noise.deviation,
            resolution=study.noise.resolution,
        )
        for at in places
    ]


def compared(found: WorkspaceMaps) -> tuple[Comparison, ...]:
    """How far the workspaces go straight ahead, and what good places are worth."""
    study, rows = found.study, []
    middle = len(found.x) // 2
    for spacing, one in zip(study.spacings, found.maps, strict=True):
        safe = 0.5 if spacing == 0 else 0.005
        inside = one.within(study.position, study.axis, safe)[middle]
        far = float(found.z[inside].max()) if inside.any() else 0.0
        what = "one sensor, its branch known" if spacing == 0 else f"two sensors {MILLI * spacing:.3g} mm apart"
        rows.append(
            Comparison(
                quantity=f"reach ahead within {MILLI * study.position:g} mm and {np.degrees(study.axis):g}°, {what}",
                found=MILLI * far,
                unit="mm",
                published="40 mm, one sensor, 30 s" if spacing == 0 else "",
            )
        )
    rows += [
        Comparison(
            quantity=f"bound of the position with {study.placed} sensors in a line",
            found=MILLI * found.line_bound,
            unit="mm",
        ),
        Comparison(
            quantity=f"bound of the position with {study.placed} sensors placed best on the same plate",
            found=MILLI * found.placed_bound,
            unit="mm",
            at_most=MILLI * found.line_bound,
        ),
    ]
    return tuple(rows)


def arrays(found: WorkspaceMaps) -> dict[str, Floats]:
    """For data.npz, SI."""
    data: dict[str, Floats] = {"x": found.x, "z": found.z, "spacings": found.study.spacings}
    for name in ("position", "axis", "wrong_branch"):
        data[name] = np.stack([getattr(one, name) for one in found.maps])
    return data | {"placed": np.array([one.pose.translation for one in found.placed])}
