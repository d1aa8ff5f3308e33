"""The words of the command line: every command with its help, and mistakes as one sentence."""

from __future__ import annotations

import argparse
from argparse import Namespace
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import NoReturn

from magfem.errors import InputError
from magfem.units import quoted
from magfem.version import __version__

Run = Callable[[Namespace], int]
"""What a command does with its options; returns the exit code, 0 or 1."""

_DESCRIPTION = """\
From a magnet's or a coil's geometry to a field model that states its own error: a device card becomes
a mesh, a finite-element solution, a fitted model and a report. Every CARD, MODEL and RECIPE is a name that
`magfem list` shows or the path of a file."""

_EXAMPLES = """\
from card to report:
  magfem list
  magfem show ring_magnet_4x1.5x1
  magfem solve ring_magnet_4x1.5x1 -o solution
  magfem fit ring_magnet_4x1.5x1 -o ring.json
  magfem validate ring.json
  magfem field ring.json --points points.csv -o field.csv --gradient
  magfem export ring.json --to c -o ring.h
  magfem report ring.json -o ring.html

Results go to stdout and progress to stderr. With --json the result on stdout is one JSON value.
exit codes: 0 done, 1 a check failed, 2 bad input, 3 the computation failed"""


class Parser(argparse.ArgumentParser):
    """An ArgumentParser that raises InputError where the stock one prints its usage and leaves."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (`{self.prog} --help` shows examples)")


class CommandLine:
    """All commands; commands add themselves by `add`."""

    def __init__(self) -> None:
        self.parser = Parser(
            prog="magfem",
            description=_DESCRIPTION,
            epilog=_EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        self.parser.add_argument("--version", action="version", version=f"magfem {__version__}")
        _add_common_options(self.parser)
        self._subparsers = self.parser.add_subparsers(metavar="COMMAND", title="commands", required=True)
        self.commands: dict[str, Parser] = {}

    def add(self, name: str, run: Run, summary: str, description: str, examples: Sequence[str]) -> Parser:
        """A new command: one line for the list of commands, one paragraph and examples for its own help."""
        parser = self._subparsers.add_parser(
            name,
            help=summary,
            description=description,
            epilog="\n  ".join(["examples:", *examples]),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        _add_common_options(parser)
        parser.set_defaults(run=run)
        self.commands[name] = parser
        return parser

    def parse(self, arguments: Sequence[str]) -> Namespace:
        """The options, with `run` among them. Raises InputError, and SystemExit after --help or --version."""
        word = next((argument for argument in arguments if not argument.startswith("-")), None)
        if word is not None and word not in self.commands:
            nearest = get_close_matches(word, self.commands, n=1, cutoff=0.0)[0]
            raise InputError(f"unknown command {quoted(word)}; the nearest is {quoted(nearest)}")
        return self.parser.parse_args(arguments, Namespace(json=False, quiet=False, debug=False))


def _add_common_options(parser: Parser) -> None:
    """Options that stand before or after the command; `CommandLine.parse` knows their defaults."""
    for flags, text in (
        (("--json",), "print the machine-readable result on stdout"),
        (("-q", "--quiet"), "no progress on stderr"),
        (("--debug",), "show where an error comes from"),
    ):
        parser.add_argument(*flags, action="store_true", default=argparse.SUPPRESS, help=text)


def add_dimension(parser: Parser, default: int | None, shown: str) -> None:
    """--dimension; `shown` says the default in words."""
    parser.add_argument(
        "--dimension",
        type=int,
        choices=(2, 3),
        default=default,
        help=f"2: the half section, 3: the whole space (default: {shown})",
    )


def add_resolution(parser: Parser, default: float | None, shown: str) -> None:
    """--resolution; `shown` says the default in words."""
    parser.add_argument(
        "--resolution",
        type=float,
        metavar="FACTOR",
        default=default,
        help=f"fineness of the mesh; doubling it halves every element (default: {shown})",
    )
