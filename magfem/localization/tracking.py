"""Tracks: poses of a magnet that moves, each from a short window of samples, and all of them together.

A pose from one window alone may take a wrong branch, and a filter that starts from it passes the fault on. Here all
windows are judged at once: every window offers its branches, the path through them that moves least for what the
samples allow is where Gauss–Newton begins, and the track is the one that explains all samples best while it moves as
smoothly as its process noise says. That is found from the samples as well, as what makes them most likely. Windows
that do not fit the track even so are told from it, and weigh less.

The magnet is taken to stand still during a window, where it is in its middle. One sensor alone cannot tell a track from
its mirror image: then `Track.ambiguous` says so, and `near` chooses.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from magfem.errors import ConvergenceError, InputError
from magfem.localization.localize import localize, whitened
from magfem.localization.motion import Dynamics, Likelihoods, ProcessNoise, Smoothed, dynamics, kalman_filter, smooth
from magfem.localization.orientation import orientation
from magfem.localization.pose import Pose
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.localization.rotor import Model, as_rotor
from magfem.localization.sensor import Sensors, as_sensors
from magfem.localization.window_likelihood import Windows, likelihoods, misfit, moved
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Points, Vectors

log = logging.getLogger("magfem")

MOST_ITERATIONS = 80
SMALL_CHANGE = 1e-5  # of the distance, and rad
FAULTY = 1e-4  # probability of a window's misfit below which it is told from the track
FEWEST_SAMPLES = 6  # of an axis in a window
ALTERNATIVES = 4
MANY = 300  # windows that take so long that progress is shown
NEVER = 1e9  # cost of a branch that is none
HOPELESS = 100.0  # cost of a path above the best beyond which it is not followed
SETTLED, FROZEN = 3, 8  # iterations after which the process noise is looked for near the last, and is left as it is
START = ProcessNoise(1e-8, 1e-5)
DECADES = 1.5
"""Deviation of the logarithms of process noise before anything was measured. Short tracks alone often prefer none, and
would state too small a covariance."""

COARSE = 4.0  # decades either way that process noise is looked for
LOGARITHMS = (-16.0, 2.0)  # of densities: between no noise at all and no memory


@dataclass(frozen=True, eq=False)
class Track:
    """A magnet's path through w windows.

    times: (w,) s, the windows' middles.  position: (w, 3) m.  axis: (w, 3).  velocity: (w, 3) m/s.  covariance:
    (w, 6, 6), of position and axis in the common frame.  faulty: (w,) windows whose samples do not fit the track.
    noise: the process noise, stated or found.  log_evidence: how likely the samples are.  ambiguous: whether another
    track is about as likely.  alternatives: the other tracks that were followed, likeliest first.  poses: what each
    window says alone.  converged, iterations: of Gauss–Newton on the whole track.
    """

    times: Floats
    position: Points
    axis: Vectors
    velocity: Vectors
    covariance: Floats
    faulty: Booleans
    noise: ProcessNoise
    log_evidence: float
    ambiguous: bool
    alternatives: tuple[Track, ...]
    poses: Pose
    converged: bool
    iterations: int

    @property
    def position_deviation(self) -> Floats:
        """(w,) m, root of the mean square distance from the true position that the covariance states."""
        return np.asarray(np.sqrt(np.einsum("wii->w", self.covariance[:, :3, :3])))

    @property
    def axis_deviation(self) -> Floats:
        """(w,) rad, root of the mean square angle from the true axis that the covariance states."""
        return np.asarray(np.sqrt(np.einsum("wii->w", self.covariance[:, 3:, 3:])))


def track(
    samples: ArrayLike,
    times: ArrayLike,
    model: Model,
    frequency: float | None = None,
    sensors: Sensors = None,
    *,
    starts: ArrayLike,
    near: ArrayLike | None = None,
    noise: ProcessNoise | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
    strict: bool = True,
) -> Track:
    """The track of a magnet from w windows of samples.

    samples: (w, n, 3) T of one sensor, (w, s, n, 3) of several; `windows` cuts them out of one record. Windows with too
    few samples are left out.  times: (n,) s within a window.  starts: (w,) s, increasing, when the windows begin.
    near: (3,) m, where the magnet was about in the first window.  noise: the process noise; None to find it.
    Otherwise as `localize`.

    Raises InputError for fewer than three windows, ConvergenceError where the track did not converge and `strict`.
    """
    begin = real_numbers(starts, "starts must be real numbers (w,) in s")
    if begin.ndim != 1 or begin.size < 3 or not np.all(np.diff(begin) > 0):
        raise InputError("a track needs three windows or more, with starts (w,) in s that increase")
    b = real_numbers(samples, SAMPLES)
    if b.shape[:1] != begin.shape:
        raise InputError(f"{begin.size} windows need samples (w, …), got {b.shape}")
    length = float(np.ptp(real_numbers(times, TIMES)))
    if np.diff(begin).min() < (1 - 1e-9) * length:
        raise InputError(
            f"windows of a track must not overlap, their samples would count twice: one begins every "
            f"{np.diff(begin).min():g} s, and they are {length:g} s long"
        )
    rotor, array = as_rotor(model, rotation_axis), as_sensors(sensors)
    b, begin = _whole(b, begin)
    poses = localize(b, times, rotor, frequency, sensors, strict=False)
    middles = begin + float(np.mean(real_numbers(times, TIMES)))
    with one_thread_for_algebra():
        seen = Windows(rotor, array, whitened(poses.fields, array))
        ways = _paths(poses)
        found = []
        for number, way in enumerate(ways, 1):
            if begin.size > MANY:
                log.info("track: %d windows, way %d of %d", begin.size, number, len(ways))
            found.append(_follow(seen, middles, poses, way, noise))
    found = _distinct(sorted(found, key=lambda one: -one.log_evidence))
    if near is not None:
        where, likeliest = real_numbers(near, "near must be a position (3,) in m"), found[0].log_evidence
        found.sort(key=lambda one: (one.log_evidence < likeliest - 10.0, _apart(one, where)))
    best = found[0]
    if strict and not best.converged:
        raise ConvergenceError(
            f"the track did not converge in {best.iterations} steps; pass strict=False to see it all the same"
        )
    others = tuple(found[1:])
    ambiguous = any(one.log_evidence > best.log_evidence - 3.0 for one in others)
    return Track(**{**best.__dict__, "alternatives": others, "ambiguous": ambiguous})


def windows(
    samples: ArrayLike, times: ArrayLike, length: float, step: float | None = None
) -> tuple[Floats, Floats, Floats]:
    """Cut a record into windows of `length` s, one every `step` s (`length` unless stated).

    samples: (..., n, 3), times (n,) s, evenly sampled. Returns samples (w, ..., k, 3), times (k,) within a window, and
    starts (w,) s. Raises InputError where no window fits or the times are uneven.
    """
    b, t = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    if t.ndim != 1 or t.size < 2 or b.shape[-2:] != (t.size, 3):
        raise InputError(f"samples must be (..., n, 3) and times (n,), got {b.shape} and {t.shape}")
    interval = np.ptp(t) / (t.size - 1)
    if not np.allclose(np.diff(t), interval, rtol=1e-3, atol=0):
        raise InputError("windows are cut out of evenly sampled records: fill gaps with NaN")
    count, hop = round(length / interval), round((length if step is None else step) / interval)
    if hop < 1 or not 1 < count <= t.size:
        raise InputError(
            f"no window of {length:g} s, one every {length if step is None else step:g} s, fits the record"
        )
    first = np.arange(0, t.size - count + 1, hop)
    cut = b[..., first[:, None] + np.arange(count), :]
    return np.moveaxis(cut, -3, 0), t[:count] - t[0], t[first]


def _whole(b: Floats, begin: Floats) -> tuple[Floats, Floats]:
    """The windows, and their starts, in which every sensor took enough samples to say something."""
    axes = (*range(1, b.ndim - 2), b.ndim - 1)
    enough = (np.isfinite(b).sum(axis=-2, keepdims=True) >= FEWEST_SAMPLES).all(axis=axes).reshape(-1)
    if enough.sum() < 3:
        raise InputError(
            f"only {enough.sum()} of {enough.size} windows hold {FEWEST_SAMPLES} samples or more of each axis"
        )
    if not enough.all():
        log.info("track: %d of %d windows hold too few samples and are left out", (~enough).sum(), enough.size)
    return b[enough], begin[enough]


def _paths(poses: Pose) -> list[tuple[Points, Floats]]:
    """Starts for the whole track: positions (w, 3) and frames (w, 3, 3), one for every branch of the surest window.

    Each is the shortest path through the branches of all windows that goes by that branch (Viterbi's algorithm): costs
    are the branches' likelihoods and the steps between them, in units of what noise and motion make of steps.
    """
    p = np.stack([one.position for one in poses.branches], axis=1)  # (w, k, 3)
    a = np.stack([one.axis for one in poses.branches], axis=1)
    phase = np.stack([one.phase for one in poses.branches], axis=1)
    cost = np.stack([poses.log_likelihood - one.log_likelihood for one in poses.branches], axis=1)  # (w, k)
    cost = np.minimum(cost, NEVER)
    # However singular a window is, deviations of positions are at most the distance, of axes a radian.
    distance = np.linalg.norm(p, axis=-1)
    wide = np.stack([np.minimum(one.position_deviation, poses.distance) for one in poses.branches], axis=1)
    turned = np.stack([np.minimum(one.axis_deviation, 1.0) for one in poses.branches], axis=1)
    step = np.linalg.norm(p[1:, None, :, :] - p[:-1, :, None, :], axis=-1)  # (w − 1, k before, k after)
    turn = np.linalg.norm(a[1:, None, :, :] - a[:-1, :, None, :], axis=-1)
    usual = np.median(step.min(axis=(1, 2))), np.median(turn.min(axis=(1, 2)))
    between = 0.5 * step**2 / (usual[0] ** 2 + wide[:-1, :, None] ** 2 + wide[1:, None, :] ** 2)
    between += 0.5 * turn**2 / (usual[1] ** 2 + turned[:-1, :, None] ** 2 + turned[1:, None, :] ** 2)

    forward, arrow_back = _sweep(cost, between)
    backward, arrow_ahead = _sweep(cost[::-1], np.swapaxes(between, 1, 2)[::-1])
    backward, arrow_ahead = backward[::-1], arrow_ahead[::-1]
    through = forward + backward - cost
    sure = int(np.argmin((wide / np.maximum(distance, 1e-12))[:, 0]))
    chosen = []
    for k in np.argsort(through[sure], kind="stable")[:ALTERNATIVES]:
        if through[sure, k] > through[sure].min() + HOPELESS:
            continue
        path = np.empty(len(p), dtype=np.int64)
        path[sure] = k
        for w in range(sure, 0, -1):
            path[w - 1] = arrow_back[w - 1, path[w]]
        for w in range(sure, len(p) - 1):
            path[w + 1] = arrow_ahead[w, path[w]]
        every = np.arange(len(p))
        chosen.append((p[every, path], orientation(a[every, path], phase[every, path])))
    return chosen


def _sweep(cost: Floats, between: Floats) -> tuple[Floats, Floats]:
    """Least costs (w, k) of paths that end at each branch, and for each step (w − 1, k) the branch it came from."""
    total, arrows = [cost[0]], []
    for w in range(len(between)):
        way = total[-1][:, None] + between[w]
        arrows.append(way.argmin(axis=0))
        total.append(way.min(axis=0) + cost[w + 1])
    return np.array(total), np.array(arrows)


def _follow(
    seen: Windows, times: Floats, poses: Pose, path: tuple[Points, Floats], noise: ProcessNoise | None
) -> Track:
    """Gauss–Newton on a whole track from a path, process noise found between the steps."""
    p, R = path
    expected = 6 * len(seen.array.sensors) - 1  # what is left of a window's misfit, but for the phase, is the track's
    limit = float(chi2.isf(FAULTY, expected))
    weight = np.ones(len(p))
    used = START if noise is None else noise
    change = np.inf
    iterations = 0
    spin: Floats = np.zeros_like(p)
    while True:
        measured, phase = likelihoods(seen, p, R, weight)
        motion = dynamics(np.diff(times), R[:-1, :, 2], spin[:-1])
        if noise is None and iterations < FROZEN:  # by then it hardly changes any more
            used = _process_noise(measured, motion, used, iterations)
        found = smooth(measured, motion, used)
        spin = 0.5 * (spin + found.state[:, 9:])  # halfway: what is not observed would swing about
        if change < SMALL_CHANGE or iterations == MOST_ITERATIONS:
            break
        p, R, changes = moved(seen, p, R, found.state, phase)
        change = float(changes.max())
        iterations += 1
        if iterations >= SETTLED:  # before, it may be the track that does not fit the windows
            weight = np.minimum(1.0, limit / np.maximum(misfit(seen, p, R), 1e-12))
    return _as_track(times, poses, found, used, weight < 1.0, change < SMALL_CHANGE, iterations)


def _process_noise(measured: Likelihoods, motion: Dynamics, last: ProcessNoise, iterations: int) -> ProcessNoise:
    """The densities that predict the windows best, each from those before it.

    Far from the end every iteration searches anew, on a coarse grid of logarithms: what was found about a bad track may
    be far off. Then the top of the parabola through nine points around, ever closer.
    """
    usual = np.log10([float(START.position), float(START.axis)])

    def predicted(points: Floats) -> Floats:
        """(k,) log evidence of windows under densities of logarithms (k, 2), and of these before anything was seen."""
        evidence = kalman_filter(measured, motion, ProcessNoise(10 ** points[:, 0], 10 ** points[:, 1])).log_evidence
        return np.asarray(evidence.sum(axis=-1) - 0.5 * np.sum((points - usual) ** 2, axis=1) / DECADES**2)

    widths: tuple[float, ...]
    if iterations < SETTLED:
        grid = usual + COARSE * _SQUARE_OF_SEVEN
        centre, widths = grid[np.argmax(predicted(grid))], (0.7, 0.25)
    else:
        centre, widths = np.log10([float(last.position), float(last.axis)]), (0.25,)
    for width in widths:
        centre = centre + width * _top(predicted(centre + width * _SQUARE_OF_THREE))
    centre = np.clip(centre, *LOGARITHMS)
    return ProcessNoise(float(10 ** centre[0]), float(10 ** centre[1]))


def _square(count: int) -> Floats:
    """(count², 2) points −1 to 1 about the middle, in both directions."""
    steps = np.linspace(-1.0, 1.0, count)
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


_SQUARE_OF_SEVEN, _SQUARE_OF_THREE = _square(7), _square(3)


def _top(values: Floats) -> Floats:
    """(2,) where the paraboloid through values (9,) at `_SQUARE_OF_THREE` is highest, not beyond the square.

    Where it has no top, the best of the nine points.
    """
    x, y = _SQUARE_OF_THREE.T
    terms = np.stack([np.ones(9), x, y, 0.5 * x**2, x * y, 0.5 * y**2], axis=1)
    _, b_x, b_y, a_xx, a_xy, a_yy = np.linalg.lstsq(terms, values, rcond=None)[0]
    A = np.array([[a_xx, a_xy], [a_xy, a_yy]])
    if a_xx < 0 and np.linalg.det(A) > 0:
        top: Floats = np.linalg.solve(A, [-b_x, -b_y])
        return np.clip(top, -1.0, 1.0)
    return np.asarray(_SQUARE_OF_THREE[int(np.argmax(values))])


def _as_track(
    times: Floats,
    poses: Pose,
    found: Smoothed,
    noise: ProcessNoise,
    faulty: Booleans,
    converged: bool,
    iterations: int,
) -> Track:
    axis = found.state[:, 3:6] / np.linalg.norm(found.state[:, 3:6], axis=-1, keepdims=True)
    across = np.tile(np.eye(6), (times.size, 1, 1))
    across[:, 3:, 3:] -= axis[:, :, None] * axis[:, None, :]
    return Track(
        times=times,
        position=found.state[:, :3],
        axis=axis,
        velocity=found.state[:, 6:9],
        covariance=across @ found.covariance[:, :6, :6] @ across,
        faulty=faulty,
        noise=noise,
        log_evidence=float(found.log_evidence.sum()),
        ambiguous=False,
        alternatives=(),
        poses=poses,
        converged=bool(converged),
        iterations=iterations,
    )


def _distinct(found: list[Track]) -> list[Track]:
    """Tracks without those that ended where a likelier one did."""
    kept: list[Track] = []
    for one in found:
        size = np.median(np.linalg.norm(one.position, axis=-1))
        if all(
            np.abs(one.position - other.position).max() > 0.01 * size or np.abs(one.axis - other.axis).max() > 0.05
            for other in kept
        ):
            kept.append(one)
    return kept


def _apart(one: Track, where: Floats) -> float:
    return float(np.linalg.norm(one.position[0] - where))
