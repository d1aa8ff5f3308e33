"""Field of a uniformly magnetised sector of a ring, with gradient and hessian, to near rounding.

Frame: that of the whole ring, centre at the origin and z its axis; any direction of magnetisation. Its part
across the axis is replaced by the surface charge M·n, its part along the axis by the surface current M × n, so
that the flat ends of the sector carry neither. With S(x) = 1/(4π) ∫ w dA / |x − y| over a wall (w = cos φ or
sin φ) or a side (w = 1), a charge density q w and a current density K w give

    B = µ0 (−q ∇S + ∇S × K), and inside, where the charges give H, the transverse part of µ0 M is added.

On the walls ∫ dz/r = [ln(r + Z)] is taken in closed form (r + Z as s/(r − Z) where Z < 0, with s the squared
distance across the axis), and the integral over φ by Gauss–Legendre panels. As a function of φ the integrand
is singular at φ_point ± iη with cosh η = (R² + ρ² + ζ²)/(2Rρ), ζ the height over the ends, 0 beside the wall:
no panel is wider than its middle is far from there, so that each converges as 3.7^(−2 NODES). The sides are
flat rectangles in closed form (`uniform_block`).

Far away charges and currents cancel. There the Newtonian potential U(x) = 1/(4π) ∫ dV / |x − y| is derived
under the integral, B_i = µ0 M_j ∂_i ∂_j U, by the same panels in φ and Gauss–Legendre rules in ρ and z.

Slanovc et al., J. Magn. Magn. Mater. 559, 169482 (2022), give an all-analytic form of B.

Measured on a ring, inner radius 1, outer 2, length 1.5, whole and cut into four, against `ring_jet`: relative
error of B 1e-14 everywhere farther than 1e-4 from edges (the edges of the ring alone: 1e-10 at 1e-6); of gradient
and hessian, d off the curved walls, in units of the inner radius,

    d = 0.1     5e-14   6e-13        d = 0.001    2e-12   5e-9
    d = 0.01    1e-12   2e-10        d = 0.0001   1e-11   5e-7

and less off faces and edges. On the walls themselves, being moved inwards, B and gradient hold to 1e-7; the
hessian has no digits there. From 0.3 to 100 sizes away all three agree with integrated dipoles to 1e-11, those of
a thin shell among them. A point takes 10 to 30 µs with all three.
"""

from __future__ import annotations

from math import asinh, atan2, cos, log, pi, sin, sqrt

import numpy as np

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.fields.uniform_block import add_pole, rectangle_derivatives, symmetric_tensors
from magfem.threads import in_chunks
from magfem.typing import ArrayLike, Booleans, Floats, Jet, Points

NODES = 14  # of a panel
FAR = 2.0  # distance, in circumscribed radii, beyond which the volume is integrated over
SECTION = 20  # nodes, at most, along ρ and along z of that integral
WIDEST = 1.2  # rad, half a panel at most
SURFACE = 1e-7  # points nearer to the surface, in units of the shortest half size, are moved inwards by this
ROUNDING = 1e-12  # points nearer to the surface, in units of the outer radius, lie on it
THREAD = 100  # points that are worth a thread

_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(NODES)
_COMPONENTS = (0, 3, 9, 19, 34)  # up to each order
_RULES = np.zeros((2, SECTION + 1, SECTION))
for _count in range(1, SECTION + 1):
    _RULES[:, _count, :_count] = np.polynomial.legendre.leggauss(_count)
_ODD_IN_Z = np.array([2, 5, 7, 11, 13, 16, 18])  # z, xz, yz, xxz, xyz, yyz, zzz
_LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)[None])  # [j, k, i] = ε_ijk


