"""Devices back to cards: what a device made in Python would look like as a file."""

from __future__ import annotations

import json
import re
from hashlib import sha256
from typing import Any

from magfem.errors import CardError
from magfem.geometry.card import CardOrigin
from magfem.geometry.device import length_text
from magfem.geometry.geometry import Coil, Geometry, Magnets
from magfem.geometry.load import geometry_from_text


def card_text(geometry: Geometry) -> str:
    """The device's card: the very text it was read from, or one that reads back to an equal device."""
    return _card(geometry).text


def describe(geometry: Geometry) -> dict[str, Any]:
    """What a device is, for summaries and provenance: kind, name, source, card, and materials or circuits."""
    card = _card(geometry)
    about: dict[str, Any] = {
        "kind": geometry.kind,
        "name": geometry.name,
        "source": geometry.source,
        "card": {"path": card.path, "sha256": card.sha256, "text": card.text},
    }
    if isinstance(geometry, Magnets):
        about["bodies"] = [
            {
                "name": body.name,
                "remanence": body.material.remanence_vector.tolist(),
                "recoil_permeability": body.material.recoil_permeability,
            }
            for body in geometry.bodies
        ]
    if isinstance(geometry, Coil):
        about["circuits"] = [circuit.name for circuit in geometry.circuits]
        about["resistivity"] = geometry.conductor.resistivity
    return about


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
    head: dict[str, Any] = {"kind": geometry.kind, "name": geometry.name}
    if geometry.source:
        head["source"] = geometry.source
    region = geometry.region
    limits = {"clearance": length_text(region.clearance), "extent": length_text(region.extent)}
    return "\n".join(_lines({**head, **geometry.tables(), "region": limits})) + "\n"


def _lines(table: dict[str, Any], path: str = "") -> list[str]:
    """A TOML table, plain values before the tables within it."""
    lines = [f"{_key(key)} = {_value(value)}" for key, value in table.items() if not _is_table(value)]
    for key, value in table.items():
        if not _is_table(value):
            continue
        name = f"{path}.{_key(key)}" if path else _key(key)
        several = isinstance(value, list)
        for entry in value if several else [value]:
            lines += ["", f"[[{name}]]" if several else f"[{name}]", *_lines(entry, name)]
    return lines


def _key(key: str) -> str:
    """As TOML writes a key: bare where it may be, else in quotes."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _is_table(value: object) -> bool:
    """A table, or a list of tables."""
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def _value(value: object) -> str:
    """Texts, numbers, booleans and lists of them: JSON's way to write them is TOML's as well, but for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
