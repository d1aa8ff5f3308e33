"""Centrelines against curves in closed form, and their stated scatter against the scatter of many fits."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from rod.curves import LENGTH, circle, elastica, helix, jointed
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from magfem.errors import ConvergenceError, InputError
from magfem.rod import fit_centreline
from magfem.rod.centreline_basis import CentrelineBasis

S = np.linspace(0, LENGTH, 101)
STRAIGHT = ((0.02, 0.025), (0.045, 0.05))
LENGTHS = (0.02, 0.005, 0.02, 0.005)


def degrees_between(a, b):
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1)))


def test_basis_holds_every_polynomial():
    """Without rigid stretches the space is that of eq. 3.6: a polynomial of the degree comes back to rounding."""
    u = S / LENGTH
    place = np.stack([u**4 - u, 2 * u**3, u - 0.3 * u**2], -1) * LENGTH
    found = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=S, degree=4, robust=False)
    assert np.allclose(found.position(S), place, atol=1e-15, rtol=0)
    first = np.stack([4 * u**3 - 1, 6 * u**2, 1 - 0.6 * u], -1)
    second = np.stack([12 * u**2, 12 * u, -0.6 + 0 * u], -1) / LENGTH
    third = np.stack([24 * u, 12 + 0 * u, 0 * u], -1) / LENGTH**2
    for ours, exact in zip(found.derivatives(S, 3)[1:], (first, second, third), strict=True):
        assert np.allclose(ours, exact, atol=1e-11 * np.abs(exact).max(), rtol=0)


def test_basis_is_orthonormal_and_powers_are_not():
    basis = CentrelineBasis(0.045, degree=8)
    s = np.linspace(0, 0.045, 200)
    assert np.linalg.cond(basis.functions(s)) < 2
    assert np.linalg.cond(s[:, None] ** np.arange(1, 9)) > 1e13  # eq. 3.6, in metres
    x, w = np.polynomial.legendre.leggauss(40)
    values = basis.functions((x + 1) / 2 * 0.045)
    assert np.allclose(values.T @ (w[:, None] / 2 * values), np.eye(8), atol=1e-12)


def test_rigid_stretches_are_straight_and_joints_are_smooth():
    basis = CentrelineBasis(LENGTH, STRAIGHT, 5, False)
    for start, end in STRAIGHT:
        assert np.all(basis.functions(np.linspace(start, end - 1e-9, 9), 2) == 0)
    for joint in (0.02, 0.025, 0.045):
        sides = np.array([joint - 1e-12, joint])
        for derivative in (0, 1):
            values = basis.functions(sides, derivative)
            assert np.allclose(values[0], values[1], atol=1e-9 * np.abs(values).max())


@pytest.mark.parametrize("bend", [0.5, 1.5, 3.0])
@pytest.mark.parametrize("known", [True, False])
def test_circle(bend, known):
    """Error of the truncated polynomial falls by orders with the degree; curvature is the circle's."""
    place, tangent = circle(S, bend)
    errors = []
    for degree in (5, 7, 9, 11):
        found = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=S if known else None, degree=degree, robust=False)
        errors.append(degrees_between(found.tangent(S), tangent).max())
    assert errors[-1] < 1e-5
    assert all(late < early / 20 or late < 1e-6 for early, late in pairwise(errors))
    assert np.allclose(found.curvature(S), bend / LENGTH, rtol=2e-5)


def test_helix_curvature_torsion_and_frames():
    radius, pitch = 0.01, 0.006
    place, tangent = helix(S, radius, pitch)
    found = fit_centreline(place, LENGTH, place[0], arc_lengths=S, degree=16, robust=False)
    kappa, tau = radius / (radius**2 + pitch**2), pitch / (radius**2 + pitch**2)
    inner = S[5:-5]
    assert np.allclose(found.tangent(S), tangent, atol=1e-9)
    assert np.allclose(found.curvature(inner), kappa, rtol=1e-6)
    assert np.allclose(found.torsion(inner), tau, rtol=1e-4)
    # Frenet's frame of a helix, by hand: the normal points to the axis.
    angle = inner / np.hypot(radius, pitch)
    frames = found.frenet_frames(inner)
    assert np.allclose(frames[:, :, 0], -np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1), atol=1e-7)
    # Eq. 3.11 in that frame: u = (0, κ, τ), from the frame's own change along the curve.
    h = 1e-6
    rate = (found.frenet_frames(inner + h) - found.frenet_frames(inner - h)) / (2 * h)
    skew = np.einsum("nij,nik->njk", frames, rate)
    u = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1)
    assert np.allclose(u, [0, kappa, tau], atol=2e-4 * kappa)


