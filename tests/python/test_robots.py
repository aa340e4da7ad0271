# SPDX-License-Identifier: BSD-2-Clause
import copy
import re
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import collada
import joblib
import numpy as np
import pinocchio as pin
import pytest
import yaml
from scipy.optimize import brentq

from conftest import put_on_ground
from dynacom import (
    Contact6DSettings,
    ContactPointSettings,
    ContactSchedule,
    DistributionStatus,
    DynacomError,
    FrictionModel,
    Motion,
    analyzeMotion,
    computeContactMotions,
    countLanes,
)
from dynacom.robots import (
    list_robots,
    load_robot,
    make_robot,
    parse_payload,
    read_robot_file,
)
from helpers import SHARED_DATA

ROBOTS = [path.stem for path in list_robots()]


# Left and right contacts.
PAIRS = {
    "anymal_c": [("LF_FOOT", "RF_FOOT"), ("LH_FOOT", "RH_FOOT")],
    "bolt": [("FL_FOOT", "FR_FOOT")],
    "g1": [("left_sole", "right_sole")],
    "go2": [("FL_foot", "FR_foot"), ("RL_foot", "RR_foot")],
    "icub": [("left_sole", "right_sole")],
    "solo12": [("FL_FOOT", "FR_FOOT"), ("HL_FOOT", "HR_FOOT")],
    "talos": [("left_sole", "right_sole")],
}


def find_robots_folder() -> Path:
    folders = [Path(entry, "cmeel.prefix/share/example-robot-data/robots") for entry in sys.path]
    return next(folder for folder in folders if folder.is_dir())


def collision_geometry(robot):
    """Geometry objects of the robot's URDF, by name."""
    geometry = pin.GeometryModel()
    pin.buildGeomFromUrdf(
        robot.model,
        str(robot.urdf),
        pin.GeometryType.COLLISION,
        geometry,
        [str(find_robots_folder().parent.parent)],
    )
    return {item.name: item for item in geometry.geometryObjects}


def vertices(item):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return np.array([item.geometry.vertices(i) for i in range(item.geometry.num_vertices)])


def frame_in_joint(robot, name):
    frame = robot.model.frames[robot.model.getFrameId(robot.contacts[name].frame_name)]
    return frame.parentJoint, frame.placement


def facing_x(robot):
    """The default configuration, turned so that the robot looks along the world's x."""
    q = robot.default.copy()
    if robot.name == "icub":  # whose base's x points backwards
        q[3:7] = [0, 0, 1, 0]
    return q


def lean(q, roll, pitch):
    """q, with the base turned."""
    q = q.copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(roll, pitch, 0.0)).coeffs()
    return q


# The robots that come with the package.


def test_bundled_robots():
    assert sorted(PAIRS) == ROBOTS


@pytest.mark.parametrize("name", ROBOTS)
def test_every_contact_has_a_frame(name):
    robot = load_robot(name)
    assert robot.name == name
    assert robot.model.joints[1].shortname() == "JointModelFreeFlyer"
    assert robot.model.nq == 7 + robot.model.njoints - 2
    for contact in robot.contacts.values():
        assert [f.name for f in robot.model.frames].count(contact.frame_name) == 1
    assert robot.dynacom().getActiveContacts() == list(robot.contacts)
    assert robot.urdf == find_robots_folder() / read_robot_file(path_of(name)).urdf


def path_of(name):
    return next(path for path in list_robots() if path.stem == name)


def bears_its_weight(robot, q):
    dynamics = robot.dynacom()
    zero = np.zeros(robot.model.nv)
    dynamics.computeDynamics(q, zero, zero, flatHorizontalGround=False)
    assert dynamics.getDistributionStatus() == DistributionStatus.Solved
    forces = [dynamics.getContact(contact).toWorldForces()[2] for contact in robot.contacts]
    assert min(forces) > 0.1 * 9.81 * dynamics.getMass()
    assert sum(forces) == pytest.approx(9.81 * dynamics.getMass(), rel=1e-9)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("name", ROBOTS)
def test_lanes(name, flat):
    """Several frames at once are what each frame is on its own."""
    robot = load_robot(name)
    model, frames = robot.model, 101
    rng = np.random.default_rng(0)
    steps = 0.05 * rng.standard_normal((frames, model.nv))
    motion = Motion(
        np.arange(frames) / 50.0,
        np.array([pin.integrate(model, facing_x(robot), step) for step in steps]),
        0.2 * rng.standard_normal((frames, model.nv)),
        0.3 * rng.standard_normal((frames, model.nv)),
    )
    active = rng.random((frames, len(robot.contacts))) < 0.9
    schedule = ContactSchedule(list(robot.contacts), active)
    dynamics = robot.dynacom()
    expected = analyzeMotion(dynamics, motion, schedule, flat, omega=3.0, lanes=1)
    # Bolt's two points cannot give any wrench.
    assert expected.status.count(DistributionStatus.Solved) > 10 or name == "bolt"
    for lanes in (4, 8):
        found = analyzeMotion(dynamics, motion, schedule, flat, omega=3.0, lanes=lanes)
        assert found.status == expected.status
        weight = 9.81 * dynamics.getMass()
        for key in ("com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque", "cop"):
            assert_same(getattr(found, key), getattr(expected, key))
        for key in ("feasible_acom", "feasible_dam", "vrp", "nl", "dcm"):
            assert_same(getattr(found, key), getattr(expected, key))
        assert_same(found.residual / weight, expected.residual / weight)
        for one, other in zip(found.contacts, expected.contacts, strict=True):
            assert_same(one.wrench / weight, other.wrench / weight)
            for key in ("cop", "friction_usage", "yaw_usage", "cop_margin"):
                assert_same(getattr(one, key), getattr(other, key))
        placed, alone = (
            computeContactMotions(dynamics, motion, lanes=number) for number in (lanes, 1)
        )
        for one, other in zip(placed, alone, strict=True):
            for key in ("position", "rotation", "height", "velocity"):
                assert_same(getattr(one, key), getattr(other, key))


def test_lanes_are_there():
    """Where Linux says that the processor has them."""
    cpuinfo = Path("/proc/cpuinfo")
    flags = set(re.findall(r"\w+", cpuinfo.read_text())) if cpuinfo.exists() else set()
    avx2 = {"avx2", "fma"}
    avx512 = avx2 | {"avx512f", "avx512dq", "avx512vl", "avx512bw"}
    lanes = 8 if avx512 <= flags else 4 if avx2 <= flags else 1
    for name in ROBOTS:
        assert countLanes(load_robot(name).dynacom()) == lanes


