"""Fields as magpylib sources, and magpylib's sources as fields."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from magfem.errors import InputError, UnitMismatchError
from magfem.fields.field import OUTSIDE, Evaluated, Field, Unit
from magfem.fields.region import Everywhere, Region
from magfem.fitting.about import facts
from magfem.geometry.catalogue import is_path
from magfem.typing import Floats, Hessians, Jet, Outside, Points, Tensors, Vectors
from magfem.units import describe, one_line

if TYPE_CHECKING:
    from magpylib.misc import CustomSource

FIRST = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Central differences of order eight: f′ h ≈ Σ FIRST[k − 1] (f(kh) − f(−kh)), error h⁹ f⁽⁹⁾/630."""

SECOND = np.array([8 / 5, -1 / 5, 8 / 315, -1 / 560])
"""The same for f″ h² ≈ Σ SECOND[k − 1] (f(kh) − 2 f(0) + f(−kh)), error h¹⁰ f⁽¹⁰⁾/3150."""

_DIRECTIONS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0]])
_AT_A_TIME = 20_000  # points; each takes up to 49 evaluations


def to_magpylib(field: Field, outside: Outside = "nan") -> CustomSource:
    """The field as a magpylib `CustomSource`: B in T and H in A/m, in air, moved and turned as magpylib's own are.

    outside: what the source gives at points outside the field's region: "nan", or "extrapolate". Raises
    UnitMismatchError for a field per ampere, InputError when magpylib is not installed.
    """
    magpylib = _magpylib()
    if outside not in OUTSIDE or outside == "raise":
        raise InputError(f'outside must be "nan" or "extrapolate", got {describe(outside)}')
    if field.unit != "T":
        raise UnitMismatchError(
            "magpylib's sources are in T, and this field is per ampere (T/A): multiply it by its current in A first"
        )

    def field_func(field: str, observers: Points, model: Field = field) -> Vectors | None:
        if field not in ("B", "H"):
            return None  # magpylib says that J and M are not defined
        B = model.B(observers, outside=outside)
        return B if field == "B" else B / magpylib.mu_0

    source: CustomSource = magpylib.misc.CustomSource(field_func=field_func, style_label=facts(field)["name"])
    return source


def magpylib_module(field: Field, model: str | os.PathLike[str], path: Path, current: float | None = None) -> str:
    """The text of a Python module at `path` whose `source` is the model as a magpylib source.

    model: its name in the catalogue or the path of its file, which the module finds from its own place.  current: of
    a model per ampere, A.
    """
    if field.unit != "T" and current is None:
        raise UnitMismatchError(
            "magpylib's sources are in T, and this model is per ampere (T/A): say at which current, in A (--current)"
        )
    reference = repr(os.fspath(model))
    if is_path(model, ".json"):
        relative = os.path.relpath(os.path.realpath(model), os.path.realpath(path.parent))
        reference = f"Path(__file__).parent / {Path(relative).as_posix()!r}"
    lines = [
        *(f"# {key}: {text}" for key, text in facts(field).items()),
        '# A source for magpylib; outside the region its field is nan (to_magpylib\'s outside="extrapolate" goes on).',
        *(["from pathlib import Path", ""] if is_path(model, ".json") else []),
        "import magfem",
        "from magfem.exchange import to_magpylib",
        "",
        f"MODEL = {reference}",
        *([] if current is None else [f"CURRENT = {current!r}  # A"]),
        "",
        f"source = to_magpylib(magfem.load_model(MODEL){'' if current is None else ' * CURRENT'})",
    ]
    return "\n".join([*lines, ""])


def from_magpylib(source: Any, step: float = 1e-5) -> MagpylibField:
    """A magpylib source or collection, as it is now, as a field in T; `step` (m) is that of its derivatives.

    Raises InputError for what magpylib has no B of, a source with a path of several poses, or a step that is no
    length.
    """
    magpylib = _magpylib()
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not 0 < step < math.inf:
        raise InputError(f"step must be a length above 0 in m, got {describe(step)}")
    try:
        copy = source.copy()
        shape = magpylib.getB(copy, np.ones((1, 3)), squeeze=False).shape
    except Exception as error:  # magpylib's own, and whatever a stranger raises
        reason = one_line(str(error).strip().partition("\n")[0])
        raise InputError(f"this is no magpylib source or collection whose B is defined: {reason}") from error
    if shape[1] != 1:
        raise InputError(f"this magpylib source has a path of {shape[1]} poses, and a field has one: reset its path")
    return MagpylibField(copy, float(step))


