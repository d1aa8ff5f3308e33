"""Linear least squares: scaled columns, a stated condition, a ridge chosen by the data, and leave-one-out residuals.

With the columns scaled to length one, A = U S Vᵀ, the ridge solution is x = V diag(s/(s² + λ)) Uᵀ b. In Bayes's terms
the scaled parameters have a normal prior of variance v and the residuals one of σ²: λ = σ²/v. The evidence is largest
where v = |x|²/γ and σ² = |r|²/(n − γ), γ = Σ s²/(s² + λ) the number of parameters that the data decide (MacKay, Neural
Computation 4, 415 (1992)): a fixed point in λ. Cross-validation takes the λ with the smallest sum of squared
leave-one-out residuals r_i/(1 − h_i), h_i the leverages (Golub, Heath & Wahba, Technometrics 21, 215 (1979)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from scipy import linalg

from magfem.typing import Booleans, Floats

Ridge: TypeAlias = Literal["none", "evidence", "leave-one-out"]

_LEAST = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class LeastSquares:
    """A solution of min |A x − b|² + λ |scaled x|², A (n, p).

    parameters: (p,).  covariance: (p, p) for residuals of variance `variance`.  condition: of the scaled columns, with
    the ridge.  variance: |r|²/(n − effective), of one row, or what was given as known.  effective: γ.  ridge: λ.
    residual: (n,).  basis: (n, p) the columns of U, singular: (p,) s, of the scaled columns, those of zeros left out.
    preimage: the parameters (p, …) that every column of U stands for, A · preimage = U.
    """

    parameters: Floats
    covariance: Floats
    condition: float
    variance: float
    effective: float
    ridge: float
    residual: Floats
    basis: Floats
    singular: Floats
    preimage: Floats

    @property
    def leave_one_out(self) -> Floats:
        """(n,) the residual of each row had it not been fitted: r_i/(1 − h_i)."""
        leverage = np.minimum((self.basis**2) @ _kept(self.singular, self.ridge), 1.0 - 1e-12)
        left_out: Floats = self.residual / (1.0 - leverage)
        return left_out

    def parameters_without(self, out: Booleans) -> Floats:
        """The parameters (p,) had the rows `out` (n,) not been fitted: what these pulled is taken back.

        x − M_o (1 − H_o)⁻¹ r_o, with M_o the part of the solution operator that acts on them and H_o their leverages.
        """
        own, kept = self.basis[out], _kept(self.singular, self.ridge)
        remaining = (1.0 + 1e-12) * np.eye(len(own)) - (own * kept) @ own.T
        pull = linalg.solve(remaining, self.residual[out], assume_a="pos")
        changed: Floats = self.parameters - self.preimage @ (kept * (own.T @ pull))
        return changed

    def without(self, target: Floats, out: Booleans) -> Floats:
        """The residuals of the rows `out` (n,) had these not been fitted: a small system, no new decomposition.

        In coordinates z = (S² + λ)^½ Vᵀx, and with K = S (S² + λ)^−½, the remaining rows' normal equations are
        (1 − K U_oᵀU_o K) z = K (Uᵀb − U_oᵀb_o).
        """
        root = np.sqrt(_kept(self.singular, self.ridge))
        own = self.basis[out] * root
        normal = np.eye(self.singular.size) - own.T @ own
        coordinates = linalg.lstsq(normal, root * (self.basis.T @ target) - own.T @ target[out], cond=1e-12)[0]
        left_out: Floats = target[out] - own @ coordinates
        return left_out


def solve_least_squares(
    matrix: Floats,
    target: Floats,
    ridge: Ridge = "none",
    variance: float | None = None,
    most_condition: float = math.inf,
    rows: int | None = None,
) -> LeastSquares:
    """Minimise |matrix·x − target|, matrix (n, p), target (n,), by the singular values of the scaled columns.

    variance: of the rows, where it is known.  most_condition: the ridge is at least what keeps the condition below.
    rows: how many there were, where `matrix` holds the triangles that they were reduced to.
    Nothing is truncated: what the data cannot tell shows in the condition, not in a silent zero. Columns of zeros, of
    which the data say nothing at all, get parameters and variances of zero and make the condition infinite.
    """
    length = np.linalg.norm(matrix, axis=0)
    if not length.all():
        return _without_effect(matrix, target, length > 0, ridge, variance, most_condition, rows)
    # A thin triangle first: singular values of a tall matrix cost several times more.
    q, r = linalg.qr(matrix / length, mode="economic", check_finite=False)
    small, s, vt = linalg.svd(r, full_matrices=False, check_finite=False)
    s = np.maximum(s, _LEAST)
    u = q @ small
    projected = u.T @ target
    outside = max(float(target @ target - projected @ projected), 0.0)
    rows = len(matrix) if rows is None else rows
    chosen = 0.0
    if ridge == "evidence":
        chosen = _most_evident(s, projected, outside, rows, variance)
    elif ridge == "leave-one-out":
        chosen = _best_left_out(u, s, projected, target)
    if s[0] > most_condition * s[-1]:  # (s₀² + λ)/(s₋₁² + λ) is the square of the condition
        chosen = max(chosen, float((s[0] ** 2 - (most_condition * s[-1]) ** 2) / (most_condition**2 - 1.0)))
    kept = _kept(s, chosen)
    parameters = vt.T @ (kept / s * projected) / length
    residual = target - u @ (kept * projected)
    effective = float(kept.sum())
    if variance is None:
        variance = float(residual @ residual) / max(rows - effective, 1.0)
    shrunk = np.maximum(s**2 + chosen, _LEAST)
    root = vt.T / np.sqrt(shrunk) / length[:, None]
    return LeastSquares(
        parameters=parameters,
        covariance=variance * root @ root.T,
        condition=float(np.sqrt(shrunk[0] / shrunk[-1])),
        variance=variance,
        effective=effective,
        ridge=chosen,
        residual=residual,
        basis=u,
        singular=s,
        preimage=vt.T / s / length[:, None],
    )


def _without_effect(
    matrix: Floats,
    target: Floats,
    seen: Booleans,
    ridge: Ridge,
    variance: float | None,
    most_condition: float,
    rows: int | None,
) -> LeastSquares:
    """Solve for the columns `seen` (p,); the others are zero."""
    solved = solve_least_squares(matrix[:, seen], target, ridge, variance, most_condition, rows)
    preimage = np.zeros((seen.size, solved.singular.size))
    preimage[seen] = solved.preimage
    parameters, covariance = np.zeros(seen.size), np.zeros((seen.size, seen.size))
    parameters[seen] = solved.parameters
    covariance[np.ix_(seen, seen)] = solved.covariance
    return replace(solved, parameters=parameters, covariance=covariance, condition=math.inf, preimage=preimage)


def _kept(s: Floats, ridge: float) -> Floats:
    """s²/(s² + λ): the share of every scaled direction that the ridge leaves; nothing of those without any effect."""
    return s**2 / np.maximum(s**2 + ridge, _LEAST)


def _most_evident(s: Floats, projected: Floats, outside: float, rows: int, variance: float | None) -> float:
    """The ridge λ of largest evidence, by MacKay's fixed point from a small one; 0 where the data need none."""
    ridge = 1e-12 * float(s[0] ** 2)
    for _ in range(200):
        kept = _kept(s, ridge)
        effective = float(kept.sum())
        size = float(np.sum((kept / s * projected) ** 2))
        if size == 0.0:
            return 0.0
        left = outside + float(np.sum(((1.0 - kept) * projected) ** 2))
        noise = left / max(rows - effective, 1.0) if variance is None else variance
        new = noise * effective / size
        if abs(new - ridge) <= 1e-6 * ridge:
            return new
        ridge = new
    return ridge


def _best_left_out(u: Floats, s: Floats, projected: Floats, target: Floats) -> float:
    """The ridge λ with the smallest leave-one-out residuals, on a logarithmic grid down to rounding."""
    squares = u**2
    best, found = np.inf, 0.0
    for ridge in s[0] ** 2 * np.concatenate([[0.0], 10.0 ** np.arange(-24.0, 0.5, 0.5)]):
        kept = _kept(s, ridge)
        leverage = np.minimum(squares @ kept, 1.0 - 1e-12)
        error = float(np.sum(((target - u @ (kept * projected)) / (1.0 - leverage)) ** 2))
        if error < best:
            best, found = error, float(ridge)
    return found
