"""Ring and cylinder magnets: closed forms against quadrature, Pappus and OpenCASCADE, and refusals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import dblquad

from magfem.errors import InputError
from magfem.geometry import AXIAL, DIAMETRIC, CylinderMagnet, Geometry, PermanentMagnet, RingMagnet

N48 = PermanentMagnet(remanence=1.35)
RING = RingMagnet(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=N48)
CYLINDER = CylinderMagnet(diameter=1e-3, length=3e-3, material=N48)
HALF_SECTIONS = [  # rho from, rho to, length, by hand
    pytest.param(RING, 0.75e-3, 2e-3, 1e-3, id="ring"),
    pytest.param(CYLINDER, 0.0, 0.5e-3, 3e-3, id="cylinder"),
]


@pytest.fixture
def occ() -> Iterator[Any]:
    """An empty OpenCASCADE model in metres."""
    import gmsh

    gmsh.initialize(["-v", "0"], interruptible=False)
    try:
        yield gmsh.model.occ
    finally:
        gmsh.finalize()


@pytest.mark.parametrize(("magnet", "rho_from", "rho_to", "length"), HALF_SECTIONS)
def test_volume_is_the_integral_over_the_half_section(
    magnet: Geometry, rho_from: float, rho_to: float, length: float
) -> None:
    integral, _ = dblquad(lambda rho, z: 2 * pi * rho, -length / 2, length / 2, rho_from, rho_to)
    assert magnet.volume == pytest.approx(integral, rel=1e-12, abs=0)


@pytest.mark.parametrize(("magnet", "rho_from", "rho_to", "length"), HALF_SECTIONS)
def test_area_follows_from_pappus(magnet: Geometry, rho_from: float, rho_to: float, length: float) -> None:
    # Each side of the half section turned about the axis: its length times the way of its centroid.
    walls = 2 * pi * (rho_from + rho_to) * length
    faces = 2 * 2 * pi * (rho_from + rho_to) / 2 * (rho_to - rho_from)
    assert magnet.area == pytest.approx(walls + faces, rel=1e-12, abs=0)


def test_moment_of_the_catalogue_ring_by_hand() -> None:
    # 1.35 T · π/4·(4² − 1.5²)·1 mm³ / (4π·1e-7 T·m/A) = 11.6016 mA·m²; µ₀ differs from 4π·1e-7 by 1.6e-10
    np.testing.assert_allclose(RING.moment, [0, 0, 1.35 * 13.75 / 16 * 1e-2], rtol=1e-9, atol=0)


def test_moment_points_along_the_magnetisation() -> None:
    tilted = replace(RING, material=PermanentMagnet(1.35, magnetisation=(0, 3, 4)))
    np.testing.assert_allclose(tilted.moment, RING.moment[2] * np.array([0, 0.6, 0.8]), rtol=1e-14)


@pytest.mark.parametrize("magnet", [RING, CYLINDER])
def test_the_body_is_the_magnet(magnet: Geometry) -> None:
    (body,) = magnet.bodies
    assert (body.name, body.material) == ("magnet", N48)
    assert (body.volume, body.area) == (magnet.volume, magnet.area)


def test_feature_size_is_the_thinnest_part() -> None:
    assert RING.feature_size == 1e-3
    assert replace(RING, length=2e-3).feature_size == pytest.approx(1.25e-3)  # the wall
    assert CYLINDER.feature_size == 1e-3
    assert replace(CYLINDER, length=0.2e-3).feature_size == 0.2e-3


@pytest.mark.parametrize(
    ("direction", "axisymmetric"),
    [(AXIAL, True), ((0, 0, -3), True), (DIAMETRIC, False), ((0, 1, 1), False), ((1e-6, 0, 1), False)],
)
def test_only_axial_magnets_are_axisymmetric(direction: tuple[float, float, float], axisymmetric: bool) -> None:
    material = PermanentMagnet(1.35, magnetisation=direction)
    assert replace(RING, material=material).axisymmetric is axisymmetric


def test_default_region_follows_the_size() -> None:
    assert (RING.region.clearance, RING.region.extent) == (0.5e-3, 6e-3)
    assert CYLINDER.region.clearance == pytest.approx(CYLINDER.length / 16, rel=0.05)
    assert CYLINDER.region.extent == 4.5e-3
    assert replace(RING, extent=9e-3).region.extent == 9e-3


@pytest.mark.parametrize("magnet", [RING, CYLINDER])
def test_solid_has_the_closed_volume_and_area(magnet: Geometry, occ: Any) -> None:
    (tag,) = magnet.build(occ)["magnet"]
    occ.synchronize()
    assert occ.getMass(3, tag) == pytest.approx(magnet.volume, rel=1e-9, abs=0)
    _, faces = occ.getSurfaceLoops(tag)
    assert sum(occ.getMass(2, face) for face in np.concatenate(faces)) == pytest.approx(magnet.area, rel=1e-9, abs=0)
    np.testing.assert_allclose(occ.getCenterOfMass(3, tag), 0, atol=1e-9)


@pytest.mark.parametrize("magnet", [RING, CYLINDER])
def test_solid_fills_its_hull(magnet: RingMagnet | CylinderMagnet, occ: Any) -> None:
    (tag,) = magnet.build(occ)["magnet"]
    radius, half = magnet.hull.diameter / 2, magnet.hull.length / 2
    box = [-radius, -radius, -half, radius, radius, half]
    np.testing.assert_allclose(occ.getBoundingBox(3, tag), box, atol=1e-6)  # OpenCASCADE pads boxes by 1e-7


@pytest.mark.parametrize("magnet", [RING, CYLINDER])
def test_half_section_turned_about_the_axis_is_the_solid(magnet: Geometry, occ: Any) -> None:
    (tag,) = magnet.build_meridian(occ)["magnet"]
    rho, z, off_plane = occ.getCenterOfMass(2, tag)
    assert 2 * pi * rho * occ.getMass(2, tag) == pytest.approx(magnet.volume, rel=1e-9, abs=0)  # Pappus
    assert (z, off_plane) == pytest.approx((0, 0), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"inner_diameter": 5e-3},
            "ring magnet: inner_diameter must be smaller than outer_diameter (4 mm), got 5 mm",
        ),
        ({"length": -1e-3}, "ring magnet: length must be positive, got -1 mm"),
        ({"length": float("nan")}, "ring magnet: length must be finite, got nan"),
        ({"length": "1 mm"}, 'ring magnet: length must be a number, got "1 mm"'),
        ({"length": True}, "ring magnet: length must be a number, got true"),
        ({"length": 10**400}, "ring magnet: length must be finite, got ~1e400"),
        ({"extent": "6 mm"}, 'ring magnet: extent must be a number, got "6 mm"'),
        ({"material": 1.35}, "ring magnet: material must be a PermanentMagnet, got 1.35"),
        ({"name": 3}, "ring magnet: name must be a text, got 3"),
    ],
)
def test_an_impossible_ring_is_not_born(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as raised:
        replace(RING, **change)
    assert str(raised.value) == message


def test_a_magnet_cannot_be_changed_afterwards() -> None:
    with pytest.raises(AttributeError):
        RING.length = 2e-3  # type: ignore[misc]
