"""Models as sources of magpylib, asked by magpylib; magpylib's sources as fields, next to closed forms and laws."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
import pytest
from exchange.exchanged_fields import FIELDS, KINDS, TermsField, points_of, worst
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.closed_form import exact
from magfem.errors import InputError, UnitMismatchError
from magfem.exchange import from_magpylib, magpylib_module, to_magpylib
from magfem.fields import Field
from magfem.geometry import BlockMagnet, CylinderMagnet, PermanentMagnet

SIZE = (2e-3, 3e-3, 1e-3)
TURN = Rotation.from_rotvec([0.3, -0.7, 1.1])


@pytest.fixture(scope="module")
def ring() -> Field:
    return magfem.load_model("ring_magnet_4x1.5x1")


@pytest.fixture(scope="module")
def block() -> Field:
    """The closed form of a rigid block, magnetised along (1, 0, 1)."""
    direction = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    return exact(BlockMagnet(size=SIZE, material=PermanentMagnet(1.2, 1.0, tuple(direction))))


def cuboid(**options: Any) -> Any:
    """magpylib's magnet of the same kind."""
    polarization = 1.2 * np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    return magpylib.magnet.Cuboid(dimension=SIZE, polarization=polarization, **options)


def shell(nearest: float, farthest: float, count: int = 200) -> np.ndarray:
    """Random points (count, 3) at distances from the origin, m."""
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(count, 3))
    return rng.uniform(nearest, farthest, (count, 1)) * directions / np.linalg.norm(directions, axis=1)[:, None]


@pytest.mark.parametrize("name", FIELDS)
def test_magpylib_gives_the_field(name: str) -> None:
    model, points = FIELDS[name], points_of(name, 100)
    source = to_magpylib(model, outside="extrapolate")
    B = model.B(points, outside="extrapolate")
    assert np.array_equal(source.getB(points), B)
    assert worst(source.getH(points) * magpylib.mu_0, B) < 1e-15
    assert source.getB(points[0]).shape == (3,)


def test_ring_as_a_source_is_magpylibs_ring_in_its_place(ring: Field) -> None:
    """Moved, turned, and together with a magnet of magpylib's own; within the demagnetisation of the real ring."""
    shape = {"dimension": (0.75e-3, 2e-3, 1e-3, 0, 360)}
    theirs = magpylib.magnet.CylinderSegment(polarization=(0, 0, 1.35), **shape)
    ours = to_magpylib(ring)
    both = [magpylib.Collection(one, cuboid(position=(0, 0, 20e-3))) for one in (ours, theirs)]
    for one in both:
        one.move((1e-3, -2e-3, 3e-3)).rotate(TURN)
    place = RigidTransform.from_components(ours.position, ours.orientation)
    points = place.apply(points_of("ring_magnet_4x1.5x1", 200))
    found, reference = (one.getB(points) for one in both)
    assert worst(found, reference) < 0.05  # recoil permeability 1.05
    beside = both[0].children[1].getB(points)
    assert worst(found - beside, ring.at(place).B(points)) < 1e-12


def test_a_source_on_a_path_is_the_model_at_each_pose(ring: Field) -> None:
    source = to_magpylib(ring)
    source.position = np.linspace((0, 0, 0), (1e-3, 0, 0), 3)
    point = np.array([0, 0, 4e-3])
    expected = [ring.B(point - position) for position in source.position]
    assert np.allclose(source.getB(point), expected, rtol=1e-13, atol=0)


def test_outside_the_region_is_nan_or_asked_for(ring: Field) -> None:
    point = (0, 0, 1.0)
    assert np.isnan(to_magpylib(ring).getB(point)).all()
    assert np.allclose(to_magpylib(ring, "extrapolate").getB(point), [0, 0, 2e-7 * ring.moment[2]], rtol=1e-3, atol=0)
    with pytest.raises(InputError, match="outside"):
        to_magpylib(ring, "raise")


