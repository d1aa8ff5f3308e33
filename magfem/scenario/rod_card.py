"""Rods in recipes: a base, materials, and sections from the base to the tip.

    [materials.PMC-770]
    youngs_modulus = "5.5 MPa"
    poisson_ratio = 0.5               # or shear_modulus; 0.5 when neither is stated
    density = "1040 kg/m^3"

    [rod]
    position = ["-30 mm", "0 mm", "0 mm"]   # of the base; its +z is the rod's axis
    direction = [1, 0, 0]
    interacting = false               # whether the magnets act on each other, as dipoles

    [[rod.sections]]
    material = "PMC-770"
    length = "25 mm"
    radius = "1.75 mm"                # a tube with inner_radius

    [[rod.sections]]
    magnet = "cylinder_magnet_2.5x4"  # a magnet's card: moment, volume, length; its z along the rod
    reversed = true                   # its z against the rod; false when not stated
    density = "7500 kg/m^3"           # 7500 kg/m³ when not stated
    model = "my_magnet.json"          # of the magnet, whose moment is taken: weaker than remanence times volume

Instead of a card a magnet may state its `moment` along the rod, `length` and `mass`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import CardError, InputError
from magfem.fields.terms import frame_about
from magfem.fitting.model import load_model
from magfem.geometry.card import Table
from magfem.geometry.vectors import three_lengths, three_numbers
from magfem.rod import FlexibleSection, MagnetSection, Rod
from magfem.rod.magnet_card import NEODYMIUM, magnet_section
from magfem.scenario.plain_values import switch, whole_number

_KINDS = ("material", "magnet", "moment")


def read_rod(card: Table) -> Rod:
    """The rod of a recipe's tables `rod` and `materials`. Raises CardError."""
    table = card.table("rod")
    table.only("position", "direction", "interacting", "sections")
    materials = card.table("materials") if "materials" in card else None
    sections = [_section(entry, materials) for entry in table.tables("sections")]
    position = np.array(three_lengths(table, "position")) if "position" in table else np.zeros(3)
    base = RigidTransform.from_components(position, _turn(table))
    interacting = switch(table, "interacting")
    magnets = sum(isinstance(one, MagnetSection) for one in sections)
    if not magnets:
        raise table.error("a rod that is steered needs at least one magnet among its sections", "sections")
    try:
        return Rod(sections, base, [None] * magnets if interacting else None)
    except InputError as error:
        raise table.error(str(error), "sections") from None


def _turn(table: Table) -> Rotation:
    if "direction" not in table:
        return Rotation.identity()
    direction = np.array(three_numbers(table, "direction"))
    if not 0 < np.linalg.norm(direction) < np.inf:
        raise table.error("direction must be three finite numbers that are not all zero", "direction")
    return Rotation.from_matrix(frame_about(direction))


def _section(entry: Table, materials: Table | None) -> FlexibleSection | MagnetSection:
    stated = [key for key in _KINDS if key in entry]
    if len(stated) != 1:
        got = " and ".join(stated) if stated else "none of them"
        raise entry.error(f"a section has a material (flexible), or a magnet or moment (a magnet), got {got}")
    try:
        return _flexible(entry, materials) if stated == ["material"] else _magnet(entry, stated[0])
    except CardError:
        raise
    except InputError as error:
        raise entry.error(str(error), stated[0]) from None


def _flexible(entry: Table, materials: Table | None) -> FlexibleSection:
    entry.only("material", "length", "radius", "inner_radius", "elements")
    name = entry.text("material")
    if materials is None or name not in materials:
        known = ", ".join(materials.values) if materials is not None else "none"
        raise entry.error(f"no material of this name stands under [materials] (there: {known})", "material")
    material = materials.table(name)
    material.only("youngs_modulus", "poisson_ratio", "shear_modulus", "density")
    if "shear_modulus" in material and "poisson_ratio" in material:
        raise material.error("state poisson_ratio or shear_modulus, not both", "shear_modulus")
    elements = whole_number(entry, "elements", 0, 2, 4096) if "elements" in entry else None
    return FlexibleSection(
        length=entry.quantity("length", "length"),
        radius=entry.quantity("radius", "length"),
        inner_radius=entry.quantity("inner_radius", "length") if "inner_radius" in entry else 0.0,
        youngs_modulus=material.quantity("youngs_modulus", "pressure"),
        poisson_ratio=material.number("poisson_ratio") if "poisson_ratio" in material else 0.5,
        shear_modulus=material.quantity("shear_modulus", "pressure") if "shear_modulus" in material else None,
        density=material.quantity("density", "density") if "density" in material else 0.0,
        elements=elements,
    )


def _magnet(entry: Table, kind: str) -> MagnetSection:
    points = whole_number(entry, "field_points", 1, 1, 16)
    if kind == "moment":
        entry.only("moment", "length", "mass", "field_points")
        return MagnetSection(
            length=entry.quantity("length", "length"),
            moment=(0.0, 0.0, entry.quantity("moment", "moment")),
            mass=entry.quantity("mass", "mass"),
            field_points=points,
        )
    entry.only("magnet", "reversed", "model", "density", "field_points")
    backwards = switch(entry, "reversed")
    model = load_model(entry.text("model")) if "model" in entry else None
    if model is not None and model.unit != "T":
        raise entry.error("this model is a coil's, and a rod carries magnets", "model")
    density = entry.quantity("density", "density") if "density" in entry else NEODYMIUM
    found = magnet_section(entry.text("magnet"), density=density, model=model, field_points=points)
    if not backwards:
        return found
    x, y, z = found.moment_vector.tolist()  # turned by 180 deg about its y axis
    return replace(found, moment=(0.0 - x, y, 0.0 - z))  # no −0.0 for people to read
