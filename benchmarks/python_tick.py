# SPDX-License-Identifier: BSD-2-Clause
"""Times a tick of a controller that is written in Python: Talos, on its two soles, mid-walk.

A tick is computeDynamics(q, v, a) and distributeForce(f, tau, com), each given NumPy arrays. Prints
a JSON object, {"name": "python/tick", "median_ns": ...}.
"""

import json
import statistics
import timeit
from pathlib import Path

import numpy as np

import dynacom

WALK = Path(__file__).parents[1] / "examples" / "data" / "talos_walk.npz"
TICKS, REPETITIONS = 1000, 100


def main():
    with np.load(WALK) as file:
        on_both_soles = np.flatnonzero(file["contacts"].all(axis=1))
        frame = on_both_soles[len(on_both_soles) // 2]
        q, v, a = (file[key][frame].copy() for key in "qva")
    talos = dynacom.load_robot("talos").dynacom()
    talos.computeDynamics(q, v, a)
    f, tau, com = talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM()

    def tick():
        talos.computeDynamics(q, v, a)
        return talos.distributeForce(f, tau, com)

    if tick() != dynacom.DistributionStatus.Solved:
        raise RuntimeError("the soles cannot give the walk's wrench")
    times = timeit.repeat(tick, number=TICKS, repeat=REPETITIONS)
    median = statistics.median(times) / TICKS
    print(json.dumps({"name": "python/tick", "median_ns": round(1e9 * median)}))


if __name__ == "__main__":
    main()
