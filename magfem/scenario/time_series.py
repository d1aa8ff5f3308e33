"""A run as files of numbers: time series in CSV, shapes in npz."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np

from magfem.scenario.run import Run
from magfem.scenario.summary import told_angles
from magfem.typing import Floats

COORDINATES = "xyz"


def time_series(run: Run) -> str:
    """CSV, a row for every step; currents in A, joints in rad or m, angles in deg, positions in m.

    Angles are told as in the summary; in space the axes' components follow, whose lengths are one.
    """
    kinds = {"wanted": run.wanted, **{name: run.stacked(name) for name in ("measured", "predicted", "actual")}}
    names = ["step", "target"]
    columns: list[Any] = [np.arange(len(run.steps)), run.target_of_step]

    def add(labels: list[str], values: Floats) -> None:
        names.extend(labels)
        columns.extend(values.T)

    add([f"current_{coil.name}_A" for coil in run.system.coils], run.stacked("currents"))
    add([f"joint_{joint.name}" for joint in run.system.joints], run.stacked("joints"))
    magnets = range(len(run.rod.magnets))
    for kind, axes in kinds.items():
        add([f"{kind}_{m}_deg" for m in magnets], told_angles(run, axes))
    add([f"error_{m}_deg" for m in magnets], np.degrees(run.true_error))
    if run.torque_only is not None:
        add([f"without_force_{m}_deg" for m in magnets], told_angles(run, run.torque_only[1]))
    if not run.scenario.planar:
        for kind, axes in kinds.items():
            add([f"{kind}_{m}_{c}" for m in magnets for c in COORDINATES], axes.reshape(len(axes), -1))
    places = run.stacked("places")
    add([f"magnet_{m}_{c}_m" for m in magnets for c in COORDINATES], places.reshape(len(places), -1))
    add(["condition"], run.stacked("condition")[:, None])
    add(["stiffness"], run.stacked("stiffness")[:, None])
    add(["switched_off"], run.stacked("off")[:, None].astype(int))
    add(["controller_ms"], 1e3 * run.stacked("seconds")[:, None])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*names, "outcome"])
    table = [column.tolist() for column in columns]
    for k, step in enumerate(run.steps):
        writer.writerow([*(_cell(column[k]) for column in table), step.outcome])
    return text.getvalue()


def _cell(value: float) -> str:
    """Empty for what there is not."""
    return repr(value) if np.isfinite(value) else ""


def shapes(run: Run) -> bytes:
    """npz: `plant`, `model` (steps, n, 3) m, `places` (steps, m, 3) m, `axes` (steps, m, 3), `target` (steps,),
    `without_force` (steps, n, 3) m if compared."""
    arrays = {
        "plant": run.stacked("plant"),
        "model": run.stacked("model"),
        "places": run.stacked("places"),
        "axes": run.stacked("actual"),
        "target": run.target_of_step,
    }
    if run.torque_only is not None:
        arrays["without_force"] = run.torque_only[0]
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    return content.getvalue()
