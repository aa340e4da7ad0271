# SPDX-License-Identifier: BSD-2-Clause
import eigenpy
import numpy as np
import pinocchio as pin
import pytest

import dynacom
from dynacom import Contact6D, Contact6DSettings, ContactPoint, ContactPointSettings, DynaCoM
from dynacom.compat import ALIASES


@pytest.fixture
def sole():
    settings = Contact6DSettings()
    settings.frame_name = "leg_left_sole_fix_joint"
    settings.mu, settings.gu = 0.3, 0.4
    settings.half_length, settings.half_width = 0.1, 0.05
    settings.weights = np.array([1, 2, 3, 4, 5, 6])
    return Contact6D(settings)


@pytest.fixture
def point():
    settings = ContactPointSettings()
    settings.frame_name = "leg_left_sole_fix_joint"
    settings.mu = 0.3
    settings.radius = 0.02
    return ContactPoint(settings)


def test_the_package_exports_all_of_the_bindings():
    bindings = {name for name in vars(dynacom.dynacom_pywrap) if not name.startswith("_")}
    # eigenpy puts its own functions into every module that uses it.
    assert bindings - set(vars(eigenpy)) <= set(dynacom.__all__)
    assert all(hasattr(dynacom, name) for name in dynacom.__all__)


CONTACT = {"get_frame_id", "set_frame_id", "get_pose", "update_NE_matrix", "NE_A", "get_settings"}
POINT = {"set_mu", "set_force_weights"}
SOLE = POINT | {
    "set_gu",
    "set_torque_weights",
    "set_surface_half_width",
    "set_surface_half_length",
}


@pytest.mark.parametrize(
    ("cls", "expected"),
    [
        (ContactPoint, CONTACT | POINT),
        (Contact6D, CONTACT | SOLE),
        (DynaCoM, {"model", "data", "NE_A", "NE_b"}),
    ],
)
def test_each_class_has_its_aliases_and_no_others(cls, expected):
    aliases = ALIASES.keys() | {"get_settings"}
    assert {alias for alias in aliases if hasattr(cls, alias)} == expected


def test_settings_as_a_dict(sole, point):
    settings = sole.get_settings()
    weights = settings.pop("weights")
    np.testing.assert_array_equal(weights, [1, 2, 3, 4, 5, 6])
    assert settings == {
        "mu": 0.3,
        "gu": 0.4,
        "half_length": 0.1,
        "half_width": 0.05,
        "frame_name": "leg_left_sole_fix_joint",
    }
    settings = point.get_settings()
    np.testing.assert_array_equal(settings.pop("weights"), np.ones(3))
    assert settings == {
        "mu": 0.3,
        "frame_name": "leg_left_sole_fix_joint",
        "world_aligned": False,
        "radius": 0.02,
    }


def test_the_dict_is_a_copy(sole):
    settings = sole.get_settings()
    settings["weights"][0] = 100.0
    settings["mu"] = 9.0
    assert sole.getSettings().mu == 0.3
    assert sole.getSettings().weights[0] == 1.0


@pytest.mark.parametrize(
    ("alias", "setter", "value"),
    [
        ("set_mu", "setMu", 0.9),
        ("set_gu", "setGu", 0.8),
        ("set_force_weights", "setForceWeights", np.array([7, 8, 9])),
        ("set_torque_weights", "setTorqueWeights", np.array([7.0, 8.0, 9.0])),
        ("set_surface_half_width", "setSurfaceHalfWidth", 0.03),
        ("set_surface_half_length", "setSurfaceHalfLength", 0.04),
    ],
)
def test_setters(sole, alias, setter, value):
    other = sole.clone()
    before = sole.getSettings()
    getattr(sole, alias)(value)
    getattr(other, setter)(value)
    assert sole.getSettings() == other.getSettings()
    assert sole.getSettings() != before
    for matrix in ("uni_A", "fri_A", "reg_A"):
        np.testing.assert_array_equal(getattr(sole, matrix)(), getattr(other, matrix)())


