"""System cards: which coil models stand where, in TOML.

    kind = "coil_system"
    name = "Helmholtz pair of our own coil"
    source = "this laboratory"
    current_limit = "5 A"            # of every coil that states none

    [workspace]                      # optional: a ball, or a box by size = ["20 mm", "20 mm", "10 mm"]
    radius = "10 mm"
    centre = ["0 mm", "0 mm", "0 mm"]

    [[coils]]
    name = "left"
    model = "our_coil"               # a model of fits/, or a model file beside the card, per ampere (T/A)
    position = ["-40 mm", "0 mm", "0 mm"]               # of the model's origin
    rotation = [{ z = "180 deg" }, { y = "90 deg" }]    # intrinsic, in this order; or quaternion, or direction
    current_limit = "8 A"
    joint = "turntable"              # what carries it; its pose is then the one at joint values zero

    [[joints]]                       # in the order of the joint values
    name = "turntable"
    kind = "revolute"                # or "prismatic", whose limits are lengths and which has no point
    axis = [0, 0, 1]
    point = ["0 mm", "0 mm", "0 mm"]        # of the axis, at joint values zero
    limits = ["-90 deg", "90 deg"]
    parent = "gantry"                # optional: the joint that carries this one

Instead of `[[coils]]`, `calibration` names an MPEM file beside the card.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.actuation.coil_system import CoilSystem, SystemCoil
from magfem.actuation.joints import KINDS, Joint, Joints
from magfem.actuation.mpem import read_mpem
from magfem.errors import CardError, InputError
from magfem.fields.region import Everywhere, Region
from magfem.fields.term_kinds import PATH
from magfem.fields.terms import Terms, frame_about
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting.model import load_model
from magfem.geometry.card import Table, read_table
from magfem.geometry.vectors import three_lengths, three_numbers
from magfem.typing import Floats
from magfem.units import describe, quantity

KIND = "coil_system"

_TURNS = ("rotation", "quaternion", "direction")


def read_system_card(file: Path, shown: str) -> CoilSystem:
    """The coil system of a card; `shown` is how messages name the file. Raises CardError."""
    card = read_table(file, shown)
    card.only("kind", "name", "source", "current_limit", "workspace", "coils", "calibration", "joints")
    if (kind := card.text("kind")) != KIND:
        raise card.error(f'a system card is of kind "{KIND}", got {describe(kind)}', "kind")
    name, source = card.text("name"), card.text("source") if "source" in card else ""
    workspace = _workspace(card.table("workspace")) if "workspace" in card else None
    limit = _limit(card)
    if "calibration" in card:
        for key in ("coils", "joints"):
            if key in card:
                raise card.error(f"a system has either a calibration or {key}, not both", "calibration")
        file_name = card.text("calibration")
        calibrated = read_mpem(file.parent / file_name, _beside(shown, file_name))
        return replace(
            calibrated,
            name=name,
            source=source,
            coils=tuple(replace(coil, current_limit=limit) for coil in calibrated.coils),
            workspace=workspace or calibrated.workspace,
        )
    coils = tuple(_coil(entry, file.parent, limit) for entry in card.tables("coils"))
    if not coils:
        raise card.error("coils must be one or more tables [[coils]]", "coils")
    joints = tuple(_joint(entry) for entry in card.tables("joints")) if "joints" in card else ()
    try:
        Joints(joints)
    except InputError as error:
        raise card.error(str(error), "joints") from None
    try:
        return CoilSystem(name, coils, workspace=workspace or Everywhere(), source=source, joints=joints)
    except InputError as error:
        raise card.error(str(error), "coils") from None


def _coil(entry: Table, folder: Path, limit: float | None) -> SystemCoil:
    entry.only("name", "model", "position", "current_limit", "joint", *_TURNS)
    terms, region = _model(entry, folder)
    position = np.array(three_lengths(entry, "position")) if "position" in entry else np.zeros(3)
    pose = RigidTransform.from_components(position, _turn(entry, terms))
    joint = entry.text("joint") if "joint" in entry else None
    return SystemCoil(entry.text("name"), terms, region, pose, _limit(entry) or limit, joint)


def _joint(entry: Table) -> Joint:
    """One of the tables [[joints]]."""
    entry.only("name", "kind", "axis", "point", "limits", "parent")
    name, kind = entry.text("name"), entry.text("kind")
    if kind not in KINDS:
        raise entry.error(f"kind must be revolute or prismatic, got {describe(kind)}", "kind")
    revolute = kind == "revolute"
    if not revolute and "point" in entry:
        raise entry.error("a prismatic joint slides along its axis wherever that lies: leave the point out", "point")
    axis = three_numbers(entry, "axis")
    point = three_lengths(entry, "point") if "point" in entry else (0.0, 0.0, 0.0)
    parent = entry.text("parent") if "parent" in entry else None
    stated = entry.value("limits")
    example = '["-90 deg", "90 deg"]' if revolute else '["-20 mm", "20 mm"]'
    if not isinstance(stated, list) or len(stated) != 2:
        raise entry.error(f"limits must be two values such as {example}, got {describe(stated)}", "limits")
    try:
        low, high = (quantity(one, "angle" if revolute else "length") for one in stated)
    except InputError as error:
        raise entry.error(f"limits: {error}", "limits") from None
    try:
        return Joint(name, "revolute" if revolute else "prismatic", axis, (low, high), point, parent)
    except InputError as error:
        raise entry.error(str(error), "axis" if "axis" in str(error) else "limits") from None


def _model(entry: Table, folder: Path) -> tuple[Terms, Region]:
    """The coil's model: its terms and where they hold."""
    name = entry.text("model")
    try:
        model = load_model(folder / name if name.endswith(".json") else name)
    except CardError:
        raise
    except InputError as error:
        raise entry.error(str(error), "model") from None
    if model.unit != "T/A":
        raise entry.error(
            f"{name} is a field in {model.unit}, and a system's coils are fields per ampere (T/A)", "model"
        )
    return model.lowered, model.region


