"""Families of the literature, fitted to the same data, that figures show beside a model."""

from __future__ import annotations

from dataclasses import dataclass

from magfem.fields import Region
from magfem.fields.terms import Terms


@dataclass(frozen=True, eq=False)
class Rival:
    """One family's fit, by the words of legends; window: where it is meant to hold."""

    label: str
    terms: Terms
    window: Region
