"""Windings of rectangular section with uniform azimuthal current density: field, derivatives and vector potential.

Frame: centre at the origin, z the axis, positive current right-handed about +z. Two routes, compiled:

*Cells*, away from the winding. The section is bisected until no part is much larger than its distance from the
observer; in each part current loops stand at Gauss points, as many as the part's distance asks for. Seen from
(ρ, z) the loop's field is an analytic function of its place in the section with its nearest singularity at
(ρ, z) itself, so n points on a length 2h at distance d leave an error like (q + √(1 + q²))^(−2n), q = d/h.

*Ends*, near the winding and inside it. By superposition over z the winding is the difference of two ends,
B = ∫ da [P(a; ρ, z + L/2) − P(a; ρ, z − L/2)], where P belongs to a current sheet of radius a and ∂P/∂z is the
field of a loop of that radius. P_ρ is minus the loop's vector potential; P_z is Derby and Olbert's integral
(Am. J. Phys. 78, 229 (2010)), which jumps at a = ρ by half of µ0 times the sheet's current. The radii are bisected
from ρ on as above, so the jump lies between parts; the derivatives of P are loop fields, and the end of the radial
integral at the jump leaves −µ0 J ρ̂ in the gradient of B_z between the planes of the ends. The rest of the field is
curl-free there, and its derivatives follow from those of the loop.

The vector potential is summed over cells everywhere; inside the winding these shrink towards the observer.
"""

from __future__ import annotations

from math import ceil, hypot, log, pi, sqrt

import numpy as np

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.loop import add_loop, complete_elliptic, potential_over_rho
from magfem.fields.packing import unpack_gradient, unpack_hessian
from magfem.threads import in_chunks
from magfem.typing import ArrayLike, Booleans, Floats, Jet, Points, Vectors

MOST = 12  # Gauss points along one side of a cell
TOLERANCE = 1e-12  # of the Gauss rules
NEAR = 1.0  # of the section's longer side: nearer than this the route is by ends, the faster there
FLAT = 1e-6  # of its thickness: a winding shorter than this is all cells, its two ends would cancel
EDGE = 1e-10  # of the outer radius or the length: nearer to an end of the winding counts as this far
CORNER = 1e-6  # of the longer side: cells of the vector potential at the observer are not divided further
DEEPEST = 400  # cells waiting on the stack: one bisection adds one, halving a side 50 times is beyond rounding


def _gauss_rules() -> tuple[Floats, Floats]:
    """Nodes on (−1, 1) and weights of sum 1, each (MOST + 1, MOST): row n is the rule of n points."""
    nodes, weights = np.zeros((MOST + 1, MOST)), np.zeros((MOST + 1, MOST))
    for n in range(1, MOST + 1):
        nodes[n, :n], weights[n, :n] = np.polynomial.legendre.leggauss(n)
    return nodes, weights / 2


_NODES, _WEIGHTS = _gauss_rules()


def thick_solenoid_jet(
    points: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    length: float,
    ampere_turns: float,
    order: int = 1,
) -> Jet:
    """Field of a winding of rectangular section with uniform current density, inside and outside.

    Parameters
    ----------
    points : (..., 3) m, the winding's frame.
    inner_radius, outer_radius : m, 0 ≤ inner ≤ outer, 0 < outer; equal ones make a current sheet.
    length : m, ≥ 0; zero makes a flat disc, whose field is not defined on the disc itself.
    ampere_turns : A (or turns, for T/A), the total current round the section.
    order : 0 for B, 1 for B and gradient, 2 for B, gradient and hessian.

    Returns
    -------
    B (..., 3) T, gradient (..., 3, 3) T/m, hessian (..., 3, 3, 3) T/m², up to `order`. In the winding curl B = µ0 J.
    On the surface the derivatives are those inside; at the corners of the section, where they are infinite,
    large values. On a current sheet B is the mean of both sides.

    Against magnetised cylinders summed over the radius, from 1 % of the section's longer side outside it and inside:
    relative error of B 1e-9, gradient 5e-9, hessian 1e-6.
    """
    _check(inner_radius, outer_radius, length)
    points = np.ascontiguousarray(points, dtype=float)
    flat = points.reshape(-1, 3)
    count = flat.shape[0]
    B = np.zeros((count, 3))
    gradient = np.zeros((count if order > 0 else 0, 3, 3))
    hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))

    def run(chunk: slice) -> None:
        _evaluate(
            flat[chunk],
            float(inner_radius),
            float(outer_radius),
            float(length),
            float(ampere_turns),
            order,
            NEAR,
            B[chunk],
            gradient[chunk],
            hessian[chunk],
        )

    in_chunks(run, count, at_least=64)
    if order > 0 and outer_radius > inner_radius and length > 0:
        inside = _in_winding(flat, inner_radius, outer_radius, length)
        J = ampere_turns / ((outer_radius - inner_radius) * length)
        _add_curl(flat[inside], MU_0 * J, inside, gradient, hessian)
    shape = points.shape[:-1]
    jet = (B, gradient, hessian)[: order + 1]
    return tuple(part.reshape(*shape, *part.shape[1:]) for part in jet)