def assert_same(actual, expected):
    scale = np.abs(np.nan_to_num(expected)).max() or 1.0
    np.testing.assert_allclose(actual / scale, expected / scale, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_standing(request, name):
    """All contacts touch the ground, the robot's lowest points, and bear the weight."""
    robot = load_robot(name)
    if name in ("talos", "anymal_c"):
        q = request.getfixturevalue(f"{name.removesuffix('_c')}_standing")
    else:
        q = put_on_ground(robot, facing_x(robot))
    dynamics = robot.dynacom()
    zero = np.zeros(robot.model.nv)
    dynamics.computeDynamics(q, zero, zero)
    # The frames of iCub's soles are that far from horizontal.
    tolerance = 2e-5 if name == "icub" else 1e-9
    for contact in robot.contacts:
        surface = dynamics.getContact(contact).getSurfacePose()
        assert surface.translation[2] == pytest.approx(0.0, abs=tolerance)
        np.testing.assert_allclose(surface.rotation, np.eye(3), atol=tolerance)

    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    heights = [
        lowest(item, data.oMi[item.parentJoint] * item.placement)
        for item in collision_geometry(robot).values()
    ]
    assert min(heights) == pytest.approx(0.0, abs=1e-3)
    if name != "bolt":
        bears_its_weight(robot, q)


def lowest(item, oMg):
    """Height of the lowest point of a geometry whose placement is oMg."""
    shape, up = item.geometry, oMg.rotation[2]  # in the geometry's frame
    match type(shape).__name__:
        case "Sphere":
            depth = shape.radius
        case "Box":
            depth = np.abs(up) @ shape.halfSide
        case "Cylinder":
            depth = np.hypot(up[0], up[1]) * shape.radius + abs(up[2]) * shape.halfLength
        case "BVHModelOBBRSS":
            depth = -(vertices(item) @ up).min()
    return oMg.translation[2] - depth


def test_bolt_stands_where_its_com_is_above_the_line_of_its_feet():
    robot = load_robot("bolt")
    dynamics = robot.dynacom()
    zero = np.zeros(robot.model.nv)

    def distance(pitch):
        dynamics.computeDynamics(lean(robot.default, 0.0, pitch), zero, zero)
        foot = dynamics.getContact("FL_FOOT").getSurfacePose().translation
        return dynamics.getCoM()[0] - foot[0]

    pitch = brentq(distance, -0.3, 0.3, xtol=1e-15)
    assert abs(pitch) < 0.1
    bears_its_weight(robot, lean(robot.default, 0.0, pitch))


@pytest.mark.parametrize(
    ("name", "mass"),
    [
        ("talos", 95.0),
        ("anymal_c", 50.0),
        ("g1", 35.0),
        ("bolt", 1.34),
        ("icub", 33.0),
        ("go2", 15.0),
        ("solo12", 2.5),
    ],
)
def test_masses(name, mass):
    """As data sheets and papers have them, within some per cent."""
    assert load_robot(name).dynacom().getMass() == pytest.approx(mass, rel=0.15)


@pytest.mark.parametrize("name", ROBOTS)
def test_left_mirrors_right(name):
    robot = load_robot(name)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, facing_x(robot))

    def place(contact):
        return data.oMf[robot.model.getFrameId(robot.contacts[contact].frame_name)].translation

    tolerance = 2e-5 if name == "icub" else 1e-9
    for left, right in PAIRS[name]:
        assert place(left)[1] > 0.0
        np.testing.assert_allclose(place(left), place(right) * [1, -1, 1], atol=tolerance)
        settings = [copy.copy(robot.contacts[side]) for side in (left, right)]
        for side in settings:
            side.frame_name = "any"
        assert settings[0] == settings[1]
    assert [contact for pair in PAIRS[name] for contact in pair] == list(robot.contacts)


@pytest.mark.parametrize("name", ROBOTS)
def test_defaults_are_within_limits(name):
    robot = load_robot(name)
    assert (robot.default[7:] >= robot.model.lowerPositionLimit[7:]).all()
    assert (robot.default[7:] <= robot.model.upperPositionLimit[7:]).all()
    np.testing.assert_array_equal(robot.default[:7], pin.neutral(robot.model)[:7])


def test_talos_soles_lie_on_its_feet(talos):
    geometry = collision_geometry(talos)
    for side in ("left", "right"):
        settings = talos.contacts[f"{side}_sole"]
        joint, placement = frame_in_joint(talos, f"{side}_sole")
        foot = geometry[f"leg_{side}_6_link_0"]
        assert foot.parentJoint == joint
        points = np.array([placement.actInv(foot.placement * point) for point in vertices(foot)])
        # The frame is at the mesh's lowest plane, and the rectangle inside the mesh.
        assert points[:, 2].min() == pytest.approx(0.0, abs=1e-3)
        half = np.array([settings.half_length, settings.half_width])
        assert (points[:, :2].min(axis=0) < -half).all()
        assert (points[:, :2].max(axis=0) > half).all()
        # It does not reach beyond the flat part by more than the rim's rounding.
        flat = points[points[:, 2] < 1e-3, :2]
        assert (flat.min(axis=0) < 0.01 - half).all()
        assert (flat.max(axis=0) > half - 0.01).all()


@pytest.mark.parametrize("name", ["talos", "g1", "icub"])
def test_yaw_friction_is_within_coulombs(name):
    for settings in load_robot(name).contacts.values():
        corners = settings.mu * np.hypot(settings.half_length, settings.half_width)
        assert 0.5 * corners < settings.gu <= corners


def test_g1_soles_lie_between_the_spheres_of_its_urdf():
    robot = load_robot("g1")
    urdf = ElementTree.parse(robot.urdf)
    for side in ("left", "right"):
        joint, placement = frame_in_joint(robot, f"{side}_sole")
        assert robot.model.names[joint] == f"{side}_ankle_roll_joint"
        (link,) = urdf.findall(f"link[@name='{side}_ankle_roll_link']")
        spheres = []
        for collision in link.findall("collision"):
            assert float(collision.find("geometry/sphere").get("radius")) == 0.005
            assert collision.find("origin").get("rpy") == "0 0 0"
            spheres.append([float(x) for x in collision.find("origin").get("xyz").split()])
        assert len(spheres) == 4
        points = np.array([placement.actInv(np.array(sphere)) for sphere in spheres])
        np.testing.assert_allclose(points[:, 2], 0.005, atol=1e-12)
        # A rectangle from the hindmost spheres to the foremost, as wide as the narrower pair.
        settings = robot.contacts[f"{side}_sole"]
        np.testing.assert_allclose(np.abs(points[:, 0]), settings.half_length, atol=1e-12)
        np.testing.assert_allclose(points[:, 0].sum(), 0.0, atol=1e-12)
        assert np.abs(points[:, 1]).min() == pytest.approx(settings.half_width, abs=1e-12)
        np.testing.assert_allclose(placement.rotation, np.eye(3), atol=1e-12)


