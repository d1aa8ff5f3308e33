"""Pictures of coils: flat ones as a plan with a side view, all others in 3D; arrows show positive currents."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Patch, Polygon
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator

from magfem.geometry import Circuit, CoaxialWinding, Coil, FoilTrack, SweptWinding
from magfem.mesh.coil_surfaces import coil_surfaces
from magfem.report.coil_outline import Path, Strip, is_flat, paths, strips, swept_lattices
from magfem.report.figures.style import COPPER, EDGE, INK, LEAD, WIDTH, Picture, drawing, figure, png
from magfem.report.scenes import View, axes_cross, canvas, render, scale_bar, view
from magfem.typing import Floats, Integers, Points

MILLI = 1e3
FEW = 4
"""Circuits that get pictures of their own; of more, all are drawn together."""

_MARGIN = 1.2  # of a 3D picture over the coil
_ACROSS = 0.09  # height of the side view over its width, heights stretched
_ARROWS_FLAT, _ARROWS = 3, 4  # to a circuit in the plan, to a part in 3D


def coil_picture(geometry: Coil) -> Picture:
    """The coil in its frame, with the direction of positive current; leads are paler."""
    return _plan(geometry) if is_flat(geometry) else _space(geometry)


def _legend(geometry: Coil) -> list[Patch]:
    tracks = [part for circuit in geometry.circuits for part in circuit.parts if isinstance(part, FoilTrack)]
    handles = [Patch(fc=COPPER, ec=EDGE, lw=0.4, label="turns" if tracks else "winding")]
    if any(track.lead_length for track in tracks):
        handles.append(Patch(fc=LEAD, ec=EDGE, lw=0.4, label="leads"))
    return handles


# Flat coils


def _plan(geometry: Coil) -> Picture:
    """From above, and a view along y whose heights are stretched."""
    by_circuit = [
        (circuit.name, [(part, strips(part)) for part in circuit.parts if isinstance(part, FoilTrack)])
        for circuit in geometry.circuits
    ]
    everything = [strip for _, tracks in by_circuit for _, cut in tracks for strip in cut]
    points = np.concatenate([strip.outline for strip in everything])
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    with drawing():
        wide = WIDTH - 0.75
        tall = wide * size[1] / size[0]
        scale = min(1.0, 1.3 * wide / tall)
        drawn = figure(scale * (tall + wide * _ACROSS) + 1.35, scale * wide + 0.75)
        above, beside = drawn.subplots(2, 1, sharex=True, height_ratios=(size[1], size[0] * _ACROSS))
        for _, tracks in by_circuit:
            ordered = sorted(tracks, key=lambda track: _height(track[1]))
            for _, cut in ordered:
                for strip in sorted(cut, key=lambda strip: float(strip.middle[:, 2].mean())):
                    _fill(above, strip.outline[:, :2], strip.lead)
            _plan_arrows(above, ordered[-1][1], float(np.hypot(size[0], size[1])) / len(by_circuit) ** 0.5)
        if len(by_circuit) > 1:
            for name, tracks in by_circuit:
                box = np.concatenate([strip.outline for _, cut in tracks for strip in cut if not strip.lead])
                x, y = (box.min(axis=0) + box.max(axis=0))[:2] / 2 * MILLI
                above.text(x, y, name, ha="center", va="center", fontsize=7.5)
        stretch = _side(beside, by_circuit, size)
        margin = 0.03 * float(size.max())
        above.set(
            xlim=((low[0] - margin) * MILLI, (high[0] + margin) * MILLI),
            ylim=((low[1] - margin) * MILLI, (high[1] + margin) * MILLI),
            aspect="equal",
            ylabel="y (mm)",
        )
        above.tick_params(labelbottom=False)
        beside.set(xlabel="x (mm)", ylabel="z (µm)")
        for axes in (above, beside):
            axes.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]))
        beside.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
        drawn.legend(handles=_legend(geometry), loc="outside upper right", ncols=2, handlelength=1.2)
        content = png(drawn)
    return Picture(
        "device",
        content,
        f"{geometry.name} drawn from above and from the side; arrows show the direction of positive current.",
        "From above, to scale, and from the side, heights stretched "
        f"{stretch:.2g} times. Arrows: positive current. Paler: leads.",
    )


def _height(cut: tuple[Strip, ...]) -> float:
    return max(float(strip.middle[:, 2].mean()) for strip in cut if not strip.lead)


def _fill(axes: Axes, outline: Points, lead: bool, width: float = 0.25) -> None:
    axes.add_patch(
        Polygon(outline * MILLI, closed=True, fc=LEAD if lead else COPPER, ec=EDGE, lw=width, joinstyle="round")
    )


def _plan_arrows(axes: Axes, cut: tuple[Strip, ...], size: float) -> None:
    """Curved arrows over the topmost layer's turns, evenly along the current."""
    turns = np.concatenate([strip.middle for strip in cut if not strip.lead])
    for share in (np.arange(_ARROWS_FLAT) + 0.5) / _ARROWS_FLAT:
        piece = _piece(turns, float(share), 0.13 * size)
        vertices = piece[:, :2] * MILLI
        for colour, line in (("white", 2.6), (INK, 1.3)):
            arrow = FancyArrowPatch(path=Outline(vertices), arrowstyle="-|>", mutation_scale=9)
            arrow.set(fc=colour, ec=colour, lw=line, fill=True)
            arrow.set_capstyle("round")
            axes.add_patch(arrow)


