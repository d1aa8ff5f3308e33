"""Meshes of the half section, drawn flat; cuts through 3D meshes are in `report.scenes`."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from magfem.mesh.mesh import Mesh
from magfem.report.figures.style import INK, SKY, Picture, drawing, figure, png

MILLI = 1e3


def meridian_figures(mesh: Mesh) -> tuple[Picture, Picture]:
    """The whole mesh of the half section, and its finest corner."""
    magnet = mesh.points[np.unique(mesh.cells[mesh.body >= 0])]
    corner = magnet[np.argmax(magnet @ np.array([1.0, 1.0]))]
    close = 0.35 * float(np.ptp(magnet[:, 1]))
    whole = (0.0, mesh.radius * 1.02), (-mesh.radius * 1.02, mesh.radius * 1.02)
    zoom = (corner[0] - close, corner[0] + 0.6 * close), (corner[1] - close, corner[1] + 0.6 * close)
    count = f"{len(mesh.cells)} triangles with curved edges"
    return (
        _draw(mesh, whole, "mesh", f"Mesh of the half section: {count}.", f"The mesh of the half section: {count}."),
        _draw(
            mesh,
            zoom,
            "mesh_corner",
            "The same mesh near the rim of the body.",
            "The same near a rim, where the field is singular and the elements are smallest.",
        ),
    )


def _draw(
    mesh: Mesh, window: tuple[tuple[float, float], tuple[float, float]], name: str, alt: str, caption: str
) -> Picture:
    corners = mesh.points[mesh.cells[:, [0, 3, 1, 4, 2, 5]]] * MILLI
    with drawing():
        drawn = figure(4.4)
        axes = drawn.add_subplot()
        for body, colour in ((False, "#ffffff"), (True, SKY)):
            chosen = corners[(mesh.body >= 0) == body]
            axes.add_collection(
                PolyCollection(list(chosen), facecolors=colour, edgecolors=INK, linewidths=0.35, antialiaseds=True)
            )
        (left, right), (bottom, top) = window
        axes.set(
            xlim=(left * MILLI, right * MILLI),
            ylim=(bottom * MILLI, top * MILLI),
            xlabel="ρ (mm)",
            ylabel="z (mm)",
            aspect="equal",
        )
        handles = [
            Patch(facecolor=SKY, edgecolor=INK, label="magnet"),
            Patch(facecolor="white", edgecolor=INK, label="air"),
        ]
        drawn.legend(handles=handles, loc="outside upper right", ncols=2, handlelength=1.2)
        content = png(drawn)
    return Picture(name, content, alt, caption)
