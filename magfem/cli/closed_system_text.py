"""How a motor's way through its tubes ended, in words."""

from __future__ import annotations

from typing import Any

from magfem.cli.console import table


def text(data: dict[str, Any], folder: str) -> str:
    """A summary as lines, with the folder that holds the rest."""
    rows = [("junction", "wanted", "entered", "tip bent by", "without field", "field")]
    for one in data["junctions"]:
        rows.append(
            (
                one["node"],
                one["wanted"],
                one["entered"] + ("" if one["as_wanted"] else " (wrong)"),
                f"{one['deflection_mm']:.1f} mm",
                f"{one['without_field_mm']:.1f} mm",
                f"{one['field_mT']:.1f} mT",
            )
        )
    reached = sum(one["reached"] for one in data["targets"])
    found = data["localization"]
    return (
        f"{data['name']}\n{table(rows)}\n"
        f"  {reached} of {len(data['targets'])} targets reached, {data['distance_mm']:.0f} mm in "
        f"{data['duration_s']:.0f} s; {found['count']} localizations, RMS errors {found['position_error_mm']['rms']:.2g} mm and "
        f"{found['axis_error_deg']['rms']:.2g} deg\n  all of it in {folder}"
    )
