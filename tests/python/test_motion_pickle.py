# SPDX-License-Identifier: BSD-2-Clause
import gzip
import pickle
import re
import sys
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from dynacom import DynacomError, read_motion
from dynacom.motion_pickle import _load
from helpers import CALM, SHARED_DATA, THOROUGH
from motion_files import assert_notes, refuses, sway


def retargeted(robot, **changes):
    """As GMR writes it."""
    motion = sway(robot)
    content = {
        "fps": 60,
        "root_pos": motion.position,
        "root_rot": motion.quaternion,
        "dof_pos": motion.angles,
        "local_body_pos": None,
        "link_body_list": ["body", "upper"],
    } | changes
    return {key: value for key, value in content.items() if value is not ...}


def by_name(robot, *names):
    """As ASAP writes it."""
    motion = sway(robot)
    clip = {
        "root_trans_offset": motion.position.astype(np.float32),
        "pose_aa": np.zeros((90, 6, 3), dtype=np.float32),
        "dof": motion.angles.astype(np.float32),
        "root_rot": motion.quaternion,
        "fps": 60,
    }
    return {name: dict(clip) for name in names}


@pytest.fixture
def write(tmp_path):
    def write(content, protocol=4, name="clip.pkl"):
        path = tmp_path / name
        path.write_bytes(pickle.dumps(content, protocol))
        return path

    return write


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_retargeted(write, toy, protocol):
    motion = sway(toy)
    clip = read_motion(write(retargeted(toy), protocol), toy)
    np.testing.assert_array_equal(clip.time, motion.time)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    assert clip.v is clip.a is clip.schedule is None
    assert_notes(clip, "in the order of the URDF")


@pytest.mark.parametrize("name", ["clip.pickle", "clip.joblib", "CLIP.PKL"])
def test_suffixes(write, toy, name):
    clip = read_motion(write(retargeted(toy), name=name), toy)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-15)


def test_by_name(write, toy):
    clip = read_motion(write(by_name(toy, "squat")), toy)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-6)
    clip = read_motion(write(by_name(toy, "squat")), toy, clip="squat")
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-6)


def test_several(write, toy):
    content = by_name(toy, "walk", "squat")
    content["squat"]["root_trans_offset"] = content["walk"]["root_trans_offset"] + 1.0
    path = write(content)
    refuses(path, toy, "holds 2 clips (walk, squat): choose one with --clip")
    refuses(path, toy, "holds 2 clips (walk, squat): got clip 'run'", clip="run")
    walk, squat = (read_motion(path, toy, clip=name) for name in content)
    np.testing.assert_allclose(squat.q[:, :3] - walk.q[:, :3], 1.0, atol=1e-6)
    refuses(write(by_name(toy, "walk")), toy, "the clip walk: got clip 'run'", clip="run")
    refuses(write(retargeted(toy)), toy, "is one clip without a name, got clip 'a'", clip="a")


def test_frame_rates(write, toy):
    path = write(retargeted(toy, fps=np.float32(50.0)))
    np.testing.assert_array_equal(read_motion(path, toy).time, np.arange(90) / 50)
    clip = read_motion(path, toy, fps=25)
    np.testing.assert_array_equal(clip.time, np.arange(90) / 25)
    assert_notes(clip, "The file says 50 frames per second; --fps 25 counts.", "order of the URDF")
    np.testing.assert_array_equal(
        read_motion(write(retargeted(toy, fps=np.array([50]))), toy).time, np.arange(90) / 50
    )
    for missing in (..., None):
        path = write(retargeted(toy, fps=missing))
        refuses(path, toy, "give --fps")
        assert_notes(read_motion(path, toy, fps=25), "order of the URDF")


def test_w_first(write, toy):
    path = write(retargeted(toy, root_rot=np.roll(sway(toy).quaternion, 1, axis=1)))
    np.testing.assert_allclose(read_motion(path, toy, quat="wxyz").q, sway(toy).q, atol=1e-15)
    refuses(path, toy, "must be x y z w, got w x y z", "give --quat wxyz")