def thick_solenoid_vector_potential(
    points: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    length: float,
    ampere_turns: float,
) -> Vectors:
    """Vector potential (..., 3) T·m in the Coulomb gauge, inside and outside the winding.

    Arguments as in `thick_solenoid_jet`; length and thickness may be zero, both together on no point of the wire.
    """
    _check(inner_radius, outer_radius, length)
    points = np.ascontiguousarray(points, dtype=float)
    flat = points.reshape(-1, 3)
    potential = np.zeros(flat.shape)
    section = (float(inner_radius), float(outer_radius), float(length), float(ampere_turns))

    def run(chunk: slice) -> None:
        _evaluate_potential(flat[chunk], *section, potential[chunk])

    in_chunks(run, flat.shape[0], at_least=16)
    return potential.reshape(points.shape)


def _check(inner_radius: float, outer_radius: float, length: float) -> None:
    if not (0 <= inner_radius <= outer_radius and outer_radius > 0 and length >= 0):
        raise InputError(
            "winding: expected 0 ≤ inner_radius ≤ outer_radius, 0 < outer_radius and 0 ≤ length, "
            f"got {inner_radius:g}, {outer_radius:g} and {length:g} m"
        )


def _in_winding(points: Points, inner_radius: float, outer_radius: float, length: float) -> Booleans:
    rho = np.hypot(points[:, 0], points[:, 1])
    inside: Booleans = (rho >= inner_radius) & (rho <= outer_radius) & (np.abs(points[:, 2]) <= length / 2)
    return inside


def _add_curl(points: Points, slope: float, at: Booleans, gradient: Floats, hessian: Floats) -> None:
    """Add the derivatives of B_z = −`slope`·ρ at `points`; on the axis, where they have no limit, zero."""
    radial = points[:, :2]
    rho = np.hypot(radial[:, 0], radial[:, 1])
    unit = np.divide(radial, rho[:, None], out=np.zeros_like(radial), where=rho[:, None] > 0)
    gradient[at, 2, :2] -= slope * unit
    if hessian.size:
        inverse = np.divide(1.0, rho, out=np.zeros_like(rho), where=rho > 0)
        across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
        hessian[at, 2, :2, :2] -= slope * inverse[:, None, None] * across


