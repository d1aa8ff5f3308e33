"""The picture of a localization: drawn for one motor and one sensor as for more, with what was found in it."""

from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib import pyplot
from scipy.spatial.transform import RigidTransform

from magfem.fields.dipole_field import DipoleField
from magfem.localization import Sensor, as_rotor, simulated_samples
from magfem.localization.poses_file import pose_to_dict
from magfem.localization.recorded import Setup, localize_recording
from magfem.report.figures.style import PURPLE, Picture
from magfem.report.localization_pictures import localization_picture
from magfem.samples.recording import Recording

T = np.arange(200) / 20.0
ROTOR = as_rotor(DipoleField([2.6e-3, 0, 0]))


def drawn(motors: int, sensors: int, drift: bool = False) -> Picture:
    names = ("",) if sensors == 1 else ("a", "b")
    array = {name: Sensor(pose=RigidTransform.from_translation([0.02 * k, 0, 0])) for k, name in enumerate(names)}
    frequencies = (0.5, 1.3)[:motors]
    seen = sum(
        simulated_samples(ROTOR, [0.01, 0.01 * k, 0.02], [0.3, 0.1, 1], T, f, list(array.values()))
        for k, f in enumerate(frequencies)
    )
    assert isinstance(seen, np.ndarray)
    recording = Recording(
        np.tile(T, len(names)), seen.reshape(-1, 3), np.repeat(np.arange(len(names)), len(T)), names, "made"
    )
    setup = Setup(ROTOR, () if drift else frequencies, array, drift)
    poses, took_part = localize_recording(recording, setup)
    entries = [pose_to_dict(pose, 5.0, (0.0, 10.0), took_part) for pose in poses]
    return localization_picture(recording, setup, entries, poses)


@pytest.mark.parametrize(("motors", "sensors", "drift"), [(1, 1, False), (2, 2, False), (1, 2, True)])
def test_it_draws(motors: int, sensors: int, drift: bool) -> None:
    picture = drawn(motors, sensors, drift)
    image = pyplot.imread(io.BytesIO(picture.png))[..., :3]
    assert picture.size == (1480, 1040) and ("2 poses" in picture.alt) == (motors == 2)
    colour = np.array([int(PURPLE[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    purple = np.abs(image - colour).max(axis=-1) < 0.02
    width = purple.shape[1]
    assert purple[:, : width // 2].sum() > 200  # the frequency in the spectrum
    assert purple[:, width // 2 :].sum() > 200 * motors  # the magnets with their axes
    names = ("", " of sensor a", " of sensor b")
    assert any(f"The signal{name} with its fit" in picture.alt for name in names)