def test_a_field_per_ampere_needs_a_current() -> None:
    coil = TermsField(KINDS["loops"], unit="T/A")
    with pytest.raises(UnitMismatchError, match="multiply it by its current"):
        to_magpylib(coil)
    point = points_of("loops")[0]
    assert np.array_equal(to_magpylib(coil * 0.5, "extrapolate").getB(point), 0.5 * coil.B(point, "extrapolate"))


def test_magnetisation_is_not_defined(ring: Field) -> None:
    with pytest.raises(Exception, match="undefined M-field"):
        to_magpylib(ring).getM((0, 0, 3e-3))


def load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_module_of_a_catalogue_model(ring: Field, tmp_path: Path) -> None:
    path = tmp_path / "ring.py"
    path.write_text(magpylib_module(ring, "ring_magnet_4x1.5x1", path))
    points = points_of("ring_magnet_4x1.5x1", 20)
    assert np.array_equal(load(path).source.getB(points), ring.B(points))


def test_module_and_model_file_travel_together(tmp_path: Path) -> None:
    ring = magfem.load_model("ring_magnet_4x1.5x1")
    for folder in ("here/models", "here/scripts"):
        (tmp_path / folder).mkdir(parents=True)
    ring.save(tmp_path / "here/models/ring.json")
    path = tmp_path / "here/scripts/ring.py"
    path.write_text(magpylib_module(ring, tmp_path / "here/models/ring.json", path))
    os.rename(tmp_path / "here", tmp_path / "there")
    points = points_of("ring_magnet_4x1.5x1", 20)
    assert np.array_equal(load(tmp_path / "there/scripts/ring.py").source.getB(points), ring.B(points))


def test_module_of_a_coil_states_its_current(tmp_path: Path) -> None:
    coil = TermsField(KINDS["loops"], unit="T/A")
    with pytest.raises(UnitMismatchError, match="at which current"):
        magpylib_module(coil, "coil", tmp_path / "coil.py")
    text = magpylib_module(coil, "coil", tmp_path / "coil.py", current=0.5)
    assert "CURRENT = 0.5  # A" in text and "* CURRENT" in text


def test_cuboid_is_the_closed_form_of_its_block(block: Field) -> None:
    """B, gradient and hessian of two programs, the second's with analytic derivatives."""
    field, points = from_magpylib(cuboid()), shell(2.5e-3, 10e-3)
    B, gradient, hessian = field.jet(points, 2)
    true = block.jet(points, 2)
    assert worst(B, true[0]) < 1e-10
    assert worst(gradient, true[1]) < 1e-8
    assert worst(hessian, true[2]) < 1e-6


def test_placed_sources_and_collections(block: Field) -> None:
    """A collection with a moved, turned block and a current, in closed form and by Biot and Savart."""
    place = RigidTransform.from_components([1e-3, 2e-3, -1e-3], TURN)
    wire = magpylib.current.Circle(diameter=4e-3, current=3.0, position=(0, 0, -4e-3))
    magnet = cuboid(position=place.translation, orientation=place.rotation)
    field = from_magpylib(magpylib.Collection(magnet, wire))
    loop = TermsField(magfem.fields.terms.loops([[0, 0, -4e-3]], 2e-3, 3.0))
    points = shell(9e-3, 15e-3)
    true = [a + b for a, b in zip(block.at(place).jet(points), loop.jet(points, 1, "extrapolate"), strict=True)]
    B, gradient = field.jet(points)
    assert worst(B, true[0]) < 1e-10
    assert worst(gradient, true[1]) < 1e-8


def test_derivatives_are_of_order_eight() -> None:
    """Error against step, at a distance of 1 mm from a dipole: a slope of eight, and the size that is stated."""
    moment = np.array([0.0, 0.0, 1e-3])
    dipole = magpylib.misc.Dipole(moment=moment)
    # ∂B_z/∂z on the axis, of B_z = 2e-7 m/z³, and its derivative
    point, slope, bend = np.array([0, 0, 1e-3]), -6e-7 * 1e-3 / 1e-12, 24e-7 * 1e-3 / 1e-15
    errors = []
    for step in (40e-6, 80e-6):
        _, gradient, hessian = from_magpylib(dipole, step).jet(point, 2)
        scale = magpylib.mu_0 / (4e-7 * np.pi)
        errors.append([abs(gradient[2, 2] / (slope * scale) - 1), abs(hessian[2, 2, 2] / (bend * scale) - 1)])
    orders = np.log2(np.array(errors[1]) / np.array(errors[0]))
    assert np.all((orders > 7.5) & (orders < 8.7)), orders
    assert errors[0][0] < 1e4 * 0.04**8 and errors[0][1] < 1e5 * 0.04**8


