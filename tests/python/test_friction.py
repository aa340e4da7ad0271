# SPDX-License-Identifier: BSD-2-Clause
"""By which friction motions are judged: Coulomb's cone, unless somebody says otherwise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dynacom
from dynacom import AnalysisOptions, FrictionModel
from dynacom.batch_row import Job

MU = 0.05
GRAVITY = 9.81


@pytest.fixture(scope="module")
def slippery(talos):
    """Talos with so little friction that it slides before it falls."""
    contacts = {name: settings.copy() for name, settings in talos.contacts.items()}
    for settings in contacts.values():
        settings.mu = MU
    return replace(talos, contacts=contacts)


@pytest.fixture
def swaying(motion_file, talos, talos_standing):
    """A motion's file: all of the robot sways by a millimetre, up to a part of mu g."""

    def write(part: float, direction: float) -> Path:
        time = np.linspace(0.0, 2.0, 201)
        rate = 2.0 * np.pi * 2.5
        a = np.zeros((len(time), talos.model.nv))
        along = np.array([np.cos(direction), np.sin(direction)])
        a[:, :2] = part * MU * GRAVITY * np.sin(rate * time)[:, np.newaxis] * along
        q = np.tile(talos_standing, (len(time), 1))
        q[:, :2] -= a[:, :2] / rate**2
        v = np.zeros_like(a)
        v[:, :2] = -part * MU * GRAVITY / rate * np.cos(rate * time)[:, np.newaxis] * along
        both = np.ones((len(time), 2), dtype=bool)
        return motion_file(t=time, q=q, v=v, a=a, contacts=both)

    return write


def judge(path, robot, friction=None):
    options = AnalysisOptions(friction=friction, distance=False)
    return dynacom.analyze(path, robot, options=options, sensitivity=False)


def lacking(report) -> float:
    """What of the force the contacts cannot give, over m g."""
    return float(np.linalg.norm(report["residual"][:, :3], axis=1).max() / report.summary["weight"])


@pytest.mark.parametrize(
    ("friction", "reach"),
    # How far each goes along an axis, along the diagonal and between them, over mu.
    [
        (None, (1.0, 1.0, 1.0)),
        ("cone", (1.0, 1.0, 1.0)),
        ("outer-pyramid", (1.0, np.sqrt(2.0), 1.0 / np.cos(np.pi / 8.0))),
        ("inner-pyramid", (np.sqrt(0.5), 1.0, np.sqrt(0.5) / np.cos(np.pi / 8.0))),
        ("facets", (1.0, 1.0, 1.0 / np.cos(np.pi / 8.0))),
    ],
)
def test_how_far_friction_reaches(slippery, swaying, friction, reach):
    for direction, most in zip((0.0, np.pi / 4.0, np.pi / 8.0), reach, strict=True):
        within = judge(swaying(0.98 * most, direction), slippery, friction)
        assert lacking(within) < 1e-9, direction
        beyond = judge(swaying(1.2 * most, direction), slippery, friction)
        # The closest wrench is less far off than the force alone.
        assert 0.02 * MU < lacking(beyond) < 0.2 * most * MU * 1.001, direction
        for report, least in ((within, 0.97), (beyond, 1.0 - 1e-6)):
            for name in slippery.contacts:
                largest = report[f"contact.{name}.friction_usage"].max()
                assert least < largest < 1.0 + 1e-9, (direction, name)


def test_the_cone_is_left_where_the_pyramid_is_not(slippery, swaying):
    """A force of (1, 1) of mu f_z is 41 % beyond the cone."""
    path = swaying(1.35, np.pi / 4.0)
    assert lacking(judge(path, slippery, "outer-pyramid")) < 1e-9
    report = judge(path, slippery)
    assert lacking(report) > 0.1 * MU
    for name in slippery.contacts:
        for usage in ("friction_usage", "cone_usage"):
            assert report[f"contact.{name}.{usage}"].max() == pytest.approx(1.0, rel=1e-6)


def test_the_pyramid_says_by_how_much_it_leaves_the_cone(slippery, swaying):
    report = judge(swaying(1.35, np.pi / 4.0), slippery, "outer-pyramid")
    for name in slippery.contacts:
        assert report[f"contact.{name}.friction_usage"].max() < 1.0 + 1e-9
        assert 1.3 < report[f"contact.{name}.cone_usage"].max() < np.sqrt(2.0) + 1e-9


def test_a_robot_has_a_friction_of_its_own(slippery, swaying):
    path = swaying(1.35, np.pi / 4.0)
    lenient = replace(slippery, friction=FrictionModel.OuterPyramid)
    assert lacking(judge(path, lenient)) < 1e-9
    assert lacking(judge(path, lenient, "cone")) > 0.1 * MU


def test_a_contact_that_says_so_keeps_its_own(slippery, swaying):
    contacts = {name: settings.copy() for name, settings in slippery.contacts.items()}
    for settings in contacts.values():
        settings.friction = FrictionModel.InnerPyramid
    strict = replace(slippery, contacts=contacts)
    path = swaying(0.9, 0.0)
    assert lacking(judge(path, slippery)) < 1e-9
    for friction in (None, "outer-pyramid"):
        assert lacking(judge(path, strict, friction)) > 0.05 * MU


def test_results_of_batches_depend_on_it(slippery):
    lenient = replace(slippery, friction=FrictionModel.OuterPyramid)
    keys = {
        Job(slippery, AnalysisOptions()).key(),
        Job(lenient, AnalysisOptions()).key(),
        Job(slippery, AnalysisOptions(friction="facets")).key(),
    }
    assert len(keys) == 3


def test_a_job_takes_it_along(slippery):
    job = Job(
        replace(slippery, friction=FrictionModel.Facets), AnalysisOptions(friction="inner-pyramid")
    )
    function, arguments = job.__reduce__()
    made = function(*arguments)
    assert made.robot.friction == FrictionModel.Facets
    assert made.options.friction == "inner-pyramid"
    assert made.key() == job.key()