def test_joints(write, toy):
    motion = sway(toy)
    # One degree of freedom each.
    clip = read_motion(write(retargeted(toy, dof_pos=motion.angles[:, :, None])), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    clip = read_motion(write(retargeted(toy, dof_pos=motion.angles[:, :4])), toy)
    assert_notes(clip, "version of toy with 4 joints", "not give 1 of 5 joints")
    refuses(write(retargeted(toy, dof_pos=motion.angles[:, :3])), toy, "must have 4 or 5 joints")


@pytest.mark.parametrize("kind", [list, np.array])
@pytest.mark.parametrize("key", ["joint_names", "dof_names"])
def test_joints_by_name(write, toy, key, kind):
    motion = sway(toy)
    changes = {"dof_pos": motion.angles[:, ::-1], key: kind(motion.names[::-1])}
    clip = read_motion(write(retargeted(toy, **changes)), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    assert clip.notes == ()
    changes[key] = kind(motion.names[:-1])
    refuses(write(retargeted(toy, **changes)), toy, f"{key} must name 5 joints, got 4")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"root_pos": ...}, "missing root_pos or root_trans_offset, got fps, root_rot, dof_pos"),
        ({"root_rot": ...}, "missing root_rot, got fps, root_pos"),
        ({"root_pos": np.ones((90, 2))}, "root_pos must have shape (T, 3), got (90, 2)"),
        ({"root_rot": np.ones((90, 3))}, "root_rot must have shape (T, 4), got (90, 3)"),
        ({"root_rot": np.ones((80, 4))}, "root_rot must have 90 frames, got 80"),
        ({"dof_pos": np.ones(90)}, "dof_pos must have shape (T, joints), got (90,)"),
        ({"dof_pos": np.ones((80, 5))}, "dof_pos must have 90 frames, got 80"),
        ({"dof_pos": None}, "dof_pos must "),
        ({"dof_pos": np.full((90, 5), np.nan)}, "dof_pos must be finite, got nan in frame 0 of"),
        ({"root_pos": "here"}, "root_pos must be an array of numbers"),
        ({"root_pos": {"x": 1}}, "root_pos must be an array of numbers"),
        ({"root_pos": np.full((90, 3), "a")}, "root_pos must be an array of numbers"),
        ({"dof_names": [["a"], ["b", "c"]]}, "dof_names must be names"),
        ({"dof_names": 3}, "dof_names must name 5 joints, got 1"),
        ({"root_pos": [[10**400, 0, 0]]}, "root_pos must be an array of numbers"),
        ({"fps": 10**400}, "fps must be a number"),
        ({"fps": "fast"}, "fps must be a number"),
        ({"fps": [30, 60]}, "fps must be a number"),
        ({"fps": -1}, "fps must be finite and > 0 Hz, got -1"),
    ],
)
def test_wrong_contents(write, toy, changes, expected):
    refuses(write(retargeted(toy, **changes)), toy, expected)


@pytest.mark.parametrize(
    ("content", "got"),
    [
        ([1, 2], "got list"),
        (np.ones(3), "got ndarray"),
        ({}, "got the keys none"),
        ({"a": 1, 2: 3}, "got the keys a, 2"),
        ({"a": {"fps": 3}}, "got the keys a"),
    ],
)
def test_other_contents(write, toy, content, got):
    refuses(write(content), toy, "must hold fps, root_pos, root_rot and dof_pos", got)


def test_no_frames(write, toy):
    empty = {"root_pos": np.ones((0, 3)), "root_rot": np.ones((0, 4)), "dof_pos": np.ones((0, 5))}
    refuses(write(retargeted(toy, **empty)), toy, "must have at least one frame, got none")


# Arrays of all kinds, of NumPy 1 and 2.

DTYPES = ["<f8", ">f8", "<f4", "<f2", "<i8", ">i4", "u1", "?", "<c16", "<U3", ">U3", "S4"]


@THOROUGH
@given(
    data=st.data(),
    dtype=st.sampled_from(DTYPES),
    protocol=st.integers(0, pickle.HIGHEST_PROTOCOL),
    layout=st.sampled_from(["C", "F", "moved", "strided"]),
    core=st.booleans(),
)
def test_arrays(tmp_path_factory, data, dtype, protocol, layout, core):
    """They are what pickle makes of them."""
    array = data.draw(arrays(dtype, array_shapes(min_dims=0, max_dims=3, min_side=0)))
    if layout == "F":
        array = np.asfortranarray(array)
    elif layout == "moved" and array.ndim == 3:
        array = array.transpose(1, 0, 2)
    elif layout == "strided" and array.ndim:
        array = array[::2]
    content = {"array": array, "list": [array, 1], "inner": {"array": array}, "text": "ä"}
    if scalar := bool(array.size) and array.flat[0].itemsize > 0:
        content["scalar"] = array.flat[0]
    dumped = pickle.dumps(content, protocol)
    if core:
        dumped = of_numpy_1(dumped)
    path = tmp_path_factory.mktemp("pickle") / "file.pkl"
    path.write_bytes(dumped)
    loaded = _load(path, trust=False)
    assert loaded.keys() == content.keys()
    for got in (loaded["array"], loaded["list"][0], loaded["inner"]["array"]):
        assert got.dtype == array.dtype
        np.testing.assert_array_equal(got, array)
    assert loaded["text"] == "ä"
    if scalar:
        np.testing.assert_array_equal(loaded["scalar"], content["scalar"])


