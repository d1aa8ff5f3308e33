"""The tables and figures of docs/verification.md: `python benchmarks/verification.py [section …]`.

Sections: devices magnets currents axis inductance halbach corners edges stator planar. All but `edges` take seconds;
that one solves nine meshes of edge elements, some minutes. Figures go to docs/figures, or to the folder after
`--figures`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import log, pi, sin
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation
from tables import show

import magfem
from magfem.constants import MU_0
from magfem.fem import CoilSolution, flux_linkage, inductance_of_coil, quadrature
from magfem.fem.conduction import solve_sheet
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fields.coaxial_inductance import (
    CoaxialWinding,
    loops_mutual_inductance,
    mutual_inductance,
    nagaoka_coefficient,
    self_inductance,
)
from magfem.fields.filament import Filaments
from magfem.fields.norms import relative_errors
from magfem.fields.terms import loops
from magfem.fields.uniform_cylinder import ring_jet
from magfem.fields.uniform_cylinder_segment import cylinder_segment_jet
from magfem.geometry import CylinderMagnet, FoilTrack, HalbachRing, Part, PermanentMagnet
from magfem.geometry.foil_ribbon import Ribbon, Straight
from magfem.mesh.lattice import patches
from magfem.report.figures.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, drawing, figure, grid
from magfem.typing import Floats, Points

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from references import coil_corners, coils  # noqa: E402

FIGURES = HERE.parent / "docs" / "figures"
MAGNETS = (
    "ring_magnet_4x1.5x1",
    "rotor_1x3",
    "disc_magnet_8x2",
    "block_magnet_5x5x2",
    "sphere_magnet_5",
    "cylinder_segment_magnet_20x12x8",
    "magnet_stack_2x45x30",
    "magnet_stack_7_rings",
    "halbach_ring_8",
    "halbach_ring_16",
    "halbach_array_5",
    "magnet_assembly_quadrupole",
)


def small(value: float) -> str:
    return f"{value:.0e}"


def percent(value: float, digits: int = 3) -> str:
    return f"{100 * value:+.{digits}f} %"


def keep(name: str, height: float, draw: Callable[[Any], None], columns: int = 1) -> None:
    """Draw a figure of one or two columns and write it, in few colours."""
    from PIL import Image

    with drawing():
        sheet = figure(height, 4.6 if columns == 1 else 7.4)
        draw(sheet)
        path = FIGURES / f"{name}.png"
        sheet.savefig(path, dpi=110, metadata={"Software": None})
    Image.open(path).convert("RGB").quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"\n{path}: {path.stat().st_size / 1e3:.0f} kB")


def rigid(name: str) -> Any:
    """A device of the catalogue at recoil permeability 1."""
    geometry: Any = magfem.load_geometry(name)
    if not hasattr(geometry, "material"):
        placed = [replace(one, magnet=_stiff(one.magnet)) for one in geometry.magnets]
        return replace(geometry, magnets=tuple(placed), origin=None)
    return _stiff(geometry)


def _stiff(magnet: Any) -> Any:
    return replace(magnet, material=replace(magnet.material, recoil_permeability=1.0), origin=None)


# magnets ---------------------------------------------------------------------------------------------------------


def peer(part: Part) -> list[tuple[float, Any]]:
    """magpylib's own of a part, with signs: rings are a cylinder less a smaller one."""
    shape: Any = part.shape
    J = part.material.remanence_vector
    place = {"position": part.position, "orientation": Rotation.from_rotvec(part.rotation)}
    magnet = magpylib.magnet
    match type(shape).__name__:
        case "Box":
            return [(1.0, magnet.Cuboid(dimension=shape.size, polarization=J, **place))]
        case "Ball":
            return [(1.0, magnet.Sphere(diameter=shape.diameter, polarization=J, **place))]
        case "Sector":
            sizes = (shape.inner_diameter / 2, shape.outer_diameter / 2, shape.length)
            angles = (np.degrees(shape.start), np.degrees(shape.end))
            return [(1.0, magnet.CylinderSegment(dimension=(*sizes, *angles), polarization=J, **place))]
    full = magnet.Cylinder(dimension=(shape.outer_diameter, shape.length), polarization=J, **place)
    if not shape.inner_diameter:
        return [(1.0, full)]
    return [
        (1.0, full),
        (-1.0, magnet.Cylinder(dimension=(shape.inner_diameter, shape.length), polarization=J, **place)),
    ]


