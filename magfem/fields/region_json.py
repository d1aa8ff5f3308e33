"""Regions as model files hold them."""

from __future__ import annotations

import math
from typing import Any

from magfem.errors import InputError
from magfem.fields.hull import hull_from_dict, hull_to_dict
from magfem.fields.region import Everywhere, Region, Shell
from magfem.fields.terms_json import number
from magfem.fields.workspace_region import Ball, Box


def region_to_dict(region: Region) -> dict[str, Any]:
    """The region as JSON-ready data (SI units)."""
    if isinstance(region, Everywhere):
        return {"kind": "everywhere"}
    if isinstance(region, Shell):
        return {
            "kind": "shell",
            "hull": hull_to_dict(region.hull),
            "clearance": region.clearance,
            "extent": region.extent,
            **{name: _bounds(getattr(region, name)) for name in ("z", "rho") if region.windowed},
        }
    if isinstance(region, Ball):
        return {"kind": "ball", "centre": list(region.centre), "radius": region.radius}
    if isinstance(region, Box):
        return {"kind": "box", "low": list(region.low), "high": list(region.high)}
    raise InputError(f"a region of type {type(region).__name__} cannot be written to a model file")


def region_from_dict(data: dict[str, Any]) -> Region:
    """Inverse of `region_to_dict`. Raises InputError, KeyError, TypeError, ValueError for anything else."""
    if data.get("kind") == "everywhere":
        return Everywhere()
    if data.get("kind") == "shell":
        window = {name: _pair(data[name]) for name in ("z", "rho") if name in data}
        shell = Shell(hull_from_dict(data["hull"]), _length(data, "clearance"), _length(data, "extent"), **window)
        if not 0 <= shell.clearance < shell.extent < math.inf:
            raise InputError("a shell needs a clearance of 0 or more and a larger extent")
        if not (shell.z[0] < shell.z[1] and 0 <= shell.rho[0] < shell.rho[1]):
            raise InputError("a window needs a lower and a larger upper limit of z and of rho, these 0 or more")
        return shell
    if data.get("kind") == "ball":
        return Ball(_three(data["centre"]), _length(data, "radius"))
    if data.get("kind") == "box":
        return Box(_three(data["low"]), _three(data["high"]))
    raise InputError(f"unknown region kind {data.get('kind')!r}; known: everywhere, shell, ball, box")


def _bounds(pair: tuple[float, float]) -> list[float | None]:
    """Limits as JSON has them, which knows no infinity."""
    return [value if math.isfinite(value) else None for value in pair]


def _length(data: dict[str, Any], key: str) -> float:
    try:
        return number(data[key])
    except ValueError:
        raise InputError(f"{key} must be a finite number of metres") from None


def _pair(data: Any) -> tuple[float, float]:
    low, high = data
    return -math.inf if low is None else number(low), math.inf if high is None else number(high)


def _three(data: Any) -> tuple[float, float, float]:
    x, y, z = data
    return number(x), number(y), number(z)
