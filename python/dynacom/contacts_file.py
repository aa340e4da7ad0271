# SPDX-License-Identifier: BSD-2-Clause
"""What contacts feel, as arrays for whoever trains controllers."""

from pathlib import Path

import numpy as np

from dynacom.motion_joints import rotations
from dynacom.motion_report import MotionReport


def contact_arrays(report: MotionReport) -> dict[str, np.ndarray]:
    """Arrays of T frames and C contacts, see docs/files.md.

    Returns:
        ``time`` (T,) [s]; ``fps``, NaN where frames are not evenly spaced [Hz]; ``frame`` (T,), the
        row of the motion's file, -1 of frames that it does not have; ``contact_names`` (C,);
        ``contact_mask`` (T, C), bool; ``contact_forces`` (T, C, 3), in the world [N];
        ``contact_wrenches`` (T, C, 6), force and moment in the surface's frame, about its origin
        [N], [N m]; ``cop`` (T, C, 3), in the world, NaN of a contact that bears less than 1 N [m].
    """
    found, clip = report.examination, report.clip
    frames = len(report.motion.time)
    contacts = found.analysis.contacts
    names = [contact.name for contact in contacts]

    def stack(arrays: list[np.ndarray], *shape: int) -> np.ndarray:
        return np.array(arrays).reshape(len(names), frames, *shape).swapaxes(0, 1)

    wrenches = stack([contact.wrench for contact in contacts], 6)
    rotation = stack([rotations(moved.rotation) for moved in found.contacts], 3, 3)
    cop = stack([np.pad(contact.cop, ((0, 0), (0, 1))) for contact in contacts], 3)
    place = stack([moved.position for moved in found.contacts], 3)
    frame = np.arange(frames)
    if clip.gaps is not None:
        frame = np.full(frames, -1)
        frame[clip.gaps.places()] = np.arange(len(clip.gaps.time))
    return {
        "time": report.motion.time,
        "fps": np.array(found.derived.frame_rate),
        "frame": frame,
        "contact_names": np.array(names, dtype=str),
        "contact_mask": stack([contact.active for contact in contacts]).astype(bool),
        "contact_forces": np.einsum("tcij,tcj->tci", rotation, wrenches[..., :3]),
        "contact_wrenches": wrenches,
        "cop": place + np.einsum("tcij,tcj->tci", rotation, cop),
    }


def write_contacts(report: MotionReport, path: str | Path) -> None:
    """Writes them as an archive of NumPy's.

    Raises:
        OSError: the file cannot be written.
    """
    np.savez_compressed(path, **contact_arrays(report))
