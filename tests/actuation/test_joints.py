"""Joints: fields of moved coils are moved fields, their derivatives are differences, what is wrong is one sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, Joint, SystemCoil
from magfem.errors import CardError, InputError
from magfem.fields.region import Everywhere
from magfem.fields.terms import charge_discs, closed_path, harmonics, loops, uniform
from magfem.fields.workspace_region import Ball

RNG = np.random.default_rng(1)
POINTS = RNG.uniform(-0.02, 0.02, (7, 3))


def turned(values):
    """The motions of `chain`'s joints, one after the other, in SciPy's words."""
    a, b, c = values
    root = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, a]))
    about = np.array([0.0, 0.1, 0.0])
    turn = Rotation.from_rotvec(b * np.array([0.6, 0, 0.8]))
    elbow = root * RigidTransform.from_components(about - turn.apply(about), turn)
    slide = elbow * RigidTransform.from_translation(c * np.array([0, 1, 0]))
    return root, elbow, slide


@pytest.fixture(scope="module")
def chain():
    """Coils of all kinds of sources on a turntable, on an elbow on it, on a slide on that one, and on nothing."""
    joints = (
        Joint("slide", "prismatic", (0, 2, 0), (-0.03, 0.03), parent="elbow"),  # before what carries it
        Joint("turntable", "revolute", (0, 0, 1), (-2, 2)),
        Joint("elbow", "revolute", (3, 0, 4), (-1, 1), (0, 0.1, 0), "turntable"),
    )
    far = np.array([[0.1, 0.02, 0.0]])
    discs = charge_discs(np.add(far, [[0, 0, 0], [0, 0, 0.01]]), [0.01, 0.01], [1.0, -1.0])
    mixed = harmonics(0.02, [1, 2, 3], [0, 1, 3], [False, True, False], RNG.normal(size=3), far)
    path = closed_path(RNG.normal(scale=0.01, size=(5, 3)), 20.0, far)
    poses = RigidTransform.from_components(RNG.normal(scale=0.01, size=(5, 3)), Rotation.random(5, rng=RNG))
    coils = (
        SystemCoil("a", loops(far, 0.03, 50.0) + path, pose=poses[0], joint="turntable"),
        SystemCoil("b", mixed + loops(far, 0.02, 1.0), joint="elbow"),
        SystemCoil("c", discs, pose=poses[2], joint="slide"),
        SystemCoil("d", loops(far, 0.01, 10.0), pose=poses[3]),
    )
    return CoilSystem("chain", coils, uniform([1e-3, 0, 2e-3]), joints=joints)


VALUES = np.array([0.02, 0.7, -0.5])
AMPERES = np.array([1.0, -2.0, 3.0, 0.5])


def test_moved_coils_have_the_moved_fields(chain):
    """Against `Terms.placed` with SciPy's motions."""
    root, elbow, slide = turned(VALUES[[1, 2, 0]])
    for points in (POINTS, RNG.uniform(-0.02, 0.02, (9000, 3))):  # in one call, and in chunks for threads
        jets = chain.unit_jets(points, VALUES, 2)
        for k, pose in enumerate((root, elbow, slide, RigidTransform.identity())):
            expected = chain.coils[k].terms.placed(pose).jet(points, 2)
            for ours, theirs in zip(jets, expected, strict=True):
                np.testing.assert_allclose(ours[k], theirs, atol=1e-12 * np.abs(theirs).max())


def test_all_ways_to_the_field_agree(chain):
    jets = chain.unit_jets(POINTS, VALUES, 2)
    expected = [
        np.tensordot(AMPERES, unit, 1) + back for unit, back in zip(jets, chain.background_jets(POINTS, 2), strict=True)
    ]
    methods = (chain.B, chain.gradient, chain.hessian)
    ways = [
        chain.jet(POINTS, AMPERES, VALUES, 2),
        chain.at(AMPERES, VALUES).jet(POINTS, 2),
        chain.fixed(VALUES).jet(POINTS, AMPERES, order=2),
        [method(POINTS, AMPERES, VALUES) for method in methods],
        [np.array([method(one, AMPERES, VALUES) for one in POINTS]) for method in methods],
    ]
    for way in ways:
        for ours, theirs in zip(way, expected, strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12 * np.abs(theirs).max())
    rows = chain.unit_fields(POINTS, VALUES)
    np.testing.assert_allclose(rows[:, :3], jets[0].transpose(1, 2, 0), rtol=1e-11)
    np.testing.assert_allclose(rows[:, 7], jets[1][:, :, 1, 2].T, rtol=1e-11)


def test_none_is_zero_where_the_poses_are_stated(chain):
    for ours, zero in zip(chain.unit_jets(POINTS, None, 2), chain.unit_jets(POINTS, np.zeros(3), 2), strict=True):
        np.testing.assert_array_equal(ours, zero)
    expected = np.stack([coil.terms.jet(POINTS, 0)[0] for coil in chain.coils])
    np.testing.assert_allclose(chain.unit_jets(POINTS, None, 0)[0], expected, rtol=1e-12)