def magnets() -> None:
    """Closed forms of all magnets against magpylib's, B outside."""
    rows, found = [], []
    for name in MAGNETS:
        geometry = rigid(name)
        layers = geometry.region.layers(np.random.default_rng(1), layers=32, per_layer=64)
        B = magfem.exact(geometry).B(layers)
        with np.errstate(all="ignore"):
            theirs = sum(sign * np.asarray(one.getB(layers)) for part in geometry.parts for sign, one in peer(part))
        errors = relative_errors(np.asarray(theirs), B)
        lost = int(np.isnan(errors).sum())
        errors = errors[~np.isnan(errors)]
        found.append((name, errors))
        row = [f"`{name}`", len(geometry.parts), small(float(np.median(errors)))]
        rows.append([*row, small(float(np.quantile(errors, 0.99))), small(float(errors.max())), lost])
    header = ["device", "solids", "median", "99 %", "max", "magpylib gives none"]
    show("B of magpylib, relative to magfem's closed forms, 2048 points of the region", header, rows)
    segments()

    def draw(sheet: Any) -> None:
        axes = sheet.subplots()
        for place, (_, errors) in enumerate(reversed(found)):
            low, middle, high = (max(float(np.quantile(errors, q)), 1e-17) for q in (0.05, 0.5, 0.99))
            axes.plot([low, high], [place, place], color=BLUE, linewidth=4, alpha=0.35, solid_capstyle="round")
            axes.plot(middle, place, "o", color=BLUE, markersize=5)
            axes.plot(errors.max(), place, "|", color=ORANGE, markersize=11, markeredgewidth=2)
        axes.set_yticks(range(len(found)), [name for name, _ in reversed(found)], fontsize=7.5)
        axes.set_xscale("log")
        axes.set_xlim(1e-17, 10)
        axes.set_xlabel("relative difference of B: 5 to 99 % of the points, median (dot), largest (orange)")
        grid(axes)

    keep("magpylib", 3.4, draw, 2)


def segments() -> None:
    """A ring in four segments is the ring: ours and magpylib's, near face planes and near the axis."""
    inner, outer, length, J = 5e-3, 10e-3, 8e-3, np.array([0.6, 0.3, 1.0])
    cuts = np.linspace(0, 360, 5)
    rng = np.random.default_rng(2)
    angle, share, gap = rng.uniform(0, 2 * pi, 4000), rng.uniform(size=4000), rng.uniform(size=4000)
    cases = {
        "0 to 0.01 mm off a face's plane, outside": (outer * (1.1 + 2 * share), length / 2 + 1e-5 * gap),
        "0 to 0.01 mm off the axis, above": (1e-5 * gap, length / 2 + 1e-3 + 0.02 * share),
        "above, 1 to 10 mm": (outer * 3 * np.sqrt(share), length / 2 + 1e-3 + 9e-3 * gap),
    }
    rows = []
    for label, (rho, z) in cases.items():
        points = np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=-1)
        truth = ring_jet(points, inner, outer, length, J / MU_0, 0)[0]
        ours, theirs = np.zeros_like(truth), np.zeros_like(truth)
        for a, b in pairwise(cuts):
            ours += cylinder_segment_jet(points, inner, outer, length, np.radians(a), np.radians(b), J / MU_0, 0)[0]
            one = magpylib.magnet.CylinderSegment(dimension=(inner, outer, length, a, b), polarization=J)
            with np.errstate(all="ignore"):
                theirs += one.getB(points)
        cells = [label]
        for B in (ours, theirs):
            errors = np.linalg.norm(B - truth, axis=1) / np.linalg.norm(truth, axis=1)
            cells += [small(float(np.nanmedian(errors))), small(float(np.nanmax(errors)))]
        rows.append(cells)
    header = ["points", "magfem median", "magfem max", "magpylib median", "magpylib max"]
    show("Four segments against the whole ring", header, rows)


# currents --------------------------------------------------------------------------------------------------------


