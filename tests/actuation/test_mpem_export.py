"""Writing MPEM files: exactly where harmonics allow it, else with a residual that is true; read by mag_manip."""

from __future__ import annotations

import json
import logging
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from references import mag_manip
from references.mpem_formula import file_field
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, SystemCoil, write_mpem
from magfem.cli.program import main
from magfem.constants import MU_0
from magfem.errors import ConvergenceError, InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Shell
from magfem.fields.term_kinds import INTERIOR
from magfem.fields.terms import charge_discs, closed_path, harmonics, loops, uniform
from magfem.fields.workspace_region import Ball, Box

BALL = Ball((0.0, 0.0, 0.0), 0.03)
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7])
POSE = RigidTransform.from_components([0.05, -0.06, 0.04], TURN)


def one_coil(terms, pose=None, workspace=BALL):
    pose = RigidTransform.identity() if pose is None else pose
    return CoilSystem("one", (SystemCoil("Coil_a", terms, pose=pose),), workspace=workspace)


def all_orders(kind, top, radius, rng, reach):
    """Every harmonic up to a degree."""
    index = [(n, m, s) for n in range(1, top + 1) for m in range(n + 1) for s in (0, 1)[: 1 + (m > 0)]]
    degree, order, sine = zip(*index, strict=True)
    values = rng.normal(size=len(index)) * reach ** np.array(degree)
    return harmonics(radius, degree, order, [bool(s) for s in sine], values, kind=kind)


def formula(file, points, currents):
    return file_field(points, yaml.safe_load(file.read_text(encoding="utf-8")), currents)


# Exactly


@pytest.mark.parametrize(
    "terms",
    [
        harmonics(0.04, [1, 2, 5], [0, 0, 0], [False] * 3, [1e-3, -2e-3, 1e-3]),
        harmonics(0.04, [1, 1, 1], [0, 1, 1], [False, False, True], [1e-3, 2e-3, -3e-3]),
        all_orders(1, 6, 0.04, np.random.default_rng(1), 0.5),
        all_orders(INTERIOR, 5, 0.04, np.random.default_rng(2), 0.5),
        uniform([1e-3, -2e-3, 0.5e-3]),
        harmonics(0.04, [1, 3, 3], [1, 1, 3], [False, True, True], [1e-3, 2e-3, 1e-3]),
    ],
    ids=["axial", "oblique dipole", "all exterior to 6", "all interior to 5", "uniform", "diametric"],
)
def test_harmonics_go_over_exactly(terms, tmp_path):
    """By the formula of the format, and read back; axes turned and moved."""
    system, file = one_coil(terms, POSE), tmp_path / "coil.yaml"
    done = write_mpem(system, file)
    points = BALL.random_points(np.random.default_rng(3), 200)
    expected = system.B(points, [1.0])
    size = np.abs(expected).max()
    assert done.exact and done.maximum == done.rms == 0.0
    np.testing.assert_allclose(formula(file, points, [1.0]), expected, atol=1e-12 * size)
    back = magfem.load_system(file)
    slopes = system.gradient(points, [1.0])
    inside = back.workspace.contains(points)
    assert inside.any()
    np.testing.assert_allclose(back.gradient(points[inside], [1.0]), slopes[inside], atol=1e-12 * np.abs(slopes).max())


def test_octomag_round_trip_keeps_every_coefficient(tmp_path):
    octomag, file = magfem.load_system("octomag"), tmp_path / "again.yaml"
    done = write_mpem(octomag, file)
    assert done.exact and done.sources == 33
    original = yaml.safe_load((mag_manip.ROOT / "geometries/systems/OctoMag_Calibration.yaml").read_text())
    again = yaml.safe_load(file.read_text())
    for label in original["Coil_List"]:
        theirs, ours = original[label], again[label]
        assert theirs["Source_List"] == ours["Source_List"]
        for name in theirs["Source_List"]:
            for key in ("A_Coeff", "B_Coeff", "Source_Position"):
                assert ours[name][key] == theirs[name][key], (label, name, key)
            np.testing.assert_allclose(ours[name]["Source_Direction"], theirs[name]["Source_Direction"], atol=1e-15)
    assert magfem.load_system(file).workspace == octomag.workspace


def test_bigmag_and_a_background_in_mag_manip(tmp_path):
    """The whole system exported, evaluated by mag_manip: the eight rows, and the field with its background."""
    bigmag, file = magfem.load_system("bigmag"), tmp_path / "bigmag.yaml"
    system = replace(
        bigmag, background=uniform([0, 0, 1e-3]) + all_orders(INTERIOR, 3, 0.1, np.random.default_rng(4), 1e-3)
    )
    assert write_mpem(system, file).exact
    rng = np.random.default_rng(5)
    points, currents = Ball((0.0, 0.0, 0.0), 0.055).random_points(rng, 60), rng.uniform(-8, 8, 6)
    theirs = mag_manip.evaluate(file, points, currents)
    rows, B = system.unit_fields(points), system.B(points, currents)
    assert theirs.coils == 6
    scale = np.abs(rows).max(axis=(0, 2))[:, None]
    np.testing.assert_allclose(theirs.rows / scale, rows / scale, atol=1e-12)
    np.testing.assert_allclose(theirs.B, B, atol=1e-12 * np.abs(B).max())


