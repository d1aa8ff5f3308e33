"""Reading CSV: headers, units, mappings, and what an error says. The expected numbers stand in each test."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magfem.errors import InputError
from magfem.samples import Samples, SystemSamples, parse_columns, read_samples
from magfem.samples.table import parse_table

ROW = [0.003, -0.0005, 0.012], [0.01, -0.002, 0.25]  # m, T

HEADERS = {
    "SI": ("x,y,z,Bx,By,Bz", "0.003,-0.0005,0.012,0.01,-0.002,0.25"),
    "lower case": ("x,y,z,bx,by,bz", "0.003,-0.0005,0.012,0.01,-0.002,0.25"),
    "upper case": ("X,Y,Z,BX,BY,BZ", "0.003,-0.0005,0.012,0.01,-0.002,0.25"),
    "suffixes": ("x_mm,y_um,z_cm,bx_mT,By_uT,Bz_T", "3,-500,1.2,10,-2000,0.25"),
    "brackets": ("x [mm],y (µm),z[cm],Bx [mT],By (µT),Bz [Wb/m^2]", "3,-500,1.2,10,-2000,0.25"),
    "another order": ("Bz,note,x_mm,By_mT,z_mm,y_mm,Bx_mT", "0.25,edge,3,-2,12,-0.5,10"),
    "points of a system": ("px_mm,py_mm,pz_mm,bx_mT,by_mT,bz_mT", "3,-0.5,12,10,-2,250"),
    "quoted": ('"x_mm","y_mm","z_mm","Bx_mT","By_mT","Bz_mT"', '"3",-0.5,"12",10,-2,250'),
    "semicolons": ("x_mm;y_mm;z_mm;Bx_mT;By_mT;Bz_mT", "3;-0.5;12;10;-2;250"),
    "tabs": ("x_mm\ty_mm\tz_mm\tBx_mT\tBy_mT\tBz_mT", "3\t-0.5\t12\t10\t-2\t250"),
    "spaces": (" x_mm , y_mm,z_mm,Bx_mT,By_mT,Bz_mT", " 3, -0.5 ,12,10,-2,2.5e2 "),
    "comments": ("# a probe\n\n% 2021\nx_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT", "\n3,-0.5,12,10,-2,250\n"),
    "other columns": ("t,x_error,x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT,bx_raw", "noon,?,3,-0.5,12,10,-2,250,"),
}


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path("s.csv")


def read(path: Path, text: str, columns: dict[str, str] | None = None, sigma: float | None = None) -> Samples:
    path.write_text(text, encoding="utf-8")
    samples = read_samples(path, columns, sigma)
    assert isinstance(samples, Samples)
    return samples


def refusal(path: Path, text: str | bytes, columns: dict[str, str] | None = None) -> str:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        read_samples(path, columns)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", HEADERS)
def test_headers_and_units(name: str, file: Path) -> None:
    header, row = HEADERS[name]
    samples = read(file, f"{header}\n{row}\n")
    assert samples.points[0] == pytest.approx(ROW[0], rel=1e-15, abs=0)
    assert samples.B[0] == pytest.approx(ROW[1], rel=1e-15, abs=0)
    assert (samples.unit, samples.sigma, samples.source) == ("T", None, "s.csv")


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_line_ends_of_every_system_and_a_byte_order_mark(ending: str, file: Path) -> None:
    file.write_bytes(b"\xef\xbb\xbf" + ending.join(["x,y,z,Bx,By,Bz", "1,2,3,4,5,6", "7,8,9,1,2,3"]).encode())
    samples = read_samples(file)
    assert samples.points.tolist() == [[1, 2, 3], [7, 8, 9]] and samples.B.tolist() == [[4, 5, 6], [1, 2, 3]]


def test_standard_deviations(file: Path) -> None:
    common = read(file, "x,y,z,Bx,By,Bz,sigma_uT\n1,2,3,4,5,6,7\n1,2,3,4,5,6,8\n")
    assert common.sigma == pytest.approx(np.array([[7e-6] * 3, [8e-6] * 3]))
    own = read(file, "x,y,z,Bx,By,Bz,sx_uT,sy_mT,sz\n1,2,3,4,5,6,7,8,9\n")
    assert own.sigma == pytest.approx(np.array([[7e-6, 8e-3, 9]]))
    stated = read(file, "x,y,z,Bx,By,Bz,sx_uT,sy_mT,sz\n1,2,3,4,5,6,7,8,9\n", sigma=2e-6)
    assert stated.sigma is not None and stated.sigma.tolist() == [[2e-6] * 3]
    constant = read(file, "x,y,z,Bx,By,Bz\n1,2,3,4,5,6\n", {"sigma": "=2 uT"})
    assert constant.sigma is not None and constant.sigma.tolist() == [[2e-6] * 3]
    for sigma in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="sigma must be a positive number"):
            read_samples(file, sigma=sigma)


def test_fields_per_ampere(file: Path) -> None:
    samples = read(file, "x,y,z,Bx_mT/A,By [mT/A],Bz (T/A),sigma\n1,2,3,4,5,6,7\n")
    assert samples.unit == "T/A"
    assert samples.B[0] == pytest.approx([4e-3, 5e-3, 6]) and samples.sigma == pytest.approx(np.full((1, 3), 7))
    assert 'must be all in T or all in T/A, got "By" and "Bx_T/A" [s.csv: line 1]' in refusal(
        file, "x,y,z,Bx_T/A,By,Bz\n1,2,3,4,5,6\n"
    )


def test_a_probe_of_one_axis(file: Path) -> None:
    samples = read(file, "x,y,z,Bz_mT,sz_uT\n1,2,3,4,5\n")
    assert np.array_equal(samples.B, [[np.nan, np.nan, 4e-3]], equal_nan=True)
    assert samples.sigma is not None
    assert np.array_equal(samples.sigma, [[np.nan, np.nan, 5e-6]], equal_nan=True)
    single = read(file, "x,y,z,Bx,By,Bz,sigma\n1,2,3,4,nan,NaN,7\n1,2,3,nan,5,6,7\n")
    assert np.array_equal(single.measured, [[True, False, False], [False, True, True]])
    assert np.array_equal(np.isnan(single.sigma), ~single.measured)  # type: ignore[arg-type]


def test_a_coil_system(file: Path) -> None:
    file.write_text("px_mm,py_mm,pz_mm,i1_mA,I0,i2,bx_mT,by_uT,bz,sigma\n1,2,3,4,5,6,7,8,9,2\n")
    samples = read_samples(file)
    assert isinstance(samples, SystemSamples)
    assert samples.points[0] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert samples.currents.tolist() == [[5, 0.004, 6]]  # by their number, not by their place
    assert samples.B[0] == pytest.approx([7e-3, 8e-6, 9])
    assert samples.sigma is not None and samples.sigma.tolist() == [[2, 2, 2]]
    file.write_text("x,y,z,coil,Bx,By,Bz\n1,2,3,4,5,6,7\n")
    mapped = read_samples(file, {"i0": "coil [mA]", "i1": "=2 A"})
    assert isinstance(mapped, SystemSamples) and mapped.currents.tolist() == [[0.004, 2]]


def test_columns_by_other_names(file: Path) -> None:
    text = "stage_x_mm,stage_y,depth [um],raw,Bx_mT\n1,2,3,4,5\n"
    columns = {"x": "-stage_x_mm", "y": "stage_y [cm]", "z": "depth [um]", "Bz": "- raw [uT]", "by": "raw [mT]"}
    samples = read(file, text, columns)
    assert samples.points[0] == pytest.approx([-1e-3, 2e-2, 3e-6], rel=1e-15, abs=0)
    assert samples.B[0] == pytest.approx([5e-3, 4e-3, -4e-6], rel=1e-15, abs=0)
    swapped = read(file, "x,y,z,Bx,By,Bz\n1,2,3,4,5,6\n", {"x": "y", "y": "-x", "Bx": "By", "By": "-Bx"})
    assert swapped.points.tolist() == [[2, -1, 3]] and swapped.B.tolist() == [[5, -4, 6]]


def test_the_bar_of_a_header_that_begins_with_a_minus(file: Path) -> None:
    """The file's own name comes first, negation second."""
    samples = read(file, "-x_mm,y,z,Bx,By,Bz\n1,2,3,4,5,6\n", {"x": "-x_mm"})
    assert samples.points[0, 0] == pytest.approx(1e-3)


