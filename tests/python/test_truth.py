# SPDX-License-Identifier: BSD-2-Clause
"""What scripts/truth measures, of made-up contacts and forces whose errors are known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import truth_goals
import truth_metrics
import truth_page
import truth_robustness
import truth_scores
import truth_trials
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import dynacom
from helpers import WALKS
from motion_files import TOY_FILE, TOY_URDF

WEIGHT = 400.0  # m g [N]
STEP = 0.005
TIME = STEP * np.arange(600)


def standing(*loads: tuple[int, int, float]) -> np.ndarray:
    """A force: nothing, but in the frames from the first to the second a part of m g."""
    force = np.zeros(len(TIME))
    for first, end, load in loads:
        force[first:end] = load * WEIGHT
    return force


def truth_of(force: np.ndarray, touch: np.ndarray | None = None):

    return truth_metrics.true_contact(force, TIME, WEIGHT, touch)


def changes_of(force: np.ndarray, touch: np.ndarray | None = None) -> list[tuple[int, int, int]]:
    changes = truth_of(force, touch).changes
    return sorted((change.first, change.last, change.sign) for change in changes)


def errors_of(found: list[tuple[int, int]], force: np.ndarray, measured=None) -> list[float]:
    """In frames; `found` are runs of contact."""

    active = np.zeros(len(TIME), dtype=bool)
    for first, end in found:
        active[first:end] = True
    measured = np.ones(len(TIME), dtype=bool) if measured is None else measured
    errors = truth_metrics.change_errors(active, truth_of(force), TIME, measured)
    return [round(error / STEP, 6) for error in errors]


# ---- Contacts ----


@pytest.mark.parametrize(
    ("begins", "error"),
    [(200, 0), (205, 0), (210, 0), (214, 4), (197, 3), (259, 49), (150, np.inf)],
)
def test_a_change_may_be_anywhere_between_touch_and_load(begins, error):
    """Touched from frame 200 on, but loaded from 210 on."""
    force = standing((200, 210, 0.03), (210, 600, 0.5))
    assert changes_of(force) == [(200, 210, 1)]
    assert errors_of([(begins, 600)], force) == [error]


def test_an_end_is_between_load_and_the_last_touch():
    force = standing((0, 200, 0.5), (200, 210, 0.03))
    assert changes_of(force) == [(200, 210, -1)]
    assert errors_of([(0, 207)], force) == [0]
    assert errors_of([(0, 213)], force) == [3]


def test_touch_that_the_file_knows_of_counts():
    """A force that is too small for touch alone, and touch without any force."""
    force = standing((190, 200, 0.005), (200, 600, 0.5))
    assert changes_of(force) == [(200, 200, 1)]
    touch = np.zeros(len(TIME), dtype=bool)
    touch[185:190] = True
    assert changes_of(force, touch) == [(185, 200, 1)]


def test_a_bounce_is_no_change():
    """60 ms of load, then nothing for 50 ms, belong to the landing."""
    force = standing((200, 212, 0.8), (222, 600, 0.5))
    assert changes_of(force) == [(200, 222, 1)]
    assert errors_of([(200, 600)], force) == errors_of([(222, 600)], force) == [0]


def test_a_bounce_in_the_middle_is_neither_a_change_nor_made_up():

    force = standing((0, 100, 0.5), (200, 212, 0.8), (300, 600, 0.5))
    assert changes_of(force) == [(100, 100, -1), (300, 300, 1)]
    found = force > 0
    everywhere = np.ones(len(TIME), dtype=bool)
    assert errors_of([(0, 100), (200, 212), (300, 600)], force) == [0, 0]
    assert truth_metrics.wrong_frames(found, truth_of(force), TIME, everywhere)[2] == 0


@pytest.mark.parametrize("gap", [4, 18])
def test_gaps_that_are_too_short_are_none(gap):
    """20 ms are no gap of the load at all; 90 ms are one, but do not count."""
    force = standing((0, 300, 0.5), (300 + gap, 600, 0.5))
    truth = truth_of(force)
    assert not truth.changes and not truth.free.any()
    assert truth.loaded.all() == (gap == 4)


def test_an_unloaded_time_that_is_always_touched_does_not_count():
    assert not changes_of(standing((0, 300, 0.5), (300, 400, 0.03), (400, 600, 0.5)))


def test_a_change_that_was_found_is_used_once():
    """Two steps 0.2 s apart, of which only one is found: the other one was missed."""
    force = standing((100, 200, 0.5), (240, 340, 0.5))
    assert errors_of([(100, 200), (240, 340)], force) == [0, 0, 0, 0]
    assert sorted(errors_of([(100, 200)], force)) == [0, 0, np.inf, np.inf]
    assert errors_of([], force) == [np.inf] * 4


def test_what_is_not_measured_and_the_ends_are_left_out():
    force = standing((22, 100, 0.5), (200, 300, 0.5), (400, 578, 0.5))
    assert len(changes_of(force)) == 6
    assert errors_of([], force) == [np.inf] * 4  # not those 0.11 s from the ends
    measured = np.ones(len(TIME), dtype=bool)
    measured[190:350] = False
    assert errors_of([], force, measured) == [np.inf] * 2


def test_frames_that_are_lost_and_made_up():
    """Of those that are more than 8 frames, 0.04 s, from any other state."""

    force = standing((200, 400, 0.5))
    found = np.zeros(len(TIME), dtype=bool)
    found[100:110] = found[195:300] = True
    measured = np.ones(len(TIME), dtype=bool)
    measured[:50] = False
    wrong = truth_metrics.wrong_frames(found, truth_of(force), TIME, measured)
    assert wrong == (92, 184, 10, 142 + 192)


def test_changes_of_two_schedules():

    known = np.zeros((100, 2), dtype=bool)
    known[20:60, 0] = known[30:50, 1] = True
    found = known.copy()
    same = {"changes": 4, "moved": 0, "worst": 0, "gone": 0, "made_up": 0}
    assert truth_metrics.compare_changes(found, known, 2) == same

    found[20:22, 0], found[60:63, 0] = False, True
    assert truth_metrics.compare_changes(found, known, 2) == same | {"moved": 1, "worst": 3}
    found[:, 1] = False
    found[80:90, 0] = True
    wrong = {"changes": 4, "moved": 1, "worst": 3, "gone": 2, "made_up": 2}
    assert truth_metrics.compare_changes(found, known, 2) == wrong


# ---- Forces ----


EVERYWHERE = np.ones(len(TIME), dtype=bool)
SWAY = 500 + 200 * np.sin(2 * np.pi * TIME)


def test_force_error_of_a_scaled_and_of_a_shifted_force():

    inner = SWAY[21:-21]  # more than 0.1 s from the ends
    expected = 100 * 0.1 * np.sqrt(np.mean(inner**2)) / 400
    error = truth_metrics.force_error(1.1 * SWAY, SWAY, TIME, EVERYWHERE)
    assert error == pytest.approx(expected, rel=1e-3)
    error = truth_metrics.force_error(SWAY - 40, SWAY, TIME, EVERYWHERE)
    assert error == pytest.approx(10, rel=1e-3)


def test_force_error_knows_nothing_above_its_filter():
    """A ripple of 50 Hz, and the same at 2 Hz, which counts."""

    fast, slow = (40 * np.sin(2 * np.pi * rate * TIME) for rate in (50, 2))
    assert truth_metrics.force_error(SWAY + fast, SWAY, TIME, EVERYWHERE) < 0.1
    assert truth_metrics.force_error(SWAY + slow, SWAY, TIME, EVERYWHERE) > 6


def test_force_error_is_of_what_was_measured():
    """Whatever is elsewhere, even beside it, does not matter."""

    measured = EVERYWHERE.copy()
    measured[200:300] = measured[310:315] = False
    found = np.where(measured, SWAY - 40, 1e4)
    error = truth_metrics.force_error(found, SWAY, TIME, measured)
    assert error == pytest.approx(10, rel=1e-2)


def test_cop_error_is_of_frames_that_bear_enough():

    force = np.where(TIME < 1.5, 0.8, 0.1) * WEIGHT
    known = np.column_stack([force, 0.1 * force, -0.2 * force])
    offset = np.where(TIME < 1.5, 0.01, 0.5)
    found = np.column_stack([force, (0.1 + offset) * force, -0.2 * force])
    error = truth_metrics.cop_error(found, known, TIME, TIME < 1.4, WEIGHT)
    assert_allclose(error, [0.01, 0], rtol=0, atol=1e-9)
    error = truth_metrics.cop_error(found, known, TIME, TIME > 1.6, WEIGHT)
    assert np.isnan(error).all()
    lifted = 8 * found
    error = truth_metrics.cop_error(lifted, known, TIME, TIME > 1.6, WEIGHT)
    assert np.isnan(error).all()


# ---- Trials ----


@pytest.fixture
def trial_file(tmp_path: Path):
    """Writes a trial of the toy robot, which steps in place; its arrays may be replaced."""
    (tmp_path / "toy.urdf").write_text(TOY_URDF)
    (tmp_path / "toy.yaml").write_text(TOY_FILE)
    model = dynacom.load_robot(tmp_path / "toy.yaml").model

    def write(name: str, **changes: np.ndarray) -> Path:
        force = np.zeros((len(TIME), 2, 3))
        force[:, 0, 2] = SWAY
        force[100:300, 1, 2] = 21.0
        cop = np.full((len(TIME), 2, 3), [0.1, 0.2, 0.0])
        arrays = {
            "t": 3.0 + TIME,
            "q": np.tile(pin.neutral(model), (len(TIME), 1)),
            "joint_names": np.array(model.names[2:]),
            "foot_names": np.array(["foot", "pad"]),
            "foot_forces": force,
            "foot_cops": cop,
            "measured": EVERYWHERE,
            "urdf": np.array("toy.urdf"),
        }
        path = tmp_path / f"{name}.npz"
        np.savez(path, **(arrays | changes))
        return path

    return write


def test_a_trial(trial_file):

    trial = truth_trials.read_trial(trial_file("walk"))
    assert trial.mass == 2 and trial.cutoff == 6 and trial.time[0] == 0
    assert [trial.contacts(foot) for foot in trial.feet] == [["foot"], ["pad"]]
    assert trial.touch is None
    schedule = truth_trials.measured_schedule(trial)
    assert list(schedule.names) == ["foot", "pad"]
    assert_array_equal(schedule.active[:, 0], EVERYWHERE)
    assert_array_equal(np.flatnonzero(schedule.active[:, 1]), np.arange(100, 300))


def test_forces_below_20_n_are_noise_unless_they_are_simulated(trial_file):

    force = np.zeros((len(TIME), 2, 3))
    force[:, :, 2] = 19.0
    for name, expected in (("walk", False), ("sim_walk", True)):
        trial = truth_trials.read_trial(trial_file(name, foot_forces=force))
        assert (truth_trials.measured_schedule(trial).active == expected).all()


def test_a_trial_of_other_joints_is_refused(trial_file):

    with pytest.raises(ValueError, match="joints must be"):
        truth_trials.read_trial(trial_file("walk", joint_names=np.array(["knee"] * 5)))


def test_the_lag_of_icub_is_taken_out(trial_file):

    late = np.zeros((len(TIME), 2, 3))
    late[:, 0, 2] = 500 + 200 * np.sin(2 * np.pi * (TIME - 0.05))
    trial = truth_trials.read_trial(trial_file("icub_walk", foot_forces=late))
    assert_allclose(trial.force[trial.measured, 0, 2], SWAY[trial.measured], rtol=0, atol=1e-6)
    assert_array_equal(np.flatnonzero(~trial.measured), np.arange(590, 600))


def test_belts_are_taken_out(trial_file):

    trial = truth_trials.read_trial(trial_file("run", belt_velocity=np.array([-2.0, 0, 0])))
    assert_allclose(trial.q[:, 0], 2 * TIME)
    assert_allclose(trial.cop[:, 0, 0], 0.1 + 2 * TIME)
    assert_allclose(trial.q[:, 1:3], 0)


def test_noise(trial_file):
    """1 mm on places and on what slides, 2 mrad on what turns."""

    trial = truth_trials.read_trial(trial_file("walk"))
    noisy = truth_trials.with_noise(trial)
    model = trial.robot.model
    steps = [pin.difference(model, *pair) for pair in zip(trial.q, noisy.q, strict=True)]
    expected = np.full(model.nv, 2e-3)
    expected[:3] = expected[model.joints[model.getJointId("a_slide")].idx_v] = 1e-3
    assert_allclose(np.std(steps, axis=0), expected, rtol=0.15)
    assert_array_equal(truth_trials.with_noise(trial).q, noisy.q)


@pytest.fixture(scope="module")
def planned() -> truth_trials.Trial:
    """Talos's walk as a trial: the forces that it was planned with, in the world."""
    robot = dynacom.load_robot("talos")
    with np.load(WALKS / "talos_walk.npz") as file:
        arrays = {name: file[name] for name in file.files}
    data, force = robot.model.createData(), np.zeros((len(arrays["t"]), 2, 3))
    frames = [robot.model.getFrameId(str(name)) for name in arrays["contact_frames"]]
    for row, (q, wrenches) in enumerate(zip(arrays["q"], arrays["contact_wrenches"], strict=True)):
        pin.framesForwardKinematics(robot.model, data, q)
        for foot, frame in enumerate(frames):
            force[row, foot] = data.oMf[frame].rotation @ wrenches[foot, :3]
    feet = tuple(map(str, arrays["contact_names"]))
    everywhere = np.ones(len(force), dtype=bool)
    time = arrays["t"] - arrays["t"][0]
    cop = np.full_like(force, np.nan)
    return truth_trials.Trial(
        "sim_talos", robot, time, arrays["q"], feet, force, cop, None, everywhere
    )


