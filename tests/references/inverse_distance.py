"""Derivatives of 1/r of any order, by the rules of differentiation alone: no Legendre polynomials.

A function is a sum of c xᵃ yᵇ zᶜ / rᵖ, kept as {(a, b, c, p): c} with whole numbers, and

    ∂/∂x (xᵃ/rᵖ) = a xᵃ⁻¹/rᵖ − p xᵃ⁺¹/rᵖ⁺².
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

ONE_OVER_R = {(0, 0, 0, 1): 1}


def derivative(function, axis):
    """∂/∂x, y or z (0, 1, 2)."""
    result = defaultdict(int)
    for powers, factor in function.items():
        power, p = powers[axis], powers[3]
        if power:
            result[_changed(powers, axis, power - 1, p)] += power * factor
        result[_changed(powers, axis, power + 1, p + 2)] -= p * factor
    return {powers: factor for powers, factor in result.items() if factor}


def along(axis, order):
    """∂^order/∂(axis)^order (1/r)."""
    function = ONE_OVER_R
    for _ in range(order):
        function = derivative(function, axis)
    return function


def value(function, points):
    """Its value (n,) at points (n, 3), in extended precision."""
    x, y, z = np.asarray(points, dtype=np.longdouble).T
    r = np.sqrt(x * x + y * y + z * z)
    return sum(factor * x**a * y**b * z**c / r**p for (a, b, c, p), factor in function.items())


def gradient(function, points):
    """(n, 3)."""
    return np.stack([value(derivative(function, axis), points) for axis in range(3)], axis=-1)


def second(function, points):
    """(n, 3, 3)."""
    return np.stack([gradient(derivative(function, axis), points) for axis in range(3)], axis=-1)


def _changed(powers, axis, power, p):
    changed = [*powers[:3], p]
    changed[axis] = power
    return tuple(changed)