def test_constants_stand_for_columns(file: Path) -> None:
    samples = read(file, "s_mm,Bx\n1,5\n2,6\n", {"x": "s_mm", "y": "=0 mm", "z": "=-7.5 mm"})
    assert samples.points.tolist() == [[0.001, 0, -0.0075], [0.002, 0, -0.0075]]


def test_texts_of_a_command_line() -> None:
    assert parse_columns(["x=-stage_mm", "PY==0 mm", "bz = raw [mT]"]) == {
        "x": "-stage_mm",
        "y": "=0 mm",
        "Bz": "raw [mT]",
    }
    for texts, message in [
        (["x"], 'expected NAME=COLUMN, such as x=magnet_x_mm, or a constant, such as y==0 mm, got "x"'),
        (["x="], 'got "x="'),
        (["w=a"], 'samples have no column "w": expected x, y, z, Bx'),
        (["x=a", "px=b"], 'column x is given twice: as "a" and as "b"'),
    ]:
        with pytest.raises(InputError) as caught:
            parse_columns(texts)
        assert message in str(caught.value)


HEAD = "x,y,z,Bx,By,Bz"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "column x is missing: expected the header x,y,z,Bx,By,Bz (m, T; or x_mm, Bx_mT)"),
        ("\n# nothing\n", "got an empty file [s.csv: line 1]"),
        (f"{HEAD}\n", "there are no rows under the header [s.csv: line 1]"),
        ("x,y,Bx\n1,2,3\n", 'such as x=stage_mm, got "x,y,Bx" [s.csv: line 1]'),
        ("x,y,z\n1,2,3\n", "column Bx is missing"),
        ("x,y,z,Hx\n1,2,3,4\n", "column Bx is missing"),
        (f"{HEAD},x_mm\n1,2,3,4,5,6,7\n", 'column x is there 2 times: "x", "x_mm" [s.csv: line 1]'),
        (f"{HEAD},bx_mT\n1,2,3,4,5,6,7\n", 'column Bx is there 2 times: "Bx", "bx_mT" [s.csv: line 1]'),
        ("# b\nx,y,z,Bx_mm\n1,2,3,4\n", 'column "Bx_mm" does not end in a unit of flux density such as mT'),
        ("# b\nx,y,z,Bx_mm\n1,2,3,4\n", "[s.csv: line 2]"),
        ("x_mT,y,z,Bx\n1,2,3,4\n", 'column "x_mT" does not end in a unit of length such as mm [s.csv: line 1]'),
        (f"{HEAD}\n1,2,3,4,5,6\n\n1,2,3,4,5,six\n", 'got "six" [s.csv: line 4, column Bz]'),
        (f"# a\n{HEAD}\n1,2,3,4,5,inf\n", "expected a finite number, or nan where nothing was measured"),
        (f"# a\n{HEAD}\n1,2,3,4,5,inf\n", '"inf" [s.csv: line 3, column Bz]'),
        (f"{HEAD}\n1,2,nan,4,5,6\n", 'expected a finite number, got "nan" [s.csv: line 2, column z]'),
        (f"{HEAD}\n1,2,3,4,5,\n", 'got "" [s.csv: line 2, column Bz]'),
        (f"{HEAD}\n1,2,3,4,5,1_0\n", 'got "1_0" [s.csv: line 2, column Bz]'),
        (f"{HEAD}\n1,2,3,4,5,6\n1,2,3,nan,nan,nan\n", "no component of B was measured: one at least is needed"),
        (f"{HEAD}\n1,2,3,4,5,6\n1,2,3,nan,nan,nan\n", "[s.csv: line 3]"),
        (f"{HEAD}\n1,2,3,4,5\n", "expected 6 cells as in the header, got 5 [s.csv: line 2]"),
        (f"{HEAD}\n1,2,3,4,5,6,7\n1,2,3,4,5\n", "expected 6 cells as in the header, got 7 [s.csv: line 2]"),
        (f"{HEAD}\n0,1,0,2,0,3,0,4,0,5,0,6\n", "got 12: decimal commas are not read, write 1.5 [s.csv: line 2]"),
        (
            "x;y;z;Bx;By;Bz\n1;2,5;3;4;5;6\n",
            'expected a number with a decimal point, got "2,5" [s.csv: line 2, column y]',
        ),
        (f'{HEAD}\n1,2,3,4,5,"6\n', "not valid CSV: unexpected end of data [s.csv: line 2]"),
        (f"{HEAD}\n1,2,\0,4,5,6\n", "expected a text file, got a binary one [s.csv]"),
        (b"\x89HDF\r\n\x1a\n\xff\xfe", "not UTF-8 text [s.csv]"),
        ("1,2,3,4,5,6\n", 'there is no header: expected x,y,z,Bx,By,Bz or the like, got "1,2,3,4,5,6" [s.csv: line 1]'),
        (f"# by NumPy\n# {HEAD}\n1,2,3,4,5,6\n", "the header is a comment: take away the mark before it"),
        (f"# by NumPy\n# {HEAD}\n1,2,3,4,5,6\n", "[s.csv: line 2]"),
        (f"{HEAD},sx,sz\n1,2,3,4,5,6,7,8\n", "column sy is missing: every component that was measured has"),
        (f"{HEAD},sx,sigma\n1,2,3,4,5,6,7,8\n", "columns sigma and sx, sy, sz are both there"),
        (f"{HEAD},sigma_mT\n1,2,3,4,5,6,7\n1,2,3,4,5,6,0\n", "a standard deviation must be positive, got 0"),
        (f"{HEAD},sigma_mT\n1,2,3,4,5,6,7\n1,2,3,4,5,6,0\n", "[s.csv: line 3, column sigma_mT]"),
        (f"{HEAD},sigma\n1,2,3,4,5,6,nan\n", "a standard deviation must be positive, got nan [s.csv: line 2"),
        (f"{HEAD},i0,i2\n1,2,3,4,5,6,7,8\n", "column i1 is missing: expected a current for every coil from i0 on"),
        ("px,py,pz,i0,bx,by\n1,2,3,4,5,6\n", "column Bz is missing: expected the header px,py,pz,i0,...,iN,bx,by,bz"),
        (f"{HEAD},i0\n1,2,3,nan,5,6,7\n", 'expected a finite number, got "nan" [s.csv: line 2, column Bx]'),
        ("x,y,z,i0,Bx_T/A,By_T/A,Bz_T/A\n1,2,3,4,5,6,7\n", "a coil system must be in T, got T/A"),
    ],
)
def test_an_error_says_what_and_where(text: str | bytes, message: str, file: Path) -> None:
    assert message in refusal(file, text)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"x": "stage"}, 'there is no column "stage" for x: the nearest is "stage_mm" [s.csv: line 1]'),
        ({"x": "q"}, 'there is no column "q" for x: the columns are "stage_mm,pos,pos,depth,Bz_mT" [s.csv: line 1]'),
        ({"x": "0 mm"}, 'there is no column "0 mm" for x: a constant is written "=0 mm" [s.csv: line 1]'),
        ({"x": "pos"}, 'column "pos" is there 2 times [s.csv: line 1]'),
        ({"x": "depth"}, 'column "depth" does not end in a unit of length: state it, such as "depth [mm]" [s.csv: li'),
        ({"x": "depth [mT]"}, 'column "depth [mT]" does not end in a unit of length such as mm [s.csv: line 1]'),
        ({"x": "=0"}, 'column x: expected a length with its unit, such as "4 mm", got the bare number 0'),
        ({"x": "=0 mT"}, 'column x: expected a length with its unit, such as "4 mm", got "0 mT"'),
        ({"Bx": "=0 mT"}, 'column Bx cannot be a constant: B is what was measured, got "=0 mT"'),
        ({"radius": "stage_mm"}, 'samples have no column "radius"'),
        ({"x": "stage_mm", "px": "stage_mm"}, "column x is given twice"),
        ({"x": 0}, "columns map names to texts"),
    ],
)
def test_a_mapping_that_cannot_be(columns: dict[str, str], message: str, file: Path) -> None:
    text = "stage_mm,pos,pos,depth,Bz_mT\n1,2,3,4,5\n"
    usual = {"x": "stage_mm", "y": "=0 mm", "z": "=1 mm"}
    assert message in refusal(file, text, columns if "px" in columns else usual | columns)


