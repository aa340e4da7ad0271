# SPDX-License-Identifier: BSD-2-Clause
"""Contact schedules in YAML: as written, and as corrected by hand."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from dynacom import ContactSchedule, DynacomError, read_schedule, write_schedule
from helpers import CALM, THOROUGH

CONTACTS = ["left", "right"]
TIME = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


@pytest.fixture
def read(tmp_path):
    """The frames of a text, drawn with dots and hashes, one line per contact."""

    def read(text, time=TIME, contacts=CONTACTS):
        path = tmp_path / "schedule.yaml"
        path.write_text(text, encoding="utf-8")
        schedule = read_schedule(path, time, contacts)
        assert schedule.names == list(contacts)
        assert schedule.active.shape == (len(time), len(contacts))
        return ["".join(".#"[int(active)] for active in column) for column in schedule.active.T]

    return read


# There and back.

NAMES = st.lists(st.text(min_size=1, max_size=12), min_size=1, max_size=4, unique=True)


@st.composite
def schedules(draw):
    names = draw(NAMES.filter(lambda names: all(is_storable(name) for name in names)))
    frames = draw(st.integers(1, 30))
    rows = st.lists(st.booleans(), min_size=len(names), max_size=len(names))
    active = np.array(draw(st.lists(rows, min_size=frames, max_size=frames)))
    start = draw(st.floats(-1e6, 1e6))
    step = draw(st.floats(1e-3, 10.0))
    jitter = draw(st.lists(st.floats(0.0, 0.5), min_size=frames, max_size=frames))
    time = start + step * (np.arange(frames) + np.array(jitter))
    return ContactSchedule(names, active), time


def is_storable(name):
    """Lone surrogates have no encoding."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


@CALM
@given(schedules())
def test_what_is_written_is_read(tmp_path_factory, case):
    """Whatever the contacts are called, and at any times."""
    schedule, time = case
    path = tmp_path_factory.mktemp("schedule") / "schedule.yaml"
    write_schedule(schedule, time, path)
    again = read_schedule(path, time, schedule.names)
    assert again.names == schedule.names
    assert_array_equal(again.active, schedule.active)


@THOROUGH
@given(st.lists(st.booleans(), min_size=1, max_size=60), st.sampled_from([24.0, 30.0, 59.94, 60.0]))
def test_times_may_be_rounded(tmp_path_factory, active, rate):
    """By hand: to a fraction of a millisecond, at the rates of videos."""
    time = np.arange(len(active)) / rate
    rounded = np.round(time, 5)
    path = tmp_path_factory.mktemp("schedule") / "schedule.yaml"
    write_schedule(ContactSchedule(["left"], np.array(active)[:, None]), rounded, path)
    assert_array_equal(read_schedule(path, time, ["left"]).active[:, 0], active)


def test_what_is_written(tmp_path):
    active = np.array([[1, 0], [1, 0], [0, 0], [1, 0], [0, 0], [1, 0]], dtype=bool)
    path = tmp_path / "schedule.yaml"
    write_schedule(ContactSchedule(["left", "the right: #1"], active), TIME, path)
    comment, *lines = path.read_text().splitlines()
    assert comment.startswith("# ") and "[s]" in comment
    assert lines == [
        "left:",
        "- [0.0, 0.1]",
        "- [0.3, 0.3]",
        "- [0.5, 0.5]",
        "'the right: #1': []",
    ]


def test_times_are_written_as_one_would(tmp_path):
    """No more digits than needed; more where frames follow one another closely."""
    path = tmp_path / "schedule.yaml"
    for rate, line in ((60.0, "- [0.016667, 0.033333]"), (1e5, "- [1.0e-05, 2.0e-05]")):
        time = np.arange(4) / rate
        active = np.array([[False], [True], [True], [False]])
        write_schedule(ContactSchedule(["left"], active), time, path)
        assert path.read_text().splitlines()[2] == line
        assert_array_equal(read_schedule(path, time, ["left"]).active, active)


def test_a_folder_that_is_not_there(tmp_path):
    schedule = ContactSchedule(["left"], np.ones((6, 1), dtype=bool))
    with pytest.raises(FileNotFoundError):
        write_schedule(schedule, TIME, tmp_path / "none" / "schedule.yaml")


