"""The dissertation's own ring fits as published: displaced axial multipoles, window by window."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from magfem.fields.terms import Terms, concatenate
from magfem.fitting.published import published_axial_multipole

_FILE = Path(__file__).parent / "published_ring_magnet_fits.json"  # source and licence are stated in it


def published_ring_fits() -> dict[str, tuple[Terms, dict[str, Any]]]:
    """By name ("front", "side"): the field and the window in z and rho, m, that the file's name states."""
    return {
        name: (_terms(fit["sources"]), fit["window"]) for name, fit in json.loads(_FILE.read_text())["fits"].items()
    }


def _terms(sources: list[dict[str, Any]]) -> Terms:
    parts = []
    for source in sources:
        terms = published_axial_multipole(source["a"], radius=2e-3)
        parts.append(replace(terms, centre=np.array([[0.0, 0.0, source["z_source_m"]]])))
    return concatenate(parts)
