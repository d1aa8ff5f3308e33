"""Samples from CSV files."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from magfem.errors import InputError
from magfem.samples.assemble import assemble
from magfem.samples.columns import canonical, split_unit
from magfem.samples.comsol import comsol_samples, is_comsol
from magfem.samples.samples import Samples, SystemSamples
from magfem.samples.table import Table, delimiter_of, is_number, parse_table, read_text
from magfem.units import quoted


def read_samples(
    path: str | PathLike[str], columns: Mapping[str, str] | None = None, sigma: float | None = None
) -> Samples | SystemSamples:
    """Field data from a file.

    Parameters
    ----------
    path : a CSV file with the header `x,y,z,Bx,By,Bz` in m and T, and `sigma` for all or `sx,sy,sz` for each component
        if standard deviations are known; of a coil system `px,py,pz,i0,…,iN,bx,by,bz` in m, A and T. A unit in a
        header is understood (`x_mm`, `bx [mT]`, `i0_mA`, `Bz_mT/A`), and case does not count. Components of B may be
        missing, or `nan` in single rows; other columns are ignored. Cells are separated by commas, semicolons or tabs;
        comments (#, %) may come before the header. An export of COMSOL is known by its header (`read_comsol`).
    columns : what stands for what, such as `{"x": "-magnet_x_mm", "y": "=0 mm", "z": "height [mm]"}`: a column of the
        file, with a minus before it if it is to be negated and its unit after it if its name does not end in one; or
        an equals sign and a constant.
    sigma : standard deviation of every component, T (T/A); takes the place of what the file says.

    Returns
    -------
    Samples, or SystemSamples if the file has currents.

    Raises
    ------
    InputError : in one sentence with file, line and column.
    """
    path = Path(path)
    text = read_text(path)
    if is_comsol(text):
        return comsol_samples(path, text, columns, sigma)
    table = parse_table(path, text)
    _check_header(table, text)
    return assemble(table, columns, sigma)


def _check_header(table: Table, text: str) -> None:
    """A header that is a comment, as NumPy writes it, would make the first row of numbers the header."""
    if not table.header or not all(is_number(cell) for cell in table.header):
        return
    comments = [line.lstrip("#% \t") for line in text.split("\n")[: table.header_line - 1]]
    for number, line in enumerate(comments, start=1):
        cells = line.split(delimiter_of(line) or ",")
        if any(canonical(split_unit(cell)[0].partition("_")[0]) for cell in cells):
            raise InputError(f"the header is a comment: take away the mark before it [{table.path}: line {number}]")
    raise InputError(
        f"there is no header: expected x,y,z,Bx,By,Bz or the like, got {quoted(','.join(table.header))} "
        f"[{table.path}: line {table.header_line}]"
    )
