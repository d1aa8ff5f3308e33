"""Pictures of coils and of assembled magnets: drawn, in their colours, nothing lost."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import magfem
from magfem.geometry import Coil
from magfem.report import show_picture
from magfem.report.coil_pictures import shells
from magfem.report.coil_scenes import coil_picture
from magfem.report.figures.style import COPPER, LEAD
from magfem.typing import Floats


def drawn(name: str) -> Floats:
    geometry = magfem.load_geometry(name)
    assert isinstance(geometry, Coil)
    return np.asarray(imread(io.BytesIO(coil_picture(geometry).png))[..., :3], dtype=float)


def share(pixels: Floats, colour: str) -> float:
    """Of pixels close to a colour."""
    return float((np.abs(pixels - to_rgb(colour)).max(axis=-1) < 0.06).mean())


@pytest.mark.parametrize("name", ["planar_coil_12mm", "meander_coil_10x5", "rectangular_spiral_20x12"])
def test_a_foil_of_some_micrometres_is_seen_from_above_with_its_leads(name: str) -> None:
    pixels = drawn(name)
    assert share(pixels, COPPER) > 0.1
    assert share(pixels, LEAD) > 1e-3


@pytest.mark.parametrize("name", ["solenoid_20x30x30", "saddle_coil_pair_40x60"])
def test_coils_in_space_are_copper_with_dark_arrows(name: str) -> None:
    pixels = drawn(name)
    red, _, blue = np.moveaxis(pixels, -1, 0)
    assert np.mean(red > blue + 0.3) > 0.05
    assert np.mean(pixels.max(axis=-1) < 0.25) > 1e-3


def test_magnets_of_an_assembly_show_both_poles(tmp_path: Path) -> None:
    show_picture(magfem.load_geometry("halbach_ring_8"), tmp_path / "ring.png")
    red, _, blue = np.moveaxis(imread(tmp_path / "ring.png")[..., :3], -1, 0)
    north, south = np.mean(red > blue + 0.25), np.mean(blue > red + 0.25)
    assert north > 0.02 and south > 0.02


def test_shells_close_around_the_windings_section() -> None:
    geometry = magfem.load_geometry("racetrack_coil_60x20")
    assert isinstance(geometry, Coil)
    (shell,) = shells(geometry)
    cut = shell.section(np.zeros(3), np.array([0.0, 1.0, 0.0]))  # two windows of 10 mm by 10 mm
    assert np.linalg.norm(cut[:, 1] - cut[:, 0], axis=-1).sum() == pytest.approx(2 * 4 * 10e-3, rel=1e-3)
