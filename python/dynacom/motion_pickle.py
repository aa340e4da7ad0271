# SPDX-License-Identifier: BSD-2-Clause
"""Motions from and into the pickles of retargeting tools, running nothing that a pickle may hold.

A pickle is a program: whoever wrote it decides what is called when it is loaded. Here it may call
what makes NumPy arrays, of numbers and texts, and nothing else; and even these calls go to
stand-ins of this module, so that no reader of NumPy's sees what the file says.
"""

import io
import pickle
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_change import Change
from dynacom.motion_checks import check_finite, from_xyzw, make_time, to_xyzw
from dynacom.motion_clip import Clip, Options, clip_from_joints
from dynacom.motion_derived import DERIVED, Joints, derived
from dynacom.motion_joints import brief, configurations, match_joints, order_without_names
from dynacom.motion_mark import MARK, is_mark, mark_text
from dynacom.robots import Robot

# What the tools call the same things.
_KEYS = {
    "position": ("root_pos", "root_trans_offset"),
    "quaternion": ("root_rot",),
    "joints": ("dof_pos", "dof"),
    "names": ("joint_names", "dof_names"),
}
# How files begin that joblib has compressed, and what with.
_COMPRESSED = {
    b"\x78": "zlib",
    b"\x1f\x8b": "gzip",
    b"BZ": "bz2",
    b"\xfd7zXZ": "xz",
    b"]\x00": "lzma",
    b"\x04\x22\x4d\x18": "lz4",
}


