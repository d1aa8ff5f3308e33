"""Files of samples that commands hold a model against, and the options that say how to read them."""

from __future__ import annotations

from argparse import Namespace, _ArgumentGroup
from typing import TYPE_CHECKING

from magfem.errors import InputError
from magfem.units import quantity

if TYPE_CHECKING:
    from magfem.samples import Samples


def add_samples_options(group: _ArgumentGroup) -> None:
    """--column and --sigma."""
    group.add_argument("--column", metavar="NAME=COLUMN", action="append", help="what stands for x, y, z, Bx, ...")
    group.add_argument("--sigma", metavar="QUANTITY", help="standard deviation of every component, such as '0.1 mT'")


def refuse_samples_options(options: Namespace, given_by: str) -> None:
    """Raise InputError for options of samples where there are none."""
    for option in ("column", "sigma"):
        if getattr(options, option):
            raise InputError(f"--{option} is for samples: {given_by} a file that ends in .csv or .txt")


def read_model_samples(path: str, options: Namespace, given_by: str) -> Samples:
    """Samples of one source. Raises InputError for what cannot be read, and for samples of a coil system."""
    from magfem.samples import SystemSamples, parse_columns, read_samples

    if not path.lower().endswith((".csv", ".txt")):
        raise InputError(f"{given_by} takes a file of samples that ends in .csv or .txt [{path}]")
    sigma = quantity(options.sigma, "flux density") if options.sigma else None
    samples = read_samples(path, parse_columns(options.column or []), sigma)
    if isinstance(samples, SystemSamples):
        raise InputError(f"samples of a coil system are of no single model [{path}]")
    return samples
