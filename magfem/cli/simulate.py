"""`magfem simulate`: a rod steered by a coil system, in closed loop."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np

from magfem.cli.console import show_result, table
from magfem.cli.outputs import output_folder
from magfem.cli.parser import CommandLine


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "simulate",
        run,
        "a magnetic rod steered by a coil system, in closed loop",
        "Runs a scenario: a rod with magnets in a coil system, a plant that is not quite the controller's model, its\n"
        "sensing, and where the magnets shall point. The folder DIR gets summary.json, timeseries.csv, shapes.npz,\n"
        "pictures, an animation and report.html, all of them or none. A scenario is a name that `magfem list` shows\n"
        "or the path of a recipe (TOML). Exit code 1 when a target that should be reached was not, or one that is\n"
        "expected to be unreachable was not recognised as such.",
        [
            "magfem simulate steer_planar -o steering",
            "magfem simulate steer_own_coils -o steering --json",
            "magfem simulate ./mine.toml -o steering --no-pictures",
        ],
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="scenario recipe: a name or a path")
    parser.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for all that comes of it")
    parser.add_argument("--no-pictures", action="store_true", help="numbers alone: no pictures, animation or page")


def run(options: Namespace) -> int:
    """Simulate, write the folder, print how every target ended."""
    from magfem.report.run_folder import FILES, write_run
    from magfem.scenario import load_scenario, simulate
    from magfem.scenario.summary import summary

    folder = output_folder(options.output, FILES)
    found = simulate(load_scenario(options.scenario))
    write_run(found, folder, pictures=not options.no_pictures)
    data = summary(found)
    show_result(options, _text(data, options.output), data)
    return 0 if data["passed"] else 1


def _text(data: dict[str, Any], folder: str) -> str:
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
