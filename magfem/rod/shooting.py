"""The dissertation's statics of a rod (2.2.1), kept as a baseline: Cosserat's equations, shot from the base.

Single shooting: a guess of force and moment at the base, ξ = (n₀, m₀), integrated to the tip, where both must vanish;
Levenberg–Marquardt on ξ with a Jacobian of finite differences. The magnets' wrenches are given, dead, and spread evenly
over the magnets; they are not looked up again along the shape, as `Rod.solve` does. Nothing is said about stability.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.rod.rod import Rod
from magfem.rod.sections import FlexibleSection, three
from magfem.rod.shooting_kernel import integrate, slope
from magfem.typing import ArrayLike, Floats, Integers, Points, Vectors

_DIFFERENCE = 1e-7  # of the rod's bending scale: increment of ξ for the Jacobian
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e8  # Marquardt's, of JᵀJ's diagonal; a tenth or tenfold


@dataclass(frozen=True, eq=False)
class ShotShape:
    """A shape of the rod, at N + 1 material points.

    states: (N + 1, 13) position, quaternion (real part first), internal force and moment, eqs. 2.1 and 2.5.
    residual: what is left of the tip's force and moment, over the rod's bending stiffness: rad.
    iterations: of Levenberg–Marquardt, each one trial step.
    """

    states: Floats
    magnet_rows: Integers
    residual: float
    iterations: int
    converged: bool

    @property
    def base_wrench(self) -> Floats:
        """(6,) ξ, force and moment at the base."""
        return self.states[0, 7:]

    @property
    def positions(self) -> Points:
        """(N + 1, 3) m."""
        return self.states[:, :3]

    @property
    def magnet_positions(self) -> Points:
        """(m, 3) m, of the magnets' centres."""
        return self.states[self.magnet_rows, :3]

    @property
    def magnet_frames(self) -> Floats:
        """(m, 3, 3), columns the magnets' axes."""
        frames: Floats = Rotation.from_quat(self.states[self.magnet_rows, 3:7], scalar_first=True).as_matrix()
        return frames


