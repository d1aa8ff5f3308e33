"""How long `import magfem` and `magfem --help` take, next to a bare `import numpy`: `python benchmarks/startup.py`."""

from __future__ import annotations

import subprocess
import sys

from tables import alternate, show

COMMANDS = {
    "python -c pass": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    "import magfem": ["-c", "import magfem"],
    "magfem --help": ["-m", "magfem", "--help"],
    "magfem list": ["-m", "magfem", "list"],
}


def main() -> None:
    runs = [
        lambda words=words: subprocess.run([sys.executable, *words], check=True, capture_output=True)
        for words in COMMANDS.values()
    ]
    alternate(runs, 1)  # files into the page cache
    seconds = dict(zip(COMMANDS, alternate(runs, 15), strict=True))
    numpy = seconds["import numpy"]
    show(
        "Start-up, whole processes, median of 15",
        ["process", "ms", "over import numpy"],
        [[name, f"{1e3 * taken:.0f}", f"{taken / numpy:.2f}"] for name, taken in seconds.items()],
    )


if __name__ == "__main__":
    main()
