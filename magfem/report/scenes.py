"""Pictures in 3D: the device with its poles, moment and dimensions, and cuts through 3D meshes.

VTK draws the bodies in parallel projection, off screen; lines and letters are drawn over its image, so they look
like those of all other figures and lengths in the picture are true to scale.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Patch

from magfem.constants import MU_0
from magfem.errors import MissingProgramError
from magfem.fields.hull import CylinderHull
from magfem.geometry import Magnets
from magfem.mesh.mesh import Mesh
from magfem.report.figures.style import GREY, INK, NORTH, SKY, SOUTH, Picture, drawing, figure, length, png
from magfem.report.surface import Surface
from magfem.typing import Floats, Points

MILLI = 1e3
_AZIMUTH, _ELEVATION = np.radians(-62.0), np.radians(24.0)  # of the eye
_PIXELS = 1200
_CANCELLED = 1e-3  # of the sum of the bodies' moments: a total below is none


@dataclass(frozen=True)
class View:
    """A square parallel projection of space. half: m, half the picture's side."""

    right: Floats  # (3,) unit vectors
    up: Floats
    towards: Floats  # the eye
    half: float
    centre: Floats = field(default_factory=lambda: np.zeros(3))  # m, what the picture's middle shows

    def project(self, points: Points) -> Floats:
        """Points (..., 3) m to picture coordinates (..., 2) m, the origin in the middle."""
        offset = points - self.centre
        return np.stack([offset @ self.right, offset @ self.up], axis=-1)


def view(half: float) -> View:
    """The view that all 3D pictures share."""
    a, e = _AZIMUTH, _ELEVATION
    towards = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return View(right, np.cross(towards, right), towards, half)


def device_picture(geometry: Magnets, surfaces: tuple[Surface, ...]) -> Picture:
    """The device in its frame: north and south poles, magnetisations, moment, dimensions."""
    many = len(surfaces) > 1
    reach = max(float(np.linalg.norm(surface.points, axis=1).max()) for surface in surfaces)
    seen = view(1.62 * reach)
    image = render(lambda plotter, pv: _add_device(plotter, pv, geometry, surfaces, reach), seen)
    with drawing():
        drawn = figure(4.6)
        axes = canvas(drawn.add_subplot(), image, seen)
        _dimension_lines(axes, geometry, seen, surfaces)
        if _has_moment(geometry):
            _moment_label(axes, geometry, seen, reach)
        if many:
            _magnetisations(axes, geometry, seen, surfaces)
        axes_cross(axes, seen)
        handles = [Patch(color=NORTH, label="north pole"), Patch(color=SOUTH, label="south pole")]
        drawn.legend(handles=handles, loc="outside lower right", ncols=2, handlelength=1.0)
        content = png(drawn)
    poles = "the north poles are red, the south poles blue" if many else "the north pole is red, the south pole blue"
    arrows = ["white arrows show how each magnet is magnetised"] if many else []
    arrows += ["the arrow m is the direction of the magnetic moment"] if _has_moment(geometry) else []
    return Picture(
        "device",
        content,
        f"{geometry.name} drawn in three dimensions; {poles}; {'; '.join(arrows)}.",
        f"To scale, in its own frame; {'; '.join(arrows)}.",
    )


def _has_moment(geometry: Magnets) -> bool:
    """Whether the magnets' moments do not cancel."""
    total = sum(float(np.linalg.norm(b.material.remanence_vector)) * b.volume for b in geometry.bodies) / MU_0
    return float(np.linalg.norm(geometry.moment)) > _CANCELLED * total


def _magnetisations(axes: Axes, geometry: Magnets, seen: View, surfaces: tuple[Surface, ...]) -> None:
    """An arrow over the middle of every body, along its magnetisation."""
    materials = {body.name: body.material for body in geometry.bodies}
    for surface in surfaces:
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        direction = unit(np.array(materials[surface.name].magnetisation, dtype=float))
        spread = surface.points @ direction
        half = 0.32 * float(np.ptp(spread)) * direction
        middle = (low + high) / 2
        start, end = (tuple((seen.project(middle + side * half) * MILLI).tolist()) for side in (-1, 1))
        for colour, width in ((INK, 3.6), ("white", 1.8)):
            arrow = FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=9, shrinkA=0, shrinkB=0)
            arrow.set(color=colour, linewidth=width)
            axes.add_patch(arrow)


