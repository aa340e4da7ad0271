# SPDX-License-Identifier: BSD-2-Clause
"""Contacts found by what a motion needs, of motions that are known by construction: puppet.py."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import AnalysisOptions, ContactSchedule, MotionReport
from dynacom.robots import Robot
from dynacom.terrain import _level_texts, _slope_texts
from helpers import CORNERS
from puppet import FEET, Play, hops, make_puppet, stand, walk

NEVER = np.inf


@pytest.fixture(scope="module")
def puppet(tmp_path_factory) -> Robot:
    return make_puppet(tmp_path_factory.mktemp("puppet"))


def judge(puppet: Robot, play: Play, yaw: float = 0.0, **arguments: object) -> MotionReport:
    return dynacom.analyze(play.clip(yaw), puppet, sensitivity=False, **arguments)


def active(report: MotionReport) -> dict[str, np.ndarray]:
    return dict(zip(report.schedule.names, np.asarray(report.schedule.active).T, strict=True))


def changes(values: np.ndarray) -> np.ndarray:
    """The last frame before each change."""
    return np.flatnonzero(np.diff(values.astype(int)))


def change_times(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Each halfway between two frames."""
    before = changes(values)
    return 0.5 * (time[before] + time[before + 1])


def assert_as_planned(report: MotionReport, play: Play, seconds: float) -> None:
    """The same changes, each within so long."""
    assert list(active(report)) == list(FEET)
    for name, found in active(report).items():
        planned = play.active[name]
        assert found[0] == planned[0]
        times = [change_times(play.time, values) for values in (found, planned)]
        assert len(times[0]) == len(times[1]), name
        assert_allclose(*times, rtol=0, atol=seconds + 1e-9, err_msg=name)


def notes(report: MotionReport) -> str:
    return "\n".join(report.summary["notes"])


# Walks.


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0])
def test_a_walk(puppet, rate):
    """Swings of half a second, each found within a frame."""
    play = walk(rate=rate)
    assert sum(len(changes(values)) for values in play.active.values()) == 12
    report = judge(puppet, play)
    assert_as_planned(report, play, 1.0 / rate)
    assert report.summary["verdict"] == "feasible"
    assert set(report.summary["ground"].values()) == {0.0}


def test_standing_before_and_after_changes_nothing(puppet):
    play = walk()
    alone = judge(puppet, play)
    with_standing = judge(puppet, play.with_standing(60.0))
    count = (len(with_standing.motion.time) - len(play.time)) // 2
    for name, expected in active(alone).items():
        found = active(with_standing)[name]
        assert_array_equal(found[count:-count], expected)
        assert found[:count].all() and found[-count:].all()


def test_a_mirror(puppet):
    play = walk()
    one, other = active(judge(puppet, play)), active(judge(puppet, play.mirrored()))
    assert_array_equal(one["left"], other["right"])
    assert_array_equal(one["right"], other["left"])
    assert not np.array_equal(one["left"], one["right"])


@pytest.mark.parametrize("yaw", [0.5, -2.0, np.pi])
def test_where_it_goes_does_not_matter(puppet, yaw):
    play = walk()
    one, other = judge(puppet, play), judge(puppet, play, yaw)
    assert_array_equal(one.schedule.active, other.schedule.active)
    assert_allclose(one.schedule.confidence, other.schedule.confidence, rtol=0, atol=1e-3)


@pytest.mark.parametrize("velocity", [(-1.0, 0.0), (0.6, -0.8)])
def test_a_treadmill(puppet, velocity):
    """Whose velocity is found, or told: either way it is the same walk."""
    play = walk(steps=10)
    belt = np.array([*velocity, 0.0])
    moved = play.moved(-belt)
    options = AnalysisOptions()
    options.detection.ground_velocity = belt
    for report in (judge(puppet, moved), judge(puppet, moved, options=options)):
        assert_as_planned(report, play, 1.0 / 120.0)
        assert_allclose(report.summary["ground_velocity"], belt, rtol=0, atol=0.01)
        assert report.summary["verdict"] == "feasible"
        assert "a treadmill" in notes(report)
        speed = report["contact.left.speed"][active(report)["left"]]  # as the belt sees it
        assert np.median(speed) < 0.02
    assert "treadmill" not in notes(judge(puppet, play))