def test_fitted_model_of_a_diametric_rotor_goes_over_exactly(tmp_path):
    """A magnet's field is in T: it becomes a background, in a file without coils."""
    rotor, file = magfem.load_model("rotor_1x3"), tmp_path / "rotor.yaml"
    assert write_mpem(rotor, file).exact
    points = rotor.region.layers(np.random.default_rng(6), 10, 20).reshape(-1, 3)
    expected = rotor.B(points)
    size = np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(formula(file, points, []) / size, expected / size, atol=1e-12)
    back = magfem.load_system(file)
    assert not back.coils
    np.testing.assert_allclose(back.B(points, []) / size, expected / size, atol=1e-12)
    theirs = mag_manip.evaluate(file, points, [])
    assert theirs.coils == 0
    np.testing.assert_allclose(theirs.B / size, expected / size, atol=1e-12)


# By a fit


def solenoid():
    """A coil of loops, 1000 turns, 60 mm long, whose middle lies 90 mm below the workspace's."""
    z = np.linspace(-0.03, 0.03, 24) - 0.09
    return loops(np.stack([0 * z, 0 * z, z], axis=-1), 0.018, 1000 / 24)


SQUARE = closed_path([[0.02, 0.02, 0], [-0.02, 0.02, 0], [-0.02, -0.02, 0], [0.02, -0.02, 0]], 100.0, [0, 0, -0.06])
PILLS = charge_discs([[0, 0, -0.05], [0, 0, -0.06]], 0.01, [1.0, -1.0])


@pytest.mark.parametrize(
    "terms", [solenoid(), SQUARE, PILLS, solenoid() + SQUARE], ids=["loops", "path", "discs", "both"]
)
def test_stated_residual_is_what_other_points_find(terms, tmp_path):
    """The residual holds at points that neither fitted nor judged."""
    system, file = one_coil(terms), tmp_path / "coil.yaml"
    done = write_mpem(system, file)
    points = BALL.random_points(np.random.default_rng(11), 3000)
    expected = system.B(points, [1.0])
    size = np.linalg.norm(expected, axis=1)
    errors = np.linalg.norm(formula(file, points, [1.0]) - expected, axis=1) / np.maximum(size, 0.01 * size.max())
    assert not done.exact and 0 < done.maximum <= 0.01
    assert errors.max() <= done.maximum
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(done.rms, rel=0.5)


def test_loop_in_mag_manip_keeps_the_formula_on_its_axis(tmp_path):
    """Closed form of the loop, not ours: B = µ₀ R²/2 (R² + z²)^{3/2}, at the very point nearest to it too."""
    file, z = tmp_path / "loop.yaml", np.linspace(-0.03, 0.03, 13)
    done = write_mpem(one_coil(loops(np.array([[0, 0, -0.1]]), 0.04, 1.0)), file)
    exact = MU_0 * 0.04**2 / 2 / (0.04**2 + (z + 0.1) ** 2) ** 1.5
    theirs = mag_manip.evaluate(file, np.stack([0 * z, 0 * z, z], axis=-1), [1.0])
    np.testing.assert_allclose(theirs.B[:, 2], exact, rtol=done.maximum)


def test_model_all_round_a_ring_magnet(tmp_path):
    """From 0.5 mm of the hull on: dipoles on rings within the body; the stated residual holds elsewhere too."""
    ring, file = magfem.load_model("ring_magnet_4x1.5x1"), tmp_path / "ring.yaml"
    done = write_mpem(ring, file)
    assert done.maximum <= 0.01
    points = ring.region.layers(np.random.default_rng(12), 60, 30, nearest=10)
    expected = ring.B(points)
    found = formula(file, points.reshape(-1, 3), []).reshape(expected.shape)
    size = np.linalg.norm(expected, axis=-1)
    floor = np.maximum(size, 0.01 * size.max(axis=-1, keepdims=True))
    errors = np.linalg.norm(found - expected, axis=-1) / floor
    assert errors.max() <= done.maximum and np.sqrt(np.mean(errors**2)) <= 1.2 * done.rms


def test_sources_lie_outside_the_region(tmp_path):
    """Or the field would be infinite where it is promised."""
    shell = Shell(CylinderHull(0.036, 0.06), 0.005, 0.1)
    model = magfem.load_model("bigmag_air")
    terms = loops(np.array([[0, 0, -0.03], [0, 0, 0.03]]), 0.018, 1.0)
    file = tmp_path / "pair.yaml"
    write_mpem(replace(model, lowered=terms, region=shell, parameter=np.zeros(2, int)), file, strict=False)
    places = np.concatenate([coil.terms.centre for coil in magfem.load_system(file).coils])
    assert not shell.contains(places).any()


