"""Files of samples that commands fit, or hold a model against, and the options that say how to read them."""

from __future__ import annotations

from argparse import Namespace, _ArgumentGroup
from typing import TYPE_CHECKING

from magfem.errors import InputError
from magfem.units import one_line, quantity

if TYPE_CHECKING:
    from magfem.samples import Samples, SystemSamples

_FILE = "a file that ends in .csv or .txt"


def is_samples(target: str) -> bool:
    """Whether a name is that of a file of samples."""
    return target.lower().endswith((".csv", ".txt"))


def add_samples_options(group: _ArgumentGroup) -> None:
    """--column and --sigma."""
    group.add_argument("--column", metavar="NAME=COLUMN", action="append", help="what stands for x, y, z, Bx, ...")
    group.add_argument("--sigma", metavar="QUANTITY", help="standard deviation of every component, such as '0.1 mT'")


def refuse_samples_options(options: Namespace, given: str, *further: str) -> None:
    """Raise InputError for options of samples, and `further` ones, where there are none.

    given: what should have been a file of samples, for people.
    """
    for option in ("column", "sigma", *further):
        if getattr(options, option):
            raise InputError(f"--{option} is for samples: {_FILE} as {given}")


def columns_and_sigma(options: Namespace) -> tuple[dict[str, str], float | None]:
    """What stands for which column, and the standard deviation, T. Raises InputError."""
    from magfem.samples import parse_columns

    sigma = quantity(options.sigma, "flux density") if options.sigma else None
    return parse_columns(options.column or []), sigma


def read_any_samples(path: str, options: Namespace) -> Samples | SystemSamples:
    """Samples as the options say. Raises InputError for what cannot be read."""
    from magfem.samples import read_samples

    return read_samples(path, *columns_and_sigma(options))


def read_model_samples(path: str, options: Namespace, given: str) -> Samples:
    """Samples of one source. Raises InputError for what cannot be read, and for samples of a coil system."""
    from magfem.samples import SystemSamples

    if not is_samples(path):
        raise InputError(f"{given} takes {_FILE} with samples [{one_line(path)}]")
    samples = read_any_samples(path, options)
    if isinstance(samples, SystemSamples):
        raise InputError(f"samples of a coil system are of no single model [{one_line(path)}]")
    return samples
