# SPDX-License-Identifier: BSD-2-Clause
"""A motion that is written in its file's format is read as it was written, and all else is kept."""

import gzip
import json
import os
import pickle
import re
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import Clip, ContactSchedule, DynacomError, mark_of, read_motion, write_motion
from dynacom.motion_joints import tree_orders
from dynacom.robots import Robot
from motion_files import ROOT, body_poses, sway, write_columns, write_csv

joblib = pytest.importorskip("joblib")
pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def moved(robot: Robot, clip: Clip, size: float = 0.01) -> np.ndarray:
    """The clip with a smooth change of all that its file gives, (T, nq)."""
    model = robot.model
    rng = np.random.default_rng(1)
    ways = np.zeros(model.nv)
    ways[:6] = rng.uniform(0.5, 1.0, 6)
    for name in clip.joint_names:
        ways[model.joints[model.getJointId(name)].idx_v] = rng.uniform(0.5, 1.0)
    waves = size * np.sin(3.0 * (clip.time - clip.time[0]) + 0.3)
    return np.array(
        [pin.integrate(model, q, wave * ways) for q, wave in zip(clip.q, waves, strict=True)]
    )


def frames_of(clip: Clip) -> np.ndarray:
    """Which of the clip's frames its file has."""
    return np.arange(len(clip.time)) if clip.gaps is None else clip.gaps.places()


def written(
    path: Path, robot: Robot, tolerance: float, notes: int = 0, **options: object
) -> tuple[Clip, Clip, Path, list[str]]:
    """Reads a file, writes it with another motion, and reads that: before, after, path, notes."""
    clip = read_motion(path, robot, **options)
    out = path.with_name(f"out_{path.name}")
    q = moved(robot, clip)
    said = write_motion(clip, out, q)
    assert len(said) == notes, said
    assert all(note[0].isupper() and note.endswith(".") and "\n" not in note for note in said)
    found = read_motion(out, robot, **options)
    assert_array_equal(found.time, clip.time)
    rows = frames_of(clip)
    assert_allclose(found.q[rows], q[rows], rtol=0, atol=tolerance)
    assert np.abs(q - clip.q).max() > 100.0 * tolerance
    assert found.joint_names == clip.joint_names
    assert found.exact == (path.suffix not in (".csv", ".gz"))
    assert_same_schedule(found.schedule, clip.schedule)
    # Unchanged, with and without a mark: bit for bit.
    for mark in (True, False):
        same = path.with_name(f"same_{mark}_{path.name}")
        assert write_motion(clip, same, clip.q, mark=mark) == []
        again = read_motion(same, robot, **options)
        for name in ("time", "q", "v", "a", "quaternion_error"):
            assert_array_equal(getattr(again, name), getattr(clip, name))
        assert again.notes == clip.notes
        assert again.exact == (mark and found.exact)
    return clip, found, out, said


def assert_same_schedule(found: ContactSchedule | None, expected: ContactSchedule | None) -> None:
    assert (found is None) == (expected is None)
    if expected is not None:
        assert found.names == expected.names
        assert_array_equal(found.active, expected.active)


def velocities(robot: Robot, clip: Clip) -> dynacom.Motion:
    return dynacom.differentiate(robot.model, clip.time, clip.q)


# CSV.


def test_csv_without_a_header(tmp_path, toy):
    """Six decimals are too coarse for accelerations at 60 Hz; all columns get one more.

    Numbers are off by half of the last decimal, quaternions by as much again for their norm.
    """
    path = tmp_path / "motion.csv"
    np.savetxt(path, sway(toy).table, "%.6f", ",")
    _, _, out, notes = written(path, toy, 1e-7, 1, fps=60)
    assert notes == ["Accelerations need more decimals than the file has: 12 columns have 7 now."]
    cells = out.read_text().splitlines()[5].split(",")
    assert len(cells) == 12 and all(len(cell.split(".")[1]) == 7 for cell in cells)
    assert (tmp_path / "same_True_motion.csv").read_bytes() == path.read_bytes()


def test_csv_at_a_rate_that_needs_no_more_decimals(tmp_path, toy):
    path = tmp_path / "motion.csv"
    np.savetxt(path, sway(toy).table, "%.8f", ",")
    _, _, out, _ = written(path, toy, 1e-8, fps=60)
    assert {
        len(cell.split(".")[1]) for cell in out.read_text().replace("\n", ",").split(",")[:-1]
    } == {8}


