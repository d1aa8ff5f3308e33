"""Curves in closed form, by arc length: positions and unit tangents (n, 3)."""

from __future__ import annotations

import numpy as np
from scipy.special import ellipeinc, ellipj

LENGTH = 0.05


def circle(s, bend, length=LENGTH):
    """From the origin along +z, turning by `bend` rad in the xz plane over `length`."""
    k = bend / length
    place = np.stack([(1 - np.cos(k * s)) / k, 0 * s, np.sin(k * s) / k], -1)
    return place, np.stack([np.sin(k * s), 0 * s, np.cos(k * s)], -1)


def helix(s, radius, pitch):
    """About the z axis from (radius, 0, 0); pitch: rise per radian. κ = r/(r² + p²), τ = p/(r² + p²)."""
    speed = np.hypot(radius, pitch)
    a = s / speed
    place = np.stack([radius * np.cos(a), radius * np.sin(a), pitch * a], -1)
    return place, np.stack([-radius * np.sin(a), radius * np.cos(a), pitch + 0 * a], -1) / speed


def elastica(s, modulus, length=LENGTH, reach=2.5):
    """Euler's inflectional elastica from an inflection, `reach` of its natural length (Love, § 263), in the yz plane.

    In natural length u: z = 2E(am u) − u, y = 2k (1 − cn u); direction (2 dn² − 1, 2k sn dn); curvature 2k cn.
    """
    u = s / length * reach
    sn, cn, dn, am = ellipj(u, modulus**2)
    z, y = 2 * ellipeinc(am, modulus**2) - u, 2 * modulus * (1 - cn)
    place = np.stack([0 * s, y, z], -1) * length / reach
    return place, np.stack([0 * s, 2 * modulus * sn * dn, 2 * dn**2 - 1], -1), 2 * modulus * cn * reach / length


def jointed(s, bends, lengths):
    """Arcs in the xz plane, one after the other with a common tangent; bend zero is a straight stretch."""
    place, tangent = np.zeros((s.size, 3)), np.zeros((s.size, 3))
    at, angle, begin = np.zeros(2), 0.0, 0.0
    for bend, length in zip(bends, lengths, strict=True):
        here = (s >= begin - 1e-15) if begin else np.ones(s.size, bool)
        for own, which in ((np.clip(s - begin, 0, length), here), (np.array([length]), None)):
            k = bend / length
            turn = angle + k * own
            if bend:
                x, z = (np.cos(angle) - np.cos(turn)) / k, (np.sin(turn) - np.sin(angle)) / k
            else:
                x, z = own * np.sin(angle), own * np.cos(angle)
            if which is None:
                at, angle = np.array([at[0] + x[0], at[1] + z[0]]), turn[0]
            else:
                place[which] = np.stack([at[0] + x, 0 * x, at[1] + z], -1)[which]
                tangent[which] = np.stack([np.sin(turn), 0 * x, np.cos(turn)], -1)[which]
        begin += length
    return place, tangent
