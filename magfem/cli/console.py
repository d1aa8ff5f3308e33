"""What people and programs read: results on stdout, progress on stderr."""

from __future__ import annotations

import logging
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.typing import Floats


def show_result(options: Namespace, text: str, data: Any) -> None:
    """Print a command's result: `text` for people, or with --json `data` on stdout and `text` on stderr."""
    if not options.json:
        print(text)
        return
    from magfem.files import to_json

    print(to_json(data))
    if not options.quiet:
        print(text, file=sys.stderr)


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of equal length as aligned lines: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  " + "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]).rstrip() for row in rows
    )


def listing(rows: Sequence[tuple[str, str]]) -> str:
    """Names, each with its text after it."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join(f"  {name:{width}}  {text}".rstrip() for name, text in rows)


def moment_text(moment: Floats) -> str:
    """A magnetic moment (3,) A·m² in words; what rounding leaves of a component is none."""
    least = 1e-9 * max(map(abs, moment))
    shown = [float(component) if abs(component) > least else 0.0 for component in moment]
    return f"({', '.join(format_quantity(component, 'moment') for component in shown)})"


@contextmanager
def progress(quiet: bool) -> Iterator[None]:
    """Within it, the library's progress goes to stderr, a line per stage with the seconds since the start."""
    log = logging.getLogger("magfem")
    handler = logging.StreamHandler()
    handler.setFormatter(_Elapsed())
    level = log.level
    log.setLevel(logging.WARNING if quiet else logging.INFO)
    log.addHandler(handler)
    logging.getLogger("skfem").setLevel(logging.ERROR)  # its warnings are about the layout of its own arrays
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


class _Elapsed(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return f"{record.relativeCreated / 1000:5.1f} s  {record.getMessage()}"