@pytest.mark.parametrize("decimals", [3, 5, 6])
@pytest.mark.parametrize("fps", [30, 60, 120])
def test_flight_stays_flight(tmp_path, talos, talos_standing, decimals, fps):
    """However coarse the file was, rounding makes no force of a thousandth of the weight."""
    time = np.arange(fps // 2) / fps
    model = talos.model
    q = np.tile(talos_standing, (len(time), 1))
    path = tmp_path / "motion.csv"
    names = dict.fromkeys(talos.joints.names)
    columns = [q[:, model.joints[model.getJointId(name)].idx_q] for name in names]
    table = np.column_stack([q[:, :7], *columns])
    np.savetxt(path, table, f"%.{decimals}f", ",", header=",".join([*ROOT, *names]), comments="")
    clip = read_motion(path, talos, fps=fps)
    # Thrown up, turning about the centre of mass, which no force does.
    data = model.createData()
    v = np.zeros(model.nv)
    v[3:6] = 0.1, 0.4, -0.2
    q = clip.q.copy()
    com = pin.centerOfMass(model, data, q[0]).copy()
    for row, t in enumerate(time):
        q[row] = pin.integrate(model, clip.q[0], t * v)
        flight = com + t * np.array([0.3, 0.2, 2.0]) + 0.5 * t**2 * np.array([0.0, 0.0, -9.81])
        q[row, :3] += flight - pin.centerOfMass(model, data, q[row])
    out = tmp_path / "out.csv"
    write_motion(clip, out, q)

    def worst(q: np.ndarray) -> float:
        motion = dynacom.differentiate(model, time, q)
        forces = []
        for row in zip(motion.q[3:-3], motion.v[3:-3], motion.a[3:-3], strict=True):
            pin.centerOfMass(model, data, *row)
            forces.append(np.linalg.norm(data.acom[0] + [0.0, 0.0, 9.81]) / 9.81)
        return max(forces)

    found = worst(read_motion(out, talos, fps=fps).q)
    assert found < 1e-3
    # Numbers as coarse as they were would make more.
    rounded = np.round(q, decimals)
    rounded[:, 3:7] /= np.linalg.norm(rounded[:, 3:7], axis=1)[:, None]
    if 10.0**-decimals * fps**2 > 0.01:
        assert worst(rounded) > found


LAYOUT = "\r\n".join(
    [
        '\ufeffframe, time,"root_x",root_y,root_z,qx,qy,qz,qw,'
        "z_knee,m_hip,c_wheel,a_slide,b_toe,more,contact.foot.active,contact.pad.active,"
        "contact.foot.force_x,contact.foot.force_y,contact.foot.force_z",
        "",
        '007, 0.000,"0.10",0.2,+0.30,0,0,0,1,0.1,0.2,7.1,0.1,0.3,0.5e1,True,0.25,1,2,3',
        '008, 0.040,"0.11",0.2,+0.31,0,0,0,1,0.1,0.2,7.2,0.1,0.3,1e3,False,0.75,1,2,3',
        '009, 0.080,"0.12",0.2,+0.32,0,0,0,1,0.1,0.2,7.3,0.1,0.3,-0,True,1.00,1,2,3',
        '010, 0.120,"0.13",0.2,+0.33,0,0,0,1,0.1,0.2,7.4,0.1,0.3,5,True,0.00,1,2,3',
        "",
    ]
)


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz"])
def test_texts_of_csv_are_kept(tmp_path, toy, suffix):
    """Spaces, quotation marks, ends of lines, empty lines, and whatever does not change."""
    path, out = tmp_path / f"motion{suffix}", tmp_path / f"out{suffix}"
    load = gzip.decompress if suffix == ".csv.gz" else bytes
    content = LAYOUT.encode()
    path.write_bytes(gzip.compress(content) if suffix == ".csv.gz" else content)
    clip = read_motion(path, toy)
    write_motion(clip, out, clip.q)
    assert load(out.read_bytes()) == content
    q = clip.q.copy()
    q[1, 0] += 0.001
    q[2, 2] -= 0.25
    angle = 7.4 + 0.01
    wheel = toy.model.joints[toy.model.getJointId("c_wheel")].idx_q
    q[3, wheel : wheel + 2] = np.cos(angle), np.sin(angle)
    notes = write_motion(clip, out, q)
    assert notes == [
        "The forces of foot are left out: they were those of the motion before.",
        "Accelerations need more decimals than the file has: 3 columns have 6 now.",
    ]
    lines = load(out.read_bytes()).decode().split("\r\n")
    before = [line.rsplit(",", 3)[0] for line in content.decode().split("\r\n")]
    assert lines[:3] == before[:3]
    assert lines[3] == before[3].replace('"0.11"', '"0.111000"')
    assert lines[4] == before[4].replace("+0.32", "0.070000")
    assert lines[5] == before[5].replace("7.4", "7.410000")
    assert lines[6:] == [""]
    found = read_motion(out, toy)
    assert_allclose(found.q, q, atol=1e-12)
    assert_same_schedule(found.schedule, clip.schedule)
    assert found.forces == {}


def test_masks_and_forces_of_csv(tmp_path, toy):
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    path.write_bytes(LAYOUT.encode())
    clip = read_motion(path, toy)
    active = np.array([[0, 1], [1, 0], [0, 0], [1, 1]], dtype=bool)
    unsure = np.where(active, 0.51, 0.497)
    force = np.arange(12.0).reshape(4, 3) + 0.5
    schedule = ContactSchedule(["foot", "pad"], active, unsure)
    assert write_motion(clip, out, clip.q, schedule=schedule, forces={"foot": force}) == []
    lines = [line.split(",") for line in out.read_text("utf-8-sig").split("\n") if line.strip()]
    assert [line[15] for line in lines[1:]] == ["False", "True", "False", "True"]
    # Two decimals would make 0.50 of it, which is active.
    assert [line[16] for line in lines[1:]] == ["0.510", "0.497", "0.497", "0.510"]
    found = read_motion(out, toy)
    assert_array_equal(found.schedule.active, active)
    assert_allclose(found.forces["foot"], force, atol=1e-12)
    assert_array_equal(found.q, clip.q)
    # A contact that is not named is never active; one that the file does not have is told.
    alone = path.with_name("alone.csv")
    columns = sway(toy, 4).columns | {"contact.pad.active": np.ones(4)}
    clip = read_motion(write_columns(alone, columns), toy)
    schedule = ContactSchedule(["foot"], np.ones((4, 1), dtype=bool))
    notes = write_motion(clip, out, clip.q, schedule=schedule)
    assert notes == ["The file has no place to say when foot is active."]
    assert not np.asarray(read_motion(out, toy).schedule.active).any()


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_order_and_sign_of_quaternions(tmp_path, toy, order, sign):
    motion = sway(toy)
    quaternion = sign * (1.0 + 0.01 * np.sin(motion.time))[:, None] * motion.quaternion
    if order == "wxyz":
        quaternion = np.roll(quaternion, 1, axis=1)
    table = np.hstack([motion.position, quaternion, motion.angles])
    path = tmp_path / "motion.csv"
    np.savetxt(path, table, "%.18e", ",")
    clip, found, out, _ = written(path, toy, 1e-14, fps=60, quat=order)
    rows = np.loadtxt(out, delimiter=",")[:, 3:7]
    assert (np.einsum("ti,ti->t", rows, quaternion) > 0.9).all()
    # The file's sign, whatever that of q.
    q = moved(toy, clip)
    q[:, 3:7] *= -1.0
    opposite = tmp_path / "opposite.csv"
    write_motion(clip, opposite, q)
    assert opposite.read_bytes() == out.read_bytes()
    # Of norm 1, in frames that have not changed too.
    assert clip.quaternion_error.max() > 5e-3
    assert found.quaternion_error.max() < 1e-15
    q = clip.q.copy()
    q[0, 0] += 0.1
    write_motion(clip, out, q)
    assert_allclose(read_motion(out, toy, fps=60, quat=order).quaternion_error, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("form", "pattern"),
    [
        ("%.18e", r"-?\d\.\d{18}e[+-]\d\d"),
        ("%.17g", r"-?[\d.]+(e-\d+)?"),
        ("%.9e", r"-?\d\.\d{9}e[+-]\d\d"),
        ("%.3e", r"-?\d\.\d{3,7}e[+-]\d\d"),
    ],
)
def test_forms_of_numbers(tmp_path, toy, form, pattern):
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    np.savetxt(path, sway(toy).table, form, ",")
    clip = read_motion(path, toy, fps=60)
    q = moved(toy, clip)
    write_motion(clip, out, q)
    for cell in out.read_text().replace("\n", ",").split(",")[:-1]:
        assert re.fullmatch(pattern, cell), cell
    # Half a thousandth of gravity, of a second difference.
    assert 4.0 * 60**2 * np.abs(read_motion(out, toy, fps=60).q[:, :3] - q[:, :3]).max() < 5e-3


def test_columns_of_zeros_among_others_of_all_digits(tmp_path, toy):
    """As pandas writes them: 0.0 says nothing of how many digits are kept."""
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    columns = {"time": sway(toy).time} | sway(toy).columns | {"root_y": np.zeros(90)}
    del columns["t"]
    rows = [",".join(map(repr, row)) for row in np.column_stack([*columns.values()]).tolist()]
    path.write_text("\n".join([",".join(columns), *rows]))
    clip = read_motion(path, toy)
    q = moved(toy, clip)
    assert write_motion(clip, out, q) == []
    assert_array_equal(read_motion(out, toy).q[:, :3], q[:, :3])
    assert not out.read_text().endswith("\n")


# Parquet.


def test_parquet(tmp_path, toy):
    motion = sway(toy)
    path = tmp_path / "motion.parquet"
    arrays = {
        name: pyarrow.array(values.astype(np.float32)) for name, values in motion.columns.items()
    }
    arrays["t"] = pyarrow.array(motion.time)
    arrays["b_toe"] = pyarrow.array(motion.columns["b_toe"])
    arrays["frame"] = pyarrow.array(np.arange(90, dtype=np.int16))
    arrays["contact.foot.active"] = pyarrow.array(motion.time > 0.5)
    fields = [
        pyarrow.field(name, array.type, metadata={"unit": "?"}) for name, array in arrays.items()
    ]
    schema = pyarrow.schema(fields, metadata={"who": "me"})
    table = pyarrow.Table.from_arrays([*arrays.values()], schema=schema)
    parquet.write_table(table, path, row_group_size=32, compression="gzip")
    _, _, out, _ = written(path, toy, 2e-7)
    found = parquet.ParquetFile(out)
    assert found.schema_arrow.equals(schema, check_metadata=False)
    assert found.schema_arrow.metadata[b"who"] == b"me"
    assert found.schema_arrow.field("root_x").metadata[b"unit"] == b"?"
    assert json.loads(found.schema_arrow.metadata[b"dynacom"])["exact"] is True
    assert found.metadata.num_row_groups == 3
    assert found.metadata.row_group(0).column(1).compression == "GZIP"
    for name in ("t", "frame", "contact.foot.active"):
        assert found.read()[name].equals(table[name])
    same = parquet.read_table(tmp_path / "same_False_motion.parquet")
    assert same.equals(table, check_metadata=True)


def test_masks_of_parquet_and_integers(tmp_path, toy):
    path, out = tmp_path / "motion.parquet", tmp_path / "out.parquet"
    columns = sway(toy).columns | {"contact.foot.active": np.ones(90, dtype=bool)}
    columns["a_slide"] = np.zeros(90, dtype=int)
    columns |= {f"contact.pad.force_{axis}": np.ones(90) for axis in "xyz"}
    parquet.write_table(pyarrow.table(columns), path)
    clip = read_motion(path, toy)
    active = np.arange(90)[:, None] % 3 == 0
    notes = write_motion(
        clip, out, moved(toy, clip), schedule=ContactSchedule(["foot"], active), mark=False
    )
    assert notes == [
        "The forces of pad are left out: they were those of the motion before.",
        "The column a_slide was of integers, and is of real numbers now.",
    ]
    found = read_motion(out, toy)
    assert_array_equal(found.schedule.active, active)
    assert not found.exact and found.forces == {}
    assert_allclose(found.q, moved(toy, clip), atol=1e-14)


# Plain archives.


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_plain_archives(motion_file, talos, talos_motion, dtype):
    """Velocities and accelerations are those of the configurations as they were rounded."""
    arrays = {name: talos_motion[name].astype(dtype) for name in "qva"}
    arrays["q"] = np.asfortranarray(arrays["q"])
    meta = np.array({"a": [1]}, dtype=object)
    path = motion_file(**arrays, meta=meta, more=np.ones((2, 3), dtype=np.int8))
    _, found, out, _ = written(path, talos, 1e-14 if dtype == np.float64 else 1e-7)
    motion = velocities(talos, found)
    accuracy = 1e-13 if dtype == np.float64 else 1e-6
    assert_allclose(found.v, motion.v, rtol=accuracy, atol=accuracy)
    assert_allclose(found.a, motion.a, rtol=accuracy, atol=accuracy)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out) as new:
        assert new.namelist() == [*old.namelist(), "dynacom.npy"]
        for name in ("t", "contacts", "contact_names", "meta", "more"):
            assert new.read(f"{name}.npy") == old.read(f"{name}.npy")
    with np.load(out) as archive:
        assert {archive[name].dtype for name in "qva"} == {np.dtype(dtype)}
        assert archive["q"].flags.f_contiguous
        assert json.loads(archive["dynacom"].item()) == {
            "exact": True,
            "version": dynacom.__version__,
        }


