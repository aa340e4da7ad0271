# SPDX-License-Identifier: BSD-2-Clause
"""What touches the ground besides the feet: motions are made so that it is known what carries."""

import copy
import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow
import pytest
from scipy.optimize import linprog

import dynacom
from dynacom.analysis_options import AnalysisOptions
from dynacom.batch_row import Job
from dynacom.motion_file import Clip
from dynacom.robots import make_robot

RATE = 100.0
SHANK, THIGH, TRUNK = 0.4, 0.4, 0.5
UPPER_ARM, FOREARM = 0.3, 0.3
ANKLE_HEIGHT, KNEE_RADIUS, HAND_RADIUS = 0.06, 0.05, 0.04
HALF_LENGTH, HALF_WIDTH, SOLE_FORWARD = 0.1, 0.04, 0.05
SOLE = f"half_length={HALF_LENGTH},half_width={HALF_WIDTH},mu=0.7,gu=0.05"


def _link(name: str, mass: float, com: str, geometry: str, origin: str) -> str:
    collision = f"<collision><origin xyz='{origin}'/><geometry>{geometry}</geometry></collision>"
    return (
        f"<link name='{name}'><inertial><origin xyz='{com}'/><mass value='{mass}'/>"
        "<inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
        f"{collision if geometry else ''}</link>"
    )


def _joint(parent: str, child: str, origin: str, kind: str = "revolute") -> str:
    limits = "<axis xyz='0 1 0'/><limit lower='-4' upper='4' effort='100' velocity='20'/>"
    return (
        f"<joint name='{child}_joint' type='{kind}'><parent link='{parent}'/>"
        f"<child link='{child}'/><origin xyz='{origin}'/>{'' if kind == 'fixed' else limits}"
        "</joint>"
    )


def _urdf() -> str:
    parts = [_link("trunk", 12, f"0 0 {TRUNK / 2}", f"<box size='0.2 0.24 {TRUNK}'/>", "0 0 0.25")]
    for side, y in (("left", 0.1), ("right", -0.1)):
        ball, foot = f"<sphere radius='{KNEE_RADIUS}'/>", "<box size='0.2 0.08 0.06'/>"
        parts += [
            _link(f"{side}_thigh", 1.5, f"0 0 {-THIGH / 2}", "", ""),
            _joint("trunk", f"{side}_thigh", f"0 {y} 0"),
            _link(f"{side}_shank", 0.8, f"0 0 {-SHANK / 2}", ball, "0 0 0"),
            _joint(f"{side}_thigh", f"{side}_shank", f"0 0 {-THIGH}"),
            _link(f"{side}_foot", 0.4, "0.03 0 -0.03", foot, f"{SOLE_FORWARD} 0 -0.03"),
            _joint(f"{side}_shank", f"{side}_foot", f"0 0 {-SHANK}"),
            _link(f"{side}_sole", 0.01, "0 0 0", "", ""),
            _joint(f"{side}_foot", f"{side}_sole", f"{SOLE_FORWARD} 0 {-ANKLE_HEIGHT}", "fixed"),
            _link(f"{side}_arm", 0.5, f"0 0 {-UPPER_ARM / 2}", "", ""),
            _joint("trunk", f"{side}_arm", f"0 {2 * y} {TRUNK}"),
            _link(
                f"{side}_hand",
                0.4,
                f"0 0 {-FOREARM / 2}",
                f"<sphere radius='{HAND_RADIUS}'/>",
                f"0 0 {-FOREARM}",
            ),
            _joint(f"{side}_arm", f"{side}_hand", f"0 0 {-UPPER_ARM}"),
        ]
    return f"<robot name='toy'>{''.join(parts)}</robot>"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("toy") / "toy.urdf"
    path.write_text(_urdf())
    return make_robot(path, [f"{side}_sole:6d:{SOLE}" for side in ("left", "right")])


