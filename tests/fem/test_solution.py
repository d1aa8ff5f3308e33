"""Solutions as objects: files, refusals, and repeatability."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module

import meshio
import numpy as np
import pytest

import magfem
from magfem.constants import MU_0
from magfem.errors import CardError, ConvergenceError, InputError
from magfem.fem.solve import solve
from magfem.geometry import PermanentMagnet, RingMagnet


@pytest.mark.parametrize("name", ["ring_2d", "rotor_3d"])
def test_saved_solution_comes_back_to_the_bit(name, request, tmp_path):
    solution = request.getfixturevalue(name)
    solution.save(tmp_path / "run")
    again = magfem.load_solution(tmp_path / "run")
    points = solution.geometry.region.layers(np.random.default_rng(0), 4, 5)
    for ours, theirs in zip(solution.jet(points, 2), again.jet(points, 2), strict=True):
        assert np.array_equal(ours, theirs)
    assert again.summary == json.loads(json.dumps(solution.summary))
    assert again.geometry == solution.geometry


def test_saved_solution_of_a_changed_device_is_that_device(tmp_path):
    ring = replace(magfem.load_geometry("ring_magnet_4x1.5x1"), length=2e-3)
    solve(ring, resolution=0.5).save(tmp_path / "run")
    assert magfem.load_solution(tmp_path / "run").geometry == ring


def test_vtu_holds_potential_and_field(ring_3d, tmp_path):
    """The file as another program reads it: inside the ring B is near µ₀(H + M) of the closed form."""
    ring_3d.save(tmp_path / "run")
    content = meshio.read(tmp_path / "run" / "solution.vtu")
    assert content.cells[0].type == "tetra10"
    assert content.point_data["potential"].shape == (len(content.points),)
    inside = content.cell_data["body"][0] == 0
    B = content.cell_data["B"][0]
    centres = content.points[content.cells[0].data[:, :4]].mean(axis=1)
    deep = inside & (np.abs(centres[:, 2]) < 0.2e-3) & (np.abs(np.hypot(*centres.T[:2]) - 1.4e-3) < 0.3e-3)
    truth = ring_3d.B(centres[deep])
    assert deep.any()
    assert np.linalg.norm(B[deep] - truth, axis=1).max() <= 0.02 * np.abs(truth).max()


def test_summary_has_the_keys_others_read(ring_2d):
    assert set(ring_2d.error) >= {"B", "gradient"}
    assert set(ring_2d.stats) >= {"unknowns", "seconds", "peak_bytes"}
    assert ring_2d.stats["peak_bytes"] < 2 * 2**30


def test_same_input_same_output(rotor):
    first, second = (solve(rotor, resolution=0.5) for _ in range(2))
    points = rotor.region.layers(np.random.default_rng(0), 4, 5)
    assert np.array_equal(first.B(points), second.B(points))
    assert first.error == second.error


def test_field_is_proportional_to_remanence(ring, ring_2d):
    weaker = RingMagnet(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=PermanentMagnet(0.675, 1.05))
    points = ring.region.layers(np.random.default_rng(0), 4, 5)
    assert np.allclose(2 * solve(weaker).B(points), ring_2d.B(points), rtol=1e-9, atol=1e-15)


def test_demagnetisation_has_the_size_of_the_demagnetising_factor(ring_2d, ring):
    """M = M₀ − χN M with the ring's magnetometric N, from the energy ½µ₀ N M² V of the rigid magnet."""
    from references.magnet_energy import ring_field_energy

    energy = ring_field_energy(2e-3, 0.75e-3, 1e-3, 1.35)
    N = 2 * MU_0 * energy / (1.35**2 * ring.volume)
    expected = ring.moment[2] / (1 + 0.05 * N)
    assert ring_2d.moment[2] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dimension": 1}, "dimension must be 2 or 3"),
        ({"resolution": 0.01}, "resolution must lie between"),
        ({"resolution": 1e6}, "resolution must lie between"),
        ({"resolution": float("nan")}, "resolution must lie between"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"dimension": "2"}, 'dimension must be 2 or 3, got "2"$'),
        ({"dimension": np.array([2, 3])}, "dimension must be 2 or 3, got a ndarray$"),
        ({"resolution": "1"}, 'resolution must lie between .* got "1"$'),
        ({"resolution": None}, "resolution must lie between .* got a NoneType$"),
        ({"resolution": True}, "resolution must lie between .* got true$"),
        ({"tolerance": "x"}, 'tolerance must be a relative error between 0 and 1, got "x"$'),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(ring, arguments, message):
    with pytest.raises(InputError, match=message) as caught:
        solve(ring, **arguments)
    assert "\n" not in str(caught.value)


def test_two_dimensions_need_axial_magnetisation(rotor):
    with pytest.raises(InputError, match="axial"):
        solve(rotor, dimension=2)


def test_tolerance_out_of_reach_says_so(ring, monkeypatch):
    monkeypatch.setattr(import_module("magfem.fem.solve_magnets"), "RESOLUTIONS", {2: (0.25, 0.5)})
    with pytest.raises(ConvergenceError, match="out of reach"):
        solve(ring, resolution=0.25, tolerance=1e-10)