def test_compressed_archives_stay_compressed(tmp_path, talos, talos_motion):
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    np.savez_compressed(path, **talos_motion)
    clip = read_motion(path, talos)
    write_motion(clip, out, moved(talos, clip))
    with zipfile.ZipFile(out) as archive:
        assert {member.compress_type for member in archive.infolist()} == {zipfile.ZIP_DEFLATED}


def test_coarse_numbers_are_told(motion_file, talos, talos_motion):
    """Ten kilometres away, single precision has steps of a millimetre."""
    q = talos_motion["q"].copy()
    q[:, 0] += 1e4
    clip = read_motion(motion_file(q=q.astype(np.float32)), talos)
    notes = write_motion(clip, clip.path.with_name("out.npz"), moved(talos, clip))
    assert len(notes) == 1 and "coarse" in notes[0]


@pytest.mark.parametrize("dtype", [bool, int, np.float32])
def test_masks_of_archives(motion_file, talos, talos_motion, dtype):
    clip = read_motion(motion_file(contacts=talos_motion["contacts"].astype(dtype)), talos)
    out = clip.path.with_name("out.npz")
    active = np.arange(80).reshape(40, 2) % 3 == 0
    # In another order, and unsure, which the file is not.
    schedule = ContactSchedule(
        ["right_sole", "left_sole"], active[:, ::-1], np.where(active[:, ::-1], 0.6, 0.1)
    )
    assert write_motion(clip, out, clip.q, schedule=schedule) == []
    found = read_motion(out, talos)
    assert found.schedule.names == ["left_sole", "right_sole"]
    assert_array_equal(found.schedule.active, active)
    assert found.schedule.confidence is None
    assert np.load(out)["contacts"].dtype == dtype
    for name in "qva":
        assert_array_equal(getattr(found, name), getattr(clip, name))


def test_unsure_masks(motion_file, talos):
    clip = read_motion(motion_file(contacts=np.full((40, 2), 0.75, dtype=np.float32)), talos)
    out = clip.path.with_name("out.npz")
    active = np.arange(80).reshape(40, 2) % 3 == 0
    confidence = np.where(active, 0.625, np.nextafter(0.5, 0.0))
    schedule = ContactSchedule(["left_sole", "right_sole"], active, confidence)
    write_motion(clip, out, clip.q, schedule=schedule)
    found = read_motion(out, talos).schedule
    assert_array_equal(found.active, active)
    assert_allclose(found.confidence, confidence, atol=1.1e-4)


@pytest.mark.parametrize("frames", [None, ("lower", "toe_link")])
def test_wrenches_of_archives(tmp_path, toy, frames):
    """The reader takes them back to the contacts' surfaces."""
    motion = sway(toy)
    rng = np.random.default_rng(2)
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    arrays = {"t": motion.time, "q": motion.q, "contact_names": np.array(["foot", "pad"])}
    arrays |= {
        "contacts": np.ones((90, 2), dtype=bool),
        "contact_wrenches": rng.standard_normal((90, 2, 6)),
    }
    if frames:
        arrays["contact_frames"] = np.array(["tip", "lower"])
    np.savez(path, **arrays)
    clip = read_motion(path, toy)
    q = moved(toy, clip)
    forces = {"foot": rng.standard_normal((90, 3)), "pad": rng.standard_normal((90, 6))}
    assert write_motion(clip, out, q, forces=forces) == []
    found = read_motion(out, toy)
    for name, values in forces.items():
        assert_allclose(found.forces[name], values, atol=1e-12)
    # Without forces of one of them there are none.
    notes = write_motion(clip, out, q, forces={"foot": forces["foot"]})
    assert notes == ["The forces of foot, pad are left out: they were those of the motion before."]
    assert read_motion(out, toy).forces == {}
    write_motion(clip, out, clip.q)
    for name, values in clip.forces.items():
        assert_array_equal(read_motion(out, toy).forces[name], values)


# Archives of whole_body_tracking.

LINKS = ["body", "upper", "wheel", "slider", "lower", "toe"]


