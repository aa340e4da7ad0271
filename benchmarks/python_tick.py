# SPDX-License-Identifier: BSD-2-Clause
"""What a controller's tick takes in Python: prints a JSON object.

Talos at rest in its neutral configuration, on two soles, as the case ``tick`` of
``bench_dynamics.cpp``.
"""

import json
import statistics
import time

import numpy as np
import pinocchio

import dynacom

CALLS = 2000


def main():
    talos = dynacom.load_robot("talos").dynacom()
    q, rest = pinocchio.neutral(talos.getModel()), np.zeros(talos.getModel().nv)
    times = []
    for _ in range(10):
        start = time.thread_time_ns()
        for _ in range(CALLS):
            talos.computeDynamics(q, rest, rest)
            talos.distributeForce(
                talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM()
            )
        times.append((time.thread_time_ns() - start) / CALLS)
    print(json.dumps({"name": "python/tick", "median_ns": statistics.median(times)}))


if __name__ == "__main__":
    main()
