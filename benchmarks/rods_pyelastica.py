"""A cantilever under a dead tip force by PyElastica's dynamic relaxation; prints its time and tip as JSON.

It stands alone, for an environment of its own: `pip install pyelastica`, then `python rods_pyelastica.py CASE`, CASE
the JSON that `benchmarks/rods.py` writes: length, radius, youngs_modulus, density, force (3,), elements, seconds.
"""

from __future__ import annotations

import json
import sys
from time import process_time

import elastica as ea
import numpy as np


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    """A clamped rod, a force, a damper."""


def main(case: dict) -> None:
    simulator = Simulator()
    rod = ea.CosseratRod.straight_rod(
        case["elements"],
        np.zeros(3),
        np.array([0.0, 0.0, 1.0]),
        np.array([1.0, 0.0, 0.0]),
        case["length"],
        case["radius"],
        case["density"],
        youngs_modulus=case["youngs_modulus"],
        shear_modulus=case["youngs_modulus"] / 3,
    )
    simulator.append(rod)
    simulator.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    simulator.add_forcing_to(rod).using(ea.EndpointForces, np.zeros(3), np.array(case["force"]), ramp_up_time=1e-3)
    # The slowest bending mode critically damped, steps well within the elements' own time of sound.
    slowest = 3.516 * np.sqrt(case["youngs_modulus"] / case["density"]) * case["radius"] / 2 / case["length"] ** 2
    step = 0.15 * case["length"] / case["elements"] / np.sqrt(case["youngs_modulus"] / case["density"])
    simulator.dampen(rod).using(ea.AnalyticalLinearDamper, uniform_damping_constant=2 * slowest, time_step=step)
    simulator.finalize()
    stepper, steps = ea.PositionVerlet(), int(case["seconds"] / step)
    time = stepper.step(simulator, np.float64(0.0), step)  # compiles
    started = process_time()
    for _ in range(steps):
        time = stepper.step(simulator, time, step)
    print(
        json.dumps({"took": process_time() - started, "steps": steps, "tip": rod.position_collection[:, -1].tolist()})
    )


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
