"""Where the current of 1 A crowds in a foil that conduction was solved in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize

from magfem.fem.sheet_currents import SheetCurrents
from magfem.geometry import Circuit, FoilTrack
from magfem.report.figures.style import Picture, drawing, figure, png
from magfem.typing import Booleans, Floats, Points

MILLI = 1e3
_FINE = 2  # cells to each half of a patch
_CLOSE = 9.0  # track widths, half the side of the close view
_MAP = "YlOrRd"


@dataclass(frozen=True)
class DensityMap:
    """Cells of a foil laid flat: corners (c, 4, 2) m, current density at the middles (c,) A/m² per ampere.

    width: of the track, m.
    """

    corners: Floats
    density: Floats
    width: float
    rolled: bool


def density_map(circuit: Circuit, sheets: SheetCurrents) -> DensityMap | None:
    """Of the turns of a foil circuit, leads apart; None when it is not of foil or was not solved as a sheet.

    Several sheets stand for each foil's thickness, each with its share of the current: the uppermost is taken.
    """
    tracks = [part for part in circuit.parts if isinstance(part, FoilTrack)]
    if not sheets.count or len(tracks) < len(circuit.parts):
        return None
    track = tracks[-1]
    rolled = track.curvature != 0
    level = _level(sheets.nodes, rolled)
    turns = _turns(track, level, rolled)
    nodes, stream = sheets.nodes[turns], sheets.stream[turns]
    if not len(nodes):
        return None
    u = np.linspace(0.0, 1.0, 2 * _FINE + 1)
    shapes = _quadratic(u)
    places = np.einsum("sa,tb,pabi->psti", shapes, shapes, nodes.reshape(-1, 3, 3, 3))
    flat = _flat(places, rolled)
    corners = np.stack([flat[:, :-1, :-1], flat[:, 1:, :-1], flat[:, 1:, 1:], flat[:, :-1, 1:]], axis=3).reshape(
        -1, 4, 2
    )
    middle = 0.5 * (u[1:] + u[:-1])
    share = float(np.ptp(stream))  # of 1 A: ψ runs from 0 to it across the sheet
    density = _sheet_current(nodes, stream, middle).reshape(-1) / (share * track.thickness)
    return DensityMap(corners, density, track.width, rolled)


def density_figures(found: DensityMap, name: str) -> tuple[Picture, Picture]:
    """The whole foil, and a close view of the place where the density is largest; A/mm² at 1 A."""
    density = found.density * 1e-6
    corners = found.corners * MILLI
    middles = corners.mean(axis=1)
    worst = middles[int(np.argmax(density))]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    close = _CLOSE * found.width * MILLI / 2
    mean = float(np.median(density))
    near = (np.abs(middles - worst) < 1.3 * close).all(axis=1)
    laid = ", unrolled" if found.rolled else ""
    pictures = []
    everything = np.ones(len(density), dtype=bool)
    for key, chosen, (left, right), (bottom, top), words in (
        ("current", everything, (low[0], high[0]), (low[1], high[1]), f"Current density at 1 A{laid}."),
        (
            "current_close",
            near,
            (worst[0] - close, worst[0] + close),
            (worst[1] - close, worst[1] + close),
            "The same around its largest value; colours stop at twice the usual density.",
        ),
    ):
        with drawing():
            drawn = figure(3.9)
            axes = drawn.add_subplot()
            image = _cells(axes, corners[chosen], density[chosen], mean, float(density.max()))
            margin = 0.02 * max(right - left, top - bottom)
            axes.set(
                xlim=(left - margin, right + margin),
                ylim=(bottom - margin, top + margin),
                aspect="equal",
                xlabel="around (mm)" if found.rolled else "x (mm)",
                ylabel="z (mm)" if found.rolled else "y (mm)",
            )
            axes.set_title("current density at 1 A (A/mm²)", loc="left")
            drawn.colorbar(image, ax=axes, shrink=0.85)
            content = png(drawn)
        pictures.append(Picture(f"{key}_{name}", content, f"Map of the current density in {name}{laid}.", words))
    return pictures[0], pictures[1]


def _cells(axes: Axes, corners: Floats, density: Floats, mean: float, top: float) -> PolyCollection:
    cells = PolyCollection(list(corners), array=density, cmap=_MAP, norm=Normalize(0.5 * mean, min(top, 2.0 * mean)))
    cells.set_edgecolor("face")
    cells.set_linewidth(0.2)
    axes.add_collection(cells)
    return cells


def _quadratic(u: Floats) -> Floats:
    return np.stack([(1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1)], axis=1)


def _sheet_current(nodes: Floats, stream: Floats, u: Floats) -> Floats:
    """|K| (p, s, t) A/m at places u × u of biquadratic patches: |x_u ψ_v − x_v ψ_u| / |x_u × x_v|."""
    value = _quadratic(u)
    slope = np.stack([4 * u - 3, 4 - 8 * u, 4 * u - 1], axis=1)
    x, psi = nodes.reshape(-1, 3, 3, 3), stream.reshape(-1, 3, 3)
    xu, xv = (np.einsum("sa,tb,pabi->psti", *pair, x) for pair in ((slope, value), (value, slope)))
    pu, pv = (np.einsum("sa,tb,pab->pst", *pair, psi)[..., None] for pair in ((slope, value), (value, slope)))
    size: Floats = np.linalg.norm(xu * pv - xv * pu, axis=-1) / np.linalg.norm(np.cross(xu, xv), axis=-1)
    return size


def _level(nodes: Floats, rolled: bool) -> Floats:
    """Height, or radius, of every node (p, 9) m."""
    level: Floats = np.hypot(nodes[..., 0], nodes[..., 1]) if rolled else nodes[..., 2]
    return level


def _turns(track: FoilTrack, level: Floats, rolled: bool) -> Booleans:
    """Which patches belong to the turns of a track: those of the uppermost (outermost) sheet in its foil."""
    stations = track.stations(0.5)
    middle = 0.5 * (stations.left + stations.right)[1::2][~stations.lead]
    own = float(np.median(_level(middle, rolled)))
    inside: Booleans = np.all((level > own) & (level < own + 0.5 * track.thickness), axis=1)
    if not inside.any():
        return inside
    height = np.median(level, axis=1) - own
    top: Booleans = inside & (height > height[inside].max() - 0.05 * track.thickness)
    return top


def _flat(places: Points, rolled: bool) -> Floats:
    """Places (..., 3) of a flat foil, or of one rolled about z, in its plane (..., 2) m."""
    if not rolled:
        return places[..., :2]
    angle = np.arctan2(places[..., 1], places[..., 0])
    # The foil does not close: cut it where its cells leave the largest gap.
    order = np.sort(angle.ravel())
    gap = np.diff(np.append(order, order[0] + 2 * np.pi))
    seam = order[int(np.argmax(gap))] + 0.5 * float(gap.max())
    turned = (angle - seam) % (2 * np.pi)
    radius = float(np.hypot(places[..., 0], places[..., 1]).mean())
    middle = 0.5 * (turned.min() + turned.max())
    return np.stack([radius * (turned - middle), places[..., 2]], axis=-1)