def cylinder_segment_jet(
    points: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    length: float,
    start: float,
    end: float,
    magnetisation: ArrayLike,
    order: int = 1,
) -> Jet:
    """Field of a uniformly magnetised sector of a ring, with its derivatives, inside and outside.

    Parameters
    ----------
    points : (..., 3) m, frame of the ring.
    inner_radius, outer_radius, length : m, 0 ≤ inner_radius < outer_radius, length > 0.
    start, end : rad, azimuths of the two sides, start < end ≤ start + 2π; the whole turn has no sides.
    magnetisation : (3,) A/m, any direction, the same throughout.
    order : 0 for B, 1 for B and gradient, 2 for B, gradient and hessian.

    Returns
    -------
    B (..., 3) T, gradient (..., 3, 3) T/m, hessian (..., 3, 3, 3) T/m², up to `order`.
    The surface belongs to the magnet. On it, and inside nearer than 1e-7 of the shortest half size: the values
    that far inwards, large on edges; the hessian next to a curved wall only when farther off than 1e-5.
    """
    array = np.asarray(points, dtype=float)
    m = np.asarray(magnetisation, dtype=float)
    turn = (end - start) / 2
    whole = turn > np.pi * (1 - 1e-12)
    every = array.reshape(-1, 3)
    far = np.linalg.norm(every, axis=1) > FAR * np.hypot(outer_radius, length / 2)
    result = [np.empty((len(every), *(3,) * (n + 1))) for n in range(order + 1)]
    distant = _volume_derivatives(every[far], inner_radius, outer_radius, length, start, end, order + 2)
    for value, tensor in zip(result, distant, strict=True):
        value[far] = tensor @ m
    flat, inside = _moved(every[~far], inner_radius, outer_radius, length, start, end, whole)
    jet = [np.zeros((flat.shape[0], *(3,) * (n + 1))) for n in range(order + 1)]
    jet[0] += inside[:, None] * m * [1, 1, 0]

    def add(potential: tuple[Floats, ...], charge: float, current: Floats) -> None:
        matrix = -charge * np.eye(3) + np.einsum("jki,k->ij", _LEVI_CIVITA, current)
        for value, tensor in zip(jet, potential, strict=True):
            value += np.einsum("ij,nj...->ni...", matrix, tensor)

    for radius, sign in ((outer_radius, 1.0), (inner_radius, -1.0)):
        if radius > 0:
            cosine, sine = _wall_derivatives(flat, radius, length, start, end, order + 1)
            add(cosine, sign * m[0], sign * m[2] * np.array([0.0, 1.0, 0.0]))
            add(sine, sign * m[1], sign * m[2] * np.array([-1.0, 0.0, 0.0]))
    for azimuth, sign in () if whole else ((end, 1.0), (start, -1.0)):
        outward, along = _axes(azimuth)
        side = _side_derivatives(flat, inner_radius, outer_radius, length, azimuth, order + 1)
        add(side, sign * float(m @ along), -sign * m[2] * outward)
    for value, near in zip(result, jet, strict=True):
        value[~far] = near
    return tuple(MU_0 * value.reshape(*array.shape[:-1], *value.shape[1:]) for value in result)


def _axes(azimuth: float) -> tuple[Floats, Floats]:
    """Unit vectors ρ and φ at an azimuth."""
    return np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])


def _moved(
    points: Points, inner: float, outer: float, length: float, start: float, end: float, whole: bool
) -> tuple[Points, Booleans]:
    """The points, those on the surface moved inwards, and whether each lies in the magnet (its surface included)."""
    turn, half, middle = (end - start) / 2, length / 2, (start + end) / 2
    step = SURFACE * min((outer - inner) / 2, half, outer * min(turn, 1.0))
    rounding = ROUNDING * outer
    rho = np.hypot(points[:, 0], points[:, 1])
    azimuth = np.remainder(np.arctan2(points[:, 1], points[:, 0]) - middle + np.pi, 2 * np.pi) - np.pi
    inside = (rho <= outer + rounding) & (rho >= inner - rounding) & (np.abs(points[:, 2]) <= half + rounding)
    nearest = inner + step
    if whole:
        nearest = nearest if inner > 0 else 0.0
    else:
        inside &= rho * (np.abs(azimuth) - turn) <= rounding
        nearest = max(nearest if inner > 0 else 0.0, step / np.sin(min(turn, np.pi / 2)))
    depth = np.clip(rho, nearest, outer - step)
    limit = turn - np.arcsin(np.minimum(step / np.maximum(depth, step), 1.0))
    angle = azimuth if whole else np.clip(azimuth, -limit, limit)
    height = np.clip(points[:, 2], step - half, half - step)
    near = inside & ((depth != rho) | (angle != azimuth) | (height != points[:, 2]))
    within = np.stack([depth * np.cos(middle + angle), depth * np.sin(middle + angle), height], axis=-1)
    return np.where(near[:, None], within, points), inside


