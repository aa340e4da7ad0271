# SPDX-License-Identifier: BSD-2-Clause
"""Motions from the pickles of retargeting tools, without running what else a pickle may hold.

A pickle is a program: whoever wrote it decides what is called when it is loaded. Here it may call
what makes NumPy arrays, of numbers and texts, and nothing else; and even these calls go to
stand-ins of this module, so that no reader of NumPy's sees what the file says.
"""

import pickle
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_checks import check_finite, make_time, to_xyzw
from dynacom.motion_clip import Clip, Options, clip_from_joints
from dynacom.motion_joints import brief, match_joints, order_without_names
from dynacom.robots import Robot

# What the tools call the same things.
_KEYS = {
    "position": ("root_pos", "root_trans_offset"),
    "quaternion": ("root_rot",),
    "joints": ("dof_pos", "dof"),
    "names": ("joint_names", "dof_names"),
}
# How files begin that joblib has compressed: zlib, gzip, bz2, xz, lzma, lz4.
_COMPRESSED = (b"\x78", b"\x1f\x8b", b"BZ", b"\xfd7zXZ", b"]\x00", b"\x04\x22\x4d\x18")


def read_pickle(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .pkl, .pickle and .joblib.

    Raises:
        DynacomError: as :func:`read_motion`; or the file holds other things than numbers, texts and
            arrays and is not trusted, or joblib, which such a file needs, is not installed.
        OSError: the file cannot be read.
    """
    return _read(path, _choose(path, _load(path, options.trust), options.clip), robot, options)


def read_clips(
    path: Path, robot: Robot, options: Options
) -> Iterator[tuple[str | None, Callable[[], Clip]]]:
    """Loads such a file once, for all the clips that it holds.

    Yields:
        The name of a clip, None where there is but one, and a function that makes the clip, or
        raises DynacomError.

    Raises:
        DynacomError, OSError: as :func:`read_pickle`.
    """
    content = _load(path, options.trust)
    if _holds_clips(content) and len(content) > 1:
        for name, inner in content.items():
            yield str(name), partial(_read, path, inner, robot, options)
    else:
        yield None, partial(_read, path, _choose(path, content, None), robot, options)


def _read(path: Path, content: Mapping[str, Any], robot: Robot, options: Options) -> Clip:
    position = _numbers(path, content, "position", 3)
    quaternion = _numbers(path, content, "quaternion", 4)
    joints = _numbers(path, content, "joints", None)
    frames = len(position)
    for what, values in (("quaternion", quaternion), ("joints", joints)):
        if len(values) != frames:
            name = _find(content, what)
            raise DynacomError(f"{path}: {name} must have {frames} frames, got {len(values)}")

    time, notes = make_time(path, frames, file_fps=_frame_rate(path, content), fps=options.fps)
    if (key := _find(content, "names")) and content[key] is not None:
        try:
            names = np.asarray(content[key], dtype=str).ravel().tolist()
        except (TypeError, ValueError) as error:
            raise DynacomError(f"{path}: {key} must be names ({error})") from error
        if len(names) != joints.shape[1]:
            raise DynacomError(
                f"{path}: {key} must name {joints.shape[1]} joints, got {len(names)}"
            )
        known, more = match_joints(path, robot, names)
        notes += more
        names, joints = [names[index] for index in known], joints[:, known]
    else:
        names, more = order_without_names(path, robot, joints.shape[1])
        notes += more
    order = options.quat or "xyzw"
    return clip_from_joints(
        path,
        robot,
        time,
        position,
        to_xyzw(quaternion, order),
        names,
        joints,
        order=order,
        option=True,
        believed=options.quat is not None,
        notes=notes,
    )


def _load(path: Path, trust: bool) -> Any:
    with path.open("rb") as file:
        beginning = file.read(8)
        file.seek(0)
        try:
            return _plain(_Unpickler(file, encoding="latin1").load())
        except _Refused as error:
            refused = str(error)
        except Exception as error:  # pickle promises no type for what is no pickle, or a broken one
            if not beginning.startswith(_COMPRESSED):
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


def _plain(value: Any) -> Any:
    """With arrays for their stand-ins; dictionaries and lists as deep as motions nest them."""
    if isinstance(value, _Array):
        return value.value
    if isinstance(value, dict):
        return {
            key: {k: _plain(v) for k, v in inner.items()}
            if isinstance(inner, dict)
            else _plain(inner)
            for key, inner in value.items()
        }
    if isinstance(value, list | tuple):
        return [item.value if isinstance(item, _Array) else item for item in value]
    return value


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