def test_joint_derivatives_are_the_differences(chain):
    found = chain.joint_jets(POINTS, AMPERES, VALUES, chain.unit_jets(POINTS, VALUES, 2))
    step = 1e-6
    for k in range(3):
        ends = [chain.jet(POINTS, AMPERES, VALUES + sign * step * np.eye(3)[k]) for sign in (1, -1)]
        for ours, above, below in zip(found, *ends, strict=True):
            expected = (above - below) / (2 * step)
            np.testing.assert_allclose(ours[k], expected, atol=1e-8 * np.abs(expected).max())


def test_a_turn_of_everything_turns_the_field():
    """B(R p) = R B(p) when one joint carries all coils; nothing else has to be known of them."""
    bigmag = magfem.load_system("bigmag")
    angle, currents = 0.83, [1, 2, -3, 4, -5, 6]
    turn = Rotation.from_rotvec([0, 0, angle])
    one = bigmag.B(turn.apply(POINTS), currents, [angle, angle])
    np.testing.assert_allclose(one, turn.apply(bigmag.B(POINTS, currents)), rtol=1e-12)


def test_a_whole_turn_comes_back():
    bigmag, currents = magfem.load_system("bigmag"), [1, 2, -3, 4, -5, 6]
    half = bigmag.B(POINTS, currents, [np.pi, -np.pi])
    np.testing.assert_allclose(half, bigmag.B(POINTS, currents, [-np.pi, np.pi]), rtol=1e-12)


def test_region_goes_with_the_coils(chain):
    """A coil holds in a ball about itself: the system holds where the joints carry that ball."""
    near = replace(chain.coils[2], own_region=Ball((0.0, 0.0, 0.0), 0.01), pose=RigidTransform.identity())
    system = replace(chain, coils=(*chain.coils[:2], near, chain.coils[3]))
    slide = turned(VALUES[[1, 2, 0]])[2]
    inside = slide.apply(np.array([0.0, 0.0, 0.0099]))
    outside = inside + np.array([0.02, 0, 0])
    assert system.region_at(VALUES).contains(inside) and not system.region_at(VALUES).contains(outside)
    system.B(inside, AMPERES, VALUES)
    with pytest.raises(InputError, match="outside the field's region"):
        system.B(outside, AMPERES, VALUES)
    assert isinstance(chain.region_at(VALUES), Everywhere)


def test_workspace_of_turning_coils_stays(chain):
    bigmag = magfem.load_system("bigmag")
    assert bigmag.region_at([1.0, -2.0]) is bigmag.workspace and bigmag.region_at() is bigmag.workspace
    aside = replace(bigmag, workspace=Ball((0.01, 0.0, 0.0), 0.045))  # turned coils are elsewhere about its centre
    assert aside.region_at([1.0, -2.0]).contains([0.01, 0, 0])


def test_system_file_keeps_joints(chain, tmp_path):
    chain.save(tmp_path / "chain.json")
    again = magfem.load_system(tmp_path / "chain.json")
    assert again.joints == chain.joints and [one.joint for one in again.coils] == ["turntable", "elbow", "slide", None]
    expected = chain.B(POINTS, AMPERES, VALUES)
    np.testing.assert_allclose(again.B(POINTS, AMPERES, VALUES), expected, atol=1e-13 * np.abs(expected).max())


def test_mpem_file_holds_at_the_stated_joints(tmp_path):
    from magfem.actuation import write_mpem

    bigmag, currents, joints = magfem.load_system("bigmag"), np.arange(6.0), [0.3, -0.7]
    write_mpem(bigmag, tmp_path / "turned.yaml", joints=joints)
    assert "gamma_bottom = 17.1887 deg, gamma_top = -40.107 deg" in (tmp_path / "turned.yaml").read_text()
    again = magfem.load_system(tmp_path / "turned.yaml")
    np.testing.assert_allclose(again.B(POINTS, currents), bigmag.B(POINTS, currents, joints), rtol=1e-11)
    with pytest.raises(InputError, match="joints are those of a coil system"):
        write_mpem(magfem.load_model("bigmag_air"), tmp_path / "x.yaml", joints=[0.0])


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ([1.0], r"has the joints slide, turntable, elbow: their values have shape \(3,\), got \(1,\)"),
        ([[0, 0, 0]], r"got \(1, 3\)"),
        ([0, np.nan, 0], "joints must be finite"),
        ([0, 3, 0], 'joint "turntable" of chain moves from -114.592 deg to 114.592 deg, got 171.887 deg'),
        ([0.04, 0, 0], 'joint "slide" of chain moves from -30 mm to 30 mm, got 40 mm'),
        (["a", "b", "c"], "joints must be real numbers"),
        ([[1], [1, 2]], "joints must be real numbers"),
    ],
)
def test_wrong_values_are_one_sentence(chain, values, complaint):
    for call in (chain.checked_joints, chain.region_at, chain.fixed, lambda q: chain.B(POINTS, AMPERES, q)):
        with pytest.raises(InputError, match=complaint) as caught:
            call(values)
        assert "\n" not in str(caught.value)