def currents() -> None:
    """Loops, windings, straight filaments and flat sheets against magpylib."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-40e-3, 40e-3, (4000, 3))
    rows = []

    def row(label: str, ours: Floats, theirs: Floats) -> None:
        errors = np.linalg.norm(ours - theirs, axis=-1) / np.linalg.norm(ours, axis=-1)
        rows.append([label, small(float(np.median(errors))), small(float(errors.max()))])

    circle = magpylib.current.Circle(diameter=50e-3, current=1.0)
    row("loop, 50 mm", loops_jet(np.array([25e-3]), points, 0)[0], circle.getB(points))
    pair: Any = magfem.load_geometry("helmholtz_pair_200")
    ours = magfem.solve(pair).B(points)
    row("Helmholtz pair, 14 × 10 mm windings (magpylib: 400 loops each)", ours, as_loops(pair, points))
    corner = 1e-3 * np.array([[10.0, -6, 0], [10, 6, 0], [-10, 6, 0], [-10, -6, 0], [10, -6, 0]])
    wire = Filaments(corner[:-1].copy(), corner[1:].copy(), np.ones(4))
    line = magpylib.current.Polyline(current=1.0, vertices=corner)
    row("rectangle of wire, 20 × 12 mm", wire.jet(points, 0)[0], line.getB(points))
    away = points[np.abs(points[:, 2]) > 1e-3]
    x, y = np.meshgrid(np.linspace(-10e-3, 10e-3, 3), np.linspace(-2e-3, 2e-3, 3), indexing="ij")
    strip = SheetCurrents(patches(np.stack([x, y, 0 * x], axis=-1)), patches(np.ascontiguousarray(0.5 + y / 4e-3)))
    theirs = magpylib.current.TriangleSheet(
        vertices=1e-3 * np.array([[-10.0, -2, 0], [10, -2, 0], [10, 2, 0], [-10, 2, 0]]),
        faces=[[0, 1, 2], [0, 2, 3]],
        current_densities=[[250.0, 0, 0]] * 2,
    )
    row("flat strip, 20 × 4 mm, 1 A along it, 1 mm off and farther", strip.jet(away, 0)[0], theirs.getB(away))
    show("B of currents, relative differences to magpylib at 4000 points", ["current", "median", "max"], rows)


def loops_jet(radii: Floats, points: Points, order: int) -> tuple[Floats, ...]:
    """(B, gradient, …) of loops of 1 A about z in the plane z = 0, radii (n,) m."""
    return loops(np.zeros((radii.size, 3)), radii, np.ones(radii.size)).jet(np.atleast_2d(points), order)


def as_loops(device: Any, points: Points, count: int = 20) -> Floats:
    """A coil of coaxial windings by magpylib's loops at Gauss points."""
    node, weight = np.polynomial.legendre.leggauss(count)
    total = np.zeros_like(points)
    for part in device.circuits[0].parts:
        radii = 0.5 * (part.inner_radius + part.outer_radius) + 0.5 * (part.outer_radius - part.inner_radius) * node
        for radius, share in zip(radii, weight, strict=True):
            for z, other in zip(part.centre + 0.5 * part.length * node, weight, strict=True):
                current = part.turns * share * other / 4
                total += magpylib.current.Circle(diameter=2 * radius, current=current, position=(0, 0, z)).getB(points)
    return total


# axis ------------------------------------------------------------------------------------------------------------


def axis() -> None:
    """The thick solenoid on its axis: radii 10 to 15 mm, length 30 mm, 1000 ampere turns."""
    solution: Any = magfem.solve(magfem.load_geometry("solenoid_20x30x30"))
    rows = []
    for z, wanted in coils.AXIS.items():
        found = float(solution.B([0.0, 0.0, z])[2])
        rows.append([f"{1e3 * z:g} mm", f"{wanted:.10f} T", f"{found:.10f} T", small(abs(found / wanted - 1))])
    show("B_z on the axis of the thick solenoid at 1 A", ["z", "published", "magfem", "difference"], rows)
    z = np.linspace(-45e-3, 45e-3, 241)

    def closed(z: Floats) -> Floats:
        total = np.zeros_like(z)
        for sign in (1, -1):
            distance = 15e-3 + sign * z
            total += distance * np.log((15e-3 + np.hypot(15e-3, distance)) / (10e-3 + np.hypot(10e-3, distance)))
        field: Floats = MU_0 * 1000 / (2 * 5e-3 * 30e-3) * total
        return field

    line = solution.B(np.stack([0 * z, 0 * z, z], axis=-1))[:, 2]
    worst = np.abs(line / closed(z) - 1).max()
    print(f"largest difference to the closed form at 241 points of the axis: {worst:.0e}")

    def draw(sheet: Any) -> None:
        axes = sheet.subplots()
        axes.plot(1e3 * z, 1e3 * closed(z), color=BLUE, label="closed form on the axis")
        axes.plot(1e3 * z[::12], 1e3 * line[::12], "o", color=INK, markersize=3, label="magfem")
        axes.plot(
            1e3 * np.array(list(coils.AXIS)),
            1e3 * np.array(list(coils.AXIS.values())),
            "x",
            color=ORANGE,
            markersize=9,
            markeredgewidth=2,
            label="published",
        )
        axes.axvspan(-15, 15, color=GREY, alpha=0.12, linewidth=0)
        axes.set_xlabel("z (mm); shaded: the winding")
        axes.set_ylabel("B$_z$ (mT) at 1000 A turns")
        axes.legend()
        grid(axes)

    keep("solenoid_axis", 2.7, draw)


# inductance ------------------------------------------------------------------------------------------------------


