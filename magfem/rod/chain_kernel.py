"""The rod as a chain of links: its shape, its energy's gradient and Hessian, in compiled code.

A flexible link is one element of length h with strains at its two Gauss points. Its end follows from its start by two
screw motions, exp(η₁) and exp(η₂), η₁ = h (a₁ ξ₁ + a₂ ξ₂), η₂ = h (a₂ ξ₁ + a₁ ξ₂), a = 1/4 ± √3/6: the commutator-free
Magnus integrator of order four (Blanes & Moan, Appl. Numer. Math. 56 (2006) 1519). The twists η = (α, ν) are the
unknowns themselves. In them the elastic energy of the link, ½ (h/2) Σ (ξ_i − ξ̂_i)ᵀ K (ξ_i − ξ̂_i), is

    (1/2h) [7/4 (|e₁|² + |e₂|²) + ½ e₁·e₂],   e = η − η̂,   a·b = aᵀ K b.

A rigid link is a fixed shift along its own z. The rod's potential energy is a function of all twists, which are plain
vectors; its exact Hessian is that of a discrete optimal control problem with a cross-section's pose as its state. A
Riccati recursion from the tip to the base factors it in time proportional to the number of links, and the signs of
its pivots are the inertia of the whole Hessian (Sylvester).

Spatial variations of a pose are x = (ω, v): dR = [ω]× R, dp = v. J(α) = I + c₁ [α]× + c₂ [α]×² is the left Jacobian of
rotations: exp maps α + dα to exp([J dα]×) exp(α), and a screw (α, ν) moves its origin by J(α) ν.
"""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel
from magfem.typing import Booleans, Floats

NEUTRAL = 1e-9
"""Of a link's bending stiffness: pivots below count as zero, such as that of a turn which no load resists."""

_ROUNDING = 1e-15  # of its shear stiffness at the arm of its length: what rounding leaves of a pivot of zero

_TERMS = 12  # of the series in θ²: exact to rounding for links that turn by less than π
_C1 = np.array([(-1.0) ** k / float(np.prod(np.arange(1.0, 2 * k + 3))) for k in range(_TERMS)])  # (1 − cos θ)/θ²
_C2 = np.array([(-1.0) ** k / float(np.prod(np.arange(1.0, 2 * k + 4))) for k in range(_TERMS)])  # (θ − sin θ)/θ³

OWN, CROSS = 1.75, 0.25  # of the elastic energy's second derivatives, K/h each: 7/4 of a twist, 1/4 between the two


@kernel
def _series(t: float, out: Floats) -> None:
    """c₁, c₂ and their first and second derivatives with respect to t = |α|², to out (6,)."""
    a = b = c = d = e = f = 0.0
    for k in range(_TERMS - 1, -1, -1):
        c = c * t + 2.0 * b
        b = b * t + a
        a = a * t + _C1[k]
        f = f * t + 2.0 * e
        e = e * t + d
        d = d * t + _C2[k]
    out[0], out[1], out[2], out[3], out[4], out[5] = a, d, b, e, c, f


@kernel
def _screw(R: Floats, twist: Floats, c: Floats, R_end: Floats, p: Floats, p_end: Floats) -> None:
    """From the pose R, p over the twist (α, ν), 6 numbers, to R_end, p_end; c are the series at |α|²."""
    x, y, z = twist[0], twist[1], twist[2]
    t = x * x + y * y + z * z
    c1, c2 = c[0], c[1]
    s = 1.0 - t * c2
    # exp(α) = I + s [α] + c₁ [α]²,  J ν = ν + c₁ α × ν + c₂ α × (α × ν)
    e00, e11, e22 = 1.0 - c1 * (y * y + z * z), 1.0 - c1 * (x * x + z * z), 1.0 - c1 * (x * x + y * y)
    e01, e10 = c1 * x * y - s * z, c1 * x * y + s * z
    e02, e20 = c1 * x * z + s * y, c1 * x * z - s * y
    e12, e21 = c1 * y * z - s * x, c1 * y * z + s * x
    u, v, w = twist[3], twist[4], twist[5]
    ku, kv, kw = y * w - z * v, z * u - x * w, x * v - y * u
    du = u + c1 * ku + c2 * (y * kw - z * kv)
    dv = v + c1 * kv + c2 * (z * ku - x * kw)
    dw = w + c1 * kw + c2 * (x * kv - y * ku)
    for i in range(3):
        r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
        R_end[i, 0] = r0 * e00 + r1 * e10 + r2 * e20
        R_end[i, 1] = r0 * e01 + r1 * e11 + r2 * e21
        R_end[i, 2] = r0 * e02 + r1 * e12 + r2 * e22
        p_end[i] = p[i] + r0 * du + r1 * dv + r2 * dw


