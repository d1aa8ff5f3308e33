"""The folder that a simulated scenario leaves."""

from __future__ import annotations

import logging
from pathlib import Path

from magfem.files import write_folder, write_json, write_text
from magfem.scenario.run import Run
from magfem.scenario.summary import summary
from magfem.scenario.time_series import shapes, time_series

log = logging.getLogger("magfem")

PICTURES = ("angles", "currents", "shapes", "rods", "forces", "forces_angles")
FILES = frozenset(
    ["summary.json", "timeseries.csv", "shapes.npz", "scenario.toml", "coil.json", "animation.gif", "report.html"]
    + [f"{name}.png" for name in PICTURES]
)
"""All that the folder may hold."""


def write_run(run: Run, folder: Path, pictures: bool = True) -> None:
    """Make or replace `folder`, whole or not at all; without `pictures` it holds numbers alone.

    Raises InputError when it cannot be written, MissingProgramError when nothing can be drawn.
    """
    write_folder(folder, lambda draft: _fill(run, draft, pictures), FILES)
    log.info("scenario: %s", folder)


def _fill(run: Run, folder: Path, pictures: bool) -> None:
    write_json(folder / "summary.json", summary(run))
    write_text(folder / "timeseries.csv", time_series(run))
    (folder / "shapes.npz").write_bytes(shapes(run))
    write_text(folder / "scenario.toml", run.scenario.text)
    if run.coil is not None:
        run.coil.save(folder / "coil.json")
    if not pictures:
        return
    from magfem.report.run_animation import animation
    from magfem.report.run_page import render
    from magfem.report.run_pictures import draw

    drawn = draw(run)
    for picture in drawn:
        (folder / f"{picture.name}.png").write_bytes(picture.png)
    log.info("scenario: animation")
    moving = animation(run)
    (folder / "animation.gif").write_bytes(moving)
    write_text(folder / "report.html", render(run, drawn, moving))
