# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 5. Many motions at once, on all cores. How fast may one crouch?"""

import tempfile
from pathlib import Path

import numpy as np
from crouch import crouch

import dynacom

talos = dynacom.load_robot("talos")
periods = (2.0, 1.5, 1.0, 0.9, 0.8, 0.7, 0.6, 0.5)

with tempfile.TemporaryDirectory() as folder:
    for number, period in enumerate(periods):
        time, q = crouch(talos.dynacom(), period)
        np.savez(Path(folder, f"{number}.npz"), t=time, q=q)

    # A row per clip, in the order of the files' names. A clip that cannot be read would be a row
    # with its error. With out=, all of this would be in files, with a page for people.
    table = dynacom.batch(folder, talos).to_pylist()

for period, row in zip(periods, table, strict=True):
    print(
        f"{period:.1f} s: {row['verdict']}, within reach {100 * row['solved_share']:3.0f} %, "
        f"left sole up to {row['contact.left_sole.largest_vertical_force']:.2f} m g"
    )
