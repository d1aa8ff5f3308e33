"""The solid parts of a device."""

from __future__ import annotations

from dataclasses import dataclass

from magfem.geometry.material import PermanentMagnet


@dataclass(frozen=True)
class Body:
    """One solid of one material. Volume and area are closed forms: the mesh is checked against them."""

    name: str  # unique within its device; meshes tag the body by it
    material: PermanentMagnet  # its direction in the device's frame
    volume: float  # m³
    area: float  # m², of the whole surface
    thickness: float = 0.0  # m, the smallest, which a mesh must resolve; 0: not known
    radius: float = 0.0  # m, of a ball that holds the body; 0: not known
