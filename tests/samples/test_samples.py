"""Samples: what they keep, what they refuse, and that a file gives back every bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from magfem.errors import InputError
from magfem.samples import Samples, SystemSamples, read_samples, samples_text

FINITE = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(min_value=0, exclude_min=True, allow_infinity=False)


def table(count: int, columns: int, elements: st.SearchStrategy[float] = FINITE) -> st.SearchStrategy[Any]:
    return arrays.arrays(float, (count, columns), elements=elements)


@st.composite
def samples(draw: st.DrawFn) -> Samples:
    """Any samples: whole and partial rows, with deviations or without, of both units."""
    count = draw(st.integers(1, 5))
    B = draw(table(count, 3))
    for row in range(count):
        B[row, draw(st.sampled_from([[], [0], [1], [2], [0, 1], [0, 2], [1, 2]]))] = np.nan
    sigma = draw(st.none() | table(count, 3, POSITIVE))
    return Samples(draw(table(count, 3)), B, sigma, draw(st.sampled_from(["T", "T/A"])))


@st.composite
def system_samples(draw: st.DrawFn) -> SystemSamples:
    count, coils = draw(st.integers(1, 4)), draw(st.integers(1, 12))
    sigma = draw(st.none() | table(count, 3, POSITIVE))
    return SystemSamples(draw(table(count, 3)), draw(table(count, coils)), draw(table(count, 3)), sigma)


def bits(values: Any) -> bytes:
    """-0.0 is not 0.0 here, and NaN is itself."""
    return b"" if values is None else np.where(np.isnan(values), np.nan, values).tobytes()


@given(written=st.one_of(samples(), system_samples()))
def test_a_file_gives_back_every_bit(written: Samples | SystemSamples, tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("samples") / "s.csv"
    path.write_text(samples_text(written))
    read = read_samples(path)
    assert type(read) is type(written)
    assert bits(read.points) == bits(written.points)
    assert bits(read.B) == bits(written.B)
    assert (read.sigma is None) == (written.sigma is None)
    assert bits(read.sigma) == bits(written.sigma)
    if isinstance(written, Samples) and isinstance(read, Samples):
        assert read.unit == written.unit
    else:
        assert bits(read.currents) == bits(written.currents)  # type: ignore[union-attr]


def test_the_text_is_what_the_file_format_says() -> None:
    one = Samples([[0.001, 0, -2.5e-7]], [[1e-3, np.nan, -0.25]], 1e-6)
    assert samples_text(one) == "x,y,z,Bx,By,Bz,sx,sy,sz\n0.001,0.0,-2.5e-07,0.001,nan,-0.25,1e-06,nan,1e-06\n"
    assert samples_text(Samples([[1, 2, 3]], [[4, 5, 6]], unit="T/A")).startswith("x,y,z,Bx_T/A,By_T/A,Bz_T/A\n")
    coils = SystemSamples([[1, 2, 3]], [[7, 8]], [[4, 5, 6]])
    assert samples_text(coils) == "px,py,pz,i0,i1,bx,by,bz\n1.0,2.0,3.0,7.0,8.0,4.0,5.0,6.0\n"


def test_subsets_keep_rows_together() -> None:
    rng = np.random.default_rng(1)
    whole = Samples(rng.normal(size=(9, 3)), rng.normal(size=(9, 3)), rng.uniform(1, 2, (9, 3)), "T/A", "a probe")
    mask = whole.points[:, 0] > 0
    for which in (mask, np.flatnonzero(mask)):
        part = whole.subset(which)
        assert np.array_equal(part.points, whole.points[mask]) and np.array_equal(part.B, whole.B[mask])
        assert part.sigma is not None and whole.sigma is not None
        assert np.array_equal(part.sigma, whole.sigma[mask])
        assert (part.count, part.unit, part.source) == (mask.sum(), "T/A", "a probe")
    coils = SystemSamples(whole.points, rng.normal(size=(9, 2)), whole.B)
    assert np.array_equal(coils.subset(slice(2, 5)).currents, coils.currents[2:5])
    assert (coils.coils, coils.subset(slice(2, 5)).count) == (2, 3)
    with pytest.raises(InputError, match="there are no samples"):
        whole.subset(np.zeros(9, dtype=bool))


def test_what_was_measured_and_where() -> None:
    probe = Samples([[0, 0, 0], [4, -2, 1]], [[np.nan, 1, np.nan], [2, 3, np.nan]], [1.0, 2.0, 3.0])
    assert np.array_equal(probe.measured, [[False, True, False], [True, True, False]])
    assert np.array_equal(probe.sigma, [[np.nan, 2, np.nan], [1, 2, np.nan]], equal_nan=True)
    assert np.array_equal(probe.centre, [2, -1, 0.5]) and np.array_equal(probe.extent, [4, 2, 1])


def test_samples_cannot_change_behind_a_models_back() -> None:
    points = np.ones((2, 3))
    kept = Samples(points, np.ones((2, 3)), 1.0)
    points[:] = 7
    assert kept.points[0, 0] == 1
    for array in (kept.points, kept.B, kept.sigma):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 2  # type: ignore[index]


GOOD = {"points": np.ones((2, 3)), "B": np.ones((2, 3))}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"points": np.ones((2, 2))}, r"points must be an array \(n, 3\), got shape \(2, 2\)"),
        ({"points": np.ones((3, 3))}, "got 3, 2 rows"),
        ({"points": np.ones((0, 3)), "B": np.ones((0, 3))}, "there are no samples"),
        ({"points": [[1, 2, 3], [1, np.nan, 3]]}, "points must be finite .sample 1"),
        ({"points": "here"}, "points must be an array of numbers"),
        ({"B": [[1, 2, 3], [np.inf, 2, 3]]}, "B must be finite, or NaN where it was not measured .sample 1"),
        ({"B": [[1, 2, 3], [np.nan] * 3]}, "no component of B was measured.*sample 1"),
        ({"sigma": 0.0}, "standard deviations must be positive"),
        ({"sigma": [1, 2, np.nan]}, "standard deviations must be positive"),
        ({"sigma": np.ones(2)}, r"sigma must be one number, \(3,\) or \(n, 3\), got shape \(2,\)"),
        ({"unit": "mT"}, 'must be "T" or "T/A", got \'mT\''),
    ],
)
def test_samples_are_valid_or_not_born(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Samples(**(GOOD | changed))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"currents": np.ones(2)}, r"currents must be an array \(n, coils\)"),
        ({"currents": np.ones((3, 1))}, "got 2, 2, 3 rows"),
        ({"currents": [[1.0], [np.inf]]}, "currents must be finite .sample 1"),
        ({"B": [[1, 2, 3], [1, 2, np.nan]]}, "B of a coil system must be finite"),
    ],
)
def test_system_samples_are_valid_or_not_born(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SystemSamples(**(GOOD | {"currents": np.ones((2, 1))} | changed))


def test_importing_loads_numpy_alone() -> None:
    code = "import sys, magfem.samples; print(*sorted({n.partition('.')[0] for n in sys.modules}))"
    root = Path(__file__).parents[2]
    loaded = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True).stdout
    assert not {"scipy", "pint", "numba", "gmsh", "skfem"} & set(loaded.split())
