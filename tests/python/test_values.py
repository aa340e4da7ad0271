# SPDX-License-Identifier: BSD-2-Clause
"""What all classes of the package have in common: they print, copy, and take lists for vectors."""

import copy
import pickle
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_array_equal

import dynacom
from dynacom import (
    CentroidalState,
    CentroidalWrench,
    Contact6D,
    ContactPoint,
    ContactSchedule,
    DistributionStatus,
    DynaCoM,
    DynaCoMSettings,
    Motion,
    WrenchDistribution,
)
from helpers import WALKS, point, point_settings, sole, sole_settings

# Not objects of their own: nobody makes one, or an error.
ABSTRACT = {"ContactBase", "DynacomError", "NotReadyError"}


def polygon() -> dynacom.ContactPolygonSettings:
    settings = dynacom.ContactPolygonSettings()
    settings.vertices = [[0.1, 0.0], [-0.1, 0.05], [-0.1, -0.05]]
    settings.frame_name = "foot"
    return settings


def grasp() -> dynacom.ContactGraspSettings:
    settings = dynacom.ContactGraspSettings()
    settings.frame_name = "hand"
    return settings


@pytest.fixture(scope="module")
def objects(talos, talos_standing, talos_motion):
    """One of each public class, by name; those of a robot on two feet, of one frame."""
    robot = talos.dynacom()
    rest = np.zeros(talos.model.nv)
    robot.computeDynamics(talos_standing, rest, rest)
    robot.distributeForce(robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM())
    state = dynacom.readCentroidalState(robot.getData())
    motion = Motion(*(talos_motion[key] for key in "tqva"))
    schedule = ContactSchedule(["left_sole", "right_sole"], talos_motion["contacts"])
    analysis = dynacom.analyzeMotion(robot, motion, schedule)
    result = robot.getDistribution()
    report = dynacom.analyze(WALKS / "talos_walk.npz", talos)
    recorded = dynacom.RecordedMotion(motion.time, motion.q)
    examiner = dynacom.MotionExaminer(robot, sensitivity=True)
    examination = examiner.examine(recorded)
    sunk = dynacom.DetectionSettings()
    sunk.ground_height = -1.0  # above it, feet are held in the air
    hovering = dynacom.MotionExaminer(robot, detection=sunk).examine(recorded)
    repaired = dynacom.repairMotion(
        dynacom.splitContacts(robot), motion, examination.inference.schedule
    )
    few = dynacom.RecordedMotion(motion.time[:4], np.tile(talos_standing, (4, 1)))
    repairer = dynacom.make_repairer(talos, dynacom.AnalysisOptions())
    hurried = replace(report.clip, time=report.clip.time / 1.5, v=None, a=None)
    mended = dynacom.repair(hurried, talos, strict=True)
    hand = dynacom.DistributionContact(dynacom.ContactSet(), weights=[1.0, 2.0, 3.0])
    problem = dynacom.DistributionProblem([hand], [0.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    objects = [
        state,
        dynacom.computeGroundWrench(state, [0.0, 0.0, -9.81]),
        dynacom.GroundPlane(),
        point_settings(),
        sole_settings(),
        point(),
        sole(),
        polygon(),
        dynacom.ContactPolygon(polygon()),
        grasp(),
        dynacom.ContactGrasp(grasp()),
        dynacom.FrictionModel.Cone,
        WrenchDistribution(),
        result,
        result.status,
        result.contacts[0],
        robot.computeWrenchMargin(),
        DynaCoMSettings(),
        robot,
        motion,
        schedule,
        analysis,
        analysis.contacts[0],
        talos,
        dynacom.Payload("torso_2_link", 3.0, (0.0, 0.1, 0.2)),
        dynacom.compareDerivatives(talos.model, motion),
        dynacom.computeContactMotions(robot, motion)[0],
        dynacom.DetectionSettings(),
        dynacom.VerdictSettings(),
        dynacom.CentroidalFilterSettings(),
        examination.distance,
        dynacom.RepairSettings(),
        dynacom.LadderSettings(),
        repairer,
        mended,
        mended.repair,
        mended.repair.root,
        mended.repair.feet,
        mended.repair.steps[0],
        repairer.repair(few).reasons[0],
        dynacom.RepairGround(),
        repaired,
        repaired.stances[0],
        dynacom.FaultLimit(0.1, 0.2),
        dynacom.AnalysisOptions(),
        dynacom.BatchProgress(3, 1),
        report.clip,
        report,
        report.verdict,
        report.verdict.findings["foot_sliding"],
        report.verdict.windows[0],
        report.verdict.normals[0],
        recorded,
        examiner,
        examination,
        examination.derived,
        examination.inference,
        examination.inference.stances[0],
        dynacom.splitContacts(robot),
        examination.statistics,
        examination.statistics.contacts[0],
        examination.sensitivity[0],
        dynacom.compareMeasured(motion.v, motion.v),
        dynacom.BodyPoints("trunk", 1, [[0.0, 0.1, 0.2]], [0.05]),
        dynacom.CollisionPoints([], ["trunk.stl"]),
        dynacom.Seat("pelvis", 3, 9, 0.45, 0.6),
        dynacom.BodyStatistics("pelvis", 0.5, 0.2, 0.9),
        hovering.missing_support,
        hovering.missing_support.intervals[0],
        hovering.terrain,
        hovering.terrain.contacts[0],
        hovering.terrain.held[0],
        dynacom.Section.disc(0.5),
        dynacom.ContactSet(),
        hand,
        problem,
        dynacom.DistributionSolver(),
        dynacom.DistributionSolver().solve(problem),
    ]
    return {type(value).__qualname__: value for value in objects} | {
        "DistributionResult.Contact": result.contacts[0],
        "MotionAnalysis.Contact": analysis.contacts[0],
    }


def test_all_classes_are_looked_at(objects):
    classes = {name for name in dynacom.__all__ if isinstance(getattr(dynacom, name), type)}
    assert classes - ABSTRACT <= set(objects)


def test_misspelt_attributes_are_refused(objects):
    for name, value in objects.items():
        with pytest.raises(AttributeError):
            value.half_lenght = 0.1
        assert not hasattr(value, "half_lenght"), name
    with pytest.raises(AttributeError, match="'Contact6DSettings' has no attribute 'halfLength'"):
        sole_settings().halfLength = 0.1
    with pytest.raises(AttributeError, match="mu"):
        sole().mu = 0.1


def test_classes_derived_from_ours_may_have_attributes():
    class Named(DynaCoM):
        def __init__(self):
            super().__init__()
            self.name = "talos"

    assert Named().name == "talos"
    assert not Named().isInitialized()


def test_nothing_prints_an_address(objects):
    for name, value in objects.items():
        for text in (str(value), repr(value)):
            assert " at 0x" not in text, name
            assert "\n" not in text, name
        if name not in ("DistributionStatus", "FrictionModel"):
            assert repr(value).startswith(f"{name}("), name
            assert repr(value).endswith(")"), name


def test_what_printing_tells(objects):
    """Numbers that are not round are cut after six digits, as C++ does."""
    result = objects["DistributionResult"]
    assert "status=Solved, wrench=[0 0 885.57 " in repr(result)
    forces = re.search(r"forces=\[\[(.*)\], \[(.*)\]\]\)$", repr(result)).groups()
    for text, contact in zip(forces, result.contacts, strict=True):
        np.testing.assert_allclose(np.fromstring(text, sep=" "), contact.force, rtol=1e-5)
    margin = objects["WrenchMargin"]
    expected = f"WrenchMargin(margin={margin.margin:g}, axis={margin.axis}, sign={margin.sign})"
    assert repr(margin) == str(margin) == expected
    wrench = CentroidalWrench()
    wrench.force, wrench.torque = [1, -2, 0.5], [1e-9, 0, np.nan]
    assert repr(wrench) == "CentroidalWrench(force=[1 -2 0.5], torque=[1e-09 0 nan])"
    assert repr(Contact6D()) == "Contact6D()"
    assert repr(point()) == f"ContactPoint({point().getSettings()})"
    assert repr(DynaCoM()) == "DynaCoM()"
    assert "mass=90.2722, nq=39, nv=38, active_contacts=['left_sole', 'right_sole']" in repr(
        objects["DynaCoM"]
    )
    assert repr(objects["Motion"]) == "Motion(frames=40, nq=39, nv=38)"
    names = "['left_sole', 'right_sole']"
    assert repr(objects["ContactSchedule"]) == f"ContactSchedule(frames=40, names={names})"
    analysis = objects["MotionAnalysis"]
    statuses = ", ".join(
        f"{status}: {analysis.status.count(status)}"
        for status in DistributionStatus.values.values()
        if status in analysis.status
    )
    assert f"frames=40, status={{{statuses}}}, omega=" in repr(analysis)
    assert "name='left_sole', frames=40, active_frames=30" in repr(analysis.contacts[0])


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_everything_can_be_copied(objects, copied):
    for name, value in objects.items():
        # They hold a pinocchio.Model, which says itself how it is copied; nor is a MotionRepairer.
        if name in ("Robot", "MotionReport", "RepairReport", "MotionRepairer"):
            continue
        other = copied(value)
        assert type(other) is type(value), name
        assert repr(other) == repr(value), name
    margin = objects["WrenchMargin"]
    other = copied(margin)
    assert other is not margin
    assert (other.margin, other.axis, other.sign) == (margin.margin, margin.axis, margin.sign)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, CentroidalState.copy])