def test_residual_above_the_tolerance_is_refused(tmp_path):
    """Nothing is written then, unless it is asked for."""
    system, file = one_coil(loops(np.array([[0, 0, -0.1]]), 0.04, 1.0)), tmp_path / "loop.yaml"
    with pytest.raises(ConvergenceError, match=r"Coil_a of one to .* of B at best, more than the tolerance of 1e-16"):
        write_mpem(system, file, tolerance=1e-16)
    assert not file.exists()
    done = write_mpem(system, file, tolerance=1e-16, strict=False)
    assert done.maximum > 1e-16 and f"{done.maximum:.1e}" in file.read_text()


def test_every_coil_states_its_own_residual(tmp_path, caplog):
    coils = (
        SystemCoil("exact", harmonics(0.1, [1], [0], [False], [1e-3], [0, 0, 0.1])),
        SystemCoil("loops", solenoid()),
    )
    system = CoilSystem("two", coils, workspace=BALL)
    with caplog.at_level(logging.INFO, logger="magfem"):
        done = write_mpem(system, tmp_path / "two.yaml")
    assert list(done.residuals) == ["Coil_0", "Coil_1"]  # names of the usual form, which theirs are not
    assert done.residuals["Coil_0"] == (0.0, 0.0) and done.residuals["Coil_1"] == (done.maximum, done.rms)
    assert re.search(r"mpem: \d+ sources, fitted, relative error of B at most", caplog.text)


# The file


def test_mag_manip_wants_the_other_coefficients_as_tilde(tmp_path):
    """And numbers with a dot, which YAML 1.1 does not take for texts."""
    file = tmp_path / "coil.yaml"
    write_mpem(one_coil(harmonics(0.03, [1], [0], [False], [1e-30]) + uniform([1e-30, 0, 0])), file)
    content = yaml.safe_load(file.read_text())["Coil_a"]
    assert [(content[name]["A_Coeff"] is None) + (content[name]["B_Coeff"] is None) for name in ("Src_0", "Src_1")] == [
        1,
        1,
    ]
    values = [*content["Src_0"]["B_Coeff"], *content["Src_1"]["A_Coeff"], *content["Src_1"]["Source_Position"]]
    assert all(isinstance(value, float) for value in values)


def test_workspace_of_the_file(tmp_path):
    file = tmp_path / "coil.yaml"
    coil = one_coil(harmonics(0.03, [1], [0], [False], [1e-3]), POSE)
    write_mpem(coil, file)
    half = 0.03 / np.sqrt(3)
    np.testing.assert_allclose(magfem.load_system(file).workspace.high, [half] * 3)  # all of it lies in the ball
    box = Box((-0.01, -0.02, 0.0), (0.01, 0.02, 0.03))
    write_mpem(coil, file, workspace=box)
    assert magfem.load_system(file).workspace == box


def test_what_cannot_be_written_is_refused(tmp_path):
    file = tmp_path / "coil.yaml"
    everywhere = CoilSystem("free", one_coil(solenoid()).coils)
    with pytest.raises(InputError, match="give a Ball or a Box"):
        write_mpem(everywhere, file)
    assert write_mpem(everywhere, file, workspace=BALL).maximum < 0.01
    for nothing in (3, magfem.exact(magfem.load_geometry("sphere_magnet_5"))):
        with pytest.raises(InputError, match="takes a coil system, a fitted model"):
            write_mpem(nothing, file)
    with pytest.raises(InputError, match="cannot write"):
        write_mpem(everywhere, tmp_path / "none" / "coil.yaml", workspace=BALL)


# The command


def test_command_writes_what_the_function_writes(tmp_path, capsys):
    file, own = tmp_path / "ring.yaml", tmp_path / "own.yaml"
    bounds = "-1 mm, 1 mm, -1 mm, 1 mm, 2 mm, 4 mm"
    line = ["export", "ring_magnet_4x1.5x1", "--to", "mpem", "-o", str(file), "--bounds", bounds, "--json"]
    assert main(line) == 0
    shown = json.loads(capsys.readouterr().out)
    done = write_mpem(magfem.load_model("ring_magnet_4x1.5x1"), own, Box((-1e-3, -1e-3, 2e-3), (1e-3, 1e-3, 4e-3)))
    assert file.read_bytes() == own.read_bytes()
    assert shown["residual"] == {"max": done.maximum, "rms": done.rms} and not shown["exact"]
    assert main([*line, "--tolerance", "0.5"]) == 0
    assert json.loads(capsys.readouterr().out)["sources"] < shown["sources"]
