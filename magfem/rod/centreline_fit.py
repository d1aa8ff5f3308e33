"""From a point cloud to a centreline (dissertation, 2.2.4 and eq. 3.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_basis import centreline_basis
from magfem.rod.curve_fit import PointCloud, Task, fit_curve, nearest_places
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Points

if TYPE_CHECKING:
    from magfem.rod.centreline_basis import CentrelineBasis

_NEIGHBOURS = (10, 40)  # along which a cloud is walked; more when too few points are reached


@one_thread_for_algebra()
def fit_centreline(
    points: ArrayLike,
    length: float,
    base: ArrayLike,
    *,
    arc_lengths: ArrayLike | None = None,
    base_tangent: ArrayLike | None = None,
    straight: tuple[tuple[float, float], ...] = (),
    degree: int = 6,
    robust: bool = True,
    ordered: bool = False,
    start: Centreline | None = None,
) -> Centreline:
    """The centreline of a rod of known length through a cloud of points.

    Parameters
    ----------
    points : (n, 3) m on the rod's axis, with noise and, if `robust`, with outliers.
    length : m.
    base : (3,) m, where the rod begins; held exactly.
    arc_lengths : (n,) m, the points' places along the rod; found along if not given.
    base_tangent : (3,), direction at the base, of any length; free if not given.
    straight : (start, end) m of the rigid stretches: exactly straight, where a plain polynomial smears.
    degree : of the polynomial on every flexible stretch.
    robust : weighs outliers down by Tukey's biweight; about 5 % of the precision is its price.
    ordered : the points follow the rod from base to tip. Only used without `arc_lengths` and `start`.
    start : a centreline nearby, such as the one before: faster, and safe where the rod nearly touches itself.

    Raises InputError for data that cannot be used, ConvergenceError when no curve of the length fits half of them.
    """
    data = finite(points, "points", (-1, 3))
    rod = rod_of(length, base, base_tangent, straight, degree)
    task = Task(*rod, PointCloud(data), slide=arc_lengths is None, robust=robust)
    enough(task, len(data))
    if arc_lengths is not None:
        s = finite(arc_lengths, "arc lengths", (len(data),))
        if not np.all((s >= 0) & (s <= length * (1 + 1e-9))):
            raise InputError(f"centreline: arc lengths must lie between 0 and the rod's length {length:g} m")
        return fit_curve(task, None, s, rough=True)
    if start is not None:
        c = adopted(start, task)
        return fit_curve(task, c, nearest_places(task, task.curve(c)), rough=False)
    crowd = data if ordered else data[in_company(data)]
    c = rough_shape(task, crowd, walked(crowd, task.base, length, ordered))
    return fit_curve(task, c, nearest_places(task, task.curve(c)), rough=True)


def rod_of(
    length: float,
    base: ArrayLike,
    base_tangent: ArrayLike | None,
    straight: tuple[tuple[float, float], ...],
    degree: int,
) -> tuple[CentrelineBasis, Floats, Floats | None]:
    """Basis, base and unit tangent, checked."""
    tangent = None
    if base_tangent is not None:
        tangent = finite(base_tangent, "base tangent", (3,))
        if not np.any(tangent):
            raise InputError("centreline: the base tangent must not be zero")
        tangent = tangent / np.linalg.norm(tangent)
    stretches = tuple((float(start), float(end)) for start, end in straight)
    return centreline_basis(length, stretches, degree, tangent is None), finite(base, "base", (3,)), tangent


def finite(values: ArrayLike, name: str, shape: tuple[int, ...]) -> Floats:
    """An array of the shape, −1 for any number, without NaN and infinities."""
    array = np.asarray(values, dtype=float)
    if array.ndim != len(shape) or any(want not in (-1, got) for want, got in zip(shape, array.shape, strict=True)):
        expected = ", ".join("n" if want < 0 else str(want) for want in shape)
        raise InputError(f"centreline: {name} must be an array of shape ({expected}), got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"centreline: {name} must be finite; leave out what was not seen")
    return array


def enough(task: Task, count: int) -> None:
    """Raises InputError when so few data cannot fix the curve."""
    need = task.basis.count + 2
    if count < need:
        raise InputError(
            f"centreline: {count} point{'s' * (count != 1)} cannot fix {task.basis.count} coefficients per coordinate, "
            f"at least {need} are needed; a lower degree needs fewer"
        )


def adopted(start: Centreline, task: Task) -> Floats:
    """Coefficients (K, 3) of a centreline in the task's basis: its own, or those of the nearest curve."""
    if start.basis == task.basis and start.base_tangent is None:
        return start.coefficients
    s, weights = task.basis.quadrature
    place = start.position(np.minimum(s * (start.length / task.basis.length), start.length)) - task.base
    if task.base_tangent is not None:
        place = place - s[:, None] * task.base_tangent
    found: Floats = task.basis.functions(s).T @ (weights[:, None] * place)
    return found


