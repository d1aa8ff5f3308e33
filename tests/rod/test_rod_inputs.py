"""What a rod cannot be made of, or solved for, is said in one sentence."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

import magfem
from magfem.errors import ConvergenceError, InputError, OutsideRegionError
from magfem.fields import DipoleField, UniformField
from magfem.rod import CrossSection, FlexibleSection, MagnetSection, Rod

GIVEN = dict(length=0.03, radius=1e-3, youngs_modulus=1e6)
SECTION = FlexibleSection(**GIVEN)
MAGNET = MagnetSection(length=5e-3, moment=0.01)
NAN = float("nan")


def flexible(**changes):
    return lambda: FlexibleSection(**(GIVEN | changes))


def magnet(**changes):
    return lambda: MagnetSection(**(dict(length=5e-3, moment=0.01) | changes))


def solved(**loads):
    return lambda: Rod([SECTION, MAGNET]).solve(**loads)


WRONG = {
    "length must be positive and finite, got 0": flexible(length=0),
    "length must be positive and finite, got '3 cm'": flexible(length="3 cm"),
    "youngs_modulus must be positive and finite, got nan": flexible(youngs_modulus=NAN),
    "density must be finite and not negative": flexible(density=-1.0),
    "density must be finite and not negative (kg/m³), got '1 g'": flexible(density="1 g"),
    "poisson_ratio must lie above -1 and up to 0.5, got 0.6": flexible(poisson_ratio=0.6),
    "poisson_ratio must lie above -1 and up to 0.5, got None": flexible(poisson_ratio=None),
    "shear_modulus must be positive": flexible(shear_modulus=0.0),
    "state either radius (m) or cross_section": flexible(cross_section=CrossSection.disc(1e-3)),
    "flexible section: state either radius": flexible(radius=None),
    "cross_section is a CrossSection, got str": flexible(radius=None, cross_section="disc"),
    "elements must be a whole number from 2 to 4096, got 1": flexible(elements=1),
    "elements must be a whole number from 2 to 4096, got 2.0": flexible(elements=2.0),
    "0 ≤ inner radius < outer radius, got 0.002": flexible(inner_radius=2e-3),
    "0 ≤ inner radius < outer radius, got 0.0 and 'wide'": flexible(radius="wide"),
    "intrinsic_curvature must be three finite numbers": flexible(intrinsic_curvature=5.0),
    "intrinsic_strain must point along +z": flexible(intrinsic_strain=(0, 0, -1)),
    "intrinsic_strain must be three finite numbers": flexible(intrinsic_strain=(0, 0, NAN)),
    "force_per_length must be three finite numbers": flexible(force_per_length=(1, 2)),
    "moment_per_length must be three finite numbers": flexible(moment_per_length="up"),
    "magnetic_moment_per_length must be three finite numbers": flexible(magnetic_moment_per_length=[[0, 0], [1]]),
    "area must be positive and finite, got -1.0": lambda: CrossSection(-1.0, 1.0, 1.0, 1.0),
    "torsion_constant must be positive and finite, got inf": lambda: CrossSection(1.0, 1.0, 1.0, np.inf),
    "area must be positive and finite, got 'big'": lambda: CrossSection("big", 1.0, 1.0, 1.0),
    "a rectangle needs two positive sides, got 0.001 and 0": lambda: CrossSection.rectangle(1e-3, 0),
    "magnet section: length must be finite and not negative (m), got -1": magnet(length=-1),
    "magnet section: length must be finite and not negative (m), got None": magnet(length=None),
    "mass must be finite and not negative (kg), got nan": magnet(mass=NAN),
    "field_points must be a whole number from 1 to 16, got 17": magnet(field_points=17),
    "field_points must be a whole number from 1 to 16, got 1.0": magnet(field_points=1.0),
    "magnet section: moment must be three finite numbers": magnet(moment=(1, 2)),
    "magnet section: moment must be three finite numbers, got (0.0, 0.0, inf)": magnet(moment=np.inf),
    "at least one FlexibleSection": lambda: Rod([MAGNET]),
    "a rod takes a list of sections: Rod([section]), got FlexibleSection": lambda: Rod(SECTION),
    "a rod takes a list of sections: Rod([section]), got int": lambda: Rod(5),
    "got str as section 1": lambda: Rod([SECTION, "magnet"]),
    "a rod's base is one pose": lambda: Rod([SECTION], base=[0, 0, 0]),
    "a rod's base is one pose, ": lambda: Rod([SECTION], base=RigidTransform.from_translation(np.zeros((2, 3)))),
    "the rod has 1 magnets, and magnet_fields has 2 entries": lambda: Rod([SECTION, MAGNET], None, [None, None]),
    "entry 0 of magnet_fields is a Field in T, or None, got str": lambda: Rod([SECTION, MAGNET], None, ["dipole"]),
    "of magnet_fields is a Field in T, or None, got one per ampere": lambda: Rod(
        [SECTION, MAGNET], None, [magfem.load_model("bigmag_air")]
    ),
    'outside must be "raise" or "extrapolate", got \'nan\'': solved(outside="nan"),
    "gravity must be three finite numbers, got 9.81": solved(gravity=9.81),
    "tip_force must be three finite numbers": solved(tip_force=(0, NAN, 0)),
    "tip_moment must be three finite numbers": solved(tip_moment=None),
    "tolerance must be positive and finite, got 0": solved(tolerance=0),
    "most_iterations must be a whole number from 1, got 0": solved(most_iterations=0),
    "guess is a RodState that solve returned, got int": solved(guess=3),
    "a rod's field is a Field in T, or (system, currents, joints), got float": solved(field=0.1),
    "got one per ampere: multiply": solved(field=magfem.load_model("bigmag_air")),
    "a rod's field is a Field, or (system, currents, joints) of a coil system": solved(field=(1.0, [2.0])),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_one_sentence_says_what_is_wrong(sentence):
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        WRONG[sentence]()
    assert "\n" not in str(caught.value)


def test_a_curvature_that_is_no_function_of_arc_length():
    for curvature in (lambda s: s, lambda s: np.full((s.size, 3), NAN)):
        with pytest.raises(InputError, match=r"must give \(32, 3\) finite numbers for as many arc lengths, got shape"):
            Rod([FlexibleSection(**GIVEN, intrinsic_curvature=curvature)]).solve()


def test_a_guess_of_another_rod():
    state = Rod([SECTION]).solve()
    with pytest.raises(InputError, match="the state of a rod with other sections"):
        Rod([SECTION, MAGNET]).solve(guess=state)


def test_numbers_of_numpy_are_numbers():
    for number in (np.float64(0.01), np.float32(0.01), np.int64(1), np.array(0.01)):
        assert MagnetSection(length=np.float32(1e-3), moment=number).moment_vector[2] == pytest.approx(float(number))


def test_a_shape_that_does_not_converge_is_an_error_or_says_so():
    rod, load = Rod([SECTION]), dict(tip_force=(0.05, 0, 0), most_iterations=2)
    with pytest.raises(ConvergenceError, match=r"residual .* rad after 2 iterations; strict=False returns it"):
        rod.solve(**load)
    state = rod.solve(**load, strict=False)
    assert (state.converged, state.stable, state.outcome) == (False, False, "iterations")


def test_a_magnet_outside_the_fields_region_is_an_error():
    field = 8.0 * magfem.load_model("bigmag_iron")
    rod = Rod([SECTION, MAGNET])  # its magnet is too near to the coil
    with pytest.raises(OutsideRegionError, match=r"out of the field's region .*outside=\"extrapolate\""):
        rod.solve(field=field)
    with pytest.raises(OutsideRegionError, match="out of the field's region"):
        rod.solve(field=field, tip_moment=(1e-6, 0, 0))
    with pytest.raises(OutsideRegionError, match="is pulled out of the field's region"):
        edge = RigidTransform.from_translation([0, 0, 0.018])  # within, by 4 mm; the iron core attracts the magnet
        Rod([FlexibleSection(length=0.03, radius=2e-4, youngs_modulus=1e6), MAGNET], edge).solve(field=field)


def test_an_infinite_field_is_no_shape():
    """A dipole right where the magnet is."""
    there = DipoleField([0, 0, 1.0]).at(RigidTransform.from_translation([0, 0, 0.0325]))
    for moment in ((0, 0, 0), (1e-6, 0, 0)):
        with pytest.raises(ConvergenceError, match="did not converge"):
            Rod([SECTION, MAGNET]).solve(field=there, tip_moment=moment, gravity=(0, 0, 0))


def test_importing_rods_is_light():
    """No compiler, no solver, no picture: sections and rods can be written down at once."""
    code = (
        "import sys, scipy.spatial.transform; before = set(sys.modules); import magfem.rod; "
        "print(*(set(sys.modules) - before))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    heavy = {"numba", "llvmlite", "skfem", "gmsh", "matplotlib", "pyvista", "pint", "scipy.optimize", "meshio"}
    assert "magfem.rod.rod" in loaded and not heavy & {name for name in loaded}


def test_a_field_without_magnets_is_no_load():
    assert Rod([SECTION]).solve(field=UniformField([1, 1, 1]), gravity=(0, 0, 0)).energy == 0.0
