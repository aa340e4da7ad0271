# SPDX-License-Identifier: BSD-2-Clause
import copy
import gc
import threading
import time
import weakref

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dynacom import (
    DetectionSettings,
    DynaCoM,
    MotionExaminer,
    NotReadyError,
    RecordedMotion,
    VerdictSettings,
)
from helpers import WALKS


@pytest.fixture(scope="module")
def recorded():
    with np.load(WALKS / "talos_walk.npz") as walk:
        return RecordedMotion(walk["t"], walk["q"])


def assert_same(one, other):
    assert_array_equal(one.analysis.residual, other.analysis.residual)
    assert_array_equal(one.analysis.cop, other.analysis.cop)
    assert_array_equal(one.ground, other.ground)
    assert_array_equal(one.schedule.active, other.schedule.active)
    assert one.verdict.feasible == other.verdict.feasible


def test_results_do_not_depend_on_threads_or_on_what_was_before(talos, recorded):
    examiner = MotionExaminer(talos.dynacom(), threads=1)
    expected = examiner.examine(recorded)
    for threads in (1, 2, 5):
        other = MotionExaminer(talos.dynacom(), threads=threads)
        for _ in range(2):
            assert_same(other.examine(recorded), expected)
    assert_same(examiner.copy().examine(recorded), expected)


def test_settings_reach_what_they_are_for(talos, recorded):
    detection = DetectionSettings()
    detection.ground_height = 0.005
    verdict = VerdictSettings()
    verdict.residual_torque.limit = 0.0
    examiner = MotionExaminer(
        talos.dynacom(), 5.0, False, 2.5, detection, verdict, True, threads=1, lanes=1
    )
    found = examiner.examine(recorded)
    assert found.derived.cutoff == 5.0
    assert found.analysis.omega == 2.5
    assert_allclose(found.ground, 0.005, rtol=0, atol=1e-12)
    assert found.ground.shape == (len(found.analysis.time), 2)
    assert found.verdict.findings["residual_torque"].frames > 0
    assert [entry.cutoff for entry in found.sensitivity] == [2.5, 10.0]


def test_progress(talos, recorded):
    told = []
    examiner = MotionExaminer(
        talos.dynacom(), 6.0, sensitivity=True, progress=told.append, threads=1
    )
    for _ in range(2):
        told.clear()
        examiner.examine(recorded)
        assert told == sorted(told)
        assert told[-1] == 1.0
        assert len(told) >= 3

    def stop(part):
        raise KeyError(part)

    with pytest.raises(KeyError):
        MotionExaminer(talos.dynacom(), progress=stop).examine(recorded)


def test_other_threads_go_on_meanwhile(talos, recorded):
    """Python's lock is free while motions are examined."""
    examiner = MotionExaminer(talos.dynacom(), 6.0, sensitivity=True, threads=1)
    done = threading.Event()

    def work():
        for _ in range(10):
            examiner.examine(recorded)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    ticks = 0
    while not done.is_set():
        time.sleep(0.0005)
        ticks += 1
    thread.join()
    # With the lock held, it would be one or two for each call.
    assert ticks > 40


def test_refused(talos, recorded):
    with pytest.raises(ValueError, match=r"ExaminationSettings\.cutoff must be"):
        MotionExaminer(talos.dynacom(), -1.0)
    with pytest.raises(NotReadyError, match="MotionExaminer"):
        MotionExaminer(DynaCoM())
    q = recorded.q
    q[5, 3:7] = 0.0
    with pytest.raises(ValueError, match="quaternions of norm 1, got another in frame 5"):
        MotionExaminer(talos.dynacom()).examine(RecordedMotion(recorded.time, q))


def test_a_robot_without_contacts_falls(talos):
    """Of a body in free fall nothing is asked, and so nothing is missing."""
    times = np.arange(51) / 50.0  # after which nothing falls faster than 10 m/s
    model = talos.model
    q = np.tile(pin.neutral(model), (51, 1))
    q[:, 2] = 10.0 - 0.5 * 9.81 * times**2
    found = MotionExaminer(DynaCoM(model), 0.0).examine(RecordedMotion(times, q))
    assert found.verdict.feasible
    assert found.statistics.mean_vertical_force == pytest.approx(0.0, abs=1e-9)


def test_what_it_holds_is_not_copied_and_outlives_it(talos, recorded):
    """An hour has hundreds of megabytes of it."""
    found = MotionExaminer(talos.dynacom(), sensitivity=False).examine(recorded)
    analysis = found.analysis
    lists = (found.contacts, found.part_motions, analysis.contacts, analysis.parts)
    firsts = [elements[0] for elements in lists]
    kept = [(first.name, str(first)) for first in firsts]
    motion, contact = firsts[0].position, firsts[2].wrench
    copied = copy.copy(firsts[2])
    owner = weakref.ref(found)
    del lists, analysis, found
    gc.collect()
    assert owner() is not None
    assert [(first.name, str(first)) for first in firsts] == kept
    assert_array_equal(firsts[0].position, motion)
    assert_array_equal(firsts[2].wrench, contact)
    del firsts
    gc.collect()
    assert owner() is None
    assert_array_equal(copied.wrench, contact)
