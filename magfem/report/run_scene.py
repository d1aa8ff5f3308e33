"""The rod among the coils in three dimensions: tubes for rods, magnets with their poles, coils as they stand."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from magfem.fields.hull import CylinderHull
from magfem.fields.region import PlacedRegion, Shell
from magfem.report.figures.style import COPPER, GREY, NORTH, SOUTH, Picture, drawing, figure, png
from magfem.report.scenes import View, axes_cross, canvas, render, scale_bar, view
from magfem.rod import FlexibleSection
from magfem.scenario.run import Run
from magfem.typing import Floats, Points

_COIL_RADIUS, _COIL_LENGTH = 0.014, 0.02  # m, of coils whose size no model tells


def rods_picture(run: Run) -> Picture:
    """The plant at the start and where targets ended, at the coils' places; the last shape is solid."""
    from magfem.report.run_pictures import shown_steps

    chosen = shown_steps(run)
    reach = max(float(np.linalg.norm(run.steps[k].plant, axis=1).max()) for k in chosen)
    bodies = coil_bodies(run)
    near = [float(np.linalg.norm(centre)) for centre, *_ in bodies]
    wide = View(*_frame(), half=1.25 * max([reach, *near]) + 1.5 * _COIL_LENGTH)
    close = View(*_frame(), half=1.25 * reach)
    with drawing():
        drawn = figure(4.1, 7.4)
        panels = drawn.subplots(1, 2)
        for axes, seen, coils in zip(panels, (wide, close), (bodies, []), strict=True):
            image = render(partial(_fill, run=run, chosen=chosen, bodies=coils), seen)
            canvas(axes, image, seen)
            axes_cross(axes, seen)
            scale_bar(axes, seen)
        handles = [
            Patch(color=NORTH, label="north pole"),
            Patch(color=SOUTH, label="south pole"),
            Patch(color=COPPER, label="coil"),
        ]
        drawn.legend(handles=handles, loc="outside lower center", ncols=3, handlelength=1.0)
        content = png(drawn)
    return Picture(
        "rods",
        content,
        "The rod between the coils and from near, at the start and at its targets.",
        "The plant between the coils (left) and from near: pale the start and earlier targets, solid the last one."
        + ("" if _known_size(run) else " The coils’ places are true, their sizes are not known."),
    )


def _frame() -> tuple[Floats, Floats, Floats]:
    shared = view(1.0)
    return shared.right, shared.up, shared.towards


def coil_bodies(run: Run) -> list[tuple[Floats, Floats, float, float]]:
    """Centre (3,) m, axis (3,), outer radius and length (m) of every coil at joint values zero."""
    found = []
    for coil in run.system.coils:
        turn = coil.pose.rotation.as_matrix()
        hull = _hull(coil)
        if hull is not None:
            found.append((np.asarray(coil.pose.translation), turn[:, 2], hull.diameter / 2, hull.length))
        else:  # models of published coils have their origin on the coil's face
            centre = np.asarray(coil.pose.translation) - _COIL_LENGTH / 2 * turn[:, 2]
            found.append((centre, turn[:, 2], _COIL_RADIUS, _COIL_LENGTH))
    return found


def _hull(coil: Any) -> CylinderHull | None:
    region = coil.own_region
    if isinstance(region, PlacedRegion):
        region = region.region
    return region.hull if isinstance(region, Shell) and isinstance(region.hull, CylinderHull) else None


def _known_size(run: Run) -> bool:
    return all(_hull(coil) is not None for coil in run.system.coils)


def _fill(plotter: Any, pv: Any, *, run: Run, chosen: list[int], bodies: list[Any]) -> None:
    for k in chosen:
        step = run.steps[k]
        last = k == chosen[-1]
        _add_rod(plotter, pv, run, step.plant, step.actual, 1.0 if last else 0.35)
    for centre, axis, radius, length in bodies:
        coil = pv.Cylinder(center=tuple(centre), direction=tuple(axis), radius=radius, height=length, resolution=80)
        plotter.add_mesh(coil, color=COPPER, opacity=0.55, ambient=0.4, diffuse=0.6, smooth_shading=False)
        edges = coil.clean().extract_feature_edges(35, boundary_edges=False, manifold_edges=False)
        plotter.add_mesh(edges, color="#6B3F1A", line_width=2, lighting=False)


def _add_rod(plotter: Any, pv: Any, run: Run, line: Points, axes: Floats, opacity: float) -> None:
    """Flexible sections as grey tubes, magnets half red and half blue."""
    chain, sections = run.rod.chain, run.rod.sections
    magnet = 0
    for number, section in enumerate(sections):
        links = np.flatnonzero(chain.section == number)
        nodes = np.arange(links[0], links[-1] + 2)
        if isinstance(section, FlexibleSection):
            radius = _radius(section)
            tube = pv.Spline(line[nodes], 60).tube(radius=radius, n_sides=32)
            plotter.add_mesh(tube, color=GREY, opacity=opacity, ambient=0.4, diffuse=0.65, smooth_shading=True)
            continue
        radius = 0.9 * _radius(next(one for one in sections if isinstance(one, FlexibleSection)))
        moment = section.moment_vector[2]
        centre, axis = line[nodes[1]], axes[magnet]
        for side, colour in ((0.25, NORTH if moment >= 0 else SOUTH), (-0.25, SOUTH if moment >= 0 else NORTH)):
            half = pv.Cylinder(
                center=tuple(centre + side * section.length * axis),
                direction=tuple(axis),
                radius=1.15 * radius,
                height=section.length / 2,
                resolution=60,
            )
            plotter.add_mesh(half, color=colour, opacity=opacity, ambient=0.5, diffuse=0.6)
        magnet += 1


def _radius(section: FlexibleSection) -> float:
    return section.radius if section.radius is not None else float(np.sqrt(section.section.area / np.pi))
