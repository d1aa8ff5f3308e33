"""The two verbs of the report stage."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from pathlib import Path

from magfem.errors import InputError
from magfem.files import write_bytes, write_text
from magfem.geometry import Coil, Geometry, Magnets
from magfem.samples import Samples

log = logging.getLogger("magfem")


def write_report(
    target: str | os.PathLike[str], path: str | os.PathLike[str], pdf: bool = False, samples: Samples | None = None
) -> tuple[Path, ...]:
    """Write the report of a card, a model or a report recipe (name or path) as one HTML page.

    pdf: also print it, beside the page and with the ending .pdf.  samples: to hold the model against. Returns the
    files written.
    Raises InputError before anything is computed when the place cannot be written or no browser is there to
    print, CardError for a card or recipe that is wrong, MissingProgramError when nothing can be drawn.
    """
    from magfem.report.coil_page import render as render_coil
    from magfem.report.page import render
    from magfem.report.pdf import find_browser, print_pdf
    from magfem.report.subject import CoilSubject, gather

    html = _writable(path, (".html", ".htm"))
    if pdf:
        find_browser()
    subject = gather(target)
    if isinstance(subject, CoilSubject):
        if samples is not None:
            raise InputError("samples are held against a model: fit one to the coil first")
        write_text(html, render_coil(subject))
    else:
        write_text(html, render(replace(subject, samples=samples)))
    log.info("report: %s", html)
    return (html, print_pdf(html)) if pdf else (html,)


def show_picture(geometry: Geometry, path: str | os.PathLike[str]) -> Path:
    """Draw a device to a PNG: magnets with poles, moment and dimensions, coils with the way of the current.

    Nothing is solved.
    """
    from magfem.report.coil_scenes import coil_picture
    from magfem.report.scenes import device_picture
    from magfem.report.surface import surfaces

    target = _writable(path, (".png",))
    if isinstance(geometry, Coil):
        picture = coil_picture(geometry)
    else:
        assert isinstance(geometry, Magnets)
        picture = device_picture(geometry, surfaces(geometry))
    write_bytes(target, picture.png)
    return target


def _writable(path: str | os.PathLike[str], endings: tuple[str, ...]) -> Path:
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise InputError(f"cannot write: the name must end in {endings[0]} [{target}]")
    if not target.parent.is_dir():
        raise InputError(f"cannot write: there is no folder {target.parent} [{target}]")
    if target.is_dir():
        raise InputError(f"cannot write: this is a folder [{target}]")
    return target