def mesh_pictures(mesh: Mesh) -> tuple[Picture, Picture]:
    """A 3D mesh cut open along the plane y = 0: all of it, and near a rim of the device."""
    count = f"{len(mesh.cells)} tetrahedra with curved faces"
    magnet = mesh.points[np.unique(mesh.cells[mesh.body >= 0])]
    rim = magnet[np.argmax(magnet @ np.array([1.0, 0.0, 1.0]))]
    whole = _front(1.04 * mesh.radius, np.zeros(3))
    close = _front(0.35 * float(np.ptp(magnet, axis=0).min()), np.array([rim[0], 0.0, rim[2]]))
    return (
        _mesh_picture(mesh, "mesh", whole, f"The mesh, cut open at y = 0: {count}."),
        _mesh_picture(
            mesh, "mesh_rim", close, "The same near a rim, where the field is singular and the elements are smallest."
        ),
    )


def _front(half: float, centre: Floats) -> View:
    """Straight onto the xz plane."""
    x, y, z = np.eye(3)
    return View(x, z, -y, half, centre)


def _mesh_picture(mesh: Mesh, name: str, seen: View, caption: str) -> Picture:
    image = render(lambda plotter, pv: _add_cut(plotter, pv, mesh), seen)
    x, _, z = seen.centre * MILLI
    half = seen.half * MILLI
    with drawing():
        drawn = figure(4.4)
        axes = drawn.add_subplot()
        axes.imshow(image, extent=(x - half, x + half, z - half, z + half), interpolation="lanczos")
        axes.set(xlabel="x (mm)", ylabel="z (mm)")
        handles = [Patch(fc=SKY, ec=INK, label="magnet"), Patch(fc="white", ec=INK, label="air")]
        drawn.legend(handles=handles, loc="outside upper right", ncols=2, handlelength=1.2)
        return Picture(name, png(drawn), f"Mesh of {len(mesh.cells)} tetrahedra, cut open at y = 0.", caption)


def render(fill: Callable[[Any, Any], None], seen: View) -> Any:
    """Draw with VTK what `fill(plotter, pyvista)` adds; an image (n, n, 3) uint8."""
    pv = _pyvista()
    plotter = pv.Plotter(off_screen=True, window_size=(_PIXELS, _PIXELS), lighting="none")
    try:
        plotter.set_background("white")
        fill(plotter, pv)
        far = 4 * max(seen.half, *map(abs, plotter.bounds))
        for direction, strength in (
            (1.0 * seen.towards + 0.9 * seen.up - 0.6 * seen.right, 0.75),
            (1.0 * seen.towards - 0.2 * seen.up + 0.9 * seen.right, 0.3),
        ):
            plotter.add_light(pv.Light(position=tuple(direction), intensity=strength, light_type="scene light"))
        plotter.enable_parallel_projection()
        plotter.camera.position = tuple(seen.centre + far * seen.towards)
        plotter.camera.focal_point = tuple(seen.centre)
        plotter.camera.up = tuple(seen.up)
        plotter.camera.parallel_scale = seen.half
        plotter.camera.clipping_range = (0.01 * far, 2 * far)
        plotter.enable_anti_aliasing("ssaa")
        image = plotter.screenshot(None, return_img=True)
    finally:
        plotter.close()
    if np.ptp(image) == 0:
        raise _cannot_render("VTK draws an empty picture")
    return image


def _pyvista() -> Any:
    """PyVista, imported only where its shared libraries are: VTK ends the whole process without them."""
    if sys.platform == "linux":
        if not os.environ.get("DISPLAY"):
            os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        for library in ("libX11.so.6", "libXrender.so.1", "libGL.so.1", "libEGL.so.1"):
            try:
                ctypes.CDLL(library)
            except OSError:
                raise _cannot_render(f"{library} is missing") from None
    try:
        import pyvista
    except ImportError as error:
        raise _cannot_render(str(error)) from None
    return pyvista