@kernel
def shape(
    flexible: Booleans,
    length: Floats,
    stiffness: Floats,
    rest: Floats,
    twist: Floats,
    R: Floats,
    p: Floats,
    R_middle: Floats,
    p_middle: Floats,
) -> float:
    """Poses of all nodes from the first; returns the elastic energy, J.

    flexible, length: (e,) of each link.  stiffness: (e, 6) N·m² and N, of curvatures and strains.  rest, twist: (e, 12)
    both twists without load, and as they are.  R, p: (e + 1, 3, 3), (e + 1, 3), the base's given; R_middle, p_middle
    between the two screws of a link.
    """
    c = np.empty(6)
    energy = 0.0
    for k in range(flexible.size):
        if flexible[k]:
            for i in range(6):
                e1, e2 = twist[k, i] - rest[k, i], twist[k, 6 + i] - rest[k, 6 + i]
                square = OWN * (e1 * e1 + e2 * e2) + 2.0 * CROSS * e1 * e2
                energy += 0.5 * stiffness[k, i] / length[k] * square
            first, second = twist[k, :6], twist[k, 6:]
            _series(first[0] ** 2 + first[1] ** 2 + first[2] ** 2, c)
            _screw(R[k], first, c, R_middle[k], p[k], p_middle[k])
            _series(second[0] ** 2 + second[1] ** 2 + second[2] ** 2, c)
            _screw(R_middle[k], second, c, R[k + 1], p_middle[k], p[k + 1])
        else:
            for i in range(3):
                p[k + 1, i] = p[k, i] + R[k, i, 2] * length[k]
                for j in range(3):
                    R[k + 1, i, j] = R[k, i, j]
    return energy


@kernel
def _to_body(R: Floats, a: Floats, out: Floats) -> None:
    """Rᵀ a."""
    for i in range(3):
        out[i] = R[0, i] * a[0] + R[1, i] * a[1] + R[2, i] * a[2]


@kernel
def _contracted(w: Floats, twist: Floats, c: Floats, out: Floats) -> None:
    """out[i, j] = ∂(wᵀ J(α) e_j)/∂α_i."""
    a = twist[:3]
    t = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    wa = w[0] * a[0] + w[1] * a[1] + w[2] * a[2]
    cross0, cross1, cross2 = w[1] * a[2] - w[2] * a[1], w[2] * a[0] - w[0] * a[2], w[0] * a[1] - w[1] * a[0]  # w × α
    c1, c2, d1, d2 = c[0], c[1], c[2], c[3]
    for i in range(3):
        ai = a[i]
        out[i, 0] = (
            2.0 * d1 * ai * cross0 + c2 * (w[i] * a[0] - 2.0 * w[0] * ai) + 2.0 * d2 * ai * (wa * a[0] - t * w[0])
        )
        out[i, 1] = (
            2.0 * d1 * ai * cross1 + c2 * (w[i] * a[1] - 2.0 * w[1] * ai) + 2.0 * d2 * ai * (wa * a[1] - t * w[1])
        )
        out[i, 2] = (
            2.0 * d1 * ai * cross2 + c2 * (w[i] * a[2] - 2.0 * w[2] * ai) + 2.0 * d2 * ai * (wa * a[2] - t * w[2])
        )
        out[i, i] += c2 * wa
    # −c₁ [w]×
    out[0, 1] += c1 * w[2]
    out[0, 2] -= c1 * w[1]
    out[1, 0] -= c1 * w[2]
    out[1, 2] += c1 * w[0]
    out[2, 0] += c1 * w[1]
    out[2, 1] -= c1 * w[0]


