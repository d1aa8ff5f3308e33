"""What a fit of samples says of itself is true: strength beside gain, pose, bounds, regions, refusals."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest

import magfem
from magfem.errors import ConvergenceError, InputError
from magfem.fields.norms import relative_errors
from magfem.fields.region import Shell
from magfem.fitting import Recipe
from magfem.geometry import AXIAL, CylinderMagnet, PermanentMagnet
from magfem.samples import Samples
from magfem.typing import Floats, Points

DISC = CylinderMagnet(diameter=8e-3, length=2e-3, material=PermanentMagnet(1.22, 1.0, AXIAL))
NOISE = 20e-6  # T


def peer(height: float = 0.0, remanence: float = 1.22) -> magpylib.magnet.Cylinder:
    return magpylib.magnet.Cylinder(dimension=(8e-3, 2e-3), polarization=(0, 0, remanence), position=(0, 0, height))


def plane(height: float) -> Points:
    """A grid (121, 3) at one height, m."""
    x, y = np.meshgrid(np.linspace(-10e-3, 10e-3, 11), np.linspace(-10e-3, 10e-3, 11))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])


def noisy(B: Floats, seed: int) -> Floats:
    return B + NOISE * np.random.default_rng(seed).normal(size=B.shape)


def test_gain_beside_a_known_magnet_is_found() -> None:
    """The sensor reads 1.25 times too much: with the gain free the magnet is what its card says."""
    points = plane(6e-3)
    read = 1.25 * peer().getB(points)
    model = magfem.fit(
        Samples(points, noisy(read, 1), NOISE), Recipe(geometry=DISC, family="device", free={"gain": None})
    )
    gain = model.report["measurement"]["free"]["gain"]
    assert abs(gain["value"] - 1.25) < 4 * gain["deviation"] < 1e-2
    assert "remanence" not in model.report["measurement"]
    np.testing.assert_allclose(model.B(points), peer().getB(points), atol=2e-5)


@pytest.mark.parametrize("seed", range(3))
def test_pose_is_found_wherever_the_bounds_have_their_middle(seed) -> None:
    """Strength and height trade along one line of the scan: from the middle alone a search ends in the wrong valley."""
    line = np.column_stack([np.linspace(-15e-3, 15e-3, 61), np.zeros(61), np.full(61, 7e-3)])
    samples = Samples(line, noisy(peer(-1e-3).getB(line), seed), NOISE)
    model = magfem.fit(samples, Recipe(geometry=DISC, family="device", free={"centre_z": (-2e-3, 2e-3)}))
    found = model.report["measurement"]
    assert abs(found["free"]["centre_z"]["value"] + 1e-3) < 4 * found["free"]["centre_z"]["deviation"]
    assert abs(found["remanence"]["value"] - 1.22) < 4 * found["remanence"]["deviation"]


def test_bound_is_of_the_field_and_not_of_the_noise(ring_solution) -> None:
    """0.1 mT on 1500 points: the field is known to a tenth of a per cent, the readings far away only to many."""
    region = ring_solution.geometry.region
    points = region.layers(np.random.default_rng(1), 50, 30)
    B = ring_solution.B(points.reshape(-1, 3)) + 1e-4 * np.random.default_rng(2).normal(size=(1500, 3))
    model = magfem.fit(Samples(points.reshape(-1, 3), B, 1e-4), Recipe(geometry=ring_solution.geometry))
    assert isinstance(model.region, Shell)
    fresh = model.region.layers(np.random.default_rng(3), 40, 30)
    for key, found, truth in zip(("B", "gradient"), model.jet(fresh), ring_solution.jet(fresh), strict=True):
        true = relative_errors(found, truth).max()
        assert true <= model.report["bound"][key] <= 0.02, key
    assert model.report["heldout"]["B"]["max"] > 0.05  # relative to the weakest readings


def test_ten_per_cent_too_strong_exceeds_the_bound() -> None:
    points = np.concatenate([plane(height) for height in (4e-3, 6e-3, 9e-3)])
    samples = Samples(points, noisy(peer().getB(points), 4), NOISE)
    model = magfem.fit(samples, Recipe(geometry=DISC, family="device"))
    assert magfem.validate(model, Samples(points, noisy(peer().getB(points), 5), NOISE)).passed
    strong = Samples(points, noisy(peer(remanence=1.1 * 1.22).getB(points), 6), NOISE)
    assert not magfem.validate(model, strong).passed


def test_uniform_field_has_a_finite_bound_of_its_gradient() -> None:
    points = np.random.default_rng(0).uniform(-1e-2, 1e-2, (40, 3))
    model = magfem.fit(Samples(points, noisy(np.tile([1e-3, 2e-3, -1e-3], (40, 1)), 7), NOISE))
    assert model.report["parameters"] == 3
    assert 0 < model.report["bound"]["gradient"] < 10


def test_region_reaches_as_far_as_the_samples() -> None:
    points = np.concatenate([plane(height) for height in (4e-3, 6e-3)])
    model = magfem.fit(Samples(points, noisy(peer().getB(points), 8), NOISE), Recipe(geometry=DISC))
    assert isinstance(model.region, Shell)
    distance = DISC.hull.distance(points)
    assert model.region.clearance == pytest.approx(distance.min()) and model.region.extent == pytest.approx(
        distance.max()
    )


def test_samples_far_from_the_device_s_region_are_refused() -> None:
    points = plane(0.5)
    with pytest.raises(InputError, match="none of the samples lies in the region"):
        magfem.fit(Samples(points, peer().getB(points) * 1e3), Recipe(geometry=DISC, family="device"))


def test_a_magnet_inside_the_samples_is_no_workspace() -> None:
    """Interior harmonics cannot describe a source among the samples, and no model of them is handed out."""
    points = np.random.default_rng(0).uniform(-12e-3, 12e-3, (150, 3))
    points = points[DISC.hull.distance(points) > 1e-3]
    with pytest.raises(ConvergenceError, match="describes these samples"):
        magfem.fit(Samples(points, noisy(peer().getB(points), 9), NOISE), Recipe(options={"degrees": 4}))


def test_samples_per_ampere_are_no_magnet_s() -> None:
    points = plane(6e-3)
    with pytest.raises(InputError, match="per ampere do not belong to a magnet"):
        magfem.fit(Samples(points, peer().getB(points), unit="T/A"), Recipe(geometry=DISC))


def test_current_of_a_coil_s_samples_is_found() -> None:
    """Readings in T of a coil whose own field is per ampere: the factor is the current."""
    coil = magfem.load_geometry("loop_50")
    field = magfem.solve(coil)
    points = coil.region.layers(np.random.default_rng(1), 20, 10).reshape(-1, 3)
    loop = magpylib.current.Circle(diameter=50e-3, current=0.7)
    samples = Samples(points, loop.getB(points) + 1e-8 * np.random.default_rng(2).normal(size=points.shape), 1e-8)
    model = magfem.fit(samples, Recipe(geometry=coil, family="device"))
    current = model.report["measurement"]["current"]
    assert abs(current["value"] - 0.7) < 4 * current["deviation"] < 1e-2
    assert model.unit == "T" and field.unit == "T/A"