def test_broken_folders_are_refused(tmp_path, ring_2d):
    with pytest.raises(InputError, match="not found"):
        magfem.load_solution(tmp_path)
    ring_2d.save(tmp_path / "run")
    (tmp_path / "run" / "fields.npz").write_bytes(b"not a zip")
    with pytest.raises(InputError, match="cannot be read"):
        magfem.load_solution(tmp_path / "run")
    (tmp_path / "run" / "summary.json").write_text("{}")
    with pytest.raises(InputError, match="no saved solution"):
        magfem.load_solution(tmp_path / "run")


@pytest.mark.parametrize("part", [0.0, 0.3, 0.99])
def test_truncated_fields_are_refused(part, tmp_path, ring_2d):
    ring_2d.save(tmp_path / "run")
    fields = tmp_path / "run" / "fields.npz"
    fields.write_bytes(fields.read_bytes()[: int(part * fields.stat().st_size)])
    with pytest.raises(InputError, match=r"^the solution's fields cannot be read: .*fields\.npz\]$"):
        magfem.load_solution(tmp_path / "run")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda summary: summary.pop("settings"), "not a whole solution: missing key 'settings'"),
        (lambda summary: summary.pop("device"), "not a whole solution: missing key 'device'"),
        (lambda summary: summary["error"].pop("B"), "not a whole solution: missing key 'B'"),
        (lambda summary: summary["error"].update(B="small"), 'must be numbers, got "small"'),
        (lambda summary: summary["settings"].update(dimension=3), "settings.dimension is 3, its mesh has dimension 2"),
        (lambda summary: summary.update(device=[]), "not a whole solution: list indices"),
        (lambda summary: summary["device"]["card"].update(text="kind = 3"), "kind must be a text"),
        (lambda summary: summary["device"]["card"].update(text=3), "not a whole solution: "),
    ],
)
def test_edited_summaries_are_refused(edit, message, tmp_path, ring_2d):
    ring_2d.save(tmp_path / "run")
    path = tmp_path / "run" / "summary.json"
    summary = json.loads(path.read_text())
    edit(summary)
    path.write_text(json.dumps(summary))
    with pytest.raises(CardError, match=message) as caught:
        magfem.load_solution(tmp_path / "run")
    assert "\n" not in str(caught.value)


def test_fields_without_an_array_are_refused(tmp_path, ring_2d):
    ring_2d.save(tmp_path / "run")
    with np.load(tmp_path / "run" / "fields.npz") as stored:
        arrays = dict(stored)
    del arrays["body"]
    np.savez(tmp_path / "run" / "fields.npz", **arrays)
    with pytest.raises(CardError, match="not a whole solution: missing key 'body'"):
        magfem.load_solution(tmp_path / "run")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: magfem.solve("ring_magnet_4x1.5x1"),
            r"^solve takes a device: magfem.load_geometry\('ring_magnet_4x1.5x1'\), ",
        ),
        (lambda: magfem.solve(RingMagnet), "^solve takes a device: "),
        (lambda: magfem.exact("ring_magnet_4x1.5x1"), "^exact takes a device: "),
        (lambda: magfem.load_model(3), '^load_model takes a name or path: "ring.json", got 3$'),
        (
            lambda: magfem.load_solution(None),
            '^load_solution takes the folder of a solution: "runs/ring", got a ',
        ),
    ],
)
def test_what_is_of_the_wrong_type_is_told_what_to_pass(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_settings_are_plain_numbers(ring):
    settings = solve(ring, dimension=np.int64(2), resolution=np.float32(0.5)).settings
    assert settings == {"dimension": 2, "resolution": 0.5}
    assert [type(value) for value in settings.values()] == [int, float]


def test_what_does_not_fit_is_refused_before_anything_is_solved(rotor, monkeypatch):
    asked = []

    def refuse(geometry, dimension, resolution):
        asked.append(resolution)
        raise InputError("too large")

    monkeypatch.setattr(import_module("magfem.fem.solve_magnets"), "generate", refuse)
    with pytest.raises(InputError, match="too large"):
        solve(rotor, resolution=2.0)
    assert asked == [2.0]


def test_fields_show_themselves_in_one_line(rigid_ring, ring_2d):
    model = magfem.load_model("ring_magnet_4x1.5x1")
    bound = model.report["bound"]
    assert repr(ring_2d) == (
        f"<Solution of 'ring magnet': dimension 2, resolution 1, stated error {ring_2d.error['B']:.1e} in B, "
        f"{ring_2d.error['gradient']:.1e} in the gradient>"
    )
    assert repr(model) == (
        f"<FieldModel {model.name!r}: {model.report['label']}, 0.5 to 6 mm from the body's hull, all round, "
        f"bound {bound['B']:.1e} in B, {bound['gradient']:.1e} in the gradient>"
    )
    exact = magfem.exact(rigid_ring)
    assert repr(exact) == "<ExactField of 'ring magnet': the closed form at recoil permeability 1, everywhere>"
