"""How far contacts and forces that were found are from measured ones.

Everything here works on arrays alone: (T,) of frames at the times `time` [s], evenly spaced.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.optimize import linear_sum_assignment
from scipy.signal import butter, filtfilt

# A foot bears load above the first part of the robot's weight, and touches above the second; where
# the file says what touches, it is believed, and so are loads above the third.
LOADED, TOUCHING, TOUCHING_BESIDE = 0.05, 0.01, 0.002
# Gaps of the load under the first are none; loads and unloaded times count from the second on [s].
SHORTEST_GAP, SHORTEST = 0.03, 0.1
# Changes that are off by more are missed [s].
FARTHEST = 0.25
# How far from other states a frame must be to be surely loaded or surely free [s].
SURELY = 0.04
# What is left out at both ends of a clip, of changes and of forces, as accelerations are poor
# there [s].
CHANGE_MARGIN, FORCE_MARGIN = 0.12, 0.1
# Both forces are filtered alike before they are compared: cut-off [Hz] and order, both ways.
FORCE_CUTOFF, FORCE_ORDER = 10.0, 2
# The centre of pressure is compared where the vertical force is above this part of the weight.
COP_LOADED = 0.25


def runs(mask):
    """First frames and ends (one past the last frame) of each run of true."""
    edges = np.flatnonzero(np.diff(np.r_[0, np.asarray(mask, dtype=int), 0]))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def lasting(run, time):
    """From the first to the last frame of a run [s]."""
    return time[run[1] - 1] - time[run[0]]


@dataclass(frozen=True)
class Change:
    """A foot that begins (+1) or ends (-1) to bear load, somewhere from one frame to the other."""

    sign: int
    first: int
    last: int


@dataclass(frozen=True)
class TrueContact:
    """What a measured vertical force says of the contact of a foot."""

    changes: list
    loaded: np.ndarray  # (T,), bool: bears load, gaps that are none closed
    free: np.ndarray  # (T,), bool: nothing touches, and long enough


def true_contact(force, time, weight, touch=None):
    """The contact of a foot from its vertical force.

    A change is right anywhere between first touch and lasting load, and back. Loads under 0.1 s
    between unloaded times are bounces, gaps under 30 ms are none, and only unloaded times of 0.1 s
    and more in which nothing touches for as long count.

    Args:
        force: (T,), vertical [N].
        weight: m g [N].
        touch: (T,), bool, what else is known of touch; None if nothing is.
    """
    force = np.nan_to_num(force)
    loaded = force > LOADED * weight
    touching = force > TOUCHING * weight
    if touch is not None:
        touching = (force > TOUCHING_BESIDE * weight) | touch
    frames = len(time)

    def inner(run):
        return run[0] > 0 and run[1] < frames

    for run in runs(~loaded):
        if inner(run) and lasting(run, time) < SHORTEST_GAP:
            loaded[slice(*run)] = True
    for run in runs(loaded):
        if inner(run) and lasting(run, time) < SHORTEST:
            loaded[slice(*run)] = False  # a bounce, which touches
    changes, free = [], np.zeros(frames, dtype=bool)
    for begin, end in runs(~loaded):
        if lasting((begin, end), time) < SHORTEST:
            continue
        untouched = [(begin + first, begin + last) for first, last in runs(~touching[begin:end])]
        untouched = [run for run in untouched if lasting(run, time) >= SHORTEST]
        if not untouched:
            continue
        for run in untouched:
            free[slice(*run)] = True
        if begin > 0:
            changes.append(Change(-1, begin, untouched[0][0]))
        if end < frames:
            changes.append(Change(1, untouched[-1][1], end))
    return TrueContact(changes, loaded, free)


def change_errors(found, truth, time, measured):
    """How far each change of contact that is known is from one that was found.

    Args:
        found: (T,), bool, whether the foot is in contact.
        truth: a TrueContact.
        measured: (T,), bool, where the force is known.

    Returns:
        Errors [s] beyond the interval in which the change may be, inf where it was missed. No
        change that was found is used twice.
    """
    steps = np.diff(np.asarray(found, dtype=int))
    inside = measured & (time > time[0] + CHANGE_MARGIN) & (time < time[-1] - CHANGE_MARGIN)
    errors = []
    for sign in (-1, 1):
        at = time[1:][steps == sign]
        known = [
            (time[change.first], time[change.last])
            for change in truth.changes
            if change.sign == sign and inside[change.first] and inside[change.last]
        ]
        if not known:
            continue
        first, last = np.array(known).T[:, :, None]
        off = np.maximum(np.maximum(first - at, at - last), 0.0)
        rows, columns = linear_sum_assignment(np.minimum(off, FARTHEST))
        best = np.full(len(known), np.inf)
        best[rows] = off[rows, columns]
        errors += np.where(best < FARTHEST, best, np.inf).tolist()
    return errors


def wrong_frames(found, truth, time, measured):
    """Frames that surely bear load and were not found, and that are surely free and were.

    Returns:
        (lost, loaded, made up, free): numbers of frames; loaded and free are all that are sure.
    """
    frames = int(round(SURELY / np.median(np.diff(time))))
    width = 2 * max(1, frames) + 1

    def surely(mask):
        return minimum_filter1d(mask.astype(int), width).astype(bool) & measured

    loaded, free = surely(truth.loaded), surely(truth.free)
    found = np.asarray(found, dtype=bool)
    return (
        int((loaded & ~found).sum()),
        int(loaded.sum()),
        int((free & found).sum()),
        int(free.sum()),
    )


def low_pass(values, time):
    """Values (T, ...) without what is faster than 10 Hz."""
    rate = 1 / np.median(np.diff(time))
    b, a = butter(FORCE_ORDER, min(2 * FORCE_CUTOFF / rate, 0.9))
    padding = min(3 * max(len(a), len(b)), len(values) - 1)
    return filtfilt(b, a, values, axis=0, padlen=padding)


def compared(time, measured):
    """Runs of frames whose forces are known: slices, each with a mask of what to compare of it."""
    inside = (time > time[0] + FORCE_MARGIN) & (time < time[-1] - FORCE_MARGIN)
    return [
        (slice(*run), inside[slice(*run)])
        for run in runs(measured)
        if lasting(run, time) >= FORCE_MARGIN and inside[slice(*run)].any()
    ]


def filtered(values, time, measured):
    """Values (T, ...) where they are known, filtered run by run: (N, ...)."""
    return np.concatenate(
        [low_pass(values[run], time[run])[inside] for run, inside in compared(time, measured)]
    )


def force_error(found, force, time, measured):
    """Root mean square of what a force (T,) is off, in % of the measured one's range."""
    error = filtered(found - force, time, measured)
    return 100 * rms(error) / max(np.ptp(filtered(force, time, measured)), 1e-9)


