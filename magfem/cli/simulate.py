"""`magfem simulate`: scenarios and studies, each by its recipe."""

from __future__ import annotations

from argparse import Namespace

from magfem.cli.console import show_result
from magfem.cli.outputs import output_folder
from magfem.cli.parser import CommandLine


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "simulate",
        run,
        "scenarios: rods steered by coils, magnets localized",
        'Runs a scenario. Of kind "scenario": a rod with magnets in a coil system, a plant that is not quite the\n'
        'controller\'s model, its sensing, and where the magnets shall point. Of kind "localize_and_steer": a motor\n'
        'in tubes, localized and steered by one arm. Of kind "localization_study": how well turning magnets are\n'
        "localized, beside what is published. The folder DIR gets summary.json, data, pictures\n"
        "and report.html, all of them or none. A scenario is a name that `magfem list` shows or the path of a recipe\n"
        "(TOML). Exit code 1 when it did not end as its recipe says: a target that was not reached, a limit that was\n"
        "not kept.",
        [
            "magfem simulate steer_planar -o steering",
            "magfem simulate localize_and_steer -o motor",
            "magfem simulate localize_tracks -o tracks",
            "magfem simulate ./mine.toml -o mine --no-pictures",
        ],
    )
    parser.add_argument("scenario", metavar="SCENARIO", help="scenario recipe: a name or a path")
    parser.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for all that comes of it")
    parser.add_argument("--no-pictures", action="store_true", help="numbers alone: no pictures, animation or page")


def run(options: Namespace) -> int:
    """Simulate, write the folder, print how it ended."""
    from magfem.cli.scenario_kinds import kind_of, read_recipe

    recipe = read_recipe(options.scenario)
    kind = kind_of(recipe)
    folder = output_folder(options.output, kind.files)
    found = kind.simulate(recipe)
    kind.write(found, folder, not options.no_pictures)
    data = kind.summary(found)
    show_result(options, kind.text(data, options.output), data)
    return 0 if data["passed"] else 1