def _configuration(robot, x, z, trunk, thigh, shank, foot, arm, forearm):
    """Of the hip's place, and of how far each link is pitched forward from upright [rad]."""
    q = robot.default.copy()
    q[:3] = x, 0.0, z
    q[3:7] = 0.0, np.sin(trunk / 2), 0.0, np.cos(trunk / 2)
    angles = {
        "thigh": thigh - trunk,
        "shank": shank - thigh,
        "foot": foot - shank,
        "arm": arm - trunk,
        "hand": forearm - arm,
    }
    for side in ("left", "right"):
        for name, angle in angles.items():
            joint = robot.model.getJointId(f"{side}_{name}_joint")
            q[robot.model.idx_qs[joint]] = angle
    return q


def _com(robot, q):
    return pin.centerOfMass(robot.model, robot.model.createData(), q)


def _clip(robot, q):
    q = np.asarray(q)
    time = np.arange(len(q)) / RATE
    error = np.zeros(len(q))
    names = robot.joints.names
    return Clip(Path("made.npz"), time, q, None, None, names, None, {}, error, ())


def _ease(s):
    """From 0 to 1 with speed and acceleration zero at both ends."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def _kneel(robot):
    """Crouches until the knees touch, comes forward over them, and gets up again.

    Returns:
        q (T, nq); height of the knees' lowest points (T,); whether the CoM is beyond the toes (T,).
    """
    upright = 0.3
    down = np.arccos((KNEE_RADIUS - ANKLE_HEIGHT) / SHANK)
    time = np.arange(0.0, 9.0, 1.0 / RATE)
    shanks = upright + (down - upright) * (_ease((time - 0.5) / 2) - _ease((time - 6.5) / 2))
    targets = 0.12 + 0.18 * (_ease((time - 3.0) / 1.0) - _ease((time - 5.0) / 1.0))
    frames, knees, beyond = [], [], []
    for shank, target in zip(shanks, targets, strict=True):
        knee = np.array([np.sin(shank), np.cos(shank)]) * SHANK + [0.0, ANKLE_HEIGHT]

        def pose(thigh, knee=knee, shank=shank):
            hip = knee + THIGH * np.array([np.sin(thigh), np.cos(thigh)])
            return _configuration(robot, *hip, 0.2, thigh, shank, 0.0, 2.5, 2.5)

        low, high = -1.5, 0.7
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _com(robot, pose(middle))[0] < target else (low, middle)
        frames.append(pose(low))
        knees.append(knee[1] - KNEE_RADIUS)
        beyond.append(target > SOLE_FORWARD + HALF_LENGTH + 0.02)
    return np.array(frames), np.array(knees), np.array(beyond)


def _push_up(robot):
    """On the hands and the front edges of the soles, which stand upright."""
    time = np.arange(0.0, 4.0, 1.0 / RATE)
    length = SHANK + THIGH + TRUNK
    toe_to_ankle = SOLE_FORWARD + HALF_LENGTH  # the foot points down
    frames = []
    for angle in 0.16 + 0.08 * np.cos(2.0 * np.pi * 0.5 * time):
        # Along the body, from the ankles up; the ankles are above the toes.
        along = np.array([np.cos(angle), np.sin(angle)])
        ankle = np.array([-ANKLE_HEIGHT, toe_to_ankle])
        hip = ankle + (SHANK + THIGH) * along
        shoulder = ankle + length * along
        hand = np.array([1.2, HAND_RADIUS])
        reach = hand - shoulder
        distance = np.linalg.norm(reach)
        # Both halves of the arm are as long.
        bend = np.arccos(distance / (UPPER_ARM + FOREARM))
        direction = np.arctan2(-reach[0], -reach[1])
        body = np.pi / 2 - angle
        frames.append(
            _configuration(
                robot, *hip, body, body, body, np.pi / 2, direction + bend, direction - bend
            )
        )
    return np.array(frames)


def _sit(robot):
    """On the edge of a box, two seconds: thighs level, the CoM far behind the feet."""
    q = _configuration(robot, -THIGH, ANKLE_HEIGHT + SHANK, 0.0, -np.pi / 2, 0.0, 0.0, 2.5, 2.5)
    return np.tile(q, (200, 1))


def _lie(robot):
    """On the back, for two seconds: on the corners of the trunk, with the limbs held up."""
    q = _configuration(robot, 0.0, 0.1, -np.pi / 2, *[-np.pi] * 5)
    return np.tile(q, (200, 1))


def test_postures_are_what_they_say(robot):
    """The makers of motions against Pinocchio's kinematics."""
    data = robot.model.createData()

    def height(q, frame):
        pin.framesForwardKinematics(robot.model, data, q)
        return data.oMf[robot.model.getFrameId(frame)].translation[2]

    frames, knees, _ = _kneel(robot)
    for q, knee in zip(frames[::100], knees[::100], strict=True):
        assert height(q, "left_sole") == pytest.approx(0.0, abs=1e-12)
        assert height(q, "left_shank") == pytest.approx(knee + KNEE_RADIUS)
    for q in _push_up(robot)[::50]:
        pin.framesForwardKinematics(robot.model, data, q)
        hand = data.oMf[robot.model.getFrameId("left_hand")] * pin.SE3(
            np.eye(3), np.array([0.0, 0.0, -FOREARM])
        )
        np.testing.assert_allclose(hand.translation[[0, 2]], [1.2, HAND_RADIUS], atol=1e-12)
        toe = data.oMf[robot.model.getFrameId("left_sole")] * pin.SE3(
            np.eye(3), np.array([HALF_LENGTH, 0.0, 0.0])
        )
        assert toe.translation[2] == pytest.approx(0.0, abs=1e-12)


