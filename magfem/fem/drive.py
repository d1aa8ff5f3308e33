"""Two circuits driven by sinusoidal currents: the field that turns, as in the stator of a synchronous motor.

With currents I cos ωt in the first circuit and I cos(ωt − lag) in the second, every point sees

    B(t) = C cos ωt + S sin ωt,    C = I (b₁ + cos(lag) b₂),    S = I sin(lag) b₂,

which traces an ellipse in the plane of C and S; b₁ and b₂ are the circuits' fields per ampere. The semi-axes are the
singular values of the matrix [C S]; a field that only turns, and does not swing, has two equal ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.fem.coil_solution import CoilSolution
from magfem.fields.field import Field
from magfem.typing import ArrayLike, Floats

QUADRATURE = math.pi / 2


@dataclass(frozen=True)
class TurningField:
    """The field of two circuits under sinusoidal currents.

    names: the circuits, the leading one first.  amplitude: A.  lag: rad, of the second current behind the first.
    """

    coil: CoilSolution
    names: tuple[str, str]
    amplitude: float
    lag: float

    def currents(self, phase: float) -> dict[str, float]:
        """The currents (A) by circuit at a `phase` ωt in rad."""
        first, second = self.names
        return {first: self.amplitude * math.cos(phase), second: self.amplitude * math.cos(phase - self.lag)}

    def at(self, phase: float) -> Field:
        """The field in T at a `phase` ωt in rad."""
        return self.coil.driven(self.currents(phase))

    def phasors(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """C and S (..., 3) T at `points` (..., 3) m: B(t) = C cos ωt + S sin ωt."""
        first, second = (self.coil.circuit(name).B(points) for name in self.names)
        C = self.amplitude * (first + math.cos(self.lag) * second)
        S = self.amplitude * math.sin(self.lag) * second
        return C, S

    def semi_axes(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Largest and smallest size (...) T that the turning field takes at `points` (..., 3) m."""
        sizes = np.linalg.svd(np.stack(self.phasors(points), axis=-1), compute_uv=False)
        return sizes[..., 0], sizes[..., 1]

    def axis(self, points: ArrayLike) -> Floats:
        """Unit vector (..., 3) about which the field turns, right-handed; NaN where it only swings."""
        C, S = self.phasors(points)
        normal = np.cross(C, S)
        size = np.linalg.norm(normal, axis=-1, keepdims=True)
        with np.errstate(invalid="ignore"):
            axis: Floats = np.where(size > 0, normal / size, np.nan)
        return axis

    @property
    def power(self) -> float:
        """Mean heat (W): each current is there half of the time, in the sense of squares."""
        return 0.5 * self.amplitude**2 * sum(self.coil.circuit(name).resistance for name in self.names)


def quadrature(
    coil: CoilSolution,
    amplitude: float = 1.0,
    lag: float = QUADRATURE,
    names: tuple[str, str] | None = None,
) -> TurningField:
    """Drive two circuits of a coil a quarter period apart (`lag`, rad), each with `amplitude` A.

    names: which circuits, first the leading one (None: the coil's two). Raises InputError when there are not two.
    """
    if names is None:
        if len(coil.circuits) != 2:
            raise InputError(
                f"a quadrature drive needs two circuits, {coil.geometry.name} has {len(coil.circuits)}: "
                "name two of them"
            )
        names = (coil.circuits[0].name, coil.circuits[1].name)
    for name in names:
        coil.circuit(name)
    if names[0] == names[1]:
        raise InputError(f"a quadrature drive needs two different circuits, got {names[0]!r} twice")
    for label, value in (("amplitude", amplitude), ("lag", lag)):
        if not math.isfinite(value):
            raise InputError(f"{label} must be finite, got {value}")
    return TurningField(coil, names, float(amplitude), float(lag))
