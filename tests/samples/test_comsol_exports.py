"""COMSOL's text exports, written here as its manual describes them (Programming Reference Manual, Data Formats)."""

from __future__ import annotations

import logging
from pathlib import Path

import magpylib
import numpy as np
import pytest

from magfem.errors import InputError
from magfem.samples import Samples, read_comsol, read_samples
from magfem.typing import Floats

HEAD = """\
% Model:              ring.mph
% Version:            COMSOL 6.1.0.252
% Date:               Mar 13 2023, 16:27
% Dimension:          3
% Nodes:              3
% Expressions:        3
% Description:        Magnetic flux density, x-component, Magnetic flux density, y-component
% Length unit:        mm
"""

SPREADSHEET = (
    HEAD
    + """\
% x                       y                        z                        mf.Bx (T)                mf.By (T)                mf.Bz (mT)
-1.5                      0                        2                        1.0E-3                   -2.5E-4                  12.5
0                         0.25                     2                        NaN                      NaN                      NaN
1.5                       0                        2                        -1.0E-3                  2.5E-4                   12.5
"""  # noqa: E501
)

COMMA = """\
% Model,coil.mph
% Version,COMSOL 5.6.0.280
% Dimension,3
% Nodes,1
% Expressions,4
% Description,"Magnetic flux density, x-component"
% Length unit,µm
% X,Y,Z,mfnc.normB (T),comp1.mfnc.Bz (uT),comp1.mfnc.Bx (uT),comp1.mfnc.By (uT)
1,2,3,99,6,4,5
"""

# Two by three by two points: along a row x, from row to row y, then z.
GRID = (
    HEAD
    + """\
% Grid
-1 1
0 10 20
5 7
% Data
% mf.Bx (T)
1 2
3 4
5 6
7 8
9 10
11 12
% Data
% mf.normB (T)
0 0
0 0
0 0
0 0
0 0
0 0
% Data
% mf.Bz (mT)
-1 -2
-3 -4
-5 NaN
-7 -8
-9 -10
-11 -12
"""
)