def sole_mesh(robot, link):
    """Vertices of the link's collision mesh in the link's frame: from its file, which says which
    axis is up."""
    (collision,) = ElementTree.parse(robot.urdf).findall(f"link[@name='{link}']/collision")
    file = collision.find("geometry/mesh").get("filename")
    mesh = collada.Collada(
        str(find_robots_folder().parent.parent / file.removeprefix("package://"))
    )
    assert mesh.assetInfo.upaxis == "Y_UP"
    y_up = np.concatenate(
        [part.vertex for item in mesh.scene.objects("geometry") for part in item.primitives()]
    )
    z_up = y_up @ pin.utils.rotate("x", np.pi / 2).T
    origin = collision.find("origin")
    xyz, rpy = (np.array(origin.get(key).split(), dtype=float) for key in ("xyz", "rpy"))
    return z_up @ pin.rpy.rpyToMatrix(rpy).T + xyz


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # pycollada's matrices
def test_icub_soles_lie_in_its_feet():
    robot = load_robot("icub")
    frames = {frame.name: frame for frame in robot.model.frames}
    for side in ("left", "right"):
        settings = robot.contacts[f"{side}_sole"]
        joint, placement = frame_in_joint(robot, f"{side}_sole")
        foot = frames[f"{side[0]}_foot"]
        assert foot.parentJoint == joint
        points = (
            sole_mesh(robot, foot.name) @ foot.placement.rotation.T + foot.placement.translation
        )
        points = (points - placement.translation) @ placement.rotation
        assert points[:, 2].min() == pytest.approx(0.0, abs=1e-4)
        octagon = points[points[:, 2] < 1e-3, :2]
        assert len(octagon) == 8
        octagon = octagon[np.argsort(np.arctan2(octagon[:, 1], octagon[:, 0]))]
        edges = np.roll(octagon, -1, axis=0) - octagon
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        rectangle = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)]) * [
            settings.half_length,
            settings.half_width,
        ]
        # Every corner lies in the octagon; those in front and one behind at its rim.
        beyond = (rectangle @ normals.T - (octagon * normals).sum(axis=1)).max(axis=1)
        assert (beyond <= 0.0).all()
        assert (np.sort(beyond)[1:] > -1e-3).all()


@pytest.mark.parametrize(
    ("name", "pitches", "tolerance"),
    [
        # Wheels: however they have rolled.
        ("bolt", (-np.pi, np.pi), 2e-4),
        ("solo12", (-np.pi, np.pi), 2e-4),
        # While it stands.
        ("go2", (-1.2, 0.0), 4e-4),
    ],
)
def test_feet_touch_the_ground_where_their_balls_do(name, pitches, tolerance):
    robot = load_robot(name)
    geometry = collision_geometry(robot)
    for contact, settings in robot.contacts.items():
        assert settings.world_aligned
        joint, placement = frame_in_joint(robot, contact)
        foot = geometry[f"{contact}_0"]
        assert foot.parentJoint == joint
        points = np.array([foot.placement.act(point) for point in vertices(foot)])
        for pitch in np.linspace(*pitches, 31):
            for roll in np.linspace(-0.3, 0.3, 7):
                # The ground's normal in the joint's frame: the shank leans forward, and outwards.
                up = pin.rpy.rpyToMatrix(roll, pitch, 0.0)[2]
                ball = up @ placement.translation - settings.radius
                assert (points @ up).min() == pytest.approx(ball, abs=tolerance)


def test_anymal_feet_are_the_balls_of_its_urdf(anymal):
    geometry = collision_geometry(anymal)
    for name, settings in anymal.contacts.items():
        joint, placement = frame_in_joint(anymal, name)
        ball = geometry[f"{name}_1"]
        assert ball.parentJoint == joint
        np.testing.assert_allclose(placement.translation, ball.placement.translation, atol=1e-12)
        assert settings.radius == ball.geometry.radius
        assert settings.world_aligned


def test_anymal_touches_below_the_ball_however_the_leg_points(anymal):
    dynamics = anymal.dynacom()
    q = pin.randomConfiguration(anymal.model, -np.ones(19), np.ones(19))
    zero = np.zeros(anymal.model.nv)
    dynamics.computeDynamics(q, zero, zero)
    data = dynamics.getData()
    for name in anymal.contacts:
        foot = anymal.model.frames[anymal.model.getFrameId(name)]
        ball = (data.oMi[foot.parentJoint] * foot.placement).act(np.array([0.0, 0.0, 0.0225]))
        surface = dynamics.getContact(name).getSurfacePose()
        np.testing.assert_allclose(surface.translation, ball - [0.0, 0.0, 0.03], atol=1e-12)
        np.testing.assert_allclose(surface.rotation, np.eye(3), atol=1e-12)


# Robot.joints.


def test_joints(toy):
    joints = toy.joints
    assert joints.names == ("a_slide", "c_wheel", "m_hip", "z_knee", "b_toe")
    np.testing.assert_array_equal(joints.idx_q, [7, 8, 10, 11, 12])
    np.testing.assert_array_equal(joints.turns, [False, True, True, True, True])
    np.testing.assert_array_equal(joints.unlimited, [False, True, False, False, False])


@pytest.mark.parametrize(
    "names", [(), ("z_knee",), ("c_wheel", "b_toe", "a_slide"), ("m_hip", "a_slide", "c_wheel")]
)
def test_some_joints(toy, names):
    some = toy.joints.take([*names])
    assert some.names == names
    model = toy.model
    joints = [model.joints[model.getJointId(name)] for name in names]
    np.testing.assert_array_equal(some.idx_q, [joint.idx_q for joint in joints])
    np.testing.assert_array_equal(some.turns, [name != "a_slide" for name in names])
    np.testing.assert_array_equal(some.unlimited, [name == "c_wheel" for name in names])


def test_all_joints_as_they_stand(toy):
    assert toy.joints.take([*toy.joints.names]) is toy.joints


def test_robots_do_not_share_joints(talos, anymal):
    """Not even those that were made of one another."""
    assert talos.joints.names != anymal.joints.names
    other = replace(talos, model=anymal.model)
    assert other.joints.names == anymal.joints.names


# Robot.dynacom().