def _side_derivatives(
    points: Points, inner: float, outer: float, length: float, azimuth: float, highest: int
) -> tuple[Floats, ...]:
    """∂S of a side, orders 1 to `highest`, in the ring's axes."""
    outward, along = _axes(azimuth)
    frame = np.stack([outward, along, [0.0, 0.0, 1.0]])
    local = (points - (inner + outer) / 2 * outward) @ frame.T
    return _turned(rectangle_derivatives(local, outer - inner, length, highest), frame)


def _wall_derivatives(
    points: Points, radius: float, length: float, start: float, end: float, highest: int
) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
    """∂S of a wall with w = cos φ and with w = sin φ, orders 1 to `highest`."""
    out = np.empty((points.shape[0], 2, _COMPONENTS[highest]))

    def run(chunk: slice) -> None:
        _wall(points[chunk], radius, length / 2, start, end, highest, out[chunk])

    in_chunks(run, points.shape[0], THREAD)
    # The kernel's axes are ρ and φ of the point, from whose azimuth its cosine and sine count.
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    c, s, zero = np.cos(azimuth), np.sin(azimuth), np.zeros(len(points))
    frame = np.stack([c, s, zero, -s, c, zero, zero, zero, zero + 1], axis=-1).reshape(-1, 3, 3)
    cosine, sine = out[:, 0], out[:, 1]
    c, s = c[:, None], s[:, None]
    return (
        _turned(symmetric_tensors(c * cosine - s * sine, 1, highest), frame),
        _turned(symmetric_tensors(s * cosine + c * sine, 1, highest), frame),
    )


def _turned(tensors: tuple[Floats, ...], frame: Floats) -> tuple[Floats, ...]:
    """Tensors (n, 3, …) from a frame whose axes are the rows of `frame`, (3, 3) or (n, 3, 3), to the ring's."""
    result = []
    for order, tensor in enumerate(tensors, start=1):
        for axis in range(1, order + 1):
            rows = np.moveaxis(tensor, axis, -1)
            turned = np.reshape(rows, (len(rows), 3 ** (order - 1), 3)) @ frame
            tensor = np.moveaxis(turned.reshape(rows.shape), -1, axis)
        result.append(tensor)
    return tuple(result)


def _volume_derivatives(
    points: Points, inner: float, outer: float, length: float, start: float, end: float, highest: int
) -> tuple[Floats, ...]:
    """∂U of the sector at points beyond FAR, orders 2 to `highest`."""
    out = np.zeros((points.shape[0], _COMPONENTS[highest]))

    def run(chunk: slice) -> None:
        _volume(points[chunk], inner, outer, length / 2, start, end, highest, out[chunk])

    in_chunks(run, points.shape[0], THREAD)
    return symmetric_tensors(out, 2, highest)


@kernel
def _volume(
    points: Floats, inner: float, outer: float, half: float, start: float, end: float, highest: int, out: Floats
) -> None:
    """Add the components (n, c) of the derivatives of U to `out`."""
    breadth, middle = (outer - inner) / 2, (outer + inner) / 2
    u = np.empty(3)
    for n in range(points.shape[0]):
        x, y, z = points[n]
        rho = sqrt(x * x + y * y)
        gap = sqrt(rho * rho + z * z) - sqrt(outer * outer + half * half)
        across = _section_nodes(gap / breadth)
        along = _section_nodes(gap / half)
        origin = atan2(y, x)
        a = start - origin
        a -= 2.0 * pi * np.floor(a / (2.0 * pi) + 0.5)
        last = a + (end - start)
        # The nearest singularity for any ρ and z of the section: |y|² + |x|² − 2 |y| |x| cos at the largest |y|.
        ball = sqrt(outer * outer + half * half)
        far = sqrt(rho * rho + z * z)
        eta = 2.0 * asinh((far - ball) / sqrt(4.0 * ball * far))
        while a < last:
            width = _panel(a, last, eta)
            for node in range(NODES):
                phi = origin + a + width * (1.0 + _ABSCISSAE[node])
                c, s = cos(phi), sin(phi)
                for i in range(across):
                    radius = middle + breadth * _RULES[0, across, i]
                    weight = _WEIGHTS[node] * width * _RULES[1, across, i] * breadth * radius * half / (4.0 * pi)
                    u[0], u[1] = x - radius * c, y - radius * s
                    for j in range(along):
                        u[2] = z - half * _RULES[0, along, j]
                        add_pole(u, weight * _RULES[1, along, j], highest, out[n])
            a += 2.0 * width
            if last - a < 1e-15:
                break