def test_rotation_minimising_frames_turn_against_torsion():
    """Between Frenet's frame and one that does not turn lies the angle ∫τ ds (Bishop 1975), τ s on a helix."""
    radius, pitch = 0.01, 0.006
    place, _ = helix(S, radius, pitch)
    found = fit_centreline(place, LENGTH, place[0], arc_lengths=S, degree=16, robust=False)
    tau = pitch / (radius**2 + pitch**2)
    s = S[::10]
    frames = found.frames(s, Rotation.from_matrix(found.frenet_frames(0.0)))
    frenet = found.frenet_frames(s)
    angle = np.unwrap(
        np.arctan2(np.sum(frenet[:, :, 0] * frames[:, :, 1], -1), np.sum(frenet[:, :, 0] * frames[:, :, 0], -1))
    )
    assert np.allclose(angle, tau * s, atol=2e-4)
    assert np.allclose(np.linalg.det(frames), 1)
    u = found.curvature_vector(s)
    assert np.allclose(np.linalg.norm(u, axis=-1), found.curvature(s), rtol=1e-9) and np.all(u[:, 2] == 0)
    assert np.allclose(found.frames(s)[:, :, 2], found.tangent(s), atol=1e-12)


def test_curvature_vector_rebuilds_the_rod():
    """Integrating R' = R [u]× and p' = R e₃ from the base gives the curve again: u is what a rod would take."""
    place, _ = jointed(S, (0.8, 0.0, -0.9, 0.0), LENGTHS)
    found = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=S, straight=STRAIGHT, degree=6, robust=False)
    steps = 4000
    middle = (np.arange(steps) + 0.5) * LENGTH / steps
    u = found.curvature_vector(middle)
    frame, p = Rotation.from_matrix(found.frames(0.0)), np.zeros(3)
    for turn in Rotation.from_rotvec(u * LENGTH / steps):
        p = p + (frame * turn**0.5).apply([0, 0, LENGTH / steps])
        frame = frame * turn
    assert np.allclose(p, place[-1], atol=1e-7)


def test_frames_on_a_straight_rod():
    found = fit_centreline(S[:, None] * [0, 0.6, 0.8], LENGTH, (0, 0, 0), degree=3)
    assert np.allclose(found.frames(S)[:, :, 2], [0, 0.6, 0.8], atol=1e-12)
    assert np.allclose(found.frames(S), found.frames(0.0), atol=1e-9)
    assert np.allclose(found.curvature(S), 0, atol=1e-9)
    with pytest.raises(InputError, match="undefined where the rod is straight"):
        found.frenet_frames(0.01)
    with pytest.raises(InputError, match="undefined where the rod is straight"):
        found.torsion(0.01)


@pytest.mark.parametrize("modulus", [0.3, 0.6, 0.8])
def test_elastica(modulus):
    """The closed form of a bent rod: directions and curvatures, with and without known places."""
    place, tangent, curvature = elastica(S, modulus)
    for known in (S, None):
        found = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=known, degree=14, robust=False)
        assert degrees_between(found.tangent(S), tangent).max() < 2e-3
        assert np.allclose(found.position(S), place, atol=1e-8)
        assert np.allclose(found.curvature(S[5:-5]), np.abs(curvature[5:-5]), atol=2e-3 * curvature[0])


def test_a_plain_polynomial_smears_rigid_magnets():
    """Arc, magnet, arc, magnet: straight stretches give exact directions, a polynomial of twice the degree does not."""
    place, tangent = jointed(S, (0.9, 0.0, -0.7, 0.0), LENGTHS)
    at = np.array([0.0225, 0.0475])
    exact = jointed(at, (0.9, 0.0, -0.7, 0.0), LENGTHS)[1]
    plain = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=S, degree=8, robust=False)
    pieces = fit_centreline(place, LENGTH, (0, 0, 0), arc_lengths=S, straight=STRAIGHT, degree=8, robust=False)
    assert degrees_between(pieces.tangent(at), exact).max() < 1e-3
    assert degrees_between(plain.tangent(at), exact).max() > 0.5
    assert degrees_between(pieces.tangent(S), tangent).max() < 2e-3


