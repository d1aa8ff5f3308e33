"""The folder that a study of localization leaves: numbers, data, pictures and a page."""

from __future__ import annotations

import io
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from magfem.files import write_folder, write_json, write_text
from magfem.report.figures.style import Picture
from magfem.scenario.localization_study import Study
from magfem.version import __version__

log = logging.getLogger("magfem")

_MOST_RANDOM_PATHS = 100
_PICTURES = (
    *("isoline_errors", "range", "track_cubic", "track_helical", "track_sinusoidal"),
    *(f"track_random_{k}" for k in range(1, _MOST_RANDOM_PATHS + 1)),
    *("isoline_positions", "isoline_angles", "isoline_sensitivity", "axis_bias", "sensor_noise", "stator_field"),
    *("stator_bias", "workspaces", "placed"),
)
FILES = frozenset(["summary.json", "data.npz", "recipe.toml", "report.html"] + [f"{name}.png" for name in _PICTURES])
"""All that the folder may hold."""


def write_study(study: Study, folder: Path, pictures: bool = True) -> None:
    """Make or replace `folder`, whole or not at all; without `pictures` it holds numbers alone.

    Raises InputError when it cannot be written.
    """
    write_folder(folder, lambda draft: _fill(study, draft, pictures), FILES)
    log.info("study: %s", folder)


def _fill(study: Study, folder: Path, pictures: bool) -> None:
    write_json(folder / "summary.json", study.summary())
    data = io.BytesIO()
    np.savez_compressed(data, allow_pickle=False, **study.arrays)
    (folder / "data.npz").write_bytes(data.getvalue())
    write_text(folder / "recipe.toml", study.text)
    if not pictures:
        return
    from magfem.report.study_pictures import draw

    log.info("study: pictures")
    drawn = draw(study)
    for picture in drawn:
        (folder / f"{picture.name}.png").write_bytes(picture.png)
    write_text(folder / "report.html", render(study, drawn))


def render(study: Study, drawn: Sequence[Picture]) -> str:
    """The whole page as HTML; nothing in it is loaded from outside."""
    from magfem.report.environment import environment

    limited = [one for one in study.comparisons if one.limit]
    return (
        environment()
        .get_template("study_page.html.j2")
        .render(
            title=study.name,
            study=study,
            kept=sum(one.holds for one in limited),
            limits=len(limited),
            pictures={picture.name: (picture,) for picture in drawn},
            version=__version__,
        )
    )
