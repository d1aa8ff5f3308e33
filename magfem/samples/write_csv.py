"""Samples as CSV files."""

from __future__ import annotations

from magfem.samples.samples import AXES, Samples, SystemSamples
from magfem.samples.table import table_text


def samples_text(samples: Samples | SystemSamples) -> str:
    """The CSV that `read_samples` reads the same samples from, bit by bit, but for their source.

    In m, A and T; fields per ampere have their unit in the header (`Bx_T/A`). A component that was not measured is
    `nan`.
    """
    if isinstance(samples, SystemSamples):
        header = ["px", "py", "pz", *(f"i{k}" for k in range(samples.coils)), "bx", "by", "bz"]
        values = [samples.points, samples.currents, samples.B]
        unit = ""
    else:
        unit = "" if samples.unit == "T" else f"_{samples.unit}"
        header = [*AXES, *(f"B{axis}{unit}" for axis in AXES)]
        values = [samples.points, samples.B]
    if samples.sigma is not None:
        header += [f"s{axis}{unit}" for axis in AXES]
        values.append(samples.sigma)
    return table_text(header, values)