def powers_covariance(s, at, degree, sigma):
    """Cramér–Rao bound of p(at) with p a polynomial without constant: the textbook formula, in powers of s/L."""
    powers = np.arange(1, degree + 1)
    design, there = (s[:, None] / LENGTH) ** powers, (at / LENGTH) ** powers
    slope = powers * (at / LENGTH) ** (powers - 1) / LENGTH
    inverse = np.linalg.inv(design.T @ design)
    return sigma**2 * there @ inverse @ there, sigma**2 * slope @ inverse @ slope


def test_known_places_reach_the_cramer_rao_bound():
    """300 fits scatter as the bound says (χ² at one in a thousand), and state that bound themselves."""
    rng = np.random.default_rng(11)
    sigma, at, u = 1e-4, 0.05, S / LENGTH
    truth = np.stack([0.2 * u**2, 0 * u, u], -1) * LENGTH
    bound, slope_bound = powers_covariance(S, at, 4, sigma)
    ends, slopes, stated = [], [], []
    for _ in range(300):
        found = fit_centreline(
            truth + sigma * rng.standard_normal(truth.shape), LENGTH, (0, 0, 0), arc_lengths=S, degree=4, robust=False
        )
        ends.append(found.position(at) - truth[-1])
        slopes.append(found.derivatives(at, 1)[1] - [0.4, 0, 1])
        stated.append(found.position_covariance(at))
    low, high = chi2.ppf([0.0005, 0.9995], 900)
    assert low < np.sum(np.square(ends)) / bound < high
    assert low < np.sum(np.square(slopes)) / slope_bound < high
    assert np.allclose(np.mean(stated, axis=0), bound * np.eye(3), atol=0.02 * bound)


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_clouds_scatter_as_stated(share):
    """Unordered clouds without places, with up to a fifth outliers: Mahalanobis distances of position follow χ²(3), of
    direction χ²(2); 150 fits, within one in a thousand, and 10 % for the linearised, estimated covariance."""
    rng = np.random.default_rng(3)
    bend, sigma, at = 1.4, 1e-4, np.array([0.02, 0.05])
    exact, exact_tangent = circle(at, bend)
    distances = []
    for _ in range(150):
        cloud = circle(rng.uniform(0, LENGTH, 250), bend)[0]
        cloud += sigma * rng.standard_normal(cloud.shape)
        wrong = rng.random(250) < share
        cloud[wrong] = rng.uniform(cloud.min(0) - 5e-3, cloud.max(0) + 5e-3, (wrong.sum(), 3))
        found = fit_centreline(cloud, LENGTH, (0, 0, 0))
        away, turn = found.position(at) - exact, found.tangent(at) - exact_tangent
        spread, turn_spread = found.position_covariance(at), found.tangent_covariance(at)
        inverse = np.linalg.pinv(turn_spread, rcond=1e-6, hermitian=True)
        distances.append(
            [
                np.einsum("ni,ni->n", away, np.linalg.solve(spread, away[..., None])[..., 0]),
                np.einsum("ni,nij,nj->n", turn, inverse, turn),
            ]
        )
    total = np.sum(distances, axis=0)
    for sums, freedom in zip(total, (3, 2), strict=True):
        low, high = chi2.ppf([0.0005, 0.9995], 150 * freedom)
        assert np.all((0.9 * low < sums) & (sums < 1.1 * high)), sums / (150 * freedom)


def test_noise_is_estimated_and_outliers_are_told():
    rng = np.random.default_rng(5)
    cloud, _ = circle(np.linspace(0, LENGTH, 1000), 1.0)
    cloud += 5e-5 * rng.standard_normal(cloud.shape)
    cloud[:200] += rng.choice([-1, 1], (200, 1)) * [0, 2e-3, 0]
    found = fit_centreline(cloud, LENGTH, (0, 0, 0))
    assert found.noise == pytest.approx(5e-5, rel=0.08)
    assert not found.used[:200].any() and found.used[200:].mean() > 0.98


def test_least_squares_without_robustness_is_lost_with_outliers():
    rng = np.random.default_rng(6)
    place, tangent = circle(S, 1.0)
    cloud = place + 5e-5 * rng.standard_normal(place.shape)
    cloud[rng.permutation(101)[:20]] += [0.0, 4e-3, 0.0]
    fits = [
        fit_centreline(cloud, LENGTH, (0, 0, 0), arc_lengths=S, robust=robust, degree=4) for robust in (True, False)
    ]
    errors = [degrees_between(found.tangent(S), tangent).max() for found in fits]
    assert errors[0] < 1 < 4 < errors[1]


