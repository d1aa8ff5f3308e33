"""The potential on the bodies' surfaces, computed once more from the sources that a solution found: compiled.

A body magnetised by M₀ + χH, H = −∇φ, acts at any point x as the charges M₀·n and the dipoles −χφn on its surface
and, inside, as −χφ(x) itself (Green's third identity), so that

    φ(x) [1 + Σ χ s(x)] = 1/4π Σ ∮ [M₀·n / r − χ φ (r·n)/r³] dS,    r = x − y,    s(x) = −1/4π ∮ (r·n)/r³ dS,

with s the share of x's surroundings that a body fills: 1 inside, ½ on a smooth wall. Put into the right side, a
solved φ with error e comes out with at most e χ/(2 + χ), and smoothed: along rims, where elements are least
accurate, the rigid part M₀ enters exactly. It is one step of the iteration of Sloan (Math. Comp. 30, 758 (1976)).
"""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel, summing_kernel
from magfem.mesh.shape_functions import triangle_rule, triangle_shapes
from magfem.threads import in_chunks
from magfem.typing import Floats, Integers, Points

_FAR, _NEAR = 6.0, 2.5
"""Distance over triangle size from which 3 and 12 points integrate it; below, rules that crowd at its nearest node."""
_CROWDED = 7  # Gauss points each way of those rules
_TILE = 512  # triangles that are summed at all points before the next: they stay in the processor's cache

_Tile = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]


def surface_potential(
    points: Points, facets: Integers, potential: Floats, magnetisation: Floats, susceptibility: Floats
) -> Floats:
    """φ (n,) A at the nodes `points` (n, 3) m: new on walls where χ changes, elsewhere as given.

    facets: (t, 6), closed surfaces of curved triangles, oriented outwards.  potential: (n,) A.  magnetisation:
    (t, 3) A/m and susceptibility (t,): of the body inside each.
    """
    facets, magnetisation, susceptibility = _jumps(facets, magnetisation, susceptibility)
    chosen = np.unique(facets[susceptibility != 0.0])
    if chosen.size == 0:
        return potential
    cuts = [slice(start, start + _TILE) for start in range(0, len(facets), _TILE)]
    tiles = [_tile(points[facets[c]], potential[facets[c]], magnetisation[c], susceptibility[c]) for c in cuts]
    crowded = [_crowded(node) for node in range(6)]
    longest = max(len(weights) for _, weights in crowded)
    rules = np.zeros((6, longest, 19))  # padded with zero weights
    for rule, (local, weights) in zip(rules, crowded, strict=True):
        rule[: len(weights)] = np.column_stack([*triangle_shapes(local), weights])
    sums = np.zeros((chosen.size, 3))

    def run(chunk: slice) -> None:
        at = points[chosen[chunk]]
        for tile in tiles:
            _evaluate(at, *tile, rules, sums[chunk])

    in_chunks(run, chosen.size, at_least=16)
    charges, filled, dipoles = sums.T / (4 * np.pi)
    found = potential.copy()
    found[chosen] = (charges - dipoles) / (1.0 - filled)
    return found


def _jumps(facets: Integers, magnetisation: Floats, susceptibility: Floats) -> tuple[Integers, Floats, Floats]:
    """Facets on which two bodies touch taken once, with the inner less the outer one's M₀ and χ."""
    corners = np.sort(facets[:, :3], axis=1)
    _, first, which = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    sign = np.where(np.arange(len(facets)) == first[which], 1.0, -1.0)
    jumps = np.zeros((len(first), 4))
    np.add.at(jumps, which, sign[:, None] * np.column_stack([magnetisation, susceptibility]))
    return facets[first], jumps[:, :3], jumps[:, 3]


def _tile(nodes: Floats, values: Floats, magnetisation: Floats, susceptibility: Floats) -> _Tile:
    """What `_evaluate` needs of some triangles."""
    centre = nodes[:, :3].mean(axis=1)
    size = np.linalg.norm(nodes[:, :3] - centre[:, None], axis=-1).max(axis=1)
    bodies = nodes, values, magnetisation, susceptibility
    far, near = (_sources(*bodies, *triangle_rule(degree)) for degree in (2, 6))
    return *bodies, centre, size, far, near


def _sources(
    nodes: Floats, values: Floats, magnetisation: Floats, susceptibility: Floats, local: Floats, weights: Floats
) -> Floats:
    """(8, q, t): places, charges M₀·n dS, normals χ n dS and potential at a rule's points on every triangle."""
    shapes, du, dv = triangle_shapes(local)
    normals = np.cross(*(np.einsum("qa,tai->tqi", d, nodes) for d in (du, dv))) * weights[:, None]
    sources = np.empty((8, weights.size, len(nodes)))
    sources[:3] = np.einsum("qa,tai->iqt", shapes, nodes)
    sources[3] = np.einsum("ti,tqi->qt", magnetisation, normals)
    sources[4:7] = np.einsum("t,tqi->iqt", susceptibility, normals)
    sources[7] = np.einsum("qa,ta->qt", shapes, values)
    return sources


