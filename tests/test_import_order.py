"""Imports point to the left, in the order that docs/design.md states."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "magfem"
FILES = sorted(PACKAGE.rglob("*.py"))


def stated_order() -> dict[str, set[str]]:
    """For every name in the line of docs/design.md all names left of it, by its chains: a ← b, c ← d; b ← e."""
    line = re.search(r"^    (errors.*←.*)$", (ROOT / "docs" / "design.md").read_text(), re.MULTILINE)
    assert line, "docs/design.md states the order in one indented line that begins with errors"
    left: dict[str, set[str]] = {}
    for chain in line[1].split(";"):
        links = [[name.strip() for name in link.split(",")] for link in chain.split("←")]
        for name in links[0]:
            left.setdefault(name, set())
        for before, after in pairwise(links):
            for name in after:
                left.setdefault(name, set()).update(before)
    for _ in left:  # what is left of something left is left: chains are no longer than there are names
        for own in left.values():
            own |= {farther for near in own for farther in left[near]}
    return left


LEFT = stated_order()


def part_of(file: Path) -> str:
    """The package or module of magfem that a file belongs to."""
    inner = file.relative_to(PACKAGE)
    return inner.parts[0] if len(inner.parts) > 1 else inner.stem


def imported_parts(source: str) -> set[str]:
    """The parts of magfem that a source imports, wherever in it: also in functions, also for types alone."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: imports are absolute"
            module = (node.module or "").split(".")
            if module == ["magfem"]:
                found |= {alias.name for alias in node.names}
            elif module[0] == "magfem":
                found.add(module[1])
        elif isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
            found |= {(*name, "__init__")[1] for name in names if name[0] == "magfem"}
    return found


def test_the_order_names_every_part_and_has_no_circle() -> None:
    assert set(LEFT) == {part_of(file) for file in FILES}
    assert not [name for name, left in LEFT.items() if name in left]


def test_the_order_is_the_one_that_was_meant() -> None:
    """Fields know nothing of geometry, solvers nothing of fits, fits nothing of what uses them."""
    chain = ("errors", "fields", "geometry", "mesh", "fem", "fitting", "actuation", "rod", "scenario", "report", "cli")
    for left, right in pairwise(chain):
        assert left in LEFT[right] and right not in LEFT[left]
    for one, other in (
        ("exchange", "report"),
        ("exchange", "rod"),
        ("samples", "fem"),
        ("samples", "mesh"),
        ("closed_form", "fem"),
    ):
        assert one not in LEFT[other] and other not in LEFT[one]


def test_imports_are_found_wherever_they_stand() -> None:
    source = "import magfem.fem.solve\ndef f():\n    from magfem.report import page\nif TYPE_CHECKING:\n"
    assert imported_parts(source + "    from magfem import cli") == {"fem", "report", "cli"}
    assert imported_parts("import magfem\nimport numpy\nfrom pathlib import Path") == {"__init__"}


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_imports_point_to_the_left(file: Path) -> None:
    own = part_of(file)
    wrong = imported_parts(file.read_text()) - LEFT[own] - {own}
    assert not wrong, (
        f"{own} imports {', '.join(sorted(wrong))}, which {'does' if len(wrong) == 1 else 'do'} not stand left of it"
    )
