# SPDX-License-Identifier: BSD-2-Clause
import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dynacom import DynacomError, motion_csv, read_motion
from helpers import CALM, THOROUGH
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


def test_fractions_for_active(tmp_path, toy):
    """A contact is active from one half on; the fractions of all are how sure that is."""
    masks = np.column_stack([np.linspace(0.0, 1.0, 90), np.arange(90) % 2])
    columns = sway(toy).columns
    columns |= {"contact.pad.active": masks[:, 0], "contact.foot.active": masks[:, 1]}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert clip.schedule.names == ["pad", "foot"]
    np.testing.assert_array_equal(clip.schedule.active, masks >= 0.5)
    np.testing.assert_array_equal(clip.schedule.confidence, masks)
    del columns["contact.pad.active"]
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert clip.schedule.confidence is None


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
            {"contact.pad.active": np.where(np.arange(90) == 5, 1.5, 1)},
            "column 'contact.pad.active' must be from 0 to 1, got 1.5 in frame 5",
        ),
        (
            {"contact.pad.active": np.where(np.arange(90) == 7, -0.1, 1)},
            "column 'contact.pad.active' must be from 0 to 1, got -0.1 in frame 7",
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


# With the reader of plain numbers, and with NumPy alone.


def outcome(path, robot):
    """The clip, to the bit, or the message."""
    try:
        clip = read_motion(path, robot, fps=60)
    except DynacomError as error:
        return str(error)
    arrays = [clip.time, clip.q, clip.quaternion_error, *clip.forces.values()]
    active = None if clip.schedule is None else clip.schedule.active.tolist()
    return [(a.shape, a.tobytes()) for a in arrays], clip.joint_names, clip.notes, active


def outcomes(path, robot):
    """With the reader of plain numbers, and with NumPy alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion_csv, "_readNumberTable", lambda *_: None)
        alone = outcome(path, robot)
    return outcome(path, robot), alone


def to_lines(table):
    return [",".join(map(repr, map(float, row))) for row in table]


@pytest.fixture
def no_numpy(monkeypatch):
    """Makes what is left to NumPy an error."""

    def fail(*_, **__):
        raise AssertionError("left to NumPy")

    monkeypatch.setattr(np, "loadtxt", fail)


PLAIN = {
    "lines": lambda lines: "\n".join(lines),
    "last line ended": lambda lines: "\n".join(lines) + "\n",
    "of Windows": lambda lines: "\r\n".join(lines) + "\r\n",
    "blank lines above": lambda lines: "\n \r\n\n" + "\n".join(lines),
    "mark": lambda lines: "\ufeff" + "\n".join(lines),
    "comment sign": lambda lines: "\n".join(["# " + lines[0], *lines[1:]]),
    "quoted names": lambda lines: "\n".join(['"' + lines[0].replace(",", '","') + '"', *lines[1:]]),
}
ODD = {
    "of old Macs": lambda lines: "\r".join(lines) + "\r",
    "of all kinds": lambda lines: "\r\r" + "\n".join(lines[:3]) + "\r" + "\n".join(lines[3:]),
    "blank lines": lambda lines: "\n \n\n" + "\n\n".join(lines) + "\n\n\n",
    "spaces": lambda lines: "\n".join(line.replace(",", " ,\t ") for line in lines),
    "quotes": lambda lines: "\n".join([lines[0], lines[1].replace(",", '","'), *lines[2:]]),
    "spaces between": lambda lines: "\n".join([*lines[:3], "   ", *lines[3:]]),
    "comment": lambda lines: "\n".join([*lines[:3], "# the end"]),
    "comma at the end": lambda lines: "\n".join(line + "," for line in lines),
    "mark below": lambda lines: "\n".join([lines[0], "\ufeff" + lines[1], *lines[2:]]),
    "two marks": lambda lines: "\ufeff\ufeff" + "\n".join(lines),
    "short line": lambda lines: "\n".join([*lines, "1,2"]),
    "semicolons": lambda lines: "\n".join(lines).replace(",", ";"),
    "decimal commas": lambda lines: "\n".join(lines).replace(",", ";").replace(".", ","),
    "no row": lambda lines: lines[0] + "\n\n",
}


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz"])
@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize("name", [*PLAIN, *ODD])
def test_texts_with_numpy_alone(tmp_path, toy, text, name, header, suffix):
    lines = text if header else [row.partition(",")[2] for row in text[1:]]
    content = (PLAIN | ODD)[name](lines).encode()
    path = tmp_path / f"clip{suffix}"
    path.write_bytes(gzip.compress(content) if suffix == ".csv.gz" else content)
    both, alone = outcomes(path, toy)
    assert both == alone
    if (name in PLAIN and (header or name not in ("comment sign", "quoted names"))) or name in (
        "of old Macs",
        "of all kinds",
        "blank lines",
        "spaces",
    ):
        assert not isinstance(alone, str)


@pytest.mark.parametrize("name", PLAIN)
def test_plain_texts_need_no_numpy(tmp_path, toy, text, name, no_numpy):
    path = tmp_path / "clip.csv"
    path.write_text(PLAIN[name](text), encoding="utf-8", newline="")
    np.testing.assert_allclose(read_motion(path, toy).q, sway(toy, 5).q, atol=1e-15)


CELLS = [
    *("", " ", "NA", "N/A", "null", "None", "nan", "NaN", "-nan", "nan(1)", "#N/A", "NULL"),
    *("inf", "-inf", "Infinity", "+INFINITY", "1e400", "-1e400", "1.#INF", "1e308", "1e-400"),
    *("+0.5", "++0.5", "+-0.5", "--0.5", "- 0.5", ".5", "5.", ".", "1e", "1e5", "1E+05", "1e+-5"),
    *("0x1", "0x1p-3", "1_0", "1d0", "1f", "1L", "1j", "0.5%", "1 000", "1'000", "0b1", "007.50"),
    *("4.9e-324", "2.2250738585072011e-308", "9007199254740993", "0.1000000000000000055511151231"),
    *('"0.5"', '"0"5', '"0""5"', '""0.5', '"0.5" ', "'0.5'", '"0.5', '0"5', "#", "0.5#", "# 0.5"),
    *("True", "false", "1\x00", "1\x1a", "\t0.5\t", "\xa00.5", "\u20030.5", "0.5\x0b", "0.5\x0c"),
    *("\x1c0.5", "\ufeff0.5", "\u0661", "\u22121"),
]


@pytest.mark.parametrize(
    "column", ["battery", "contact.pad.force_z", "contact.pad.active", "m_hip"]
)
@pytest.mark.parametrize("cell", CELLS)
def test_cells_with_numpy_alone(tmp_path, toy, cell, column):
    columns = sway(toy, 5).columns | {name: np.arange(5.0) for name in FORCES[:3]}
    columns |= {"contact.pad.active": np.ones(5), "battery": np.zeros(5)}
    header, *rows = [",".join(columns), *to_lines(np.column_stack([*columns.values()]))]
    cells = rows[2].split(",")
    cells[[*columns].index(column)] = cell
    path = tmp_path / "clip.csv"
    path.write_text("\n".join([header, *rows[:2], ",".join(cells), *rows[3:]]), encoding="utf-8")
    both, alone = outcomes(path, toy)
    assert both == alone


@pytest.mark.parametrize("position", [0, 5, 8190, 8192, 100_000, -1])
@pytest.mark.parametrize("part", [b"\xff", b"\xc3\xa9", b"\x00", b"\r", b",", b"\n"])
def test_bytes_with_numpy_alone(tmp_path, toy, part, position):
    """Whatever stands where."""
    content = "\n".join(to_lines(sway(toy, 600).table)).encode()
    path = tmp_path / "clip.csv"
    path.write_bytes(content[:position] + part + content[position:])
    both, alone = outcomes(path, toy)
    assert both == alone


@pytest.mark.parametrize("length", [0, 1, 9, 12, 2000, -9, -4])
@pytest.mark.parametrize("more", [[], ["1,2"]])
def test_cut_archives_with_numpy_alone(tmp_path, toy, more, length):
    """What is wrong first counts."""
    first, *rows = to_lines(sway(toy).table)
    path = tmp_path / "clip.csv.gz"
    path.write_bytes(gzip.compress("\n".join([first, *more, *rows]).encode())[:length])
    both, alone = outcomes(path, toy)
    assert both == alone
    assert isinstance(alone, str)


def test_long_files(tmp_path, toy, no_numpy):
    """Row by row."""
    motion = sway(toy, 20_000)
    path = write_csv(tmp_path / "clip.csv", motion.table)
    assert path.stat().st_size > 3 << 20
    clip = read_motion(path, toy, fps=60)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    np.testing.assert_array_equal(clip.q[:, :3], motion.position)
    # A row that is wrong far below is found, too.
    with path.open("a") as file:
        file.write("1,2\n")
    with pytest.raises(AssertionError, match="left to NumPy"):
        read_motion(path, toy, fps=60)


def test_errors_of_long_files(tmp_path, toy):
    path = write_csv(tmp_path / "clip.csv", sway(toy, 8_000).table)
    with path.open("a") as file:
        file.write("1,2\n")
    refuses(path, toy, "line 8001 must have 12 columns, as the first, got 2", fps=60)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@THOROUGH
@given(
    cells=st.lists(
        st.one_of(
            st.floats(width=64).map(repr),
            st.floats(allow_nan=False, allow_infinity=False).map("{:.25e}".format),
            st.decimals(-10, 10, places=30).map(str),
            st.from_regex(r"[ \t]?[-+]?[0-9]{1,25}(\.[0-9]{0,25})?([eE][-+]?[0-9]{1,3})?[ \t]?\Z"),
            st.text("0123456789+-.eExnaif_\"'# \t,", max_size=6),
            st.sampled_from(CELLS),
        ),
        min_size=1,
        max_size=4,
    ),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n", " \n"]),
)
def test_any_cells_with_numpy_alone(tmp_path_factory, toy, cells, end):
    """Forces may be any numbers, and are handed out as they are."""
    columns = sway(toy, len(cells)).columns | {name: np.zeros(len(cells)) for name in FORCES[:2]}
    rows = to_lines(np.column_stack([*columns.values()]))
    lines = [",".join([*columns, FORCES[2]])]
    lines += [f"{row},{cell}" for row, cell in zip(rows, cells, strict=True)]
    path = tmp_path_factory.mktemp("cells") / "clip.csv"
    path.write_text(end.join(lines), encoding="utf-8", newline="")
    both, alone = outcomes(path, toy)
    assert both == alone


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