@kernel
def _add_second(w: Floats, twist: Floats, c: Floats, factor: float, out: Floats) -> None:
    """Add factor · ∂²(wᵀ J(α) ν)/∂α² to out (3, 3)."""
    a0, a1, a2, v0, v1, v2 = twist[0], twist[1], twist[2], twist[3], twist[4], twist[5]
    t = a0 * a0 + a1 * a1 + a2 * a2
    x0, x1, x2 = v1 * w[2] - v2 * w[1], v2 * w[0] - v0 * w[2], v0 * w[1] - v1 * w[0]  # ν × w
    ax = a0 * x0 + a1 * x1 + a2 * x2
    wa, va, wv = w[0] * a0 + w[1] * a1 + w[2] * a2, v0 * a0 + v1 * a1 + v2 * a2, w[0] * v0 + w[1] * v1 + w[2] * v2
    Q = wa * va - t * wv
    c2, d1, d2, dd1, dd2 = c[1], 2.0 * c[2], 2.0 * c[3], 4.0 * c[4], 4.0 * c[5]
    a, x, v = (a0, a1, a2), (x0, x1, x2), (v0, v1, v2)
    q = (
        w[0] * va + v0 * wa - 2.0 * wv * a0,
        w[1] * va + v1 * wa - 2.0 * wv * a1,
        w[2] * va + v2 * wa - 2.0 * wv * a2,
    )
    for i in range(3):
        for j in range(3):
            value = d1 * (x[i] * a[j] + a[i] * x[j]) + (dd1 * ax + dd2 * Q) * a[i] * a[j]
            value += c2 * (w[i] * v[j] + v[i] * w[j]) + d2 * (a[i] * q[j] + q[i] * a[j])
            if i == j:
                value += d1 * ax + d2 * Q - 2.0 * c2 * wv
            out[i, j] += factor * value


@kernel
def _variations(R: Floats, twist: Floats, c: Floats, turn: Floats, shift: Floats) -> None:
    """turn = R J(α), shift = R ∂(J(α) ν)/∂α, both (3, 3): what dα does to the end's rotation and position."""
    a0, a1, a2, v0, v1, v2 = twist[0], twist[1], twist[2], twist[3], twist[4], twist[5]
    t = a0 * a0 + a1 * a1 + a2 * a2
    c1, c2, d1, d2 = c[0], c[1], 2.0 * c[2], 2.0 * c[3]
    va = v0 * a0 + v1 * a1 + v2 * a2
    a, v = (a0, a1, a2), (v0, v1, v2)
    cross = (a1 * v2 - a2 * v1, a2 * v0 - a0 * v2, a0 * v1 - a1 * v0)  # α × ν
    J = ((0.0, -a2, a1), (a2, 0.0, -a0), (-a1, a0, 0.0))
    V = ((0.0, -v2, v1), (v2, 0.0, -v0), (-v1, v0, 0.0))
    for j in range(3):
        j0, j1, j2 = c1 * J[0][j] + c2 * a0 * a[j], c1 * J[1][j] + c2 * a1 * a[j], c1 * J[2][j] + c2 * a2 * a[j]
        b0 = -c1 * V[0][j] + a[j] * (d1 * cross[0] + d2 * (a0 * va - t * v0)) + c2 * (a0 * v[j] - 2.0 * v0 * a[j])
        b1 = -c1 * V[1][j] + a[j] * (d1 * cross[1] + d2 * (a1 * va - t * v1)) + c2 * (a1 * v[j] - 2.0 * v1 * a[j])
        b2 = -c1 * V[2][j] + a[j] * (d1 * cross[2] + d2 * (a2 * va - t * v2)) + c2 * (a2 * v[j] - 2.0 * v2 * a[j])
        diagonal, along = 1.0 - c2 * t, c2 * va
        if j == 0:
            j0 += diagonal
            b0 += along
        elif j == 1:
            j1 += diagonal
            b1 += along
        else:
            j2 += diagonal
            b2 += along
        for i in range(3):
            turn[i, j] = R[i, 0] * j0 + R[i, 1] * j1 + R[i, 2] * j2
            shift[i, j] = R[i, 0] * b0 + R[i, 1] * b1 + R[i, 2] * b2