def test_dynacoms_share_nothing(talos):
    first, second = talos.dynacom(), talos.dynacom()
    first.getContact("left_sole").setMu(0.1)
    assert second.getContact("left_sole").getSettings().mu == 0.7
    assert talos.contacts["left_sole"].mu == 0.7


def test_inactive_contacts(anymal):
    dynamics = anymal.dynacom(inactive=["LF_FOOT", "RH_FOOT"])
    assert dynamics.getActiveContacts() == ["RF_FOOT", "LH_FOOT"]
    assert set(dynamics.getKnownContacts()) == set(anymal.contacts)


def test_unknown_inactive_contact(talos):
    with pytest.raises(ValueError, match=r"talos \(left_sole, right_sole\), got hand$"):
        talos.dynacom(inactive=["left_sole", "hand"])


# Files of one's own.

URDF = """<robot name="cart">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="foot"/>
  <joint name="leg" type="fixed"><parent link="base"/><child link="foot"/>
    <origin xyz="0.1 0.2 -0.3" rpy="0 0 1.5707963267948966"/></joint>
</robot>"""

POINT = {"name": "toe", "kind": "point", "frame": "foot", "mu": 0.5}
SOLE = {
    "name": "sole",
    "kind": "6d",
    "frame": "foot",
    "mu": 0.5,
    "gu": 0.1,
    "half_length": 0.2,
    "half_width": 0.3,
}


@pytest.fixture
def robot_file(tmp_path):
    """Writes a robot file, with its URDF beside it."""

    def write(content, name="cart.yaml"):
        (tmp_path / "urdf").mkdir(exist_ok=True)
        (tmp_path / "urdf" / "cart.urdf").write_text(URDF)
        path = tmp_path / name
        path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
        return path

    return write


def with_contacts(*contacts):
    return {"urdf": "urdf/cart.urdf", "contacts": list(contacts)}


def without(mapping, key):
    return {other: value for other, value in mapping.items() if other != key}


@pytest.mark.parametrize("name", ["cart.yaml", "cart.yml"])
def test_own_file(robot_file, name):
    path = robot_file(
        with_contacts(
            POINT | {"weights": [1, 2, 3], "world_aligned": True, "radius": 0.02},
            SOLE | {"weights": [1, 2, 3, 4, 5, 6], "coupled_yaw": True},
        ),
        name,
    )
    robot = load_robot(path)
    assert robot.name == "cart"
    assert list(robot.contacts) == ["toe", "sole"]
    toe = ContactPointSettings()
    toe.frame_name, toe.mu, toe.weights = "foot", 0.5, np.array([1.0, 2.0, 3.0])
    toe.world_aligned, toe.radius = True, 0.02
    assert robot.contacts["toe"] == toe
    sole = Contact6DSettings()
    sole.frame_name, sole.mu, sole.gu, sole.half_length, sole.half_width = (
        "foot",
        0.5,
        0.1,
        0.2,
        0.3,
    )
    sole.weights = np.arange(1.0, 7.0)
    sole.coupled_yaw = True
    assert robot.contacts["sole"] == sole
    assert robot.dynacom().getMass() == 2.0
    # The same as text, and the default weights.
    robot = load_robot(str(robot_file(with_contacts(SOLE))))
    np.testing.assert_array_equal(robot.contacts["sole"].weights, np.ones(6))


def test_friction(robot_file):
    """Of contacts, and by what motions are judged; else they are what the classes are."""
    contacts = with_contacts(
        POINT | {"friction": "cone"},
        SOLE | {"friction": "facets", "facets": 6, "facet_angle": 0.25},
        POINT | {"name": "heel"},
    )
    robot = load_robot(robot_file(contacts | {"friction": "inner-pyramid"}))
    assert robot.friction == FrictionModel.InnerPyramid
    assert robot.contacts["toe"].friction == FrictionModel.Cone
    sole = robot.contacts["sole"]
    assert (sole.friction, sole.facets, sole.facet_angle) == (FrictionModel.Facets, 6, 0.25)
    assert robot.contacts["heel"].friction == FrictionModel.OuterPyramid
    assert load_robot(robot_file(contacts)).friction == FrictionModel.Cone


def test_frames_of_contacts(robot_file):
    """xyz and rpy place a frame as in URDF, in the frame given."""
    robot = load_robot(
        robot_file(
            with_contacts(
                POINT | {"xyz": [1, 0, 0]},
                SOLE | {"rpy": [0.1, 0.2, 0.3]},
                POINT | {"name": "heel", "xyz": [0, 0, -1], "rpy": [np.pi, 0, 0]},
                POINT | {"name": "plain"},
            )
        )
    )
    frames = {frame.name: frame.placement for frame in robot.model.frames}
    foot = frames["foot"]
    np.testing.assert_allclose(foot.translation, [0.1, 0.2, -0.3])
    # The foot is turned by a quarter about z: its x is y.
    np.testing.assert_allclose(frames["toe_contact"].translation, [0.1, 1.2, -0.3], atol=1e-12)
    np.testing.assert_array_equal(frames["toe_contact"].rotation, foot.rotation)
    np.testing.assert_allclose(
        frames["sole_contact"].rotation,
        foot.rotation
        @ pin.utils.rotate("z", 0.3)
        @ pin.utils.rotate("y", 0.2)
        @ pin.utils.rotate("x", 0.1),
        atol=1e-12,
    )
    np.testing.assert_allclose(frames["heel_contact"].translation, [0.1, 0.2, -1.3])
    np.testing.assert_allclose(frames["heel_contact"].rotation[:, 2], [0, 0, -1], atol=1e-12)
    assert {name: settings.frame_name for name, settings in robot.contacts.items()} == {
        "toe": "toe_contact",
        "sole": "sole_contact",
        "heel": "heel_contact",
        "plain": "foot",
    }
    dynamics = robot.dynacom()
    dynamics.computeDynamics(pin.neutral(robot.model), np.zeros(6), np.zeros(6))
    pose = dynamics.getContact("toe").getPose()
    np.testing.assert_allclose(pose.homogeneous, frames["toe_contact"].homogeneous, atol=1e-12)


def test_a_copy_of_a_bundled_file_works_anywhere(tmp_path, talos):
    path = tmp_path / "mine.yaml"
    path.write_text(next(path for path in list_robots() if path.stem == "talos").read_text())
    assert load_robot(path).contacts == talos.contacts


# Joints: where they are by default, and the orders of fewer of them.

JOINTS = """<robot name="mast">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="wheel"/><link name="arm"/><link name="rod"/><link name="ball"/><link name="foot"/>
  <joint name="wheel" type="continuous"><parent link="base"/><child link="wheel"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="rod"/>
    <axis xyz="0 0 1"/><limit lower="0.1" upper="0.3" effort="1" velocity="1"/></joint>
  <joint name="throw" type="floating"><parent link="base"/><child link="ball"/></joint>
  <joint name="ankle" type="fixed"><parent link="base"/><child link="foot"/></joint>
</robot>"""