def tracking(path: Path, robot: Robot, dtype: type = float, **changes: object) -> Path:
    motion = sway(robot)
    position, quaternion = body_poses(robot, motion.q, LINKS)
    arrays = {
        "fps": np.array([60]),
        "joint_pos": motion.angles,
        "joint_vel": np.zeros(motion.angles.shape),
        "body_pos_w": position,
        "body_quat_w": quaternion,
        "body_lin_vel_w": np.zeros(position.shape),
        "body_ang_vel_w": np.zeros(position.shape),
    } | changes
    arrays = {key: value for key, value in arrays.items() if value is not None}
    np.savez(
        path,
        **{
            key: value.astype(dtype) if value.dtype.kind == "f" else value
            for key, value in arrays.items()
        },
    )
    return path


def assert_bodies(
    robot: Robot, clip: Clip, path: Path, links: list[str | None], accuracy: float
) -> None:
    """Poses are Pinocchio's of what was read, velocities those that it has from differences."""
    model, data = robot.model, robot.model.createData()
    motion = velocities(robot, clip)
    position, quaternion = body_poses(robot, clip.q, [link or "body" for link in links])
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    columns = [column for column, link in enumerate(links) if link]
    for column in columns:
        assert_allclose(arrays["body_pos_w"][:, column], position[:, column], atol=accuracy)
        dot = np.einsum("ti,ti->t", arrays["body_quat_w"][:, column], quaternion[:, column])
        assert_allclose(np.abs(dot), 1.0, atol=accuracy)
        frame = model.getFrameId(links[column], pin.FrameType.BODY)
        for row in range(1, len(clip.q) - 1, 7):
            pin.forwardKinematics(model, data, motion.q[row], motion.v[row])
            expected = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            # A parabola through three poses, where joints go along theirs: of second order.
            for name, vector in (("lin", expected.linear), ("ang", expected.angular)):
                found = arrays[f"body_{name}_vel_w"][row, column]
                assert_allclose(found, vector, atol=2e-3 + 100 * accuracy)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("order", ["the order of the URDF", "breadth first"])
def test_tracking(tmp_path, toy, dtype, order):
    motion = sway(toy)
    names = tree_orders(toy)[order]
    angles = motion.angles[:, [motion.names.index(name) for name in names]]
    path = tracking(tmp_path / "motion.npz", toy, dtype, joint_pos=angles)
    accuracy = 1e-13 if dtype == np.float64 else 3e-7
    clip, found, out, notes = written(path, toy, accuracy, 2)
    assert [note.split()[3] for note in notes] == ["body_lin_vel_w", "body_ang_vel_w"]
    assert_bodies(toy, found, out, LINKS, accuracy)
    v = velocities(toy, found).v
    assert_allclose(found.v, v, atol=1e-10 if dtype == np.float64 else 1e-5)
    with np.load(out) as archive, np.load(path) as before:
        for name in before.files:
            assert archive[name].dtype == before[name].dtype
            assert archive[name].shape == before[name].shape
        assert_array_equal(archive["fps"], [60])
    # Once more: now they are those of the origins.
    again = out.with_name("again.npz")
    assert write_motion(found, again, moved(toy, found)) == []


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("named", [True, False])
def test_tracking_with_the_root_among_the_joints(tmp_path, toy, order, named):
    motion = sway(toy)
    _, quaternion = body_poses(toy, motion.q, LINKS)
    turned = motion.quaternion
    if order == "wxyz":
        turned = np.roll(turned, 1, axis=1)
    else:
        quaternion = np.roll(quaternion, -1, axis=2)
    path = tracking(
        tmp_path / "motion.npz",
        toy,
        joint_pos=np.hstack([motion.position, -turned, motion.angles]),
        joint_vel=np.zeros((90, 11)),
        body_quat_w=quaternion,
        body_lin_vel_w=None,
        body_ang_vel_w=None,
        **({"joint_names": np.array(motion.names), "body_names": np.array(LINKS)} if named else {}),
    )
    _, found, out, _ = written(path, toy, 1e-13, quat=order)
    v = velocities(toy, found).v
    assert_allclose(found.v, v, atol=1e-10)
    with np.load(out) as archive:
        kept = np.einsum("ti,ti->t", archive["joint_pos"][:, 3:7], -turned)
        assert (kept > 0.9).all()
        assert (np.einsum("tbi,tbi->tb", archive["body_quat_w"], quaternion) > 0.9).all()


def test_bodies_and_joints_that_the_robot_does_not_have(tmp_path, toy):
    """A box that is carried nowhere stays; a sensor on a link and a finger go with theirs."""
    motion = sway(toy)
    position, quaternion = body_poses(toy, motion.q, LINKS)
    rng = np.random.default_rng(0)
    tip = LINKS.index("lower")
    rotation = np.array([[pin.Quaternion(*q).matrix() for q in row] for row in quaternion])
    sensor = position[:, tip] + rotation[:, tip] @ [0.1, 0.2, 0.05]
    finger = position[:, tip] + rotation[:, tip] @ [0.0, -0.3, 0.1]
    spin = np.array([pin.Quaternion(pin.exp3(np.array([0, t, 0]))).coeffs() for t in motion.time])
    box = np.cumsum(0.05 * rng.standard_normal((90, 3)), axis=0)
    position = np.concatenate([position, np.stack([sensor, finger, box], axis=1)], axis=1)
    turns = []
    for row in range(90):
        turn = pin.Quaternion(*quaternion[row, tip]) * pin.Quaternion(spin[row])
        turns.append(np.roll(turn.coeffs(), 1))
    more = np.stack([quaternion[:, tip], np.array(turns), np.tile([1.0, 0, 0, 0], (90, 1))], axis=1)
    quaternion = np.concatenate([quaternion, more], axis=1)
    names = ["finger_joint", *motion.names]
    changes = {
        "joint_pos": np.column_stack([motion.time, motion.angles]),
        "joint_vel": np.ones((90, 6)),
        "body_pos_w": position,
        "body_quat_w": quaternion,
        "body_lin_vel_w": np.full(position.shape, 5.0),
        "body_ang_vel_w": np.full(position.shape, 5.0),
    }
    named = {
        "joint_names": np.array(names),
        "body_names": np.array([*LINKS, "sensor", "finger", "box"]),
    }
    path = tracking(tmp_path / "motion.npz", toy, **changes, **named)
    _, found, out, notes = written(path, toy, 1e-13, 3)
    assert notes[0] == "Bodies that move with none of the robot's links stay as they were: box."
    assert_bodies(toy, found, out, [*LINKS, None, None, None], 1e-12)
    after, turned = body_poses(toy, found.q, ["lower"])
    with np.load(out) as archive:
        arrays = dict(archive)
    rotation = np.array([pin.Quaternion(*q).matrix() for q in turned[:, 0]])
    assert_allclose(
        arrays["body_pos_w"][:, 6], after[:, 0] + rotation @ [0.1, 0.2, 0.05], atol=1e-12
    )
    assert_allclose(
        arrays["body_pos_w"][:, 7], after[:, 0] + rotation @ [0.0, -0.3, 0.1], atol=1e-12
    )
    for row in range(90):
        expected = rotation[row] @ pin.Quaternion(spin[row]).matrix()
        matrix = pin.Quaternion(*arrays["body_quat_w"][row, 7]).matrix()
        assert_allclose(matrix, expected, atol=1e-12)
    for name in ("body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w"):
        assert_array_equal(arrays[name][:, 8], changes[name][:, 8])
    assert_array_equal(arrays["joint_pos"][:, 0], motion.time)
    assert_array_equal(arrays["joint_vel"][:, 0], np.ones(90))