def test_kneels_and_gets_up(robot):
    frames, knees, beyond = _kneel(robot)
    report = dynacom.analyze(_clip(robot, frames), robot)
    assert report.summary["verdict"] == "feasible", report.summary["reasons"]
    assert set(report.summary["bodies"]) == {"left_shank", "right_shank"}
    for side in ("left", "right"):
        active = report[f"body.{side}_shank.active"]
        assert active[beyond].all()
        assert not active[knees > 0.01].any()
        assert report[f"contact.{side}_sole.active"].all()
        # They push up, where the knees are.
        force = report[f"body.{side}_shank.force"]
        assert (force[beyond, 2] > 0.1 * 9.81 * report.summary["mass"]).all()
        assert (force[~active] == 0.0).all()
        place = report[f"body.{side}_shank.position"][beyond]
        np.testing.assert_allclose(place[:, 2], 0.0, atol=0.01)
        np.testing.assert_allclose(place[:, 0], SHANK, atol=0.01)
    total = sum(report[f"body.{side}_shank.force"] for side in ("left", "right"))
    total = total + sum(report[f"contact.{side}_sole.force"] for side in ("left", "right"))
    np.testing.assert_allclose(total, report["ground_force"], atol=1e-3 * total.max())
    assert any("left_shank and right_shank carry" in note for note in report.summary["notes"])
    columns = report.columns()
    assert {"body.left_shank.active", "body.left_shank.position_z"} <= columns.keys()


def test_for_how_long_it_stood_before_does_not_matter(robot):
    """As links do that carry for half a second, in a minute."""
    frames = _kneel(robot)[0]
    standing = np.repeat(frames[:1], round(60 * RATE), axis=0)
    report = dynacom.analyze(_clip(robot, np.concatenate([standing, frames])), robot)
    assert set(report.summary["bodies"]) == {"left_shank", "right_shank"}
    assert report.summary["verdict"] == "feasible", report.summary["reasons"]


def test_feet_only(robot):
    options = AnalysisOptions(feet_only=True)
    report = dynacom.analyze(_clip(robot, _kneel(robot)[0]), robot, options=options)
    assert report.summary["verdict"] == "not feasible"
    assert report.summary["bodies"] == {}
    assert not any(name.startswith("body.") for name in report.columns())


def test_push_up(robot):
    report = dynacom.analyze(_clip(robot, _push_up(robot)), robot)
    assert report.summary["verdict"] == "feasible", report.summary["reasons"]
    assert set(report.summary["bodies"]) == {"left_hand", "right_hand"}
    for side in ("left", "right"):
        assert report[f"body.{side}_hand.active"].all()
        assert report[f"contact.{side}_sole.front_left.active"].all()
        assert not report[f"contact.{side}_sole.rear_left.active"].any()
        assert report.summary["bodies"][f"{side}_hand"]["weight_share"] > 0.2