def test_stairs(puppet):
    play = walk(rise=lambda x: 0.15 * round(x / 0.25), clearance=0.1)
    report = judge(puppet, play)
    assert_as_planned(report, play, 1.0 / 120.0)
    assert report.summary["verdict"] == "feasible", report.summary["codes"]
    assert "left stands at 0.00, 0.15, 0.45 and 0.75 m" in notes(report)
    assert (
        "right stands at 0.00, 0.30, 0.60 and 0.75 m: steps or stairs, or feet that float."
        in notes(report)
    )


def test_stairs_down(puppet):
    play = walk(rise=lambda x: -0.12 * round(x / 0.25))
    report = judge(puppet, play)
    assert_as_planned(report, play, 2.0 / 120.0)
    assert report.summary["verdict"] == "feasible", report.summary["codes"]
    assert "steps or stairs" in notes(report)


@pytest.mark.parametrize("end", [2.9, np.inf])
def test_soles_that_stay_level_show_no_slope(puppet, end):
    """They stand as on stairs."""
    rise = np.tan(np.radians(3.0))
    play = walk(rise=lambda x: rise * (np.clip(x, 0.6, end) - 0.6), steps=16)
    report = judge(puppet, play)
    assert_as_planned(report, play, 1.0 / 120.0)
    assert report.summary["verdict"] == "feasible", report.summary["codes"]
    assert not any(stance.slope.any() for stance in report.examination.inference.stances)
    assert "slope" not in notes(report).lower()


def test_slopes_that_some_stances_are_on():
    def contact(name, slopes, levels):
        return SimpleNamespace(name=name, slopes=list(np.radians(slopes)), levels=levels)

    def said(*contacts):
        terrain = SimpleNamespace(contacts=contacts, lowest=0.0)
        found = SimpleNamespace(terrain=terrain, inference=SimpleNamespace(slope=np.zeros(2)))
        return [*_slope_texts(found), *_level_texts(terrain, {"left": 0.0})]

    assert said(contact("left", [], [0.0])) == ["Height of the ground: left 0.000 m."]
    assert said(contact("left", [3.0], [0.0]), contact("right", [2.94, 8.0], [0.0])) == [
        "Slopes are stood on, by left on 3.0 degrees; by right on 2.9 and 8.0 degrees. Where else "
        "they stand, the ground is taken for level."
    ]
    slopes, steps = said(contact("left", [2.0, 4.0, 6.0, 8.0, 10.0], [0.0, 0.15]))
    assert "left on 2.0 to 10.0 degrees" in slopes
    assert steps == "left stands at 0.00 and 0.15 m: steps or stairs, or feet that float."


# Jumps.


def test_hops_do_not_depend_on_the_rate(puppet):
    """What is seen at 30 frames a second is what is seen at 500, within a frame of the slower."""
    rates = (30.0, 60.0, 120.0, 500.0)
    found = {}
    for rate in rates:
        play = hops(rate=rate)
        report = judge(puppet, play)
        assert report.summary["verdict"] == "feasible", report.summary["codes"]
        assert_as_planned(report, play, 1.0 / rate)
        found[rate] = play.time, active(report)
    for slower in rates:
        for faster in rates:
            if faster <= slower:
                continue
            (time, expected), (fine, seen) = found[slower], found[faster]
            nearest = np.abs(fine - time[:, None]).argmin(axis=1)
            for name in FEET:
                difference = changes(seen[name][nearest]) - changes(expected[name])
                assert np.abs(difference).max() <= 1, (slower, faster)


