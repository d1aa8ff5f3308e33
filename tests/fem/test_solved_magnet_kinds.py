"""Solved blocks, spheres, stacks and assemblies against closed forms, other routes and laws."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import magfem
from magfem.fem.solve_magnets import solve_once
from magfem.fields.norms import relative_errors
from magfem.geometry import (
    BlockMagnet,
    HalbachArray,
    HalbachRing,
    MagnetAssembly,
    MagneticSolids,
    MagnetStack,
    PermanentMagnet,
    PlacedMagnet,
    SphereMagnet,
)
from magfem.typing import Floats, Jet

N48 = PermanentMagnet(1.35, 1.05)
SKEW = PermanentMagnet(1.35, 1.05, (0, 1, 1))
RIGID = PermanentMagnet(1.35, 1.0, (0, 1, 1))


def layers_of(magnets: MagneticSolids) -> Floats:
    return magnets.region.layers(np.random.default_rng(2026), layers=16, per_layer=24)


def worst(found: Jet, truth: Jet, layers: Floats) -> list[float]:
    """Largest relative errors of B and gradient."""
    shapes = [layers.shape, (*layers.shape, 3)]
    return [
        float(relative_errors(f.reshape(shape), t.reshape(shape)).max())
        for f, t, shape in zip(found, truth, shapes, strict=True)
    ]


def test_sphere_demagnetises_itself_by_its_factor() -> None:
    """H = −M/3 inside: the moment is remanence·V/µ₀ · 3/(µ + 2), and the field outside that dipole's, 2D and 3D."""
    sphere = SphereMagnet(diameter=5e-3, material=PermanentMagnet(1.35, 1.2))
    expected = sphere.moment * 3 / (1.2 + 2)
    layers = layers_of(sphere)
    dipole = magfem.exact(SphereMagnet(diameter=5e-3, material=PermanentMagnet(1.35 * 3 / 3.2, 1.0)))
    for dimension, accuracy in ((2, 3e-6), (3, 1e-4)):
        solved = solve_once(sphere, dimension, 1.0)
        np.testing.assert_allclose(solved.quantities["moment"], expected, rtol=0, atol=accuracy * expected[2])
        B, gradient = worst(solved.currents.jet(layers.reshape(-1, 3), 1), dipole.jet(layers, 1), layers)
        assert accuracy >= B and gradient <= 5 * accuracy


def test_block_converges_to_a_refined_solve() -> None:
    block = BlockMagnet(size=(5e-3, 5e-3, 2e-3), material=SKEW)
    layers = layers_of(block)
    solved, refined = (solve_once(block, 3, r).currents.jet(layers.reshape(-1, 3), 1) for r in (1.0, 2.0))
    B, gradient = worst(solved, refined, layers)
    assert B <= 1e-4 and gradient <= 5e-4


def test_rigid_block_is_the_closed_form() -> None:
    block = BlockMagnet(size=(5e-3, 5e-3, 2e-3), material=RIGID)
    layers = layers_of(block)
    solved = solve_once(block, 3, 0.5)
    assert max(worst(solved.currents.jet(layers.reshape(-1, 3), 1), magfem.exact(block).jet(layers, 1), layers)) <= 1e-8
    moment = np.array(solved.quantities["boundary_moment"])
    assert np.linalg.norm(moment - block.moment) <= 1e-4 * np.linalg.norm(block.moment)


def test_stack_in_3d_is_the_stack_in_2d() -> None:
    stack = MagnetStack(outer_diameter=45e-3, length=30e-3, count=2, gap=10e-3, material=N48)
    layers = layers_of(stack)
    flat, solid = (solve_once(stack, d, 1.0).currents.jet(layers.reshape(-1, 3), 1) for d in (2, 3))
    B, gradient = worst(solid, flat, layers)
    assert B <= 1e-4 and gradient <= 5e-4


def test_halves_that_touch_are_one_block() -> None:
    """Two blocks that share a face, magnetised alike, against one block of both: the same field, inner face and all."""
    halves = HalbachArray(size=(2.5e-3, 5e-3, 2e-3), count=2, step=0.0, material=SKEW)
    whole = BlockMagnet(size=(5e-3, 5e-3, 2e-3), material=SKEW)
    layers = layers_of(whole)
    one, other = (solve_once(magnets, 3, 1.0).currents.jet(layers.reshape(-1, 3), 1) for magnets in (halves, whole))
    B, gradient = worst(one, other, layers)
    assert B <= 1e-4 and gradient <= 5e-4


def test_ring_of_which_little_is_left_outside() -> None:
    """Segments that touch, all but cancelling each other outside: half the resolution is already close."""
    ring = HalbachRing(outer_diameter=30e-3, inner_diameter=20e-3, length=10e-3, segments=8, material=N48)
    layers = layers_of(ring)
    coarse, fine = (solve_once(ring, 3, r).currents.jet(layers.reshape(-1, 3), 1) for r in (0.5, 1.0))
    B, gradient = worst(coarse, fine, layers)
    assert B <= 4e-4 and gradient <= 1e-4


def test_placed_magnets_solve_as_their_closed_forms() -> None:
    """Recoil 1: turned and moved magnets of a small assembly; bodies keep their names and volumes."""
    block = BlockMagnet(size=(5e-3, 4e-3, 2e-3), material=RIGID)
    assembly = MagnetAssembly(
        magnets=(
            PlacedMagnet(block, (0, 0, 3e-3), (0, 0, pi / 6), "turned"),
            PlacedMagnet(SphereMagnet(diameter=4e-3, material=RIGID), (1e-3, 0, -3e-3), (0.3, 0.4, 0)),
        )
    )
    layers = layers_of(assembly)
    solved = solve_once(assembly, 3, 1.0)
    assert solved.mesh.names == ("turned", "magnet_2")
    truth = magfem.exact(assembly).jet(layers, 1)
    B, gradient = worst(solved.currents.jet(layers.reshape(-1, 3), 1), truth, layers)
    assert B <= 1e-4 and gradient <= 5e-4


@pytest.mark.parametrize(
    "magnets",
    [
        SphereMagnet(diameter=5e-3, material=PermanentMagnet(1.35, 1.0, (0, 1, 1))),
        BlockMagnet(size=(5e-3, 5e-3, 2e-3), material=RIGID),
        MagnetStack(outer_diameter=8e-3, length=4e-3, count=2, gap=2e-3, material=PermanentMagnet(1.35, 1.0)),
        HalbachArray(size=(5e-3, 5e-3, 5e-3), count=2, material=RIGID),
    ],
    ids=["sphere", "block", "stack", "array"],
)
def test_default_recipe_fits_the_default_region(magnets: MagneticSolids) -> None:
    """The kind's default region is one that its default family can serve."""
    model = magfem.fit(magfem.exact(magnets))
    layers = layers_of(magnets)
    B, gradient = worst(model.jet(layers, 1), magfem.exact(magnets).jet(layers, 1), layers)
    assert B <= model.report["bound"]["B"] <= 1e-2
    assert gradient <= model.report["bound"]["gradient"] <= 5e-2