def _crowded(node: int) -> tuple[Floats, Floats]:
    """Points (q, 2) and weights of a rule on the unit triangle for what is singular, as 1/r, at one of its six nodes.

    Triangles that have the node as a corner are squares with one side drawn together there (Duffy 1982).
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
    x, w = np.polynomial.legendre.leggauss(_CROWDED)
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid((x + 1) / 2, (x + 1) / 2))
    weights = np.outer(w, w).ravel() / 4
    apex = corners[node]
    local, shares = [], []
    for first, second in ((0, 1), (1, 2), (2, 0)):
        one, other = corners[first] - apex, corners[second] - apex
        area = one[0] * other[1] - one[1] * other[0]
        if area > 1e-12:  # else the node lies on this side
            local.append(apex + a * ((1 - b) * one + b * other))
            shares.append(weights * a[:, 0] * area)
    return np.concatenate(local), np.concatenate(shares)


@kernel
def _evaluate(
    points: Points,
    nodes: Floats,
    values: Floats,
    magnetisation: Floats,
    susceptibility: Floats,
    centre: Floats,
    size: Floats,
    far: Floats,
    near: Floats,
    rules: Floats,
    sums: Floats,
) -> None:
    """Add to `sums` (n, 3), at every point, ∮ M₀·n/r, ∮ χ (r·n)/r³ and ∮ χ φ (r·n)/r³ over all surfaces."""
    count = nodes.shape[0]
    share = np.empty(count)
    for i in range(points.shape[0]):
        at = points[i]
        for t in range(count):
            dx, dy, dz = at[0] - centre[t, 0], at[1] - centre[t, 1], at[2] - centre[t, 2]
            share[t] = 1.0 if dx * dx + dy * dy + dz * dz > (_FAR * size[t]) ** 2 else 0.0
        _add_far(at[0], at[1], at[2], far, share, sums[i])
        for t in range(count):
            if share[t] == 1.0:
                continue
            dx, dy, dz = at[0] - centre[t, 0], at[1] - centre[t, 1], at[2] - centre[t, 2]
            if dx * dx + dy * dy + dz * dz > (_NEAR * size[t]) ** 2:
                for q in range(near.shape[1]):
                    s = near[:, q, t]
                    _add(at[0] - s[0], at[1] - s[1], at[2] - s[2], s[3], s[4], s[5], s[6], s[7], sums[i])
            else:
                _add_close(at, nodes[t], values[t], magnetisation[t], susceptibility[t], rules, sums[i])


@kernel
def _add(
    rx: float, ry: float, rz: float, charge: float, nx: float, ny: float, nz: float, value: float, sums: Floats
) -> None:
    """One charge and one dipole at distance r."""
    inverse = 1.0 / np.sqrt(rx * rx + ry * ry + rz * rz)
    flux = (rx * nx + ry * ny + rz * nz) * inverse**3
    sums[0] += charge * inverse
    sums[1] += flux
    sums[2] += flux * value


@summing_kernel
def _add_far(x: float, y: float, z: float, sources: Floats, share: Floats, sums: Floats) -> None:
    """The same sums as `_add` over the triangles whose share is one, written for vector units."""
    charges = filled = dipoles = 0.0
    for q in range(sources.shape[1]):
        px, py, pz, charge = sources[0, q], sources[1, q], sources[2, q], sources[3, q]
        nx, ny, nz, value = sources[4, q], sources[5, q], sources[6, q], sources[7, q]
        for t in range(share.size):
            rx, ry, rz = x - px[t], y - py[t], z - pz[t]
            squared = 1.0 / max(rx * rx + ry * ry + rz * rz, 1e-60)
            inverse = share[t] * np.sqrt(squared)
            flux = (rx * nx[t] + ry * ny[t] + rz * nz[t]) * inverse * squared
            charges += charge[t] * inverse
            filled += flux
            dipoles += flux * value[t]
    sums[0] += charges
    sums[1] += filled
    sums[2] += dipoles


@kernel
def _add_close(
    at: Floats, nodes: Floats, values: Floats, magnetisation: Floats, chi: float, rules: Floats, sums: Floats
) -> None:
    """One triangle close to the point, by the rule that crowds at its nearest node."""
    nearest, least = 0, np.inf
    for a in range(6):
        distance = (at[0] - nodes[a, 0]) ** 2 + (at[1] - nodes[a, 1]) ** 2 + (at[2] - nodes[a, 2]) ** 2
        if distance < least:
            nearest, least = a, distance
    for q in range(rules.shape[1]):
        rule = rules[nearest, q]
        weight = rule[18]
        if weight == 0.0:
            break
        rx, ry, rz = at[0], at[1], at[2]
        xu = yu = zu = xv = yv = zv = value = 0.0
        for a in range(6):
            x, y, z, shape, du, dv = nodes[a, 0], nodes[a, 1], nodes[a, 2], rule[a], rule[6 + a], rule[12 + a]
            rx -= shape * x
            ry -= shape * y
            rz -= shape * z
            xu += du * x
            yu += du * y
            zu += du * z
            xv += dv * x
            yv += dv * y
            zv += dv * z
            value += shape * values[a]
        nx, ny, nz = weight * (yu * zv - zu * yv), weight * (zu * xv - xu * zv), weight * (xu * yv - yu * xv)
        charge = magnetisation[0] * nx + magnetisation[1] * ny + magnetisation[2] * nz
        _add(rx, ry, rz, charge, chi * nx, chi * ny, chi * nz, value, sums)