@kernel
def _pull_back(
    R: Floats,
    twist: Floats,
    c: Floats,
    d: Floats,
    M: Floats,
    N: Floats,
    H: Floats,
    gradient: Floats,
    B: Floats,
    own: Floats,
    mixed: Floats,
    work: Floats,
) -> None:
    """One screw, from its end to its start.

    In: the resultants M, N at its end (of all loads from there on, about its end), d its shift, H (6, 6) the Hessian
    with respect to x at its end. Out: H with respect to x at its start; B (6, 6), what the twist does to x at the end;
    gradient (6,) and own (6, 6), the energy's derivatives with respect to the twist; mixed (6, 6), x at the start with
    the twist; M about the start.
    """
    turn, shift, PB, G, wb = work[:3, :3], work[:3, 3:6], work[3:9], work[9:12, :3], work[9, 3:6]
    _variations(R, twist, c, turn, shift)
    for i in range(3):
        for j in range(3):
            B[i, j] = turn[i, j]
            B[i, 3 + j] = 0.0
            B[3 + i, j] = shift[i, j]
            B[3 + i, 3 + j] = turn[i, j]
    for j in range(3):
        gradient[j] = -(turn[0, j] * M[0] + turn[1, j] * M[1] + turn[2, j] * M[2])
        gradient[j] -= shift[0, j] * N[0] + shift[1, j] * N[1] + shift[2, j] * N[2]
        gradient[3 + j] = -(turn[0, j] * N[0] + turn[1, j] * N[1] + turn[2, j] * N[2])
    for i in range(6):
        for j in range(3):
            low = H[i, 3] * turn[0, j] + H[i, 4] * turn[1, j] + H[i, 5] * turn[2, j]
            PB[i, 3 + j] = low
            high = H[i, 0] * turn[0, j] + H[i, 1] * turn[1, j] + H[i, 2] * turn[2, j]
            PB[i, j] = high + H[i, 3] * shift[0, j] + H[i, 4] * shift[1, j] + H[i, 5] * shift[2, j]
    for j in range(6):
        for i in range(3):
            high = turn[0, i] * PB[0, j] + turn[1, i] * PB[1, j] + turn[2, i] * PB[2, j]
            own[i, j] = high + shift[0, i] * PB[3, j] + shift[1, i] * PB[4, j] + shift[2, i] * PB[5, j]
            own[3 + i, j] = turn[0, i] * PB[3, j] + turn[1, i] * PB[4, j] + turn[2, i] * PB[5, j]
    # Second variations of the end under the resultants, in the body's frame.
    _to_body(R, N, wb)
    _contracted(wb, twist, c, G)
    for i in range(3):
        for j in range(3):
            own[i, 3 + j] -= G[i, j]
            own[3 + j, i] -= G[i, j]
    _add_second(wb, twist, c, -1.0, own)
    _to_body(R, M, wb)
    _contracted(wb, twist, c, G)
    for i in range(3):
        for j in range(3):
            own[i, j] -= 0.5 * (G[i, j] + G[j, i])
    # Aᵀ P B with A = [1, 0; −[d]×, 1], and the second variations ½ [M]× turn + [N]× shift, [N]× turn.
    for j in range(6):
        p3, p4, p5 = PB[3, j], PB[4, j], PB[5, j]
        mixed[0, j] = PB[0, j] + d[1] * p5 - d[2] * p4
        mixed[1, j] = PB[1, j] + d[2] * p3 - d[0] * p5
        mixed[2, j] = PB[2, j] + d[0] * p4 - d[1] * p3
        mixed[3, j], mixed[4, j], mixed[5, j] = p3, p4, p5
    for j in range(3):
        t0, t1, t2, s0, s1, s2 = turn[0, j], turn[1, j], turn[2, j], shift[0, j], shift[1, j], shift[2, j]
        mixed[0, j] += 0.5 * (M[1] * t2 - M[2] * t1) + N[1] * s2 - N[2] * s1
        mixed[1, j] += 0.5 * (M[2] * t0 - M[0] * t2) + N[2] * s0 - N[0] * s2
        mixed[2, j] += 0.5 * (M[0] * t1 - M[1] * t0) + N[0] * s1 - N[1] * s0
        mixed[0, 3 + j] += N[1] * t2 - N[2] * t1
        mixed[1, 3 + j] += N[2] * t0 - N[0] * t2
        mixed[2, 3 + j] += N[0] * t1 - N[1] * t0
    _shift_back(d, M, N, H)


