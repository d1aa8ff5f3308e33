"""One look for all figures: colours, sizes, and the way from a Matplotlib figure to a picture on a page."""

from __future__ import annotations

import io
import math
import struct
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

WIDTH = 4.6  # inches; about a phone's width, so that the lettering stays legible there
DPI = 200
_SHORT = 80.0  # ratio of a logarithmic axis' ends up to which whole decades are too few labels

# Okabe and Ito's palette: told apart by colour-blind readers, and in grey by lightness.
BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
SKY, YELLOW = "#56B4E9", "#E69F00"
INK, GREY, PALE = "#1f2429", "#6b737b", "#d9dde1"
NORTH, SOUTH = "#C8442E", "#2F6DB3"
COPPER, LEAD, EDGE = "#C77B3B", "#E9C9A4", "#6B3F1A"  # of coils: turns, leads, their outlines
MODEL, FEM, EXACT, MEASURED = BLUE, INK, GREEN, ORANGE
RIVALS = (ORANGE, PURPLE, YELLOW, GREEN, SKY)
DASHES = ("--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)))  # of the rivals
MAGNITUDE, ERROR = "viridis", "cividis"  # colour maps of |B| and of relative errors

_STYLE: Any = {  # typed by name in some releases of Matplotlib only
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "axes.unicode_minus": True,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "text.color": INK,
    "hatch.color": "#9aa2aa",
    "hatch.linewidth": 0.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@dataclass(frozen=True)
class Picture:
    """A PNG with the words that replace it (`alt`) and the words below it (`caption`)."""

    name: str
    png: bytes
    alt: str
    caption: str

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, from the PNG's header."""
        width, height = struct.unpack(">II", self.png[16:24])
        return width, height


@contextmanager
def drawing() -> Iterator[None]:
    """Within it, Matplotlib draws in the common look."""
    with mpl.rc_context(_STYLE):
        yield


def figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, sizes in inches; its layout keeps labels from overlapping."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def png(drawn: Figure) -> bytes:
    """The figure as a PNG, the same bytes every time."""
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def plain_log(axis: Any, fine: bool = False) -> None:
    """Label a logarithmic axis 0.1, 1, 10 as far as these read well; `fine` adds 2 and 5."""
    axis.set_major_locator(LogLocator(10, subs=(1, 2, 5) if fine else (1,), numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value)))


def percent_log(axis: Any) -> None:
    """Label a logarithmic axis of relative errors in percent: 1 %, 0.1 %, down to 10⁻⁶ %; a short one 1, 2, 5 %."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(10, subs=(1, 2, 5) if 0 < high < _SHORT * low else (1,), numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{_tick(100 * value)} %"))


def wrapped(label: str, width: int = 56) -> str:
    """A legend's label on as many lines as it needs to fit below a figure."""
    return textwrap.fill(label, width)


def length(value: float) -> str:
    """A length (m) in mm, as figures label it."""
    return f"{value * 1e3:.4g} mm"


def grid(axes: Axes) -> None:
    """A quiet grid behind the curves."""
    axes.grid(True, which="major")
    axes.set_axisbelow(True)


def _tick(value: float) -> str:
    if value <= 0:
        return "0"
    if 0.9e-4 <= value < 1e5:
        return f"{value:.6f}".rstrip("0").rstrip(".") if value < 1 else f"{value:.0f}"
    exponent = round(math.log10(value))
    return f"$10^{{{exponent}}}$"
