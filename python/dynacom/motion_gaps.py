# SPDX-License-Identifier: BSD-2-Clause
"""Frames that a recording has dropped are made anew, so that all are evenly spaced."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from dynacom.dynacom_pywrap import ContactSchedule

# How far times may be from an even rate, in frames: as where frames are filtered.
_UNEVEN = 0.1


@dataclass(frozen=True)
class Gaps:
    """Between which frames others are missing."""

    #: (T,), of the file.
    time: np.ndarray
    #: How many are missing after each frame but the last, (T - 1,).
    missing: np.ndarray

    @classmethod
    def find(cls, time: np.ndarray) -> "Gaps | None":
        """None where no frame is missing, or times are uneven in another way."""
        steps = np.diff(time)
        if not len(steps) or steps.max() < 1.5 * steps.min():
            return None
        counts = np.rint(steps / np.median(steps)).astype(int)
        if counts.min() < 1:
            return None
        places = np.concatenate([[0], np.cumsum(counts)])
        step = (time[-1] - time[0]) / places[-1]
        if np.abs(time - time[0] - step * places).max() > _UNEVEN * step or counts.max() == 1:
            return None
        return cls(time, counts - 1)

    def note(self) -> str:
        """What was made, and of what."""
        count, first = int(self.missing.sum()), self.time[np.argmax(self.missing > 0)]
        what = (
            f"The frame after {first:.4g} s is missing: it was made from those around it"
            if count == 1
            else f"Frames are missing, {count} in all, the first after {first:.4g} s: they were "
            "made from those around them"
        )
        return f"{what}, so that frames are evenly spaced."

    def places(self) -> np.ndarray:
        """Where the file's frames are among all, (T,)."""
        return np.concatenate([[0], np.cumsum(self.missing + 1)])

    def times(self) -> np.ndarray:
        """Of all frames, (T + missing,)."""
        places = self.places()
        return np.interp(np.arange(places[-1] + 1), places, self.time)

    def repeated(self, values: np.ndarray) -> np.ndarray:
        """Rows of values, missing ones as the one before."""
        return np.repeat(values, np.append(self.missing + 1, 1), axis=0)

    def interpolated(self, values: np.ndarray) -> np.ndarray:
        """Rows of values, missing ones by the cubic through the two rows at either side."""
        made = self.repeated(values)
        for place, rows, weights in self._stencils():
            made[place] = weights @ values[rows]
        return made

    def configurations(self, model: pin.Model, q: np.ndarray) -> np.ndarray:
        """The same of configurations (T, nq), as differences from the one before."""
        made = self.repeated(q)
        for place, rows, weights in self._stencils():
            base = made[place]
            differences = np.array([pin.difference(model, base, q[row]) for row in rows])
            made[place] = pin.integrate(model, base, weights @ differences)
        return made

    def schedule(self, schedule: ContactSchedule) -> ContactSchedule:
        """As in the frame before."""
        active = self.repeated(np.asarray(schedule.active))
        if schedule.confidence is None:
            return ContactSchedule(schedule.names, active)
        return ContactSchedule(schedule.names, active, self.repeated(schedule.confidence))

    def forces(self, forces: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """By contact."""
        return {name: self.interpolated(values) for name, values in forces.items()}

    def _stencils(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Of each missing frame: its place, the frames around it, and Lagrange's weights."""
        places, times = self.places(), self.times()
        for before in np.flatnonzero(self.missing).tolist():
            rows = np.arange(max(before - 1, 0), min(before + 3, len(self.time)))
            nodes = self.time[rows]
            for place in range(places[before] + 1, places[before + 1]):
                weights = [
                    np.prod([(times[place] - b) / (a - b) for b in nodes if b != a]) for a in nodes
                ]
                yield place, rows, np.array(weights)