def test_bodies_of_joints_at_rest(tmp_path, toy):
    """A link that has not moved in another one so far is still its own: the closest."""
    motion = sway(toy)
    q, angles = motion.q.copy(), motion.angles.copy()
    for name in ("z_knee", "b_toe", "a_slide"):
        angles[:, motion.names.index(name)] = 0.1
        q[:, toy.model.joints[toy.model.getJointId(name)].idx_q] = 0.1
    position, quaternion = body_poses(toy, q, LINKS)
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    changes = {"joint_pos": angles, "body_pos_w": position, "body_quat_w": quaternion}
    clip = read_motion(tracking(path, toy, **changes), toy)
    write_motion(clip, out, moved(toy, clip))
    assert_bodies(toy, read_motion(out, toy), out, LINKS, 1e-12)


def test_signs_of_bodies(tmp_path, toy):
    """Where a turn passes half a circle, w passes zero, and quaternions go on."""
    motion = sway(toy)
    q = motion.q.copy()
    turn = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, np.pi - 1.5])))
    for row in q:
        row[:3] = turn.matrix() @ row[:3]
        row[3:7] = (turn * pin.Quaternion(*row[[6, 3, 4, 5]])).coeffs()
    position, quaternion = body_poses(toy, q, LINKS)
    for row in range(1, 90):
        opposite = np.einsum("bi,bi->b", quaternion[row - 1], quaternion[row]) < 0.0
        quaternion[row][opposite] *= -1.0
    assert (quaternion[:, :, 0].min(axis=0) < 0.0).any()
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    changes = {"body_pos_w": position, "body_quat_w": quaternion}
    clip = read_motion(tracking(path, toy, **changes), toy)
    write_motion(clip, out, moved(toy, clip))
    with np.load(out) as archive:
        assert (np.einsum("tbi,tbi->tb", archive["body_quat_w"], quaternion) > 0.9).all()
    assert_bodies(toy, read_motion(out, toy), out, LINKS, 1e-12)


def test_nameless_bodies_that_are_no_link(tmp_path, toy):
    """Where the root is in joint_pos, they are left out, and the file can be read without."""
    motion = sway(toy)
    position, quaternion = body_poses(toy, motion.q, LINKS)
    box = np.cumsum(np.full((90, 1, 3), 0.05), axis=0)
    changes = {
        "joint_pos": np.hstack(
            [motion.position, np.roll(motion.quaternion, 1, axis=1), motion.angles]
        ),
        "body_pos_w": np.concatenate([position, box], axis=1),
        "body_quat_w": quaternion[:, [0, 1, 2, 3, 4, 5, 0]],
        "body_lin_vel_w": np.zeros((90, 7, 3)),
        "body_ang_vel_w": None,
    }
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    clip = read_motion(tracking(path, toy, **changes), toy)
    q = moved(toy, clip)
    notes = write_motion(clip, out, q)
    assert notes[0].startswith(
        "The bodies are left out: 1 of 7 move with none of the robot's links"
    )
    with np.load(out) as archive:
        assert set(archive.files) == {"fps", "joint_pos", "joint_vel", "dynacom"}
    assert_allclose(read_motion(out, toy).q, q, atol=1e-13)


def test_bodies_of_another_revision_keep_what_they_differ_by(tmp_path, toy):
    motion = sway(toy)
    position, quaternion = body_poses(toy, motion.q, LINKS)
    position[:, 5] += [0.0, 0.0, 0.01]
    path, out = tmp_path / "motion.npz", tmp_path / "out.npz"
    clip = read_motion(tracking(path, toy, body_pos_w=position), toy)
    q = clip.q.copy()
    q[:, :3] += [0.1, 0.0, 0.02]
    write_motion(clip, out, q)
    with np.load(out) as archive:
        assert_allclose(archive["body_pos_w"], position + [0.1, 0.0, 0.02], atol=1e-13)


# Pickles.


def clip_of(robot: Robot, **changes: object) -> dict[str, object]:
    motion = sway(robot)
    return {
        "fps": 60,
        "root_pos": motion.position.astype(np.float32),
        "root_rot": motion.quaternion,
        "dof_pos": motion.angles,
        "names_of_dogs": ("Rex", ["Bello"]),
        "nested": {"deep": [{"array": np.arange(3)}]},
    } | changes


def dump(path: Path, content: object, protocol: int = 4) -> Path:
    path.write_bytes(pickle.dumps(content, protocol))
    return path


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_pickles(tmp_path, toy, protocol):
    content = clip_of(toy)
    path = dump(tmp_path / "motion.pkl", content, protocol)
    _, _, out, _ = written(path, toy, 1e-7)
    data = out.read_bytes()
    assert data[:2] == bytes([0x80, protocol]) if protocol > 1 else data[:1] != b"\x80"
    found = pickle.loads(data)
    assert [*found] == [*content, "dynacom"]
    for key in ("fps", "names_of_dogs"):
        assert found[key] == content[key] and type(found[key]) is type(content[key])
    assert_array_equal(found["nested"]["deep"][0]["array"], np.arange(3))
    for key in ("root_pos", "root_rot", "dof_pos"):
        assert found[key].dtype == content[key].dtype


def test_one_of_several_clips(tmp_path, toy):
    """Others stay as they are; shapes and lists, too."""
    motion = sway(toy)
    clips = {
        name: {
            "root_trans_offset": motion.position.tolist(),
            "root_rot": np.roll(motion.quaternion, 1, axis=1),
            "dof": motion.angles[:, :, None],
            "fps": np.float64(60),
        }
        for name in ("first", "second")
    }
    path = dump(tmp_path / "motion.pickle", clips)
    _, _, out, _ = written(path, toy, 1e-13, clip="second", quat="wxyz")
    found = pickle.loads(out.read_bytes())
    assert found["first"]["root_trans_offset"] == clips["first"]["root_trans_offset"]
    for key in ("root_rot", "dof"):
        assert_array_equal(found["first"][key], clips["first"][key])
    assert "dynacom" not in found["first"]
    assert found["second"]["dof"].shape == (90, 5, 1)
    assert isinstance(found["second"]["root_trans_offset"], list)
    assert not read_motion(out, toy, clip="first", quat="wxyz").exact


def test_batches_know_which_clip_it_was(tmp_path, toy):
    from dynacom.motion_clip import Options
    from dynacom.motion_pickle import PickleFile

    content = {name: clip_of(toy) for name in ("a", "b")}
    path = dump(tmp_path / "motion.pkl", content)
    for name, make in PickleFile(path, Options()).clips(toy):
        assert make().options.clip == name


