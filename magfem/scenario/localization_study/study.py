"""What a study is, and what it leaves: numbers beside the published ones, and whether they keep their limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from magfem.typing import Floats

FORMAT, VERSION = "magfem localization study", 1


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One number: `found` in `unit`, in words what was `published`, and a limit where there is one."""

    quantity: str
    found: float
    unit: str = ""
    published: str = ""
    at_most: float | None = None
    at_least: float | None = None

    @property
    def holds(self) -> bool:
        """Whether the limit is kept; true without one."""
        low = self.at_least is None or self.found >= self.at_least
        return low and (self.at_most is None or self.found <= self.at_most)

    @property
    def limit(self) -> str:
        """The limit in words."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}"
        return "" if self.at_least is None else f"at least {self.at_least:g}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """A study that was run.

    kind: its `study` in the recipe.  text: the recipe.  result: what pictures are drawn of.  arrays: the data, by name,
    for `data.npz`.  notes: what a reader of the page must know.
    """

    kind: str
    name: str
    source: str
    text: str
    result: Any
    comparisons: tuple[Comparison, ...]
    arrays: Mapping[str, Floats]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all limits are kept."""
        return all(one.holds for one in self.comparisons)

    def summary(self) -> dict[str, Any]:
        """What `summary.json` holds."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "study": self.kind,
            "name": self.name,
            "source": self.source,
            "passed": self.passed,
            "comparisons": [
                {
                    "quantity": one.quantity,
                    "found": one.found,
                    "unit": one.unit,
                    "published": one.published,
                    "limit": one.limit,
                    "holds": one.holds,
                }
                for one in self.comparisons
            ],
            "notes": list(self.notes),
        }