def read_pickle(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .pkl, .pickle and .joblib.

    Raises:
        DynacomError: as :func:`read_motion`; or the file holds other things than numbers, texts and
            arrays and is not trusted, or joblib, which such a file needs, is not installed.
        OSError: the file cannot be read.
    """
    return _read(path, _choose(path, _load(path, options.trust), options.clip), robot, options)


def write_pickle(change: Change) -> bytes:
    """The file with a change in one clip: keys, types, shapes and the pickle's protocol are kept.

    Raises:
        DynacomError: as :func:`write_motion`.
        OSError: the file cannot be read.
    """
    file = PickleFile(change.clip.path, change.clip.options)
    file.change(change)
    return file.dump()


class PickleFile:
    """Such a file, loaded once for all the clips that it holds."""

    def __init__(self, path: Path, options: Options) -> None:
        """Loads it.

        Raises:
            DynacomError, OSError: as :func:`read_pickle`.
        """
        self._path, self._options = path, options
        self._content = _load(path, options.trust)
        has_names = _holds_clips(self._content) and len(self._content) > 1
        #: Clip's name in results -> its key in the file.
        self._keys = {str(key): key for key in self._content} if has_names else {}

    def clips(self, robot: Robot) -> Iterator[tuple[str | None, Callable[[], Clip]]]:
        """All of them.

        Yields:
            The name of a clip, None where there is but one, and a function that makes the clip, or
            raises DynacomError.

        Raises:
            DynacomError: the file holds none.
        """
        if not self._keys:
            clip = _choose(self._path, self._content, self._options.clip)
            yield None, partial(_read, self._path, clip, robot, self._options)
            return
        for key, clip in list(self._content.items()):  # which may be dropped meanwhile
            chosen = replace(self._options, clip=str(key))
            yield str(key), partial(_read, self._path, clip, robot, chosen)

    def read(self, name: str | None, robot: Robot) -> Clip:
        """A clip, as it is now.

        Raises:
            DynacomError: as :func:`read_pickle`.
        """
        chosen = replace(self._options, clip=name)
        return _read(self._path, self._find(name), robot, chosen)

    def change(self, change: Change) -> None:
        """Changes one of the clips, here and not on the disk.

        Raises:
            DynacomError: as :func:`write_motion`.
        """
        clip, options = self._find(change.clip.options.clip), self._options
        if change.moves:
            layout = _find_layout(self._path, clip, change.clip.robot, options)
            _change_clip(change, clip, layout)
        clip.pop(MARK, None)
        if change.mark:
            clip[MARK] = mark_text()

    def drop(self, name: str) -> None:
        """Takes out one of several clips, here and not on the disk."""
        del self._content[self._keys.pop(name)]

    def dump(self) -> bytes:
        """The file's bytes, as it is now.

        Raises:
            DynacomError: it holds what cannot be written.
            OSError: the file cannot be read.
        """
        return _dump(self._path, self._content)

    def _find(self, name: str | None) -> dict[str, Any]:
        if name in self._keys:
            return self._content[self._keys[name]]
        return _choose(self._path, self._content, name)


def _read(path: Path, content: Mapping[str, Any], robot: Robot, options: Options) -> Clip:
    frames = len(_numbers(path, content, "position", 3))
    rate = _frame_rate(path, content)
    layout = _find_layout(path, content, robot, options)
    time, notes = make_time(path, frames, file_fps=rate, fps=options.fps)
    return clip_from_joints(
        path,
        robot,
        time,
        layout.position,
        layout.quaternion,
        layout.names,
        layout.joints[:, layout.columns],
        options,
        order=layout.order,
        option=True,
        notes=[*notes, *layout.notes],
        exact=is_mark(content.get(MARK)),
    )


@dataclass(frozen=True)
class _Layout:
    """What is where."""

    #: (T, 3).
    position: np.ndarray
    #: (T, 4), x y z w.
    quaternion: np.ndarray
    #: Of the quaternions in the file.
    order: str
    #: All of the file, (T, n).
    joints: np.ndarray
    #: Which of them are the robot's, and what they are called.
    columns: list[int]
    names: Sequence[str]
    notes: list[str]


def _find_layout(path: Path, content: Mapping[str, Any], robot: Robot, options: Options) -> _Layout:
    position = _numbers(path, content, "position", 3)
    quaternion = _numbers(path, content, "quaternion", 4)
    joints = _numbers(path, content, "joints", None)
    frames, count = len(position), joints.shape[1]
    for what, values in (("quaternion", quaternion), ("joints", joints)):
        if len(values) != frames:
            name = _find(content, what)
            raise DynacomError(f"{path}: {name} must have {frames} frames, got {len(values)}")
    if (key := _find(content, "names")) and content[key] is not None:
        try:
            names = np.asarray(content[key], dtype=str).ravel().tolist()
        except (TypeError, ValueError) as error:
            raise DynacomError(f"{path}: {key} must be names ({error})") from error
        if len(names) != count:
            raise DynacomError(f"{path}: {key} must name {count} joints, got {len(names)}")
        columns, notes = match_joints(path, robot, names)
        names = [names[index] for index in columns]
    else:
        columns = list(range(count))
        names, notes = order_without_names(path, robot, count)
    order = options.quat or "xyzw"
    return _Layout(position, to_xyzw(quaternion, order), order, joints, columns, names, notes)


def _change_clip(change: Change, clip: dict[str, Any], layout: _Layout) -> None:
    """Changes a clip in place; what follows from it and cannot be told is taken out of it."""
    robot, notes = change.clip.robot, change.notes
    quaternion = change.quaternion(layout.quaternion)
    joints = layout.joints.copy()
    joints[:, layout.columns] = change.angles(layout.names, layout.joints[:, layout.columns])
    after = {
        _find(clip, "position"): change.position(layout.position),
        _find(clip, "quaternion"): from_xyzw(quaternion, layout.order),
        _find(clip, "joints"): joints,
    }
    before, step = dict(clip), 0.0
    for key, values in after.items():
        clip[key] = _alike(values, clip[key])
        step = max(step, float(np.spacing(np.abs(np.asarray(clip[key])).max())))
    change.note_rounding(step)
    path = change.clip.path
    old_rate = _frame_rate(path, clip)
    if (rate := change.frame_rate(old_rate)) != old_rate:
        clip["fps"] = _rate_alike(rate, clip["fps"])
    position, rounded = _numbers(path, clip, "position", 3), _numbers(path, clip, "quaternion", 4)
    angles = _numbers(path, clip, "joints", None)[:, layout.columns]
    q = configurations(robot, position, to_xyzw(rounded, layout.order), layout.names, angles)
    velocity = change.derivatives(change.as_read(q)).v[change.rows]
    both = Joints(layout.names, layout.columns, layout.joints, joints)
    left_out = []
    for key in [key for key in before if key in DERIVED]:
        values = derived(key, change, before, both, velocity)
        if values is None:
            left_out.append(key)
            del clip[key]
        else:
            clip[key] = _alike(values, clip[key])
    if left_out:
        notes.append(f"Left out, as they were those of the motion before: {brief(left_out)}.")


def _alike(values: np.ndarray, old: Any) -> Any:
    """Numbers in the type and the shape of old ones."""
    values = values.reshape(np.shape(old))
    if isinstance(old, list | tuple):
        return values.tolist()
    is_whole = old.dtype.kind not in "iu" or (values == np.rint(values)).all()
    return values.astype(old.dtype) if is_whole else values


def _rate_alike(rate: float, old: Any) -> Any:
    """The same of a single number, which Python's own may be."""
    if np.ndim(old):
        return _alike(np.array(rate), old)
    return int(rate) if isinstance(old, int) and rate.is_integer() else rate


def _load(path: Path, trust: bool) -> Any:
    with path.open("rb") as file:
        beginning = file.read(8)
        file.seek(0)
        try:
            return _plain(_Unpickler(file, encoding="latin1").load(), {})
        except _Refused as error:
            refused = str(error)
        except Exception as error:  # pickle promises no type for what is no pickle, or a broken one
            if not beginning.startswith(tuple(_COMPRESSED)):
                raise DynacomError(f"{path}: must be a pickle ({error})") from error
            refused = "is compressed, as joblib's files are"
    if not trust:
        raise DynacomError(
            f"{path}: {refused}, and only numbers, texts and NumPy arrays are read, because a "
            "pickle can run any program: --trust (trust=True) loads it all the same, with joblib, "
            "if you trust whoever made it"
        )
    try:
        import joblib
    except ImportError as error:
        raise DynacomError(
            f"{path}: {refused}: that needs joblib, which is not installed: "
            "pip install dynacom[joblib]"
        ) from error
    try:
        return joblib.load(path)
    except Exception as error:
        raise DynacomError(f"{path}: joblib cannot load it ({error})") from error


def _dump(path: Path, content: Any) -> bytes:
    """As the file there is written: by joblib or not, compressed or not, in the same protocol."""
    old = path.read_bytes()
    codec = next((name for start, name in _COMPRESSED.items() if old.startswith(start)), None)
    try:
        if codec is None and b"joblib.numpy_pickle" not in old:
            # From the second on, protocols begin with their number.
            return pickle.dumps(content, old[1] if old[:1] == b"\x80" else 0)
        import joblib

        written = io.BytesIO()
        joblib.dump(content, written, compress=(codec, 3) if codec else 0)
        return written.getvalue()
    except Exception as error:  # pickle promises no type for what it does not know
        raise DynacomError(f"{path}: holds what cannot be written ({error})") from error


class _Refused(Exception):
    """The pickle asks for something else than arrays."""


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        # numpy.core until NumPy 1, numpy._core from 2 on.
        found = _ALLOWED.get((module.replace("numpy._core", "numpy.core"), name))
        if found is None:
            raise _Refused(
                "is a file of joblib"
                if module.startswith("joblib.")
                else f"the pickle asks for {module}.{name}"
            )
        # A new function each time: a pickle may also change what it is given.
        return lambda *arguments: found(*arguments)

    def persistent_load(self, pid: Any) -> Any:
        raise _Refused("the pickle asks for things outside it")


class _DType:
    """Stands for numpy.dtype: of numbers, texts and bytes of a fixed size."""

    def __init__(self, code: str, align: bool = False, copy: bool = False) -> None:
        if not (isinstance(code, str) and re.fullmatch(r"[biufcUS]\d{1,5}|\?", code)):
            raise _Refused(f"the pickle asks for an array of {code!r}")
        self.value = np.dtype(code)

    def __setstate__(self, state: tuple) -> None:
        # Version, order of bytes, and what only other types have.
        if state[1] == ">":
            self.value = self.value.newbyteorder(">")


class _Array:
    """Stands for numpy.ndarray while it is being filled."""

    def __setstate__(self, state: tuple) -> None:
        _, shape, dtype, by_columns, data = state
        self.value = _from_buffer(data, dtype, shape, "F" if by_columns else "C")


def _from_buffer(data: Any, dtype: _DType, shape: Any, order: str, axes: Any = None) -> np.ndarray:
    if isinstance(data, str):  # of Python 2
        data = data.encode("latin1")
    array = np.frombuffer(data, dtype.value)
    if order == "K" and axes is not None:
        return array.reshape(shape).transpose(axes)
    return array.reshape(shape, order=order)


def _scalar(dtype: _DType, data: Any) -> Any:
    return _from_buffer(data, dtype, (), "C")[()]


def _new_array(kind: Any, shape: Any, code: Any) -> _Array:
    return _Array()


def _to_bytes(text: str, encoding: str) -> bytes:
    # So are bytes written for Python 2.
    if encoding != "latin1":
        raise _Refused(f"the pickle asks for the encoding {encoding!r}")
    return text.encode("latin1")


def _no_bytes() -> bytes:
    return b""


_ALLOWED = {
    ("numpy", "dtype"): _DType,
    ("numpy", "ndarray"): _Array,
    ("numpy.core.multiarray", "_reconstruct"): _new_array,
    ("numpy.core.multiarray", "scalar"): _scalar,
    ("numpy.core.numeric", "_frombuffer"): _from_buffer,
    ("_codecs", "encode"): _to_bytes,
    ("__builtin__", "bytes"): _no_bytes,
}


def _plain(value: Any, known: dict[int, Any]) -> Any:
    """With arrays and types for their stand-ins.

    Args:
        known: what was made of dictionaries and lists so far, by where they are: what is in a
            pickle may be in it many times, and in itself.
    """
    if isinstance(value, _Array | _DType):
        return value.value
    if not isinstance(value, dict | list | tuple):
        return value
    if id(value) in known:
        return known[id(value)]
    if isinstance(value, tuple):
        plain = tuple(_plain(item, known) for item in value)
        return known.setdefault(id(value), plain)
    plain = known[id(value)] = type(value)()
    if isinstance(value, dict):
        plain.update((_plain(key, known), _plain(item, known)) for key, item in value.items())
    else:
        plain.extend(_plain(item, known) for item in value)
    return plain


def _choose(path: Path, content: Any, clip: str | None) -> Mapping[str, Any]:
    """The clip, of a file that is one or holds several by name."""
    if isinstance(content, dict) and _find(content, "joints"):
        if clip is not None:
            raise DynacomError(f"{path}: is one clip without a name, got clip '{clip}'")
        return content
    if not _holds_clips(content):
        got = (
            f"the keys {brief([str(key) for key in content]) or 'none'}"
            if isinstance(content, dict)
            else type(content).__name__
        )
        raise DynacomError(
            f"{path}: must hold fps, root_pos, root_rot and dof_pos, or clips of fps, "
            f"root_trans_offset, root_rot and dof by name, got {got}"
        )
    names = [str(name) for name in content]
    if clip is None and len(names) == 1:
        return next(iter(content.values()))
    if clip not in names:
        what = f"{len(names)} clips ({brief(names)})" if len(names) > 1 else f"the clip {names[0]}"
        choice = "choose one with --clip" if clip is None else f"got clip '{clip}'"
        raise DynacomError(f"{path}: holds {what}: {choice}")
    return next(inner for name, inner in content.items() if str(name) == clip)


def _holds_clips(content: Any) -> bool:
    """Whether it is clips by name."""
    return (
        isinstance(content, dict)
        and len(content) > 0
        and all(isinstance(inner, dict) and _find(inner, "joints") for inner in content.values())
    )


def _find(content: Mapping[str, Any], what: str) -> str | None:
    return next((key for key in _KEYS[what] if key in content), None)


def _numbers(path: Path, content: Mapping[str, Any], what: str, columns: int | None) -> np.ndarray:
    """An array with a row per frame and so many columns, or any number, checked."""
    key = _find(content, what)
    if key is None:
        raise DynacomError(
            f"{path}: missing {' or '.join(_KEYS[what])}, got {brief([str(k) for k in content])}"
        )
    try:
        values = np.asarray(content[key], dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise DynacomError(f"{path}: {key} must be an array of numbers ({error})") from error
    if values.ndim == 3 and values.shape[2] == 1:  # joints of one degree of freedom each
        values = values[:, :, 0]
    if values.ndim != 2 or (columns is not None and values.shape[1] != columns):
        raise DynacomError(
            f"{path}: {key} must have shape (T, {columns or 'joints'}), got {values.shape}"
        )
    check_finite(path, key, values)
    return values


def _frame_rate(path: Path, content: Mapping[str, Any]) -> float | None:
    if content.get("fps") is None:
        return None
    try:
        (fps,) = np.asarray(content["fps"], dtype=float).ravel()
    except (TypeError, ValueError, OverflowError) as error:
        raise DynacomError(f"{path}: fps must be a number ({error})") from error
    return float(fps)
