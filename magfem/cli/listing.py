"""`magfem list`: what the catalogue holds."""

from __future__ import annotations

import json
import tomllib
from argparse import Namespace
from pathlib import Path
from typing import Any

from magfem.cli.console import listing, show_result
from magfem.cli.parser import CommandLine

SECTIONS = (
    ("cards", "device cards", "geometries", ".toml"),
    ("systems", "coil systems", "geometries/systems", ".toml"),
    ("models", "field models", "fits", ".json"),
    ("recipes", "fit recipes", "fits", ".toml"),
    ("reports", "report recipes", "reports", ".toml"),
    ("scenarios", "scenarios", "reports", ".toml"),
)
"""Key in the JSON, heading, folder and ending of everything that has a name."""


def add(commands: CommandLine) -> None:
    """Add the command."""
    commands.add(
        "list",
        run,
        "cards, coil systems, fitted models and recipes it knows",
        "Lists the names that other commands understand: device cards, coil systems, fitted field models,\n"
        "recipes and scenarios, each with its description.",
        ["magfem list", "magfem list --json"],
    )


def run(options: Namespace) -> int:
    """Print the names, section by section."""
    from magfem.geometry.catalogue import SIMULATED, folder, names

    found = {key: names(section, suffix) for key, _, section, suffix in SECTIONS}
    scenarios = {name for name in found["scenarios"] if _entry(folder("reports") / f"{name}.toml", "kind") in SIMULATED}
    found["scenarios"] = tuple(name for name in found["scenarios"] if name in scenarios)
    found["reports"] = tuple(name for name in found["reports"] if name not in scenarios)
    text = "\n\n".join(
        f"{heading}:\n" + listing([(name, _entry(folder(section) / f"{name}{suffix}", "name")) for name in found[key]])
        for key, heading, section, suffix in SECTIONS
        if found[key]
    )
    show_result(options, text, found)
    return 0


def _entry(file: Path, key: str) -> str:
    """What a card, model or recipe says of itself at `key`, such as its `name`; empty when it does not."""
    try:
        text = file.read_text(encoding="utf-8")
        content: Any = json.loads(text) if file.suffix == ".json" else tomllib.loads(text)
        return str(content[key])
    except (OSError, ValueError, LookupError, TypeError):
        return ""