@dataclass(frozen=True, eq=False)
class MagpylibField(Evaluated):
    """B of a magpylib source, and derivatives by central differences of order eight; a Field in T.

    The derivatives are made symmetric and free of trace, as they are in air: inside magnets and on sheets of current,
    and nearer to them than 6 steps, they mean nothing. At a distance d from the nearest source, of a dipole's kind,
    the gradient's relative error is about 1e4 (step/d)⁸ by truncation and 1e-16 d/step by rounding; the hessian's is
    1e5 (step/d)⁸ and 1e-16 (d/step)². The default of 10 µm suits distances from 0.5 mm to a few centimetres; 1/50
    of the distance suits any.
    """

    source: Any
    step: float
    unit: Unit = "T"

    @property
    def region(self) -> Region:
        return Everywhere()

    def evaluate(self, points: Points, order: int) -> Jet:
        parts = [self._jet(points[k : k + _AT_A_TIME], order) for k in range(0, len(points), _AT_A_TIME)]
        return tuple(np.concatenate(part) for part in zip(*parts, strict=True))

    def _flux_density(self, points: Points) -> Vectors:
        B: Vectors = _magpylib().getB(self.source, points.reshape(-1, 3), squeeze=False)
        return B.reshape(points.shape)

    def _jet(self, points: Points, order: int) -> Jet:
        B = self._flux_density(points)
        if order == 0:
            return (B,)
        directions = _DIRECTIONS[: 3 if order == 1 else 6]
        steps = self.step * np.arange(1, 5)
        offsets = steps[:, None, None] * directions  # (4, directions, 3)
        after, before = (self._flux_density(points[:, None, None] + sign * offsets) for sign in (1, -1))
        slopes = np.einsum("k,nkdi->nid", FIRST, after - before)[..., :3] / self.step
        if order == 1:
            return B, _harmonic_gradient(slopes)
        bends = np.einsum("k,nkdi->nid", SECOND, after - 2 * B[:, None, None] + before) / self.step**2
        return B, _harmonic_gradient(slopes), _harmonic_hessian(bends)


def _harmonic_gradient(slopes: Tensors) -> Tensors:
    """The symmetric, trace-free part of (n, 3, 3)."""
    symmetric = (slopes + slopes.swapaxes(1, 2)) / 2
    found: Tensors = symmetric - np.trace(symmetric, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return found


def _harmonic_hessian(bends: Floats) -> Hessians:
    """The symmetric, trace-free (n, 3, 3, 3) of second derivatives (n, 3, 6) of B_i along `_DIRECTIONS`."""
    hessian = np.empty((len(bends), 3, 3, 3))
    for j in range(3):
        hessian[:, :, j, j] = bends[..., j]
        k, l = (j + 1) % 3, (j + 2) % 3  # noqa: E741
        # Along e_k + e_l the second derivative is H_kk + H_ll + 2 H_kl.
        mixed = (bends[..., 3 + j] - bends[..., k] - bends[..., l]) / 2
        hessian[:, :, k, l] = hessian[:, :, l, k] = mixed
    symmetric = sum(hessian.transpose(0, *order) for order in permutations((1, 2, 3))) / 6
    trace = np.einsum("niik->nk", symmetric) / 5
    unit = np.eye(3)
    for rule in ("ij,nk->nijk", "ik,nj->nijk", "jk,ni->nijk"):
        symmetric = symmetric - np.einsum(rule, unit, trace)
    return np.asarray(symmetric)


def _magpylib() -> Any:
    try:
        import magpylib
    except ModuleNotFoundError:
        raise InputError("magpylib is not installed: pip install 'magpylib>=5.1'") from None
    return magpylib