def inductance() -> None:
    """Published inductances; reciprocity of mutual inductance and of flux linkage."""
    rows = []
    for angle, logarithm in coils.MAXWELL.items():
        modulus2 = sin(np.radians(angle)) ** 2
        radius, other = 30e-3, 20e-3
        distance = (4 * radius * other / modulus2 - (radius + other) ** 2) ** 0.5
        found = float(loops_mutual_inductance(radius, other, distance)) / (MU_0 * (radius * other) ** 0.5)
        rows.append(pair(f"Maxwell's table, γ = {angle:g}°: M/µ₀√(Aa)", 10**logarithm, found, 7))
    for ratio, wanted in coils.NAGAOKA.items():
        rows.append(
            pair(f"Nagaoka's coefficient, diameter/length {ratio:g}", wanted, nagaoka_coefficient(ratio / 2, 1.0), 6)
        )
    found = self_inductance(CoaxialWinding(10e-3, 20e-3, 10e-3)) / 15e-3
    rows.append(pair("Brooks's coil, L/N²a, µH/m", 1e6 * coils.BROOKS, 1e6 * found, 4))
    loop: Any = magfem.solve(magfem.load_geometry("loop_50"))
    R, a = 25e-3, 0.5e-3
    wanted = MU_0 * R * (log(8 * R / a) - 1.75)
    found = 1e9 * float(loop.inductance[0, 0])
    rows.append(pair("loop, 50 mm, wire 1 mm, nH: µ₀R(ln 8R/a − 7/4)", 1e9 * wanted, found, 3))
    show("Inductances against published values", ["what", "published", "magfem", "difference"], rows)
    reciprocity()


def pair(label: str, wanted: float, found: float, digits: int) -> list[str]:
    return [label, f"{wanted:.{digits}f}", f"{found:.{digits}f}", small(abs(found / wanted - 1))]


def reciprocity() -> None:
    """M from either side; a magnet's flux through a coil against the coil's field at the magnet."""
    rows = []

    def row(label: str, one: float, other: float, unit: str) -> None:
        rows.append([label, f"{one:.8g} {unit}", f"{other:.8g} {unit}", small(abs(one / other - 1))])

    first, second = CoaxialWinding(10e-3, 15e-3, 30e-3, 1000.0), CoaxialWinding(18e-3, 24e-3, 8e-3, 300.0, 12e-3)
    row("M of two thick coaxial windings", mutual_inductance(first, second), mutual_inductance(second, first), "H")
    stator: Any = magfem.solve(magfem.load_geometry("stator_1.6x5.5"))
    inner, outer = (circuit.currents for circuit in stator.circuits)

    def linked(source: Any, driven: Any) -> float:
        places, strengths = driven.elements()
        return float((source.vector_potential(places) * strengths).sum())

    row("M of the stator's coils, ∫A·J", linked(inner, outer), linked(outer, inner), "H")
    coil: Any = magfem.solve(magfem.load_geometry("planar_coil_12mm"))
    small_magnet = CylinderMagnet(diameter=1e-3, length=1e-3, material=PermanentMagnet(1.4, 1.0))
    for label, device, magnet, height in (
        ("flux of a cylinder 1 × 1 mm, 3 mm above the planar coil", coil, small_magnet, 3e-3),
        ("flux of the rotor through the stator's inner coil", stator, rigid("rotor_1x3"), 0.0),
    ):
        pose = RigidTransform.from_translation([0.0, 0.0, height])
        flux = float(flux_linkage(device, magfem.exact(magnet).at(pose))[0])
        points, weights = cylinder(magnet.diameter, magnet.length)
        mean = weights @ device.circuits[0].B(points + np.array([0.0, 0.0, height]))
        row(label, flux, float(magnet.material.remanence_vector @ mean) * magnet.volume / MU_0, "Wb")
    header = ["what", "one way", "other way", "difference"]
    show("Reciprocity: M₁₂ = M₂₁, and Φ = ∫ M·b dV with b the coil's field per ampere", header, rows)


def cylinder(diameter: float, length: float) -> tuple[Points, Floats]:
    """Places (n, 3) m and weights (n,) of sum 1 that average over a cylinder about z."""
    node, weight = np.polynomial.legendre.leggauss(10)
    rho = 0.5 * diameter * np.sqrt(0.5 * (1 + node))
    phi = 2 * pi * np.arange(16) / 16
    R, P, Z = np.meshgrid(rho, phi, 0.5 * length * node, indexing="ij")
    weights = np.broadcast_to((weight[:, None, None] * weight) / (4 * phi.size), R.shape)
    return np.stack([R * np.cos(P), R * np.sin(P), Z], axis=-1).reshape(-1, 3), np.ascontiguousarray(weights).ravel()


# Halbach ---------------------------------------------------------------------------------------------------------


