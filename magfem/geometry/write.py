"""Devices back to cards: what a device made in Python would look like as a file."""

from __future__ import annotations

import json

from magfem.geometry.geometry import Geometry


def card_text(geometry: Geometry) -> str:
    """The device's card: the very text it was read from, or one that reads back to an equal device."""
    if geometry.origin is not None:
        return geometry.origin.text
    material = geometry.bodies[0].material
    lines = [f'kind = "{geometry.kind}"', f"name = {_quoted(geometry.name)}"]
    if geometry.source:
        lines.append(f"source = {_quoted(geometry.source)}")
    lines += ["", "[dimensions]"]
    lines += [f'{key} = "{getattr(geometry, key)!r} m"' for key in geometry.dimensions]
    lines += [
        "",
        "[material]",
        f'remanence = "{material.remanence!r} T"',
        f"recoil_permeability = {material.recoil_permeability!r}",
        f"magnetisation = {list(material.magnetisation)!r}",
        "",
        "[region]",
        f'clearance = "{geometry.region.clearance!r} m"',
        f'extent = "{geometry.region.extent!r} m"',
    ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A TOML basic string; JSON's escapes are a subset of TOML's."""
    return json.dumps(text, ensure_ascii=False)