def _cannot_render(reason: str) -> MissingProgramError:
    return MissingProgramError(
        f"pictures in 3D cannot be drawn ({reason}); on Debian and Ubuntu type: apt-get install libegl1 "
        "libegl-mesa0 libgl1 libgl1-mesa-dri libx11-6 libxrender1"
    )


def _add_device(plotter: Any, pv: Any, geometry: Magnets, surfaces: tuple[Surface, ...], reach: float) -> None:
    materials = {body.name: body.material for body in geometry.bodies}
    for surface in surfaces:
        shell = _polydata(pv, surface)
        north = np.array(materials[surface.name].magnetisation)
        middle = (surface.points.max(axis=0) + surface.points.min(axis=0)) / 2
        for colour, normal in ((NORTH, -north), (SOUTH, north)):
            half = shell.clip(normal=tuple(normal), origin=tuple(middle)).extract_surface(algorithm="dataset_surface")
            plotter.add_mesh(
                half,
                color=colour,
                smooth_shading=True,
                split_sharp_edges=True,
                feature_angle=35,
                ambient=0.5,
                diffuse=0.62,
                specular=0.12,
                specular_power=12,
            )
        edges = shell.extract_feature_edges(35, boundary_edges=False, manifold_edges=False, non_manifold_edges=False)
        if edges.n_points:  # a ball has none
            plotter.add_mesh(edges, color="#2a2f34", line_width=3, lighting=False)
    if not _has_moment(geometry):
        return
    start, size = _arrow(geometry, reach)
    plotter.add_mesh(
        pv.Arrow(
            start=tuple(start),
            direction=tuple(unit(geometry.moment)),
            scale=size,
            shaft_radius=0.025,
            tip_radius=0.07,
            tip_length=0.22,
            shaft_resolution=48,
            tip_resolution=48,
        ),
        color=INK,
        ambient=0.35,
        diffuse=0.7,
        smooth_shading=True,
        split_sharp_edges=True,
    )


def _arrow(geometry: Magnets, reach: float) -> tuple[Floats, float]:
    """Where the moment's arrow starts, and its length: from inside the device to well outside."""
    return -0.15 * reach * unit(geometry.moment), 1.6 * reach


def unit(vector: Floats) -> Floats:
    """The direction of a vector (3,)."""
    return vector / np.linalg.norm(vector)


def _polydata(pv: Any, surface: Surface) -> Any:
    faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles])
    return pv.PolyData(surface.points, faces.ravel())


def _add_cut(plotter: Any, pv: Any, mesh: Mesh) -> None:
    corners = mesh.cells[:, :4]
    middle = mesh.points[corners].mean(axis=1)
    for body, colour in ((False, "#fbfcfd"), (True, SKY)):
        chosen = corners[((mesh.body >= 0) == body) & (middle[:, 1] > 0)]
        cells = np.column_stack([np.full(len(chosen), 4), chosen])
        solid = pv.UnstructuredGrid(cells.ravel(), np.full(len(chosen), pv.CellType.TETRA), mesh.points)
        plotter.add_mesh(
            solid, color=colour, show_edges=True, edge_color="#3a4046", line_width=2.2, ambient=0.7, diffuse=0.35
        )


def canvas(axes: Axes, image: Any, seen: View) -> Axes:
    """The rendered image with axes in mm of picture coordinates, not shown."""
    limit = seen.half * MILLI
    axes.imshow(image, extent=(-limit, limit, -limit, limit), interpolation="lanczos")
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit))
    axes.set_axis_off()
    return axes