def test_values_computed_to_lie_on_a_limit_are_allowed(chain):
    chain.B(POINTS, AMPERES, [0.03 * (1 + 1e-14), -2.0, 1.0])


def test_a_prior_that_moves_is_fixed_first():
    from magfem.actuation import calibrate
    from magfem.samples import SystemSamples

    bigmag, joints, rng = magfem.load_system("bigmag"), [0.4, -0.2], np.random.default_rng(3)
    points = bigmag.workspace.random_points(rng, 40).repeat(8, axis=0)
    driven = rng.uniform(-7, 7, (320, 6))
    samples = SystemSamples(points, driven, bigmag.B(points, driven * 1.05, joints, outside="extrapolate"), sigma=1e-6)
    with pytest.raises(InputError, match=r"the coils of BigMag.* move: give prior=system.fixed\(joints\)"):
        calibrate(samples, prior=bigmag)
    found = calibrate(samples, prior=bigmag.fixed(joints), correct=False)
    np.testing.assert_allclose([one["gain"] for one in found.report["gains"]], 1.05, rtol=1e-3)


def test_systems_that_stand_still_refuse_joints():
    with pytest.raises(InputError, match="this system has no joints"):
        magfem.load_system("octomag").B([0, 0, 0], np.ones(8), [0.1])
    magfem.load_system("octomag").B([0, 0, 0], np.ones(8), [])


CARD = """
kind = "coil_system"
name = "bench"

[[joints]]
name = "table"
kind = "revolute"
axis = [0, 0, 2]
point = ["10 mm", "0 mm", "0 mm"]
limits = ["-90 deg", "45 deg"]

[[joints]]
name = "rail"
kind = "prismatic"
axis = [1, 0, 0]
limits = ["0 mm", "20 mm"]
parent = "table"

[[coils]]
name = "a"
model = "bigmag_air"
joint = "rail"
"""


def load(tmp_path, text):
    (tmp_path / "bench.toml").write_text(text)
    return magfem.load_system(tmp_path / "bench.toml")


def test_card_with_joints(tmp_path):
    system = load(tmp_path, CARD)
    table = Joint("table", "revolute", (0, 0, 1), (-np.pi / 2, np.pi / 4), (0.01, 0, 0))
    assert system.joints == (table, Joint("rail", "prismatic", (1, 0, 0), (0, 0.02), parent="table"))
    pose = system.fixed([-np.pi / 2, 0.02]).coils[0].pose
    np.testing.assert_allclose(pose.translation, [0.01, 0.01 - 0.02, 0], atol=1e-17)
    assert "1 coil, 2 joints" in repr(system)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('kind = "revolute"', 'kind = "ball"', r"must be revolute or prismatic, got .ball. \[.*joints\[0\]\.kind\]"),
        ("[0, 0, 2]", "[0, 0, 0]", r"axis must be three finite numbers .*joints\[0\]\.axis\]"),
        ("[0, 0, 2]", "[0, 0]", "axis must be three numbers"),
        ('["-90 deg", "45 deg"]', '["10 deg", "45 deg"]', r"zero.*between them \[.*joints\[0\]\.limits\]"),
        ('["-90 deg", "45 deg"]', '["0 deg", "0 deg"]', "limits must be two finite values"),
        ('["-90 deg", "45 deg"]', '["-1 mm", "1 mm"]', r"limits: expected an angle with its unit.*\.limits\]"),
        ('["-90 deg", "45 deg"]', "3", "limits must be two values such as"),
        ('kind = "prismatic"', 'kind = "prismatic"\npoint = ["0 mm", "0 mm", "0 mm"]', "leave the point out"),
        ('parent = "table"', 'parent = "chair"', r'no joint is named "chair"; known: "table", "rail" \[.*: joints\]'),
        ('parent = "table"', 'parent = "rail"', "its parents form a circle"),
        ('name = "rail"', 'name = "table"', '"table" is given twice'),
        ('joint = "rail"', 'joint = "road"', r'coil "a": no joint is named "road".*\[.*: coils\]'),
        ('axis = [1, 0, 0]\nlimits = ["0 mm", "20 mm"]', "axis = [1, 0, 0]", r'missing key "limits" \[.*joints\[1\]'),
    ],
)
def test_broken_joints_say_where(tmp_path, old, new, complaint):
    assert old in CARD
    with pytest.raises(CardError, match=complaint) as caught:
        load(tmp_path, CARD.replace(old, new, 1))
    assert "\n" not in str(caught.value)
