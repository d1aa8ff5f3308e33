"""Rods next to other ways to their shapes: `python benchmarks/rods.py [python-with-pyelastica]`.

`python benchmarks/rods.py figure` draws docs/figures/rods.png instead.

The process keeps to one core and counts its processor time; what is compared takes turns. The first table is a
manipulator like the dissertation's, whose dimensions its text lacks, in BigMag at random currents: this package cold,
warm after steps of at most 0.4 A, and with its Jacobian; the same Cosserat equations by scipy's `solve_bvp`, and by
single shooting as in the dissertation (explicit Runge–Kutta steps of order four, Levenberg–Marquardt with differences),
whose steps are compiled by Numba.
Their Jacobians take one more solution for every current. The second is a cantilever under a dead tip force, next to
PyElastica's dynamic relaxation, when an interpreter that has it is given.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numba
import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation
from tables import alternate, show

import magfem
from magfem.fields import UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod

LENGTHS, RADIUS, E, DENSITY, MOMENT, MASS = (0.035, 0.03), 1.5e-3, 5.5e6, 1040.0, 0.0135, 1e-4
MAGNET_LENGTH, GRAVITY = 5e-3, np.array([0.0, 0.0, -9.81])
BASE = RigidTransform.from_components([-0.0375, 0, 0], Rotation.from_euler("y", 90, degrees=True))
SECOND, AREA = np.pi * RADIUS**4 / 4, np.pi * RADIUS**2
BENDING = np.array([E * SECOND, E * SECOND, E / 3 * 2 * SECOND])
SHEAR = np.array([E / 3 * AREA, E / 3 * AREA, E * AREA])
FORCE, TORQUE = E * SECOND / 0.07**2, E * SECOND / 0.07  # units of the internal ones


def manipulator(elements: int | None = None) -> Rod:
    """Two polyurethane sections, each with a magnet at its end."""
    parts: list[FlexibleSection | MagnetSection] = []
    for length in LENGTHS:
        parts.append(
            FlexibleSection(length=length, radius=RADIUS, youngs_modulus=E, density=DENSITY, elements=elements)
        )
        parts.append(MagnetSection(length=MAGNET_LENGTH, moment=MOMENT, mass=MASS))
    return Rod(parts, BASE)


# The same rod as differential equations: y = p, q (w x y z), n, m of n cross-sections at once, (13, n).


def rotations(q: np.ndarray) -> np.ndarray:
    """(n, 3, 3), of quaternions (4, n) of any length."""
    w, x, y, z = q / np.linalg.norm(q, axis=0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def slope(y: np.ndarray) -> np.ndarray:
    """dy/ds by eq. 2.2 of the dissertation."""
    R, n, m = rotations(y[3:7]), y[7:10].T * FORCE, y[10:].T * TORQUE
    u = np.einsum("nji,nj->ni", R, m) / BENDING
    dp = np.einsum("nij,nj->ni", R, np.einsum("nji,nj->ni", R, n) / SHEAR + [0, 0, 1])
    w, x, yy, z = y[3:7]
    a, b, c = u.T
    dq = 0.5 * np.array(
        [-x * a - yy * b - z * c, w * a + yy * c - z * b, w * b + z * a - x * c, w * c + x * b - yy * a]
    )
    df = np.broadcast_to(-DENSITY * AREA * GRAVITY[:, None] / FORCE, (3, y.shape[1]))
    return np.concatenate([dp.T, dq, df, -np.cross(dp, n).T / TORQUE])


@numba.njit
def _slope_of_one(y, FORCE, TORQUE, weight, bending, shear, dy):
    """As `slope`, of one cross-section, to dy (13,); scalars for speed."""
    w, a, b, c = y[3], y[4], y[5], y[6]
    norm = w * w + a * a + b * b + c * c
    R = np.empty((3, 3))
    R[0, 0], R[1, 1], R[2, 2] = (
        w * w + a * a - b * b - c * c,
        w * w - a * a + b * b - c * c,
        w * w - a * a - b * b + c * c,
    )
    R[0, 1], R[1, 0] = 2 * (a * b - c * w), 2 * (a * b + c * w)
    R[0, 2], R[2, 0] = 2 * (a * c + b * w), 2 * (a * c - b * w)
    R[1, 2], R[2, 1] = 2 * (b * c - a * w), 2 * (b * c + a * w)
    u, v = np.empty(3), np.empty(3)
    for i in range(3):
        for j in range(3):
            R[i, j] /= norm
    for i in range(3):
        u[i] = (R[0, i] * y[10] + R[1, i] * y[11] + R[2, i] * y[12]) * TORQUE / bending[i]
        v[i] = (R[0, i] * y[7] + R[1, i] * y[8] + R[2, i] * y[9]) * FORCE / shear[i]
    v[2] += 1.0
    for i in range(3):
        dy[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]
        dy[7 + i] = -weight[i] / FORCE
    dy[3] = -0.5 * (a * u[0] + b * u[1] + c * u[2])
    dy[4] = 0.5 * (w * u[0] + b * u[2] - c * u[1])
    dy[5] = 0.5 * (w * u[1] + c * u[0] - a * u[2])
    dy[6] = 0.5 * (w * u[2] + a * u[1] - b * u[0])
    ratio = FORCE / TORQUE
    dy[10] = -(dy[1] * y[9] - dy[2] * y[8]) * ratio
    dy[11] = -(dy[2] * y[7] - dy[0] * y[9]) * ratio
    dy[12] = -(dy[0] * y[8] - dy[1] * y[7]) * ratio


@numba.njit
def _runge_kutta(y, length, steps, FORCE, TORQUE, weight, bending, shear):
    """y (13,) at the section's end."""
    h = length / steps
    k1, k2, k3, k4 = np.empty(13), np.empty(13), np.empty(13), np.empty(13)
    for _ in range(steps):
        _slope_of_one(y, FORCE, TORQUE, weight, bending, shear, k1)
        _slope_of_one(y + h / 2 * k1, FORCE, TORQUE, weight, bending, shear, k2)
        _slope_of_one(y + h / 2 * k2, FORCE, TORQUE, weight, bending, shear, k3)
        _slope_of_one(y + h * k3, FORCE, TORQUE, weight, bending, shear, k4)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def over_magnet(y: np.ndarray, field: object) -> np.ndarray:
    """y (13,) from a magnet's beginning to its end."""
    R, n, m = rotations(y[3:7, None])[0], y[7:10] * FORCE, y[10:] * TORQUE
    half = R[:, 2] * MAGNET_LENGTH / 2
    mu = R[:, 2] * MOMENT
    B, gradient = field.jet(y[:3] + half, 1, outside="extrapolate")
    m = m - np.cross(half, n) - np.cross(mu, B)
    n = n - gradient.T @ mu - MASS * GRAVITY
    m = m - np.cross(half, n)
    return np.concatenate([y[:3] + 2 * half, y[3:7], n / FORCE, m / TORQUE])


