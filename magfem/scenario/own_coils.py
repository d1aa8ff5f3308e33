"""Coil systems whose coil magfem solves and fits itself, in the same run: from the coil's card to the placed system.

    [system]
    coil = "solenoid_24x48x60"        # a coil's card, of one circuit
    current_limit = "8 A"
    workspace = "32 mm"               # radius of the ball about the origin in which the system is used

    [[system.coils]]
    name = "left"
    position = ["-75 mm", "0 mm", "0 mm"]     # of the coil's centre
    direction = [1, 0, 0]                     # of its axis

Of a system of the catalogue a recipe states the name alone: system = "bigmag".
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.actuation import CoilSystem, SystemCoil
from magfem.errors import CardError, InputError
from magfem.fem import solve
from magfem.fields.terms import frame_about
from magfem.fields.workspace_region import Ball
from magfem.fitting import FieldModel, fit
from magfem.geometry import Coil, load_geometry
from magfem.geometry.card import Table
from magfem.geometry.vectors import three_lengths, three_numbers

log = logging.getLogger("magfem")


@dataclass(frozen=True, eq=False)
class OwnCoils:
    """coil: name or path of the card.  workspace: m.  current_limit: A.  names, poses: of the coils' frames."""

    coil: str
    workspace: float
    current_limit: float
    names: tuple[str, ...]
    poses: tuple[RigidTransform, ...]

    def built(self) -> tuple[CoilSystem, FieldModel]:
        """The system, and the model that all its coils share. Solves and fits; raises as these do."""
        card = load_geometry(self.coil)
        if not isinstance(card, Coil) or len(card.circuits) != 1:
            raise InputError(f"{self.coil} is not a coil of one circuit, which a system of own coils is made of")
        log.info("scenario: solving %s", card.name)
        solution = solve(card)
        log.info("scenario: fitting it")
        model = fit(solution)
        coils = tuple(
            SystemCoil(name, model.lowered, model.region, pose, self.current_limit)
            for name, pose in zip(self.names, self.poses, strict=True)
        )
        name = f"{len(coils)} coils of our own: {card.name}"
        return CoilSystem(name, coils, workspace=Ball((0.0, 0.0, 0.0), self.workspace)), model


def read_own_coils(table: Table) -> OwnCoils:
    """The coils of a recipe's table `system`. Raises CardError."""
    table.only("coil", "current_limit", "workspace", "coils")
    limit, workspace = table.quantity("current_limit", "current"), table.quantity("workspace", "length")
    for key, value in (("current_limit", limit), ("workspace", workspace)):
        if not value > 0:
            raise table.error(f"{key} must be positive", key)
    entries = table.tables("coils")
    if not entries:
        raise table.error("coils must be one or more tables [[system.coils]]", "coils")
    poses = []
    for entry in entries:
        entry.only("name", "position", "direction")
        direction = np.array(three_numbers(entry, "direction"))
        if not 0 < np.linalg.norm(direction) < np.inf:
            raise entry.error("direction must be three finite numbers that are not all zero", "direction")
        turn = Rotation.from_matrix(frame_about(direction))
        poses.append(RigidTransform.from_components(np.array(three_lengths(entry, "position")), turn))
    coil = table.text("coil")
    try:
        load_geometry(coil)
    except CardError:
        raise
    except InputError as error:
        raise table.error(str(error), "coil") from None
    return OwnCoils(coil, workspace, limit, tuple(entry.text("name") for entry in entries), tuple(poses))
