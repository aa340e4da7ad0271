# SPDX-License-Identifier: BSD-2-Clause
import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dynacom import read_motion
from helpers import CALM
from motion_files import ROOT, assert_notes, refuses, sway, write_columns, write_csv

FORCES = [f"contact.pad.{what}_{axis}" for what in ("force", "torque") for axis in "xyz"]


# Without a header.


def test_without_header(tmp_path, toy):
    motion = sway(toy)
    path = write_csv(tmp_path / "clip.csv", motion.table)
    clip = read_motion(path, toy, fps=50)
    assert clip.path == path
    np.testing.assert_array_equal(clip.time, np.arange(90) / 50)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    assert clip.v is clip.a is clip.schedule is None
    assert clip.forces == {}
    assert clip.joint_names == ("a_slide", "c_wheel", "m_hip", "z_knee", "b_toe")
    assert_notes(clip, "The joints have no names: they are taken in the order of the URDF.")


def test_paths_may_be_text(tmp_path, toy):
    path = write_csv(tmp_path / "clip.csv", sway(toy).table)
    assert read_motion(str(path), toy, fps=50).path == path


def test_w_first(tmp_path, toy):
    motion = sway(toy)
    table = motion.table[:, [0, 1, 2, 6, 3, 4, 5, *range(7, 12)]]
    path = write_csv(tmp_path / "clip.csv", table)
    clip = read_motion(path, toy, fps=60, quat="wxyz")
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    table[3, 3] = np.nan
    path = write_csv(tmp_path / "clip.csv", table)
    refuses(path, toy, "column 4 (root_qw) must be finite", fps=60, quat="wxyz")


def test_fewer_joints(tmp_path, toy):
    motion = sway(toy)
    path = write_csv(tmp_path / "clip.csv", motion.table[:, :-1])
    clip = read_motion(path, toy, fps=60)
    expected = motion.q.copy()
    expected[:, toy.model.joints[toy.model.getJointId("b_toe")].idx_q] = 0.25
    np.testing.assert_allclose(clip.q, expected, atol=1e-15)
    assert clip.joint_names == ("a_slide", "c_wheel", "m_hip", "z_knee")
    assert_notes(
        clip,
        "those of the version of toy with 4 joints",
        "not give 1 of 5 joints, which stay at their default: b_toe.",
    )


@pytest.mark.parametrize("columns", [1, 7, 10, 13])
def test_wrong_number_of_columns(tmp_path, toy, columns):
    path = write_csv(tmp_path / "clip.csv", np.ones((3, columns)))
    expected = "must have a header, or 7 columns of the root and 4 or 5 of the joints of toy, got "
    refuses(path, toy, expected + str(columns), fps=60)


# With a header.


def test_with_header(tmp_path, toy):
    """In any order, with spaces, and with the short names of the root."""
    motion = sway(toy)
    columns = {name.removeprefix("root_"): values for name, values in motion.columns.items()}
    columns = {f" {name} ": columns[name] for name in reversed(columns)}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    np.testing.assert_array_equal(clip.time, motion.time)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-15)
    assert clip.notes == ()


def test_time_by_its_long_name_or_by_frame_rate(tmp_path, toy):
    columns = sway(toy).columns
    time = columns.pop("t")
    path = write_columns(tmp_path / "clip.csv", columns | {"time": time + 3.0})
    np.testing.assert_array_equal(read_motion(path, toy).time, time + 3.0)
    path = write_columns(tmp_path / "clip.csv", columns)
    np.testing.assert_array_equal(read_motion(path, toy, fps=60).time, time)
    refuses(path, toy, "give --fps")


def test_some_joints(tmp_path, toy):
    motion = sway(toy)
    columns = {name: motion.columns[name] for name in ["t", *ROOT, "m_hip", "c_wheel"]}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    model = toy.model
    for name in ("m_hip", "b_toe", "z_knee"):
        index = model.joints[model.getJointId(name)].idx_q
        expected = columns["m_hip"] if name == "m_hip" else toy.default[index]
        np.testing.assert_allclose(clip.q[:, index], expected, atol=1e-15)
    assert clip.joint_names == ("c_wheel", "m_hip")
    assert_notes(clip, "not give 3 of 5 joints, which stay at their default: a_slide, z_knee, b")


def test_other_columns(tmp_path, toy):
    columns = {"frame": np.arange(90)} | sway(toy).columns | {"battery": np.ones(90)}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert_notes(clip, "Left out, as toy has no such joints: battery.")
    del columns["b_toe"]
    path = write_columns(tmp_path / "clip.csv", columns)
    refuses(path, toy, "the joints of toy, got battery, and nothing for b_toe")


@pytest.mark.parametrize("name", ROOT)
def test_missing_root(tmp_path, toy, name):
    columns = sway(toy).columns
    del columns[name]
    path = write_columns(tmp_path / "clip.csv", columns)
    refuses(path, toy, f"missing column '{name}' (or '{name[5:]}')")


