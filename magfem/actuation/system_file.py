"""System files: a coil system with all its terms in one JSON file, complete in itself.

format, version     "magfem-system", 1
name, source        texts
coils               name, terms (as in model files), region; pose (position m, quaternion, scalar last) unless it is
                    the identity; current_limit (A) if there is one; joint (its name) if one carries the coil
joints              if there are any: name, kind, axis, point (m), limits (rad or m); parent (its name) if there is one
background          terms in T, or null
workspace           a region
report, provenance  tables: what a calibration found out about itself, and of what
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.actuation.coil_system import CoilSystem, SystemCoil
from magfem.actuation.joints import Joint
from magfem.errors import CardError, InputError
from magfem.fields.region_json import region_from_dict, region_to_dict
from magfem.fields.terms_json import number, numbers, terms_from_list, terms_to_list
from magfem.files import not_whole, read_json, write_json
from magfem.units import describe

FORMAT, VERSION = "magfem-system", 1

_KEYS = ("format", "version", "name", "source", "coils", "background", "workspace", "report", "provenance")
_COIL_KEYS, _COIL_CHOICES = ("name", "terms", "region"), ("pose", "current_limit", "joint")
_JOINT_KEYS, _JOINT_CHOICES = ("name", "kind", "axis", "point", "limits"), ("parent",)
_WRONG = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, InputError)


def write_system(system: CoilSystem, path: Path) -> None:
    """Write the system file, whole or not at all. Every float keeps its bits, but for a pose's, which may round."""
    write_json(path, system_to_dict(system))


def system_to_dict(system: CoilSystem) -> dict[str, Any]:
    """The content of the system file."""
    joints = {"joints": [_joint_to_dict(joint) for joint in system.joints]} if system.joints else {}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": system.name,
        "source": system.source,
        "coils": [_coil_to_dict(coil) for coil in system.coils],
        **joints,
        "background": None if system.background is None else terms_to_list(system.background),
        "workspace": region_to_dict(system.workspace),
        "report": system.report,
        "provenance": system.provenance,
    }


def is_system_file(path: Path) -> bool:
    """Whether a JSON file says that it holds a system; false also for what is no JSON."""
    try:
        data = read_json(path, "the file")
    except InputError:
        return False
    return isinstance(data, dict) and data.get("format") == FORMAT


def read_system(file: Path, shown: str) -> CoilSystem:
    """The system of a file; `shown` is how messages name it. Raises InputError, or CardError (file and key)."""
    data = read_json(file, "the coil system")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise CardError(f'this is not a coil system: "format" must be "{FORMAT}"', f"{shown}: format")
    if data.get("version") != VERSION:
        raise CardError(
            f"version {data.get('version')!r} of the format is not known, expected {VERSION}", f"{shown}: version"
        )
    key = ""
    try:
        _only(data, _KEYS, ("joints",))
        for key, kind, words in (
            ("name", str, "a text"),
            ("source", str, "a text"),
            ("coils", list, "a list of tables"),
            ("report", dict, "a table"),
            ("provenance", dict, "a table"),
        ):
            if not isinstance(data[key], kind):
                raise ValueError(words)
        coils = []
        for k, entry in enumerate(data["coils"]):
            key = f"coils[{k}]"
            coils.append(_coil_from_dict(entry))
        joints = []
        for k, entry in enumerate(data.get("joints", [])):
            key = f"joints[{k}]"
            joints.append(_joint_from_dict(entry))
        key = "background"
        background = None if data["background"] is None else terms_from_list(data["background"])
        key = "workspace"
        workspace = region_from_dict(data["workspace"])
        key = "coils"
        return CoilSystem(
            data["name"],
            tuple(coils),
            background,
            workspace,
            data["source"],
            data["report"],
            data["provenance"],
            tuple(joints),
        )
    except _WRONG as error:
        raise not_whole("coil system", error, shown, key) from None


def _coil_to_dict(coil: SystemCoil) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": coil.name,
        "terms": terms_to_list(coil.own_terms),
        "region": region_to_dict(coil.own_region),
    }
    rotation, position = coil.pose.rotation, coil.pose.translation
    if np.any(position != 0) or np.any(rotation.as_matrix() != np.eye(3)):
        entry["pose"] = {"position": position.tolist(), "quaternion": rotation.as_quat().tolist()}
    if coil.current_limit is not None:
        entry["current_limit"] = coil.current_limit
    if coil.joint is not None:
        entry["joint"] = coil.joint
    return entry


def _joint_to_dict(joint: Joint) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": joint.name,
        "kind": joint.kind,
        "axis": list(joint.axis),
        "point": list(joint.point),
        "limits": list(joint.limits),
    }
    if joint.parent is not None:
        entry["parent"] = joint.parent
    return entry


def _joint_from_dict(entry: Any) -> Joint:
    if not isinstance(entry, dict):
        raise ValueError("a table for every joint")
    _only(entry, _JOINT_KEYS, _JOINT_CHOICES)
    for key in ("name", "kind", "parent"):
        if not isinstance(entry.get(key, ""), str):
            raise ValueError(f"a text as {key}, got {describe(entry[key])}")
    axis, point, limits = (tuple(numbers(entry[key]).tolist()) for key in ("axis", "point", "limits"))
    return Joint(entry["name"], entry["kind"], axis, limits, point, entry.get("parent"))


def _coil_from_dict(entry: Any) -> SystemCoil:
    if not isinstance(entry, dict):
        raise ValueError("a table for every coil")
    _only(entry, _COIL_KEYS, _COIL_CHOICES)
    if not isinstance(entry["name"], str):
        raise ValueError(f"a text as name, got {describe(entry['name'])}")
    if not isinstance(entry.get("joint", ""), str):
        raise ValueError(f"a text as joint, got {describe(entry['joint'])}")
    limit = number(entry["current_limit"]) if "current_limit" in entry else None
    pose = _pose(entry["pose"]) if "pose" in entry else RigidTransform.identity()
    terms, region = terms_from_list(entry["terms"]), region_from_dict(entry["region"])
    return SystemCoil(entry["name"], terms, region, pose, limit, entry.get("joint"))


def _pose(entry: Any) -> RigidTransform:
    if not isinstance(entry, dict):
        raise ValueError("a pose of position and quaternion")
    _only(entry, ("position", "quaternion"))
    position, quaternion = numbers(entry["position"]), numbers(entry["quaternion"])
    if position.shape != (3,) or quaternion.shape != (4,) or abs(np.linalg.norm(quaternion) - 1) > 1e-9:
        raise ValueError("a pose of a position of three numbers and a quaternion of length one, the scalar last")
    return RigidTransform.from_components(position, Rotation.from_quat(quaternion))


def _only(entry: dict[str, Any], keys: tuple[str, ...], choices: tuple[str, ...] = ()) -> None:
    """KeyError for a key that is missing, ValueError for one that nobody knows."""
    for key in keys:
        entry[key]
    unknown = sorted(set(entry) - {*keys, *choices})
    if unknown:
        raise ValueError(f"the keys {', '.join((*keys, *choices))}, got {describe(unknown[0])}")