def of_numpy_1(dumped):
    """The same pickle as NumPy 1 would write it, whose module has a name of one letter less."""
    dumped = dumped.replace(b"cnumpy._core.", b"cnumpy.core.")
    for name in (b"multiarray", b"numeric"):
        old, new = b"numpy._core." + name, b"numpy.core." + name
        dumped = dumped.replace(
            b"\x8c" + bytes([len(old)]) + old, b"\x8c" + bytes([len(new)]) + new
        )
    # The lengths of frames are then wrong; without frames there are none.
    return (
        re.sub(rb"\x95.{8}", b"", dumped, count=1, flags=re.DOTALL)
        if b"\x95" in dumped[:4]
        else dumped
    )


def test_the_test_writes_pickles_of_numpy_1():
    dumped = pickle.dumps(np.ones(3), 4)
    assert b"numpy._core" in dumped or b"numpy.core" in dumped
    assert b"numpy._core" not in of_numpy_1(dumped)


# Pickles that would do something.


class Evil:
    """Makes a file when it is unpickled."""

    def __init__(self, path, function=open):
        self.path, self.function = path, function

    def __reduce__(self):
        return self.function, (str(self.path), "w")


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize("place", ["all", "key", "extra", "array", "deep"])
def test_pickles_do_nothing(write, toy, tmp_path, protocol, place):
    trace = tmp_path / "trace"
    evil = Evil(trace)
    content = {
        "all": evil,
        "key": retargeted(toy, fps=evil),
        "extra": retargeted(toy) | {"note": evil},
        "array": retargeted(toy, dof_pos=np.array([[evil]], dtype=object)),
        "deep": {"clip": retargeted(toy) | {"meta": {"notes": [evil]}}},
    }[place]
    path = write(content, protocol)
    message = refuses(path, toy, "only numbers, texts and NumPy arrays are read", "--trust")
    assert ("'O8'" if place == "array" else ".open") in message
    assert not trace.exists()
    # It would, if it were let.
    pickle.loads(path.read_bytes())
    assert trace.exists()


GLOBALS = [
    "os system",
    "posix system",
    "builtins eval",
    "builtins exec",
    "builtins getattr",
    "__builtin__ eval",
    "functools partial",
    "copyreg _reconstructor",
    "numpy load",
    "numpy.core.multiarray fromfile",
    "numpy._core.multiarray fromfile",
    "numpy.lib.npyio load",
    "numpy.testing._private.utils runstring",
    "numpy.core numeric.load",
    "numpy ndarray.tofile",
    "dynacom.motion_pickle _load",
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
]


@pytest.mark.parametrize("line", GLOBALS)
def test_globals_that_are_refused(tmp_path, toy, line):
    module, name = line.split()
    path = tmp_path / "clip.pkl"
    for dumped in (
        b"c" + module.encode() + b"\n" + name.encode() + b"\n.",
        b"\x80\x04\x8c" + bytes([len(module)]) + module.encode()
        + b"\x8c" + bytes([len(name)]) + name.encode() + b"\x93.",
    ):  # fmt: skip
        path.write_bytes(dumped)
        refuses(path, toy, f"the pickle asks for {module}.{name}", "--trust (trust=True)")


def test_other_ways_out(tmp_path, toy):
    path = tmp_path / "clip.pkl"
    path.write_bytes(b"Pother\n.")
    refuses(path, toy, "things outside it")
    path.write_bytes(b"\x80\x02c_codecs\nencode\nX\x01\x00\x00\x00aX\x06\x00\x00\x00base64\x86R.")
    refuses(path, toy, "the encoding 'base64'")
    dumped = pickle.dumps(np.array([None]), 2)
    path.write_bytes(dumped)
    refuses(path, toy, "an array of 'O8'")