def test_scores_of_a_walk_whose_forces_are_known(planned):
    """The contacts are right by construction, and the forces but for the feet's shares."""
    trial = planned
    schedule = truth_trials.measured_schedule(trial)
    report = truth_trials.analyze(trial, None, schedule)
    figures = truth_scores.score(report, trial)
    assert figures["changes"] >= 8 and figures["missed"] == 0
    assert figures["median"] == 0 and figures["worst"] < 30
    assert figures["lost"] == figures["made_up"] == 0
    assert max(figures["feet"]) < 7
    assert max(figures["whole"]) < 0.02  # N/kg
    assert figures["cop"] == [None, None]  # not known here
    # The same after a quarter of a turn about the vertical, of the robot and of its forces.
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    q = trial.q.copy()
    q[:, :3] = q[:, :3] @ turn.T
    quaternions = Rotation.from_matrix(turn) * Rotation.from_quat(q[:, 3:7])
    q[:, 3:7] = quaternions.as_quat()
    turned = replace(trial, q=q, force=trial.force @ turn.T)
    again = truth_scores.score(truth_trials.analyze(turned, None, schedule), turned)
    assert_allclose(again["feet"], figures["feet"], rtol=1e-3)
    assert_allclose(again["whole"], np.array(figures["whole"])[[1, 0, 2]], rtol=0, atol=1e-4)
    # And with one foot only, the other one's force is gone.
    active = np.array(schedule.active)
    active[:, 1] = False
    one = dynacom.ContactSchedule(list(schedule.names), active)
    lame = truth_scores.score(truth_trials.analyze(trial, None, one), trial)
    assert lame["feet"][1] > 30 and lame["lost"] == 100 and lame["missed"] > 3