@kernel
def _shift_back(d: Floats, M: Floats, N: Floats, H: Floats) -> None:
    """H and M from the end of a shift d to its start, d's second variation included."""
    d0, d1, d2 = d[0], d[1], d[2]
    for i in range(6):  # H A
        h3, h4, h5 = H[i, 3], H[i, 4], H[i, 5]
        H[i, 0] += h5 * d1 - h4 * d2
        H[i, 1] += h3 * d2 - h5 * d0
        H[i, 2] += h4 * d0 - h3 * d1
    for j in range(6):  # Aᵀ (H A)
        h3, h4, h5 = H[3, j], H[4, j], H[5, j]
        H[0, j] += d1 * h5 - d2 * h4
        H[1, j] += d2 * h3 - d0 * h5
        H[2, j] += d0 * h4 - d1 * h3
    Nd = N[0] * d0 + N[1] * d1 + N[2] * d2
    for i in range(3):
        for j in range(3):
            H[i, j] -= 0.5 * (N[i] * d[j] + N[j] * d[i])
        H[i, i] += Nd
    M[0] += d1 * N[2] - d2 * N[1]
    M[1] += d2 * N[0] - d0 * N[2]
    M[2] += d0 * N[1] - d1 * N[0]


@kernel
def factor(
    flexible: Booleans,
    length: Floats,
    stiffness: Floats,
    rest: Floats,
    twist: Floats,
    R: Floats,
    p: Floats,
    R_middle: Floats,
    p_middle: Floats,
    wrench: Floats,
    tangent: Floats,
    damping: float,
    gradient: Floats,
    B: Floats,
    mixed: Floats,
    gain: Floats,
    pivots: Floats,
    resultant: Floats,
) -> tuple[int, float]:
    """The energy's gradient, and its Hessian factored.

    Returns how many eigenvalues of the Hessian are negative, and the square of the gradient in the norm of the elastic
    Hessian's inverse, J.

    wrench: (e + 1, 6) torque, force on every node about itself.  tangent: (e + 1, 6, 6) the symmetric part of minus
    its derivative with respect to x.  damping: how many times the elastic Hessian is added.  Written: gradient (e, 12),
    without damping; B (e, 6, 12) of every link; mixed (e, 6, 12), x at the start with the twists; gain (e, 12, 6),
    twists that the links beyond take for x at the start; pivots (e, 12, 12), the unit lower factor with the inverse
    pivots on its diagonal; resultant (e + 1, 6) the moment, force that a node's section carries, from the loads.
    """
    c = np.empty(6)
    H = np.empty((6, 6))
    B1, B2 = np.empty((6, 6)), np.empty((6, 6))
    own1, own2 = np.empty((6, 6)), np.empty((6, 6))
    mixed1, mixed2 = np.empty((6, 6)), np.empty((6, 6))
    g1, g2 = np.empty(6), np.empty(6)
    work = np.empty((12, 6))
    M, N, d, d2 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    links = flexible.size
    negative, square = 0, 0.0
    for i in range(3):
        M[i], N[i] = wrench[links, i], wrench[links, 3 + i]
        resultant[links, i], resultant[links, 3 + i] = M[i], N[i]
    for i in range(6):
        for j in range(6):
            H[i, j] = tangent[links, i, j]
    for k in range(links - 1, -1, -1):
        if not flexible[k]:
            for i in range(3):
                d[i] = p[k + 1, i] - p[k, i]
            _shift_back(d, M, N, H)
        else:
            first, second = twist[k, :6], twist[k, 6:]
            for i in range(3):
                d[i] = p_middle[k, i] - p[k, i]
                d2[i] = p[k + 1, i] - p_middle[k, i]
            _series(second[0] ** 2 + second[1] ** 2 + second[2] ** 2, c)
            _pull_back(R_middle[k], second, c, d2, M, N, H, g2, B2, own2, mixed2, work)
            _series(first[0] ** 2 + first[1] ** 2 + first[2] ** 2, c)
            _pull_back(R[k], first, c, d, M, N, H, g1, B1, own1, mixed1, work)
            Bk, mk, Lk, Kk = B[k], mixed[k], pivots[k], gain[k]
            for j in range(6):
                for i in range(3):
                    Bk[i, 6 + j], Bk[3 + i, 6 + j] = B2[i, j], B2[3 + i, j]
                    Bk[i, j], Bk[3 + i, j] = B1[i, j], B1[3 + i, j]
                    mk[i, j], mk[3 + i, j] = mixed1[i, j], mixed1[3 + i, j]
                # A₂ B₁
                Bk[3, j] += B1[1, j] * d2[2] - B1[2, j] * d2[1]
                Bk[4, j] += B1[2, j] * d2[0] - B1[0, j] * d2[2]
                Bk[5, j] += B1[0, j] * d2[1] - B1[1, j] * d2[0]
                # A₁ᵀ mixed₂
                m3, m4, m5 = mixed2[3, j], mixed2[4, j], mixed2[5, j]
                mk[0, 6 + j] = mixed2[0, j] + d[1] * m5 - d[2] * m4
                mk[1, 6 + j] = mixed2[1, j] + d[2] * m3 - d[0] * m5
                mk[2, 6 + j] = mixed2[2, j] + d[0] * m4 - d[1] * m3
                mk[3, 6 + j], mk[4, 6 + j], mk[5, 6 + j] = m3, m4, m5
            for i in range(6):
                for j in range(6):
                    Lk[i, j], Lk[6 + i, 6 + j] = own1[i, j], own2[i, j]
                    # mixed₂ᵀ B₁: x in the middle moves with the first twist.
                    total = 0.0
                    for l in range(6):  # noqa: E741
                        total += mixed2[l, i] * B1[l, j]
                    Lk[6 + i, j] = total
                spring = stiffness[k, i] / length[k]
                e1, e2 = twist[k, i] - rest[k, i], twist[k, 6 + i] - rest[k, 6 + i]
                gradient[k, i] = g1[i] + spring * (OWN * e1 + CROSS * e2)
                gradient[k, 6 + i] = g2[i] + spring * (OWN * e2 + CROSS * e1)
                a, b = gradient[k, i], gradient[k, 6 + i]
                square += (OWN * (a * a + b * b) - 2.0 * CROSS * a * b) / ((OWN * OWN - CROSS * CROSS) * spring)
                damped = (1.0 + damping) * spring
                Lk[i, i] += OWN * damped
                Lk[6 + i, 6 + i] += OWN * damped
                Lk[6 + i, i] += CROSS * damped
            neutral = NEUTRAL * stiffness[k, :3].max() / length[k] + _ROUNDING * stiffness[k, 3] * length[k]
            negative += _eliminate(Lk, mk, Kk, neutral)
            for i in range(6):
                for j in range(i + 1):
                    total = 0.0
                    for l in range(12):  # noqa: E741
                        total += mk[i, l] * Kk[l, j]
                    H[i, j] += total
                    if j < i:
                        H[j, i] = H[i, j]
        for i in range(3):
            M[i] += wrench[k, i]
            N[i] += wrench[k, 3 + i]
            resultant[k, i], resultant[k, 3 + i] = M[i], N[i]
        for i in range(6):
            for j in range(6):
                H[i, j] += tangent[k, i, j]
    return negative, square