# What does not carry.


@pytest.mark.parametrize("lift", [0.02, 0.05, 0.2])
def test_a_foot_held_still_in_the_air_never_carries(puppet, lift):
    report = judge(puppet, stand(lifted=(-NEVER, NEVER), lift=lift))
    assert active(report)["left"].all()
    assert not active(report)["right"].any()
    assert report.schedule.confidence[:, 1].max() == 0.0
    assert report.summary["ground"] == {"left": 0.0, "right": None}
    assert f"right rests {100 * lift:.0f} cm up" in notes(report)
    assert report.summary["verdict"] == "feasible"


def test_a_box_that_a_schedule_tells_of(puppet):
    """The foot that is held 5 cm up carries, and stands there."""
    play = stand(lifted=(-NEVER, NEVER), lift=0.05)
    schedule = ContactSchedule(list(FEET), np.ones((len(play.time), 2), dtype=bool))
    report = judge(puppet, play, schedule=schedule)
    assert active(report)["right"].all()
    assert report.summary["verdict"] == "feasible"
    assert report.summary["ground"] == {"left": 0.0, "right": pytest.approx(0.05)}
    assert "rest" not in notes(report)
    assert not report.examination.terrain.held


def test_names_that_begin_alike(tmp_path):
    """A schedule is that of the contact that it names."""
    folder = tmp_path
    make_puppet(folder)
    text = (folder / "puppet.yaml").read_text()
    text = text.replace("name: left", "name: sole.left").replace("name: right", "name: sole")
    (folder / "puppet.yaml").write_text(text)
    robot = dynacom.load_robot(folder / "puppet.yaml")
    play = stand(lifted=(-NEVER, NEVER))
    for row, name in enumerate(robot.contacts):
        masks = np.zeros((len(play.time), 2), dtype=bool)
        masks[:, row] = True
        report = judge(robot, play, schedule=ContactSchedule(list(robot.contacts), masks))
        for other, found in active(report).items():
            assert found.all() == found.any() == (other == name)


@pytest.mark.parametrize("lift", [0.03, 0.1])
def test_a_foot_that_is_lifted_for_a_while(puppet, lift):
    """It leaves and comes back; while it is held in the air it carries nothing."""
    report = judge(puppet, stand(lifted=(1.5, 3.0), lift=lift))
    right = active(report)["right"]
    assert len(changes(right)) == 2
    assert not right[150:301].any()
    assert right[:110].all() and right[341:].all()
    assert active(report)["left"].all()
    assert f"right rests {100 * lift:.0f} cm up" in notes(report)


def test_who_leans_out_beside_a_raised_foot_is_not_feasible(puppet):
    """The raised foot would help, but the ground does not reach up to it."""
    play = stand(lifted=(-NEVER, NEVER))
    # The centre of pressure that is needed lies 5 cm beyond the left sole's right edge.
    leaning = replace(play, body=play.body - [0.0, 0.1, 0.0])
    report = judge(puppet, leaning)
    assert not active(report)["right"].any()
    assert "cop_outside" in report.summary["codes"]
    finding = report.verdict.findings["cop_outside"]
    assert_allclose(finding.measured[5:-5], 0.05, rtol=0, atol=1e-6)


@pytest.mark.parametrize("speed", [0.2, 0.5])
def test_sliding_while_loaded(puppet, speed):
    """The left foot carries all, and so is in contact, however it moves: the fault is that."""
    report = judge(puppet, stand(lifted=(1.0, 3.0), slide=speed))
    assert active(report)["left"].all()
    assert not active(report)["right"][120:280].any()
    assert "foot_sliding" in report.summary["codes"]
    if speed < 0.25:  # else not all corners are found, which would carry
        assert report.summary["codes"] == ["foot_sliding"]
    finding = report.verdict.findings["foot_sliding"]
    assert finding.subject.startswith("left")
    # So far within 2 s, of which 15/8 is the greatest speed of a smooth way.
    assert finding.worst == pytest.approx(speed * 15.0 / 8.0, rel=0.01)