@pytest.mark.parametrize(
    ("alias", "value"), [("set_mu", 0.9), ("set_force_weights", np.array([7, 8, 9]))]
)
def test_setters_of_points(point, alias, value):
    getattr(point, alias)(value)
    expected = {"set_mu": "mu", "set_force_weights": "weights"}[alias]
    np.testing.assert_array_equal(point.get_settings()[expected], value)


@pytest.mark.parametrize("contact", ["sole", "point"])
def test_frame_pose_and_matrix(request, contact):
    contact = request.getfixturevalue(contact)
    contact.set_frame_id(5)
    assert contact.get_frame_id() == contact.getFrameID() == 5
    com, pose = np.array([0.1, 0.2, 0.9]), pin.SE3.Random()
    contact.update_NE_matrix(com, pose)
    assert contact.get_pose() == contact.getPose() == pose
    np.testing.assert_array_equal(contact.NE_A(), contact.ne_A())
    assert np.abs(contact.NE_A()).max() > 0.0


def test_model_and_data(talos, talos_standing):
    robot = talos.dynacom()
    assert robot.model() == talos.model
    zero = np.zeros(robot.model().nv)
    robot.computeDynamics(talos_standing, zero, zero)
    np.testing.assert_array_equal(robot.data().com[0], robot.getCoM())
    robot.distributeForce(robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM())
    np.testing.assert_array_equal(robot.NE_A(), robot.ne_A())
    np.testing.assert_array_equal(robot.NE_b(), robot.ne_b())
    assert robot.NE_A().shape == (6, 12)
    np.testing.assert_allclose(robot.NE_b()[2], 9.81 * robot.getMass())


def test_model_and_data_keep_the_robot_alive(talos):
    model, data = talos.dynacom().model(), talos.dynacom().data()
    assert model.nq == talos.model.nq
    assert len(data.oMi) == talos.model.njoints


def test_script_written_for_1_2(talos, talos_standing):
    """Nothing but old spellings and positional arguments."""
    settings = Contact6DSettings()
    settings.frame_name = "leg_left_sole_fix_joint"
    settings.mu = 0.3
    settings.gu = 0.4
    settings.weights = np.array([1, 1, 1, 1, 1, 1])
    settings.half_length = 0.1
    settings.half_width = 0.05
    left = Contact6D()
    left.initialize(settings)
    settings.frame_name = "leg_right_sole_fix_joint"
    right = Contact6D()
    right.initialize(settings)
    left.set_mu(0.5)
    left.set_force_weights(np.array([1, 1, 1]))

    robot = DynaCoM()
    robot.initialize(talos.model)
    robot.addContact6d(left, "left", True)
    robot.addContact6d(right, "right", False)
    robot.activateContact6d("right")
    assert left.get_settings()["frame_name"] == "leg_left_sole_fix_joint"
    assert robot.model().frames[left.get_frame_id()].name == "leg_left_sole_fix_joint"

    q = talos_standing
    v = np.zeros(robot.model().nv, dtype=int)
    a = np.zeros(robot.model().nv, dtype=int)
    # A script may run Pinocchio by itself, before and after.
    pin.forwardKinematics(robot.model(), robot.data(), q)
    pin.updateFramePlacements(robot.model(), robot.data())
    robot.computeDynamics(q, v, a, np.zeros(6), False)
    np.testing.assert_allclose(
        left.get_pose().homogeneous, robot.data().oMf[left.get_frame_id()].homogeneous
    )
    robot.computeNL(3.2)
    robot.computeNL(3.2, q, v, a, np.zeros(6), True)
    robot.distributeForce(robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM())
    np.testing.assert_allclose(robot.NE_A() @ robot.allForces(), robot.NE_b(), atol=1e-6)
    weight = left.appliedForce()[2] + right.appliedForce()[2]
    np.testing.assert_allclose(weight, 9.81 * robot.getMass())
    assert robot.getActiveContacts() == ["left", "right"]

    robot.deactivateContact6d("left")
    robot.removeContact6d("right")
    with pytest.raises(ValueError, match="right"):
        robot.getContact("right")
    assert dynacom.DynaCoM is DynaCoM
