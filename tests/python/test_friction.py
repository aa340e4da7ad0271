# SPDX-License-Identifier: BSD-2-Clause
"""By which friction motions are judged: Coulomb's cone, unless somebody says otherwise."""

from dataclasses import replace

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
def pulled(motion_file, talos_standing):
    """A motion's file: who stands there accelerates by a part of mu g, in some direction."""

    def write(part: float, direction: float):
        frames, nv = 200, 6 + len(talos_standing) - 7
        a = np.zeros((frames, nv))
        a[:, :2] = part * MU * GRAVITY * np.array([np.cos(direction), np.sin(direction)])
        return motion_file(
            t=np.linspace(0.0, 1.99, frames),
            q=np.tile(talos_standing, (frames, 1)),
            v=np.zeros((frames, nv)),
            a=a,
            contacts=np.ones((frames, 2), dtype=bool),
        )

    return write


def judge(path, robot, friction=None):
    options = AnalysisOptions(friction=friction, distance=False)
    return dynacom.analyze(path, robot, options=options, sensitivity=False)


def lacking(report) -> float:
    """What of the force the contacts cannot give, over m g."""
    return float(np.abs(report["residual_force"]).max() / report.summary["weight"])


@pytest.mark.parametrize(
    ("friction", "reach"),
    # How far each goes along an axis and along the diagonal, over mu.
    [
        (None, (1.0, 1.0)),
        ("cone", (1.0, 1.0)),
        ("outer-pyramid", (1.0, np.sqrt(2.0))),
        ("inner-pyramid", (np.sqrt(0.5), 1.0)),
        ("facets", (1.0, 1.0 / np.cos(np.pi / 8.0) * np.cos(np.pi / 8.0))),
    ],
)
def test_how_far_friction_reaches(slippery, pulled, friction, reach):
    for direction, most in zip((0.0, np.pi / 4.0), reach, strict=True):
        within = judge(pulled(0.98 * most, direction), slippery, friction)
        assert lacking(within) < 1e-9, direction
        for name in slippery.contacts:
            usage = within[f"contact.{name}.friction_usage"]
            np.testing.assert_allclose(usage, 0.98, rtol=1e-6)
        beyond = judge(pulled(1.2 * most, direction), slippery, friction)
        # The closest wrench is less far off than the force alone.
        assert 0.02 * MU < lacking(beyond) < 0.2 * most * MU * 1.001, direction


def test_the_cone_is_left_where_the_pyramid_is_not(slippery, pulled):
    """A force of (1, 1) of mu f_z is 41 % beyond the cone."""
    path = pulled(1.35, np.pi / 4.0)
    assert lacking(judge(path, slippery, "outer-pyramid")) < 1e-9
    report = judge(path, slippery)
    assert lacking(report) > 0.1 * MU
    for name in slippery.contacts:
        for usage in ("friction_usage", "cone_usage"):
            np.testing.assert_allclose(report[f"contact.{name}.{usage}"], 1.0, rtol=1e-6)


def test_the_pyramid_says_by_how_much_it_leaves_the_cone(slippery, pulled):
    report = judge(pulled(1.35, np.pi / 4.0), slippery, "outer-pyramid")
    for name in slippery.contacts:
        found = report[f"contact.{name}.friction_usage"], report[f"contact.{name}.cone_usage"]
        np.testing.assert_allclose(found[0], 1.35 / np.sqrt(2.0), rtol=1e-6)
        np.testing.assert_allclose(found[1], 1.35, rtol=1e-6)


def test_a_robot_has_a_friction_of_its_own(slippery, pulled):
    path = pulled(1.35, np.pi / 4.0)
    lenient = replace(slippery, friction=FrictionModel.OuterPyramid)
    assert lacking(judge(path, lenient)) < 1e-9
    assert lacking(judge(path, lenient, "cone")) > 0.1 * MU


def test_a_contact_that_says_so_keeps_its_own(slippery, pulled):
    contacts = {name: settings.copy() for name, settings in slippery.contacts.items()}
    for settings in contacts.values():
        settings.friction = FrictionModel.InnerPyramid
    strict = replace(slippery, contacts=contacts)
    path = pulled(0.9, 0.0)
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
