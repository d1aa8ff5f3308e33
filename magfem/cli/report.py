"""`magfem report`: all about a device or model on one page."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.samples import add_samples_options, read_model_samples, refuse_samples_options


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "report",
        run,
        "one HTML page: device, field, model, and how far to trust them",
        "Writes a page that opens without a network: the device, its field, its model and the errors of both. A\n"
        "magnet's card is solved and fitted first; a coil's is solved, and its page holds resistance, inductance and\n"
        "the field per ampere. A name is a report recipe if there is one, else a field model, else a device card.\n"
        "The page of a model fitted to samples tells noise, bias and what was found besides; give the samples again\n"
        "to see the residuals. --pdf prints the page beside it, which needs Chromium.",
        [
            "magfem report ring_magnet_4x1.5x1",
            "magfem report ring.json -o ring.html",
            "magfem report ./my_recipe.toml -o mine.html --pdf",
            "magfem report field.json --samples samples.csv",
        ],
    )
    parser.add_argument("target", metavar="CARD|MODEL|RECIPE", help="what it is about: a name or a path")
    parser.add_argument("-o", "--output", metavar="REPORT.html", help="the page (default: its name, here)")
    parser.add_argument("--pdf", action="store_true", help="print it to REPORT.pdf as well")
    samples = parser.add_argument_group("samples")
    samples.add_argument("--samples", metavar="SAMPLES.csv", help="measured samples to hold the model against")
    add_samples_options(samples)


def run(options: Namespace) -> int:
    """Write the page."""
    name = Path(options.target).name.removesuffix(".toml").removesuffix(".json")
    path = output_file(options.output or f"{name}.html", [".html"])
    from magfem.report import write_report

    samples = read_model_samples(options.samples, options, "--samples") if options.samples else None
    if samples is None:
        refuse_samples_options(options, "--samples")
    written = [str(file) for file in write_report(options.target, path, options.pdf, samples)]
    show_result(options, "\n".join(f"report in {file}" for file in written), {"output": written})
    return 0