def _turn(entry: Table, terms: Terms) -> Rotation:
    """How the coil's frame is turned within the system's."""
    stated = [key for key in _TURNS if key in entry]
    if len(stated) > 1:
        raise entry.error(f"state one of {', '.join(_TURNS)}, got {' and '.join(stated)}", stated[1])
    if not stated:
        return Rotation.identity()
    if stated[0] == "rotation":
        return _rotation(entry)
    if stated[0] == "quaternion":
        value = entry.value("quaternion")
        if not (isinstance(value, list) and len(value) == 4 and all(type(one) in (int, float) for one in value)):
            raise entry.error("quaternion must be four numbers, the scalar last: [0, 0, 0, 1]", "quaternion")
        if not 0 < np.linalg.norm(value) < np.inf:
            raise entry.error("quaternion must be finite and not all zero", "quaternion")
        return Rotation.from_quat(value)
    direction = np.array(three_numbers(entry, "direction"))
    if not 0 < np.linalg.norm(direction) < np.inf:
        raise entry.error("direction must be three finite numbers that are not all zero", "direction")
    if not is_axisymmetric(terms):
        raise entry.error(
            "this model is not one of revolution about z, so a direction of its axis does not say how it is turned "
            "about it: state rotation or quaternion",
            "direction",
        )
    return Rotation.from_matrix(frame_about(direction))


def _rotation(entry: Table) -> Rotation:
    """Turns about the axes as they then lie, one after the other."""
    example = '[{ z = "180 deg" }, { y = "30 deg" }]'
    steps = entry.value("rotation")
    if not isinstance(steps, list) or not steps:
        raise entry.error(f"rotation must be a list of turns such as {example}, got {describe(steps)}", "rotation")
    turn = Rotation.identity()
    for step in steps:
        if not isinstance(step, dict) or len(step) != 1 or not set(step) <= set("xyz"):
            raise entry.error(f"every turn of rotation names one axis, x, y or z, as in {example}", "rotation")
        ((axis, angle),) = step.items()
        try:
            turn *= Rotation.from_euler(axis, quantity(angle, "angle"))
        except InputError as error:
            raise entry.error(f"rotation about {axis}: {error}", "rotation") from None
    return turn


def _workspace(table: Table) -> Region:
    """A ball or a box."""
    table.only("centre", "radius", "size")
    centre = three_lengths(table, "centre") if "centre" in table else (0.0, 0.0, 0.0)
    if ("radius" in table) == ("size" in table):
        raise table.error('a workspace has a radius ("55 mm") or a size (three lengths)', "radius")
    try:
        if "radius" in table:
            return Ball(centre, table.quantity("radius", "length"))
        half = np.array(three_lengths(table, "size")) / 2
        low, high = np.array(centre) - half, np.array(centre) + half
        return Box(tuple(low.tolist()), tuple(high.tolist()))
    except CardError:
        raise
    except InputError:
        key = "radius" if "radius" in table else "size"
        raise table.error(f"{key} must be positive", key) from None


def _limit(table: Table) -> float | None:
    if "current_limit" not in table:
        return None
    limit = table.quantity("current_limit", "current")
    if not limit > 0:
        raise table.error("current_limit must be positive", "current_limit")
    return limit


def _beside(shown: str, name: str) -> str:
    """A file's name as messages show it, in the folder of the card that is shown as `shown`."""
    return str(Path(shown).parent / name)


def is_axisymmetric(terms: Terms) -> bool:
    """Whether the sources are all of revolution about the z axis of their common frame."""
    size = float(np.abs(terms.centre).max()) + float(terms.radius.max())
    beside: Floats = np.hypot(terms.centre[:, 0], terms.centre[:, 1])
    upright = np.abs(np.abs(terms.frame[:, 2, 2]) - 1) < 1e-12
    return bool(
        np.all(beside <= 1e-12 * size) and upright.all() and not terms.order.any() and not np.any(terms.kind == PATH)
    )
