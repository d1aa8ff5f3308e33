"""The page of a simulated scenario."""

from __future__ import annotations

import base64
import struct
from collections.abc import Sequence

from magfem.report.environment import environment
from magfem.report.figures.style import Picture
from magfem.rod import FlexibleSection, MagnetSection
from magfem.scenario.run import Run
from magfem.scenario.summary import summary
from magfem.units import format_quantity
from magfem.version import __version__

TEMPLATE = "run_page.html.j2"


def render(run: Run, pictures: Sequence[Picture], moving: bytes) -> str:
    """The whole page as HTML; nothing in it is loaded from outside. moving: a GIF."""
    data = summary(run)
    reached = [max(one["error_deg"]) for one in data["targets"] if one["outcome"] == "converged"]
    template = environment({"degrees": _degrees}).get_template(TEMPLATE)
    return template.render(
        title=run.scenario.name,
        data=data,
        worst=float(max(reached)) if reached else None,
        pictures={picture.name: (picture,) for picture in pictures},
        moving=base64.b64encode(moving).decode("ascii"),
        moving_size=struct.unpack("<HH", moving[6:10]),
        sections=[section_words(one) for one in run.scenario.rod.sections],
        recipe=run.scenario.text,
        version=__version__,
    )


def section_words(one: FlexibleSection | MagnetSection) -> str:
    """A section in a few words, as the controller's model has it."""
    length = format_quantity(one.length, "length")
    if isinstance(one, MagnetSection):
        moment = ", ".join(format_quantity(float(part), "moment") for part in one.moment_vector)
        return f"{length} of magnet, moment ({moment}), {format_quantity(one.mass, 'mass')}"
    radius = "" if one.radius is None else f", radius {format_quantity(one.radius, 'length')}"
    return f"{length} flexible{radius}, Young’s modulus {format_quantity(one.youngs_modulus, 'pressure')}"


def _degrees(values: Sequence[float], digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}°" for value in values)