@kernel
def _eliminate(L: Floats, mixed: Floats, gain: Floats, neutral: float) -> int:
    """Factor the lower half of L (12, 12) in place, L D Lᵀ, the diagonal as 1/D; gain = −(L D Lᵀ)⁻¹ mixedᵀ.

    Returns how many pivots are below −`neutral`. One that is smaller becomes `neutral`: divided by what rounding left
    of a zero, the pivots after it would say nothing.
    """
    negative = 0
    column = np.empty(12)
    for j in range(12):
        pivot = L[j, j]
        if pivot < -neutral:
            negative += 1
        elif pivot < neutral:
            pivot = neutral
        inverse = 1.0 / pivot
        L[j, j] = inverse
        for i in range(j + 1, 12):
            column[i] = L[i, j]
            L[i, j] *= inverse
        for i in range(j + 1, 12):
            factor = column[i]
            for l in range(j + 1, i + 1):  # noqa: E741
                L[i, l] -= factor * L[l, j]
    for i in range(12):
        for q in range(6):
            gain[i, q] = -mixed[q, i]
    _substitute(L, gain)
    return negative


@kernel
def _substitute(L: Floats, x: Floats) -> None:
    """x (12, n) ← (L D Lᵀ)⁻¹ x."""
    n = x.shape[1]
    for i in range(12):
        for l in range(i):  # noqa: E741
            f = L[i, l]
            for q in range(n):
                x[i, q] -= f * x[l, q]
    for i in range(11, -1, -1):
        f = L[i, i]
        for q in range(n):
            x[i, q] *= f
        for l in range(i + 1, 12):  # noqa: E741
            f = L[l, i]
            for q in range(n):
                x[i, q] -= f * x[l, q]


