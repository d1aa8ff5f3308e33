"""Text with units: the values against hand conversion, every refusal in its own words."""

from __future__ import annotations

import subprocess
import sys
from math import pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magfem.errors import InputError
from magfem.units import DIMENSIONS, format_quantity, quantity


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("4 mm", "length", 0.004),
        ("4mm", "length", 0.004),
        (" 4  mm\n", "length", 0.004),
        ("1.1 mm", "length", 0.0011),  # exactly: conversion is decimal
        (".5 mm", "length", 0.0005),
        ("4e-3 m", "length", 0.004),
        ("-4 mm", "length", -0.004),  # its sign is for the device to judge
        ("4 µm", "length", 4e-6),  # micro sign
        ("4 μm", "length", 4e-6),  # Greek mu
        ("4 um", "length", 4e-6),
        ("4 Mm", "length", 4e6),
        ("1 in", "length", 0.0254),
        ("1.35 T", "flux density", 1.35),
        ("1350 mT", "flux density", 1.35),
        ("180 deg", "angle", pi),
        ("90°", "angle", pi / 2),
        ("0.5 turn", "angle", pi),
        ("250 mA", "current", 0.25),
        ("3 A/mm²", "current density", 3e6),
        ("3 A/mm^2", "current density", 3e6),
        ("1.1 MA/m", "magnetisation", 1.1e6),
        ("10 mA m^2", "moment", 0.01),
        ("25 °C", "temperature", 298.15),
        ("25 degC", "temperature", 298.15),
        ("7.5 g/cm³", "density", 7500.0),
        ("1 mN·m", "torque", 0.001),
        ("2 MPa", "pressure", 2e6),
    ],
)
def test_text_becomes_its_si_value(text: str, dimension: str, value: float) -> None:
    assert quantity(text, dimension) == value


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_the_example_in_the_error_is_itself_accepted(dimension: str) -> None:
    assert quantity(DIMENSIONS[dimension].example, dimension) > 0


@pytest.mark.parametrize(
    ("text", "got"),
    [
        (4, "the bare number 4"),
        (0.5, "the bare number 0.5"),
        ("4", "the bare number 4"),
        (True, "true"),
        (None, "a NoneType"),
        ([4, "mm"], "a list"),
        ({"value": 4}, "a table"),
        pytest.param(10**5000, "the bare number ~1e5000", id="enormous"),
        ("", '"", which is not a number followed by a unit'),
        ("mm", '"mm", which is not a number followed by a unit'),
        ("4,5 mm", '"4,5 mm", which is not a number followed by a unit'),
        ("2*3 mm", '"2*3 mm", which is not a number followed by a unit'),
        ("2 × 3 mm", '"2 × 3 mm", which is not a number followed by a unit'),
        ("4 mm + 1 mm", '"4 mm + 1 mm", which is not a number followed by a unit'),
        ("4 mm; import os", '"4 mm; import os", which is not a number followed by a unit'),
        ("٤ mm", '"٤ mm", which is not a number followed by a unit'),
        ("4\n\u2028;", r'"4\n\u2028;", which is not a number followed by a unit'),
        ("4 mm mm", '"4 mm mm", which is not a length'),
        ("4 kg", '"4 kg", which is not a length'),
        ("4 MM", '"4 MM", which is not a length (case counts: did you mean "4 mm"?)'),
        ("4 foo", '"4 foo", and "foo" is no known unit'),
        ("1e999 mm", '"1e999 mm", which is not finite'),
        ("1e308 Mm", '"1e308 Mm", which is not finite'),
        ("nan mm", '"nan mm", which is not finite'),
        ("-inf mm", '"-inf mm", which is not finite'),
    ],
)
def test_what_is_no_length_is_refused_in_one_sentence(text: object, got: str) -> None:
    with pytest.raises(InputError) as raised:
        quantity(text, "length")
    assert str(raised.value) == f'expected a length with its unit, such as "4 mm", got {got}'


@pytest.mark.parametrize("text", ["5 percent", "1 m/m", "1 rad/s"])
def test_a_ratio_is_no_angle(text: str) -> None:
    with pytest.raises(InputError) as raised:
        quantity(text, "angle")
    expected = f'expected an angle with its unit, such as "30 deg", got "{text}", which is not an angle'
    assert str(raised.value) == expected


@pytest.mark.parametrize(
    ("value", "dimension", "text"),
    [
        (0.004, "length", "4 mm"),
        (0.0, "length", "0 m"),
        (4e-6, "length", "4 µm"),
        (-0.0015, "length", "-1.5 mm"),
        (0.9999999e-3, "length", "1 mm"),
        (15.0, "length", "15 m"),
        (1.35, "flux density", "1.35 T"),
        (pi / 6, "angle", "30 deg"),
        (0.002, "mass", "2 g"),
        (1e6, "magnetisation", "1 MA/m"),
        (298.15, "temperature", "298.15 K"),
        (7500.0, "density", "7500 kg/m³"),
    ],
)
def test_si_value_becomes_what_people_write(value: float, dimension: str, text: str) -> None:
    assert format_quantity(value, dimension) == text


@given(value=st.floats(1e-9, 1e9), dimension=st.sampled_from(sorted(DIMENSIONS)))
@settings(max_examples=100, derandomize=True, deadline=None)
def test_reading_undoes_writing(value: float, dimension: str) -> None:
    assert quantity(format_quantity(value, dimension), dimension) == pytest.approx(value, rel=1e-5, abs=0)


_WORDS = st.lists(
    st.sampled_from(["4", "1e5", "-", " ", "mm", "m", "°", "°C", "µ", "²", "^", "**", "/", "*", "·", "e", "dB"]),
    max_size=6,
).map("".join)


@given(text=st.one_of(st.text(max_size=12), _WORDS), dimension=st.sampled_from(sorted(DIMENSIONS)))
@settings(max_examples=300, derandomize=True, deadline=None)
def test_any_text_is_a_number_or_a_sentence(text: str, dimension: str) -> None:
    try:
        assert isinstance(quantity(text, dimension), float)
    except InputError as error:
        assert len(str(error).splitlines()) == 1


def test_importing_geometry_loads_neither_pint_nor_gmsh_nor_numba() -> None:
    code = "import sys, magfem.geometry; print(sorted({'pint', 'gmsh', 'numba'} & set(sys.modules)))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