def halbach() -> None:
    """The bore's field of Halbach cylinders: with segments, and with length."""
    outer, inner, remanence = 30e-3, 20e-3, 1.35
    ideal = remanence * log(outer / inner)

    def centre(segments: int, length: float) -> float:
        ring = HalbachRing(
            outer_diameter=outer,
            inner_diameter=inner,
            length=length,
            segments=segments,
            material=PermanentMagnet(remanence, recoil_permeability=1.0),
        )
        return float(magfem.exact(ring).B([0.0, 0.0, 0.0])[0]) / ideal

    counts, lengths = (4, 6, 8, 12, 16, 24, 32, 48), np.array([10e-3, 20e-3, 40e-3, 80e-3, 160e-3, 320e-3])
    long = [centre(count, 1.5) for count in counts]
    formula = [sin(2 * pi / n) / (2 * pi / n) for n in counts]
    rows = [[n, f"{b:.6f}", f"{f:.6f}", small(abs(b / f - 1))] for n, b, f in zip(counts, long, formula, strict=True)]
    show(
        f"B in the middle over B_r ln(R_o/R_i) = {ideal:.6f} T, 1.5 m long",
        ["segments", "magfem", "sin(2π/N)/(2π/N)", "difference"],
        rows,
    )
    short = [centre(48, one) for one in lengths]
    finite = [_finite_halbach(outer / 2, inner / 2, one) * formula[-1] for one in lengths]
    rows = [
        [f"{1e3 * one:g} mm", f"{b:.6f}", f"{f:.6f}", small(abs(b / f - 1))]
        for one, b, f in zip(lengths, short, finite, strict=True)
    ]
    show("The same, 48 segments, with length", ["length", "magfem", "closed form", "difference"], rows)

    def draw(sheet: Any) -> None:
        left, right = sheet.subplots(1, 2)
        left.plot(counts, formula, color=BLUE, label="sin(2π/N) / (2π/N)")
        left.plot(counts, long, "o", color=INK, markersize=4, label="magfem, 1.5 m long")
        left.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--")
        left.set_xlabel("segments N")
        left.set_ylabel("B / B$_r$ ln(R$_o$/R$_i$)")
        fine = np.geomspace(8e-3, 0.4, 80)
        right.plot(
            1e3 * fine,
            [_finite_halbach(outer / 2, inner / 2, one) * formula[-1] for one in fine],
            color=BLUE,
            label="closed form of length",
        )
        right.plot(1e3 * lengths, short, "o", color=INK, markersize=4, label="magfem, N = 48")
        right.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--")
        right.set_xscale("log")
        right.set_xlabel("length (mm)")
        for axes in (left, right):
            axes.legend(loc="lower right")
            grid(axes)

    keep("halbach", 2.7, draw, 2)


def _finite_halbach(outer: float, inner: float, length: float) -> float:
    """The share that a length leaves of the field in the middle, continuous magnetisation.

    Of dipoles M (cos 2φ, sin 2φ) at (ρ, φ, z) the x component in the middle is, with r² = ρ² + z² and averaged over
    φ, (µ0/4π)(3ρ²/2)/r⁵ M; its integral over z is ρ² ζ(3ρ² + 2ζ²)/(ρ⁴ s³) with s² = ρ² + ζ², ζ = L/2.
    """
    node, weight = np.polynomial.legendre.leggauss(80)
    rho = 0.5 * (outer + inner) + 0.5 * (outer - inner) * node
    zeta = 0.5 * length
    s3 = np.hypot(rho, zeta) ** 3
    inside = zeta * (3 * rho**2 + 2 * zeta**2) / (rho * s3)  # → 2/ρ when long
    return float(0.5 * (outer - inner) * weight @ inside / (2 * log(outer / inner)))


# corners ---------------------------------------------------------------------------------------------------------


def corners() -> None:
    """Two bounds of a square ring's resistance close in on the corner's 1 − (2/π) ln 2 squares."""
    exact, rows, found = coil_corners.SQUARES, [], []
    for elements, resolution in ((8, 0.5), (8, 1.0), (8, 2.0), (8, 4.0)):
        bounds = solve_sheet(_square(5e-3, 1e-3), 1.0, resolution, elements).bounds
        low, high = ((bound * 10e-6 - 20) / 4 for bound in bounds)
        found.append((resolution, low, high))
        rows.append(
            [
                f"{resolution:g}",
                f"{low:.6f}",
                f"{high:.6f}",
                f"{0.5 * (low + high):.6f}",
                small(0.5 * (low + high) - exact),
            ]
        )
    show(
        f"Squares of a mitred corner; exact {exact:.6f}, published 0.559",
        ["resolution", "below", "above", "mean", "its error"],
        rows,
    )

    def draw(sheet: Any) -> None:
        left, right = sheet.subplots(1, 2)
        res, low, high = (np.array(column) for column in zip(*found, strict=True))
        left.plot(res, high, "v-", color=ORANGE, markersize=4, label="stream function: above")
        left.plot(res, low, "^-", color=BLUE, markersize=4, label="potential: below")
        left.axhline(exact, color=INK, linewidth=0.8, linestyle="--", label="1 − (2/π) ln 2")
        left.set_ylabel("squares of a corner")
        left.set_xscale("log", base=2)
        right.loglog(res, high - exact, "v-", color=ORANGE, markersize=4)
        right.loglog(res, exact - low, "^-", color=BLUE, markersize=4)
        right.loglog(res, np.abs(0.5 * (low + high) - exact), "o-", color=GREEN, markersize=4, label="their mean")
        right.loglog(res, 1.3 * (high[0] - exact) * (res / res[0]) ** -2.0, color=GREY, linestyle=":", label="order 2")
        right.set_ylabel("distance to the exact value")
        for axes in (left, right):
            axes.set_xticks([0.5, 1, 2, 4], ["0.5", "1", "2", "4"])
            axes.minorticks_off()
            axes.set_xlabel("resolution")
            axes.legend(fontsize=7.5)
            grid(axes)

    keep("corner", 2.7, draw, 2)


