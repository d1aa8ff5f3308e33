"""Sensing in recipes.

    [sensing]
    kind = "exact"
    seed = 1                          # of the noise
"""

from __future__ import annotations

from magfem.geometry.card import Table
from magfem.scenario.sensing import Exact, Sensing
from magfem.units import describe


def read_sensing(card: Table) -> tuple[Sensing, int]:
    """The sensing and the seed of its noise; exact poses when a recipe says nothing. Raises CardError."""
    if "sensing" not in card:
        return Exact(), 0
    table = card.table("sensing")
    seed = table.value("seed") if "seed" in table else 0
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise table.error(f"seed must be a whole number that is not negative, got {describe(seed)}", "seed")
    kind = table.text("kind")
    if kind == "exact":
        table.only("kind", "seed")
        return Exact(), seed
    raise table.error(f'kind must be "exact", got {describe(kind)}', "kind")