AXISYMMETRIC = """\
% Model:              loop.mph
% Dimension:          2
% Length unit:        cm
% r                        z                        mf.Bz (T)                mf.Br (T)
0                          -1                       0.5                      0
2                          3                        0.25                     -0.125
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path("export.txt")


def read(path: Path, text: str, columns: dict[str, str] | None = None) -> Samples:
    path.write_text(text, encoding="utf-8")
    samples, known = read_comsol(path, columns), read_samples(path, columns)
    assert isinstance(known, Samples)
    assert np.array_equal(known.points, samples.points) and np.array_equal(known.B, samples.B, equal_nan=True)
    return samples


def test_a_spreadsheet(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "magfem"):
        samples = read(file, SPREADSHEET)
    assert samples.points == pytest.approx(np.array([[-1.5e-3, 0, 2e-3], [1.5e-3, 0, 2e-3]]), rel=1e-15, abs=0)
    expected = np.array([[1e-3, -2.5e-4, 12.5e-3], [-1e-3, 2.5e-4, 12.5e-3]])
    assert np.allclose(samples.B, expected, rtol=1e-15, atol=0)
    assert (samples.unit, samples.source) == ("T", "export.txt")
    assert caplog.messages[0] == "export.txt: 1 of 3 points are outside the geometry, left out"


def test_a_spreadsheet_with_commas_and_other_expressions(file: Path) -> None:
    samples = read(file, COMMA)
    assert samples.points[0] == pytest.approx([1e-6, 2e-6, 3e-6], rel=1e-15, abs=0)
    assert samples.B[0] == pytest.approx([4e-6, 5e-6, 6e-6], rel=1e-15, abs=0)


def test_names_too_long_for_their_columns(file: Path) -> None:
    """COMSOL pads to 25 characters; longer names stand one space apart."""
    heading = "% x y z component1.magnetic_fields.Bx (T) component1.magnetic_fields.By (T) mf.Bz (T)"
    samples = read(file, f"{HEAD}{heading}\n1 2 3 4 5 6\n")
    assert samples.B.tolist() == [[4, 5, 6]]


def test_a_grid(file: Path) -> None:
    samples = read(file, GRID)
    B = {tuple(point): value for point, value in zip(np.round(1e3 * samples.points).tolist(), samples.B, strict=True)}
    assert len(B) == 12
    for point, Bx, Bz in [
        ((-1, 0, 5), 1, -1e-3),
        ((1, 0, 5), 2, -2e-3),
        ((-1, 10, 5), 3, -3e-3),
        ((1, 20, 7), 12, -0.012),
    ]:
        assert B[point] == pytest.approx([Bx, np.nan, Bz], nan_ok=True)
    assert B[1, 20, 5] == pytest.approx([6, np.nan, np.nan], nan_ok=True)  # not measured, but for one component


def test_an_axisymmetric_export_is_the_half_plane(file: Path) -> None:
    samples = read(file, AXISYMMETRIC)
    assert samples.points == pytest.approx(np.array([[0, 0, -0.01], [0.02, 0, 0.03]]))
    assert np.array_equal(samples.B, [[0, np.nan, 0.5], [-0.125, np.nan, 0.25]], equal_nan=True)
    grid = (
        "% Dimension: 2\n% Length unit: cm\n% Grid\n0 2\n-1 3\n% Data\n% mf.Br (T)\n1 2\n3 4\n% Data\n% mf.Bphi (T)\n"
    )
    samples = read(file, grid + "5 6\n7 8\n")
    assert samples.points[[1, 2]] == pytest.approx(np.array([[0.02, 0, -0.01], [0, 0, 0.03]]))
    assert np.array_equal(samples.B[[1, 2]], [[2, 6, np.nan], [3, 7, np.nan]], equal_nan=True)


def test_a_plane_needs_its_third_coordinate(file: Path) -> None:
    plane = "% Dimension: 2\n% Length unit: mm\n% x  y  mf.Bx (T)  mf.By (T)\n1  2  3  4\n"
    samples = read(file, plane, {"z": "=2 mm"})
    assert samples.points == pytest.approx(np.array([[1e-3, 2e-3, 2e-3]]))
    with pytest.raises(InputError, match=r"column z is missing.*\[export.txt: line 3\]"):
        read(file, plane)


def test_expressions_by_other_names(file: Path) -> None:
    text = f"{HEAD}% x  y  z  aveop1(mf.Bx) (T)  -mf.Bz (T)\n1  2  3  4  5\n"
    samples = read(file, text, {"Bx": "aveop1(mf.Bx) (T)", "Bz": "--mf.Bz (T)"})
    assert np.array_equal(samples.B, [[4, np.nan, -5]], equal_nan=True)


def test_one_solution_is_read_and_several_are_not(file: Path) -> None:
    one = f"{HEAD}% x  y  z  mf.Bx (T) @ I0=1  mf.By (T) @ I0=1\n1  2  3  4  5\n"
    assert np.array_equal(read(file, one).B, [[4, 5, np.nan]], equal_nan=True)
    with pytest.raises(InputError, match=r'several solutions \("I0=1", "I0=2"\): export one of them .*line 9\]'):
        read(file, one.replace("mf.By (T) @ I0=1", "mf.Bx (T) @ I0=2"))


def spreadsheet(points: Floats, B: Floats) -> str:
    rows = "\n".join("  ".join(f"{x:.17g}" for x in row) for row in np.hstack([1e3 * points, 1e3 * B]).tolist())
    return f"{HEAD}% x  y  z  mf.Bx (mT)  mf.By (mT)  mf.Bz (mT)\n{rows}\n"


def grid(axes: list[Floats], B: Floats) -> str:
    """B (nx, ny, nz, 3) T."""
    text = HEAD + "% Grid\n" + "".join("  ".join(f"{1e3 * x:.17g}" for x in axis) + "\n" for axis in axes)
    for component in range(3):
        text += f"% Data\n% mf.B{'xyz'[component]} (T)\n"
        for k in range(len(axes[2])):
            for j in range(len(axes[1])):
                text += "  ".join(f"{x:.17g}" for x in B[:, j, k, component]) + "\n"
    return text


def test_both_formats_hold_the_field_of_magpylibs_magnet(file: Path) -> None:
    """A magnet without any symmetry: no axis and no component can stand for another."""
    magnet = magpylib.magnet.Cuboid(polarization=(0.3, -0.5, 1.1), dimension=(3e-3, 2e-3, 1e-3))
    axes = [np.linspace(-4e-3, 3e-3, 5), np.linspace(-2e-3, 4e-3, 4), np.linspace(2e-3, 5e-3, 3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    B = magnet.getB(points)
    for text in (spreadsheet(points.reshape(-1, 3), B.reshape(-1, 3)), grid(axes, B)):
        samples = read(file, text)
        assert samples.count == 60
        assert np.allclose(samples.B, magnet.getB(samples.points), rtol=1e-10, atol=0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z,Bx\n1,2,3,4\n", "not an export of COMSOL: expected its header, lines that begin with %"),
        (HEAD, "not an export of COMSOL"),
        (HEAD + "% Coordinates\n1 2 3\n% Elements\n1 2 3\n% Data\n1\n", "sectionwise exports are not read"),
        (SPREADSHEET.replace("% Length unit:        mm\n", ""), "the line % Length unit is missing"),
        (SPREADSHEET.replace("unit:        mm", "unit:        kg"), 'column "x [kg]" does not end in a unit of length'),
        (SPREADSHEET.replace("12.5\n0", "1x\n0"), 'got "1x" [export.txt: line 10, column mf.Bz (mT)]'),
        (SPREADSHEET.replace("NaN\n", "\n"), "expected 6 cells as in the header, got 5 [export.txt: line 11]"),
        (SPREADSHEET.replace("mf.B", "mf.H"), "column Bx is missing"),
        (SPREADSHEET.replace("mf.By (T)", ""), "expected names for the 6 columns below"),
        (SPREADSHEET.replace("0.25 ", "NaN  "), 'expected a finite number, got "NaN" [export.txt: line 11, column y]'),
        (f"{HEAD}% x  y  z  mf.Bx (T)\n1 2 3 NaN\n", "B is NaN at every point: one at least is needed"),
        (
            GRID.replace("11 12\n% Data\n% mf.n", "% Data\n% mf.n"),
            "expected 6 rows of 2 values on this grid, got 5 of 2",
        ),
        (GRID.replace("11 12\n% Data\n% mf.n", "% Data\n% mf.n"), "[export.txt: line 15, column mf.Bx (T)]"),
        (GRID.replace("9 10\n", "9\n", 1), "expected 2 cells as in the header, got 1 [export.txt: line 19]"),
        (GRID.replace("9 10\n", "9 x\n", 1), 'got "x" [export.txt: line 19, column mf.Bx (T)]'),
        (GRID.replace("5 7\n", "5 NaN\n"), "expected one to three lines of coordinates after % Grid [export.txt: line"),
        (GRID[: GRID.index("% Data")], "there are no values on the grid: expected a line % Data [export.txt: line 10]"),
    ],
)
def test_an_error_in_an_export_says_what_and_where(text: str, message: str, file: Path) -> None:
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_comsol(file)
    assert message in str(caught.value)


def test_percent_comments_do_not_make_an_export(file: Path) -> None:
    file.write_text("% Measured: yesterday\n% Version: 2\nx,y,z,Bx\n1,2,3,4\n")
    assert read_samples(file).points.tolist() == [[1, 2, 3]]
