"""Recipe files for samples: every key sets what it says, and every fault is one sentence with file and key."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import magfem
from magfem.errors import InputError, MagfemError
from magfem.fitting import Recipe, load_recipe, model_from_recipe
from magfem.fitting.recipe import SamplesFile

RING = 'device = "ring_magnet_4x1.5x1"\n'
WHOLE = """\
device = "ring_magnet_4x1.5x1"
name = "ring, measured"
source = "a bench"
family = "axial_multipole"
seed = 3

[terms]
poles = 4

[region]
clearance = "1 mm"
extent = "5 mm"
z = ["1 mm"]
rho = ["0 mm", "4 mm"]

[samples]
file = "data/scan.csv"
sigma = "0.1 mT"
columns = { x = "-magnet_x_mm", y = "=0 mm" }

[fit]
objective = "absolute"
most_parameters = 12
weighting = "sigma"
ridge = "leave-one-out"
loss = "huber"
heldout = "regions"
background = true

[free]
centre = true
height = ["-1 mm", "2 mm"]
tilt_x = "5 deg"
turn = ["-10 deg", "0.1 rad"]
offsets = "0.2 mm"
gain = [0.9, 1.1]

[[measurement]]
position = ["2 mm", "0 mm", "3 mm"]
direction = [2, 0, 0]
value = "411 uT"
uncertainty = "0.5 uT"
source = "6.1.2"

[[measurement]]
position = ["0 mm", "-1 mm", "4 mm"]
direction = [0, -3, 4]
value = "55 uT"
uncertainty = "0.2 uT"
source = "6.1.2"
"""
MEASUREMENT = """
[[measurement]]
position = ["10 mm", "0 mm", "0 mm"]
direction = [1, 0, 0]
value = "411 uT"
source = "here"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "recipe.toml"
    path.write_text(text)
    return path


def test_every_key_sets_what_it_says(tmp_path: Path) -> None:
    recipe = load_recipe(written(tmp_path, WHOLE))
    assert recipe.geometry == magfem.load_geometry("ring_magnet_4x1.5x1")
    assert (recipe.name, recipe.source, recipe.family, recipe.seed) == (
        "ring, measured",
        "a bench",
        "axial_multipole",
        3,
    )
    assert recipe.options == {"poles": 4}
    region = recipe.region
    assert region is not None and recipe.geometry is not None
    assert (region.clearance, region.extent, region.z, region.rho) == (1e-3, 5e-3, (1e-3, math.inf), (0.0, 4e-3))
    assert region.hull == recipe.geometry.region.hull
    columns = {"x": "-magnet_x_mm", "y": "=0 mm"}
    assert recipe.samples == SamplesFile(tmp_path / "data/scan.csv", columns, pytest.approx(1e-4))
    fit = (recipe.objective, recipe.most_parameters, recipe.weighting, recipe.ridge, recipe.loss, recipe.heldout)
    assert fit == ("absolute", 12, "sigma", "leave-one-out", "huber", "regions") and recipe.background is True
    degree = np.pi / 180
    assert recipe.free["centre"] is None
    assert recipe.free["height"] == pytest.approx((-1e-3, 2e-3))
    assert recipe.free["tilt_x"] == pytest.approx((-5 * degree, 5 * degree))
    assert recipe.free["turn"] == pytest.approx((-10 * degree, 0.1))
    assert recipe.free["offsets"] == pytest.approx((-2e-4, 2e-4))
    assert recipe.free["gain"] == (0.9, 1.1)
    first, second = recipe.measurements
    assert first.position == pytest.approx([2e-3, 0, 3e-3]) and first.direction.tolist() == [1, 0, 0]
    assert (first.value, first.uncertainty) == pytest.approx((411e-6, 0.5e-6), rel=1e-12, abs=0)
    assert first.source == "6.1.2"
    assert second.direction == pytest.approx([0, -0.6, 0.8])
    assert second.uncertainty == pytest.approx(0.2e-6, rel=1e-12, abs=0)


def test_what_is_not_said_is_the_recipe_s_default(tmp_path: Path) -> None:
    recipe, default = load_recipe(written(tmp_path, RING)), Recipe()
    for key in ("family", "options", "region", "weighting", "ridge", "loss", "heldout", "background", "samples"):
        assert getattr(recipe, key) == getattr(default, key)
    assert recipe.free == {} and recipe.measurements == ()
    samples = load_recipe(written(tmp_path, '[samples]\nfile = "here.csv"\n'))
    assert samples.geometry is None and samples.samples == SamplesFile(tmp_path / "here.csv")