# Schedules and grounds that are given.


def test_a_schedule_that_is_given_is_kept(puppet):
    """Only which corners carry is found; that the motion needs something else is noted."""
    play = walk()
    planned = np.stack([play.active[name] for name in FEET], 1)
    report = judge(puppet, play, schedule=ContactSchedule(list(FEET), planned))
    assert_array_equal(report.schedule.active, planned)
    assert_array_equal(report.schedule.confidence, planned.astype(float))
    assert "differ" not in notes(report)

    wrong = planned.copy()
    wrong[:200, 1] = False
    report = judge(puppet, play, schedule=ContactSchedule(list(FEET), wrong))
    assert_array_equal(report.schedule.active, wrong)
    share = (wrong != planned)[:, 1].mean()
    assert f"right in {share:.0%} of the frames" in notes(report)
    for name, values in zip(FEET, wrong.T, strict=True):
        parts = [report[f"contact.{name}.{corner}.active"] for corner in CORNERS]
        assert_array_equal(np.any(parts, axis=0), values)


def test_how_sure_a_schedule_is_stays(puppet):
    play = stand(seconds=1.0)
    masks = np.tile([0.75, 1.0], (len(play.time), 1))
    given = ContactSchedule(list(FEET), masks >= 0.5, masks)
    report = judge(puppet, play, schedule=given)
    assert_array_equal(report.schedule.confidence, masks)
    assert_array_equal(report["contact.left.confidence"], masks[:, 0])


def test_a_height_that_is_given(puppet):
    """Feet that rest 5 cm above it carry nothing; those that rest on it do."""
    options = AnalysisOptions()
    options.detection.ground_height = 0.0
    report = judge(puppet, walk(), options=options)
    assert report.summary["ground"] == {"left": 0.0, "right": 0.0}
    assert report.summary["verdict"] == "feasible"
    options.detection.ground_height = -0.05
    report = judge(puppet, walk(), options=options)
    assert_allclose(report["contact.left.height"].min(), 0.05, rtol=0, atol=1e-9)
    for name in FEET:
        assert not report[f"contact.{name}.active"].any()
    assert report.summary["verdict"] == "not feasible"


# Parts.


def test_corners_are_those_that_touch(puppet):
    """A centre of pressure far forward is carried by the front corners; the sole is one contact."""
    play = stand()
    forward = replace(play, body=play.body + [0.09, 0.0, 0.0])
    report = judge(puppet, forward)
    assert report.summary["verdict"] == "feasible"
    for name in FEET:
        parts = {corner: report[f"contact.{name}.{corner}.active"] for corner in CORNERS}
        assert parts["front_left"].all() and parts["front_right"].all()
        assert_array_equal(report[f"contact.{name}.active"], np.any([*parts.values()], axis=0))
        assert_allclose(report[f"contact.{name}.cop"][:, 0], 0.09, rtol=0, atol=1e-6)
    total = sum(report[f"contact.{name}.force"] for name in FEET)
    assert_allclose(total, np.tile([0, 0, 30 * 9.81], (len(total), 1)), rtol=0, atol=1e-6)


def test_confidence_is_low_where_the_schedule_changes(puppet):
    play = walk()
    report = judge(puppet, play)
    for index, name in enumerate(FEET):
        confidence = report.schedule.confidence[:, index]
        assert_array_equal(confidence, report[f"contact.{name}.confidence"])
        assert confidence.min() >= 0.0 and confidence.max() <= 1.0
        far = np.ones(len(confidence), dtype=bool)
        for frame in changes(play.active[name]):
            far[max(0, frame - 12) : frame + 13] = False
        planned = play.active[name][far]
        assert confidence[far][planned].min() > 0.9
        assert confidence[far][~planned].max() < 0.1
