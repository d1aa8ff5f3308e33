"""Whether the coils of a calibration, and the background, can be told apart by the currents that were driven."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.errors import InputError
from magfem.samples import SystemSamples
from magfem.typing import Booleans, Floats, Integers

ALIKE = 1e-3
"""Share of a coil's currents that the others must leave unexplained for it to count as driven on its own."""

FEWEST_PLACES = 8
_SAME = 1e-6  # of the extent: positions this near are one
_THIN = 1e-6  # of the extent: positions whose spread across a line is less are on it


def places(samples: SystemSamples) -> tuple[Floats, Integers]:
    """The positions (q, 3) m where measurements were made, and that of every sample (n,)."""
    step = _SAME * max(float(samples.extent.max()), 1e-12)
    cells = np.round((samples.points - samples.centre) / step)
    _, first, place = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return samples.points[first], place.reshape(-1)


def check_samples(samples: SystemSamples, positions: Floats, names: Sequence[str], background: bool) -> None:
    """Raise InputError for samples that cannot tell the coils' fields: positions (q, 3), currents, B.

    names: of the coils, as people know them.
    """
    where = f" [{samples.source}]" if samples.source else ""
    if len(positions) < FEWEST_PLACES:
        raise InputError(
            f"{len(positions)} positions are too few for a calibration: {FEWEST_PLACES} or more are needed, spread "
            f"over the workspace{where}"
        )
    spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    if spread[1] < _THIN * spread[0]:
        raise InputError(
            f"all positions lie on a line: a calibration needs them spread in two directions or three{where}"
        )
    if not samples.B.any():
        raise InputError(f"B is zero in every row: there is nothing to calibrate{where}")
    _check_currents(samples.currents, names, where)
    if background:
        _check_background(samples.currents, names, where)


def _check_currents(currents: Floats, names: Sequence[str], where: str) -> None:
    length = np.linalg.norm(currents, axis=0)
    idle = [name for name, size in zip(names, length, strict=True) if size == 0]
    if idle:
        raise InputError(
            f"{_listed(idle)} carried no current in any row: drive every coil, or leave its column out{where}"
        )
    scaled = currents / length
    cosine = np.abs(scaled.T @ scaled) - np.eye(len(names))
    first, second = (int(k) for k in np.unravel_index(int(np.argmax(cosine)), cosine.shape))
    if 1 - cosine[first, second] ** 2 < ALIKE**2:
        pair = _listed([names[min(first, second)], names[max(first, second)]])
        raise InputError(
            f"the currents of {pair} are proportional in all rows, so their fields cannot be told apart: drive one "
            f"without the other{where}"
        )
    tied = _tied(scaled)
    if tied.any():
        group = _listed([name for name, one in zip(names, tied, strict=True) if one])
        raise InputError(
            f"the currents of {group} depend on each other linearly in all rows, so their fields cannot be told apart: "
            f"add rows that drive each of them alone{where}"
        )


def _check_background(currents: Floats, names: Sequence[str], where: str) -> None:
    scaled = np.column_stack(
        [currents / np.linalg.norm(currents, axis=0), np.ones(len(currents)) / len(currents) ** 0.5]
    )
    tied = _tied(scaled)
    if tied[-1]:
        group = _listed([name for name, one in zip(names, tied[:-1], strict=True) if one])
        raise InputError(
            f"the currents of {group} add up to a constant in all rows, so the background cannot be told from their "
            f"fields: add rows without currents or with reversed ones, or calibrate without a background{where}"
        )


def _tied(scaled: Floats) -> Booleans:
    """Which columns (k,) of length one take part in a combination that is nearly zero in all rows."""
    # The triangle has the same null space, and all of it also where there are fewer rows than columns.
    _, size, directions = np.linalg.svd(np.linalg.qr(scaled, mode="r"))
    size = np.pad(size, (0, scaled.shape[1] - size.size))
    nothing = directions[size < ALIKE]
    return np.asarray((np.abs(nothing) > 0.05).any(axis=0)) if len(nothing) else np.zeros(scaled.shape[1], dtype=bool)


def _listed(names: Sequence[str]) -> str:
    """Names as people list them."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