@pytest.fixture
def mast(robot_file):
    """Writes the file of a robot with joints of several kinds."""

    def write(**keys):
        path = robot_file(with_contacts(POINT) | keys)
        (path.parent / "urdf" / "cart.urdf").write_text(JOINTS)
        return path

    return write


def test_default(mast):
    robot = load_robot(mast(default={"elbow": -0.75, "slide": 0.2, "wheel": 7}))
    model = robot.model
    expected = pin.neutral(model)
    expected[model.idx_qs[model.getJointId("elbow")]] = -0.75
    expected[model.idx_qs[model.getJointId("slide")]] = 0.2
    # A joint without limits has a cosine and a sine.
    wheel = model.idx_qs[model.getJointId("wheel")]
    expected[wheel : wheel + 2] = np.cos(7.0), np.sin(7.0)
    np.testing.assert_allclose(robot.default, expected, rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        robot.default[0] = 1.0
    np.testing.assert_array_equal(load_robot(mast()).default, pin.neutral(model))
    # Limits are included.
    assert load_robot(mast(default={"elbow": -1, "slide": 0.3})).default[7:].min() == -1.0


@pytest.mark.parametrize(
    ("default", "part"),
    [
        *(
            (
                {"elbow": 0.5, name: 0.1},
                f"default must name joints of the URDF that turn or slide, got '{name}'",
            )
            for name in ("hand", "universe", "root_joint", "ankle", "throw")
        ),
        ({"elbow": 0.6}, "default: elbow must be within its limits, -1 to 0.5, got 0.6"),
        ({"elbow": -1.1}, "default: elbow must be within its limits, -1 to 0.5, got -1.1"),
        ({"slide": 0}, "default: slide must be within its limits, 0.1 to 0.3, got 0"),
    ],
)
def test_bad_default(mast, default, part):
    refuses(mast(default=default), part)


def test_joint_layouts(mast):
    layouts = [["slide", "wheel"], ["elbow"]]
    robot = load_robot(mast(joint_layouts=layouts))
    assert robot.joint_layouts == (("slide", "wheel"), ("elbow",))
    assert load_robot(mast()).joint_layouts == ()


@pytest.mark.parametrize(
    ("layouts", "part"),
    [
        *(
            (
                [["elbow"], ["slide", name]],
                f"joint_layouts must name joints of the URDF that turn or slide, got '{name}'",
            )
            for name in ("hand", "universe", "root_joint", "ankle", "throw")
        ),
        ([["elbow", "slide", "elbow"]], "must name a joint once, got 'elbow' 2 times"),
        (
            [["elbow"], ["slide"]],
            "joint_layouts must differ in length from each other and from the robot's 4 joints, "
            "got one of 1",
        ),
    ],
)
def test_bad_joint_layouts(mast, layouts, part):
    refuses(mast(joint_layouts=layouts), part)


def test_a_joint_layout_is_not_as_long_as_all_joints(robot_file):
    path = robot_file(with_contacts(POINT) | {"joint_layouts": [["knee", "hip"]]})
    urdf = path.parent / "urdf" / "cart.urdf"
    for joint in ("hip", "knee"):
        part = f"""<link name="{joint}"/><joint name="{joint}" type="continuous">
          <parent link="base"/><child link="{joint}"/><axis xyz="0 1 0"/></joint></robot>"""
        urdf.write_text(urdf.read_text().replace("</robot>", part))
    refuses(path, "and from the robot's 2 joints, got one of 2")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_g1_of_23_joints():
    """A clip of the retargeting tools has the axes of its joints, too."""
    robot = load_robot("g1")
    (layout,) = robot.joint_layouts
    assert set(robot.model.names[2:]) - set(layout) == {
        f"{side}_wrist_{axis}_joint"
        for side in ("left", "right")
        for axis in ("roll", "pitch", "yaw")
    }
    assert list(layout) == [name for name in robot.model.names if name in layout]
    path = SHARED_DATA / "squat_level1.pkl"
    if not path.is_file():
        pytest.skip("the folder ../shared/data is not there")
    (clip,) = joblib.load(path).values()
    # The rotation vectors of the root, of the joints, and of three bodies without any.
    vectors, angles = clip["pose_aa"][:, 1:24], clip["dof"]
    urdf = ElementTree.parse(robot.urdf)
    for index, name in enumerate(layout):
        axis = np.array(urdf.find(f"joint[@name='{name}']/axis").get("xyz").split(), dtype=float)
        np.testing.assert_allclose(vectors[:, index], np.outer(angles[:, index], axis), atol=1e-6)


def test_icub_without_neck():
    robot = load_robot("icub")
    reduced = pin.buildModelFromUrdf(
        str(robot.urdf.with_name("icub_reduced.urdf")), pin.JointModelFreeFlyer()
    )
    assert robot.joint_layouts == (tuple(reduced.names[2:]),)


# URDFs with a floating joint of their own.


def test_floating_base(robot_file):
    path = robot_file(with_contacts(POINT))
    urdf = path.parent / "urdf" / "cart.urdf"
    base = """<link name="world"/><joint name="floating_base" type="floating">
      <parent link="world"/><child link="base"/></joint></robot>"""
    urdf.write_text(URDF.replace("</robot>", base))
    robot = load_robot(path)
    assert (robot.model.nq, robot.model.nv) == (7, 6)
    assert list(robot.model.names) == ["universe", "floating_base"]
    path.write_text(path.read_text().replace("frame: foot", "frame: world"))
    refuses(path, "contact 'toe': frame must be the robot's, got the world's, 'world'")


def test_g1_has_one_free_flyer(tmp_path):
    """Its URDF has a floating joint in a comment, for those who want it."""
    robot = load_robot("g1")
    assert (robot.model.nq, robot.model.nv) == (7 + 29, 6 + 29)
    text = robot.urdf.read_text()
    start, stop = text.index("<!-- <link name="), text.index("</joint> -->") + len("</joint> -->")
    floating = text[start:stop].removeprefix("<!--").removesuffix("-->")
    assert 'type="floating"' in floating
    path = tmp_path / "floating.urdf"
    path.write_text(text[:start] + floating + text[stop:])
    other = make_robot(path, ["left_ankle_roll_link:point:mu=1"])
    assert list(other.model.names)[1:] == ["floating_base_joint", *list(robot.model.names)[2:]]
    assert other.model.nq == 7 + 29
    assert other.dynacom().getMass() == robot.dynacom().getMass()


# Payloads.


def test_payload(talos):
    """A point mass, fixed to the frame."""
    loaded = talos.with_payload("gripper_right_base_link", 3.0, [0.1, -0.2, 0.3])
    assert loaded.contacts == talos.contacts
    assert (loaded.name, loaded.urdf) == (talos.name, talos.urdf)
    np.testing.assert_array_equal(loaded.default, talos.default)
    rng = np.random.default_rng(1)
    q = pin.integrate(talos.model, talos.default, rng.standard_normal(talos.model.nv))
    v, a = rng.standard_normal((2, talos.model.nv))
    before, after = talos.dynacom(), loaded.dynacom()
    for dynamics in (before, after):
        dynamics.computeDynamics(q, v, a)
    assert after.getMass() == pytest.approx(before.getMass() + 3.0, rel=1e-12)

    # Its place and acceleration, of a frame of its own.
    model = talos.model.copy()
    hand = model.frames[model.getFrameId("gripper_right_base_link")]
    place = hand.placement * pin.SE3(np.eye(3), np.array([0.1, -0.2, 0.3]))
    frame = model.addFrame(pin.Frame("load", hand.parentJoint, 0, place, pin.FrameType.OP_FRAME))
    data = model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacement(model, data, frame)
    acceleration = pin.getFrameClassicalAcceleration(
        model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).linear
    load, com = data.oMf[frame].translation, before.getCoM()
    total = before.getMass() + 3.0
    np.testing.assert_allclose(
        after.getCoM(), (before.getMass() * com + 3.0 * load) / total, rtol=0, atol=1e-12
    )
    force = 3.0 * (acceleration + [0.0, 0.0, 9.81])
    np.testing.assert_allclose(
        after.getGroundCoMForce(), before.getGroundCoMForce() + force, rtol=0, atol=1e-9
    )

    def moment(dynamics):
        """That of the ground about the world's origin: a point mass has no inertia of its own."""
        return dynamics.getGroundCoMTorque() + np.cross(
            dynamics.getCoM(), dynamics.getGroundCoMForce()
        )

    np.testing.assert_allclose(
        moment(after), moment(before) + np.cross(load, force), rtol=0, atol=1e-9
    )


def test_payloads_add_up_and_change_no_other_robot(talos):
    mass = talos.dynacom().getMass()
    one = talos.with_payload("torso_2_link", 2)
    two = one.with_payload("torso_2_link", 2).with_payload("left_sole_link", 1e-3, (0, 0, 1))
    assert talos.dynacom().getMass() == mass
    assert one.dynacom().getMass() == pytest.approx(mass + 2.0, rel=1e-12)
    assert two.dynacom().getMass() == pytest.approx(mass + 4.001, rel=1e-12)


def test_payload_on_a_contacts_frame():
    robot = load_robot("g1")
    loaded = robot.with_payload("left_sole_contact", 1.0)
    assert loaded.dynacom().getMass() == pytest.approx(robot.dynacom().getMass() + 1.0)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("hand", 1.0), "frame must be the name of one frame of the URDF, got 'hand', which none"),
        (("universe", 1.0), "frame must be the robot's, got the world's, 'universe'"),
        (("torso_2_link", 0.0), "mass must be positive and finite, got 0.0"),
        (("torso_2_link", -1), "mass must be positive and finite, got -1"),
        (("torso_2_link", np.nan), "mass must be positive and finite, got nan"),
        (("torso_2_link", np.inf), "mass must be positive and finite, got inf"),
        (("torso_2_link", 1.0, (0, 0)), "position must be 3 finite numbers, got [0. 0.]"),
        (("torso_2_link", 1.0, (0, 0, np.inf)), "position must be 3 finite numbers, got"),
    ],
)
def test_bad_payload(talos, arguments, part):
    with pytest.raises(DynacomError) as caught:
        talos.with_payload(*arguments)
    assert str(caught.value).startswith(f"payload of talos: {part}")