def test_base_and_base_tangent_are_held():
    rng = np.random.default_rng(8)
    place, _ = circle(S, 1.2)
    cloud = place + [1, 2, 3] + 1e-4 * rng.standard_normal(place.shape)
    found = fit_centreline(cloud, LENGTH, (1, 2, 3), base_tangent=(0, 0, 5))
    assert np.array_equal(found.position(0.0), [1, 2, 3])
    assert np.allclose(found.tangent(0.0), [0, 0, 1], atol=1e-14)
    free = fit_centreline(cloud, LENGTH, (1, 2, 3))
    assert np.trace(found.tangent_covariance(0.01)) < np.trace(free.tangent_covariance(0.01))


def test_the_length_is_kept_where_places_are_unknown():
    """A gap in the cloud, and none of it near the tip: the rod goes on for its length."""
    s = np.concatenate([np.linspace(0, 0.02, 60), np.linspace(0.028, 0.046, 60)])
    place, _ = circle(s, 1.0)
    found = fit_centreline(place[np.random.default_rng(0).permutation(120)], LENGTH, (0, 0, 0))
    assert np.allclose(found.position(LENGTH), circle(np.array(LENGTH), 1.0)[0], atol=2e-6)
    speed = np.linalg.norm(found.derivatives(S, 1)[1], axis=-1)
    assert np.allclose(speed, 1, atol=1e-4)


def test_a_start_nearby_leads_to_the_same_curve_in_fewer_steps():
    rng = np.random.default_rng(9)
    cloud = circle(rng.uniform(0, LENGTH, 200), 1.0)[0] + 1e-4 * rng.standard_normal((200, 3))
    cold = fit_centreline(cloud, LENGTH, (0, 0, 0))
    before = fit_centreline(circle(S, 0.9)[0], LENGTH, (0, 0, 0), degree=4)
    warm = fit_centreline(cloud, LENGTH, (0, 0, 0), start=before)
    deviation = np.sqrt(np.trace(cold.position_covariance(S), axis1=1, axis2=2).max())
    assert warm.iterations < cold.iterations
    assert np.linalg.norm(warm.position(S) - cold.position(S), axis=-1).max() < 0.1 * deviation


GOOD = circle(S, 1.0)[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": GOOD[:5]}, "5 points cannot fix 6 coefficients"),
        ({"points": GOOD[:, :2]}, r"shape \(n, 3\)"),
        ({"points": np.where(S[:, None] > 0.04, np.nan, GOOD)}, "points must be finite; leave out"),
        ({"length": 0.0}, "length must be positive"),
        ({"length": np.nan}, "length must be positive"),
        ({"base": (0, np.inf, 0)}, "base must be finite"),
        ({"base_tangent": (0, 0, 0)}, "base tangent must not be zero"),
        ({"straight": ((0.03, 0.02),)}, "straight stretches are"),
        ({"straight": ((0.0, 0.02), (0.01, 0.03))}, "straight stretches are"),
        ({"straight": ((0.0, 0.06),)}, "straight stretches are"),
        ({"straight": ((0.0, LENGTH),), "base_tangent": (0, 0, 1)}, "leaves nothing to fit"),
        ({"degree": 1}, "degree must be a whole number"),
        ({"degree": 3.0}, "degree must be a whole number"),
        ({"arc_lengths": S + 0.01}, "arc lengths must lie between"),
        ({"arc_lengths": S[:7]}, r"shape \(101\)"),
        ({"arc_lengths": 0 * S + 0.01}, "too little of the rod"),
        ({"points": GOOD[:20], "arc_lengths": S[:20] * 0.2}, "too little of the rod"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_one_sentence(change, words):
    given = {"points": GOOD, "length": LENGTH, "base": (0, 0, 0)} | change
    with pytest.raises(InputError, match=words) as error:
        fit_centreline(given.pop("points"), given.pop("length"), given.pop("base"), **given)
    assert "\n" not in str(error.value)


def test_a_cloud_that_is_no_rod_is_refused():
    ball = np.random.default_rng(1).uniform(-0.05, 0.05, (300, 3))
    with pytest.raises(ConvergenceError, match="centreline"):
        fit_centreline(ball, LENGTH, (0, 0, 0))


def test_arc_lengths_off_the_rod_are_refused():
    found = fit_centreline(GOOD, LENGTH, (0, 0, 0))
    for s in (-0.01, 0.051, np.nan):
        with pytest.raises(InputError, match="between 0 and the rod's length"):
            found.position(s)