@kernel
def solve(
    flexible: Booleans,
    p: Floats,
    B: Floats,
    mixed: Floats,
    gain: Floats,
    pivots: Floats,
    twist_load: Floats,
    node_load: Floats,
    base: Floats,
    twist: Floats,
    x: Floats,
) -> None:
    """How twists (e, 12, n) and nodes x (e + 1, 6, n) answer to n loads, by the factored Hessian.

    twist_load: (e, 12, n) generalised forces on the twists.  node_load: (e + 1, 6, n) torque, force on the nodes.
    base: (6, n) how the base moves.
    """
    links, n = flexible.size, node_load.shape[2]
    l = np.empty((6, n))  # noqa: E741
    for i in range(6):
        for q in range(n):
            l[i, q] = -node_load[links, i, q]
            x[0, i, q] = base[i, q]
    for k in range(links - 1, -1, -1):
        d0, d1, d2 = p[k + 1, 0] - p[k, 0], p[k + 1, 1] - p[k, 1], p[k + 1, 2] - p[k, 2]
        if flexible[k]:
            Bk, mk, out = B[k], mixed[k], twist[k]
            for i in range(12):
                for q in range(n):
                    out[i, q] = twist_load[k, i, q]
                for j in range(6):
                    f = Bk[j, i]
                    for q in range(n):
                        out[i, q] -= f * l[j, q]
            _substitute(pivots[k], out)
        for q in range(n):
            l[0, q] += d1 * l[5, q] - d2 * l[4, q]
            l[1, q] += d2 * l[3, q] - d0 * l[5, q]
            l[2, q] += d0 * l[4, q] - d1 * l[3, q]
        for i in range(6):
            if flexible[k]:
                for j in range(12):
                    f = mk[i, j]
                    for q in range(n):
                        l[i, q] += f * out[j, q]
            for q in range(n):
                l[i, q] -= node_load[k, i, q]
    for k in range(links):
        d0, d1, d2 = p[k + 1, 0] - p[k, 0], p[k + 1, 1] - p[k, 1], p[k + 1, 2] - p[k, 2]
        here, there = x[k], x[k + 1]
        for q in range(n):
            a, b, g = here[0, q], here[1, q], here[2, q]
            there[0, q], there[1, q], there[2, q] = a, b, g
            there[3, q] = here[3, q] + b * d2 - g * d1
            there[4, q] = here[4, q] + g * d0 - a * d2
            there[5, q] = here[5, q] + a * d1 - b * d0
        if flexible[k]:
            out = twist[k]
            for i in range(12):
                for j in range(6):
                    f = gain[k, i, j]
                    for q in range(n):
                        out[i, q] += f * here[j, q]
            for j in range(6):
                for i in range(12):
                    f = B[k, j, i]
                    for q in range(n):
                        there[j, q] += f * out[i, q]