def start() -> np.ndarray:
    """p, q at the base."""
    x, y, z, w = BASE.rotation.as_quat()
    return np.concatenate([BASE.translation, [w, x, y, z]])


def by_solve_bvp(field: object, tolerance: float = 1e-6) -> np.ndarray:
    """The tip, by collocation on both sections side by side."""
    base, L = start(), np.array(LENGTHS)

    def both(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.concatenate([L[0] * slope(y[:13]), L[1] * slope(y[13:])])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.concatenate([a[:7] - base, a[13:] - over_magnet(b[:13], field), over_magnet(b[13:], field)[7:]])

    s = np.linspace(0, 1, 8)
    guess = np.zeros((26, 8))
    guess[3:7], guess[16:20] = base[3:7, None], base[3:7, None]
    guess[:3] = base[:3, None] + BASE.rotation.apply([0, 0, 1])[:, None] * s * L[0]
    guess[13:16] = base[:3, None] + BASE.rotation.apply([0, 0, 1])[:, None] * (L[0] + MAGNET_LENGTH + s * L[1])
    solution = solve_bvp(both, ends, s, guess, tol=tolerance, max_nodes=2000)
    return over_magnet(solution.y[13:, -1], field)[:3] if solution.success else np.full(3, np.nan)


def by_shooting(field: object, first: np.ndarray, steps: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """The tip and ξ = n, m at the base, from a first ξ."""
    base = start()

    def along(xi: np.ndarray) -> np.ndarray:
        y = np.concatenate([base, xi])
        for length in LENGTHS:
            y = _runge_kutta(y, length, steps, FORCE, TORQUE, DENSITY * AREA * GRAVITY, BENDING, SHEAR)
            y = over_magnet(y, field)
        return y

    found = least_squares(lambda xi: along(xi)[7:], first, method="lm", xtol=1e-8, ftol=1e-8, gtol=1e-8)
    tip = along(found.x)
    return (tip[:3] if np.abs(tip[7:]).max() < 1e-6 else np.full(3, np.nan)), found.x


def tip_by_shooting(field: object, first: np.ndarray) -> np.ndarray:
    """The tip alone."""
    return by_shooting(field, first)[0]


def tip_of(rod: Rod, driven: tuple, guess: object) -> np.ndarray:
    """The tip by magfem."""
    return rod.solve(driven, guess=guess).positions[-1]


def jacobian_of(rod: Rod, driven: tuple, guess: object) -> np.ndarray:
    """All magnets' poses by all currents, by magfem."""
    return rod.solve(driven, guess=guess).jacobian


def manipulator_table() -> None:
    """The dissertation's rod in BigMag."""
    system, rod, fine = magfem.load_system("bigmag"), manipulator(), manipulator(64)
    rng = np.random.default_rng(0)
    before = rng.uniform(-4, 4, 6)
    settings = [(one, one + rng.uniform(-0.4, 0.4, 6)) for one in rng.uniform(-4, 4, (12, 6))]
    rod.solve((system, before, None)).jacobian.sum()  # compiles
    ways: dict[str, list[float]] = {}
    errors: dict[str, list[float]] = {}
    for last, now in settings:
        driven, field = (system, now, None), system.at(now)
        truth = fine.solve(driven).positions[-1]
        guess = rod.solve((system, last, None))
        xi = by_shooting(system.at(last), np.zeros(6))[1]
        runs: dict[str, Callable[[], np.ndarray]] = {
            "magfem, cold": partial(tip_of, rod, driven, None),
            "magfem, warm": partial(tip_of, rod, driven, guess),
            "magfem, warm, and the Jacobian": partial(jacobian_of, rod, driven, guess),
            "solve_bvp, cold": partial(by_solve_bvp, field),
            "single shooting, cold": partial(tip_by_shooting, field, np.zeros(6)),
            "single shooting, warm": partial(tip_by_shooting, field, xi),
        }
        for name, seconds in zip(runs, alternate(list(runs.values()), 5, process_time), strict=True):
            ways.setdefault(name, []).append(seconds)
            if "Jacobian" not in name:
                errors.setdefault(name, []).append(float(np.linalg.norm(runs[name]() - truth)))
    unit = median(ways["magfem, warm"])
    rows = []
    for name, seconds in ways.items():
        wrong = np.array(errors.get(name, []))
        on = wrong[wrong < 1e-4]
        same = f"{on.size} of {wrong.size}" if wrong.size else ""
        rows.append(
            [
                name,
                f"{1e3 * median(seconds):.2f}",
                f"{median(seconds) / unit:.1f}",
                same,
                f"{1e6 * median(on):.2g}" if on.size else "",
            ]
        )
    for name, times in (("single shooting, warm", 7), ("solve_bvp, cold", 7)):
        whole = times * median(ways[name])
        ratio = whole / median(ways["magfem, warm, and the Jacobian"])
        rows.append([f"{name}, and differences by 6 currents", f"{1e3 * whole:.0f}", f"{whole / unit:.0f}", "", ""])
        print(f"{name} with differences over magfem with its Jacobian: {ratio:.0f}")
    show(
        "Two magnets in BigMag, medians over 12 settings within ±4 A",
        ["way", "ms", "over magfem, warm", "same shape", "tip off by, µm"],
        rows,
    )


def elastica_table(python: str | None) -> None:
    """A cantilever with PL²/EI = 2."""
    length, load = 0.07, 2 * E * SECOND / 0.07**2
    rod, fine = (
        Rod([FlexibleSection(length=length, radius=RADIUS, youngs_modulus=E, elements=elements)])
        for elements in (16, 128)
    )
    loads = dict(gravity=(0, 0, 0), tip_force=(load, 0, 0))
    expected = fine.solve(**loads).positions[-1]
    taken = alternate([lambda: rod.solve(**loads)], 15, process_time)[0]
    off = np.linalg.norm(rod.solve(**loads).positions[-1] - expected)
    rows = [["magfem, cold, 16 elements", f"{1e3 * taken:.2f}", "1", f"{1e6 * off:.2g}"]]
    if python is not None:
        case = dict(length=length, radius=RADIUS, youngs_modulus=E, density=DENSITY, force=[load, 0, 0])
        for elements, seconds in ((20, 0.2), (20, 0.4), (40, 0.4)):
            text = json.dumps(case | dict(elements=elements, seconds=seconds))
            script = str(Path(__file__).with_name("rods_pyelastica.py"))
            answer = subprocess.run([python, script, text], check=True, capture_output=True, text=True).stdout
            found = json.loads(answer.splitlines()[-1])
            off = np.linalg.norm(np.array(found["tip"]) - expected)
            rows.append(
                [
                    f"PyElastica, {elements} elements, {seconds:g} s of time ({found['steps']} steps)",
                    f"{1e3 * found['took']:.0f}",
                    f"{found['took'] / taken:.0f}",
                    f"{1e6 * off:.2g}",
                ]
            )
    show("Elastica, PL²/EI = 2, 70 mm", ["way", "ms", "over magfem", "tip off by, µm"], rows)


def figure() -> None:
    """docs/figures/rods.png."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    picture = plt.figure(figsize=(9.0, 3.8), dpi=130)
    axes = picture.add_subplot(1, 2, 1)
    soft = FlexibleSection(length=1.0, radius=1e-4, youngs_modulus=1e9, magnetic_moment_per_length=(0, 0, 1.0))
    published = {0.1: 2.862, 0.5: 14.011, 1: 26.434, 2: 44.791, 5: 69.635, 10: 81.949}  # Wang et al. 2020
    for load, angle in published.items():
        field = UniformField([load * soft.stiffness[0], 0, 0])
        state = Rod([soft]).solve(field, gravity=(0, 0, 0))
        x, z = state.positions[:, 0], state.positions[:, 2]
        (line,) = axes.plot(x, z, label=f"λ = {load:g}: {np.degrees(np.arccos(state.frames[-1][2, 2])):.3f}°")
        way = np.array([np.sin(np.radians(angle)), np.cos(np.radians(angle))])
        axes.plot([x[-1], x[-1] + 0.12 * way[0]], [z[-1], z[-1] + 0.12 * way[1]], ":", color=line.get_color())
    axes.set(xlabel="x/L, along the field", ylabel="z/L", aspect="equal", title="hard-magnetic; dotted: published")
    axes.legend(fontsize=7)

    space = picture.add_subplot(1, 2, 2, projection="3d")
    system, rod = magfem.load_system("bigmag_extended"), manipulator()
    rng = np.random.default_rng(3)
    for _ in range(6):
        state = rod.solve((system, rng.uniform(-4, 4, 14), None))
        line = space.plot(*(1e3 * state.positions.T), linewidth=1)[0]
        for node in rod.chain.magnet_node:
            ends = 1e3 * state.positions[[node - 1, node + 1]]
            space.plot(*ends.T, color=line.get_color(), linewidth=5, solid_capstyle="butt")
    space.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm", title="two magnets, 14 coils")
    space.set_box_aspect(None, zoom=0.85)
    picture.tight_layout()
    picture.savefig(Path(__file__).parents[1] / "docs" / "figures" / "rods.png", dpi=110, metadata={"Software": None})


def main() -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    if sys.argv[1:] == ["figure"]:
        figure()
        return
    started = perf_counter()
    manipulator_table()
    elastica_table(sys.argv[1] if len(sys.argv) > 1 else None)
    print(f"\n{perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
