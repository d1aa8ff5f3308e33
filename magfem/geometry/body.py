"""The solid parts of a device."""

from __future__ import annotations

from dataclasses import dataclass

from magfem.geometry.material import PermanentMagnet


@dataclass(frozen=True)
class Body:
    """One solid of one material. Volume and area are closed forms: the mesh is checked against them."""

    name: str  # unique within its device; meshes tag the body by it
    material: PermanentMagnet
    volume: float  # m³
    area: float  # m², of the whole surface
