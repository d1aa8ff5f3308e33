"""Closed forms of every magnet kind against magpylib, and of Halbach rings against Halbach's formula."""

from __future__ import annotations

from dataclasses import replace
from math import log, pi
from typing import Any

import magpylib
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import magfem
from magfem.errors import InputError
from magfem.fields.norms import relative_errors
from magfem.geometry import (
    BlockMagnet,
    CylinderMagnet,
    CylinderSegmentMagnet,
    DiscMagnet,
    HalbachArray,
    HalbachRing,
    MagnetAssembly,
    MagneticSolids,
    MagnetStack,
    PermanentMagnet,
    PlacedMagnet,
    RingMagnet,
    SphereMagnet,
)
from magfem.geometry.ball import Ball
from magfem.geometry.box import Box
from magfem.geometry.sector import Sector
from magfem.geometry.tube import Tube

SKEW = PermanentMagnet(1.3, 1.0, (1.0, -2.0, 0.5))
AXIAL = PermanentMagnet(1.3, 1.0)
SEGMENT = {"outer_diameter": 20e-3, "length": 8e-3, "start_angle": 0.4, "end_angle": 1.7, "material": SKEW}
KINDS: dict[str, MagneticSolids] = {
    "ring": RingMagnet(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=SKEW),
    "cylinder": CylinderMagnet(diameter=1e-3, length=3e-3, material=SKEW),
    "disc": DiscMagnet(diameter=8e-3, thickness=2e-3, material=SKEW),
    "block": BlockMagnet(size=(5e-3, 4e-3, 2e-3), material=SKEW),
    "sphere": SphereMagnet(diameter=5e-3, material=SKEW),
    "segment": CylinderSegmentMagnet(inner_diameter=12e-3, **SEGMENT),
    "wedge": CylinderSegmentMagnet(**SEGMENT),
    "stack": MagnetStack(outer_diameter=45e-3, length=30e-3, count=2, gap=10e-3, material=AXIAL),
    "halbach_ring": HalbachRing(
        outer_diameter=30e-3, inner_diameter=20e-3, length=10e-3, segments=8, gap=0.2e-3, material=AXIAL
    ),
    "halbach_array": HalbachArray(size=(5e-3, 4e-3, 3e-3), count=5, step=pi / 4, material=AXIAL),
    "assembly": MagnetAssembly(
        magnets=(
            PlacedMagnet(BlockMagnet(size=(5e-3, 4e-3, 2e-3), material=SKEW), (1e-3, 0, 5e-3), (0.1, 0.4, -0.7)),
            PlacedMagnet(SphereMagnet(diameter=4e-3, material=SKEW), (0, 0, -4e-3), (0.3, 0, 0)),
            PlacedMagnet(CylinderMagnet(diameter=2e-3, length=6e-3, material=AXIAL), (8e-3, 0, 0), (0, pi / 3, 0)),
        )
    ),
}


def rival(magnets: MagneticSolids) -> magpylib.Collection:
    """The same device in magpylib: shapes, poses and directions put in by hand."""
    sources: list[Any] = []
    for part in magnets.parts:
        J = part.material.remanence * np.array(part.material.magnetisation)
        shape = part.shape
        if isinstance(shape, Box):
            source: Any = magpylib.magnet.Cuboid(polarization=J, dimension=shape.size)
        elif isinstance(shape, Ball):
            source = magpylib.magnet.Sphere(polarization=J, diameter=shape.diameter)
        elif isinstance(shape, Tube) and shape.inner_diameter == 0:
            source = magpylib.magnet.Cylinder(polarization=J, dimension=(shape.outer_diameter, shape.length))
        else:
            assert isinstance(shape, Tube | Sector)
            start, end = (0.0, 2 * pi) if isinstance(shape, Tube) else (shape.start, shape.end)
            start, end = (angle - 2 * pi * (end > 2 * pi) for angle in (start, end))
            size = (
                shape.inner_diameter / 2,
                shape.outer_diameter / 2,
                shape.length,
                np.degrees(start),
                np.degrees(end),
            )
            source = magpylib.magnet.CylinderSegment(polarization=J, dimension=size)
        sources.append(source.rotate(Rotation.from_rotvec(part.rotation), anchor=(0, 0, 0)).move(part.position))
    return magpylib.Collection(*sources)


@pytest.mark.parametrize("name", KINDS)
def test_exact_matches_magpylib_inside_and_outside(name: str) -> None:
    magnets = KINDS[name]
    field, other = magfem.exact(magnets), rival(magnets)
    outside = magnets.region.layers(np.random.default_rng(3), layers=12, per_layer=30)
    outside = outside + np.random.default_rng(8).normal(scale=1e-5, size=outside.shape)  # magpylib errs in face planes
    if any(isinstance(part.shape, Sector) for part in magnets.parts):  # there magpylib errs near the axis as well
        outside = outside[:, np.hypot(outside[..., 0], outside[..., 1]).min(axis=0) > 4e-3]
    truth = other.getB(outside.reshape(-1, 3)).reshape(outside.shape)
    assert relative_errors(field.B(outside), truth).max() <= 1e-6  # magpylib's own error far from a segment
    for part in magnets.parts:
        corners = part.shape.corners
        box = np.random.default_rng(4).uniform(corners.min(axis=0), corners.max(axis=0), (200, 3))
        inside = part.pose.apply(box[part.shape.contains(box)])
        assert len(inside) >= 20
        assert relative_errors(field.B(inside), other.getB(inside), layered=False).max() <= 1e-8


