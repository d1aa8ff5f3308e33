"""The tables and the figure of docs/shape-sensing.md: `python benchmarks/shape_sensing.py`.

A rod of two arcs and two rigid magnets in closed form, so that every direction is known. The figure goes to
docs/figures, or to the folder after `--figures`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from tables import alternate, show

from magfem.errors import MagfemError
from magfem.report.figures.style import BLUE, GREEN, GREY, INK, ORANGE, drawing, figure, grid
from magfem.rod import Camera, Centreline, fit_centreline, fit_centreline_to_views, magnet_poses, simulate_views
from magfem.rod.magnet_pose import forward_difference
from magfem.typing import Floats

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from rod.curves import LENGTH, circle, jointed  # noqa: E402

FIGURES = HERE.parent / "docs" / "figures"
BENDS, LENGTHS = (0.9, 0.0, -0.7, 0.0), (0.02, 0.005, 0.02, 0.005)
STRAIGHT, MAGNETS = ((0.02, 0.025), (0.045, 0.05)), np.array([0.0225, 0.0475])
EXACT = jointed(MAGNETS, BENDS, LENGTHS)[1]
NOISE = 1e-4  # m
CAMERAS = (
    Camera.looking_at((0, 0, 0.02), (0.3, 0.0, 0.02), 6000.0, (640.0, 512.0)),
    Camera.looking_at((0, 0, 0.02), (0.0, 0.3, 0.06), 6000.0, (640.0, 512.0)),
    Camera.looking_at((0, 0, 0.02), (-0.15, 0.15, 0.25), 6000.0, (640.0, 512.0)),
)


def degrees(found: Floats, exact: Floats) -> Floats:
    """Angles (…,) between unit vectors (…, 3)."""
    return np.asarray(np.degrees(2 * np.arcsin(np.linalg.norm(found - exact, axis=-1) / 2)))


def cloud(generator: np.random.Generator, count: int = 200, noise: float = NOISE) -> Floats:
    """Points of the rod anywhere along it, with noise."""
    place = jointed(np.sort(generator.uniform(0, LENGTH, count)), BENDS, LENGTHS)[0]
    return np.asarray(generator.permutation(place + noise * generator.standard_normal((count, 3))))


def truncation() -> None:
    """What a polynomial of each degree cannot follow of a circle."""
    s = np.linspace(0, LENGTH, 201)
    rows = []
    for degree in (3, 4, 5, 6, 7, 8, 10):
        row = [str(degree)]
        for bend in (45, 90, 135, 170):
            place, tangent = circle(s, np.radians(bend))
            found = fit_centreline(place, LENGTH, (0, 0, 0), degree=degree, robust=False)
            row.append(f"{degrees(found.tangent(s), tangent).max():.2g}")
        rows.append(row)
    show("Largest direction error on an arc without noise, deg", ("degree", "45°", "90°", "135°", "170°"), rows)


def directions(trials: int = 200) -> None:
    """Errors at both magnets, by the ways to a direction."""
    ways: dict[str, Callable[[Centreline, Centreline], Floats]] = {
        "derivative, straight magnets": lambda pieces, plain: pieces.tangent(MAGNETS),
        "derivative, plain polynomial": lambda pieces, plain: plain.tangent(MAGNETS),
        "difference (2.10), δs = 0.5 mm": lambda pieces, plain: forward_difference(plain, MAGNETS, 5e-4),
        "difference (2.10), δs = 2 mm": lambda pieces, plain: forward_difference(plain, MAGNETS, 2e-3),
    }
    rows = []
    for noise in (0.0, NOISE):
        generator = np.random.default_rng(1)
        errors: dict[str, list[Floats]] = {name: [] for name in ways}
        for _ in range(trials if noise else 1):
            seen = cloud(generator, noise=noise)
            common = {"base_tangent": (0, 0, 1)}
            pieces = fit_centreline(seen, LENGTH, (0, 0, 0), straight=STRAIGHT, degree=4, **common)
            plain = fit_centreline(seen, LENGTH, (0, 0, 0), degree=6, **common)
            for name, way in ways.items():
                errors[name].append(degrees(way(pieces, plain), EXACT))
        for name, found in errors.items():
            rms = np.sqrt(np.mean(np.square(found), axis=0))
            rows.append([name, f"{1e3 * noise:g} mm", *(f"{value:.3f}" for value in rms)])
    show("Root mean square error of a magnet's direction, deg", ("way", "noise", "first", "last"), rows)


def times() -> None:
    """How long one measurement takes, from a start as far off as a rod moves between two."""
    generator = np.random.default_rng(2)
    seen = cloud(generator)
    place = jointed(np.linspace(0, LENGTH, 100), BENDS, LENGTHS)[0]
    views = [view.pixels for view in simulate_views(CAMERAS[:2], place, generator)]
    settings = {"base_tangent": (0, 0, 1), "straight": STRAIGHT, "degree": 4}
    near = fit_centreline(
        jointed(np.linspace(0, LENGTH, 100), tuple(0.95 * bend for bend in BENDS), LENGTHS)[0],
        LENGTH,
        (0, 0, 0),
        **settings,
    )
    runs: dict[str, Callable[[], Centreline]] = {
        "cloud of 200, near start": lambda: fit_centreline(seen, LENGTH, (0, 0, 0), start=near, **settings),
        "cloud of 200, cold": lambda: fit_centreline(seen, LENGTH, (0, 0, 0), **settings),
        "two views of 100, near start": lambda: fit_centreline_to_views(
            CAMERAS[:2], views, LENGTH, (0, 0, 0), start=near, **settings
        ),
        "two views of 100, cold": lambda: fit_centreline_to_views(CAMERAS[:2], views, LENGTH, (0, 0, 0), **settings),
    }
    for run in runs.values():
        run()
    taken = alternate(list(runs.values()), 100)
    poses = alternate([lambda: magnet_poses(near, MAGNETS)], 200)[0]
    rows = [[name, f"{1e3 * seconds:.2f}"] for name, seconds in zip(runs, taken, strict=True)]
    show("Time of a measurement", ("what", "ms"), [*rows, ["poses of two magnets", f"{1e3 * poses:.2f}"]])


def cold_starts(trials: int = 300) -> None:
    """How often a fit without a start ends within 0.5 mm of the rod, said to fail, or ends elsewhere unsaid."""
    s = np.linspace(0, LENGTH, 120)
    rows = []
    for count in (2, 3):
        for largest, outliers in ((1.5, 0.0), (1.5, 0.2), (2.8, 0.0), (2.8, 0.2)):
            generator = np.random.default_rng(3)
            near, said, unsaid = 0, 0, 0
            for _ in range(trials):
                turn = Rotation.from_rotvec([0, 0, generator.uniform(0, 2 * np.pi)])
                place = turn.apply(circle(s, generator.uniform(0.01, largest))[0])
                views = simulate_views(CAMERAS[:count], place, generator, missing=0.1, outliers=outliers)
                try:
                    found = fit_centreline_to_views(CAMERAS[:count], [v.pixels for v in views], LENGTH, (0, 0, 0))
                except MagfemError:
                    said += 1
                    continue
                if np.linalg.norm(found.position(s) - place, axis=-1).max() < 5e-4:
                    near += 1
                else:
                    unsaid += 1
            rows.append([count, f"{np.degrees(largest):.0f}°", f"{outliers:.0%}", near, said, unsaid])
    show(f"{trials} cold starts", ("cameras", "bent up to", "outliers", "found", "refused", "wrong"), rows)


def placements(trials: int = 60) -> None:
    """How well two cameras see a quarter of a circle that ends along +x, by where they stand.

    Turns of a direction are measured in its stated deviations: their mean square over 2 is 1 where these are true.
    """
    s = np.linspace(0, LENGTH, 150)
    place = circle(s, np.pi / 2)[0]
    exact = circle(MAGNETS, np.pi / 2)[1]
    front = (0.02, -0.3, 0.02)
    stands = {
        "side by side, both in front": ((-0.1, -0.3, 0.02), (0.12, -0.3, 0.02)),
        "one in front, one aside and below": (front, (0.2, -0.2, -0.15)),
        "one in front, one above it": (front, (0.02, -0.15, 0.28)),
        "one in front, one on top": (front, (0.02, 0.02, 0.32)),
    }
    rows = []
    for name, positions in stands.items():
        cameras = [Camera.looking_at((0.015, 0, 0.02), position, 2500.0) for position in positions]
        farthest, turns, stated = [], [], []
        for seed in range(trials):
            views = simulate_views(cameras, place, np.random.default_rng(seed), missing=0.1, outliers=0.05)
            found = fit_centreline_to_views(
                cameras, [view.pixels for view in views], LENGTH, (0, 0, 0), base_tangent=(0, 0, 1)
            )
            poses = magnet_poses(found, MAGNETS)
            turn = poses.directions - exact
            inverse = np.linalg.pinv(poses.direction_covariance, rcond=1e-6, hermitian=True)
            farthest.append(np.linalg.norm(found.position(s) - place, axis=-1).max())
            turns.append(np.einsum("mi,mij,mj->m", turn, inverse, turn) / 2)
            stated.append(np.sqrt(np.trace(found.position_covariance(LENGTH))))
        row = [1e6 * np.median(farthest), 1e6 * max(farthest), 1e6 * np.median(stated)]
        rows.append([name, *(f"{value:.0f}" for value in row), f"{np.mean(turns):.2f}"])
    header = ("cameras", "farthest off, median µm", "worst", "stated at the tip", "turns over stated")
    show(f"Two cameras, 0.5 px, {trials} pairs of pictures", header, rows)


def draw(folder: Path) -> None:
    """A measured rod: its cloud and both fits from the side, and what each says of the direction along it."""
    generator = np.random.default_rng(4)
    seen = cloud(generator)
    wrong = generator.random(len(seen)) < 0.15
    seen[wrong] = generator.uniform([-5e-3, -5e-3, 0], [0.03, 5e-3, 0.05], (int(wrong.sum()), 3))
    s = np.linspace(0, LENGTH, 401)
    place, tangent = jointed(s, BENDS, LENGTHS)
    pieces = fit_centreline(seen, LENGTH, (0, 0, 0), base_tangent=(0, 0, 1), straight=STRAIGHT, degree=4)
    plain = fit_centreline(seen, LENGTH, (0, 0, 0), base_tangent=(0, 0, 1), degree=6)
    with drawing():
        sheet = figure(3.3, 7.4)
        shape, error = sheet.subplots(1, 2, width_ratios=(1, 1.3))
        shape.plot(1e3 * seen[:, 2], 1e3 * seen[:, 0], ".", color=GREY, markersize=3, label="cloud, 15 % outliers")
        shape.plot(1e3 * pieces.position(s)[:, 2], 1e3 * pieces.position(s)[:, 0], color=BLUE, label="centreline")
        for start, end in STRAIGHT:
            inside = (s >= start) & (s <= end)
            shape.plot(1e3 * place[inside, 2], 1e3 * place[inside, 0], color=INK, linewidth=4, alpha=0.5)
        shape.set(xlabel="z, mm", ylabel="x, mm", aspect="equal", title="a rod with two rigid magnets")
        shape.legend(loc="lower right")
        chord = s[s <= LENGTH - 2e-3]
        ahead = degrees(forward_difference(plain, chord, 2e-3), tangent[: chord.size])
        error.plot(1e3 * s, degrees(pieces.tangent(s), tangent), color=BLUE, label="derivative, magnets straight")
        error.plot(1e3 * s, degrees(plain.tangent(s), tangent), color=GREEN, label="derivative, plain polynomial")
        error.plot(1e3 * chord, ahead, color=ORANGE, label="difference (2.10), δs = 2 mm")
        for start, end in STRAIGHT:
            error.axvspan(1e3 * start, 1e3 * end, color=GREY, alpha=0.15, linewidth=0)
        error.set(xlabel="arc length, mm", ylabel="direction error, °", ylim=(0, 8), title="against the true direction")
        error.legend()
        for axes in (shape, error):
            grid(axes)
        sheet.savefig(folder / "shape_sensing.png", metadata={"Software": None})


if __name__ == "__main__":
    arguments = sys.argv[1:]
    truncation()
    directions()
    times()
    cold_starts()
    placements()
    draw(Path(arguments[arguments.index("--figures") + 1]) if "--figures" in arguments else FIGURES)