def test_what_follows_from_a_pickle(tmp_path, humanoid):
    """Positions of links in the root's frame, also of those that this robot does not have."""
    motion = sway(humanoid)
    model, data = humanoid.model, humanoid.model.createData()
    links = ["pelvis", "left_knee_link", "torso_link", "right_ankle_roll_link"]
    toe = [0.1, 0.01, -0.02]

    def positions(q: np.ndarray) -> np.ndarray:
        position = []
        for row in q.copy():
            row[:7] = 0, 0, 0, 0, 0, 0, 1
            pin.framesForwardKinematics(model, data, row)
            poses = [data.oMf[model.getFrameId(link)] for link in links]
            end = poses[-1].act(np.array(toe))
            position.append([*(pose.translation.copy() for pose in poses), end])
        return np.array(position)

    kinds = [model.joints[model.getJointId(name)].shortname() for name in motion.names]
    axes = np.array([[kind == f"JointModelR{axis}" for axis in "XYZ"] for kind in kinds])
    assert (axes.sum(axis=1) == 1).all()

    def vectors(q: np.ndarray) -> np.ndarray:
        turns = [pin.log3(pin.Quaternion(row[3:7]).matrix()) for row in q]
        columns = [model.joints[model.getJointId(name)].idx_q for name in motion.names]
        of_joints = q[:, columns][:, :, None] * axes
        return np.concatenate(
            [np.array(turns)[:, None], of_joints, np.zeros((len(q), 3, 3))], axis=1
        )

    index = [model.joints[model.getJointId(name)].idx_v for name in motion.names]
    v = dynacom.differentiate(model, motion.time, motion.q).v
    content = clip_of(
        humanoid,
        local_body_pos=positions(motion.q).astype(np.float32),
        link_body_list=[*links, "toe"],
        pose_aa=vectors(motion.q),
        dof_vel=v[:, index],
        root_vel=v[:, :3],
        smpl_joints=np.ones((90, 24, 3)),
    )
    path = dump(tmp_path / "motion.pkl", content)
    clip, after, out, notes = written(path, humanoid, 1e-7, 1)
    assert notes == ["Left out, as they were those of the motion before: root_vel."]
    found = pickle.loads(out.read_bytes())
    assert found["local_body_pos"].dtype == np.float32
    assert_allclose(found["local_body_pos"], positions(after.q), atol=1e-6)
    assert_allclose(found["pose_aa"], vectors(after.q), atol=1e-6)
    assert_allclose(found["dof_vel"], velocities(humanoid, after).v[:, index], atol=1e-9)
    assert_array_equal(found["smpl_joints"], content["smpl_joints"])
    assert found["link_body_list"] == [*links, "toe"]
    # What cannot be told is left out.
    wrong = {
        "local_body_pos": content["local_body_pos"] + 1.0,
        "pose_aa": vectors(motion.q)[:, :, ::-1],
    }
    clip = read_motion(dump(path, content | wrong | {"dof_vel": np.ones((90, 29))}), humanoid)
    notes = write_motion(clip, out, moved(humanoid, clip))
    assert notes == [
        "Left out, as they were those of the motion before: local_body_pos, pose_aa, dof_vel, "
        "root_vel."
    ]
    assert not {"local_body_pos", "pose_aa", "dof_vel", "root_vel"} & {
        *pickle.loads(out.read_bytes())
    }


@pytest.mark.parametrize(
    "compress", [0, ("zlib", 3), ("gzip", 3), ("bz2", 3), ("xz", 3), ("lzma", 3)]
)
def test_files_of_joblib(tmp_path, toy, compress):
    path = tmp_path / "motion.joblib"
    content = {"one": clip_of(toy)}
    joblib.dump(content, path, compress=compress)
    _, _, out, _ = written(path, toy, 1e-7, trust=True)
    assert out.read_bytes()[:2] == path.read_bytes()[:2]
    found = joblib.load(out)
    assert found["one"]["names_of_dogs"] == content["one"]["names_of_dogs"]


# Frames and joints that a file does not have.


# At another pace.


def test_stretched_times(tmp_path, toy, motion_file, talos):
    """The first one stays; velocities in the file are those of the new pace."""
    columns = sway(toy).columns
    columns["t"] = 2.0 + columns["t"]
    plain = motion_file(t=3.0 + np.arange(40) / 50.0, a=None)
    paths = [(plain, talos), (write_columns(tmp_path / "motion.csv", columns), toy)]
    table = pyarrow.table({name: pyarrow.array(column) for name, column in columns.items()})
    paths.append((tmp_path / "motion.parquet", toy))
    parquet.write_table(table, paths[-1][0])
    for path, robot in paths:
        clip = read_motion(path, robot)
        out = path.with_name(f"out_{path.name}")
        assert write_motion(clip, out, clip.q, stretch=1.25) == []
        found = read_motion(out, robot)
        assert_allclose(found.time, clip.time[0] + 1.25 * (clip.time - clip.time[0]), atol=1e-12)
        assert_array_equal(found.q, clip.q)
        if clip.v is not None:
            assert_allclose(found.v, velocities(robot, found).v, atol=1e-12)
            assert_allclose(velocities(robot, clip).v, 1.25 * found.v, atol=1e-12)


def test_stretched_rates(tmp_path, toy):
    """Those of integers stay such where they can; a note tells of arrays which cannot."""
    path, out = tmp_path / "motion.pkl", tmp_path / "out.pkl"
    rates = [(60, 1.5, int), (60, 1.25, int), (50, 1.1, float), (np.array([60]), 1.1, None)]
    for fps, stretch, kind in rates:
        clip = read_motion(dump(path, clip_of(toy, fps=fps)), toy)
        assert write_motion(clip, out, clip.q, stretch=stretch) == []
        found = pickle.loads(out.read_bytes())["fps"]
        assert_allclose(found, fps / stretch)
        if kind:
            assert type(found) is kind
        assert_allclose(read_motion(out, toy).time, stretch * clip.time, atol=1e-12)
    clip = read_motion(tracking(tmp_path / "motion.npz", toy), toy)
    notes = write_motion(clip, tmp_path / "out.npz", clip.q, stretch=1.25)
    assert not any("fps" in note for note in notes)
    notes = write_motion(clip, tmp_path / "odd.npz", clip.q, stretch=1.1)
    assert "The array fps was of integers, and is of real numbers now." in notes
    for name, stretch in (("out.npz", 1.25), ("odd.npz", 1.1)):
        found = read_motion(tmp_path / name, toy)
        assert_allclose(found.time, stretch * clip.time, atol=1e-12)
        assert_array_equal(found.q, clip.q)
        with np.load(tmp_path / name) as archive:
            assert archive["fps"].shape == (1,)
        assert_bodies(toy, found, tmp_path / name, LINKS, 1e-13)


def test_velocities_in_the_file_are_slower(tmp_path, toy):
    """They are known for what they are by the pace that the file had."""
    motion = sway(toy)
    columns = [toy.model.joints[toy.model.getJointId(name)].idx_v for name in motion.names]
    v = dynacom.differentiate(toy.model, motion.time, motion.q).v[:, columns]
    clip = read_motion(dump(tmp_path / "motion.pkl", clip_of(toy, dof_vel=v)), toy)
    assert write_motion(clip, tmp_path / "out.pkl", clip.q, stretch=2.0) == []
    found = pickle.loads((tmp_path / "out.pkl").read_bytes())["dof_vel"]
    assert_allclose(found, 0.5 * v, atol=1e-5)
    # Of bodies, those that a first writing has made so.
    clip = read_motion(tracking(tmp_path / "motion.npz", toy), toy)
    write_motion(clip, tmp_path / "origins.npz", moved(toy, clip))
    clip = read_motion(tmp_path / "origins.npz", toy)
    assert write_motion(clip, tmp_path / "slow.npz", clip.q, stretch=2.0) == []
    with np.load(tmp_path / "origins.npz") as before, np.load(tmp_path / "slow.npz") as after:
        for name in ("body_lin_vel_w", "body_ang_vel_w", "joint_vel"):
            assert_allclose(after[name], 0.5 * before[name], atol=1e-9)


