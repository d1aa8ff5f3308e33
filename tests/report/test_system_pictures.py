"""Pictures of coil systems: PNGs whose words hold the numbers, and complaints."""

from __future__ import annotations

import numpy as np
import pytest

import magfem
from magfem.actuation import CoilSystem, workspace_map
from magfem.errors import InputError
from magfem.fields.terms import uniform
from magfem.report.system_pictures import WORDS, system_picture, workspace_picture

MOMENT = [0, 0, 0.066]


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


def test_systems_with_and_without_places_and_joints(bigmag):
    still = system_picture(bigmag)
    assert "6 coils around a workspace, 2 joints" in still.alt
    assert still.png.startswith(b"\x89PNG") and min(still.size) > 700
    assert system_picture(bigmag, [0.0, 0.0]).png == still.png != system_picture(bigmag, [0.5, 0.0]).png
    assert "8 coils around a workspace." in system_picture(magfem.load_system("octomag")).alt
    assert "0 coils" in system_picture(CoilSystem("background", (), uniform([0, 0, 1]))).alt


@pytest.mark.parametrize("what", WORDS)
def test_maps_hold_what_the_system_can_do(bigmag, what):
    """The words' numbers lie where a fine grid in the plane y = 0 puts them; tiles may miss a sharp minimum."""
    picture = workspace_picture(bigmag, what, [0.4, -0.6], MOMENT)
    low, high = (float(part) for part in picture.alt.rstrip(".").rsplit(", ", 1)[1].split(" to "))
    r, angle = np.meshgrid(np.linspace(0, 0.055, 40), np.linspace(0, 2 * np.pi, 97))
    points = np.stack([r * np.cos(angle), 0 * r, r * np.sin(angle)], axis=-1)
    values = getattr(workspace_map(bigmag, points, [0.4, -0.6], MOMENT), what) * (1 if what == "condition" else 1e3)
    assert np.nanmin(values) * 0.99 <= low <= np.nanquantile(values, 0.05)
    assert np.nanquantile(values, 0.98) <= high <= np.nanmax(values) * 1.01


def test_what_cannot_be_drawn_is_one_sentence(bigmag):
    for arguments, complaint in (
        (("power",), "what must be one of field_everywhere"),
        (("force_best",), "needs the moment"),
        (("condition", None, None, None, 2), "plane must be 0"),
    ):
        with pytest.raises(InputError, match=complaint):
            workspace_picture(bigmag, *arguments)
    with pytest.raises(InputError, match="states no workspace"):
        workspace_picture(CoilSystem("free", bigmag.coils, joints=bigmag.joints))
    with pytest.raises(InputError, match="depends on current limits"):
        workspace_picture(magfem.load_system("octomag"))
