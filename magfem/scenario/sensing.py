"""What the controller gets to see of the plant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from magfem.rod.state import RodState
from magfem.typing import Floats, Points


class Sensing(Protocol):
    """How magnets' poses are measured."""

    def see(self, plant: RodState, rng: np.random.Generator) -> tuple[Points, Floats]:
        """Measured centres (m, 3) m and frames (m, 3, 3) of the magnets."""

    def describe(self) -> str:
        """In a few words."""


@dataclass(frozen=True)
class Exact:
    """Everything, without noise."""

    def see(self, plant: RodState, rng: np.random.Generator) -> tuple[Points, Floats]:
        """As `Sensing.see`."""
        return plant.magnet_positions, plant.magnet_frames

    def describe(self) -> str:
        """In a few words."""
        return "exact poses"


def in_plane(positions: Points, frames: Floats) -> tuple[Points, Floats]:
    """Poses with their centres and axes moved into the xz plane, which the rod is known to lie in.

    Source: dissertation, 2.3.1, where the axis of rotation is y, wanted and measured alike.
    """
    flat = np.array(positions)
    flat[:, 1] = 0.0
    axes = np.array(frames[:, :, 2])
    axes[:, 1] = 0.0
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    y = np.broadcast_to(np.array([0.0, 1.0, 0.0]), axes.shape)
    return flat, np.stack([np.cross(y, axes), y, axes], axis=-1)