@kernel
def _evaluate(
    points: Points,
    inner: float,
    outer: float,
    length: float,
    ampere_turns: float,
    order: int,
    near: float,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Write the jet at `points` (n, 3), without the part that has a curl."""
    stack = np.empty((DEEPEST, 5))
    jet = np.empty(15)
    loop = np.empty(15)
    half = 0.5 * length
    side = max(outer - inner, length)
    edge = EDGE * max(outer, length)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        rho = sqrt(x * x + y * y)
        distance = hypot(max(inner - rho, rho - outer, 0.0), max(abs(z) - half, 0.0))
        jet[:] = 0.0
        if distance > near * side or length <= FLAT * (outer - inner):
            _add_cells(x, y, z, inner, outer, half, ampere_turns, order, stack, jet)
        else:
            loop[:] = 0.0
            beside = abs(z) <= half
            lower, upper = z + half, z - half
            across = max(inner - rho, rho - outer) < edge  # on the end itself its derivatives jump
            if across and abs(lower) < edge:
                lower = edge if beside else -edge
            if across and abs(upper) < edge:
                upper = -edge if beside else edge
            sheet = ampere_turns / length
            G, P_z = _add_end(x, y, rho, lower, inner, outer, sheet, order, stack, loop)
            other = _add_end(x, y, rho, upper, inner, outer, -sheet, order, stack, loop)
            _from_ends(x, y, rho, G + other[0], P_z + other[1], order, loop, jet)
        B[i, 0], B[i, 1], B[i, 2] = jet[0], jet[1], jet[2]
        if order > 0:
            unpack_gradient(jet, gradient[i])
        if order > 1:
            unpack_hessian(jet, hessian[i])


@kernel
def _points_needed(distance: float, half: float, tolerance: float) -> int:
    """Gauss points on a length 2·`half` for a singularity at `distance`; more than MOST asks for bisection."""
    if half == 0.0:
        return 1
    q = distance / half
    if q < 1.0:
        return MOST + 1
    return max(1, ceil(-0.5 * log(tolerance) / log(q + sqrt(1.0 + q * q))))


@kernel
def _add_cells(
    x: float,
    y: float,
    z: float,
    inner: float,
    outer: float,
    half: float,
    ampere_turns: float,
    order: int,
    stack: Floats,
    jet: Floats,
) -> None:
    """Add the field of loops at Gauss points of cells; a row of the stack: centre, half side in a, in z, current."""
    rho = sqrt(x * x + y * y)
    smallest = EDGE * max(outer - inner, 2.0 * half)
    stack[0] = (0.5 * (inner + outer), 0.5 * (outer - inner), 0.0, half, ampere_turns)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        a, da, c, dc, current = stack[waiting]
        distance = hypot(max(abs(rho - a) - da, 0.0), max(abs(z - c) - dc, 0.0))
        # A loop's field grows as its radius squared, however far away: relative to that the bound is weaker.
        n = _points_needed(distance, da, TOLERANCE / (1.0 + (distance / (a + da)) ** 2))
        m = _points_needed(distance, dc, TOLERANCE)
        if max(n, m) > MOST:
            if max(da, dc) > smallest:
                waiting = _bisect(a, da, c, dc, current, n > MOST, m > MOST, stack, waiting)
                continue
            n = m = 1
        for j in range(n):
            radius = a + da * _NODES[n, j]
            for k in range(m):
                share = current * _WEIGHTS[n, j] * _WEIGHTS[m, k]
                add_loop(x, y, z - (c + dc * _NODES[m, k]), radius, share, order, jet)


@kernel
def _bisect(
    a: float, da: float, c: float, dc: float, current: float, in_a: bool, in_z: bool, stack: Floats, waiting: int
) -> int:
    """Put the halves or quarters of a cell on the stack; the longer side at least is halved."""
    halve_a = in_a and (da >= 0.5 * dc or not in_z)
    halve_z = in_z and (dc >= 0.5 * da or not in_a)
    rows, columns = 2 if halve_a else 1, 2 if halve_z else 1
    for i in range(rows):
        for k in range(columns):
            stack[waiting, 0] = a + (i - 0.5) * da if halve_a else a
            stack[waiting, 1] = 0.5 * da if halve_a else da
            stack[waiting, 2] = c + (k - 0.5) * dc if halve_z else c
            stack[waiting, 3] = 0.5 * dc if halve_z else dc
            stack[waiting, 4] = current / (rows * columns)
            waiting += 1
    return waiting


@kernel
def _add_end(
    x: float,
    y: float,
    rho: float,
    zeta: float,
    inner: float,
    outer: float,
    sheet: float,
    order: int,
    stack: Floats,
    loop: Floats,
) -> tuple[float, float]:
    """(P_ρ/ρ, P_z) of the end at height `zeta` below the observer; its ∂P/∂z is added to `loop`, `order` − 1 deep.

    `sheet` is the current per length, A/m, of the whole thickness. A row of the stack is centre and half length
    of a part of the radii, as offsets from ρ, and its share of `sheet`.
    """
    G = P_z = 0.0
    waiting = 0
    if inner < rho < outer:
        thickness = outer - inner
        stack[0, :3] = (0.5 * (inner - rho), 0.5 * (rho - inner), sheet * (rho - inner) / thickness)
        stack[1, :3] = (0.5 * (outer - rho), 0.5 * (outer - rho), sheet * (outer - rho) / thickness)
        waiting = 2
    else:
        stack[0, :3] = (0.5 * ((inner - rho) + (outer - rho)), 0.5 * (outer - inner), sheet)
        waiting = 1
    while waiting > 0:
        waiting -= 1
        offset, half, current = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
        n = _points_needed(hypot(max(abs(offset) - half, 0.0), zeta), half, TOLERANCE)
        if n > MOST:
            for sign in (-1.0, 1.0):
                stack[waiting, :3] = (offset + 0.5 * sign * half, 0.5 * half, 0.5 * current)
                waiting += 1
            continue
        for j in range(n):
            t = offset + half * _NODES[n, j]
            share = current * _WEIGHTS[n, j]
            G -= share * potential_over_rho(rho, zeta, rho + t)
            P_z += share * _sheet_end(rho, zeta, t)
            if order > 0:
                add_loop(x, y, zeta, rho + t, share, order - 1, loop)
    return G, P_z


@kernel
def _sheet_end(rho: float, zeta: float, offset: float) -> float:
    """P_z of a current sheet of 1 A/m and radius ρ + `offset`: odd in `zeta`, ±µ0/2 far along the bore."""
    a = rho + offset
    gamma = offset / (a + rho)
    far = (a + rho) * (a + rho) + zeta * zeta
    kc2 = (offset * offset + zeta * zeta) / far
    if gamma == 0.0:  # on the sheet: the mean of both sides
        return MU_0 / (2.0 * pi) * zeta / sqrt(far) * complete_elliptic(kc2)[0]
    integral = _general_elliptic(sqrt(kc2), gamma * gamma, 1.0, gamma)
    return MU_0 / pi * a / (a + rho) * zeta / sqrt(far) * integral


@kernel
def _general_elliptic(kc: float, p: float, c: float, s: float) -> float:
    """∫₀^{π/2} (c cos²φ + s sin²φ) / ((cos²φ + p sin²φ) √(cos²φ + kc² sin²φ)) dφ, kc > 0, p > 0.

    Bulirsch's transformation (Numer. Math. 7, 78 (1965)).
    """
    root = sqrt(p)
    s = s / root
    mean, f = 1.0, c
    c = c + s / root
    g = kc / root
    s = 2.0 * (s + f * g)
    root += g
    g = mean
    k = product = kc
    mean += kc
    for _ in range(60):
        if abs(g - k) <= 1e-8 * g:
            break
        k = 2.0 * sqrt(product)
        product = k * mean
        f = c
        c = c + s / root
        g = product / root
        s = 2.0 * (s + f * g)
        root += g
        g = mean
        mean += k
    return 0.5 * pi * (s + c * mean) / (mean * (mean + root))


@kernel
def _from_ends(x: float, y: float, rho: float, G: float, P_z: float, order: int, loop: Floats, jet: Floats) -> None:
    """Add to `jet` the curl-free jet with B_ρ = ρG and B_z = P_z, whose derivative along z is the jet `loop`.

    With s = ρ², div B = 0 gives sG_s = −G − ∂_z B_z/2, and its derivative by s the next one.
    """
    s = rho * rho
    jet[0] += x * G
    jet[1] += y * G
    jet[2] += P_z
    if order < 1:
        return
    G_s = -(G + 0.5 * loop[2]) / s if s > 0.0 else 0.0
    jet[3] += G + 2.0 * x * x * G_s
    jet[4] += 2.0 * x * y * G_s
    jet[5] += loop[0]
    jet[6] += G + 2.0 * y * y * G_s
    jet[7] += loop[1]
    if order < 2:
        return
    slope = 0.5 * (x * loop[5] + y * loop[7]) / s if s > 0.0 else 0.0  # ∂_s ∂_z B_z
    G_ss = -(2.0 * G_s + 0.5 * slope) / s if s > 0.0 else 0.0
    jet[8] += x * (6.0 * G_s + 4.0 * x * x * G_ss)
    jet[9] += y * (2.0 * G_s + 4.0 * x * x * G_ss)
    jet[10] += loop[3]
    jet[11] += x * (2.0 * G_s + 4.0 * y * y * G_ss)
    jet[12] += loop[4]
    jet[13] += y * (6.0 * G_s + 4.0 * y * y * G_ss)
    jet[14] += loop[6]


@kernel
def _evaluate_potential(
    points: Points, inner: float, outer: float, length: float, ampere_turns: float, potential: Vectors
) -> None:
    """Write A at `points` (n, 3)."""
    stack = np.empty((DEEPEST, 5))
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        factor = _potential_of_cells(sqrt(x * x + y * y), z, inner, outer, 0.5 * length, ampere_turns, stack)
        potential[i, 0] = -y * factor
        potential[i, 1] = x * factor


@kernel
def _potential_of_cells(
    rho: float, z: float, inner: float, outer: float, half: float, ampere_turns: float, stack: Floats
) -> float:
    """A_φ/ρ, by cells as in `_add_cells`.

    The section is first cut at the observer's radius and height, so that inside it he stands on corners of cells.
    The singularity is logarithmic: small cells weigh as their share of the section, and need fewer points.
    """
    thickness, length = outer - inner, 2.0 * half
    smallest = (CORNER if thickness > 0.0 and length > 0.0 else EDGE) * max(thickness, length)
    smallest = min(smallest, 1e-3 * thickness if thickness > 0.0 else smallest)
    smallest = min(smallest, 1e-3 * length if length > 0.0 else smallest)
    cut_a = min(max(rho, inner), outer)
    cut_z = min(max(z, -half), half)
    waiting = 0
    for i in range(2):
        a0, a1 = (inner, cut_a) if i == 0 else (cut_a, outer)
        if (thickness > 0.0 and a1 == a0) or (thickness == 0.0 and i == 1):
            continue
        for k in range(2):
            z0, z1 = (-half, cut_z) if k == 0 else (cut_z, half)
            if (length > 0.0 and z1 == z0) or (length == 0.0 and k == 1):
                continue
            share = (a1 - a0) / thickness if thickness > 0.0 else 1.0
            share *= (z1 - z0) / length if length > 0.0 else 1.0
            stack[waiting, 0], stack[waiting, 1] = 0.5 * (a0 + a1), 0.5 * (a1 - a0)
            stack[waiting, 2], stack[waiting, 3] = 0.5 * (z0 + z1), 0.5 * (z1 - z0)
            stack[waiting, 4] = share
            waiting += 1
    total = 0.0
    while waiting > 0:
        waiting -= 1
        a, da, c, dc, share = stack[waiting]
        distance = hypot(max(abs(rho - a) - da, 0.0), max(abs(z - c) - dc, 0.0))
        tolerance = min(0.1, TOLERANCE / share)
        n = _points_needed(distance, da, tolerance / (1.0 + (distance / (a + da)) ** 2))
        m = _points_needed(distance, dc, tolerance)
        if max(n, m) > MOST:
            if max(da, dc) > smallest:
                waiting = _bisect(a, da, c, dc, share, n > MOST, m > MOST, stack, waiting)
                continue
            n, m = min(n, 4), min(m, 4)
        for j in range(n):
            radius = a + da * _NODES[n, j]
            for k in range(m):
                weight = share * _WEIGHTS[n, j] * _WEIGHTS[m, k]
                total += weight * potential_over_rho(rho, z - (c + dc * _NODES[m, k]), radius)
    return ampere_turns * total
