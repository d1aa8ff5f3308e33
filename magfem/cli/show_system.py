"""`magfem show` of a coil system: coils, joints, and what it can do at the middle of its workspace."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from magfem.cli.console import listing, show_result
from magfem.cli.outputs import output_file
from magfem.cli.systems import stated_joints
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem
    from magfem.typing import Floats


def show_system(options: Namespace) -> int:
    """Print the system's numbers and draw it."""
    from magfem.actuation import load_system
    from magfem.files import write_bytes

    system = load_system(options.card)
    joints = stated_joints(system, options)
    picture = output_file(options.output or f"{Path(options.card).stem}.png", [".png"])
    data = _data(system, joints)
    from magfem.report.system_pictures import system_picture

    write_bytes(picture, system_picture(system, joints).png)
    data["picture"] = str(picture)
    show_result(options, _text(system, data), data)
    return 0


def _data(system: CoilSystem, joints: Floats) -> dict[str, Any]:
    """The system's numbers, SI units."""
    from magfem.fields.region_json import region_to_dict

    fixed = system.fixed(joints)
    return {
        "name": system.name,
        "source": system.source,
        "coils": [
            {
                "name": coil.name,
                "position": coil.pose.translation,
                "axis": coil.pose.rotation.as_matrix()[:, 2],
                "current_limit": coil.current_limit,
                "joint": own.joint,
            }
            for coil, own in zip(fixed.coils, system.coils, strict=True)
        ],
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind,
                "axis": joint.axis,
                "limits": joint.limits,
                "parent": joint.parent,
                "value": value,
            }
            for joint, value in zip(system.joints, joints.tolist(), strict=True)
        ],
        "background": system.background is not None,
        "workspace": region_to_dict(system.workspace),
        **_middle(system, joints),
    }


def _middle(system: CoilSystem, joints: Floats) -> dict[str, Any]:
    """At the middle of the workspace: B per ampere (T/A), and what the current limits allow, where they are stated."""
    from magfem.actuation import workspace_map
    from magfem.fields.workspace_region import bounding_ball

    ball = bounding_ball(system.workspace)
    if ball is None or not system.coils or not system.region_at(joints).contains(np.array(ball.centre)):
        return {}
    per_ampere = system.unit_fields(ball.centre, joints)[:3]
    found: dict[str, Any] = {"middle": ball.centre, "field_per_ampere": np.linalg.norm(per_ampere, axis=0)}
    if all(coil.current_limit is not None for coil in system.coils):
        reach = workspace_map(system, ball.centre, joints)
        keys = ("field_everywhere", "field_best", "condition")
        found |= {key: float(getattr(reach, key)) for key in keys}
    return found


def _text(system: CoilSystem, data: dict[str, Any]) -> str:
    rows = [("source", system.source or "not stated"), ("workspace", system.workspace.describe())]
    for joint, entry in zip(system.joints, data["joints"], strict=True):
        low, high, value = (format_quantity(one, joint.dimension) for one in (*joint.limits, entry["value"]))
        carried = ", ".join(coil.name for coil in system.coils if coil.joint == joint.name)
        by = f", on {joint.parent}" if joint.parent else ""
        carries = f"; carries {carried}" if carried else ""
        rows.append((joint.name, f"{joint.kind}{by}, {low} to {high}, now at {value}{carries}"))
    strengths = data.get("field_per_ampere", [None] * len(system.coils))
    for coil, strength in zip(system.coils, strengths, strict=True):
        limit = "no limit" if coil.current_limit is None else f"up to {format_quantity(coil.current_limit, 'current')}"
        share = "" if strength is None else f", {format_quantity(strength, 'flux density per current')} in the middle"
        rows.append((f"coil {coil.name}", f"{limit}{share}"))
    if system.background is not None:
        rows.append(("background", "there whatever the currents"))
    if "field_everywhere" in data:
        worst, best = (format_quantity(data[key], "flux density") for key in ("field_everywhere", "field_best"))
        rows.append(("field", f"up to {worst} in any direction, {best} in the best, in the middle"))
        rows.append(("condition", f"{data['condition']:.3g} of field and gradient there"))
    return f"{system.name}\n{listing([*rows, ('picture', data['picture'])])}"