def test_twice_the_same_column(tmp_path, toy):
    motion = sway(toy)
    header = ",".join(["t", *ROOT, *motion.names[:-1], "z_knee"])
    path = write_csv(tmp_path / "clip.csv", np.column_stack([motion.time, motion.table]), header)
    refuses(path, toy, "column 'z_knee' is there 2 times")


def test_not_finite_by_name(tmp_path, toy):
    columns = sway(toy).columns
    columns["m_hip"][4] = np.nan
    path = write_columns(tmp_path / "clip.csv", columns)
    refuses(path, toy, "column 'm_hip' must be finite, got nan in frame 4")


# Contacts.


def test_contacts_and_forces(tmp_path, toy):
    rng = np.random.default_rng(0)
    active = rng.integers(0, 2, (90, 2))
    wrench = rng.standard_normal((90, 9))
    columns = sway(toy).columns | {"contact.pad.active": active[:, 0]}
    columns |= dict(zip(FORCES, wrench[:, :6].T, strict=True))
    columns |= {"contact.foot.active": active[:, 1]}
    columns |= {f"contact.foot.force_{axis}": wrench[:, 6 + i] for i, axis in enumerate("xyz")}
    # A point has no moment; our own tables have zeros here.
    columns |= {"contact.foot.torque_x": np.zeros(90)}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert clip.schedule.names == ["pad", "foot"]
    np.testing.assert_array_equal(clip.schedule.active, active == 1)
    assert clip.forces.keys() == {"pad", "foot"}
    np.testing.assert_array_equal(clip.forces["pad"], wrench[:, :6])
    np.testing.assert_array_equal(clip.forces["foot"], wrench[:, 6:])
    assert clip.notes == ()


def test_forces_without_moments_or_schedule(tmp_path, toy):
    columns = sway(toy).columns | {name: np.arange(90) for name in FORCES[:3]}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert clip.schedule is None
    np.testing.assert_array_equal(clip.forces["pad"], np.arange(90)[:, None] * [1, 1, 1])


@pytest.mark.parametrize("words", ["True False", "true false", "1 0", "1.0 0.0", " TRUE False "])
def test_words_for_active(tmp_path, toy, words):
    yes, no = words.replace(" ", ",").strip(",").split(",")
    motion = sway(toy, 3)
    header = ",".join(motion.columns) + ",contact.pad.active"
    rows = [
        ",".join(map(repr, map(float, row))) for row in zip(*motion.columns.values(), strict=True)
    ]
    lines = [f"{row},{word}" for row, word in zip(rows, (yes, no, f" {yes} "), strict=True)]
    path = tmp_path / "clip.csv"
    path.write_text("\n".join([header, *lines]))
    clip = read_motion(path, toy)
    np.testing.assert_array_equal(clip.schedule.active[:, 0], [True, False, True])


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({"contact.hand.active": 1}, "contacts must be those of toy (foot, pad), got 'hand'"),
        ({"contact.hand.force_x": 1}, "contacts must be those of toy (foot, pad), got 'hand'"),
        (
            {"contact.pad.active": np.where(np.arange(90) == 5, 0.5, 1)},
            "column 'contact.pad.active' must be 0 or 1, got 0.5 in frame 5",
        ),
        ({"contact.pad.force_x": 1}, "missing column 'contact.pad.force_y'"),
        ({"contact.pad.torque_y": 1}, "missing column 'contact.pad.force_x'"),
        (
            {name: 1 for name in FORCES[:5]},
            "missing column 'contact.pad.torque_z'",
        ),
        (
            {name: np.nan for name in FORCES},
            "column 'contact.pad.force_x' must be finite, got nan in frame 0",
        ),
        ({"contact.pad.speed": 1}, None),
    ],
)
def test_wrong_contacts(tmp_path, toy, more, expected):
    columns = sway(toy).columns | {name: np.ones(90) * value for name, value in more.items()}
    path = write_columns(tmp_path / "clip.csv", columns)
    if expected is None:
        assert_notes(read_motion(path, toy), "Left out, as toy has no such joints: contact.pad.spe")
    else:
        refuses(path, toy, expected)


# As text.


