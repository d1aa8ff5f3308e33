"""Block magnets: cuboids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from magfem.geometry.box import Box
from magfem.geometry.card import Table
from magfem.geometry.device import length_text
from magfem.geometry.limits import InvalidValue, check_length, check_thickness
from magfem.geometry.single_magnet import SingleMagnet
from magfem.geometry.vectors import is_triple, three_lengths
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class BlockMagnet(SingleMagnet):
    """A cuboid with edges along x, y and z, centre at the origin. Raises InputError when it is impossible."""

    kind = "block_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("width", "depth", "height")  # along x, y, z: the card's one `size`

    size: tuple[float, float, float]  # m, along x, y, z

    @property
    def width(self) -> float:
        """Along x, m."""
        return self.size[0]

    @property
    def depth(self) -> float:
        """Along y, m."""
        return self.size[1]

    @property
    def height(self) -> float:
        """Along z, m."""
        return self.size[2]

    @property
    def shape(self) -> Box:
        return Box(self.size)

    def check_lengths(self) -> float:
        object.__setattr__(self, "size", check_size(self.words, self.size))
        return max(self.size)

    @classmethod
    def dimensions_from_card(cls, card: Table) -> dict[str, Any]:
        table = card.table("dimensions")
        table.only("size")
        return {"size": three_lengths(table, "size")}

    def dimensions_table(self) -> dict[str, Any]:
        return {"size": [length_text(length) for length in self.size]}


def check_size(words: str, size: Any) -> tuple[float, float, float]:
    """The three lengths (m) of a block; InvalidValue for what none can have."""
    key = "dimensions.size"
    if not is_triple(size):
        raise InvalidValue(f"{words}: size must be three lengths, along x, y and z, got {describe(size)}", key)
    for length in size:
        check_length(words, key, length)
        check_thickness(words, key, "every length of size", length, max(size))
    x, y, z = map(float, size)
    return x, y, z