# ---- Robustness ----


def test_constants_are_the_numbers_of_the_settings():

    class Settings:
        def __init__(self):
            self.values = {"speed": 0.25, "frames": 10, "ground": np.nan, "none": 0.0, "on": True}

    for name in Settings().values:
        setattr(Settings, name, property(lambda self, name=name: self.values[name]))
    assert truth_robustness.constants(Settings()) == ["frames", "speed"]
    default = dynacom.AnalysisOptions().detection
    name = truth_robustness.constants(default)[0]
    options = truth_robustness.scaled(name, 1.6)
    assert getattr(options.detection, name) == pytest.approx(1.6 * getattr(default, name))
    assert getattr(dynacom.AnalysisOptions().detection, name) == getattr(default, name)


def test_a_standing_robot_may_stand_longer(talos, talos_standing):

    q = np.tile(talos_standing, (60, 1))
    poses = truth_robustness.Poses("still", talos, 50.0, q, dynacom.AnalysisOptions())
    assert truth_robustness.ends_at_rest(poses)
    figures = truth_robustness.measure_standing(poses)
    assert figures == {
        **dict.fromkeys(("changes", "moved", "worst", "gone", "made_up", "while_standing"), 0),
        "at_rest": True,
    }
    moved = q.copy()
    moved[:, 0] = 0.2 * np.arange(60) / 50
    assert not truth_robustness.ends_at_rest(replace(poses, q=moved))


