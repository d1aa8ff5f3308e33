"""Studies of localization on few draws: their reading, their numbers against what is known, their folders."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from magfem.cli import main
from magfem.errors import CardError, InputError
from magfem.geometry.card import parse_table
from magfem.localization import Sensor, as_rotor, pose_bound
from magfem.scenario.localization_study import Study
from magfem.scenario.localization_study.noise import Noise
from magfem.scenario.localization_study.poses import beta_of, drawn_poses, isoline_distance, pose_errors
from magfem.scenario.localization_study.recipe import run_study
from magfem.scenario.localization_study.tracks import cubic, helical, random_path, sinusoidal

REPORTS = Path(__file__).parents[2] / "reports"


def recipe(name: str, **changes: str) -> str:
    """The text of a recipe of the catalogue with lines `key = …` exchanged."""
    lines = (REPORTS / f"{name}.toml").read_text().splitlines()
    for key, value in changes.items():
        found = [k for k, line in enumerate(lines) if line.startswith(f"{key} =")]
        lines[found[0]] = f"{key} = {value}"
    return "\n".join(lines)


def studied(name: str, **changes: str) -> Study:
    return run_study(parse_table(recipe(name, **changes).encode(), "a.toml"))


@pytest.fixture(scope="module")
def isolines() -> Study:
    return studied(
        "localize_isolines", strengths='["20 uT", "100 uT"]', beta='["30 deg", "60 deg"]', draws="40", band_draws="400"
    )


@pytest.fixture(scope="module")
def tracks() -> Study:
    return studied("localize_tracks", windows="60", random_paths="1")


def test_isolines_keep_their_limits(isolines: Study) -> None:
    """At the bound, and ahead of the published algorithm; the bound is the one of the poses themselves."""
    limited = [one for one in isolines.comparisons if one.limit]
    assert len(limited) == 10  # five at either strength
    assert isolines.passed


def test_isoline_distances_have_that_field() -> None:
    rotor = as_rotor("rotor_1x3")
    beta = np.radians([0.0, 40.0, 90.0])
    r = isoline_distance(rotor, np.asarray(50e-6), beta)
    for distance, angle in zip(r, beta, strict=True):
        turn = np.linspace(0, 2 * np.pi, 721)
        C, S, *_ = rotor.quadratures(distance * np.array([np.cos(angle), 0.0, np.sin(angle)]))
        field = np.linalg.norm(np.cos(turn)[:, None] * C + np.sin(turn)[:, None] * S, axis=1)
        assert field.max() == pytest.approx(50e-6, rel=1e-6)


def test_drawn_poses_are_where_they_are_said_to_be() -> None:
    true = drawn_poses(np.full((5, 40), 0.03), np.full((5, 40), 0.7), np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(true.position, axis=-1), 0.03)
    np.testing.assert_allclose(beta_of(true.position, true.axis), 0.7)
    assert np.abs(true.position.mean(axis=(0, 1))).max() < 0.01  # all directions
    off = pose_errors(1.1 * true.position, true.axis, true)
    np.testing.assert_allclose(off.position, 0.003)
    np.testing.assert_allclose(off.distance, 0.003)
    np.testing.assert_allclose(off.direction, 0.0, atol=1e-7)


def test_uniform_noise_has_its_deviation() -> None:
    noise = Noise(3e-6, "uniform", 1e-7)
    drawn = noise.added(np.zeros((20000, 3)), np.random.default_rng(1))
    assert np.abs(drawn).max() <= 3.05e-6
    assert drawn.std() == pytest.approx(noise.deviation, rel=0.02)
    np.testing.assert_allclose(drawn / 1e-7, np.round(drawn / 1e-7), atol=1e-9)


def test_paths_keep_their_distances(tracks: Study) -> None:
    study = tracks.result.study
    for path in (cubic, helical, sinusoidal, lambda one: random_path(one, 3)):
        position, axis = path(study)
        r = np.linalg.norm(position, axis=1)
        assert r.min() > 0.93 * study.nearest and r.max() < 1.001 * study.farthest
        np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0)
    r = np.linalg.norm(cubic(study)[0], axis=1)
    assert r.max() == pytest.approx(study.farthest, rel=1e-3)


def test_tracks_are_smoothed_and_the_published_algorithm_is_lost(tracks: Study) -> None:
    """Sixty windows: half as many as the recipe has, so with wider limits than it."""
    for one in tracks.result.paths:
        off, _, turned = one.errors(one.smoothed)
        assert np.sqrt(np.mean(off**2)) < 1.2e-3 and np.degrees(np.sqrt(np.mean(turned**2))) < 4.5
        assert one.wrong(one.smoothed) == 0 and not one.ambiguous
        assert one.wrong(one.published) > 10


def test_range_follows_the_cube_of_the_distance() -> None:
    found = studied(
        "localize_range", noises='["10 nT"]', distances='["50 mm", "100 mm"]', beta='["45 deg", "46 deg"]', draws="300"
    ).result
    assert found.axis[0, 1] / found.axis[0, 0] == pytest.approx(8.0, rel=0.15)
    sensor = Sensor(noise=10e-9 / np.sqrt(3))
    position = -0.1 * np.array([np.cos(np.pi / 4), 0, np.sin(np.pi / 4)])
    times = np.arange(600) / 20
    bound = pose_bound("rotor_1x3", position, [0, 0, 1], sensor, times=times)
    assert found.axis_bound[0, 1] == pytest.approx(bound.axis, rel=0.05)


def test_curves_show_the_bias_of_the_parametrisation() -> None:
    """Up to 6.5° by the issue of the eccentric angle, and next to none with the polar one."""
    found = studied("isoline_functions").result
    assert 5.0 < np.degrees(found.bias.max()) < 6.5
    assert np.degrees(found.mended_bias.max()) < 0.4


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"study": '"isoline"'}, "study must be one of"),
        ({"strengths": '["20 mm"]'}, "strengths|flux density"),
        ({"strengths": '"20 uT"'}, "list of quantities"),
        ({"draws": "0"}, "draws must be a whole number"),
        ({"model": '"rotor_9x9"'}, "unknown field model"),
        ({"frequency": '"1"'}, "frequency"),
        ({"frequency": '"11 Hz"'}, "below half the rate of 20 Hz"),
        ({"rate": '"-20 Hz"'}, "rate must be positive"),
        ({"duration": '"1e9 s"'}, "between 4 and 1000000 are possible"),
        ({"noise": '"-3 uT"'}, "noise must be positive"),
        ({"distribution": '"normal"'}, "distribution must be"),
        ({"kind": '"scenario"'}, "of kind"),
        ({"seed": "1\nseeds = 2"}, "unknown key"),
    ],
)
def test_bad_recipes_are_told(changes: dict[str, str], words: str) -> None:
    with pytest.raises((CardError, InputError), match=words):
        studied("localize_isolines", **changes)


def test_the_command_leaves_a_whole_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    card = tmp_path / "mine.toml"
    card.write_text(recipe("localize_range", distances='["20 mm", "40 mm"]', draws="10"))
    assert main(["simulate", str(card), "-o", str(tmp_path / "out"), "--json", "--quiet"]) == 0
    printed = json.loads(capsys.readouterr().out)
    data = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert data == printed and data["passed"] is True
    assert {one.name for one in (tmp_path / "out").iterdir()} == {
        *("summary.json", "data.npz", "recipe.toml", "report.html", "range.png")
    }
    arrays = np.load(tmp_path / "out" / "data.npz")
    assert arrays["direction"].shape == (5, 2) and np.isfinite(arrays["direction"]).all()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "")


def test_a_limit_that_is_not_kept_is_exit_code_one(tmp_path: Path) -> None:
    text = recipe(
        *("localize_isolines",),
        strengths='["20 uT"]',
        beta='["45 deg"]',
        draws="5",
        band_draws="50",
        bound="0.5",
    )
    (tmp_path / "mine.toml").write_text(text)
    command = ["simulate", str(tmp_path / "mine.toml"), "-o", str(tmp_path / "out"), "--no-pictures", "--quiet"]
    assert main(command) == 1
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"summary.json", "data.npz", "recipe.toml"}
