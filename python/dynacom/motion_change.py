# SPDX-License-Identifier: BSD-2-Clause
"""What changes in a motion's file when its configurations do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from dynacom.dynacom_pywrap import ContactSchedule, Motion, differentiate
from dynacom.errors import DynacomError
from dynacom.motion_checks import QUATERNION_NOTED, check_finite, normalize
from dynacom.motion_clip import Clip, is_point
from dynacom.motion_joints import brief, joint_angles
from dynacom.robots import STANDARD_GRAVITY

#: A joint that the file does not give has moved if it did so by more than this [rad, m].
_MOVED = 1e-9
#: How far from 1 norms of quaternions may be that are to be written.
_NORM_ERROR = 1e-6
#: How large accelerations may be that rounding makes [m/s^2, rad/s^2]: half of the thousandth of
#: gravity by which the ground's force may be off in flight, where it is zero. The other half is for
#: what rounded angles do to the centre of mass, whose levers about the joints are below a metre.
ROUNDING_NOISE = 5e-4 * STANDARD_GRAVITY


@dataclass
class Change:
    """New configurations of a clip, in the frames that its file has: F of them.

    Numbers that do not change are handed out as the file has them, bit for bit.
    """

    clip: Clip
    #: Indices of the file's frames among the clip's, (F,).
    rows: np.ndarray
    #: (F, nq): as they were read, and as they are to be.
    before: np.ndarray
    q: np.ndarray
    #: When contacts are active, in all frames of the clip; None where that is not known.
    schedule: ContactSchedule | None
    #: As :attr:`Clip.forces`, in all frames.
    forces: Mapping[str, np.ndarray]
    #: Whether the file is to be marked as exact.
    mark: bool
    #: By which factor time is stretched.
    stretch: float = 1.0
    #: What is to be said about what was written.
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        clip: Clip,
        q: np.ndarray,
        schedule: ContactSchedule | None,
        forces: Mapping[str, np.ndarray] | None,
        mark: bool,
        stretch: float = 1.0,
    ) -> "Change":
        """Of a clip.

        Args:
            q: (T, nq), of all frames of the clip.

        Raises:
            DynacomError: something has another shape than it must have, or is not finite.
        """
        if not (np.isfinite(stretch) and stretch > 0.0):
            raise DynacomError(f"stretch must be finite and > 0, got {stretch:g}")
        frames = len(clip.time)
        q = np.asarray(q, dtype=float)
        if q.shape != clip.q.shape:
            raise DynacomError(f"q must have shape {clip.q.shape}, got {q.shape}")
        error = np.abs(np.linalg.norm(q[:, 3:7], axis=1) - 1.0)
        if not np.isfinite(q).all() or not error.max() <= _NORM_ERROR:
            raise DynacomError("q must hold finite numbers and quaternions of norm 1, got others")
        q = q.copy()
        q[:, 3:7], _, _ = normalize(clip.path, q[:, 3:7])
        if schedule is not None and len(schedule.active) != frames:
            raise DynacomError(
                f"schedule must have {frames} frames, as the clip, got {len(schedule.active)}"
            )
        forces = {name: np.asarray(values, dtype=float) for name, values in (forces or {}).items()}
        for name, values in forces.items():
            if name not in clip.robot.contacts:
                raise DynacomError(f"forces must be of the robot's contacts, got '{name}'")
            shape = (frames, 3 if is_point(clip.robot, name) else 6)
            if values.shape != shape:
                raise DynacomError(f"forces of {name} must have shape {shape}, got {values.shape}")
            check_finite(clip.path, f"forces of {name}", values)
        rows = np.arange(frames) if clip.gaps is None else clip.gaps.places()
        change = cls(clip, rows, clip.q[rows], q[rows], schedule, forces, mark, stretch)
        change._note_held_joints()
        return change

    @property
    def model(self) -> pin.Model:
        """The robot's."""
        return self.clip.robot.model

    @property
    def moves(self) -> bool:
        """Whether anything that the file has moves, or does so at another pace."""
        if self.stretch != 1.0:
            return True
        held = self._held_columns()
        return not np.array_equal(np.delete(self.q, held, 1), np.delete(self.before, held, 1))

    @property
    def rate(self) -> float:
        """The highest frame rate after the change [Hz]; 0 of a single frame."""
        time = self.stretched(self.clip.time)
        return 1.0 / np.diff(time).min() if len(time) > 1 else 0.0

    def stretched(self, time: np.ndarray) -> np.ndarray:
        """Times, the first of which stays where it is."""
        return time if self.stretch == 1.0 else time[0] + self.stretch * (time - time[0])

    def frame_rate(self, old: float | None) -> float | None:
        """What the file is to say of its frame rate [Hz]; notes what it cannot.

        Args:
            old: in the file; None where it has neither times nor a rate.
        """
        if self.stretch == 1.0:
            return old
        given = self.clip.options.fps
        rate = (given or old) / self.stretch
        if old is None:
            self.notes.append(
                f"Time is stretched, and the file has no place to say so: its frame rate is "
                f"{rate:.9g} Hz now (--fps)."
            )
            return None
        if given is not None:
            self.notes.append(
                f"The frame rate is {rate:.9g} Hz now, as the file says: --fps is not to be given."
            )
        return rate

    def position(self, old: np.ndarray) -> np.ndarray:
        """The root's, (F, 3).

        Args:
            old: in the file.

        Raises:
            DynacomError: the file is not the one that was read.
        """
        before, after = self.before[:, :3], self.q[:, :3]
        if not np.array_equal(old, before):
            raise DynacomError(f"{self.clip.path}: has changed since it was read")
        return np.where(after == before, old, after)

    def quaternion(self, old: np.ndarray) -> np.ndarray:
        """The root's, (F, 4), x y z w, of the sign that they have in the file.

        Args:
            old: in the file. Those whose norm is off are not kept.
        """
        after = aligned(self.q[:, 3:7], old)
        same = (self.q[:, 3:7] == self.before[:, 3:7]).all(axis=1)
        same &= self.clip.quaternion_error[self.rows] <= QUATERNION_NOTED
        return np.where(same[:, None], old, after)

    def angles(self, names: Sequence[str], old: np.ndarray) -> np.ndarray:
        """Of k joints, (F, k).

        Args:
            old: in the file. Joints without limits may have turned more than once.
        """
        robot = self.clip.robot
        joints = robot.joints.take(names)
        before, after = (joint_angles(robot, q, names) for q in (self.before, self.q))
        same = after == before
        limited = ~joints.unlimited
        if not np.array_equal(old[:, limited], before[:, limited]):
            raise DynacomError(f"{self.clip.path}: has changed since it was read")
        turns = np.where(joints.unlimited, np.rint((old - after) / (2.0 * np.pi)), 0.0)
        return np.where(same, old, after + 2.0 * np.pi * turns)

    def as_read(self, q: np.ndarray, model: pin.Model | None = None) -> np.ndarray:
        """Configurations (F, nq), rounded as the file has them, as they will be read: (T, nq).

        Args:
            model: whose they are, if they are not the robot's.
        """
        q = q.copy()
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
        gaps = self.clip.gaps
        return q if gaps is None else gaps.configurations(model or self.model, q)

    def derivatives(
        self, q: np.ndarray, model: pin.Model | None = None, *, before: bool = False
    ) -> Motion:
        """Velocities and accelerations of such configurations, in all frames of the clip.

        Args:
            before: whether at the pace that the clip had.
        """
        time = self.clip.time if before else self.stretched(self.clip.time)
        return differentiate(model or self.model, time, q)

    def mask(self, contact: str, unsure: bool) -> np.ndarray:
        """When a contact is active, (F,): 0 and 1.

        Args:
            unsure: whether the file says how sure that is: then numbers between are so.
        """
        if contact not in self.schedule.names:
            return np.zeros(len(self.rows))
        column = self.schedule.names.index(contact)
        active = np.asarray(self.schedule.active)[self.rows, column].astype(bool)
        if not unsure or self.schedule.confidence is None:
            return active.astype(float)
        confidence = np.asarray(self.schedule.confidence)[self.rows, column]
        # Rounding must not carry it to the other side of one half.
        return np.where(active, np.maximum(confidence, 0.5), np.minimum(confidence, 0.4999))

    def note_masks(self, contacts: Sequence[str]) -> None:
        """Notes which contacts are active and have no mask in the file."""
        active = np.asarray(self.schedule.active)
        missing = [
            name
            for column, name in enumerate(self.schedule.names)
            if name not in contacts and active[:, column].any()
        ]
        if missing:
            self.notes.append(f"The file has no place to say when {brief(missing)} is active.")

    def note_forces(self, contacts: Sequence[str]) -> None:
        """Notes whose forces the file had and has no more."""
        self.notes.append(
            f"The forces of {brief(contacts)} are left out: they were those of the motion before."
        )

    def note_rounding(self, step: float) -> None:
        """Notes a file whose numbers are too coarse for accelerations.

        Args:
            step: the largest one from a number to the next that can be written.
        """
        noise = rounding_noise(step, self.rate)
        if not noise <= ROUNDING_NOISE:
            self.notes.append(
                f"The file's numbers are coarse: their rounding makes accelerations of up to "
                f"{noise:.2g} m/s^2 or rad/s^2."
            )

    def _held_columns(self) -> np.ndarray:
        """Of joints that the file does not give, in a configuration."""
        model, given = self.model, set(self.clip.joint_names)
        columns = [
            np.arange(joint.idx_q, joint.idx_q + joint.nq)
            for joint, name in zip(model.joints[2:], model.names[2:], strict=True)
            if name not in given
        ]
        return np.concatenate([np.empty(0, dtype=int), *columns])

    def _note_held_joints(self) -> None:
        robot, given = self.clip.robot, set(self.clip.joint_names)
        held = [name for name in robot.joints.names if name not in given]
        before, after = (joint_angles(robot, q, held) for q in (self.before, self.q))
        moved = np.abs(after - before).max(axis=0, initial=0.0) > _MOVED
        if moved.any():
            names = [name for name, moves in zip(held, moved, strict=True) if moves]
            self.notes.append(
                f"Joints have moved that the file does not give, and are not in it: {brief(names)}."
            )


def rounding_noise(step: float, rate: float) -> float:
    """The largest acceleration that rounding makes, by which every other number is half a step off.

    Args:
        step: from one number to the next that can be written [m, rad].
        rate: frames per second.
    """
    return 2.0 * step * rate**2


def aligned(quaternion: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of the signs by which they are close to old ones."""
    opposite = np.einsum("...i,...i->...", quaternion, old) < 0.0
    return np.where(opposite[..., None], -quaternion, quaternion)