# ---- The page ----


def kept(root: Path) -> tuple[dict, dict]:
    return tuple(
        json.loads((root / "docs" / f"{name}.json").read_text(encoding="utf-8"))
        for name in ("truth", "truth_thresholds")
    )


def test_the_page_is_of_the_kept_figures(root):

    assert truth_page.page(*kept(root)) == (root / "docs" / "truth.md").read_text(encoding="utf-8")


def test_goals_follow_the_figures(root):
    """One trial of a kind that meets its goal, spoilt in one figure at a time."""

    figures, thresholds = kept(root)
    good = {"changes": 4, "missed": 0, "median": 10.4, "worst": 20.0, "lost": 0.1, "made_up": 0.0}
    good |= {"active": [50.0, 50.0], "feet": [4.04, 3.0], "statuses": {}, "codes": []}

    def goal(**changes):
        cases = dict.fromkeys(("default", "10"), good | changes)
        figures["trials"] = {"s4_walk": {"found": cases, "measured": cases}}
        every = truth_goals.goals(figures, thresholds)
        assert [g.met for g in every] == sorted(
            (g.met for g in every), key=[False, None, True].index
        )
        return {g.what: g for g in every}

    changes, force = "people walking: changes", "people walking: vertical force per foot, nRMSE"
    goals = goal()
    assert goals[changes].met and goals[force].met
    assert goals[changes].measured == "s4_walk 10 / 20"
    assert goals[force].measured == "s4_walk 4.0 3.0"
    for spoilt in ({"missed": 1}, {"median": 10.6}, {"worst": 21.0}):
        goals = goal(**spoilt)
        assert goals[changes].met is False and goals[changes].measured.startswith("**s4_walk")
    assert goal(feet=[3.0, 4.1])[force].met is False
    assert goal()["simulations: changes"].met is None
