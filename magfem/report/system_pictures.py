"""Pictures of coil systems: where coils and joints are, and maps of what the system can do in its workspace."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from magfem.actuation import CoilSystem, WorkspaceMap, workspace_map
from magfem.actuation.joints import Joints
from magfem.errors import InputError
from magfem.fields.region_parts import bounding_box
from magfem.fields.workspace_region import Ball, Box
from magfem.report.figures.cuts import Cut, cuts, draw_region, frame_cut
from magfem.report.figures.region_fields import map_axes
from magfem.report.figures.style import (
    BLUE,
    ERROR,
    GREEN,
    GREY,
    INK,
    MAGNITUDE,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    YELLOW,
    Picture,
    drawing,
    figure,
    png,
)
from magfem.report.scenes import MILLI, View, axes_cross, scale_bar, view
from magfem.typing import ArrayLike, Floats, Points

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW)  # of joints and the coils they carry
_ROUND = np.linspace(0, 2 * np.pi, 73)
_DISC = 0.22  # of a coil's distance from the middle: the radius of its sign
_TILES = 60  # of a map, along its longer side

Quantity: TypeAlias = Literal["field_everywhere", "field_best", "force_everywhere", "force_best", "condition"]
WORDS: dict[Quantity, str] = {
    "field_everywhere": "|B| in the worst direction (mT)",
    "field_best": "|B| in the best direction (mT)",
    "force_everywhere": "force in the worst direction (mN)",
    "force_best": "force in the best direction (mN)",
    "condition": "condition of field and gradient",
}
"""What `workspace_picture` can show, and how it is labelled."""


def system_picture(system: CoilSystem, joints: ArrayLike | None = None) -> Picture:
    """The system from aside: coils as rings with their axes, joints' axes dashed, the workspace.

    A ring stands at the origin of its coil's model; its size says nothing, for a model does not know it. Coils whose
    models have their origin within the workspace, as calibrated ones do, are left out.
    """
    fixed = system.fixed(joints)
    middle, inner = _middle(system)
    places = np.array([coil.pose.translation for coil in fixed.coils]).reshape(-1, 3)
    reach = max(float(np.linalg.norm(places - middle, axis=1).max(initial=0.0)), inner, 1e-3)
    seen = view(1.45 * reach)
    seen = View(seen.right, seen.up, seen.towards, seen.half, middle)
    bounded = isinstance(system.workspace, Ball | Box)
    carriers = [coil.joint for coil in system.coils]
    colours = {joint.name: _COLOURS[k % len(_COLOURS)] for k, joint in enumerate(system.joints)}
    with drawing():
        drawn = figure(4.6)
        axes = drawn.add_subplot()
        limit = seen.half * MILLI
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
        axes.set_axis_off()
        _workspace(axes, system, seen)
        for k in np.argsort(places @ seen.towards):  # the farther ones first
            coil, carrier = fixed.coils[k], carriers[k]
            if bounded and system.workspace.contains(places[k]):
                continue  # a calibrated coil: known by its field in the workspace, not by its place
            colour = INK if carrier is None else colours[carrier]
            _coil(axes, seen, places[k], coil.pose.rotation.as_matrix(), reach, colour, coil.name)
        _joint_axes(axes, system, joints, seen, reach, colours)
        axes_cross(axes, seen)
        scale_bar(axes, seen)
        handles = [Line2D([], [], color=colours[joint.name], label=joint.name) for joint in system.joints]
        if None in carriers and system.joints:
            handles.append(Line2D([], [], color=INK, label="fixed"))
        if handles:
            drawn.legend(handles=handles, loc="outside upper right", ncols=3, handlelength=1.0)
        content = png(drawn)
    moving = f", {len(system.joints)} joints whose axes are dashed" if system.joints else ""
    caption = "Rings stand where the coils' models have their origin, arrows along their axes; their size is a sign."
    return Picture("system", content, f"{system.name}: {len(system.coils)} coils around a workspace{moving}.", caption)


def workspace_picture(
    system: CoilSystem,
    what: Quantity = "field_everywhere",
    joints: ArrayLike | None = None,
    moment: ArrayLike | None = None,
    limits: ArrayLike | None = None,
    plane: int = 0,
) -> Picture:
    """A map of what the system can do in a plane through its workspace: 0 the xz plane, 1 the yz plane.

    what: a key of `WORDS`; forces need a `moment` (3,) A·m². The others as in `workspace_map`. Raises InputError for a
    system without a workspace that is a ball or a box.
    """
    if what not in WORDS:
        raise InputError(f"what must be one of {', '.join(WORDS)}, got {what!r}")
    if not isinstance(system.workspace, Ball | Box):
        raise InputError(f"{system.name} states no workspace, a ball or a box, to draw a map of")
    if what.startswith("force") and moment is None:
        raise InputError("a map of forces needs the moment of the magnet")
    if plane not in (0, 1):
        raise InputError(f"plane must be 0 (xz) or 1 (yz), got {plane!r}")
    cut = cuts(system.workspace)[plane]
    horizontal, vertical, points = cut.points(_TILES)
    found = workspace_map(system, points, joints, moment, limits=limits)
    return _map(system, found, what, cut, horizontal, vertical)


def _map(
    system: CoilSystem, found: WorkspaceMap, what: Quantity, cut: Cut, horizontal: Floats, vertical: Floats
) -> Picture:
    values = np.array(getattr(found, what), dtype=float)
    if what != "condition":
        values = values * MILLI
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(f"nothing is finite in the {cut.words} of {system.name}'s workspace")
    low, high = float(known.min()), float(known.max())
    norm = LogNorm(low, high) if low > 0 and high > 5 * low else Normalize(low, high)
    assert isinstance(system.workspace, Ball | Box)
    with drawing():
        drawn, axes, beside = map_axes(cut)
        colours = ERROR if what == "condition" else MAGNITUDE
        image = axes.pcolormesh(
            horizontal * MILLI, vertical * MILLI, values, norm=norm, cmap=colours, rasterized=True, shading="nearest"
        )
        draw_region(axes, system.workspace, cut)
        frame_cut(axes, cut)
        drawn.colorbar(image, cax=beside)
        beside.set_title("")
        axes.set_title(WORDS[what], loc="left")
        content = png(drawn)
    shown = f"{low:.3g} to {high:.3g}"
    return Picture(
        what,
        content,
        f"{WORDS[what]} in the {cut.words} of {system.name}'s workspace, {shown}.",
        f"{WORDS[what]}, {cut.words}, within the current limits.",
    )


def _middle(system: CoilSystem) -> tuple[Floats, float]:
    """The workspace's middle, or the coils' when there is none, and its reach from there."""
    if isinstance(system.workspace, Ball | Box):
        low, high = bounding_box(system.workspace)
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    places = [coil.pose.translation for coil in system.coils]
    return np.mean(places, axis=0) if places else np.zeros(3), 0.0


def _workspace(axes: Axes, system: CoilSystem, seen: View) -> None:
    region = system.workspace
    if isinstance(region, Ball):
        for normal in (seen.towards, np.array([0.0, 0.0, 1.0])):  # its outline and its equator
            ring = _ring(np.array(region.centre), normal, region.radius)
            _line(axes, seen, ring, color=GREY, linewidth=0.8)
    elif isinstance(region, Box):
        low, high = np.array(region.low), np.array(region.high)
        for axis in range(3):
            for one in (0, 1):
                for other in (0, 1):
                    ends = np.array([low, high])
                    first, second = [k for k in range(3) if k != axis]
                    ends[:, first], ends[:, second] = (low, high)[one][first], (low, high)[other][second]
                    _line(axes, seen, ends, color=GREY, linewidth=0.8)


def _coil(axes: Axes, seen: View, place: Floats, frame: Floats, reach: float, colour: str, name: str) -> None:
    """A ring, pale inside, the arrow of positive flux, and the name outside."""
    radius = _DISC * reach
    ring = seen.project(_ring(place, frame[:, 2], radius)) * MILLI
    axes.fill(*ring.T, color=PALE, alpha=0.6, linewidth=0)
    axes.plot(*ring.T, color=colour, linewidth=2.2)
    ends = [tuple(each) for each in (seen.project(np.array([place, place + 1.1 * radius * frame[:, 2]])) * MILLI)]
    arrow = FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=8, shrinkA=0, shrinkB=0)
    arrow.set(color=colour, linewidth=1.2)
    axes.add_patch(arrow)
    x, y = seen.project(place - 0.8 * radius * frame[:, 2]) * MILLI
    axes.text(x, y, name, ha="center", va="center", fontweight="bold", color=INK)


def _joint_axes(
    axes: Axes, system: CoilSystem, joints: ArrayLike | None, seen: View, reach: float, colours: dict[str, str]
) -> None:
    """Every joint's axis where it now lies: a dashed line; several in one place are dashed in turn."""
    values = system.checked_joints(joints)
    motions = system.joint_motions(values)
    indices = Joints(system.joints)
    for k, joint in enumerate(system.joints):
        direction, point = np.array(joint.axis), np.array(joint.point)
        if joint.parent is not None:
            motion = motions[indices.index(joint.parent)]
            direction, point = motion[:, :3] @ direction, motion[:, :3] @ point + motion[:, 3]
        point = point + ((seen.centre - point) @ direction) * direction  # its nearest to the middle
        line = np.array([point - 1.3 * reach * direction, point + 1.3 * reach * direction])
        _line(axes, seen, line, color=colours[joint.name], linewidth=1.0, linestyle=(4 * k, (4, 4 * len(motions))))


def _ring(centre: Floats, normal: Floats, radius: float) -> Points:
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, helper)
    first = first / np.linalg.norm(first)
    second = np.cross(normal, first)
    ring: Points = centre + radius * (np.cos(_ROUND)[:, None] * first + np.sin(_ROUND)[:, None] * second)
    return ring


def _line(axes: Axes, seen: View, points: Points, **look: object) -> None:
    axes.plot(*(seen.project(points) * MILLI).T, **look)  # type: ignore[arg-type]
