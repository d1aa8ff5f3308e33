"""Field energy of a rigid, axially magnetised ring, from its magnetic charges by Hankel transform."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from scipy.special import j1

from magfem.constants import MU_0


def ring_field_energy(outer: float, inner: float, length: float, remanence: float) -> float:
    """½∫µ₀H² dV (J) over all space; radii and length in m.

    The faces carry charge ±M; with σ(k) = ∫₀^∞ σ J₀(kρ)ρ dρ = M (R J₁(kR) − r J₁(kr))/k and the kernel
    1/|x| = ∫₀^∞ J₀(kρ) e^{−k|z|} dk, the self and mutual energies of the two discs give
    W = 2πµ₀ · ½ ∫₀^∞ σ(k)² (1 − e^{−kL}) dk.
    """
    M = remanence / MU_0

    def integrand(k: float) -> float:
        charge = M * (outer * j1(k * outer) - inner * j1(k * inner)) / k
        return charge**2 * -np.expm1(-k * length)

    # Falls as k⁻³: piecewise over the oscillation, with the averaged tail added in closed form.
    end = 4000 / outer
    edges = np.linspace(1e-9 / outer, end, 2001)
    total = sum(quad(integrand, a, b, epsrel=1e-10)[0] for a, b in pairwise(edges))
    tail = M**2 * (outer + inner) / np.pi / (2 * end**2)  # mean of (R J₁ − r J₁)² → (R + r)/(πk)
    return np.pi * MU_0 * (total + tail)