@pytest.mark.parametrize("name", ["missing.csv", "."])
def test_a_file_that_is_none(name: str, file: Path) -> None:
    with pytest.raises(InputError, match=r"no such file \[missing.csv\]|expected a CSV file, got a directory \[\.\]"):
        read_samples(name)


def test_the_fast_way_and_the_careful_way_agree(file: Path) -> None:
    """A quoted cell anywhere sends a whole file the careful way."""
    rng = np.random.default_rng(1)
    values = rng.normal(size=(200, 6)) * 10.0 ** rng.integers(-300, 300, (200, 6))
    rows = [",".join(map(repr, row)) for row in values.tolist()]
    fast = parse_table(file, "\n".join([HEAD, *rows]))
    quoted = parse_table(file, "\n".join([HEAD, *rows[:-1], '"' + rows[-1].replace(",", '","') + '"']))
    assert fast._fast(range(6)) is not None and quoted._fast(range(6)) is None
    assert np.array_equal(fast.numbers([5, 0, 3]), values[:, [5, 0, 3]])
    assert np.array_equal(quoted.numbers([5, 0, 3]), values[:, [5, 0, 3]])


def test_reading_logs_nothing_when_nothing_is_left_out(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, "magfem"):
        read(file, f"{HEAD}\n1,2,3,4,5,6\n")
    assert caplog.messages == []


