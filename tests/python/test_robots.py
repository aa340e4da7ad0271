# SPDX-License-Identifier: BSD-2-Clause
import copy
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

from dynacom import Contact6DSettings, ContactPointSettings, DistributionStatus, DynacomError
from dynacom.robots import list_robots, load_robot, read_robot_file

ROBOTS = [path.stem for path in list_robots()]


def find_robots_folder() -> Path:
    folders = [Path(entry, "cmeel.prefix/share/example-robot-data/robots") for entry in sys.path]
    return next(folder for folder in folders if folder.is_dir())


def collision_geometry(robot, name):
    """Geometry objects of the robot's URDF, by name."""
    urdf = read_robot_file(next(path for path in list_robots() if path.stem == name)).urdf
    folder = find_robots_folder()
    geometry = pin.GeometryModel()
    pin.buildGeomFromUrdf(
        robot.model,
        str(folder / urdf),
        pin.GeometryType.COLLISION,
        geometry,
        [str(folder.parent.parent)],
    )
    return {item.name: item for item in geometry.geometryObjects}


def vertices(item):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return np.array([item.geometry.vertices(i) for i in range(item.geometry.num_vertices)])


def frame_in_joint(robot, name):
    frame = robot.model.frames[robot.model.getFrameId(robot.contacts[name].frame_name)]
    return frame.parentJoint, frame.placement


# The robots that come with the package.


def test_bundled_robots():
    assert ROBOTS == ["anymal_c", "talos"]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_contact_has_a_frame(name):
    robot = load_robot(name)
    assert robot.name == name
    assert robot.model.joints[1].shortname() == "JointModelFreeFlyer"
    for contact in robot.contacts.values():
        assert [f.name for f in robot.model.frames].count(contact.frame_name) == 1
    assert robot.dynacom().getActiveContacts() == list(robot.contacts)


@pytest.mark.parametrize(
    ("name", "standing"), [("talos", "talos_standing"), ("anymal_c", "anymal_standing")]
)
def test_standing(request, name, standing):
    """All contacts touch the ground, and bear the weight."""
    robot = load_robot(name)
    dynamics = robot.dynacom()
    q, zero = request.getfixturevalue(standing), np.zeros(robot.model.nv)
    dynamics.computeDynamics(q, zero, zero, flatHorizontalGround=False)
    for contact in robot.contacts:
        surface = dynamics.getContact(contact).getSurfacePose()
        assert surface.translation[2] == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(surface.rotation, np.eye(3), atol=1e-12)
    assert dynamics.getDistributionStatus() == DistributionStatus.Solved
    forces = [dynamics.getContact(contact).toWorldForces()[2] for contact in robot.contacts]
    assert min(forces) > 0.1 * 9.81 * dynamics.getMass()
    assert sum(forces) == pytest.approx(9.81 * dynamics.getMass(), rel=1e-9)


def test_masses(talos, anymal):
    """As their data sheets have it, within some per cent: 95 kg and 50 kg."""
    assert talos.dynacom().getMass() == pytest.approx(95.0, rel=0.1)
    assert anymal.dynacom().getMass() == pytest.approx(50.0, rel=0.1)


@pytest.mark.parametrize(
    ("name", "pairs"),
    [
        ("talos", [("left_sole", "right_sole")]),
        ("anymal_c", [("LF_FOOT", "RF_FOOT"), ("LH_FOOT", "RH_FOOT")]),
    ],
)
def test_left_mirrors_right(name, pairs):
    robot = load_robot(name)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))

    def place(contact):
        return data.oMf[robot.model.getFrameId(robot.contacts[contact].frame_name)].translation

    for left, right in pairs:
        assert place(left)[1] > 0.0
        np.testing.assert_allclose(place(left), place(right) * [1, -1, 1], atol=1e-9)
        settings = [copy.copy(robot.contacts[side]) for side in (left, right)]
        for side in settings:
            side.frame_name = "any"
        assert settings[0] == settings[1]


def test_talos_soles_lie_on_its_feet(talos):
    geometry = collision_geometry(talos, "talos")
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


def test_talos_yaw_friction_is_within_coulombs(talos):
    for settings in talos.contacts.values():
        corners = settings.mu * np.hypot(settings.half_length, settings.half_width)
        assert 0.5 * corners < settings.gu <= corners


def test_anymal_feet_are_the_balls_of_its_urdf(anymal):
    geometry = collision_geometry(anymal, "anymal_c")
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
            SOLE | {"weights": [1, 2, 3, 4, 5, 6]},
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
    assert robot.contacts["sole"] == sole
    assert robot.dynacom().getMass() == 2.0
    # The same as text, and the default weights.
    robot = load_robot(str(robot_file(with_contacts(SOLE))))
    np.testing.assert_array_equal(robot.contacts["sole"].weights, np.ones(6))


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
        ("", ["must be a mapping with the keys urdf, contacts, got None"]),
        ("[1, 2]", ["must be a mapping with the keys urdf, contacts, got [1, 2]"]),
        ("a: [", ["must be YAML"]),
        ("a: !!python/object:os.system {}", ["must be YAML"]),
        (with_contacts(POINT) | {"mass": 3}, ["unknown key 'mass', expected urdf, contacts"]),
        ({"contacts": [POINT]}, ["missing key 'urdf', got contacts"]),
        ({"urdf": "urdf/cart.urdf"}, ["missing key 'contacts', got urdf"]),
        (with_contacts(POINT) | {"urdf": 3}, ["urdf must be a text", "got 3"]),
        (with_contacts(POINT) | {"urdf": ""}, ["urdf must be a text", "got ''"]),
        (with_contacts(), ["contacts must be a list that is not empty, got []"]),
        (with_contacts() | {"contacts": {"a": 1}}, ["contacts must be a list", "got {'a': 1}"]),
        (with_contacts(POINT, SOLE, POINT), ["contact 'toe': name is taken"]),
        (with_contacts(POINT, 3), ["contacts[1] must be a mapping, got 3"]),
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
        "robot must be one of anymal_c, talos or the path of a .yaml file, got 'talso'"
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
