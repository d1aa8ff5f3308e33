"""From the words on the command line to an exit code."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Sequence

from magfem.cli import export, field, fit, listing, localize, mesh, report, show, simulate, solve, validate
from magfem.cli.console import progress
from magfem.cli.parser import CommandLine
from magfem.errors import MagfemError
from magfem.units import one_line

INTERRUPTED, BROKEN_PIPE = 130, 141
"""Exit codes as shells give them to programs that SIGINT or SIGPIPE ended."""


def command_line() -> CommandLine:
    """The parser with all commands, in the order in which help shows them."""
    commands = CommandLine()
    for command in (listing, show, mesh, solve, fit, validate, field, export, report, simulate, localize):
        command.add(commands)
    return commands


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; `argv` without the program's name, by default the process's own.

    Returns the exit code: 0 done, 1 a check failed, 2 bad input, 3 the computation failed. Every error is one
    line on stderr.
    """
    arguments = sys.argv[1:] if argv is None else argv
    try:
        code = _run(arguments)
        sys.stdout.flush()
        return code
    except (Exception, KeyboardInterrupt) as error:
        if "--debug" in arguments:
            traceback.print_exc()
        return _explain(error)


def _run(arguments: Sequence[str]) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal without µ is no reason to fail
    commands = command_line()
    if not arguments:
        commands.parser.print_help(sys.stderr)
        return 2
    try:
        options = commands.parse(arguments)
    except SystemExit:  # after --help and --version
        return 0
    with progress(options.quiet):
        code: int = options.run(options)
    return code


def _explain(error: BaseException) -> int:
    """Say on stderr, in one line, what went wrong; the exit code for it."""
    if isinstance(error, BrokenPipeError):
        # Whoever read stdout has seen enough. Python flushes it once more when it ends: let that succeed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    if isinstance(error, KeyboardInterrupt):
        message, code = "interrupted", INTERRUPTED
    elif isinstance(error, MagfemError):
        message, code = f"error: {error}", error.exit_code
    elif isinstance(error, MemoryError):
        message, code = "error: out of memory: lower the resolution", 3
    elif isinstance(error, ModuleNotFoundError):
        message, code = f"error: the Python package {error.name} is missing: pip install {error.name}", 2
    elif isinstance(error, OSError):
        place = f" [{error.filename}]" if error.filename else ""
        message, code = f"error: {error.strerror or error}{place}", 2
    else:
        message = f"error: {type(error).__name__}: {error}: this is a bug in magfem (--debug shows where)"
        code = 3
    print(f"magfem: {one_line(message)}", file=sys.stderr)
    return code
