# SPDX-License-Identifier: BSD-2-Clause
import sys

import numpy as np
import pytest

from dynacom import read_motion
from motion_files import assert_notes, refuses, sway

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def write(path, columns):
    parquet.write_table(pyarrow.table(columns), path)
    return path


def test_round_trip(tmp_path, toy):
    motion = sway(toy)
    clip = read_motion(write(tmp_path / "clip.parquet", motion.columns), toy)
    np.testing.assert_array_equal(clip.time, motion.time)
    np.testing.assert_array_equal(clip.q, motion.q)
    assert clip.v is clip.a is clip.schedule is None
    assert clip.notes == ()


def test_types_of_columns(tmp_path, toy):
    columns = sway(toy).columns
    columns |= {name: columns[name].astype(np.float32) for name in ("m_hip", "root_x")}
    columns |= {"z_knee": np.zeros(90, dtype=np.int8), "b_toe": np.zeros(90, dtype=np.float16)}
    columns |= {"contact.pad.active": np.arange(90) % 2 == 0}
    columns |= {"contact.foot.active": np.arange(90) % 2}
    clip = read_motion(write(tmp_path / "clip.parquet", columns), toy)
    np.testing.assert_allclose(clip.q[:, 0], columns["root_x"], atol=1e-15)
    assert clip.schedule.names == ["pad", "foot"]
    np.testing.assert_array_equal(clip.schedule.active[:, 0], np.arange(90) % 2 == 0)
    np.testing.assert_array_equal(clip.schedule.active[:, 1], np.arange(90) % 2 == 1)
    assert clip.schedule.confidence is None
    columns |= {"contact.foot.active": np.linspace(0.0, 1.0, 90)}
    clip = read_motion(write(tmp_path / "clip.parquet", columns), toy)
    np.testing.assert_array_equal(clip.schedule.active[:, 1], np.arange(90) >= 45)
    np.testing.assert_array_equal(clip.schedule.confidence[:, 1], np.linspace(0.0, 1.0, 90))


def test_of_pandas(tmp_path, toy):
    """With its index, several row groups, and a frame rate instead of times."""
    pandas = pytest.importorskip("pandas")
    columns = sway(toy).columns
    del columns["t"]
    table = pandas.DataFrame(columns).iloc[::2]
    path = tmp_path / "clip.parquet"
    table.to_parquet(path, row_group_size=10)
    clip = read_motion(path, toy, fps=30)
    np.testing.assert_array_equal(clip.q, sway(toy).q[::2])
    assert_notes(clip)
    refuses(path, toy, "give --fps")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (["a"] * 90, "column 'm_hip' must be numbers, got string"),
        ([[1.0]] * 90, "column 'm_hip' must be numbers, got list"),
        ([1.0] * 4 + [None] * 86, "column 'm_hip' must be numbers, got null in frame 4"),
        ([True] * 4 + [None] * 86, "column 'm_hip' must be numbers, got null in frame 4"),
        ([1.0] * 4 + [float("nan")] * 86, "column 'm_hip' must be finite, got nan in frame 4"),
    ],
)
def test_wrong_columns(tmp_path, toy, values, expected):
    path = write(tmp_path / "clip.parquet", sway(toy).columns | {"m_hip": values})
    refuses(path, toy, expected)


def test_twice_the_same_column(tmp_path, toy):
    columns = sway(toy).columns
    table = pyarrow.table([*columns.values(), np.zeros(90)], names=[*columns, "m_hip"])
    path = tmp_path / "clip.parquet"
    parquet.write_table(table, path)
    refuses(path, toy, "column 'm_hip' is there more than once")


def test_no_frames(tmp_path, toy):
    path = write(tmp_path / "clip.parquet", {k: v[:0] for k, v in sway(toy).columns.items()})
    refuses(path, toy, "must have at least one frame, got none")


@pytest.mark.parametrize("content", [b"", b"t,q\n0,1\n", b"PAR1" + bytes(100) + b"PAR1"])
def test_other_files(tmp_path, toy, content):
    path = tmp_path / "clip.parquet"
    path.write_bytes(content)
    refuses(path, toy, "must be a Parquet file")


def test_missing_file(tmp_path, toy):
    refuses(tmp_path / "none.parquet", toy, "cannot be read (No such file or directory)")


def test_without_pyarrow(tmp_path, toy, monkeypatch):
    path = write(tmp_path / "clip.parquet", sway(toy).columns)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    refuses(path, toy, "pip install dynacom[motion]")