WORDS = [
    "x",
    "y",
    "z",
    "Bx",
    "By",
    "Bz",
    "sx",
    "sigma",
    "i0",
    "i1",
    "_mm",
    "_mT/A",
    " [mT]",
    " (T)",
    ",",
    ";",
    "\t",
    " ",
    "  ",
]
WORDS += [
    "\n",
    "%",
    "# ",
    "% Grid\n",
    "% Data\n",
    "% Length unit: mm\n",
    "mf.Bx (T)",
    " @ t=1",
    "1",
    "-2.5e-3",
    "nan",
    "inf",
]
WORDS += [
    '"',
    "0,5",
    "x,y,z,Bx\n",
    "1,2,3,4\n",
    "% x y z mf.Bx (T)\n",
    "1 2 3 4\n",
    "r",
    "=",
    "-",
    "\0",
    "\x85",
    "\u2028",
    "٣",
]


@given(text=st.one_of(st.lists(st.sampled_from(WORDS), max_size=30).map("".join), st.text(max_size=40)))
def test_whatever_a_file_holds_samples_or_one_sentence(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("samples") / "s.csv"
    path.write_text(text, encoding="utf-8", errors="replace")
    for columns in (None, {"y": "=1 mm", "z": "-x", "Bz": "mf.Bx (T)"}):
        try:
            samples = read_samples(path, columns)
        except InputError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert np.isfinite(samples.points).all() and samples.count > 0
