"""Sensing in recipes.

    [sensing]
    kind = "cameras"                  # or "exact", which has no other keys than the seed
    seed = 1                          # of the noise
    noise = 0.3                       # px, standard deviation of either coordinate
    points = 120                      # of the rod's axis in a picture
    outliers = 0.01                   # the share of them that show something else
    pictures = 4                      # of every camera for one measurement
    degree = 4                        # of the centreline's polynomial on every flexible section

    [[sensing.cameras]]               # two or more
    position = ["120 mm", "-300 mm", "0 mm"]
    target = ["0 mm", "0 mm", "0 mm"] # what it looks at; the origin when not stated
    focal_length = 2500               # px

Without this table poses are exact.
"""

from __future__ import annotations

from magfem.errors import CardError, InputError
from magfem.geometry.card import Table
from magfem.geometry.vectors import three_lengths
from magfem.rod.cameras import Camera
from magfem.scenario.plain_values import whole_number
from magfem.scenario.sensing import Cameras, Exact, Sensing
from magfem.units import describe


def read_sensing(card: Table) -> tuple[Sensing, int]:
    """The sensing and the seed of its noise; exact poses when a recipe says nothing. Raises CardError."""
    if "sensing" not in card:
        return Exact(), 0
    table = card.table("sensing")
    seed = whole_number(table, "seed", 0, 0)
    kind = table.text("kind")
    if kind == "exact":
        table.only("kind", "seed")
        return Exact(), seed
    if kind != "cameras":
        raise table.error(f'kind must be "exact" or "cameras", got {describe(kind)}', "kind")
    table.only("kind", "seed", "noise", "points", "outliers", "pictures", "degree", "cameras")
    cameras = tuple(_camera(entry) for entry in table.tables("cameras"))
    if len(cameras) < 2:
        raise table.error(f"cameras must be two or more tables [[sensing.cameras]], got {len(cameras)}", "cameras")
    noise, outliers = table.number("noise"), table.number("outliers") if "outliers" in table else 0.0
    if not 0 <= noise < float("inf"):
        raise table.error("noise must be finite and not negative, in pixels", "noise")
    if not 0 <= outliers < 0.5:
        raise table.error("outliers must be a share from 0 to below 0.5", "outliers")
    return (
        Cameras(
            cameras,
            noise,
            points=whole_number(table, "points", 120, 20),
            outliers=outliers,
            pictures=whole_number(table, "pictures", 1, 1),
            degree=whole_number(table, "degree", 4, 2, 16),
        ),
        seed,
    )


def _camera(entry: Table) -> Camera:
    entry.only("position", "target", "focal_length")
    target = three_lengths(entry, "target") if "target" in entry else (0.0, 0.0, 0.0)
    try:
        return Camera.looking_at(target, three_lengths(entry, "position"), entry.number("focal_length"))
    except CardError:
        raise
    except InputError as error:
        raise entry.error(str(error), "position") from None
