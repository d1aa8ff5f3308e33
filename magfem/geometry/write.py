"""Devices back to cards: what a device made in Python would look like as a file."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import Any

from magfem.errors import CardError
from magfem.geometry.card import CardOrigin
from magfem.geometry.geometry import Geometry
from magfem.geometry.load import geometry_from_text


def card_text(geometry: Geometry) -> str:
    """The device's card: the very text it was read from, or one that reads back to an equal device."""
    return _card(geometry).text


def describe(geometry: Geometry) -> dict[str, Any]:
    """What a device is, for summaries and provenance: kind, name, source, card and materials."""
    card = _card(geometry)
    return {
        "kind": geometry.kind,
        "name": geometry.name,
        "source": geometry.source,
        "card": {"path": card.path, "sha256": card.sha256, "text": card.text},
        "bodies": [
            {
                "name": body.name,
                "remanence": body.material.remanence_vector.tolist(),
                "recoil_permeability": body.material.recoil_permeability,
            }
            for body in geometry.bodies
        ],
    }


def _card(geometry: Geometry) -> CardOrigin:
    """The card that the device was read from, if it still describes it (`dataclasses.replace` …), or a fresh one."""
    origin = geometry.origin
    if origin is not None:
        try:
            if geometry_from_text(origin.text, origin.path) == geometry:
                return origin
        except CardError:  # an origin made by hand
            pass
    text = _fresh_card(geometry)
    return CardOrigin("made in Python", sha256(text.encode()).hexdigest(), text)


def _fresh_card(geometry: Geometry) -> str:
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