def test_derivatives_are_those_of_a_field_in_air() -> None:
    _, gradient, hessian = from_magpylib(cuboid()).jet(shell(3e-3, 5e-3, 20), 2)
    size = np.abs(gradient).max()
    assert np.array_equal(gradient, gradient.swapaxes(1, 2))
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-14 * size
    for order in ((0, 2, 1, 3), (0, 1, 3, 2), (0, 3, 2, 1)):
        assert np.abs(hessian - hessian.transpose(order)).max() < 1e-14 * np.abs(hessian).max()
    assert np.abs(np.einsum("niik->nk", hessian)).max() < 1e-14 * np.abs(hessian).max()


def test_more_points_than_are_taken_at_a_time() -> None:
    field = from_magpylib(magpylib.misc.Dipole(moment=(0, 0, 1e-3)))
    points = shell(5e-3, 9e-3, 20_001)
    assert np.array_equal(field.gradient(points)[-1], field.gradient(points[-1]))
    assert field.B(np.empty((0, 3))).shape == (0, 3)


def test_a_field_keeps_its_source_as_it_was() -> None:
    source = cuboid()
    field = from_magpylib(source)
    before = field.B([0, 0, 3e-3])
    source.move((1e-3, 0, 0))
    assert np.array_equal(field.B([0, 0, 3e-3]), before)


def test_there_and_back_again(ring: Field) -> None:
    """A model, made a source of magpylib's, made a field: with the derivatives of the model."""
    field = from_magpylib(to_magpylib(ring, "extrapolate"))
    points = points_of("ring_magnet_4x1.5x1", 50)
    B, gradient = ring.jet(points)
    found = field.jet(points)
    assert np.array_equal(found[0], B)
    assert worst(found[1], gradient) < 1e-6


def test_cylinder_is_the_closed_form_of_ours() -> None:
    rotor = CylinderMagnet(diameter=1e-3, length=3e-3, material=PermanentMagnet(1.42, 1.0, (0.0, 0.0, 1.0)))
    theirs = from_magpylib(magpylib.magnet.Cylinder(dimension=(1e-3, 3e-3), polarization=(0, 0, 1.42)))
    points = shell(4e-3, 20e-3)
    assert worst(theirs.B(points), exact(rotor).B(points)) < 1e-9


@pytest.mark.parametrize("wrong", [None, 3, "Cuboid", magpylib.Sensor(), magpylib.Collection()])
def test_what_is_no_source_is_refused(wrong: Any) -> None:
    with pytest.raises(InputError, match="no magpylib source"):
        from_magpylib(wrong)


def test_an_unfinished_source_is_refused() -> None:
    with pytest.raises(InputError, match="no magpylib source or collection whose B is defined"):
        from_magpylib(magpylib.magnet.Cuboid())


def test_a_path_is_refused() -> None:
    source = cuboid()
    source.position = np.zeros((4, 3))
    with pytest.raises(InputError, match="4 poses"):
        from_magpylib(source)


@pytest.mark.parametrize("step", [0, -1e-5, float("nan"), True, "1e-5"])
def test_steps_that_are_none(step: Any) -> None:
    with pytest.raises(InputError, match="step"):
        from_magpylib(cuboid(), step)


def test_without_magpylib_there_is_a_line_to_type(ring: Field, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "magpylib", None)
    for call in (lambda: to_magpylib(ring), lambda: from_magpylib(object())):
        with pytest.raises(InputError, match="pip install"):
            call()
