"""C headers, compiled by a C and a C++ compiler without a warning and run next to magfem."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange.exchanged_fields import FIELDS, KINDS, POSE, SHELL, TermsField, points_of, worst
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.errors import InputError
from magfem.exchange import c_header
from magfem.exchange.c_source import as_c_name, c_name
from magfem.fields import Evaluated, Everywhere, Field, Shell
from magfem.fields.hull import BoxHull, PolytopeHull, SphereHull
from magfem.fields.region import Region
from magfem.fields.region_parts import region_points
from magfem.fields.terms import uniform
from magfem.fields.workspace_region import Ball, Box
from magfem.typing import Points

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Werror")
PROGRAM = """
#include <stdio.h>
#include "some_field.h"

int main(void)
{
    double p[3], B[3], alone[3], gradient[9];
    int i, same;
    while (scanf("%lf %lf %lf", &p[0], &p[1], &p[2]) == 3) {
        some_field(p, B, gradient);
        some_field(p, alone, 0);
        same = B[0] == alone[0] && B[1] == alone[1] && B[2] == alone[2];
        printf("%d %d", some_inside(p), same);
        for (i = 0; i < 3; ++i) {
            printf(" %.17g", B[i]);
        }
        for (i = 0; i < 9; ++i) {
            printf(" %.17g", gradient[i]);
        }
        printf("\\n");
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def compiler() -> str:
    program = shutil.which("cc") or shutil.which("gcc")
    if not program:
        pytest.skip("needs a C compiler (Debian: gcc, libc6-dev)")
    return program


def compiled(compiler: str, folder: Path, header: str, *options: str) -> Path:
    """The program above around a header."""
    (folder / "some_field.h").write_text(header)
    (folder / "program.c").write_text(PROGRAM)
    words = [compiler, *(options or ("-std=c99",)), *STRICT, "-O2", "program.c", "-o", "program", "-lm"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "program"


def run(program: Path, points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """inside (n,), B (n, 3) and gradient (n, 3, 3) by the program; B alone is the same B."""
    lines = "\n".join(" ".join(map(repr, row)) for row in points.tolist())
    done = subprocess.run([program], input=lines, capture_output=True, text=True, check=True)
    numbers = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert numbers.shape == (len(points), 14) and np.all(numbers[:, 1] == 1)
    return numbers[:, 0], numbers[:, 2:5], numbers[:, 5:].reshape(-1, 3, 3)


@pytest.mark.parametrize("name", FIELDS)
def test_compiled_header_gives_the_field(compiler: str, tmp_path: Path, name: str) -> None:
    points = points_of(name)
    B, gradient = FIELDS[name].jet(points, 1, outside="extrapolate")
    _, found, slopes = run(compiled(compiler, tmp_path, c_header(FIELDS[name], "some")), points)
    assert len(points) == 500
    assert worst(found, B) < 1e-12
    if name == "uniform":
        assert np.abs(slopes).max() < 1e-14
    else:
        assert worst(slopes, gradient) < 1e-12


def test_axis_and_disc_are_no_exceptions(compiler: str, tmp_path: Path) -> None:
    """Where K and E cancel, on axes, close to them, in the planes of sources, and above rims.

    Far away the discs' own formula cancels, by design of the model: 9 mm is beyond the regions that use it.
    """
    model = TermsField(KINDS["loops"] + KINDS["charge discs"])
    heights = np.array([-3e-3, 0.0, 1.1e-3, 9e-3])
    beside = np.array([0.0, 1e-9, 1e-5, 2e-4, 1e-3, 2e-3, 3e-3])
    grid = np.stack(np.meshgrid(beside, [0.0], heights), axis=-1).reshape(-1, 3)
    B, gradient = model.jet(grid, 1, outside="extrapolate")
    _, found, slopes = run(compiled(compiler, tmp_path, c_header(model, "some")), grid)
    assert worst(found, B) < 1e-12
    assert worst(slopes, gradient) < 1e-12


FRONT = Shell(SHELL.hull, 0.5e-3, 6e-3, z=(1e-3, 6e-3), rho=(0.0, 5e-3))
BESIDE = Shell(SHELL.hull, 0.0, 6e-3, z=(-2e-3, math.inf), rho=(3e-3, 6e-3))
BALL = Ball((1e-3, -0.5e-3, 2e-3), 5e-3)
BOX = Box((-3e-3, -4e-3, 0.5e-3), (5e-3, 2e-3, 6e-3))


def placed_sum(*regions: Region) -> Field:
    """Loops in regions, each a little beside the others."""
    turn = Rotation.from_rotvec([0.2, -0.1, 0.3])
    moves = [RigidTransform.from_components([k * 0.4e-3, 0.0, -k * 0.3e-3], turn**k) for k in range(len(regions))]
    parts = [TermsField(KINDS["loops"], region).at(move) for region, move in zip(regions, moves, strict=True)]
    return sum(parts[1:], parts[0])


REGIONS = {
    "cylinder": TermsField(KINDS["loops"]),
    "sphere": TermsField(KINDS["loops"], Shell(SphereHull(3e-3), 0.0, 5e-3)),
    "placed": TermsField(KINDS["loops"]).at(POSE),
    "sum of a box and a cylinder": FIELDS["placed, scaled and summed"],
    "everywhere": TermsField(KINDS["loops"], Everywhere()),
    "window in front": TermsField(KINDS["loops"], FRONT),
    "window beside": TermsField(KINDS["loops"], BESIDE),
    "window, placed": TermsField(KINDS["loops"], FRONT).at(POSE),
    "window behind a box": TermsField(KINDS["loops"], Shell(BoxHull((3e-3, 2e-3, 1e-3)), 0.0, 6e-3, z=(-5e-3, -1e-3))),
    "ball": TermsField(KINDS["loops"], BALL),
    "ball, placed": TermsField(KINDS["loops"], BALL).at(POSE),
    "box": TermsField(KINDS["loops"], BOX),
    "box, placed": TermsField(KINDS["loops"], BOX).at(POSE),
    "sum of a window, a ball and a box": placed_sum(FRONT, BALL, BOX),
}


@pytest.mark.parametrize("name", REGIONS)
def test_inside_is_the_region(compiler: str, tmp_path: Path, name: str) -> None:
    points = np.random.default_rng(4).uniform(-9e-3, 9e-3, (6000, 3))
    inside, _, _ = run(compiled(compiler, tmp_path, c_header(REGIONS[name], "some")), points)
    expected = REGIONS[name].region.contains(points)
    assert np.all(inside == expected)
    assert name == "everywhere" or 100 < expected.sum() < 5900


@pytest.mark.parametrize("name", sorted(REGIONS.keys() - {"everywhere"}))
def test_inside_ends_where_the_region_ends(compiler: str, tmp_path: Path, name: str) -> None:
    """Points in pairs, one inside and one outside, not a picometre apart, on every face of the region."""
    region = REGIONS[name].region
    points = np.random.default_rng(5).uniform(-9e-3, 9e-3, (6000, 3))
    is_in = region.contains(points)
    count = min(is_in.sum(), (~is_in).sum())
    within, beyond = points[is_in][:count], points[~is_in][:count]
    for _ in range(36):  # halved from 3 cm
        middle = (within + beyond) / 2
        is_in = region.contains(middle)[:, None]
        within, beyond = np.where(is_in, middle, within), np.where(is_in, beyond, middle)
    assert count > 100 and np.abs(within - beyond).max() < 1e-12
    program = compiled(compiler, tmp_path, c_header(REGIONS[name], "some"))
    assert np.all(run(program, within)[0] == 1) and np.all(run(program, beyond)[0] == 0)


@pytest.mark.parametrize("name", ["bigmag_iron", "solenoid_24x48x60_front"])
def test_coils_of_the_catalogue_per_ampere(compiler: str, tmp_path: Path, name: str) -> None:
    """In T/A, one in a ball and one in a window, both in front of the coil."""
    coil = magfem.load_model(name)
    points = region_points(coil.region, 500)
    header = c_header(coil, "some")
    inside, found, slopes = run(compiled(compiler, tmp_path, header), points)
    assert np.all(inside == 1) and "T of a disc, for 1 A" in header and "the field of 1 A" in header
    assert worst(found, coil.B(points)) < 1e-12 and worst(slopes, coil.gradient(points)) < 1e-12
    assert np.all(run(tmp_path / "program", points * [1, 1, -1])[0] == 0)  # behind it


def test_region_that_c_is_not_told_of(compiler: str, tmp_path: Path) -> None:
    """Of a polytope there is a field, and the answer −1."""
    corners = ((0, 0, 0), (1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 1e-3))
    model = TermsField(KINDS["loops"], Shell(PolytopeHull(corners), 1e-3, 5e-3))
    header = c_header(model, "some")
    inside, found, _ = run(compiled(compiler, tmp_path, header), points_of("loops"))
    assert np.all(inside == -1) and "some_inside returns -1" in header
    assert worst(found, model.B(points_of("loops"), outside="extrapolate")) < 1e-12


@pytest.mark.parametrize("name", ["everything", "uniform", "ring_magnet_4x1.5x1"])
def test_header_is_cpp_as_well(compiler: str, tmp_path: Path, name: str) -> None:
    header = c_header(FIELDS[name], "some")
    program = compiled(compiler, tmp_path, header, "-x", "c++", "-std=c++11")
    _, found, _ = run(program, points_of(name))
    assert worst(found, FIELDS[name].B(points_of(name), outside="extrapolate")) < 1e-12


def test_two_models_in_one_program(compiler: str, tmp_path: Path) -> None:
    """Nothing that a header defines lacks its name, and what is not called is no warning."""
    for name, model in (("ring", FIELDS["ring_magnet_4x1.5x1"]), ("all", FIELDS["everything"])):
        (tmp_path / f"{name}.h").write_text(c_header(model, name))
    text = '#include "ring.h"\n#include "all.h"\n#include "ring.h"\n'
    (tmp_path / "program.c").write_text(text + "int main(void) { return ring_inside(all_sources[0].centre); }\n")
    words = [compiler, "-std=c99", *STRICT, "program.c", "-o", "program", "-lm"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_header_holds_what_its_terms_need_and_every_bit() -> None:
    ring = magfem.load_model("ring_magnet_4x1.5x1")
    header = c_header(ring, "ring")
    assert "ring_add_loop" in header and "ring_complex" not in header and "MODEL_" not in header
    for value in (*ring.lowered.coefficient, *ring.lowered.centre[:, 2], *ring.lowered.radius):
        assert repr(float(value)) in header


def test_header_says_what_it_is() -> None:
    ring = magfem.load_model("ring_magnet_4x1.5x1")
    comment = c_header(ring, "ring").split("*/")[0]
    for text in (ring.name, "T/m", ring.region.describe(), f"{ring.report['bound']['B']:.1e}", "geometries/ring"):
        assert text in comment
    assert "the field of 1 A" in c_header(TermsField(KINDS["loops"], unit="T/A"), "coil").split("*/")[0]


def test_no_name_can_end_the_comment(compiler: str, tmp_path: Path) -> None:
    named = TermsField(KINDS["uniform"], name="a */ b /* c ??/\n\\")
    compiled(compiler, tmp_path, c_header(named, "some"))


@pytest.mark.parametrize("name", ["", "1ring", "ring magnet", "ring;", "π"])
def test_names_that_c_refuses(name: str) -> None:
    with pytest.raises(InputError, match="C name"):
        c_header(TermsField(uniform([0, 0, 1])), name)


@pytest.mark.parametrize("text", ["ring_magnet_4x1.5x1", "4 mm", "int", "", "π", "a-b", "__x"])
def test_any_text_has_a_c_name(text: str) -> None:
    assert c_name(as_c_name(text))


class Solved(Evaluated):
    """A field without terms, such as a solution."""

    region, unit = Everywhere(), "T"

    def evaluate(self, points: Points, order: int) -> tuple[np.ndarray, ...]:
        raise AssertionError


def test_a_field_without_terms_is_refused() -> None:
    with pytest.raises(InputError, match="fit a model to it first"):
        c_header(Solved(), "some")


def test_numbers_that_c_cannot_hold_are_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        c_header(TermsField(uniform([0, np.nan, 1])), "some")


def test_shell_of_the_examples_is_the_rings() -> None:
    """The shell that most examples here use holds the ring's own hull."""
    assert SHELL.hull == magfem.load_model("ring_magnet_4x1.5x1").region.hull
