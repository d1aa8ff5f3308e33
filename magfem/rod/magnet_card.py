"""A magnet of a card as a section of a rod."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError
from magfem.rod.sections import MagnetSection, positive

if TYPE_CHECKING:
    from magfem.fitting import FieldModel
    from magfem.geometry import Magnets

NEODYMIUM = 7500.0
"""kg/m³, of sintered Nd-Fe-B."""


def magnet_section(
    magnet: Magnets | str | os.PathLike[str],
    *,
    density: float = NEODYMIUM,
    model: FieldModel | None = None,
    field_points: int = 1,
) -> MagnetSection:
    """The section that a magnet's card describes; its z is the rod's axis, and how far it
    (its convex hull) reaches along that axis is the section's length.

    magnet: a geometry, the name of a card or its path.  density: kg/m³.  model: of the magnet, whose moment is taken:
    with a recoil permeability above 1 a magnet is weaker than its remanence times its volume, which is taken without
    one.  Raises InputError for what is no magnet, CardError for a wrong card.
    """
    from magfem.geometry import Magnets, load_geometry

    geometry = load_geometry(magnet) if isinstance(magnet, str | os.PathLike) else magnet
    if not isinstance(geometry, Magnets):
        raise InputError(f"a rod's magnet is a permanent magnet, and {geometry.name or geometry.kind} is not")
    positive("magnet section", "density", density)
    far = 2 * geometry.hull.radius
    above, below = geometry.hull.distance(np.array([[0.0, 0.0, far], [0.0, 0.0, -far]]))
    return MagnetSection(
        length=2 * far - float(above) - float(below),
        moment=geometry.moment if model is None else model.moment,
        mass=density * float(sum(body.volume for body in geometry.bodies)),
        field_points=field_points,
    )
