"""Fifteen numbers are a whole jet in air: B, and the independent entries of its symmetric, trace-free derivatives."""

from __future__ import annotations

from magfem.compiled import kernel
from magfem.typing import Floats


@kernel
def unpack_gradient(packed: Floats, gradient: Floats) -> None:
    """The symmetric, trace-free (3, 3) from its five numbers."""
    xx, xy, xz, yy, yz = packed[3], packed[4], packed[5], packed[6], packed[7]
    gradient[0, 0], gradient[0, 1], gradient[0, 2] = xx, xy, xz
    gradient[1, 0], gradient[1, 1], gradient[1, 2] = xy, yy, yz
    gradient[2, 0], gradient[2, 1], gradient[2, 2] = xz, yz, -xx - yy


@kernel
def unpack_hessian(packed: Floats, hessian: Floats) -> None:
    """The symmetric, trace-free (3, 3, 3) from its seven numbers."""
    xxx, xxy, xxz, xyy, xyz, yyy, yyz = (
        packed[8],
        packed[9],
        packed[10],
        packed[11],
        packed[12],
        packed[13],
        packed[14],
    )
    xzz, yzz, zzz = -xxx - xyy, -xxy - yyy, -xxz - yyz
    hessian[0, 0, 0], hessian[0, 0, 1], hessian[0, 0, 2] = xxx, xxy, xxz
    hessian[0, 1, 0], hessian[0, 1, 1], hessian[0, 1, 2] = xxy, xyy, xyz
    hessian[0, 2, 0], hessian[0, 2, 1], hessian[0, 2, 2] = xxz, xyz, xzz
    hessian[1, 0, 0], hessian[1, 0, 1], hessian[1, 0, 2] = xxy, xyy, xyz
    hessian[1, 1, 0], hessian[1, 1, 1], hessian[1, 1, 2] = xyy, yyy, yyz
    hessian[1, 2, 0], hessian[1, 2, 1], hessian[1, 2, 2] = xyz, yyz, yzz
    hessian[2, 0, 0], hessian[2, 0, 1], hessian[2, 0, 2] = xxz, xyz, xzz
    hessian[2, 1, 0], hessian[2, 1, 1], hessian[2, 1, 2] = xyz, yyz, yzz
    hessian[2, 2, 0], hessian[2, 2, 1], hessian[2, 2, 2] = xzz, yzz, zzz