def _piece(line: Points, share: float, wanted: float) -> Points:
    """A piece `wanted` long (m) of a line (n, 3), its middle at `share` of the whole length; (m, 3)."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    middle = share * along[-1]
    first, last = max(middle - wanted / 2, 0.0), min(middle + wanted / 2, along[-1])
    places = np.linspace(first, last, 24)
    return np.stack([np.interp(places, along, line[:, axis]) for axis in range(3)], axis=1)


def _side(axes: Axes, by_circuit: list[tuple[str, list[tuple[FoilTrack, tuple[Strip, ...]]]]], size: Floats) -> float:
    """The heights that metal takes up along x; returns how much they are stretched."""
    low, high = np.inf, -np.inf
    for _, tracks in by_circuit:
        for track, cut in tracks:
            half = track.thickness / 2
            for strip in cut:
                x = np.stack([strip.left[:, 0], strip.right[:, 0]])
                z = strip.middle[:, 2]
                low, high = min(low, float(z.min()) - half), max(high, float(z.max()) + half)
                # Turns are one bar from end to end; of a lead every leg is its own.
                runs = [slice(k, k + 2) for k in range(len(z) - 1)] if strip.lead else [slice(None)]
                colour = LEAD if strip.lead else COPPER
                for run in runs:
                    left, right = x[:, run].min() * MILLI, x[:, run].max() * MILLI
                    bottom, top = (z[run].min() - half) * 1e6, (z[run].max() + half) * 1e6
                    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
                    axes.add_patch(Polygon(corners, fc=colour, ec=colour, lw=0.8))
    room = 0.15 * (high - low)
    axes.set_ylim((low - room) * 1e6, (high + room) * 1e6)
    return float(_ACROSS * size[0] / (high - low + 2 * room))


# All others


def _space(geometry: Coil) -> Picture:
    """In 3D; circuits rolled one inside the other get pictures of their own."""
    apart = 1 < len(geometry.circuits) <= FEW
    groups = [(circuit,) for circuit in geometry.circuits] if apart else [geometry.circuits]
    surfaces = dict(zip([c.name for c in geometry.circuits], pieces(geometry), strict=True))
    reach = max(float(np.linalg.norm(points, axis=1).max()) for quads in surfaces.values() for points, _, _ in quads)
    seen = view(_MARGIN * reach)
    flat = [seen.project(points) for quads in surfaces.values() for points, _, _ in quads]
    aside = min(1.25 * max(float(np.abs(points[:, 0]).max()) for points in flat) + 0.25 * seen.half, seen.half)
    with drawing():
        drawn = figure(min(4.6, 0.85 + (WIDTH / len(groups)) * seen.half / aside))
        for number, circuits in enumerate(groups):

            def fill(plotter: Any, pv: Any, circuits: tuple[Circuit, ...] = circuits) -> None:
                for circuit in circuits:
                    _add_circuit(plotter, pv, circuit, surfaces[circuit.name], seen, reach)

            axes = canvas(drawn.add_subplot(1, len(groups), number + 1), render(fill, seen), seen)
            axes.set_xlim(-aside * MILLI, aside * MILLI)
            scale_bar(axes, seen)
            if number == 0:
                axes_cross(axes, seen)
            if apart:
                axes.text(0.5, 0.99, circuits[0].name, transform=axes.transAxes, ha="center", va="top")
        drawn.legend(handles=_legend(geometry), loc="outside lower right", ncols=2, handlelength=1.0)
        content = png(drawn)
    leads = " Paler: leads." if len(_legend(geometry)) > 1 else ""
    each = " The circuits are drawn one by one; in truth they share the frame." if apart else ""
    return Picture(
        "device",
        content,
        f"{geometry.name} drawn in three dimensions; arrows show the direction of positive current.",
        f"To scale, in its own frame; arrows: positive current.{leads}{each}",
    )


def pieces(geometry: Coil) -> list[list[tuple[Points, Integers, bool]]]:
    """For every circuit pieces of surface: points (n, 3) m, quadrilaterals (q, 4), whether it is a lead."""
    found = []
    for circuit, surface in zip(geometry.circuits, coil_surfaces(geometry), strict=True):
        own: list[tuple[Points, Integers, bool]] = []
        swept = [part for part in circuit.parts if isinstance(part, SweptWinding)]
        for part in swept:
            own += [(*_grid(face), False) for face in swept_lattices(part, 1.0)]
        if not swept:
            for lead in (False, True):
                nodes = surface.nodes[surface.lead.astype(bool) == lead]
                if len(nodes):
                    own.append((*_patches(nodes), lead))
        found.append(own)
    return found


def _grid(lattice: Points) -> tuple[Points, Integers]:
    """A lattice (n, m, 3) as quadrilaterals."""
    n, m = lattice.shape[:2]
    number = np.arange(n * m).reshape(n, m)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    return lattice.reshape(-1, 3), cells.reshape(-1, 4)


def _patches(nodes: Floats) -> tuple[Points, Integers]:
    """Biquadratic patches (p, 9, 3) as quadrilaterals, six along and two across each."""
    u = np.linspace(0.0, 1.0, 7)
    shapes = np.stack([(1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1)], axis=1)
    fine = np.einsum("sa,pabi->psbi", shapes, nodes.reshape(-1, 3, 3, 3))
    number = np.arange(fine[..., 0].size).reshape(fine.shape[:3])
    cells = np.stack([number[:, :-1, :-1], number[:, 1:, :-1], number[:, 1:, 1:], number[:, :-1, 1:]], axis=-1)
    return fine.reshape(-1, 3), cells.reshape(-1, 4)


def _add_circuit(
    plotter: Any,
    pv: Any,
    circuit: Circuit,
    surfaces: list[tuple[Points, Integers, bool]],
    seen: View,
    reach: float,
) -> None:
    for points, cells, lead in surfaces:
        _, first, number = np.unique(np.rint(points / (1e-6 * reach)), axis=0, return_index=True, return_inverse=True)
        faces = np.column_stack([np.full(len(cells), 4), number.reshape(-1)[cells]]).ravel()
        shell = pv.PolyData(points[first], faces)
        plotter.add_mesh(
            shell,
            color=LEAD if lead else COPPER,
            smooth_shading=True,
            split_sharp_edges=True,
            feature_angle=35,
            ambient=0.62,
            diffuse=0.62,
            specular=0.25,
            specular_power=18,
        )
        edges = shell.extract_feature_edges(35, manifold_edges=False, non_manifold_edges=False)
        if edges.n_points:
            plotter.add_mesh(edges, color=EDGE, line_width=1.5, lighting=False)
    wound = any(isinstance(part, CoaxialWinding | SweptWinding) for part in circuit.parts)
    for path in paths(circuit):
        for piece in _visible_pieces(path, seen, reach, wound):
            _add_arrow(plotter, pv, piece, reach * 0.012 if wound else min(0.3 * path.width, reach * 0.012))


def _visible_pieces(path: Path, seen: View, reach: float, wound: bool) -> list[Points]:
    """Pieces of the path that face the eye and are spread over it, a little off the surface."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path.points, axis=0), axis=1))])
    facing = path.outward @ seen.towards
    wanted = min(0.45 * reach, along[-1] / 8)
    off = reach * 0.015 if wound else 0.4 * path.width
    line = path.points + off * path.outward
    chosen: list[float] = []
    count = _ARROWS if wound else 3 * _ARROWS
    for place in np.linspace(0.0, along[-1], 16 * count, endpoint=False) + along[-1] / (32 * count):
        near = np.abs(along - place) <= wanted / 2
        apart = not chosen or place - chosen[-1] > 1.5 * wanted
        if apart and near.any() and facing[near].min() > (0.35 if wound else 0.5):
            chosen.append(float(place))
    kept = chosen[:: max(1, -(-len(chosen) // count))]
    return [_piece(line, place / along[-1], wanted) for place in kept]


def _add_arrow(plotter: Any, pv: Any, piece: Points, radius: float) -> None:
    """A tube along a piece of path, and a cone at its end."""
    head = 7 * radius
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(piece, axis=0), axis=1))])
    shaft = piece[along <= max(along[-1] - head, along[1])]
    tip, base = piece[-1], shaft[-1]
    direction = tip - base
    shapes = [
        pv.Cone(center=(tip + base) / 2, direction=direction, height=np.linalg.norm(direction), radius=3 * radius)
    ]
    if len(shaft) > 1:
        shapes.append(pv.lines_from_points(shaft).tube(radius=radius, n_sides=16))
    for shape in shapes:
        plotter.add_mesh(shape, color=INK, ambient=0.5, diffuse=0.5, smooth_shading=False)
