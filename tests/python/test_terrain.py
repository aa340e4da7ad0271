# SPDX-License-Identifier: BSD-2-Clause
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynacom
from dynacom import ContactSchedule, findTerrain
from helpers import WALKS, documentation


@pytest.fixture(scope="module")
def walk(talos):
    return dynacom.read_motion(WALKS / "talos_walk.npz", talos)


@pytest.fixture(scope="module")
def report(talos, walk):
    return dynacom.analyze(replace(walk, schedule=None), talos, sensitivity=False)


def test_grounds_are_those_of_the_arrays(talos, report):
    """By NumPy."""
    found = report.examination
    assert [contact.name for contact in found.terrain.contacts] == list(talos.contacts)
    active = np.asarray(found.schedule.active)
    for index, contact in enumerate(found.terrain.contacts):
        under = found.ground[active[:, index], index]
        assert contact.height == np.nanmedian(under)
        assert contact.levels == sorted(contact.levels)
        # It is flat.
        assert len(contact.levels) == 1
        assert contact.levels[0] == pytest.approx(contact.height, abs=0.02)
    active = np.asarray(found.inference.schedule.active)
    heights = [
        stance.height
        for stance in found.inference.stances
        if stance.on_ground and active[stance.first : stance.behind, stance.part].any()
    ]
    assert found.terrain.lowest == min(heights)
    assert found.terrain.level == np.median(heights)
    assert found.terrain.held == []


def test_it_is_found_from_what_was_found(report):
    found = report.examination
    given = (found.parts, found.inference, found.schedule, found.ground, found.analysis.time)
    again = findTerrain(*given)
    assert [c.height for c in again.contacts] == [c.height for c in found.terrain.contacts]
    assert (again.lowest, again.level) == (found.terrain.lowest, found.terrain.level)
    assert findTerrain(*given, ground_height=0.25).level == 0.25
    with pytest.raises(ValueError, match="ground must have 318 frames"):
        findTerrain(*given[:3], found.ground[1:], found.analysis.time)


def test_heights_may_begin_anywhere(talos, walk, report):
    q = walk.q.copy()
    q[:, 2] += 2.0
    raised = replace(walk, q=q, schedule=None)
    found = dynacom.analyze(raised, talos, sensitivity=False).examination.terrain
    expected = report.examination.terrain
    assert_allclose(
        [c.height for c in found.contacts], [c.height + 2.0 for c in expected.contacts], atol=1e-9
    )
    assert found.lowest == pytest.approx(expected.lowest + 2.0)
    assert found.level == pytest.approx(expected.level + 2.0)


def test_disagreement_is_that_of_the_schedules(talos, walk, report):
    """By NumPy."""
    assert report.examination.disagreement.shape == (0,)
    masks = np.asarray(walk.schedule.active).copy()
    masks[:, 0] = ~masks[:, 0]
    schedule = ContactSchedule(walk.schedule.names, masks)
    found = dynacom.analyze(walk, talos, schedule=schedule, sensitivity=False).examination
    differ = np.asarray(found.schedule.active) != np.asarray(found.inferred.active)
    assert_allclose(found.disagreement, differ.mean(axis=0), rtol=1e-15)
    assert found.disagreement.max() > 0.5


def test_documentation():
    (text,) = documentation(findTerrain)
    assert "ValueError" in text
