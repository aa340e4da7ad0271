# SPDX-License-Identifier: BSD-2-Clause
from dataclasses import replace

import numpy as np
import pytest

import dynacom
from dynacom import ContactSchedule, VerdictSettings, findMissingSupport
from helpers import WALKS, documentation


@pytest.fixture(scope="module")
def walk(talos):
    return dynacom.read_motion(WALKS / "talos_walk.npz", talos)


@pytest.fixture(scope="module")
def limping(talos, walk):
    """Of a walk, nobody knows the right foot."""
    masks = np.asarray(walk.schedule.active).copy()
    masks[:, list(walk.schedule.names).index("right_sole")] = False
    schedule = ContactSchedule(walk.schedule.names, masks)
    return dynacom.analyze(walk, talos, schedule=schedule, sensitivity=False)


def test_what_is_missing_is_that_of_the_arrays(limping):
    """By NumPy, whose intervals are those of times in which nothing is within all limits."""
    missing = limping.examination.missing_support
    time, findings = limping["time"], limping.verdict.findings
    limits = limping.options.verdict
    codes = ("residual_force", "residual_torque", "cop_outside", "flight_with_support_needed")
    beyond = np.any([findings[c].measured > getattr(limits, c).limit for c in codes], axis=0)
    inside = np.zeros(len(time), dtype=bool)
    for interval in missing.intervals:
        own = slice(interval.first, interval.last + 1)
        inside[own] = True
        assert (interval.begin, interval.end) == (time[interval.first], time[interval.last])
        assert beyond[interval.first]
        assert beyond[interval.last]
        assert beyond[own].mean() > 0.5
    lengths = [i.end - i.begin for i in missing.intervals]
    assert min(lengths) >= limits.interruption - 2.0 * (time[1] - time[0])
    assert beyond[~inside].mean() < 0.1
    assert missing.frames == inside.sum()
    assert missing.share == inside.mean()
    known = inside & ~np.asarray(limping.verdict.unsure)
    residual = np.linalg.norm(limping["residual"].reshape(-1, 2, 3), axis=2)[known].max(axis=0)
    weight = limping.examination.statistics.mass * 9.81
    assert missing.force == pytest.approx(residual[0] / weight)
    assert missing.torque == pytest.approx(residual[1] / weight)
    assert missing.cop_distance == findings["cop_outside"].measured[inside].max()


def test_it_is_found_from_what_was_found(talos, limping):
    found = limping.examination
    again = findMissingSupport(talos.dynacom(), limping.analysis, limping.verdict)
    for name in ("frames", "share", "force", "torque", "cop_distance"):
        assert getattr(again, name) == getattr(found.missing_support, name)
    patient = VerdictSettings()
    patient.interruption = 100.0
    assert findMissingSupport(talos.dynacom(), limping.analysis, limping.verdict, patient) is None


def test_when_it_begins_does_not_matter(talos, walk, limping):
    later = replace(walk, time=walk.time + 64.0)
    report = dynacom.analyze(later, talos, schedule=limping.schedule, sensitivity=False)
    found, expected = report.examination.missing_support, limping.examination.missing_support
    assert [(i.first, i.last) for i in found.intervals] == [
        (i.first, i.last) for i in expected.intervals
    ]
    assert found.force == pytest.approx(expected.force, abs=1e-6)


def test_nothing_is_missing_where_all_is_given(talos, walk):
    found = dynacom.analyze(walk, talos, sensitivity=False).examination
    assert found.missing_support is None


def test_documentation():
    (text,) = documentation(findMissingSupport)
    assert "ValueError" in text
