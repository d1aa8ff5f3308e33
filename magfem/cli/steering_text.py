"""How a steered rod's targets ended, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from magfem.cli.console import table


def text(data: dict[str, Any], folder: str) -> str:
    """A summary as lines, with the folder that holds the rest."""
    rows = [("target", "wanted", "reached", "error", "steps", "outcome")]
    for number, one in enumerate(data["targets"], 1):
        rows.append(
            (
                str(number),
                _degrees(one["wanted_deg"], 1),
                _degrees(one["reached_deg"], 1),
                f"{max(one['error_deg']):.3f} deg",
                str(one["iterations"]),
                one["outcome"] + ("" if one["as_expected"] else f", expected to be {one['expected']}"),
            )
        )
    step = data["step_ms"]
    return (
        f"{data['name']}\n{table(rows)}\n"
        f"  {data['converged']} of {len(data['targets'])} targets reached; a step of the controller takes "
        f"{step['median']:.3g} ms (median), {step['worst']:.3g} ms at worst\n  all of it in {folder}"
    )


def _degrees(values: Any, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in np.asarray(values).tolist()) + " deg"