def _square(inside: float, width: float) -> FoilTrack:
    """A square ring of 10 µm foil with mitred corners: 20 squares in its straight sides when `inside` is 5 widths."""
    half = 0.5 * (inside + width)
    places = half * np.array([[1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])
    pieces = []
    for n, start in enumerate(places):
        end = places[(n + 1) % 4]
        along = (end - start) / np.linalg.norm(end - start)
        pieces.append(Straight(start, end, np.array([-along[1], along[0], 0.0]), (width, width)))
    length = 4 * (inside + width)
    return FoilTrack(Ribbon(tuple(pieces)), width, 10e-6, length, length * width, lead_length=0.0)


# edge elements ---------------------------------------------------------------------------------------------------

EDGE_COILS: tuple[tuple[str, list[str] | None, str], ...] = (
    ("solenoid_20x30x30", None, "solenoid 20 × 30 × 30 mm"),
    ("planar_coil_12mm", None, "planar coil, 12 mm"),
    ("stator_1.6x5.5", ["inner"], "stator's inner coil"),
)


def edges() -> None:
    """Inductance by edge elements on three meshes, extrapolated, against the integral of A·J."""
    found = []
    for name, circuits, label in EDGE_COILS:
        geometry: Any = magfem.load_geometry(name)
        first: Any = magfem.solve(geometry)
        second = inductance_of_coil(geometry, circuits)
        found.append(
            {
                "label": label,
                "first": float(first.inductance[0, 0]),
                "limit": float(second.inductance[0, 0]),
                "error": float(second.error[0, 0]),
                "order": float(second.order[0, 0]),
                "values": second.values[:, 0, 0],
                "sizes": second.sizes,
                "edges": second.edges,
                "seconds": second.seconds,
            }
        )
    edge_tables(found)


def edge_tables(found: Sequence[dict[str, Any]]) -> None:
    """Print and draw what `edges` found."""
    rows = []
    for one in found:
        row = [one["label"], " / ".join(f"{count / 1e3:.0f} k" for count in one["edges"])]
        row += [" / ".join(f"{1e6 * value:.5g}" for value in one["values"]), f"{one['order']:.2f}"]
        row += [f"{1e6 * one['limit']:.5g} ± {1e6 * one['error']:.2g}", f"{1e6 * one['first']:.5g}"]
        rows.append([*row, percent(one["limit"] / one["first"] - 1, 2), f"{one['seconds']:.0f}"])
    header = ["coil", "edges", "µH on each mesh", "order", "extrapolated", "∫A·J", "difference", "seconds"]
    show("Inductance by edge elements", header, rows)

    def draw(sheet: Any) -> None:
        axes = sheet.subplots()
        for one, colour, mark in zip(found, (BLUE, ORANGE, PURPLE), "osv", strict=True):
            share = np.asarray(one["sizes"]) / one["sizes"][-1]
            off = 100 * (np.asarray(one["values"]) / one["first"] - 1)
            axes.plot(share, off, mark, color=colour, markersize=4, label=f"{one['label']}, order {one['order']:.2f}")
            size, limit = np.linspace(0, share[0], 60), 100 * (one["limit"] / one["first"] - 1)
            axes.plot(size, limit + (off[2] - limit) * size ** one["order"], color=colour, linewidth=1)
            axes.plot(0, limit, mark, color=colour, markersize=6, fillstyle="none")
        axes.axhline(0, color=GREY, linewidth=0.8, linestyle="--")
        axes.set_xlim(-0.1, None)
        axes.set_xlabel("element size over that of the finest mesh; open: extrapolated")
        axes.set_ylabel("difference to ∫A·J (%)")
        axes.legend()
        grid(axes)

    keep("edge_elements", 3.0, draw)


# the dissertation ------------------------------------------------------------------------------------------------


def stator() -> None:
    """The stator of chapter 6: field per ampere over the rotor's volume, resistances, heat."""
    geometry: Any = magfem.load_geometry("stator_1.6x5.5")
    solution: Any = magfem.solve(geometry)
    points, weights = cylinder(1e-3, 3e-3)
    angle = 2 * pi * np.arange(96) / 96
    wall = 0.5e-3 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    shell = (wall + np.linspace(-1.5e-3, 1.5e-3, 61)[:, None, None] * np.array([0, 0, 1])).reshape(-1, 3)
    rows, means = [], []
    for name in ("inner", "outer"):
        circuit = solution.circuit(name)
        B = 1e3 * circuit.B(points)
        sizes = np.concatenate([np.linalg.norm(B, axis=1), 1e3 * np.linalg.norm(circuit.B(shell), axis=1)])
        means.append(weights @ B)
        row = [name, f"{sizes.min():.2f} to {sizes.max():.2f}", f"{weights @ np.linalg.norm(B, axis=1):.2f}"]
        row += [f"{np.linalg.norm(means[-1]):.2f}", f"{circuit.resistance:.3f}", f"{circuit.lead_resistance:.3f}"]
        rows.append(row)
    header = ["coil", "|B| in the rotor's volume, mT/A", "mean |B|", "|mean B|", "Ω", "of it leads"]
    show("Stator, without its rotor", header, rows)
    cosine = means[0] @ means[1] / (np.linalg.norm(means[0]) * np.linalg.norm(means[1]))
    between, turned = np.degrees(np.arccos(cosine)), np.degrees(geometry.angle)
    print(f"angle between the mean fields {between:.2f}°, between the coils {turned:.2f}°")
    L = 1e6 * solution.inductance
    share = L[0, 1] / (L[0, 0] * L[1, 1]) ** 0.5
    print(f"inductances {L[0, 0]:.4f} and {L[1, 1]:.4f} µH, mutual {L[0, 1]:.4f} µH, coupling {share:.3f}")
    drive = quadrature(solution, amplitude=0.2)
    most, least = (1e3 * float(one) for one in drive.semi_axes(np.zeros(3)))
    print(
        f"quadrature, amplitude 200 mA: {1e3 * drive.power:.1f} mW, semi-axes at the centre {most:.3f}, {least:.3f} mT"
    )
    print(f"200 mA direct in both coils: {1e3 * solution.power([0.2, 0.2]):.1f} mW")
    draw_stator(solution)


def draw_stator(solution: CoilSolution) -> None:
    """The section z = 0 of both fields, and their sizes along the axis."""
    rho, phi = np.meshgrid(np.linspace(0, 0.6e-3, 25), np.linspace(0, 2 * pi, 97))
    X, Y = rho * np.cos(phi), rho * np.sin(phi)
    shades_at = np.stack([X, Y, 0 * X], axis=-1)
    x, y = (flat.ravel() for flat in np.meshgrid(*[np.linspace(-0.5e-3, 0.5e-3, 9)] * 2))
    within = np.hypot(x, y) < 0.56e-3
    arrows_at = np.stack([x, y, 0 * x], axis=-1)[within]
    z = np.linspace(-3.5e-3, 3.5e-3, 141)
    line = np.stack([0 * z, 0 * z, z], axis=-1)

    def draw(sheet: Any) -> None:
        left, middle, right = sheet.subplots(1, 3, width_ratios=(1, 1, 1.25))
        for axes, name in ((left, "inner"), (middle, "outer")):
            size = 1e3 * np.linalg.norm(solution.circuit(name).B(shades_at), axis=-1)
            levels = np.arange(3.0, 7.01, 0.5)
            shades = axes.contourf(1e3 * X, 1e3 * Y, size, levels, cmap="viridis", extend="both")
            arrows = solution.circuit(name).B(arrows_at)
            arrows /= np.linalg.norm(arrows, axis=-1, keepdims=True)
            axes.quiver(
                1e3 * arrows_at[:, 0], 1e3 * arrows_at[:, 1], *arrows.T[:2], color="white", scale=14, width=0.01
            )
            axes.plot(0.5 * np.cos(np.linspace(0, 7, 200)), 0.5 * np.sin(np.linspace(0, 7, 200)), color=ORANGE)
            axes.set_aspect("equal")
            axes.text(0.5, 1.02, f"{name} coil, z = 0", transform=axes.transAxes, ha="center")
            axes.set_xlabel("x (mm)")
        left.set_ylabel("y (mm)")
        sheet.colorbar(shades, ax=(left, middle), label="|B| (mT/A)", location="bottom", shrink=0.8, aspect=30)
        for name, colour in (("inner", BLUE), ("outer", ORANGE)):
            right.plot(1e3 * z, 1e3 * np.linalg.norm(solution.circuit(name).B(line), axis=-1), color=colour, label=name)
        right.axvspan(-1.5, 1.5, color=GREY, alpha=0.12, linewidth=0)
        right.set_xlabel("z (mm); shaded: the rotor")
        right.set_ylabel("|B| (mT/A)")
        right.set_ylim(0, None)
        right.legend()
        grid(right)

    keep("stator", 3.3, draw, 2)


def planar() -> None:
    """The planar coil of chapter 5: field and gradient over it, against 24 loops and the stated 2 mT and 1 T/m."""
    solution: Any = magfem.solve(magfem.load_geometry("planar_coil_12mm"))
    circuit = solution.circuits[0]
    shown = f"{circuit.resistance:.4f} Ω, of it {circuit.lead_resistance:.4f} Ω leads"
    print(f"resistance {shown}; bounds within {circuit.resistance_error:.0e}")
    radii = 1e-3 + (np.arange(24) + 0.5) * 5e-3 / 24
    plan = np.linspace(-6e-3, 6e-3, 61)
    X, Y = (flat.ravel() for flat in np.meshgrid(plan, plan))
    within = np.hypot(X, Y) < 6e-3
    rows = []
    for height in (0.2e-3, 0.5e-3, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3):
        place = np.array([[0.0, 0.0, height]])
        (B,), (gradient,) = solution.jet(place)
        (loops_B,), (loops_gradient,) = loops_jet(radii, place, 1)
        size, slope = solution.jet(np.stack([X, Y, np.full_like(X, height)], axis=-1)[within])
        size, slope = np.linalg.norm(size, axis=-1), np.linalg.norm(slope, axis=(-2, -1))
        numbers = [1e3 * B[2], -gradient[2, 2], 1e3 * loops_B[2], -loops_gradient[2, 2]]
        numbers += [np.linalg.norm(gradient), 1e3 * size.mean(), 1e3 * size.max(), slope.mean()]
        rows.append([f"{1e3 * height:g} mm", *(f"{number:.2f}" for number in numbers)])
    header = ["height", "axis: B_z, mT", "−∂B_z/∂z, T/m", "24 loops: B_z", "−∂B_z/∂z"]
    header += ["axis: ‖∇B‖", "over the coil: mean |B|", "max |B|", "mean ‖∇B‖"]
    show("Planar coil at 1 A", header, rows)
    z = np.linspace(0.2e-3, 6e-3, 117)
    line = np.stack([0 * z, 0 * z, z], axis=-1)
    B, gradient = solution.jet(line)
    ideal = loops_jet(radii, line, 1)
    ours, theirs = (B[:, 2], -gradient[:, 2, 2]), (ideal[0][:, 2], -ideal[1][:, 2, 2])
    for label, wanted, values in (("B_z = 2 mT", 2e-3, ours[0]), ("−∂B_z/∂z = 1 T/m", 1.0, ours[1])):
        beyond = np.flatnonzero(values > wanted)[-1]
        share = (values[beyond] - wanted) / (values[beyond] - values[beyond + 1])
        print(f"{label} on the axis at {1e3 * (z[beyond] + share * (z[1] - z[0])):.2f} mm")

    def draw(sheet: Any) -> None:
        left, right = sheet.subplots(1, 2)
        for axes, own, loop, factor, stated, label in (
            (left, ours[0], theirs[0], 1e3, 2.0, "B$_z$ (mT)"),
            (right, ours[1], theirs[1], 1.0, 1.0, "−∂B$_z$/∂z (T/m)"),
        ):
            axes.plot(1e3 * z, factor * own, color=BLUE, label="magfem: spiral, vias, return strip")
            axes.plot(1e3 * z, factor * loop, color=INK, linestyle="--", linewidth=1, label="24 loops")
            axes.axhline(stated, color=ORANGE, linewidth=1, label="stated")
            axes.set_xlabel("height on the axis (mm)")
            axes.set_ylabel(f"{label}, 1 A")
            grid(axes)
        left.legend()

    keep("planar_coil", 2.7, draw, 2)


def devices() -> None:
    """The picture of the README: three devices as `magfem show` draws them."""
    from tempfile import TemporaryDirectory

    from PIL import Image

    from magfem.report import show_picture

    wide = 300
    pictures = []
    with TemporaryDirectory() as folder:
        for name in ("halbach_ring_16", "planar_coil_12mm", "stator_1.6x5.5"):
            path = Path(folder) / f"{name}.png"
            show_picture(magfem.load_geometry(name), path)
            shown = Image.open(path).convert("RGB")
            pictures.append(shown.resize((wide, wide * shown.height // shown.width), Image.Resampling.LANCZOS))
    row = Image.new("RGB", (wide * len(pictures), max(picture.height for picture in pictures)), "white")
    for place, picture in enumerate(pictures):
        row.paste(picture, (wide * place, (row.height - picture.height) // 2))
    row.quantize(64, dither=Image.Dither.NONE).save(FIGURES / "devices.png", optimize=True)


SECTIONS = (devices, magnets, currents, axis, inductance, halbach, corners, edges, stator, planar)

if __name__ == "__main__":
    wanted = sys.argv[1:]
    if "--figures" in wanted:
        place = wanted.index("--figures")
        FIGURES = Path(wanted[place + 1])
        del wanted[place : place + 2]
    FIGURES.mkdir(parents=True, exist_ok=True)
    for section in SECTIONS:
        if not wanted or section.__name__ in wanted:
            section()
