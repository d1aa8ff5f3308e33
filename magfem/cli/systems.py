"""Coil systems on the command line: what names one, its currents and joints as words."""

from __future__ import annotations

import tomllib
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from magfem.cli.parser import Parser
from magfem.errors import InputError
from magfem.units import quantity, quoted

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem
    from magfem.typing import Floats


def means_a_system(text: str) -> bool:
    """Whether a word is a coil system: a system card, a system or MPEM file, or a name that no model or device has."""
    from magfem.actuation.load import READERS, SECTION
    from magfem.actuation.system_file import is_system_file
    from magfem.geometry.catalogue import names

    suffix = Path(text).suffix
    if suffix == ".json":  # models are, too
        return is_system_file(Path(text))
    if suffix == ".toml":  # devices are, too
        return _kind(Path(text)) == "coil_system"
    return suffix in READERS or text in set(names(SECTION, ".toml")) - {*names("fits", ".json"), *_devices()}


def _kind(path: Path) -> object:
    """The kind that a card states; None for what cannot be read, which its own reader complains about better."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig")).get("kind")
    except (OSError, ValueError):
        return None


def _devices() -> list[str]:
    from magfem.geometry.catalogue import names

    return list(names("geometries", ".toml"))


def add_joints(parser: Parser) -> None:
    """--joint."""
    parser.add_argument(
        "--joint",
        metavar="NAME=VALUE",
        action="append",
        help="of a coil system whose coils move: an angle or length with its unit, once for every joint that is not "
        'at zero, as in --joint "gamma_top=30 deg"',
    )


def stated_joints(system: CoilSystem, options: Namespace) -> Floats:
    """Joint values (j,) rad or m of --joint, zero where nothing is said. Raises InputError."""
    joints = {joint.name: joint for joint in system.joints}
    values = dict.fromkeys(joints, 0.0)
    given = set()
    for text in options.joint or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f'--joint is NAME=VALUE, such as "gamma_top=30 deg", got {quoted(text)}')
        if name not in joints:
            known = f"its joints are {', '.join(map(quoted, joints))}" if joints else "it has none"
            raise InputError(f"--joint: {system.name} has no joint {quoted(name)}; {known}")
        if name in given:
            raise InputError(f"--joint is given twice for {quoted(name)}")
        given.add(name)
        try:
            values[name] = quantity(value, joints[name].dimension)
        except InputError as error:
            raise InputError(f"--joint {name}: {error}") from None
    return system.checked_joints(list(values.values()))


def stated_currents(system: CoilSystem, currents: dict[str, float]) -> Floats:
    """Currents (c,) A by the coils' names, zero where nothing is said. Raises InputError."""
    names = [coil.name for coil in system.coils]
    unknown = [name for name in currents if name not in names]
    if unknown:
        known = ", ".join(map(quoted, names))
        what = f"no coil {quoted(unknown[0])}" if unknown[0] else "several coils, and a current is NAME=A"
        raise InputError(f"--current: {system.name} has {what}; its coils are {known}")
    if not currents and names:
        raise InputError(f"the field of a coil system needs --current NAME=A of {', '.join(map(quoted, names))}")
    return system.checked_currents([currents.get(name, 0.0) for name in names])
