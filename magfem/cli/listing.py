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
)
"""Key in the JSON, heading, folder and ending of everything that has a name."""


def add(commands: CommandLine) -> None:
    """Add the command."""
    commands.add(
        "list",
        run,
        "cards, coil systems, fitted models and recipes it knows",
        "Lists the names that other commands understand: device cards, coil systems, fitted field models and\n"
        "recipes, each with its description.",
        ["magfem list", "magfem list --json"],
    )


def run(options: Namespace) -> int:
    """Print the names, section by section."""
    from magfem.geometry.catalogue import folder, names

    found = {key: names(section, suffix) for key, _, section, suffix in SECTIONS}
    text = "\n\n".join(
        f"{heading}:\n" + listing([(name, _description(folder(section) / f"{name}{suffix}")) for name in found[key]])
        for key, heading, section, suffix in SECTIONS
        if found[key]
    )
    show_result(options, text, found)
    return 0


def _description(file: Path) -> str:
    """The `name` that a card, model or recipe gives itself."""
    try:
        text = file.read_text(encoding="utf-8")
        content: Any = json.loads(text) if file.suffix == ".json" else tomllib.loads(text)
        return str(content["name"])
    except (OSError, ValueError, LookupError, TypeError):
        return ""
