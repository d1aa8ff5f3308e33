"""Cards of sensors: which there are, where they stand and how they lie, how well they read.

    kind = "sensors"
    source = "bench, 2025"            # optional

    [[sensors]]
    name = "left"                     # or a number: what the column `sensor` of the samples holds
    position = ["-10 mm", "0 mm", "0 mm"]    # in the frame that all share; the origin when not stated
    quaternion = [0, 0, 0, 1]         # scalar last; or matrix, three rows, whose columns are the sensor's own axes
    noise = "3 uT"                    # standard deviation of a sample, or three of them; found in the samples if not
    resolution = "0.1 uT"             # step of the readings
    saturation = "2 mT"               # readings at or beyond it are not believed
    gain = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] # it reads gain @ B + offset
    offset = ["0 uT", "0 uT", "0 uT"]

A file that ends in .json has the same keys.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import CardError, InputError
from magfem.files import read_json, write_json, write_text
from magfem.geometry.card import CardOrigin, Table, read_table
from magfem.geometry.vectors import three_lengths
from magfem.localization.sensor import Sensor
from magfem.typing import Floats
from magfem.units import describe, one_line, quantity, quoted

KIND = "sensors"
_UNTURNED = 1e-6  # how far rows of a rotation matrix may be from perpendicular unit vectors


def read_sensors(file: Path, shown: str) -> dict[str, Sensor]:
    """Sensors by their names, in the card's order; `shown` is how messages name the file. Raises CardError."""
    card = _card(file, shown)
    card.only("kind", "source", "sensors")
    if (kind := card.text("kind")) != KIND:
        raise card.error(f'a card of sensors is of kind "{KIND}", got {describe(kind)}', "kind")
    found: dict[str, Sensor] = {}
    for entry in card.tables("sensors"):
        name = _name(entry)
        if name in found:
            raise entry.error(f"there are two sensors {quoted(name)}", "name")
        found[name] = _sensor(entry)
    if not found:
        raise card.error("sensors must be one or more tables [[sensors]]", "sensors")
    return found


def sensors_to_dict(sensors: Mapping[str, Sensor]) -> dict[str, Any]:
    """A card as JSON has it: lengths in m and fields in T, with their units, so that `read_sensors` reads it back."""
    return {
        "kind": KIND,
        "sensors": [
            {
                "name": name,
                "position": [f"{value!r} m" for value in np.asarray(one.pose.translation).tolist()],
                "quaternion": one.pose.rotation.as_quat().tolist(),
                **({} if one.noise is None else {"noise": [f"{value!r} T" for value in np.ravel(one.noise).tolist()]}),
                **({"resolution": f"{one.resolution!r} T"} if one.resolution else {}),
                **({"saturation": f"{one.saturation!r} T"} if np.isfinite(one.saturation) else {}),
                "gain": np.asarray(one.gain).tolist(),
                "offset": [f"{value!r} T" for value in np.asarray(one.offset).tolist()],
            }
            for name, one in sensors.items()
        ],
    }


def write_sensors(path: Path, sensors: Mapping[str, Sensor], source: str = "") -> None:
    """A card that `read_sensors` reads back: TOML, or JSON where `path` ends in .json.

    source: where the sensors come from, such as a calibration and its date. Raises InputError where it cannot be
    written.
    """
    card = sensors_to_dict(sensors)
    card = {"kind": card["kind"], **({"source": source} if source else {}), "sensors": card["sensors"]}
    if path.suffix.lower() == ".json":
        write_json(path, card)
        return
    # What JSON writes of text and lists of numbers is TOML as well.
    lines = [f"{key} = {json.dumps(card[key], ensure_ascii=False)}" for key in card if key != "sensors"]
    for entry in card["sensors"]:
        lines += [
            "",
            "[[sensors]]",
            *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in entry.items()),
        ]
    write_text(path, "\n".join(lines) + "\n")


def _card(file: Path, shown: str) -> Table:
    if file.suffix.lower() != ".json":
        return read_table(file, shown)
    values = read_json(file, "card of sensors")
    if not isinstance(values, dict):
        raise CardError(f"expected an object with kind and sensors, got {describe(values)}", one_line(shown))
    text = json.dumps(values)
    return Table(CardOrigin(shown, sha256(text.encode()).hexdigest(), text), values)


def _name(entry: Table) -> str:
    value = entry.value("name")
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return entry.text("name").strip()


def _sensor(entry: Table) -> Sensor:
    entry.only("name", "position", "quaternion", "matrix", "noise", "resolution", "saturation", "gain", "offset")
    position = three_lengths(entry, "position") if "position" in entry else (0.0, 0.0, 0.0)
    more: dict[str, Any] = {}
    if "noise" in entry:
        several = isinstance(entry.value("noise"), list)
        more["noise"] = _fields(entry, "noise") if several else entry.quantity("noise", "flux density")
    for key in ("resolution", "saturation"):
        if key in entry:
            more[key] = entry.quantity(key, "flux density")
    if "gain" in entry:
        more["gain"] = _matrix(entry, "gain")
    if "offset" in entry:
        more["offset"] = _fields(entry, "offset")
    try:
        return Sensor(pose=RigidTransform.from_components(position, _turn(entry)), **more)
    except InputError as error:
        key = next((key for key in more if key in str(error)), "name")
        raise entry.error(str(error), key) from None


def _turn(entry: Table) -> Rotation:
    """How the sensor is turned within the common frame."""
    if "quaternion" in entry and "matrix" in entry:
        raise entry.error("state quaternion or matrix, not both", "matrix")
    if "matrix" in entry:
        matrix = _matrix(entry, "matrix")
        if np.abs(matrix @ matrix.T - np.eye(3)).max() > _UNTURNED or np.linalg.det(matrix) < 0:
            raise entry.error(
                "matrix must be a rotation: perpendicular unit vectors, right-handed: its columns are the axes",
                "matrix",
            )
        return Rotation.from_matrix(matrix)
    if "quaternion" not in entry:
        return Rotation.identity()
    value = entry.value("quaternion")
    if not (isinstance(value, list) and len(value) == 4 and all(type(one) in (int, float) for one in value)):
        raise entry.error("quaternion must be four numbers, the scalar last: [0, 0, 0, 1]", "quaternion")
    if not 0 < np.linalg.norm(value) < np.inf:
        raise entry.error("quaternion must be finite and not all zero", "quaternion")
    return Rotation.from_quat(value)


def _matrix(entry: Table, key: str) -> Floats:
    value = entry.value(key)
    rows = value if isinstance(value, list) else []
    if len(rows) != 3 or not all(
        isinstance(row, list) and len(row) == 3 and all(type(one) in (int, float) for one in row) for row in rows
    ):
        raise entry.error(f"{key} must be three rows of three numbers, such as [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", key)
    return np.array(rows, dtype=float)


def _fields(entry: Table, key: str) -> list[float]:
    """Three flux densities (T), one for each axis of the sensor."""
    value = entry.value(key)
    if not isinstance(value, list) or len(value) != 3:
        raise entry.error(f'{key} must be three flux densities such as ["3 uT", "3 uT", "4 uT"]', key)
    try:
        return [quantity(one, "flux density") for one in value]
    except InputError as error:
        raise entry.error(f"{key}: {error}", key) from None