def test_rates_that_the_file_cannot_hold(tmp_path, toy):
    path, out = write_csv(tmp_path / "motion.csv", sway(toy).table), tmp_path / "out.csv"
    clip = read_motion(path, toy, fps=60)
    notes = write_motion(clip, out, clip.q, stretch=1.25)
    assert notes == [
        "Time is stretched, and the file has no place to say so: its frame rate is 48 Hz now "
        "(--fps)."
    ]
    assert out.read_bytes() == path.read_bytes()
    # Who has given another rate than the file's has it in the file now.
    path, out = dump(tmp_path / "motion.pkl", clip_of(toy)), tmp_path / "out.pkl"
    clip = read_motion(path, toy, fps=100)
    notes = write_motion(clip, out, clip.q, stretch=2.0)
    assert notes == ["The frame rate is 50 Hz now, as the file says: --fps is not to be given."]
    assert_allclose(read_motion(out, toy).time, 2.0 * clip.time, atol=1e-12)


def test_forces_of_another_pace_are_left_out(tmp_path, toy):
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    path.write_bytes(LAYOUT.encode())
    clip = read_motion(path, toy)
    notes = write_motion(clip, out, clip.q, stretch=2.0)
    assert "The forces of foot are left out: they were those of the motion before." in notes
    found = read_motion(out, toy)
    assert_allclose(found.time, [0.0, 0.08, 0.16, 0.24], atol=1e-12)
    assert found.forces == {}


@pytest.mark.parametrize("stretch", [0.0, -1.0, np.nan, np.inf])
def test_stretches_that_are_none(motion_file, talos, tmp_path, stretch):
    clip = read_motion(motion_file(), talos)
    with pytest.raises(DynacomError, match="stretch must be finite and > 0, got"):
        write_motion(clip, tmp_path / "out.npz", clip.q, stretch=stretch)
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_gaps(tmp_path, toy, suffix):
    """Frames that the file does not have are not written, and made anew when it is read."""
    motion = sway(toy)
    kept = np.delete(np.arange(90), [20, 50, 51])
    columns = {name: values[kept] for name, values in motion.columns.items()}
    path = tmp_path / f"motion{suffix}"
    if suffix == ".csv":
        write_columns(path, columns)
    elif suffix == ".npz":
        v = dynacom.differentiate(toy.model, motion.time, motion.q).v
        np.savez(path, t=motion.time[kept], q=motion.q[kept], v=v[kept])
    else:
        parquet.write_table(pyarrow.table(columns), path)
    clip, found, out, _ = written(path, toy, 1e-13)
    assert clip.gaps is not None and len(clip.time) == 90
    assert_allclose(found.q, moved(toy, clip), atol=1e-4)
    if suffix == ".npz":
        assert np.load(out)["q"].shape == (87, toy.model.nq)
        rows = frames_of(found)
        assert_allclose(found.v[rows], velocities(toy, found).v[rows], atol=1e-12)


def test_joints_that_the_file_does_not_give(tmp_path, toy):
    motion = sway(toy)
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    clip = read_motion(write_csv(path, motion.table[:, :-1]), toy, fps=60)
    assert "b_toe" not in clip.joint_names
    q = moved(toy, clip)
    toe = toy.model.joints[toy.model.getJointId("b_toe")].idx_q
    q[:, toe] += 1e-10
    assert write_motion(clip, out, q) == []
    q[:, toe] += 1e-3
    notes = write_motion(clip, out, q)
    assert notes == ["Joints have moved that the file does not give, and are not in it: b_toe."]
    q[:, toe] = clip.q[:, toe]
    assert_allclose(read_motion(out, toy, fps=60).q, q, atol=1e-14)
    # That alone is no change of the file.
    q = clip.q.copy()
    q[:, toe] += 1e-3
    write_motion(clip, out, q)
    assert out.read_bytes() == path.read_bytes()


# Marks.


@pytest.mark.parametrize("summary", ["summary.json", "out.csv.summary.json"])
def test_marks_beside_csv(tmp_path, toy, summary):
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    clip = read_motion(write_csv(path, sway(toy).table), toy, fps=60)
    assert not clip.exact
    write_motion(clip, out, moved(toy, clip))

    def is_exact() -> bool:
        return read_motion(out, toy, fps=60).exact

    assert not is_exact()
    mark = mark_of(out)
    assert mark["file"] == "out.csv" and mark["exact"] is True
    beside = tmp_path / summary
    beside.write_text(json.dumps({"repair": mark, "notes": []}))
    assert is_exact()
    assert not read_motion(path, toy, fps=60).exact
    for wrong in ({"file": "other.csv"}, {"sha256": "0" * 64}, {"exact": False}, {"exact": 1}):
        beside.write_text(json.dumps({"repair": mark | wrong}))
        assert not is_exact()
    for foreign in ("", "{", "[]", "3", '{"repair": 3}', '{"repair": {}}', "[" * 100000, "\xff"):
        beside.write_bytes(foreign.encode("latin1"))
        assert not is_exact()
    beside.write_text(json.dumps({"repair": mark}))
    assert is_exact()
    # An edited file is another one.
    out.write_bytes(out.read_bytes().replace(b"1", b"2", 1))
    assert not is_exact()
    beside.unlink()
    beside.mkdir()
    assert not is_exact()


def test_marks_within_files(motion_file, tmp_path, talos, toy):
    """They are written once, and taken away where they are not wanted."""
    text = json.dumps({"exact": True, "version": "9"})
    clip = read_motion(motion_file(dynacom=np.array(text)), talos)
    assert clip.exact
    out = clip.path.with_name("out.npz")
    write_motion(clip, out, moved(talos, clip))
    assert read_motion(out, talos).exact
    assert zipfile.ZipFile(out).namelist().count("dynacom.npy") == 1
    write_motion(clip, out, moved(talos, clip), mark=False)
    assert not read_motion(out, talos).exact
    for foreign in (np.ones(3), np.array("no"), np.array('{"exact": 1}'), np.array([text, text])):
        assert not read_motion(motion_file(dynacom=foreign), talos).exact
    for foreign in (3, "no", b"\xff", [text], {"exact": True}):
        path = dump(tmp_path / "motion.pkl", clip_of(toy, dynacom=foreign))
        assert not read_motion(path, toy).exact


# What is refused.