# By hand.


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("left: [[0.1, 0.3]]", [".###..", "......"]),
        ("right: [[0.1, 0.3]]\nleft: []", ["......", ".###.."]),
        ("left:\n  - [0, 0.1]\n  - [0.4, 1]", ["##..##", "......"]),
        ("left: [[-5, 99]]", ["######", "......"]),
        ("left: [[0.2, 0.2]]", ["..#...", "......"]),
        ("left: [[0.11, 0.19]]", ["......", "......"]),  # between frames
        ("left: [[0.05, 0.25]]", [".##...", "......"]),
        ("left: [[7, 9], [0.5, 0.6]]", [".....#", "......"]),
        ("left: [[0.3, 0.4], [0, 0.1], [0.1, 0.3]]", ["#####.", "......"]),  # in any order
        ("left: [[1e-1, 3e-1]]", [".###..", "......"]),
        ("left: [[0.1000001, 0.2999999]]", [".###..", "......"]),
        ("left: [[0.101, 0.299]]", ["..#...", "......"]),
        ("# all\nleft: [[0, 1]]  # the time\n", ["######", "......"]),
        ("{left: [[0, 0]], right: [[0.5, 0.5]]}", ["#.....", ".....#"]),
        ("{}", ["......", "......"]),
    ],
)
def test_edits(read, text, expected):
    assert read(text) == expected


def test_a_single_frame(read):
    assert read("left: [[0.2, 0.4]]", time=np.array([0.3])) == ["#", "."]
    assert read("left: [[0.3, 0.3]]", time=np.array([0.3])) == ["#", "."]
    with pytest.raises(DynacomError, match=r"contact 'left': times .* 0.3 to 0.3 s, got 0.302"):
        read("left: [[0.302, 0.4]]", time=np.array([0.3]))


def test_contacts_with_odd_names(read):
    for text, name in (("'1'", "1"), ("'null'", "null"), ("'a: b'", "a: b"), ("füß", "füß")):
        assert read(f"{text}: [[0, 1]]", contacts=[name]) == ["######"]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["must be a mapping of contacts to times", "got None"]),
        ("[[0, 1]]", ["must be a mapping of contacts to times", "got [[0, 1]]"]),
        ("left", ["must be a mapping", "got 'left'"]),
        ("left: [", ["must be YAML"]),
        ("left: [[0, 1]]\nleft: [[2, 3]]", ["must be YAML", "'left' twice"]),
        ("foot: [[0, 1]]", ["contact must be one of left, right", "got 'foot'"]),
        ("1: [[0, 1]]", ["contact must be one of left, right", "got 1"]),
        ("left:", ["contact 'left'", "list of times [first, last]", "got None"]),
        ("left: 1", ["contact 'left'", "got 1"]),
        ("left: [0, 1]", ["contact 'left'", "got 0"]),
        ("left: [[0, 1], [2]]", ["contact 'left'", "got [2]"]),
        ("left: [[0, 1, 2]]", ["contact 'left'", "got [0, 1, 2]"]),
        ("right: [[0.3, 0.1]]", ["contact 'right'", "first <= last", "got [0.3, 0.1]"]),
        ("left: [[0, .nan]]", ["contact 'left'", "got [0, nan]"]),
        ("left: [[-.inf, 1]]", ["contact 'left'", "got [-inf, 1]"]),
        ("left: [[false, true]]", ["contact 'left'", "got [False, True]"]),
        ("left: [['0', '1']]", ["contact 'left'", "got ['0', '1']"]),
        ("left: [{0: 1}]", ["contact 'left'", "got {0: 1}"]),
        ("left: [[0, null]]", ["contact 'left'", "got [0, None]"]),
        (f"left: [[0, 1{400 * '0'}]]", ["contact 'left'", "got [0, 1000"]),
        ("left: 0-1", ["contact 'left'", "got '0-1'"]),
    ],
)
def test_errors(read, tmp_path, text, parts):
    """One line that names the file, the contact, what was expected and what was got."""
    with pytest.raises(DynacomError, match=re.escape(f"{tmp_path / 'schedule.yaml'}: ")) as caught:
        read(text)
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(DynacomError, match=re.escape(f"{path}: cannot be read (")):
            read_schedule(path, TIME, CONTACTS)
