"""How stiff the plant is, from where its magnets are: one factor of all moduli, followed as measurements come in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from magfem.rod.goals import POSITION_SCALE
from magfem.rod.rod import Rod
from magfem.rod.sections import FlexibleSection
from magfem.rod.state import RodState
from magfem.typing import Floats, Points

_FORGET = 0.9  # of what earlier measurements weigh, for each new one
_LARGEST = log(2.0)  # either way: beyond, it is not the stiffness that is wrong
_NEAR = 0.35  # rad and POSITION_SCALE, the largest misfit of a magnet: beyond, the model has another shape
_LEAST = 1e-6  # rad² of information below which a measurement says nothing
_EXPLAINED = 0.5  # of the squared misfit: a factor that explains less is not believed


@dataclass(frozen=True)
class StiffnessEstimate:
    """log_factor: of the moduli, natural logarithm.  weight: rad², how much the measurements have said."""

    log_factor: float = 0.0
    weight: float = 0.0

    @property
    def factor(self) -> float:
        """What to multiply the moduli with."""
        return exp(self.log_factor)


def updated(
    before: StiffnessEstimate, model: RodState, in_use: float, positions: Points, axes: Floats
) -> StiffnessEstimate:
    """The estimate after magnets were seen at `positions` (m, 3) m, the rod's axis along `axes` (m, 3) there.

    model: the state of the rod whose moduli are `in_use` times the nominal ones. One Gauss–Newton step of the factor
    that makes it fit, averaged with earlier ones by what each could tell.
    """
    x = model.factored.stiffening()[model.loads.chain.magnet_node]
    frames = model.magnet_frames[:, :, 2]
    shift, a, b = x[:, 3:] / POSITION_SCALE, x[:, :3], frames
    turn = a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
    slope = np.concatenate([shift, turn]).ravel()
    misfit = np.concatenate([(positions - model.magnet_positions) / POSITION_SCALE, axes - frames]).ravel()
    information = float(slope @ slope)
    if not (information >= _LEAST and np.abs(misfit).max() <= _NEAR):
        return before
    step = float(slope @ misfit) / information
    unexplained = misfit - step * slope
    if not (abs(step) <= _LARGEST and unexplained @ unexplained <= (1 - _EXPLAINED) * (misfit @ misfit)):
        return before
    weight = _FORGET * before.weight + information
    there = log(in_use) + step
    there = before.log_factor + information / weight * (there - before.log_factor)
    return StiffnessEstimate(float(np.clip(there, -_LARGEST, _LARGEST)), weight)


def stiffened(rod: Rod, factor: float) -> Rod:
    """The rod with all moduli times `factor`."""
    return Rod(
        [
            replace(
                one,
                youngs_modulus=factor * one.youngs_modulus,
                shear_modulus=None if one.shear_modulus is None else factor * one.shear_modulus,
            )
            if isinstance(one, FlexibleSection)
            else one
            for one in rod.sections
        ],
        rod.base,
        rod.magnet_fields,
    )