@kernel
def solve_one(
    flexible: Booleans,
    p: Floats,
    B: Floats,
    mixed: Floats,
    gain: Floats,
    pivots: Floats,
    twist_load: Floats,
    node_load: Floats,
    twist: Floats,
    x: Floats,
) -> None:
    """As `solve` for one load and a base that stands still: arrays without their last axis."""
    links = flexible.size
    l = np.empty(6)  # noqa: E741
    for i in range(6):
        l[i] = -node_load[links, i]
        x[0, i] = 0.0
    for k in range(links - 1, -1, -1):
        if flexible[k]:
            Bk, L, out = B[k], pivots[k], twist[k]
            for i in range(12):
                total = twist_load[k, i]
                for j in range(6):
                    total -= Bk[j, i] * l[j]
                for j in range(i):
                    total -= L[i, j] * out[j]
                out[i] = total
            for i in range(11, -1, -1):
                total = out[i] * L[i, i]
                for j in range(i + 1, 12):
                    total -= L[j, i] * out[j]
                out[i] = total
        d0, d1, d2 = p[k + 1, 0] - p[k, 0], p[k + 1, 1] - p[k, 1], p[k + 1, 2] - p[k, 2]
        l[0] += d1 * l[5] - d2 * l[4]
        l[1] += d2 * l[3] - d0 * l[5]
        l[2] += d0 * l[4] - d1 * l[3]
        for i in range(6):
            if flexible[k]:
                for j in range(12):
                    l[i] += mixed[k, i, j] * twist[k, j]
            l[i] -= node_load[k, i]
    for k in range(links):
        d0, d1, d2 = p[k + 1, 0] - p[k, 0], p[k + 1, 1] - p[k, 1], p[k + 1, 2] - p[k, 2]
        here, there = x[k], x[k + 1]
        for i in range(6):
            there[i] = here[i]
        there[3] += here[1] * d2 - here[2] * d1
        there[4] += here[2] * d0 - here[0] * d2
        there[5] += here[0] * d1 - here[1] * d0
        if flexible[k]:
            out = twist[k]
            for i in range(12):
                for j in range(6):
                    out[i] += gain[k, i, j] * here[j]
            for j in range(6):
                for i in range(12):
                    there[j] += B[k, j, i] * out[i]
