"""The rod that steering tests use: two magnets in BigMag, in the plane of its coils."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.rod import FlexibleSection, MagnetSection, Rod

BASE = RigidTransform.from_components([-0.03, 0, 0], Rotation.from_euler("y", 90, degrees=True))


def two_magnets(stiffness: float = 1.0, elements: int | None = None) -> Rod:
    """Flexible, magnet, flexible, magnet; axis along +x; polyurethane of 5.5 MPa times `stiffness`.

    The magnets point against each other: a uniform field bends the rod into an S, a gradient into an arc, and the
    field's forces on them nearly cancel.
    """
    flexible = FlexibleSection(
        length=25e-3, radius=1.5e-3, youngs_modulus=5.5e6 * stiffness, density=1040, elements=elements
    )
    inner, outer = (MagnetSection(length=4e-3, moment=moment, mass=1.47e-4) for moment in (-0.021, 0.021))
    return Rod([flexible, inner, flexible, outer], BASE)


def stable_targets(system, plant, count: int, seed: int, planar: bool = False):
    """Directions (count, 2, 3) of both magnets that stable states at random currents within ±8 A have."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        currents = rng.uniform(-8, 8, len(system.coils))
        joints = np.zeros(2) if planar else rng.uniform(-np.pi / 4, np.pi / 4, 2)
        state = plant.solve((system, currents, joints), strict=False)
        axes = state.magnet_frames[:, :, 2]
        if state.stable and not (planar and np.abs(axes[:, 1]).max() > 1e-6):
            found.append(axes)
    return np.array(found)


def drive(controller, plant, most_steps: int = 400, plans: int = 3):
    """Close the loop on a plant that is measured exactly: the last steering, the plant's state, all steerings."""
    from magfem.rod.planning import plan

    now = controller.begin()
    state = plant.solve((controller.system, now.currents, now.joints), controller.gravity)
    history = []
    for _ in range(most_steps):
        now = controller.advance(now, state.magnet_positions, state.magnet_frames)
        history.append(now)
        if now.outcome == "converged" or (now.outcome != "moving" and now.plans == plans):
            break
        if now.outcome != "moving":
            now = plan(controller, now)
            history.append(now)
            if now.outcome == "unreachable":
                break
            continue
        where = (controller.system, now.currents, now.joints)
        state = plant.solve(where, controller.gravity, guess=state, strict=False)
        if not state.stable:  # pulled out of the workspace: all currents off
            now = plan(controller, now)
            state = plant.solve((controller.system, 0 * now.currents, 0 * now.joints), controller.gravity)
    return now, state, history
