"""What sensors read of known poses: the textbook's dipole, and derivatives against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.fields import DipoleField
from magfem.localization import as_rotor, demodulate
from magfem.localization.calibration_readings import Layout, changed, readings
from magfem.localization.calibration_setting import setting
from magfem.localization.sensor import as_sensors
from tests.localization import calibration_bench as bench

FINDS = [
    {"gain", "rotation", "position", "offset", "moment", "rotor"},
    {"rotation", "position", "offset", "rotor", "phase"},
    {"gain", "position"},
    {"rotation"},
    {"moment", "rotor", "phase"},
]


def setting_of(find, phase):
    rng = np.random.default_rng(4)
    sensors = [bench.faulty(rng, [0, 0, 0]), bench.faulty(rng, [0.01, 0, 0])]
    carriers = [
        RigidTransform.from_components(place, Rotation.random(random_state=rng)) for place in bench.around(rng, 4)
    ]
    position, axis = np.array([1e-3, 2e-3, -1e-3]), np.array([0.3, -0.2, 0.8])
    known = np.full(4, phase or 0.0)  # where each has its own it begins at zero
    array = as_sensors(sensors)
    layout, motion, at = setting(array, 4, position, axis, phase, bench.EARTH, carriers, frozenset(find))
    return sensors, carriers, position, axis, known, layout, motion, at


@pytest.mark.parametrize("model", [(1.2e-3, 0.0), (1.2e-3, 4e-4)])
def test_readings_are_those_of_the_textbook(model) -> None:
    sensors, carriers, position, axis, phase, layout, motion, at = setting_of({"offset"}, 0.7)
    values, _ = readings(as_rotor(DipoleField([model[0], 0.0, model[1]])), motion, at, layout)
    read = bench.samples(model, position, axis, phase, sensors, carriers)
    one = demodulate(read, bench.TIMES, bench.FREQUENCY)
    expected = np.concatenate([one.static, one.cosine, one.sine], axis=-1)
    assert np.abs(values - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("find", FINDS, ids=lambda find: "-".join(sorted(find)))
@pytest.mark.parametrize("model", ["rotor_1x3", "tilted"])
def test_derivatives_are_those_of_finite_differences(find, model) -> None:
    phase = 0.7 if "phase" in find else None
    *_, layout, motion, at = setting_of(find, phase)
    rotor = as_rotor(model if model == "rotor_1x3" else DipoleField([1.2e-3, 0.0, 4e-4]))
    layout = Layout(layout.sensors, layout.poses, layout.find, "offset" in find, layout.each_phase)
    _, J = readings(rotor, motion, at, layout)
    assert J.shape[-1] == len(layout.names)
    for column, name in enumerate(layout.names):
        h = 1e-6 if "position" in name else 1e-7 if "offset" in name or "static" in name else 1e-4
        step = np.zeros(len(layout.names))
        step[column] = h
        ahead, behind = (readings(rotor, motion, changed(at, sign * step, layout), layout)[0] for sign in (1, -1))
        difference = (ahead - behind) / (2 * h)
        assert np.abs(difference - J[..., column]).max() < 1e-6 * np.abs(J[..., column]).max(), name


def test_a_tilted_rotor_stands_still_along_its_axis() -> None:
    """The mean over a turn of a tilted dipole is the dipole of the moment along the axis."""
    rotor = as_rotor(DipoleField([1.2e-3, 0.0, 4e-4]))
    points = np.array([[0.01, 0.02, -0.015], [0.0, 0.0, 0.03]])
    B, gradient = rotor.steady(points)
    along = np.array([0.0, 0.0, 4e-4])
    assert np.abs(B - bench.dipole(along, points)).max() < 1e-13 * np.abs(B).max()
    for axis, h in enumerate(1e-6 * np.eye(3)):
        slope = (bench.dipole(along, points + h) - bench.dipole(along, points - h)) / 2e-6
        assert np.abs(gradient[..., axis] - slope).max() < 1e-6 * np.abs(slope).max()
    across, none = as_rotor("rotor_1x3").steady(points)
    assert not across.any() and not none.any()