def test_lies_on_its_back(robot):
    report = dynacom.analyze(_clip(robot, _lie(robot)), robot)
    assert report.summary["verdict"] == "feasible", report.summary["reasons"]
    assert set(report.summary["bodies"]) == {"trunk"}
    trunk = report.summary["bodies"]["trunk"]
    assert trunk["active_share"] == 1.0
    assert trunk["weight_share"] == pytest.approx(1.0, abs=1e-6)
    place = report["body.trunk.position"]
    np.testing.assert_allclose(place[:, :2], report["com"][:, :2], atol=1e-6)


def _seat_shares(com):
    """Of the weight: the least and the most that a seat under the trunk can bear, with feet."""
    points = [
        (forward, side + across, 0.0)
        for side in (0.1, -0.1)
        for forward in (SOLE_FORWARD - HALF_LENGTH, SOLE_FORWARD + HALF_LENGTH)
        for across in (-HALF_WIDTH, HALF_WIDTH)
    ]
    feet = len(points)
    height = ANKLE_HEIGHT + SHANK
    points += [(-THIGH + x, y, height) for x in (-0.1, 0.1) for y in (-0.12, 0.12)]
    count = len(points)
    balance = np.zeros((6, 3 * count))
    friction = []
    for k, point in enumerate(points):
        own = slice(3 * k, 3 * k + 3)
        balance[:3, own] = np.eye(3)
        balance[3:, own] = pin.skew(np.array(point) - com)
        for axis in (0, 1):
            for sign in (-1.0, 1.0):
                row = np.zeros(3 * count)
                row[3 * k + axis], row[3 * k + 2] = sign, -0.7
                friction.append(row)
    seat = np.zeros(3 * count)
    seat[3 * feet + 2 :: 3] = 1.0
    wrench = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return [
        sign
        * linprog(
            sign * seat,
            A_ub=np.array(friction),
            b_ub=np.zeros(len(friction)),
            A_eq=balance,
            b_eq=wrench,
            bounds=(None, None),
        ).fun
        for sign in (1.0, -1.0)
    ]


def test_sits(robot):
    """Nothing is known of the seat: what it would carry is said, and counts nowhere."""
    frames = _sit(robot)
    report = dynacom.analyze(_clip(robot, frames), robot)
    summary = report.summary
    assert summary["verdict"] == "not feasible"
    assert summary["bodies"] == {}
    (seat,) = summary["seats"]
    assert seat["link"] == "trunk"
    assert (seat["begin"], seat["end"]) == (0.0, 1.99)
    assert seat["height"] == pytest.approx(ANKLE_HEIGHT + SHANK)
    least, most = _seat_shares(_com(robot, frames[0]))
    assert 0.3 < least - 0.01 <= seat["weight_share"] <= most + 0.01
    notes = summary["notes"]
    text = f"trunk would have to carry {seat['weight_share']:.0%} of the weight at 0.46 m from 0.00"
    assert any(note.startswith(text) for note in notes)
    assert any(
        "Either there is a seat" in note and "in 200 of 200 frames" in note for note in notes
    )
    assert not any("load" in note for note in notes)
    assert not any(name.startswith("body.") for name in report.columns())


def test_a_seat_at_few_frames_a_second(robot):
    """No two of which are as close as what a short interruption lasts."""
    step = round(RATE / 4)
    clip = _clip(robot, _sit(robot)[::step])
    clip = replace(clip, time=clip.time * step)
    (seat,) = dynacom.analyze(clip, robot).summary["seats"]
    assert seat["link"] == "trunk"


def test_a_seat_that_is_told_of(robot):
    """As the note says: a contact on the link, and a schedule."""
    names = [*robot.contacts, "trunk"]
    seated = make_robot(
        robot.urdf,
        [f"{side}_sole:6d:{SOLE}" for side in ("left", "right")]
        + ["trunk:6d:half_length=0.1,half_width=0.12,mu=0.7,gu=0.05"],
    )
    frames = _sit(seated)
    schedule = dynacom.ContactSchedule(names, np.ones((len(frames), 3), dtype=bool))
    report = dynacom.analyze(_clip(seated, frames), seated, schedule=schedule)
    assert report.summary["verdict"] == "feasible", report.summary["reasons"]
    assert report.summary["seats"] == []
    assert report.summary["contact_missing"] is None