@pytest.mark.parametrize(
    ("text", "payload"),
    [
        ("hand:3", ("hand", 3.0, (0.0, 0.0, 0.0))),
        ("left hand:3.5e-1@0.1,-2,3", ("left hand", 0.35, (0.1, -2.0, 3.0))),
        ("arm:hand:1", ("arm:hand", 1.0, (0.0, 0.0, 0.0))),
        # For with_payload() to refuse.
        ("hand:-1@0,0,inf", ("hand", -1.0, (0.0, 0.0, np.inf))),
    ],
)
def test_parse_payload(text, payload):
    assert parse_payload(text) == payload


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hand",
        "3",
        ":3",
        "hand:",
        "hand:a",
        "hand:1@",
        "hand:1@0,0",
        "hand:1@0,0,0,0",
        "hand:1@0,0,a",
        "hand:@0,0,0",
        "hand:1@0 0 0",
        "hand 1",
    ],
)
def test_bad_text_of_a_payload(text):
    with pytest.raises(DynacomError) as caught:
        parse_payload(text)
    assert str(caught.value) == f"payload must be FRAME:MASS or FRAME:MASS@x,y,z, got '{text}'"


# Robots without a file.


def test_make_robot(talos):
    """What a file can say, texts can."""
    sole = "6d:half_length=0.10,half_width=0.06,mu=0.7,gu=0.08"
    texts = [f"leg_{side}_sole_fix_joint:{sole},name={side}_sole" for side in ("left", "right")]
    robot = make_robot(talos.urdf, texts)
    assert robot.name == "talos_reduced"
    assert (robot.contacts, robot.urdf, robot.joint_layouts) == (talos.contacts, talos.urdf, ())
    assert robot.model == talos.model
    np.testing.assert_array_equal(robot.default, pin.neutral(talos.model))
    # A path in example-robot-data.
    robot = make_robot("talos_data/robots/talos_reduced.urdf", texts, name="tall")
    assert (robot.name, robot.urdf) == ("tall", talos.urdf)


