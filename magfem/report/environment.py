"""How all report templates are filled in: the filters that they share."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from magfem.report import numbers
from magfem.report.figures.style import DPI, Picture

CSS_PIXELS = 96 / DPI  # of the page, for one of a picture


def environment(filters: Mapping[str, Callable[..., Any]] | None = None) -> Environment:
    """Templates of this folder, with the shared filters and those of one page."""
    found = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters.update(
        percent=_percent,
        bound=_bound,
        number=numbers.number,
        quantity=numbers.quantity,
        size=numbers.size,
        breakable=_breakable,
        measured=numbers.measured,
        millimetres=numbers.millimetres,
        thousands=numbers.thousands,
        direction=numbers.direction,
        inline=_inline,
        width=lambda picture: round(picture.size[0] * CSS_PIXELS),
        height=lambda picture: round(picture.size[1] * CSS_PIXELS),
    )
    found.filters.update(filters or {})
    return found


def _percent(relative: float) -> Markup:
    """A relative error to two digits; the machine-readable value keeps all of them."""
    return Markup('<data value="{}">{}</data>').format(repr(float(relative)), numbers.percent(relative))


def _bound(relative: float) -> Markup:
    return Markup('<data value="{}">{}</data>').format(repr(float(relative)), numbers.bound(relative))


def _breakable(path: str) -> Markup:
    """A path that may be broken after its slashes."""
    return Markup("/<wbr>").join(path.split("/"))


def _inline(picture: Picture) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.png).decode('ascii')}"
