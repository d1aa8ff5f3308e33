"""What a study found, in words."""

from __future__ import annotations

from typing import Any

from magfem.cli.console import table


def text(data: dict[str, Any], folder: str) -> str:
    """A summary as lines, with the folder that holds the rest."""
    rows = [("quantity", "found", "dissertation", "limit")]
    for one in data["comparisons"]:
        limit = one["limit"] + ("" if one["holds"] else ": not kept")
        rows.append((one["quantity"], f"{one['found']:.3g} {one['unit']}".rstrip(), one["published"], limit))
    limited = [one for one in data["comparisons"] if one["limit"]]
    kept = sum(one["holds"] for one in limited)
    told = f"  {kept} of {len(limited)} limits kept\n" if limited else ""
    return f"{data['name']}\n{table(rows)}\n{told}  all of it in {folder}"