def test_make_robot_with_all_keys(robot_file):
    contacts = [
        POINT | {"name": "foot"},
        POINT | {"name": "a=b:c", "world_aligned": True, "radius": 0.5, "weights": [1, 2, 3.5]},
        POINT | {"name": "toe", "world_aligned": False, "xyz": [0, 1e-2, -3]},
        SOLE | {"weights": [1, 2, 3, 4, 5, 6], "rpy": [0.1, -0.2, 0.3], "xyz": [1, 2, 3]},
    ]
    path = robot_file(with_contacts(*contacts))
    made = make_robot(
        path.parent / "urdf" / "cart.urdf",
        [
            "foot:point:mu=0.5",
            "foot:point:mu=0.5,name=a=b:c,world_aligned=true,radius=0.5,weights=1/2/3.5",
            "foot:point:world_aligned=false,mu=.5,xyz=0/1e-2/-3,name=toe",
            "foot:6d:name=sole,mu=0.5,gu=0.1,half_length=0.2,half_width=0.3,weights=1/2/3/4/5/6,"
            "rpy=0.1/-0.2/0.3,xyz=1/2/3",
        ],
    )
    robot = load_robot(path)
    assert made.contacts == robot.contacts
    assert list(made.contacts) == ["foot", "a=b:c", "toe", "sole"]
    assert made.model == robot.model
    assert (made.name, made.urdf) == (robot.name, robot.urdf)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "must be FRAME:KIND:KEY=VALUE,..."),
        ("foot", "must be FRAME:KIND:KEY=VALUE,..."),
        ("foot:point", "must be FRAME:KIND:KEY=VALUE,..."),
        (":point:mu=1", "must be FRAME:KIND:KEY=VALUE,..."),
        ("foot:point:", "must be FRAME:KIND:KEY=VALUE,..., got '' for KEY=VALUE"),
        ("foot:point:mu", "must be FRAME:KIND:KEY=VALUE,..., got 'mu' for KEY=VALUE"),
        ("foot:point:mu=1,", "must be FRAME:KIND:KEY=VALUE,..., got '' for KEY=VALUE"),
        ("foot:line:mu=1", "kind must be point or 6d, got 'line'"),
        ("foot:point:radius=1", "missing key 'mu'"),
        ("foot:point:mu=1,mu=1", "mu must be given once, got 'mu=1'"),
        ("foot:point:mu=1,frame=hand", "frame must be given once, got 'frame=hand'"),
        ("foot:point:mu=1,kind=6d", "kind must be given once, got 'kind=6d'"),
        ("foot:point:mu=1,name=", "name must be a text that is not empty, got ''"),
        ("foot:point:mu=1,gu=1", "unknown key 'gu', expected name, kind, frame, mu, xyz"),
        ("foot:point:mu=1,=1", "unknown key '', expected"),
        ("foot:point:mu=a", "mu must be a finite number, got 'a'"),
        ("foot:point:mu=", "mu must be a finite number, got ''"),
        ("foot:point:mu=nan", "mu must be a finite number, got nan"),
        ("foot:point:mu=1/2", "mu must be a finite number, got [1.0, 2.0]"),
        ("foot:point:mu=-1", "mu must be"),
        ("foot:point:mu=1,xyz=1/2", "xyz must be a list of 3 finite numbers, got [1.0, 2.0]"),
        ("foot:point:mu=1,xyz=1/2/a", "xyz must be a list of 3 finite numbers, got '1/2/a'"),
        ("foot:point:mu=1,world_aligned=1", "world_aligned must be true or false, got 1.0"),
        ("foot:6d:mu=1,gu=1,half_length=1", "missing key 'half_width'"),
    ],
)
def test_bad_text_of_a_contact(robot_file, text, part):
    urdf = robot_file(with_contacts(POINT)).parent / "urdf" / "cart.urdf"
    refuses(f"contact '{text}'", part, load=lambda _: make_robot(urdf, [text]))


def test_what_else_is_wrong_with_a_robot_without_a_file(robot_file):
    urdf = robot_file(with_contacts(POINT)).parent / "urdf" / "cart.urdf"

    def refuses_robot(start, *parts, urdf=urdf, texts=("foot:point:mu=1",)):
        refuses(start, *parts, load=lambda _: make_robot(urdf, texts))

    refuses_robot(urdf, "contacts must be given, got none", texts=())
    refuses_robot(urdf, "contact 'foot': name is taken", texts=["foot:point:mu=1"] * 2)
    refuses_robot(urdf, "contact 'hand': frame must be the name", texts=["hand:point:mu=1"])
    refuses_robot("urdf must be a file or in example-robot-data, got 'van.urdf'", urdf="van.urdf")
    urdf.write_text("<robot")
    refuses_robot(urdf, "urdf: ")


def test_make_robot_without_example_robot_data(monkeypatch):
    monkeypatch.setattr(sys, "path", [])
    with pytest.raises(DynacomError) as caught:
        make_robot("van.urdf", ["foot:point:mu=1"])
    assert str(caught.value) == (
        "urdf 'van.urdf' is not a file, and example-robot-data, which may have it, is not "
        "installed: pip install dynacom[robots]"
    )


# What is wrong with a file.


def refuses(path, *parts, load=load_robot):
    with pytest.raises(DynacomError) as caught:
        load(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (
            "",
            [
                "must be a mapping with the keys urdf, contacts, friction, default",
                "joint_layouts, got None",
            ],
        ),
        (
            "[1, 2]",
            [
                "must be a mapping with the keys urdf, contacts, friction, default",
                "joint_layouts, got [1, 2]",
            ],
        ),
        ("a: [", ["must be YAML"]),
        ("a: !!python/object:os.system {}", ["must be YAML"]),
        (with_contacts(POINT) | {"mass": 3}, ["unknown key 'mass', expected urdf, contacts"]),
        (
            with_contacts(POINT) | {"friction": "round"},
            ["friction must be one of cone, outer-pyramid, inner-pyramid, facets, got 'round'"],
        ),
        ({"contacts": [POINT]}, ["missing key 'urdf', got contacts"]),
        ({"urdf": "urdf/cart.urdf"}, ["missing key 'contacts', got urdf"]),
        (with_contacts(POINT) | {"urdf": 3}, ["urdf must be a text", "got 3"]),
        (with_contacts(POINT) | {"urdf": ""}, ["urdf must be a text", "got ''"]),
        (with_contacts(), ["contacts must be a list that is not empty, got []"]),
        (with_contacts() | {"contacts": {"a": 1}}, ["contacts must be a list", "got {'a': 1}"]),
        (with_contacts(POINT, SOLE, POINT), ["contact 'toe': name is taken"]),
        (with_contacts(POINT, 3), ["contacts[1] must be a mapping, got 3"]),
        *(
            (
                with_contacts(POINT) | {"default": value},
                [f"default must be a mapping of joints' names to finite numbers, got {value!r}"],
            )
            for value in (3, [1], {"knee": "a"}, {"knee": True}, {"knee": float("nan")}, {3: 1.0})
        ),
        *(
            (
                with_contacts(POINT) | {"joint_layouts": value},
                [f"joint_layouts must be a list of lists of joints' names, got {value!r}"],
            )
            for value in (3, {"knee": 1}, ["knee"], [[]], [["knee", 3]], [["knee"], None])
        ),
    ],
)
def test_bad_file(robot_file, content, parts):
    refuses(robot_file(content), *parts, load=read_robot_file)