def test_copies_share_nothing(copied):
    state = CentroidalState()
    state.com = [1, 2, 3]
    other = copied(state)
    other.com = [4, 5, 6]
    assert_array_equal(state.com, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("status", DistributionStatus.values.values(), ids=str)
def test_a_status_keeps_its_name(status):
    """In copies, and on its way to another process."""
    for other in (
        copy.copy(status),
        copy.deepcopy([status])[0],
        pickle.loads(pickle.dumps(status)),
    ):
        assert other is status


# Lists and tuples.


@pytest.mark.parametrize("kind", [list, tuple, lambda x: [np.float32(number) for number in x]])
def test_lists_for_vectors(kind, anymal, anymal_standing):
    """Wherever the size of a vector is known beforehand."""
    three, six = kind([1, 2.5, 3]), kind([1, 2.5, 3, 4, 5, 6])
    settings = sole_settings()
    settings.weights = six
    assert_array_equal(settings.weights, [1.0, 2.5, 3.0, 4.0, 5.0, 6.0])
    contact = Contact6D(settings)
    contact.setForceWeights(kind([7, 8, 9]))
    contact.setTorqueWeights(three)
    assert_array_equal(contact.reg_A(), [7.0, 8.0, 9.0, 1.0, 2.5, 3.0])
    contact.applyForce(six)
    assert_array_equal(contact.appliedForce(), six)
    contact.updateNewtonEuler(three, pin.SE3.Identity())
    expected = contact.ne_A()
    contact.updateNewtonEuler(np.array(three), pin.SE3.Identity())
    assert_array_equal(contact.ne_A(), expected)
    settings = DynaCoMSettings()
    settings.gravity = kind([0, 0, -1.625])
    assert_array_equal(settings.gravity, [0.0, 0.0, -1.625])

    distribution = WrenchDistribution()
    distribution.setWrenchWeights(six)
    assert_array_equal(distribution.getWrenchWeights(), six)
    distribution.add(contact)
    distribution.solve(six)
    assert_array_equal(distribution.result().wrench, six)

    robot = anymal.dynacom()
    rest = np.zeros(robot.getModel().nv)
    robot.setWrenchWeights(six)
    robot.computeDynamics(anymal_standing, rest, rest)
    force = robot.getGroundCoMForce()
    robot.computeDynamics(anymal_standing, rest, rest, six)
    assert_array_equal(robot.getGroundCoMForce(), force - three)
    robot.computeNL(3.0, anymal_standing, rest, rest, six)
    robot.distributeForce(three, three, three)
    assert_array_equal(robot.ne_b(), kind([*three, *three]))

    state = CentroidalState()
    state.mass, state.com, state.acom, state.amVariation = 1.0, three, three, three
    wrench = dynacom.computeGroundWrench(state, kind([0, 0, -2]), six)
    assert_array_equal(wrench.force, [0.0, 0.0, 2.0])
    dynacom.applyGroundWrench(state, wrench, kind([0, 0, -2]), six)
    dynacom.computeFlatGroundCoP(wrench, three)


@pytest.mark.parametrize(
    ("wrong", "got"),
    [
        (None, "NoneType"),
        ("123", "str"),
        (3.0, "float"),
        ({1, 2, 3}, "set"),
        ([1, 2, "3"], "str as number 2 of a list"),
        ((1, None, 3), "NoneType as number 1 of a tuple"),
        ([[1], [2], [3]], "list as number 0 of a list"),
        ([1, 2j, 3], "complex as number 1 of a list"),
        ([np.timedelta64(1), 2, 3], "numpy.timedelta64 as number 0 of a list"),
        (np.ones((3, 2)), r"numpy.ndarray, shape \(3, 2\), type float64"),
        (np.ones(3) * 1j, r"numpy.ndarray, shape \(3,\), type complex128"),
        (np.ones(3, dtype="m8[s]"), r"numpy.ndarray, shape \(3,\), type timedelta64\[s\]"),
    ],
)
def test_what_is_no_vector(wrong, got):
    """The error names the argument, what it takes and what it got, and no signature of C++."""
    contact = ContactPoint(point_settings())
    message = f"^force_weights must be an array, a list or a tuple of 3 numbers, got {got}$"
    with pytest.raises(TypeError, match=message):
        contact.setForceWeights(wrong)
    with pytest.raises(TypeError, match=message.replace("force_weights", "com")):
        contact.updateNewtonEuler(wrong, pin.SE3.Identity())
    assert_array_equal(contact.reg_A(), np.ones(3))


@pytest.mark.parametrize("size", [0, 2, 4])
def test_lists_of_the_wrong_size(size):
    with pytest.raises(ValueError, match=f"^force_weights must have 3 components, got {size}$"):
        point().setForceWeights([1.0] * size)


def test_pinocchio_is_left_as_it_is():
    """What the package takes besides arrays, it does not make others take."""
    with pytest.raises(TypeError):
        pin.exp3([0.0, 0.0, 1.0])