@kernel
def _section_nodes(gap: float) -> int:
    """Nodes of a rule whose integrand is singular no nearer than `gap` half widths beside it."""
    return min(SECTION, int(15.0 / log(gap + sqrt(1.0 + gap * gap))) + 2)


@kernel
def _panel(a: float, last: float, eta: float) -> float:
    """Half width of the panel that begins at `a`, with singularities at ± iη, and whole turns from there."""
    width = min(WIDEST, _reach(-a, eta), _reach(2.0 * pi - a, eta), _reach(-2.0 * pi - a, eta))
    if a + 2.2 * width > last:
        width = min(width, 0.5 * (last - a))
    return width


@kernel
def _wall(points: Floats, radius: float, half: float, start: float, end: float, highest: int, out: Floats) -> None:
    """Components (n, 2, c) of the derivatives of S in the frame of ρ, φ, z at each point, cosine then sine.

    There the wall near the point has coordinates without rounding at the scale of the radius.
    """
    size = out.shape[2]
    line = np.empty(19)
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], abs(points[n, 2])
        rho = sqrt(x * x + y * y)
        gap = rho - radius
        above = max(z - half, 0.0)
        # Azimuths count from the point's, by whole turns such that the singularity at 0 is the arc's nearest.
        a = start - atan2(y, x)
        a -= 2.0 * pi * np.floor(a / (2.0 * pi) + 0.5)
        if a > 2.0 * pi - (a + (end - start)):
            a -= 2.0 * pi
        last = a + (end - start)
        eta = max(2.0 * asinh(sqrt((gap * gap + above * above) / (4.0 * radius * rho))), 1e-12)
        for i in range(size):
            out[n, 0, i] = out[n, 1, i] = 0.0
        while a < last:
            width = _panel(a, last, eta)
            for node in range(NODES):
                phi = a + width * (1.0 + _ABSCISSAE[node])
                c, s, versine = cos(phi), sin(phi), 2.0 * sin(phi / 2.0) ** 2
                _line(gap + radius * versine, -radius * s, z, half, highest, line)
                weight = _WEIGHTS[node] * width * radius / (4.0 * pi)
                for i in range(size):
                    out[n, 0, i] += weight * c * line[i]
                    out[n, 1, i] += weight * s * line[i]
            a += 2.0 * width
            if last - a < 1e-15:
                break
        if points[n, 2] < 0.0:
            for i in _ODD_IN_Z:
                if i < size:
                    out[n, 0, i], out[n, 1, i] = -out[n, 0, i], -out[n, 1, i]


@kernel
def _reach(ahead: float, eta: float) -> float:
    """The half width w ≤ ½ |middle − singularity| of a panel that begins `ahead` before a singularity ± iη."""
    return (sqrt(4.0 * ahead * ahead + 3.0 * eta * eta) - ahead) / 3.0


@kernel
def _line(x: float, y: float, z: float, half: float, highest: int, out: Floats) -> None:
    """Derivatives of ∫ dz/r over a line from −half to half through the origin, at z ≥ 0."""
    for i in range(19):
        out[i] = 0.0
    square = x * x + y * y
    for end in range(2):
        sign = 1.0 - 2.0 * end
        u = z + sign * half
        r = sqrt(square + u * u)
        inverse = 1.0 / r
        q = 1.0 / (r + u) if u > 0.0 else (r - u) / square
        f = sign * inverse * q  # ∂_x ln(r + u) = x f
        out[0] += x * f
        out[1] += y * f
        out[2] += sign * inverse
        if highest < 2:
            continue
        g = -f * inverse * (inverse + q)  # ∂_x f = x g
        cube = sign * inverse**3
        out[3] += f + x * x * g
        out[4] += x * y * g
        out[5] -= x * cube
        out[6] += f + y * y * g
        out[7] -= y * cube
        out[8] -= u * cube
        if highest < 3:
            continue
        h = f * inverse * inverse * (3.0 * inverse * (inverse + q) + 2.0 * q * q)  # ∂_x g = x h
        fifth = 3.0 * cube * inverse * inverse
        out[9] += x * (3.0 * g + x * x * h)
        out[10] += y * (g + x * x * h)
        out[11] += x * x * fifth - cube
        out[12] += x * (g + y * y * h)
        out[13] += x * y * fifth
        out[14] += x * u * fifth
        out[15] += y * (3.0 * g + y * y * h)
        out[16] += y * y * fifth - cube
        out[17] += y * u * fifth
        out[18] += u * u * fifth - cube