def in_company(points: Points) -> Booleans:
    """(n,) which points (n, d) have their fourth neighbour no farther than four times the median of that distance.

    Outliers that are scattered thinly have not. It only serves cold starts: the fit itself weighs all data.
    """
    from scipy.spatial import cKDTree

    if len(points) < 10:
        return np.ones(len(points), dtype=bool)
    reach = cKDTree(points).query(points, k=5)[0][:, -1]
    return np.asarray(reach <= 4 * np.median(reach))


def walked(points: Points, base: Floats, length: float, ordered: bool) -> Floats:
    """Rough arc lengths (n,) m of cloud points: how long the way to each is, from the base, through its neighbours.

    Points may have any number of coordinates. In order: along the points. Else: the way of least squared hops, which
    keeps to the dense cloud and off outliers. Noise makes ways longer, never shorter: they are scaled to the length.
    """
    everything = np.concatenate([base[None], points])
    if ordered:
        way = np.cumsum(np.linalg.norm(np.diff(everything, axis=0), axis=-1))
        return np.asarray(way * min(1.0, length / way[-1]))
    # Heavy to import, and only cold starts need them.
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import cKDTree

    count = len(everything)
    tree = cKDTree(everything)
    for neighbours in (*_NEIGHBOURS, count - 1):
        hop, index = tree.query(everything, k=min(neighbours + 1, count))
        rows = np.repeat(np.arange(count), hop.shape[1])
        squares = np.maximum(hop.ravel() ** 2, 1e-300)  # zero would mean no way at all
        graph = csr_matrix((squares, (rows, index.ravel())), shape=(count, count))
        cost, previous = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
        if np.mean(np.isfinite(cost)) > 0.9 or neighbours >= count - 1:
            break
    way = np.full(count, 0.0)
    for i in np.argsort(cost)[1:]:
        if np.isfinite(cost[i]):
            way[i] = way[previous[i]] + np.linalg.norm(everything[i] - everything[previous[i]])
    way[~np.isfinite(cost)] = length / 2
    found: Floats = way[1:] * min(1.0, length / float(np.quantile(way[1:], 0.95)))
    return np.clip(found, 0.0, length)


def rough_shape(task: Task, points: Points, s: Floats) -> Floats:
    """Coefficients (K, 3) through points (n, 3) m at rough arc lengths, least absolute distances, a little stiff."""
    basis, place = task.basis, points - task.base
    if task.base_tangent is not None:
        place = place - s[:, None] * task.base_tangent
    functions = basis.functions(s)
    bending = basis.functions(basis.quadrature[0], 2) * (0.03 * basis.length**2)
    stiffness = bending.T @ (basis.quadrature[1][:, None] * bending)
    weight = np.ones(len(s))
    for _ in range(10):
        c = np.linalg.solve(
            functions.T @ (weight[:, None] * functions) + weight.sum() * 1e-2 * stiffness,
            functions.T @ (weight[:, None] * place),
        )
        away = np.linalg.norm(place - functions @ c, axis=-1)
        weight = 1 / np.maximum(away, 0.3 * np.median(away) + 1e-12 * basis.length)
    found: Floats = c
    return found
