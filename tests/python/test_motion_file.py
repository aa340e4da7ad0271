# SPDX-License-Identifier: BSD-2-Clause
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynacom
from dynacom import DynacomError, read_motion


def refuses(path, *parts):
    """Expects an error of one line that begins with the path and holds all parts."""
    with pytest.raises(DynacomError) as caught:
        read_motion(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_reads_every_array(motion_file, talos_motion):
    motion, schedule, extras = read_motion(motion_file())
    np.testing.assert_array_equal(motion.time, talos_motion["t"])
    for name in "qva":
        np.testing.assert_array_equal(getattr(motion, name), talos_motion[name])
    assert schedule.names == ["left_sole", "right_sole"]
    np.testing.assert_array_equal(schedule.active, talos_motion["contacts"])
    assert extras == {}


def test_accepts_str_paths_compressed_archives_and_other_numbers(tmp_path, talos_motion):
    path = tmp_path / "motion.npz"
    arrays = talos_motion | {
        "t": np.arange(len(talos_motion["t"])),
        "q": np.asfortranarray(talos_motion["q"]),
        "v": talos_motion["v"].astype(np.float32),
        "a": talos_motion["a"].astype(">f8"),
    }
    np.savez_compressed(path, **arrays)
    motion = read_motion(str(path)).motion
    np.testing.assert_array_equal(motion.time, arrays["t"])
    for name in "qva":
        np.testing.assert_array_equal(getattr(motion, name), arrays[name])


def test_hands_out_other_arrays_and_leaves_pickles_alone(motion_file):
    path = motion_file(wrenches=np.ones((3, 2)), meta=np.array({"a": 1}, dtype=object))
    extras = read_motion(path).extras
    assert extras.keys() == {"wrenches"}
    np.testing.assert_array_equal(extras["wrenches"], np.ones((3, 2)))


def test_contacts_may_be_absent(motion_file):
    assert read_motion(motion_file(contacts=None, contact_names=None)).schedule is None


@pytest.mark.parametrize("name", ["contacts", "contact_names"])
def test_contacts_and_their_names_come_together(motion_file, name):
    refuses(motion_file(**{name: None}), f"missing array '{name}'")


@pytest.mark.parametrize("name", ["t", "q", "v", "a"])
def test_missing_array(motion_file, name):
    others = [other for other in "tqva" if other != name]
    refuses(motion_file(**{name: None}), f"missing array '{name}', got {', '.join(others)}")


def test_missing_file(tmp_path):
    refuses(tmp_path / "none.npz", "cannot be read (No such file or directory)")


def test_folder(tmp_path):
    refuses(tmp_path, "cannot be read (Is a directory)")


@pytest.mark.parametrize("content", [b"", b"time,q\n0,1\n", b"\x80\x04K\x01."])
def test_other_files(tmp_path, content):
    path = tmp_path / "motion.npz"
    path.write_bytes(content)
    refuses(path, "must be a NumPy archive (.npz), got another file")


def test_single_array(tmp_path):
    path = tmp_path / "motion.npy"
    np.save(path, np.ones(3))
    refuses(path, "must be a NumPy archive (.npz), got a single array")


def test_empty_archive(tmp_path):
    path = tmp_path / "motion.npz"
    np.savez(path)
    refuses(path, "missing array 't', got none")


def test_pickled_array_is_not_loaded(motion_file):
    path = motion_file(q=np.array([[1, "x"]], dtype=object))
    refuses(path, "array 'q' cannot be read", "allow_pickle=False")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("t", np.array(["0", "1"]), "must be of real numbers, got <U1"),
        ("q", np.ones((2, 39), dtype=complex), "must be of real numbers, got complex128"),
        ("v", np.ones((2, 38), dtype=bool), "must be of real numbers, got bool"),
        ("contacts", np.ones((40, 2)), "must be of bool, got float64"),
        ("contact_names", np.array([1, 2]), "must be of str, got int64"),
        ("t", np.ones((40, 1)), "must have 1 dimension, got shape (40, 1)"),
        ("q", np.ones(39), "must have 2 dimensions, got shape (39,)"),
        ("a", np.array(1.0), "must have 2 dimensions, got shape ()"),
        ("contacts", np.ones(40, dtype=bool), "must have 2 dimensions, got shape (40,)"),
        ("contact_names", np.array("left_sole"), "must have 1 dimension, got shape ()"),
    ],
)
def test_wrong_type_or_shape(motion_file, name, value, expected):
    refuses(motion_file(**{name: value}), f"array '{name}' {expected}")


# What reading leaves to the analysis, where the robot is known.
@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("t", lambda t: t[::-1].copy(), r"time must increase, .* in frame 1"),
        ("t", lambda t: t[:0], r"time must have at least one frame, got 0"),
        (
            "t",
            lambda t: np.where(t > 0.5, np.nan, t),
            r"time must be finite, got -?nan in frame 26",
        ),
        ("q", lambda q: q[:, :-1], r"q must have 39 .*, got 38"),
        ("v", lambda v: v[:-1], r"v must have 40 frames, got 39"),
        ("a", lambda a: np.where(np.arange(40)[:, None] == 7, np.inf, a), r"a must be finite.* 7"),
        ("contacts", lambda c: c[:-1], r"active must have 40 frames, got 39"),
        ("contacts", lambda c: c[:, :1], r"active must have 2 contacts, got 1"),
        ("contact_names", lambda c: c[[0, 0]], r"'left_sole' twice"),
        ("contact_names", lambda c: np.array(["left_sole", "hand"]), r"hand"),
    ],
)
def test_analysis_checks_the_rest(motion_file, talos, talos_motion, name, change, expected):
    motion, schedule, _ = read_motion(motion_file(**{name: change(talos_motion[name])}))
    with pytest.raises(ValueError, match=expected):
        dynacom.analyzeMotion(talos.dynacom(), motion, schedule)


@settings(max_examples=300, deadline=None)
@given(cut=st.integers(min_value=0, max_value=2000), flip=st.binary(min_size=1, max_size=8))
def test_damaged_files_give_one_line(tmp_path_factory, cut, flip):
    path = tmp_path_factory.mktemp("damaged") / "motion.npz"
    np.savez_compressed(
        path,
        t=np.arange(3.0),
        q=np.ones((3, 7)),
        v=np.ones((3, 6)),
        a=np.ones((3, 6)),
        contacts=np.ones((3, 1), dtype=bool),
        contact_names=np.array(["foot"]),
    )
    content = path.read_bytes()
    cut %= len(content)
    path.write_bytes(content[:cut] + flip + content[cut + len(flip) :])
    try:
        read_motion(path)
    except DynacomError as error:
        assert re.match(r"[^\n]*motion\.npz: [^\n]+$", str(error))
