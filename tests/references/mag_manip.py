"""ETH's mag_manip, run in an environment of its own (`tools/mag_manip.sh`): it needs another NumPy than magfem."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PYTHON = Path(os.environ.get("MAGFEM_MAG_MANIP", ROOT / "build" / "mag_manip" / "bin" / "python"))

PROGRAM = """
import json, sys
import numpy as np
from mag_manip.mag_manip import ForwardModelMPEM
task = json.load(sys.stdin)
model = ForwardModelMPEM()
model.setCalibrationFile(task["file"])
points, currents = np.array(task["points"]), np.array(task["currents"], dtype=float)
json.dump({
    "coils": model.getNumCoils(),
    "B": [model.computeFieldFromCurrents(p, currents).ravel().tolist() for p in points],
    "five": [model.computeGradient5FromCurrents(p, currents).ravel().tolist() for p in points],
    "rows": [model.getActuationMatrix(p).tolist() for p in points] if model.getNumCoils() else [],
}, sys.stdout)
"""


@dataclass(frozen=True)
class Answer:
    """B (n, 3) T, five entries of the gradient (n, 5) T/m, and all eight rows per ampere (n, 8, c)."""

    coils: int
    B: np.ndarray
    five: np.ndarray
    rows: np.ndarray


def evaluate(file: Path, points: np.ndarray, currents: np.ndarray | list[float]) -> Answer:
    """What mag_manip makes of an MPEM file; skips the test where mag_manip is not to be had."""
    if not PYTHON.exists():
        pytest.skip("needs mag_manip in an environment of its own (sh tools/mag_manip.sh .venv/bin/python)")
    task = {"file": str(file), "points": np.asarray(points).tolist(), "currents": np.asarray(currents).tolist()}
    done = subprocess.run(
        [str(PYTHON), "-W", "ignore", "-c", PROGRAM],
        input=json.dumps(task),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    return Answer(found["coils"], *(np.array(found[key]) for key in ("B", "five", "rows")))