def test_a_pickle_changes_nothing_here(tmp_path, toy, write):
    """A pickle may set attributes of what it is given: those of functions that all would share."""
    path = tmp_path / "evil.pkl"
    # _from_buffer.__defaults__ = (1, 2)
    path.write_bytes(
        b"\x80\x02cnumpy.core.numeric\n_frombuffer\n"
        b"N}X\x0c\x00\x00\x00__defaults__K\x01K\x02\x86s\x86b."
    )
    refuses(path, toy, "must hold fps")
    clip = read_motion(write(retargeted(toy), 5), toy)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-15)
    from dynacom import motion_pickle

    assert motion_pickle._from_buffer.__defaults__ == (None,)


@pytest.mark.parametrize(
    "content", [b"", b"\x80", b"\x80\x04K\x01", b"fps,1\n", b"\x93NUMPY", b"\x80\x04]" * 1000, b"."]
)
def test_other_files(tmp_path, toy, content):
    path = tmp_path / "clip.pkl"
    path.write_bytes(content)
    refuses(path, toy, "must be a pickle")


@CALM
@given(
    place=st.integers(0, 10**6), flip=st.binary(min_size=1, max_size=8), protocol=st.integers(0, 5)
)
def test_damaged_files_give_one_line(tmp_path_factory, toy, place, flip, protocol):
    path = tmp_path_factory.mktemp("damaged") / "clip.pkl"
    content = pickle.dumps(retargeted(toy), protocol)
    place %= 600
    path.write_bytes(content[:place] + flip + content[place + len(flip) :])
    try:
        read_motion(path, toy)
    except DynacomError as error:
        assert re.match(r"[^\n]*clip\.pkl: [^\n]+$", str(error))


# joblib.


@pytest.mark.parametrize(
    "options", [{}, {"compress": 3}, {"compress": ("gzip", 3)}, {"compress": ("xz", 3)}]
)
def test_joblib(tmp_path, toy, options):
    joblib = pytest.importorskip("joblib")
    path = tmp_path / "clip.pkl"
    joblib.dump(by_name(toy, "squat"), path, **options)
    what = "is compressed, as joblib's files are" if options else "is a file of joblib"
    refuses(path, toy, what, "a pickle can run any program: --trust (trust=True)")
    clip = read_motion(path, toy, trust=True)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-6)
    assert_notes(clip, "order of the URDF")


def test_without_joblib(tmp_path, toy, write, monkeypatch):
    joblib = pytest.importorskip("joblib")
    path = tmp_path / "joblib.pkl"
    joblib.dump(by_name(toy, "squat"), path)
    monkeypatch.setitem(sys.modules, "joblib", None)
    refuses(path, toy, "needs joblib", "pip install dynacom[joblib]", trust=True)
    # Who trusts a file that needs no trust needs no joblib either.
    clip = read_motion(write(retargeted(toy)), toy, trust=True)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-15)


def test_trusted_files_that_cannot_be_read(tmp_path, toy):
    pytest.importorskip("joblib")
    path = tmp_path / "clip.pkl"
    path.write_bytes(b"cno_such_module\nf\n.")
    refuses(path, toy, "joblib cannot load it (No module named 'no_such_module')", trust=True)
    for compress in (zlib.compress, gzip.compress):
        path.write_bytes(compress(b"nothing"))
        refuses(path, toy, "--trust")
        refuses(path, toy, "joblib cannot load it", trust=True)


def test_of_asap(humanoid):
    pytest.importorskip("joblib")
    path = SHARED_DATA / "squat_level1.pkl"
    if not path.is_file():
        pytest.skip("the folder ../shared/data is not there")
    refuses(path, humanoid, "is a file of joblib", "--trust")
    clip = read_motion(path, humanoid, trust=True)
    assert clip.q.shape == (158, 36)
    assert clip.time[1] == 1 / 30
    assert len(clip.joint_names) == 23
    assert_notes(clip, "the version of humanoid with 23 joints", "not give 6 of 29 joints")
    # It squats: the knees bend as the pelvis comes down.
    knee = clip.q[:, humanoid.model.joints[humanoid.model.getJointId("left_knee_joint")].idx_q]
    assert np.corrcoef(knee, clip.q[:, 2])[0, 1] < -0.9
    # Its wrists are at their default.
    assert (
        clip.q[:, humanoid.model.joints[humanoid.model.getJointId("left_wrist_yaw_joint")].idx_q]
        == 0
    ).all()