@pytest.mark.parametrize("name", ["segment", "stack", "halbach_ring", "assembly"])
def test_gradient_and_hessian_are_the_slopes_of_B(name: str) -> None:
    """Central differences of B; placed and summed parts turn their derivatives rightly."""
    magnets = KINDS[name]
    points = magnets.region.layers(np.random.default_rng(5), layers=3, per_layer=8).reshape(-1, 3)
    field = magfem.exact(magnets)
    _, gradient, hessian = field.jet(points, 2)
    h = 1e-5 * magnets.hull.radius / 1e-2
    for axis in range(3):
        step = h * np.eye(3)[axis]
        slope = (field.B(points + step) - field.B(points - step)) / (2 * h)
        bend = (field.gradient(points + step) - field.gradient(points - step)) / (2 * h)
        size, scale = (np.sqrt(np.sum(x**2, axis=tuple(range(1, x.ndim)))) for x in (gradient, hessian))
        assert (np.linalg.norm(slope - gradient[..., axis], axis=1) <= 1e-4 * size).all()
        assert (np.linalg.norm(bend - hessian[..., axis], axis=(1, 2)) <= 1e-4 * scale).all()


@pytest.mark.parametrize(("segments", "accuracy"), [(8, 1e-6), (16, 1e-6), (32, 1e-6)])
def test_long_halbach_ring_has_halbachs_field(segments: int, accuracy: float) -> None:
    """B_r ln(R_o/R_i) sin(2π/n)/(2π/n) along +x; with many segments B_r ln(R_o/R_i)."""
    ring = HalbachRing(outer_diameter=30e-3, inner_diameter=20e-3, length=2.0, segments=segments, material=AXIAL)
    ideal = 1.3 * log(1.5)
    factor = np.sin(2 * pi / segments) / (2 * pi / segments)
    np.testing.assert_allclose(magfem.exact(ring).B([0.0, 0.0, 0.0]), [ideal * factor, 0, 0], atol=accuracy * ideal)
    assert ring.ideal_field == pytest.approx(ideal * factor, rel=1e-12)
    if segments == 32:
        assert ring.ideal_field == pytest.approx(ideal, rel=7e-3)


def test_quadrupole_ring_has_a_null_and_a_gradient() -> None:
    """Two pole pairs, n segments, endless: the gradient 2 B_r (1/R_i − 1/R_o) sin(3π/n)/(3π/n) (Halbach 1980)."""
    ring = HalbachRing(
        outer_diameter=30e-3, inner_diameter=20e-3, length=3.0, segments=16, pole_pairs=2, material=AXIAL
    )
    B, gradient = magfem.exact(ring).jet(np.zeros(3), 1)
    factor = np.sin(3 * pi / 16) / (3 * pi / 16)
    expected = 2 * 1.3 * (1 / 10e-3 - 1 / 15e-3) * factor
    np.testing.assert_allclose(B, 0, atol=1e-9)
    np.testing.assert_allclose(gradient, expected * np.diag([1, -1, 0]), atol=1e-5 * expected)


def test_touching_blocks_are_one_block() -> None:
    halves = HalbachArray(size=(2e-3, 3e-3, 4e-3), count=2, step=0.0, material=SKEW)
    whole = BlockMagnet(size=(4e-3, 3e-3, 4e-3), material=SKEW)
    points = np.random.default_rng(6).uniform(-6e-3, 6e-3, (300, 3))
    for one, other in zip(magfem.exact(halves).jet(points, 1), magfem.exact(whole).jet(points, 1), strict=True):
        assert relative_errors(one, other, layered=False).max() <= 1e-9


def test_segments_without_turning_make_a_ring() -> None:
    third = {"outer_diameter": 4e-3, "inner_diameter": 1.5e-3, "length": 1e-3, "material": SKEW}
    segments = [
        CylinderSegmentMagnet(start_angle=k * 2 * pi / 3, end_angle=(k + 1) * 2 * pi / 3, **third) for k in range(3)
    ]
    ring = MagnetAssembly(magnets=tuple(map(PlacedMagnet, segments)))
    points = KINDS["ring"].region.layers(np.random.default_rng(7), 8, 20)
    assert relative_errors(magfem.exact(ring).B(points), magfem.exact(KINDS["ring"]).B(points)).max() <= 1e-9


def test_moment_is_that_of_the_geometry_and_heat_weakens_the_field() -> None:
    warm = replace(
        KINDS["block"], material=PermanentMagnet.of_grade("N45", temperature=333.15, recoil_permeability=1.0)
    )
    cold = replace(KINDS["block"], material=PermanentMagnet.of_grade("N45", recoil_permeability=1.0))
    np.testing.assert_allclose(magfem.exact(warm).moment, warm.moment)
    point = np.array([0.0, 0.0, 5e-3])
    np.testing.assert_allclose(magfem.exact(warm).B(point), magfem.exact(cold).B(point) * (1 - 0.0012 * 40), rtol=1e-12)


def test_recoil_above_one_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    magfem.exact(SphereMagnet(diameter=1e-3, material=PermanentMagnet(1.0, 1.05)))
    assert "holds at recoil permeability 1, not at its 1.05" in caplog.text


def test_what_is_no_device_is_refused() -> None:
    with pytest.raises(InputError, match="exact takes a device"):
        magfem.exact("ring")  # type: ignore[arg-type]
