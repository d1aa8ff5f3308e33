"""The folder that a closed system's run leaves: numbers, a time series, pictures, an animation and a page."""

from __future__ import annotations

import base64
import io
import logging
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from magfem.files import write_folder, write_json, write_text
from magfem.report.figures.style import Picture
from magfem.scenario.closed_system import ClosedRun
from magfem.version import __version__

log = logging.getLogger("magfem")

FILES = frozenset(
    ["summary.json", "timeseries.csv", "recipe.toml", "way.png", "errors.png", "animation.gif", "report.html"]
)
"""All that the folder may hold."""


def write_closed_run(run: ClosedRun, folder: Path, pictures: bool = True) -> None:
    """Make or replace `folder`, whole or not at all; without `pictures` it holds numbers alone.

    Raises InputError when it cannot be written.
    """
    write_folder(folder, lambda draft: _fill(run, draft, pictures), FILES)
    log.info("closed system: %s", folder)


def _fill(run: ClosedRun, folder: Path, pictures: bool) -> None:
    write_json(folder / "summary.json", run.summary())
    write_text(folder / "timeseries.csv", time_series(run))
    write_text(folder / "recipe.toml", run.system.text)
    if not pictures:
        return
    from magfem.report.closed_system_pictures import animation, draw

    log.info("closed system: pictures and animation")
    drawn, moving = draw(run), animation(run)
    for picture in drawn:
        (folder / f"{picture.name}.png").write_bytes(picture.png)
    (folder / "animation.gif").write_bytes(moving)
    write_text(folder / "report.html", render(run, drawn, moving))


def time_series(run: ClosedRun) -> str:
    """A line for every localization: s, m, unit vectors; what is true, what is found, and where the tool is."""
    names = ["t"]
    for what in ("true", "found"):
        names += [f"{what}_{axis}" for axis in "xyz"] + [f"{what}_axis_{axis}" for axis in "xyz"]
    names += ["stated_position", "stated_axis", "tool_x", "tool_y", "tool_z"]
    rows = np.array(
        [
            np.concatenate(
                [
                    [one.time],
                    one.true.position,
                    one.true.axis,
                    one.position,
                    one.axis,
                    [one.position_deviation, one.axis_deviation],
                    one.tool,
                ]
            )
            for one in run.localizations
        ]
    )
    buffer = io.StringIO()
    np.savetxt(buffer, rows, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    return buffer.getvalue()


def render(run: ClosedRun, drawn: Sequence[Picture], moving: bytes) -> str:
    """The whole page as HTML; nothing in it is loaded from outside. moving: a GIF."""
    from magfem.report.environment import environment

    data = run.summary()
    return (
        environment()
        .get_template("closed_system_page.html.j2")
        .render(
            title=run.system.name,
            data=data,
            reached=sum(one["reached"] for one in data["targets"]),
            pictures={picture.name: (picture,) for picture in drawn},
            moving=base64.b64encode(moving).decode("ascii"),
            moving_size=struct.unpack("<HH", moving[6:10]),
            recipe=run.system.text,
            version=__version__,
        )
    )
