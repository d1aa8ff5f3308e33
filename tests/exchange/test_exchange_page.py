"""What docs/exchange.md shows, done: its commands, its C program, its MATLAB lines."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from exchange.octave import run_octave

import magfem
from magfem.cli import main

PAGE = (Path(__file__).parents[2] / "docs" / "exchange.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The page's first block of a language."""
    found = re.search(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found, language
    return found.group(1)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the page's first commands have been typed."""
    folder = tmp_path_factory.mktemp("exported")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in block("sh").splitlines():
            assert main([*shlex.split(line)[1:], "-q"]) == 0
    return folder


def expected() -> str:
    """What the model itself says at 3 mm on the axis."""
    B, gradient = magfem.load_model("ring_magnet_4x1.5x1").jet([0.0, 0.0, 3e-3])
    return f"Bz = {B[2]:.4f} T, dBz/dz = {gradient[2, 2]:.1f} T/m"


def test_c_program_prints_what_the_page_says(exported: Path) -> None:
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("needs a C compiler (Debian: gcc, libc6-dev)")
    (exported / "use_ring.c").write_text(block("c"))
    words = re.search(r"`(cc [^`]+)`", PAGE)
    assert words
    subprocess.run(shlex.split(words.group(1)), cwd=exported, check=True)
    printed = subprocess.run([exported / "use_ring"], capture_output=True, text=True, check=True).stdout
    assert printed == f"{expected()}, inside: 1\n" == block("text")


def test_matlab_lines_print_the_same(exported: Path, octave: str) -> None:
    assert run_octave(octave, block("matlab"), exported) == f"{expected()}\n"