@pytest.mark.parametrize(
    ("contact", "parts"),
    [
        (without(POINT, "name"), ["contacts[0]: missing key 'name', got frame, kind, mu"]),
        (POINT | {"name": 3}, ["contacts[0]: name must be a text", "got 3"]),
        (POINT | {"name": ""}, ["name must be a text that is not empty, got ''"]),
        (without(POINT, "kind"), ["'toe': kind must be point or 6d, got None"]),
        (POINT | {"kind": "line"}, ["'toe': kind must be point or 6d, got 'line'"]),
        (POINT | {"kind": [1]}, ["'toe': kind must be point or 6d, got [1]"]),
        (without(POINT, "frame"), ["'toe': missing key 'frame'"]),
        (POINT | {"frame": None}, ["'toe': frame must be a text", "got None"]),
        (without(POINT, "mu"), ["'toe': missing key 'mu'"]),
        (POINT | {"mu": "1e-1x"}, ["'toe': mu must be a finite number, got '1e-1x'"]),
        (POINT | {"mu": True}, ["'toe': mu must be a finite number, got True"]),
        (POINT | {"mu": float("nan")}, ["'toe': mu must be a finite number, got nan"]),
        (POINT | {"mu": 10**400}, ["'toe': mu must be a finite number, got 1000"]),
        (POINT | {"mu": -0.5}, ["'toe': ", "mu must be", "-0.5"]),
        (POINT | {"radius": -1}, ["'toe': ", "radius must be", "-1"]),
        (POINT | {"radius": [1]}, ["'toe': radius must be a finite number, got [1]"]),
        (POINT | {"world_aligned": 1}, ["'toe': world_aligned must be true or false, got 1"]),
        (POINT | {"xyz": [0, 0]}, ["'toe': xyz must be a list of 3 finite numbers, got [0, 0]"]),
        (POINT | {"xyz": 3}, ["'toe': xyz must be a list of 3 finite numbers, got 3"]),
        (POINT | {"rpy": [0, 0, "a"]}, ["'toe': rpy must be a list of 3", "got [0, 0, 'a']"]),
        (POINT | {"rpy": [0, 0, float("inf")]}, ["'toe': rpy must be a list of 3 finite"]),
        (POINT | {"weights": [1] * 6}, ["'toe': weights must be a list of 3 finite numbers"]),
        (POINT | {"weights": [1, 0, 1]}, ["'toe': ", "weights must be"]),
        (POINT | {"friction": 1}, ["'toe': friction must be one of cone, outer-pyramid"]),
        (POINT | {"facets": 6.5}, ["'toe': facets must be a whole number, got 6.5"]),
        (POINT | {"facets": 3}, ["'toe': ", "facets must be from 4 to 64, got 3"]),
        (POINT | {"facet_angle": "x"}, ["'toe': facet_angle must be a finite number, got 'x'"]),
        (POINT | {"gu": 1}, ["'toe': unknown key 'gu', expected name, kind, frame, mu, xyz"]),
        (POINT | {3: 1}, ["'toe': unknown key 3"]),
        (SOLE | {"radius": 1}, ["'sole': unknown key 'radius', expected"]),
        (SOLE | {"weights": [1] * 3}, ["'sole': weights must be a list of 6 finite numbers"]),
        (SOLE | {"half_width": -1}, ["'sole': ", "half_width must be", "-1"]),
        *(
            (without(SOLE, key), [f"'sole': missing key '{key}'"])
            for key in ("mu", "gu", "half_length", "half_width")
        ),
    ],
)
def test_bad_contact(robot_file, contact, parts):
    refuses(robot_file(with_contacts(contact)), *parts, load=read_robot_file)


def test_unknown_frame(robot_file):
    refuses(
        robot_file(with_contacts(POINT | {"frame": "hand"})),
        "contact 'toe': frame must be the name of one frame of the URDF, got 'hand'",
        "none of them",
    )


def test_ambiguous_frame(robot_file):
    path = robot_file(with_contacts(POINT))
    urdf = path.parent / "urdf" / "cart.urdf"
    urdf.write_text(URDF.replace('"leg"', '"foot"'))
    refuses(path, "contact 'toe': frame must be the name of one frame", "'foot', which 2 of them")


def test_name_of_own_frame_is_taken(robot_file):
    path = robot_file(with_contacts(POINT | {"xyz": [0, 0, 1]}))
    urdf = path.parent / "urdf" / "cart.urdf"
    urdf.write_text(URDF.replace('"leg"', '"toe_contact"'))
    refuses(path, "contact 'toe': ", "'toe_contact', which the URDF has already")


def test_missing_file(tmp_path):
    refuses(tmp_path / "none.yaml", "cannot be read (No such file or directory)")


def test_binary_file(tmp_path):
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    refuses(path, "must be YAML")


def test_unknown_robot():
    with pytest.raises(DynacomError) as caught:
        load_robot("talso")
    assert str(caught.value) == (
        f"robot must be one of {', '.join(ROBOTS)} or the path of a .yaml file, got 'talso'"
    )


def test_missing_urdf(robot_file):
    path = robot_file(with_contacts(POINT) | {"urdf": "urdf/van.urdf"})
    refuses(path, "urdf must be a file beside this one or in example-robot-data", "'urdf/van.urdf'")


def test_example_robot_data_is_not_installed(robot_file, monkeypatch):
    path = robot_file(with_contacts(POINT) | {"urdf": "urdf/van.urdf"})
    monkeypatch.setattr(sys, "path", [])
    refuses(path, "'urdf/van.urdf'", "is not installed: pip install dynacom[robots]")


def test_bad_urdf(robot_file):
    path = robot_file(with_contacts(POINT))
    (path.parent / "urdf" / "cart.urdf").write_text("<robot")
    refuses(path, "urdf: ")


def test_the_file_that_the_documents_show(root, tmp_path):
    """The robot of docs/files.md is one."""
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", (root / "docs/files.md").read_text(), re.M | re.S)
    path = tmp_path / "shown.yaml"
    path.write_text(text)
    robot = load_robot(path)
    assert list(robot.contacts) == ["left_sole", "ball"]
    assert robot.contacts["left_sole"].frame_name == "left_sole_contact"
    assert robot.contacts["ball"].world_aligned
    assert robot.default[robot.model.idx_qs[robot.model.getJointId("arm_left_4_joint")]] == -0.5
    assert len(robot.joint_layouts) == 1