def test_what_moves_sits_nowhere(robot):
    """The same posture, to and fro by 10 cm."""
    frames = _sit(robot)
    frames[:, 0] += 0.1 * np.sin(np.pi * np.arange(len(frames)) / RATE)
    report = dynacom.analyze(_clip(robot, frames), robot)
    assert report.summary["verdict"] == "not feasible"
    assert report.summary["seats"] == []
    assert any(
        "Either something carries that is not known" in note for note in report.summary["notes"]
    )


def test_rows_of_a_batch_have_bodies_and_seats(robot, root, tmp_path):
    made = {"kneel": _kneel(robot)[0], "sit": _sit(robot)}
    for name, q in made.items():
        np.savez(tmp_path / f"{name}.npz", t=np.arange(len(q)) / RATE, q=q)
    table = dynacom.batch(tmp_path, robot, out=tmp_path / "out", frames=True).to_pylist()
    for row, name in zip(table, made, strict=True):
        summary = dynacom.analyze(tmp_path / f"{name}.npz", robot).summary
        bodies = {body.pop("link"): body for body in row["bodies"]}
        assert bodies == summary["bodies"]
        assert row["seats"] == summary["seats"]
    assert [bool(row["bodies"]) for row in table] == [True, False]
    assert [bool(row["seats"]) for row in table] == [False, True]
    # All tables of frames at once, as the manual has it.
    text = (root / "docs" / "batch.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"### Tables of frames.*?```python\n(.*?)```", text, re.DOTALL)
    names: dict = {"pyarrow": pyarrow}
    exec(code.replace("DIR", str(tmp_path / "out")), names)
    assert names["table"].num_rows == sum(row["frames"] for row in table)
    forces = names["table"]["body.left_shank.force_z"].to_numpy()
    assert np.nanmax(forces) > 0.1 * 9.81 * table[0]["mass"]
    assert np.isnan(forces).sum() == table[1]["frames"]


def test_standing_needs_nothing_else(robot):
    """Nor is anything else looked at where the feet suffice."""
    frames, _, beyond = _kneel(robot)
    first = int(np.argmax(beyond))
    report = dynacom.analyze(_clip(robot, frames[: first - 100]), robot)
    assert report.summary["bodies"] == {}
    assert len(report.examination.parts) == 8


def test_walks_have_no_bodies(shared_data, talos):
    report = dynacom.analyze(shared_data / "cases" / "slope3.npz", talos, sensitivity=False)
    assert report.summary["bodies"] == {}


def test_workers_need_not_read_meshes(robot):
    job = pickle.loads(pickle.dumps(Job(robot, AnalysisOptions())))
    assert "collision_points" in vars(job.robot)
    pairs = zip(job.robot.collision_points.bodies, robot.collision_points.bodies, strict=True)
    for ours, theirs in pairs:
        assert (ours.link, ours.joint) == (theirs.link, theirs.joint)
        np.testing.assert_array_equal(ours.points, theirs.points)
        np.testing.assert_array_equal(copy.copy(ours).radius, theirs.radius)
    assert job.key() == Job(robot, AnalysisOptions()).key()
    feet = Job(robot, AnalysisOptions(feet_only=True))
    assert feet.key() != job.key()
    assert "collision_points" not in vars(pickle.loads(pickle.dumps(feet)).robot)


def test_a_given_order_is_believed(shared_data):
    """A robot may lie."""
    path = shared_data / "cases" / "lie_side.csv"
    report = dynacom.analyze(path, "g1", fps=50.0, quat="xyzw", sensitivity=False)
    assert any("turn its z axis to a height of" in note for note in report.summary["notes"])
    assert report.summary["bodies"]
    with pytest.raises(dynacom.DynacomError, match="give --quat wxyz"):
        dynacom.analyze(path, "g1", fps=50.0)
