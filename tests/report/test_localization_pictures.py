"""Pictures of isoline functions and of the stator's influence: what is drawn, and that the same is drawn twice."""

from __future__ import annotations

import re

import numpy as np
import pytest

from magfem.localization.isoline_curves import curves
from magfem.localization.stator_influence import stator_influence
from magfem.report.isoline_pictures import draw as draw_isolines
from magfem.report.stator_pictures import draw as draw_stator


@pytest.mark.parametrize("parametrisation", ["eccentric", "polar"])
def test_isolines(parametrisation):
    found = curves("rotor_1x3", parametrisation)
    pictures = draw_isolines(found)
    assert [picture.name for picture in pictures] == ["isoline_positions", "isoline_angles", "isoline_sensitivity"]
    stated = float(re.search(r"up to ([\d.]+) %", pictures[0].caption)[1])
    assert stated == pytest.approx(100 * np.abs(found.distance / found.field_distance - 1).max(), abs=0.06)
    assert [picture.png for picture in draw_isolines(found)] == [picture.png for picture in pictures]
    for picture in pictures:
        assert picture.size[0] == 1480 and picture.alt and picture.caption


def test_stator():
    found = stator_influence(distances=np.array([5e-3, 10e-3, 40e-3]))
    pictures = draw_stator(found)
    assert [picture.name for picture in pictures] == ["stator_field", "stator_bias"]
    low, high = map(float, re.search(r"ratio, (\d+) to (\d+)", pictures[0].caption).groups())
    assert (low, high) == pytest.approx((found.fields.ratio.min(), found.fields.ratio.max()), abs=0.5)
    assert [picture.png for picture in draw_stator(found)] == [picture.png for picture in pictures]
