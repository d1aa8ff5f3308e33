"""What the controller gets to see of the plant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from magfem.errors import ConvergenceError, InputError
from magfem.rod.camera_views import fit_centreline_to_views, simulate_views
from magfem.rod.cameras import Camera
from magfem.rod.centreline import Centreline
from magfem.rod.magnet_pose import magnet_poses
from magfem.rod.state import RodState
from magfem.typing import Floats, Points

_SHOWN = 0.9  # of a picture's true pixels: a curve that explains fewer is not the rod


@dataclass(frozen=True, eq=False)
class Seen:
    """Measured centres (m, 3) m and frames (m, 3, 3) of the magnets; the centreline they were read from, if any."""

    positions: Points
    frames: Floats
    centreline: Centreline | None = None


class Sensing(Protocol):
    """How magnets' poses are measured."""

    def see(self, plant: RodState, rng: np.random.Generator, before: Seen | None) -> Seen:
        """A measurement; `before` is the last one, None when there is none or the plant has jumped."""

    def describe(self) -> str:
        """In a few words."""


@dataclass(frozen=True)
class Exact:
    """Everything, without noise."""

    def see(self, plant: RodState, rng: np.random.Generator, before: Seen | None) -> Seen:
        """As `Sensing.see`."""
        return Seen(plant.magnet_positions, plant.magnet_frames)

    def describe(self) -> str:
        """In a few words."""
        return "exact poses"


@dataclass(frozen=True, eq=False)
class Cameras:
    """Two or more calibrated cameras that see points on the rod's axis, without matches.

    noise: px, of either coordinate of a pixel.  points: how many of the axis a picture shows.  outliers: the share of
    them that show something else.  pictures: of every camera for one measurement; they count together.
    degree: of the centreline's polynomial on every flexible section.
    """

    cameras: tuple[Camera, ...]
    noise: float
    points: int = 120
    outliers: float = 0.0
    pictures: int = 1
    degree: int = 4

    def see(self, plant: RodState, rng: np.random.Generator, before: Seen | None) -> Seen:
        """As `Sensing.see`. A magnet's turn about the rod's axis is not seen: its frame is the least turned one.

        Raises ConvergenceError when no centreline fits the pictures.
        """
        axis = _points_on_axis(plant, self.points)
        views = [
            simulate_views(self.cameras, axis, rng, noise=self.noise, outliers=self.outliers)
            for _ in range(self.pictures)
        ]
        pixels = [np.concatenate([view[c].pixels for view in views]) for c in range(len(self.cameras))]
        try:
            fitted = self._fitted(plant, pixels, None if before is None else before.centreline)
        except ConvergenceError:  # anew, at first from one picture of each camera: a cold start takes long
            first = self._fitted(plant, [view.pixels for view in views[0]], None)
            fitted = self._fitted(plant, pixels, first)
        middle = plant.arc_lengths[plant.loads.chain.magnet_node]
        poses = magnet_poses(fitted, middle, plant.rod.base.rotation)
        return Seen(poses.positions, poses.rotations.as_matrix(), fitted)

    def _fitted(self, plant: RodState, pixels: list[Floats], start: Centreline | None) -> Centreline:
        """The centreline in the pictures; of the plant only what is known of the rod without load is used."""
        base = plant.rod.base
        try:
            found = fit_centreline_to_views(
                self.cameras,
                pixels,
                plant.rod.length,
                base.translation,
                base_tangent=base.rotation.as_matrix()[:, 2],
                straight=_rigid_stretches(plant),
                degree=self.degree,
                start=start,
            )
        except InputError as error:  # the pictures were taken: it is the fit that went behind a camera
            raise ConvergenceError(f"the cameras do not find the rod: {error}") from None
        if found.used.mean() < _SHOWN * (1 - self.outliers):
            raise ConvergenceError("the cameras do not find the rod: the curve found leaves out much of the pictures")
        return found

    def describe(self) -> str:
        """In a few words."""
        pictures = "" if self.pictures == 1 else f", {self.pictures} pictures a step"
        return f"{len(self.cameras)} cameras, {self.points} points with {self.noise:g} px of noise{pictures}"


def in_plane(seen: Seen) -> Seen:
    """Poses with their centres and axes moved into the xz plane, which the rod is known to lie in.

    Source: dissertation, 2.3.1, where the axis of rotation is y, wanted and measured alike.
    """
    flat = np.array(seen.positions)
    flat[:, 1] = 0.0
    axes = np.array(seen.frames[:, :, 2])
    axes[:, 1] = 0.0
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    y = np.broadcast_to(np.array([0.0, 1.0, 0.0]), axes.shape)
    return Seen(flat, np.stack([np.cross(y, axes), y, axes], axis=-1), seen.centreline)


def _points_on_axis(plant: RodState, count: int) -> Points:
    """(count, 3) m, evenly spaced from base to tip: cubic between nodes, with their tangents."""
    s = plant.arc_lengths
    curve = CubicHermiteSpline(s, plant.positions, plant.frames[:, :, 2])
    points: Points = curve(np.linspace(s[0], s[-1], count))
    return points


def _rigid_stretches(plant: RodState) -> tuple[tuple[float, float], ...]:
    """(start, end) m of the magnets along the rod."""
    s, nodes = plant.arc_lengths, plant.loads.chain.magnet_node.tolist()
    return tuple((float(s[node - 1]), float(s[node + 1])) for node in nodes)