@pytest.fixture
def text(toy):
    """A clip with a header, as lines."""
    columns = sway(toy, 5).columns
    rows = [",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)]
    return [",".join(columns), *rows]


@pytest.mark.parametrize(
    "write",
    [
        lambda lines: "\n".join(lines),
        lambda lines: "\r\n".join(lines) + "\r\n",
        lambda lines: "\n\n".join(lines) + "\n\n\n",
        lambda lines: "\ufeff" + "\n".join(lines),
        lambda lines: "# " + "\n".join(lines),
        lambda lines: "\n".join(line.replace(",", ", ") for line in lines),
        lambda lines: "\n".join(['"' + lines[0].replace(",", '","') + '"', *lines[1:]]),
    ],
)
def test_ways_to_write_text(tmp_path, toy, text, write):
    path = tmp_path / "clip.csv"
    path.write_text(write(text), encoding="utf-8", newline="")
    np.testing.assert_allclose(read_motion(path, toy).q, sway(toy, 5).q, atol=1e-15)


@pytest.mark.parametrize("suffix", [".csv.gz", ".CSV.GZ"])
def test_compressed(tmp_path, toy, text, suffix):
    path = tmp_path / f"some.clip{suffix}"
    path.write_bytes(gzip.compress("\n".join(text).encode()))
    np.testing.assert_allclose(read_motion(path, toy).q, sway(toy, 5).q, atol=1e-15)
    path.write_bytes(path.read_bytes()[:-20])
    refuses(path, toy, "must be a gzip file")
    path.write_bytes("\n".join(text).encode())
    refuses(path, toy, "must be a gzip file")


@pytest.mark.parametrize("content", ["", "\n\n", "  \n"])
def test_empty(tmp_path, toy, content):
    path = tmp_path / "clip.csv"
    path.write_text(content)
    refuses(path, toy, "must hold a motion, got an empty file")


def test_header_only(tmp_path, toy, text):
    path = tmp_path / "clip.csv"
    path.write_text(text[0])
    refuses(path, toy, "must have at least one frame, got none")


@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            lambda row: row + ",1",
            "line {line} must have {columns} columns, as the first, got {more}",
        ),
        (
            lambda row: row.rpartition(",")[0],
            "line {line} must have {columns} columns, as the first, got {less}",
        ),
        (
            lambda row: ",".join(["0.1", "abc", *row.split(",")[2:]]),
            "line {line}, column 2{name} must be a number, got 'abc'",
        ),
        (
            lambda row: ",".join(["0.1", "", *row.split(",")[2:]]),
            "line {line}, column 2{name} must be a number, got ''",
        ),
        (
            lambda row: ",".join(["0.1", "True", *row.split(",")[2:]]),
            "line {line}, column 2{name} must be a number, got 'True'",
        ),
    ],
)
def test_broken_rows(tmp_path, toy, text, header, change, expected):
    lines = text if header else [row.partition(",")[2] for row in text[1:]]
    lines.insert(1, "")  # blank lines count
    lines[4] = change(lines[4])
    path = tmp_path / "clip.csv"
    path.write_text("\n".join(lines))
    columns = 13 if header else 12
    name = " (root_x)" if header else ""
    parts = {"line": 5, "columns": columns, "more": columns + 1, "less": columns - 1, "name": name}
    refuses(path, toy, expected.format(**parts), fps=60)


def test_all_rows_are_longer_than_the_header(tmp_path, toy, text):
    path = tmp_path / "clip.csv"
    path.write_text("\n".join([text[0], *(row + ",1" for row in text[1:])]))
    refuses(path, toy, "line 2 must have 13 columns, as the first, got 14")


@pytest.mark.parametrize(
    "content", [b"\x93NUMPY\x01\x00", b"\xff\xfe1\x00,\x002\x00", b"a\x00b,1\n1,1"]
)
def test_other_files(tmp_path, toy, content):
    path = tmp_path / "clip.csv"
    path.write_bytes(content)
    refuses(path, toy)


@CALM
@given(
    data=st.data(),
    fps=st.floats(1.0, 1000.0),
    digits=st.sampled_from(["%.17g", "%.7g"]),
)
def test_round_trip(tmp_path_factory, toy, data, fps, digits):
    """Any motion that is slow enough: with a header, and without one."""
    frames = data.draw(st.integers(1, 5))
    slow = 0.2 * data.draw(arrays(float, (frames, 5), elements=st.floats(-1, 1, width=32)))
    motion = sway(toy, 1)
    table = np.hstack([np.repeat(motion.table[:, :7], frames, axis=0), slow / max(1.0, fps / 20.0)])
    folder = tmp_path_factory.mktemp("round")
    path = folder / "clip.csv"
    np.savetxt(path, table, digits, ",")
    clip = read_motion(path, toy, fps=fps)
    model = toy.model
    for column, name in enumerate(motion.names):
        joint = model.joints[model.getJointId(name)]
        values = clip.q[:, joint.idx_q]
        expected = np.cos(table[:, 7 + column]) if joint.nq == 2 else table[:, 7 + column]
        np.testing.assert_allclose(values, expected, atol=1e-15 if digits == "%.17g" else 1e-6)
    np.testing.assert_array_equal(clip.time, np.arange(frames) / fps)
    time = np.arange(frames) / fps
    np.savetxt(
        path,
        np.column_stack([time, table]),
        digits if digits == "%.17g" else "%.9g",
        ",",
        header=",".join(["t", *ROOT, *motion.names]),
        comments="",
    )
    again = read_motion(path, toy)
    np.testing.assert_allclose(again.q, clip.q, atol=1e-6)