def cop_error(found, known, time, measured, weight):
    """Root mean square of what the centre of pressure is off along x and y [m], (2,).

    Args:
        found, known: (T, 3): vertical force, and that times x and y of where it presses [N], [N m].

    Returns:
        NaN where no frame bears enough.
    """
    found, known = filtered(found, time, measured), filtered(known, time, measured)
    enough = (found[:, 0] > COP_LOADED * weight) & (known[:, 0] > COP_LOADED * weight)
    if not enough.any():
        return np.full(2, np.nan)
    places = [part[enough, 1:] / part[enough, :1] for part in (found, known)]
    return rms(places[0] - places[1])


def compare_changes(found, known, same, farthest=25):
    """How the changes of contact in one schedule are unlike those in another.

    Args:
        found, known: (T, C), bool: which contacts are active.
        same: how many frames apart changes may be to be the same.
        farthest: how many frames apart they may be to be one that was moved.

    Returns:
        How many `changes` are known, how many of them `moved` by more than `same` frames, the
        `worst` of these distances [frames], how many are `gone`, and how many were `made_up`.
    """
    changes, distances, extra = 0, [], 0
    for one, other in zip(found.T.astype(int), known.T.astype(int), strict=True):
        for sign in (-1, 1):
            at, wanted = (np.flatnonzero(np.diff(steps) == sign) for steps in (one, other))
            changes += len(wanted)
            apart = np.abs(wanted[:, None] - at[None])
            # Far ones cost the same, so that one of them more is worse than all that can be gained.
            pairs = linear_sum_assignment(np.minimum(apart, farthest + 1))
            near = apart[pairs][apart[pairs] <= farthest]
            distances += near.tolist()
            extra += len(at) - len(near)
    return {
        "changes": changes,
        "moved": sum(distance > same for distance in distances),
        "worst": max(distances, default=0),
        "gone": changes - len(distances),
        "made_up": extra,
    }


def share(part, whole):
    """In percent, 0 of nothing."""
    return 100 * part / max(whole, 1)


def rms(values):
    """Root mean square over the first axis."""
    return np.sqrt(np.mean(np.square(values), axis=0))