def _dimension_lines(axes: Axes, geometry: Magnets, seen: View, surfaces: tuple[Surface, ...]) -> None:
    """The dimensions of a tube or cylinder, as on a drawing; a scale bar for everything else."""
    lengths = {key: getattr(geometry, key) for key in geometry.dimensions}
    outer = lengths.get("outer_diameter", lengths.get("diameter"))
    gap = 0.1 * seen.half * MILLI
    if outer is None or "length" not in lengths or geometry.hull != CylinderHull(outer, lengths["length"]):
        scale_bar(axes, seen)
        return
    half = lengths["length"] / 2
    flat = np.concatenate([seen.project(surface.points) for surface in surfaces]) * MILLI
    # Across: the silhouette of the wall, which parallel projection shows in true length.
    left, right = (seen.project(side * outer / 2 * seen.right - [0, 0, half]) * MILLI for side in (-1, 1))
    low = flat[:, 1].min() - gap
    _dimension(axes, (left[0], low), (right[0], low), f"⌀ {length(outer)}", shift=(0, -5))
    for x, y in (left, right):
        axes.plot([x, x], [y - 0.2 * gap, low - 0.3 * gap], color=GREY, linewidth=0.7)
    # Along: beside the silhouette, where the moment's arrow is not; foreshortened by the view's elevation.
    way = -1 if geometry.moment @ seen.right > 0.1 * np.linalg.norm(geometry.moment) else 1
    bottom, top = (seen.project(way * outer / 2 * seen.right + [0, 0, side * half]) * MILLI for side in (-1, 1))
    beside = bottom[0] + way * gap
    text = length(lengths["length"])
    _dimension(axes, (beside, bottom[1]), (beside, top[1]), text, shift=(5 * way, 0))
    for x, y in (bottom, top):
        axes.plot([x + way * 0.2 * gap, beside + way * 0.3 * gap], [y, y], color=GREY, linewidth=0.7)
    if lengths.get("inner_diameter"):
        inner = lengths["inner_diameter"]
        ends = [seen.project(side * inner / 2 * seen.right + [0, 0, half]) * MILLI for side in (-1, 1)]
        high = flat[:, 1].max() + gap
        _dimension(axes, (ends[0][0], high), (ends[1][0], high), "")
        axes.text(ends[0][0] - 0.4 * gap, high, f"⌀ {length(inner)}", ha="right", va="center")
        for x, y in ends:
            axes.plot([x, x], [y, high + 0.3 * gap], color=GREY, linewidth=0.7)


def _dimension(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    text: str,
    shift: tuple[float, float] = (0, 0),
) -> None:
    """A line with arrow heads at both ends, and its text `shift` points beside its middle."""
    arrow = FancyArrowPatch(start, end, arrowstyle="<|-|>", mutation_scale=7, shrinkA=0, shrinkB=0)
    arrow.set(color=INK, linewidth=0.8)
    axes.add_patch(arrow)
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    axes.annotate(
        text,
        middle,
        shift,
        textcoords="offset points",
        annotation_clip=False,
        ha="left" if shift[0] > 0 else "right" if shift[0] < 0 else "center",
        va="top" if shift[1] < 0 else "center",
    )


def scale_bar(axes: Axes, seen: View) -> None:
    """A length to measure by, below the device."""
    limit = seen.half * MILLI
    size = max(s for p in range(-3, 4) for s in (10.0**p, 2 * 10.0**p, 5 * 10.0**p) if s <= 0.6 * limit)
    axes.plot([-size / 2, size / 2], [-0.96 * limit] * 2, color=INK, linewidth=2.5, solid_capstyle="butt")
    axes.text(size / 2 + 0.03 * limit, -0.96 * limit, length(size / MILLI), ha="left", va="center")


def _moment_label(axes: Axes, geometry: Magnets, seen: View, reach: float) -> None:
    start, size = _arrow(geometry, reach)
    x, y = seen.project(start + 1.04 * size * unit(geometry.moment)) * MILLI
    axes.annotate("m", (x, y), (4, 2), textcoords="offset points", fontstyle="italic", fontweight="bold")


def axes_cross(axes: Axes, seen: View) -> None:
    """The directions of x, y and z in the lower left corner."""
    limit = seen.half * MILLI
    origin = np.array([axes.get_xlim()[0] + 0.18 * limit, -0.8 * limit])
    for name, unit in zip("xyz", np.eye(3), strict=True):
        tip = origin + 0.2 * limit * seen.project(unit)
        axes.add_patch(
            FancyArrowPatch(
                tuple(origin),
                tuple(tip),
                arrowstyle="-|>",
                mutation_scale=6,
                color=GREY,
                linewidth=0.9,
                shrinkA=0,
                shrinkB=0,
            )
        )
        x, y = origin + 0.26 * limit * seen.project(unit)
        axes.text(x, y, name, color=GREY, ha="center", va="center", fontstyle="italic")
