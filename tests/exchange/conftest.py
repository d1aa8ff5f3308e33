"""The other programs."""

from __future__ import annotations

import shutil

import pytest


@pytest.fixture(scope="session")
def octave() -> str:
    """GNU Octave's program."""
    program = shutil.which("octave-cli") or shutil.which("octave")
    if not program:
        pytest.skip("needs octave (Debian: octave)")
    return program