@dataclass(frozen=True, eq=False, kw_only=True)
class Shooting:
    """How a rod is shot.

    flexible_steps, rigid_steps: N_f and N_r, subsections of every flexible section and every magnet; N_r is even, so
    that there is a point at the magnet's centre.  threshold: rad, of the residual.  most_iterations: of
    Levenberg–Marquardt.  gravity: (3,) m/s².

    Raises InputError for what the published statics do not have: magnets without length, that act on each other, or a
    section that is itself magnetic or whose intrinsic curvature varies.
    """

    rod: Rod
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    flexible_steps: int = 16
    rigid_steps: int = 2
    threshold: float = 1e-6
    most_iterations: int = 60

    def __post_init__(self) -> None:
        for name, value in (("flexible_steps", self.flexible_steps), ("rigid_steps", self.rigid_steps)):
            if type(value) is not int or value < 1:
                raise InputError(f"shooting: {name} must be a whole number above 0, got {value!r}")
        if self.rigid_steps % 2:
            raise InputError(
                f"shooting: rigid_steps must be even, for a point at the magnet's centre, got {self.rigid_steps}"
            )
        if self.rod.magnet_fields is not None:
            raise InputError("shooting knows no forces between the rod's magnets: leave magnet_fields out")
        for one in self.rod.sections:
            if not one.length > 0:
                raise InputError("shooting spreads wrenches over the magnets: give every MagnetSection a length")
            if isinstance(one, FlexibleSection) and (
                callable(one.intrinsic_curvature) or np.any(np.asarray(one.magnetic_moment_per_length, float))
            ):
                raise InputError("shooting takes sections of constant intrinsic curvature that are not magnetic")
        _ = self._own_loads

    def solve(self, forces: Vectors, torques: Vectors, guess: Floats | None = None) -> ShotShape:
        """The shape under forces and torques (m, 3) N, N·m on the magnets' centres, in world axes.

        guess: (6,) ξ; without one, zero. A shape that misses the threshold is returned, `converged` False.
        """
        force, torque = (part.copy() for part in self._own_loads)
        force[self._magnets] += np.asarray(forces, float) / self._length[self._magnets, None]
        torque[self._magnets] += np.asarray(torques, float) / self._length[self._magnets, None]
        rod = (self._length, self._steps, self._compliance, self._rest, force, torque)
        scale = self._scale
        shape = self._shot(rod, np.zeros(6) if guess is None else guess)
        other, J = np.empty_like(shape), np.empty((6, 6))
        missed = shape[-1, 7:] / scale
        damping, iterations = _DAMPING, 0
        stale = True
        while np.abs(missed).max() > self.threshold and iterations < self.most_iterations and damping < _MOST_DAMPING:
            if stale:
                slope(*rod, shape, _DIFFERENCE * scale, other, J)
                scaled = J * scale / scale[:, None]
                normal, gradient = scaled.T @ scaled, scaled.T @ missed
                stale = False
            change = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
            trial = self._shot(rod, shape[0, 7:] + change * scale)
            missed_then = trial[-1, 7:] / scale
            iterations += 1
            # NaN, of a shot that ran away, compares as no better
            if missed_then @ missed_then < missed @ missed:
                shape, missed, stale = trial, missed_then, True
                damping = max(damping / 10, _LEAST_DAMPING)
            else:
                damping *= 10
        residual = float(np.abs(missed).max())
        return ShotShape(shape, self._magnet_rows, residual, iterations, residual <= self.threshold)

    def _shot(self, rod: tuple[Floats, Integers, Floats, Floats, Floats, Floats], base_wrench: Floats) -> Floats:
        shape = np.empty((int(self._steps.sum()) + 1, 13))
        shape[0, :7] = self._base
        shape[0, 7:] = base_wrench
        integrate(*rod, shape)
        return shape

    @cached_property
    def _base(self) -> Floats:
        rotation = self.rod.base.rotation
        return np.concatenate([self.rod.base.translation, rotation.as_quat(scalar_first=True)])

    @cached_property
    def _flexible(self) -> list[FlexibleSection | None]:
        return [one if isinstance(one, FlexibleSection) else None for one in self.rod.sections]

    @cached_property
    def _magnets(self) -> Integers:
        """Which sections are magnets."""
        return np.array([k for k, one in enumerate(self._flexible) if one is None], dtype=np.int64)

    @cached_property
    def _length(self) -> Floats:
        return np.array([one.length for one in self.rod.sections], dtype=float)

    @cached_property
    def _steps(self) -> Integers:
        steps = [self.rigid_steps if one is None else self.flexible_steps for one in self._flexible]
        return np.array(steps, dtype=np.int64)

    @cached_property
    def _magnet_rows(self) -> Integers:
        """Which material points are the magnets' centres."""
        ends: Integers = np.cumsum(self._steps)[self._magnets]
        return ends - self.rigid_steps // 2

    @cached_property
    def _compliance(self) -> Floats:
        """(k, 6) 1/(EI, EI, GJ), 1/(GA, GA, EA), eq. 2.2's K⁻¹; zero for magnets."""
        return np.array([np.zeros(6) if one is None else 1 / one.stiffness for one in self._flexible])

    @cached_property
    def _rest(self) -> Floats:
        """(k, 6) û, v̂."""
        straight = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        return np.array(
            [
                straight
                if one is None
                else [
                    *three("flexible section", "intrinsic_curvature", np.asarray(one.intrinsic_curvature)),
                    *three("flexible section", "intrinsic_strain", one.intrinsic_strain),
                ]
                for one in self._flexible
            ]
        )

    @cached_property
    def _own_loads(self) -> tuple[Floats, Floats]:
        """(k, 3) N/m of weight and dead loads, and (k, 3) N."""
        gravity = three("shooting", "gravity", self.gravity)
        force, torque = np.zeros((len(self._length), 3)), np.zeros((len(self._length), 3))
        for k, one in enumerate(self.rod.sections):
            if isinstance(one, FlexibleSection):
                force[k] = one.density * one.section.area * gravity + np.asarray(one.force_per_length, float)
                torque[k] = np.asarray(one.moment_per_length, float)
            else:
                force[k] = one.mass / one.length * gravity
        return force, torque

    @cached_property
    def _scale(self) -> Floats:
        """(6,) what forces and moments are measured by: EI/L² and EI/L of the softest section and the whole rod."""
        softest = min(float(one.stiffness[:2].min()) for one in self._flexible if one is not None)
        length = self.rod.length
        return np.repeat([softest / length**2, softest / length], 3)
