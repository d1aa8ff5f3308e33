"""The kinds of sources that field models are made of, all of them exact solutions of Maxwell's equations in air."""

from __future__ import annotations

LOOP = 0
"""A circular current loop about its frame's z: one coefficient, the current in A."""

HARMONIC = 1
"""Exterior solid harmonics about the centre: coefficients in T, with degree, order and part (sine)."""

INTERIOR = 2
"""Interior solid harmonics about the centre, such as a uniform background: as HARMONIC, for sources far away."""

OBLATE = 3
"""Exterior axial harmonics about the complex centre c + i·radius ẑ, which is a disc: `sine` marks imaginary parts."""

PATH = 4
"""A closed chain of straight conductors: one coefficient, the current in A."""

CHARGE_DISC = 5
"""A disc of uniform magnetic charge: one coefficient, its density in T. All discs together must be neutral."""

NAMES = {
    LOOP: "loop",
    HARMONIC: "harmonics",
    INTERIOR: "interior",
    OBLATE: "oblate",
    PATH: "path",
    CHARGE_DISC: "charge_disc",
}
"""What model files call them."""