def test_a_recipe_of_samples_is_fitted(tmp_path: Path) -> None:
    """A quadrupole field in a file of its own units, beside the recipe."""
    points = np.random.default_rng(0).uniform(-10, 10, (60, 3))
    rows = [",".join(map(str, (*p, 2 * p[0], -p[1], -p[2]))) for p in points.tolist()]
    (tmp_path / "field.csv").write_text("\n".join(["a_mm,y_mm,z_mm,bx_mT,by_mT,bz_mT", *rows]))
    text = 'name = "quadrupole"\n[samples]\nfile = "field.csv"\nsigma = "1 uT"\ncolumns = { x = "a_mm" }\n'
    model = model_from_recipe(written(tmp_path, text))
    assert model.name == "quadrupole"
    assert model.gradient(model.region.centre) == pytest.approx(np.diag([2.0, -1.0, -1.0]), abs=1e-6)


FAULTS = [
    # The file as a whole
    ('name = "x"', "a recipe names a", "recipe.toml]"),
    (RING + "sample = 1", "sample", "recipe.toml"),
    (RING + "seed = -1", "seed must be a whole number", ": seed]"),
    (RING + "seed = 1.5", "seed must be a whole number", ": seed]"),
    (RING + 'seed = "1"', "seed", ": seed]"),
    (RING + "family = 3", "family", ": family]"),
    (RING + 'family = "splines"', "unknown family", ": family]"),
    (RING + 'circuit = "inner"', "has no circuit", ": circuit]"),
    (RING + 'device = "ring"', "", "recipe.toml"),
    (RING + 'family = "closed_paths"', "closed paths are for coils", ": family]"),
    ('device = "stator_1.6x5.5"\nfamily = "closed_paths"', "name one of inner, outer", ": circuit]"),
    ("samples = 3", "samples", ": samples]"),
    # Samples
    ("[samples]", "file", ": samples.file]"),
    ("[samples]\nfile = 3", "file", ": samples.file]"),
    ('[samples]\nfile = "x.csv"\npath = "y.csv"', "path", ": samples.path]"),
    ('[samples]\nfile = "x.csv"\nsigma = 0.1', "sigma", ": samples.sigma]"),
    ('[samples]\nfile = "x.csv"\nsigma = "1 mm"', "sigma", ": samples.sigma]"),
    ('[samples]\nfile = "x.csv"\nsigma = "0 mT"', "positive", ": samples.sigma]"),
    ('[samples]\nfile = "x.csv"\nsigma = "-1 mT"', "positive", ": samples.sigma]"),
    ('[samples]\nfile = "x.csv"\ncolumns = "x"', "columns", ": samples.columns]"),
    ('[samples]\nfile = "x.csv"\ncolumns = { x = 1 }', "x", ": samples.columns.x]"),
    # How to fit
    (RING + '[fit]\nloss = "absolute"', 'loss must be "squares" or "huber"', ": fit.loss]"),
    (RING + '[fit]\nridge = "big"', "ridge must be", ": fit.ridge]"),
    (RING + '[fit]\nweighting = "none"', "weighting must be", ": fit.weighting]"),
    (RING + '[fit]\nheldout = "all"', "heldout must be", ": fit.heldout]"),
    (RING + '[fit]\nobjective = "best"', "objective must be", ": fit.objective]"),
    (RING + "[fit]\nmost_parameters = 0", "most_parameters must be", ": fit.most_parameters]"),
    (RING + '[fit]\nbackground = "yes"', "background must be true or false", ": fit.background]"),
    (RING + "[fit]\nbackground = 1", "background must be true or false", ": fit.background]"),
    (RING + "[fit]\nnoise = 1", "noise", ": fit.noise]"),
    (RING + "fit = 3", "fit", ": fit]"),
    (RING + "[target]\nB = 2", "target_B must be", ": target.B]"),
    (RING + "[solve]\ndimension = 4", "dimension must be 2 or 3", ": solve.dimension]"),
    (RING + "[terms]\nknots = 3\n", "has no option 'knots'", ": terms.knots]"),
    # What is free
    (RING + "free = true", "free", ": free]"),
    (RING + "[free]\nroll = true", "unknown free parameter 'roll'", ": free.roll]"),
    (RING + "[free]\ncentre_q = true", "unknown free parameter 'centre_q'", ": free.centre_q]"),
    (RING + "[free]\ncentre = false", "centre must be true", ": free.centre]"),
    (RING + "[free]\ncentre = 3", "centre must be true", ": free.centre]"),
    (RING + '[free]\ncentre = "3 deg"', "centre", ": free.centre]"),
    (RING + '[free]\ncentre = ["1 mm"]', "centre must be two values", ": free.centre]"),
    (RING + '[free]\ncentre = ["1 mm", "2 mm", "3 mm"]', "centre must be two values", ": free.centre]"),
    (RING + '[free]\ncentre = ["2 mm", "1 mm"]', "lower bound must be smaller", ": free.centre]"),
    (RING + '[free]\ncentre = "-1 mm"', "positive", ": free.centre]"),
    (RING + '[free]\ntilt = "1 mm"', "tilt", ": free.tilt]"),
    (RING + "[free]\ntilt = [0, 1]", "tilt", ": free.tilt]"),
    (RING + '[free]\ngain = "2"', "gain must be true", ": free.gain]"),
    (RING + '[free]\ngain = ["1 mm", "2 mm"]', "gain", ": free.gain]"),
    (RING + "[free]\ngain = [2.0, 0.5]", "lower bound must be smaller", ": free.gain]"),
    # Where it must hold
    ('[samples]\nfile = "x.csv"\n[region]\nextent = "1 mm"', "counted from a device", ": region]"),
    (RING + '[region]\nclearance = "7 mm"', "lower limits must be smaller", ": region]"),
    (RING + '[region]\nclearance = "-1 mm"', "clearance", ": region"),
    (RING + '[region]\nz = ["2 mm", "1 mm"]', "lower limits must be smaller", ": region]"),
    (RING + '[region]\nrho = ["-1 mm", "1 mm"]', "not negative", ": region]"),
    (RING + '[region]\nz = "1 mm"', "z must be one or two lengths", ": region.z]"),
    (RING + "[region]\nz = [1, 2]", "z", ": region.z]"),
    (RING + '[region]\ny = "1 mm"', "y", ": region.y]"),
    # Single readings
    (RING + "measurement = 3", "list of tables", ": measurement]"),
    (RING + "measurement = [3]", "list of tables", ": measurement[0]]"),
    (RING + "[[measurement]]\nvalue = 3", "missing key", ": measurement[0]."),
    (RING + MEASUREMENT + 'unit = "T"', "unit", ": measurement[0].unit]"),
    (RING + MEASUREMENT + "uncertainty = 3", "uncertainty", ": measurement[0].uncertainty]"),
    (RING + MEASUREMENT + 'uncertainty = "0 T"', "positive", ": measurement[0].uncertainty]"),
    (RING + MEASUREMENT.replace('"411 uT"', "411"), "value", ": measurement[0].value]"),
    (RING + MEASUREMENT.replace('"411 uT"', '"411 mm"'), "value", ": measurement[0].value]"),
    (RING + MEASUREMENT.replace("[1, 0, 0]", "[0, 0, 0]"), "zero vector", ": measurement[0].direction]"),
    (RING + MEASUREMENT.replace("[1, 0, 0]", "[1, 0]"), "list of three", ": measurement[0].direction]"),
    (RING + MEASUREMENT.replace("[1, 0, 0]", "[1, true, 0]"), "bare numbers", ": measurement[0].direction]"),
    (RING + MEASUREMENT.replace('"10 mm"', "10"), "position", ": measurement[0].position]"),
    (RING + MEASUREMENT.replace('"here"', "3"), "source", ": measurement[0].source]"),
    (RING + 2 * MEASUREMENT + "uncertainty = 3", "uncertainty", ": measurement[1].uncertainty]"),
]


@pytest.mark.parametrize(("text", "words", "where"), FAULTS, ids=[text.replace("\n", " ")[-40:] for text, *_ in FAULTS])
def test_faults_are_one_sentence_with_file_and_key(text: str, words: str, where: str, tmp_path: Path) -> None:
    with pytest.raises(MagfemError) as refused:
        load_recipe(written(tmp_path, text))
    message = str(refused.value)
    assert words in message and where in message and "recipe.toml" in message and "\n" not in message, message


def test_samples_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(MagfemError, match=r"gone\.csv") as refused:
        model_from_recipe(written(tmp_path, '[samples]\nfile = "gone.csv"\n'))
    assert "\n" not in str(refused.value)


def test_samples_of_a_coil_system_make_no_model(tmp_path: Path) -> None:
    (tmp_path / "system.csv").write_text("px,py,pz,i0,bx,by,bz\n0,0,0,1,0,0,1e-3\n0,0,1,1,0,0,1e-3\n")
    with pytest.raises(InputError, match="coil system"):
        model_from_recipe(Recipe(samples=SamplesFile(tmp_path / "system.csv")))


def test_a_recipe_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="names a device, a file of samples, or both"):
        model_from_recipe(Recipe())
