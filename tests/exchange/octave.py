"""GNU Octave as a program that tests run."""

from __future__ import annotations

import subprocess
from pathlib import Path


def run_octave(program: str, script: str, folder: Path) -> str:
    """What Octave prints when it runs `script` in `folder`; a warning is an error to this."""
    (folder / "script.m").write_text(script)
    words = [program, "--no-gui", "--norc", "--no-history", "--quiet", "script.m"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return done.stdout
