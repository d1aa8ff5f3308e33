"""Printing a page to PDF with the Chromium or Chrome that is on the PATH."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from magfem.errors import MagfemError, MissingProgramError
from magfem.files import write_bytes

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
_SECONDS = 120
_QUIET = (
    "--headless=new",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-domain-reliability",
    "--disable-extensions",
    "--disable-sync",
    "--metrics-recording-only",
    "--no-pings",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no name resolves: nothing can be fetched
    "--no-pdf-header-footer",
)


def find_browser() -> str:
    """The path of a browser. Raises MissingProgramError with the line to type."""
    for name in BROWSERS:
        found = shutil.which(name)
        if found:
            return found
    raise MissingProgramError(
        f"printing to PDF needs Chromium or Chrome ({', '.join(BROWSERS)}) on the PATH; "
        "on Debian type: apt-get install chromium"
    )


def print_pdf(html: Path) -> Path:
    """Print a page of one file beside itself, with the ending .pdf; returns where."""
    browser, target = find_browser(), html.with_suffix(".pdf")
    with tempfile.TemporaryDirectory(prefix="magfem-print-") as profile:
        draft = Path(profile) / "page.pdf"
        command = [browser, *_QUIET, f"--user-data-dir={profile}/user", f"--print-to-pdf={draft}"]
        if os.geteuid() == 0:
            command.append("--no-sandbox")  # Chromium refuses to run as root with its sandbox
        try:
            done = subprocess.run(
                [*command, html.resolve().as_uri()], capture_output=True, text=True, timeout=_SECONDS, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise MagfemError(f"{browser} could not print the page: {error}") from None
        if not draft.exists() or not draft.read_bytes().startswith(b"%PDF"):
            last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise MagfemError(f"{browser} could not print the page: {last}")
        write_bytes(target, draft.read_bytes())
    return target
