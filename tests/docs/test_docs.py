"""The documentation as a reader uses it: its Python runs, its command lines parse, its links lead somewhere."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from magfem.cli.program import command_line
from magfem.localization import Belief, Branch
from magfem.rod import MagnetPoses
from magfem.typing import Floats, Vectors

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "benchmarks" / "README.md"]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def on_axis(z: float) -> float:
    """B_z (T) of the rigid ring 4 × 1.5 × 1 mm, 1.35 T, on its axis at z mm: the elementary formula of a solenoid."""
    return (
        1.35 / 2 * sum(s * t * (z + t / 2) / np.hypot(z + t / 2, r) for s, r in ((1, 2), (-1, 0.75)) for t in (1, -1))
    )


RIGID, RIGID_SLOPE = on_axis(3.0), (on_axis(3.001) - on_axis(2.999)) / 2e-6

# B_z (T) at 1 A of 24 loops that fill radii 1 to 6 mm, 1 mm above their middle.
RADII = 1e-3 + 5e-3 * (np.arange(24) + 0.5) / 24
LOOPS = float((2e-7 * np.pi * RADII**2 / (RADII**2 + 1e-6) ** 1.5).sum())


def off_the_quarter(poses: MagnetPoses) -> float:
    """How far poses 20 and 40 mm along a quarter of a circle of 50 mm are off: the largest of their squared errors over
    the stated covariance, next to what χ² exceeds once in a thousand.
    """
    angle, radius = np.radians([36, 72]), 0.1 / np.pi
    shift = poses.positions - radius * np.stack([1 - np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    turn = poses.directions - np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    pairs = ((shift, poses.position_covariance, 3), (turn, poses.direction_covariance, 2))
    return max(
        float(np.einsum("mi,mij,mj->m", away, np.linalg.pinv(spread, rcond=1e-6, hermitian=True), away).max())
        / chi2.ppf(0.999, freedom)
        for away, spread, freedom in pairs
    )


def surely(pose: Branch | Belief, position: Floats) -> bool:
    """Whether a pose is as near as its covariance says: χ² of three numbers, below its value for 999 of 1000."""
    away = pose.position - position
    return bool(away @ np.linalg.inv(pose.covariance[:3, :3]) @ away < chi2.ppf(0.999, 3))


def axis_off(axes: Vectors, true: Vectors) -> float:
    """Root mean square angle between axes (n, 3) and the true one, deg, as the page prints it."""
    return round(float(np.degrees(np.sqrt(np.mean(np.arccos(axes @ true) ** 2)))), 1)


# For every Python block of a page, in order: an expression, its value, and the relative tolerance.
EXPECTED = {
    "tutorial.md": [
        ("geometry.volume * 1e9", 10.7992, 1e-4),
        ("solution.error['B'] < 5e-6", True, 0),
        ("B[2]", 0.973 * RIGID, 5e-3),  # less 2.7 % of demagnetisation
        ("model.report['bound']['B'] < 5e-4", True, 0),
        ("gradient[0, 2, 2]", 0.973 * RIGID_SLOPE, 5e-3),
        ("far[2] / (2e-7 * model.moment[2] / 0.1**3)", 1.0, 5e-3),  # a dipole, far away
        ("check.passed", True, 0),
        ("2 * circuit.resistance_error < 1e-3 and coil.power([0.2]) / circuit.resistance", 0.04, 1e-9),
    ],
    "localization.md": [
        ("surely(pose, position) and surely(pose.branches[0], position)", True, 0),
        ("surely(both, position) and not both.ambiguous", True, 0),
        ("np.sqrt(np.mean(off**2)) < 1 and not found.ambiguous", True, 0),
        ("surely(belief, path[-1]) and not belief.ambiguous and not belief.faulty", True, 0),
        ("[axis_off(one.axis, turned) for one in (as_published, mended, ours)] == [9.7, 9.0, 5.2]", True, 0),
        (
            "np.all(np.abs(found.sensors[0].gain - gain) < 4 * found.deviations[0].gain) and found.residual < 1.5",
            True,
            0,
        ),
        ("bound.untold == ('the offset of the sensor', 'the static field') and np.isinf(bound.condition)", True, 0),
        ("repr(float(found.sensors[0].offset[2])) in Path('calibrated.toml').read_text()", True, 0),
        ("bound.axis / pose.axis_deviation", 1.0, 0.1),  # the pose states what the bound says
        ("samples.shape[0] * array.shape[0]", 1200, 0),
    ],
    "coil-systems.md": [
        ("abs(rows[:, :3] @ currents - B).max() / abs(B).max()", 0.0, 1e-12),
        ("abs(field.B(points) - B).max() / abs(B).max()", 0.0, 1e-12),
        ("abs(standing.B(points, currents) - turned).max() / abs(turned).max()", 0.0, 1e-12),
        (  # a coil of the air kind, 80 mm along its axis; after a quarter turn it lies at (10, −80) mm
            "gantry.B([0.01, 0, 0], [1.0], [0.01, np.pi / 2])[1] / sum(f * a / 0.08**n for n, f, a in ("
            "(3, 2, 6.422646756191394e-07), (4, -6, 1.870831551827318e-08), (5, 24, 1.7460902399025802e-10), "
            "(6, -120, 5.183775351972603e-13)))",
            1.0,
            1e-12,
        ),
        ("found.torque @ pose.rotation.apply(moment) / np.linalg.norm(found.torque)", 0.0, 1e-12),
        ("least.met and even.met and even.peak < least.peak and least.norm < even.norm", True, 0),
        ("abs(along.conditioning.lost[0, 0]) * (along.outcome == 'impossible')", 1.0, 1e-9),
        ("planned.met and planned.norm <= find_currents(bigmag, magnet, angles).norm", True, 0),
        ("np.all(reach.field_everywhere <= reach.field_best) and reach.field_best.max() < 8 * 6 * 3e-3", True, 0),
        # Published: B_x = Σ a_k (−1)^{k+1} (k+1)!/x^{k+2} on the axis of the air-cored coil; both point the same way.
        (
            "pair.B([0, 0, 0], [1, -1])[0] / (2 * sum(f * a / 0.08**n for n, f, a in ("
            "(3, 2, 6.422646756191394e-07), (4, -6, 1.870831551827318e-08), (5, 24, 1.7460902399025802e-10), "
            "(6, -120, 5.183775351972603e-13))))",
            1.0,
            1e-12,
        ),
        (  # the published number, the cubic's share of one ampere aside
            "again.B([0, 0, 0], np.ones(8))[2] * (bench.report['saturation']['saturates'] == ['Coil_2'])",
            3.73329e-3 + 45e-6,
            1e-2,
        ),
        ("octomag.B([0, 0, 0], np.ones(8))[2]", 3.73329e-3, 1e-5),
        ("exact.exact and ring.maximum < 0.01", True, 0),
    ],
    "how-to.md": [
        ("disc.region.extent", 12e-3, 1e-9),
        ("ring.moment[2]", 0.0116016, 1e-4),
        ("hot.material.working_remanence / hot.material.remanence", 1 - 0.0012 * 60, 1e-9),
        ("oblique.material.magnetisation[2]", 0.5**0.5, 1e-9),
        ("half.B([0.0, 0.0, 1e-3])[2] / (0.5 * LOOPS)", 1.0, 5e-3),
        ("drive.power / (0.02 * sum(circuit.resistance for circuit in stator.circuits))", 1.0, 1e-9),
        (
            "flux_linkage(loop, magfem.exact(small).at(place))[0] / (loop.B([0, 0, 10e-3])[2] * small.moment[2])",
            1,
            1e-3,
        ),
        ("second.inductance[0, 0] / 12.5936e-3", 1.0, 5e-3),  # H, by integration of A·J
        ("gradient.trace() / abs(gradient).max()", 0.0, 1e-12),
        ("B.shape[0] * B.shape[1]", 41 * 101, 0),
        ("ring_model.region.extent", 6e-3, 1e-9),
        (
            "abs(B_of_model('rotor.json', 2 * somewhere) / rotor.B(2 * somewhere) - 1).max()"
            " + abs(B_of_model('ring.json', somewhere) / ring_model.B(somewhere) - 1).max()",
            0.0,
            1e-10,
        ),
        ("check.passed", True, 0),
        ("tight.error['B'] <= 1e-3", True, 0),
        ("finer.report['heldout']['B']['max'] <= 5e-5", True, 0),
        ("abs(again.B([0, 0, 3e-3]) - solution.B([0, 0, 3e-3])).max()", 0.0, 0.0),
    ],
    "measured-data.md": [
        ("samples.points[1, 0] * samples.B[1, 2] * samples.sigma[1, 1]", 1e-3 * 11.43e-3 * 20e-6, 1e-12),
        ("scan.points[0, 0] - scan.points[0, 2]", 22e-3, 1e-12),
        ("system.currents[1, 1] * system.B[1, 0]", -0.3e-3, 1e-12),
        ("half_plane.points[1, 0] * half_plane.B[1, 2]", 2e-3 * 0.021, 1e-12),
        ("abs(again.B - scan.B).max() + abs(again.points - scan.points).max()", 0.0, 0.0),
        ("abs(field.gradient(field.region.centre)[2, 2])", 2.0, 0.05),  # T/m, as the data set is called
        ("offset.report['heldout']['B']['absolute_rms'] < 0.8 * report['heldout']['B']['absolute_rms']", True, 0),
        ("found['remanence']['value']", 1.126, 2e-3),  # the documentation's own fit
        # On the axis below a disc's middle: half the remanence times the difference of two cosines.
        (
            "abs(on_the_bench.B([0.0, 0.0, -7e-3])[2]) / (0.5 * found['remanence']['value'] * sum("
            "s * (h + s * 1e-3) / ((h + s * 1e-3) ** 2 + 16e-6) ** 0.5 for h in (7e-3 + centre[2],) for s in (1, -1)))",
            1.0,
            0.05,
        ),
        ("scale['factor']", 1.22 / 1.42, 0.02),  # the mean of what 6.1.2's readings imply
        ("B_deviation.max() < 1e-4", True, 0),
    ],
    "steering.md": [
        (  # on the plant, solved anew at the currents that were found
            "max(np.degrees(np.arccos(axis @ goal.direction)) for axis, goal in zip("
            "plant.solve((bigmag, now.currents, now.joints), guess=state).magnet_frames[:, :, 2], wanted)) < 0.06",
            True,
            0,
        ),
        ("now.outcome == 'limit active' and plan(impossible, now, starts=4).outcome == 'unreachable'", True, 0),
        ("[one['outcome'] == 'converged' for one in told['targets']] == [True, False] and run.passed.all()", True, 0),
    ],
    "shape-sensing.md": [
        ("not line.used[::10].any() and abs(line.noise / 1e-4 - 1) < 0.2 and off_the_quarter(poses) < 1", True, 0),
        (
            "np.degrees(np.arctan2(direction[0], direction[2])) - 36",
            np.degrees(2e-3 / 0.05 * np.pi / 4),
            1e-6,
        ),  # κ δs/2
        (
            "abs(carried - carried[0]).max() + abs(carried[:, :, 2] - [0.6, 0, 0.8]).max()"
            " + ('undefined where the rod is straight' not in refused)",
            0.0,
            1e-9,
        ),
        ("abs(seen.noise / 0.5 - 1) < 0.2 and off_the_quarter(of_magnets) < 1", True, 0),
    ],
    "rods.md": [
        ("state.stable and np.abs(state.internal_force[-1]).max()", 0.0, 0),  # nothing acts on the tip
        ("np.degrees(np.arccos(hook.frames[-1][2, 2]))", np.degrees(0.5), 1e-9),
        (
            "np.abs(J[1, :3, 2] - (more.magnet_positions[1] - bent.magnet_positions[1]) / 0.01).max()"
            " < 0.01 * np.abs(J[1, :3, 2]).max()",
            True,
            0,
        ),
        ("straight.unstable_directions + buckled.unstable_directions", 2, 0),
        ("np.abs(turn[:, 5] - [0, 0, 1]).max()", 0.0, 1e-9),  # about gravity and field, all turns together
        ("np.abs(force.sum(axis=0)).max() / np.abs(force).max()", 0.0, 1e-9),
        ("np.degrees(np.arccos(across.frames[-1][2, 2]))", 69.63546369, 1e-3),
    ],
    "exchange.md": [
        ("(B - block.getB((0, 0, 4e-3)))[2]", 0.973 * RIGID, 5e-3),
        ("gradient[2, 2] / (theirs.B([0, 0, 4.001e-3]) - theirs.B([0, 0, 3.999e-3]))[2] * 2e-6", 1.0, 1e-6),
        ("grid['B'][grid.find_closest_point((0, 0, 3e-3))][2]", 0.973 * RIGID, 5e-3),
    ],
}


def blocks(page: Path, language: str) -> list[str]:
    return [text for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")) if kind == language]


TRUTHS = {"LOOPS": LOOPS, "off_the_quarter": off_the_quarter, "surely": surely, "axis_off": axis_off}


@pytest.mark.parametrize("name", EXPECTED)
def test_python_blocks_give_the_numbers_they_promise(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = blocks(ROOT / "docs" / name, "python")
    assert len(code) == len(EXPECTED[name])
    names: dict[str, object] = {}
    for number, (text, (expression, value, tolerance)) in enumerate(zip(code, EXPECTED[name], strict=True)):
        exec(compile(text, f"{name}, Python block {number + 1}", "exec"), names)
        found = eval(expression, names | TRUTHS)
        assert found == pytest.approx(value, rel=tolerance, abs=tolerance if value == 0 else 0), (number, expression)


def test_readme_example_runs(tmp_path, monkeypatch, capsys):
    """The example of the README prints what the block after it shows."""
    monkeypatch.chdir(tmp_path)
    page = ROOT / "README.md"
    exec(compile(blocks(page, "python")[0], "README.md", "exec"), {})
    printed = capsys.readouterr().out.split()
    shown = blocks(page, "text")[0].split()
    assert len(printed) == len(shown)
    for ours, theirs in zip(printed, shown, strict=True):
        try:
            assert float(ours.strip("[](),")) == pytest.approx(float(theirs.strip("[](),")), rel=0.05, abs=1e-6)
        except ValueError:
            assert ours == theirs


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_command_lines_parse(page):
    """Every `magfem …` line of a shell block is one that the command line understands."""
    parser = command_line()
    for block in blocks(page, "sh"):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["magfem"]:
                assert callable(parser.parse(words[1:]).run), line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_that_pages_name_exist(page):
    for name in re.findall(r"`((?:magfem|tests|benchmarks|docs|tools)/[\w/.]+)`", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name
