"""Random cards, possible and impossible: each is a device or one sentence, never another exception."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from magfem.errors import InputError, MagfemError
from magfem.geometry import CylinderMagnet, Geometry, PermanentMagnet, RingMagnet, load_geometry

POSSIBLE_MM = st.floats(0.1, 50).map(lambda value: f'"{value!r} mm"')
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True)
SCALAR = st.one_of(
    st.tuples(ANY_NUMBER, st.sampled_from(["mm", "m", "T", "kg", "", "Mm"])).map(lambda t: f'"{t[0]!r} {t[1]}"'),
    ANY_NUMBER.map(repr),
    st.integers().map(str),
    st.sampled_from(["true", '""', "[]", "{}", '"axial"', "1979-05-27", "07:32:00", '"4 mm\\n\\u2028"']),
    st.lists(ANY_NUMBER, max_size=4).map(lambda items: f"[{', '.join(map(repr, items))}]"),
)
LENGTH = st.one_of(POSSIBLE_MM, POSSIBLE_MM, POSSIBLE_MM, SCALAR)
REMANENCE = st.one_of(st.floats(-0.5, 3).map(lambda value: f'"{value!r} T"'), SCALAR)
PERMEABILITY = st.one_of(st.floats(0.5, 12).map(repr), SCALAR)
MAGNETISATION = st.one_of(st.sampled_from(['"axial"', '"diametric"', "[0, 1, 1]"]), SCALAR)
KEYS = {
    "ring_magnet": ("outer_diameter", "inner_diameter", "length"),
    "cylinder_magnet": ("diameter", "length"),
}


@st.composite
def cards(draw: st.DrawFn) -> str:
    kind = draw(st.sampled_from(sorted(KEYS)))
    dimensions = "\n".join(f"{key} = {draw(LENGTH)}" for key in KEYS[kind])
    region = draw(st.sampled_from(["", "[region]\n"]))
    if region:
        region += f"clearance = {draw(LENGTH)}\nextent = {draw(LENGTH)}\n"
    return (
        f'kind = "{kind}"\n[dimensions]\n{dimensions}\n[material]\nremanence = {draw(REMANENCE)}\n'
        f"recoil_permeability = {draw(PERMEABILITY)}\nmagnetisation = {draw(MAGNETISATION)}\n{region}"
    )


def assert_sound(geometry: Geometry) -> None:
    """What the stages on the right rely on."""
    assert geometry.volume > 0 and geometry.area > 0
    assert np.isfinite(geometry.moment).all() and np.linalg.norm(geometry.moment) > 0
    assert 0 < geometry.feature_size <= 2 * geometry.hull.radius <= 2000 * geometry.feature_size
    assert 0 < geometry.region.clearance < geometry.region.extent
    assert np.linalg.norm(geometry.bodies[0].material.magnetisation) - 1 < 1e-12


def load_text(text: str) -> Geometry:
    with tempfile.TemporaryDirectory() as folder:
        card = Path(folder, "random.toml")
        card.write_text(text, encoding="utf-8")
        return load_geometry(card)


def assert_device_or_sentence(text: str) -> None:
    try:
        geometry = load_text(text)
    except MagfemError as error:
        assert len(str(error).splitlines()) == 1
        assert "random.toml" in str(error)
    else:
        assert_sound(geometry)


@given(text=cards())
@settings(max_examples=400, derandomize=True, deadline=None)
def test_a_random_card_is_a_device_or_one_sentence(text: str) -> None:
    assert_device_or_sentence(text)


@given(text=st.text(max_size=80))
@settings(max_examples=150, derandomize=True, deadline=None)
def test_a_random_text_is_one_sentence(text: str) -> None:
    assert_device_or_sentence(text)


@given(
    outer=st.floats(1e-6, 10),
    bore=st.floats(0.01, 0.99),
    slenderness=st.floats(0.01, 50),
    remanence=st.floats(0.01, 2),
)
@settings(max_examples=200, derandomize=True, deadline=None)
def test_sensible_magnets_are_born(outer: float, bore: float, slenderness: float, remanence: float) -> None:
    length = min(max(outer * slenderness, 1e-6), 10.0)
    inner = max(outer * bore, 1e-6)
    material = PermanentMagnet(remanence)
    assert_sound(CylinderMagnet(diameter=outer, length=length, material=material))
    if inner < 0.995 * outer:
        assert_sound(
            RingMagnet(outer_diameter=outer, inner_diameter=inner, length=min(length, outer), material=material)
        )


@given(sizes=st.tuples(ANY_NUMBER, ANY_NUMBER, ANY_NUMBER), around=st.tuples(ANY_NUMBER, ANY_NUMBER))
@settings(max_examples=200, derandomize=True, deadline=None)
def test_any_floats_are_a_ring_or_one_sentence(sizes: tuple[float, float, float], around: tuple[float, float]) -> None:
    try:
        ring = RingMagnet(
            outer_diameter=sizes[0],
            inner_diameter=sizes[1],
            length=sizes[2],
            material=PermanentMagnet(1.35),
            clearance=around[0],
            extent=around[1],
        )
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert_sound(ring)