def test_what_cannot_be_written(motion_file, talos, tmp_path):
    clip = read_motion(motion_file(), talos)
    before = clip.path.read_bytes()
    names = {file.name for file in tmp_path.iterdir()}
    out = tmp_path / "out.npz"
    link = tmp_path / "link.npz"
    link.symlink_to(clip.path)
    hard = tmp_path / "hard.npz"
    os.link(clip.path, hard)
    for path in (clip.path, link, hard, tmp_path / "." / clip.path.name):
        with pytest.raises(DynacomError, match="must be another file than the one that was read"):
            write_motion(clip, path, clip.q)
    for name in ("out.csv", "out", "out.npz.gz"):
        with pytest.raises(DynacomError, match=r"must end in \.npz, as motion\.npz, got 'out"):
            write_motion(clip, tmp_path / name, clip.q)
    with pytest.raises(DynacomError, match="cannot be written .No such file"):
        write_motion(clip, tmp_path / "nowhere" / "out.npz", clip.q)
    with pytest.raises(DynacomError, match=r"q must have shape \(40, 39\), got \(39, 39\)"):
        write_motion(clip, out, clip.q[1:])
    for wrong in (np.nan, 2.0):
        q = clip.q.copy()
        q[3, 6] = wrong
        with pytest.raises(DynacomError, match="finite numbers and quaternions of norm 1"):
            write_motion(clip, out, q)
    schedule = ContactSchedule(["left_sole"], np.ones((39, 1), dtype=bool))
    with pytest.raises(DynacomError, match="schedule must have 40 frames, as the clip, got 39"):
        write_motion(clip, out, clip.q, schedule=schedule)
    with pytest.raises(DynacomError, match=r"left_sole must have shape \(40, 6\), got \(40, 3\)"):
        write_motion(clip, out, clip.q, forces={"left_sole": np.ones((40, 3))})
    with pytest.raises(DynacomError, match="of the robot's contacts, got 'hand'"):
        write_motion(clip, out, clip.q, forces={"hand": np.ones((40, 3))})
    with pytest.raises(DynacomError, match="one that read_motion has read, got one that was made"):
        write_motion(replace(clip, options=None), out, clip.q)
    link.unlink()
    hard.unlink()
    assert {file.name for file in tmp_path.iterdir()} == names
    assert clip.path.read_bytes() == before


@pytest.mark.parametrize("what", ["position", "joint", "missing"])
def test_a_file_that_has_changed_since(tmp_path, toy, what):
    path, out = tmp_path / "motion.csv", tmp_path / "out.csv"
    table = sway(toy).table
    clip = read_motion(write_csv(path, table), toy, fps=60)
    table[5, {"position": 0, "joint": 8, "missing": 0}[what]] += 1e-3
    write_csv(path, table)
    if what == "missing":
        path.unlink()
    with pytest.raises(
        DynacomError, match="cannot be read" if what == "missing" else "has changed"
    ):
        write_motion(clip, out, moved(toy, clip))
    assert not out.exists()


def test_files_appear_whole_or_not_at_all(motion_file, talos, monkeypatch):
    clip = read_motion(motion_file(), talos)
    out = clip.path.with_name("out.npz")
    out.write_text("before")

    def fail(*_: object) -> None:
        raise OSError("no space")

    monkeypatch.setattr("dynacom.motion_writer.os.replace", fail)
    with pytest.raises(DynacomError, match="cannot be written .no space"):
        write_motion(clip, out, clip.q)
    monkeypatch.undo()
    assert out.read_text() == "before"
    assert {file.name for file in out.parent.iterdir()} == {"motion.npz", "out.npz"}
    write_motion(clip, out, clip.q)
    assert read_motion(out, talos).exact


# Files of others: ../shared/data/SOURCES.md.


@pytest.mark.parametrize(
    ("name", "robot", "options", "accuracy"),
    [
        ("B_HandsUp.csv", "g1", {"fps": 60}, 1e-7),
        ("clips/G1_Take_102.bvh_60hz_23dof.csv", "g1", {"fps": 60}, 1e-7),
        ("clips/output_jumpjack.csv", "g1", {"fps": 30, "quat": "wxyz"}, 1e-14),
        ("cases/lie_side.csv", "g1", {"fps": 50, "quat": "xyzw"}, 1e-14),
        ("cases/full.csv", "cases/zdown.urdf", {}, 1e-7),
        ("cases/drop_t.npz", "talos", {}, 1e-14),
        ("cases/stairs.npz", "talos", {}, 1e-14),
        ("forces/sim_walk.npz", "forces/sim_biped.yaml", {}, 1e-14),
        ("forces/s4_walk.npz", "forces/s4.yaml", {}, 3e-7),
        ("B_HandsUp.npz", "g1", {}, 3e-7),
        ("sub3_largebox_003_mj.npz", "g1", {}, 1e-14),
        ("squat_level1.pkl", "g1", {"trust": True}, 3e-7),
        ("clips/airkick_stand.pkl", "g1", {}, 3e-7),
        ("clips/accad_A3___Swing_t2.pkl", "g1", {}, 3e-7),
        ("clips/0807_yanjie_walk_008.pkl", "g1", {}, 1e-14),
    ],
)
def test_files_of_others(tmp_path, shared_data, name, robot, options, accuracy):
    if robot.endswith(".urdf"):
        contacts = [
            f"{side}_sole:6d:half_length=0.1,half_width=0.05,mu=0.7,gu=0.05" for side in "lr"
        ]
        robot = dynacom.make_robot(shared_data / robot, contacts)
    else:
        robot = dynacom.load_robot(shared_data / robot if "/" in robot else robot)
    clip = read_motion(shared_data / name, robot, **options)
    q = moved(robot, clip)
    out, same = tmp_path / Path(name).name, tmp_path / f"same_{Path(name).name}"
    notes = write_motion(clip, out, q)
    found = read_motion(out, robot, **options)
    rows = frames_of(clip)
    assert_array_equal(found.time, clip.time)
    assert found.joint_names == clip.joint_names
    assert_allclose(found.q[rows], q[rows], rtol=0, atol=accuracy)
    assert np.abs(q - clip.q).max() > 5e-3
    write_motion(clip, same, clip.q)
    again = read_motion(same, robot, **options)
    assert_array_equal(again.q, clip.q)
    assert again.notes == clip.notes
    assert not any("left out" in note for note in notes)
    offsets = [body_offsets(robot, *read) for read in ((clip, clip.path), (found, out))]
    assert_allclose(offsets[1], offsets[0], rtol=0, atol=3e-6)
    if name.startswith("clips/") and name.endswith(".pkl"):
        assert len(offsets[0]) and np.abs(offsets[0]).max() < 3e-6


def body_offsets(robot: Robot, clip: Clip, path: Path) -> np.ndarray:
    """Where a file has bodies, in the frames of Pinocchio's links; empty if it has none.

    Without names each link has the body that is closest to it. Links of other revisions are
    elsewhere by as much as ever; others are there up to the precision that the files have.
    """
    content = {}
    if path.suffix == ".npz":
        content = dict(np.load(path))
    elif "squat" not in path.name and path.suffix == ".pkl":
        content = pickle.loads(path.read_bytes())
    keys = [("body_names", "body_pos_w"), ("link_body_list", "local_body_pos")]
    names, position = next(
        ((content.get(of), content[where]) for of, where in keys if where in content), (None, None)
    )
    if position is None:
        return np.empty(0)
    model, data, q = robot.model, robot.model.createData(), clip.q.copy()
    if "local_body_pos" in content:
        q[:, :7] = 0, 0, 0, 0, 0, 0, 1
    offsets = []
    for row in range(0, len(q), 20):
        pin.framesForwardKinematics(model, data, q[row])
        if names is None:
            poses = [data.oMi[joint] for joint in range(1, model.njoints)]
            away = [position[row] - pose.translation for pose in poses]
            offsets += [each[np.argmin(np.linalg.norm(each, axis=1))] for each in away]
        else:
            for body, name in enumerate(names):
                if model.existFrame(name, pin.FrameType.BODY):
                    pose = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
                    offsets.append(pose.actInv(position[row, body].astype(float)))
    return np.array(offsets)
