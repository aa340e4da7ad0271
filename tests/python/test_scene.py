# SPDX-License-Identifier: BSD-2-Clause
"""The scene in 3D: what is recorded of it, and the live one."""

import base64
import dataclasses
import io
import re
import sys
import threading
from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin
import pinocchio.visualize
import pytest
import trimesh
import zstandard
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import ConvexHull

from browser import open_page, wait_for
from dynacom import ContactSchedule, DynacomError, Motion, scene, scene_robot
from dynacom.repair_change import Before
from dynacom.robots import Robot
from dynacom.scene_before import MovingPath
from helpers import robots_folder
from report_case import Arrays, Summary, repaired_walk, report, walk_report

Report = tuple[np.ndarray, Arrays, Summary]


@pytest.fixture(scope="module")
def walk(talos: Robot) -> Report:
    """As if a feasible motion were beside it, by 2 cm in the middle."""
    q, arrays, summary = walk_report(talos)
    displacement = np.zeros_like(arrays["com"])
    displacement[:, 1] = 0.02 * np.sin(np.linspace(0.0, np.pi, len(displacement)))
    com = arrays["com"] + displacement
    return q, arrays | {"distance": displacement[:, 1], "feasible_com": com}, summary


@pytest.fixture(scope="module")
def recording(talos: Robot, walk: Report) -> scene.Recording:
    return scene.record(talos, *walk)


class Player:
    """Plays a recording, as viser's page does: what every object is like at a time."""

    def __init__(self, recording: scene.Recording) -> None:
        content = re.search(r'__VISER_EMBED_DATA__="([^"]*)"', recording.html)[1]
        packed = base64.b64decode(content)
        size = int.from_bytes(packed[:8], "little")
        raw = zstandard.ZstdDecompressor().decompress(packed[8:], max_output_size=size)
        end = 8 + int.from_bytes(raw[:8], "little")
        file = msgspec.msgpack.decode(raw[8:end])
        self.duration = file["durationSeconds"]
        self.messages = file["messages"]
        self.buffers = []
        for length in file["binaryBufferLengths"]:
            end += -end % 8
            self.buffers.append(raw[end : end + length])
            end += length

    def at(self, time: float) -> dict[str, dict[str, Any]]:
        objects: dict[str, dict[str, Any]] = defaultdict(
            lambda: {"visible": True, "position": [0.0, 0.0, 0.0], "wxyz": [1.0, 0.0, 0.0, 0.0]}
        )
        for when, message in self.messages:
            if when > time + 1e-9:
                break
            if message["type"] == "RemoveSceneNodeMessage":
                objects.pop(message["name"], None)
            elif "name" in message:
                fields = message.get("props") or message.get("updates") or message
                objects[message["name"]] |= {
                    key: self._unpack(value) for key, value in fields.items()
                }
        return objects

    def _unpack(self, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        return np.frombuffer(self.buffers[value["__binary_index"]], dtype=value["dtype"])


@pytest.fixture(scope="module")
def player(recording: scene.Recording) -> Player:
    return Player(recording)


def frames_of(recording: scene.Recording, arrays: Arrays) -> np.ndarray:
    return np.searchsorted(arrays["time"], arrays["time"][0] + recording.times - 1e-6)


def test_times(recording, player, walk):
    """15 frames a second, and those that reasons lead to."""
    _, arrays, summary = walk
    times = arrays["time"] - arrays["time"][0]
    worst = {reason["time"] for reason in summary["reasons"]}
    assert worst <= set(recording.times)
    assert set(recording.times) <= set(times)
    assert len(recording.times) == pytest.approx(15 * summary["duration"], abs=len(worst) + 1)
    assert np.diff(recording.times).max() <= 1.0 / 15.0 + summary["duration"] / len(times)
    assert recording.times[0] == 0.0
    assert recording.times[-1] == times[-1]
    assert player.duration == pytest.approx(times[-1] + 1.0 / 15.0)
    assert recording.note is None


def test_rates(talos, walk):
    q, arrays, summary = walk
    summary = summary | {"reasons": []}
    for rate, count in ((2.0, 13), (1e6, len(q))):
        assert len(scene.record(talos, q, arrays, summary, rate).times) == count


def test_most_frames(talos, walk, monkeypatch):
    monkeypatch.setattr(scene, "_MOST_FRAMES", 20)
    q, arrays, summary = walk
    assert len(scene.record(talos, q, arrays, summary | {"reasons": []}).times) == 20


def test_nothing_is_added_again(player):
    later = {message["type"] for time, message in player.messages if time > 0.0}
    assert later == {
        "SetPositionMessage",
        "SetOrientationMessage",
        "SetSceneNodeVisibilityMessage",
        "SceneNodeUpdateMessage",
    }


def test_robot_moves_by_its_names(talos, walk, recording, player):
    """As a model read without DynaCoM does, whose joints have other numbers."""
    q, arrays, _ = walk
    frames = frames_of(recording, arrays)
    assert_moves(talos, q, "/world/robot", player, zip(recording.times, frames, strict=True))


def assert_moves(
    talos: Robot, q: np.ndarray, name: str, player: Player, moments: Iterable[tuple[float, int]]
) -> None:
    """All meshes below a name are where the configurations put them, at times of frames."""
    urdf = str(talos.urdf)
    folders = [str(robots_folder().parents[1])]
    own = pin.buildModelFromUrdf(urdf)  # without free-flyer
    visuals = pin.buildGeomFromUrdf(own, urdf, pin.GeometryType.VISUAL, package_dirs=folders)
    assert visuals.ngeoms > 40
    data, placements = own.createData(), visuals.createData()
    for time, frame in list(moments)[::20]:
        root = pin.XYZQUATToSE3(pin.normalize(talos.model, q[frame])[:7])
        pin.updateGeometryPlacements(own, data, visuals, placements, q[frame, 7:])
        objects = player.at(time)
        for visual, placement in zip(visuals.geometryObjects, placements.oMg, strict=True):
            drawn = objects[f"{name}/visual/{visual.name}"]
            w, *xyz = drawn["wxyz"]
            expected = root * placement
            # viser leaves out what moves by less than a micrometre.
            assert_allclose(drawn["position"], expected.translation, atol=1e-6)
            assert_allclose(pin.Quaternion(w, *xyz).matrix(), expected.rotation, atol=1e-6)
            assert drawn["visible"]


def test_points(walk, recording, player):
    _, arrays, summary = walk
    ground = np.median([*summary["ground"].values()])
    centre = (arrays["com"].min(axis=0) + arrays["com"].max(axis=0)) / 2.0
    for time, frame in list(zip(recording.times, frames_of(recording, arrays), strict=True))[::7]:
        objects = player.at(time)
        com = arrays["com"][frame]
        assert_allclose(objects["/world"]["position"], [*-centre[:2], 0.0], atol=1e-12)
        assert_allclose(objects["/world/com"]["position"], com)
        assert_allclose(objects["/world/plumb"]["points"], [*com, *com[:2], ground], rtol=1e-6)
        for name in ("cop", "vrp"):
            drawn = objects[f"/world/{name}"]
            assert_allclose(drawn["position"], [*arrays[name][frame], ground], atol=1e-7)
        drawn = objects["/world/feasible_com"]
        assert_allclose(drawn["position"], arrays["feasible_com"][frame], atol=1e-7)
        assert drawn["visible"] == (arrays["distance"][frame] > 1e-3)


def test_forces(talos, walk, recording, player):
    """Arrows begin at the contact's centre of pressure; m g is as long as the CoM is high."""
    _, arrays, summary = walk
    weight = 9.81 * summary["mass"]
    height = np.median(arrays["com"][:, 2])
    active = 0
    for time, frame in list(zip(recording.times, frames_of(recording, arrays), strict=True))[::7]:
        objects = player.at(time)
        for number, name in enumerate(talos.contacts):
            quaternion = arrays[f"contact.{name}.rotation"][frame]
            pose = pin.SE3(
                pin.Quaternion(quaternion).matrix(), arrays[f"contact.{name}.position"][frame]
            )
            for ending, key in (("", "force"), (", measured", "measured_force")):
                drawn = objects[f"/world/forces/{number} {name}{ending}"]
                force = arrays[f"contact.{name}.{key}"][frame]
                assert drawn["visible"] == force.any()
                if not drawn["visible"]:
                    continue
                active += 1
                start, end = drawn["points"].reshape(2, 3)
                cop = arrays[f"contact.{name}.cop"][frame]
                assert_allclose(start, pose.act(np.array([*cop, 0.0])), atol=1e-3)
                assert_allclose(end - start, pose.rotation @ force / weight * height, atol=2e-3)
    assert active > 10


def test_support(talos, walk, recording, player):
    """The convex hull of the active soles, in all its corners."""
    _, arrays, _ = walk
    for time, frame in list(zip(recording.times, frames_of(recording, arrays), strict=True))[::7]:
        corners = np.concatenate(
            [
                scene.surface_corners(settings, arrays, name)[frame]
                for name, settings in talos.contacts.items()
                if arrays[f"contact.{name}.active"][frame]
            ]
        )
        drawn = player.at(time)["/world/support/area"]
        area = drawn["vertices"].reshape(-1, 3)
        faces = drawn["faces"].reshape(-1, 3)
        a, b, c = (area[faces[:, corner], :2] for corner in range(3))
        doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        assert doubled.min() > -1e-6
        assert doubled.sum() / 2.0 == pytest.approx(ConvexHull(corners[:, :2]).volume, rel=0.02)
        border = player.at(time)["/world/support/border"]["points"].reshape(-1, 2, 3)
        assert_allclose(border[:, 0], area)


def test_what_is_not_there_is_hidden(talos, walk):
    """In flight there is no support, no force and no CoP; afterwards there are again."""
    q, arrays, summary = walk
    arrays = {name: array.copy() for name, array in arrays.items()}
    flight = slice(100, 200)
    arrays["cop"][flight] = np.nan
    for name in talos.contacts:
        arrays[f"contact.{name}.active"][flight] = False
        for key in ("force", "measured_force", "torque", "measured_torque"):
            arrays[f"contact.{name}.{key}"][flight] = 0.0
    player = Player(scene.record(talos, q, arrays, summary))
    names = ["cop", "support/area", "support/border"]
    arrows = [f"forces/{number} {name}" for number, name in enumerate(talos.contacts)]
    for time, visible in ((0.0, True), (3.0, False), (4.5, True)):
        objects = player.at(time)
        assert [objects[f"/world/{name}"]["visible"] for name in names] == 3 * [visible]
        assert any(objects[f"/world/{name}"]["visible"] for name in arrows) == visible
        assert objects["/world/com"]["visible"]


def test_camera_follows_a_long_way(talos, walk):
    q, arrays, summary = walk
    ahead = 2.0 * arrays["time"]
    q, arrays = q.copy(), {name: array.copy() for name, array in arrays.items()}
    q[:, 0] += ahead
    arrays["com"][:, 0] += ahead
    recording = scene.record(talos, q, arrays, summary)
    player = Player(recording)
    for time, frame in zip(recording.times, frames_of(recording, arrays), strict=True):
        if 1.0 < time < recording.times[-1] - 1.0:
            offset = player.at(time)["/world"]["position"]
            assert_allclose(arrays["com"][frame, :2] + offset[:2], 0.0, atol=0.1)


def visuals_of(urdf: str) -> tuple[pin.Model, pin.GeometryModel]:
    path = str(robots_folder() / urdf)
    model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer())
    folders = [str(robots_folder().parents[1])]
    return model, pin.buildGeomFromUrdf(model, path, pin.GeometryType.VISUAL, package_dirs=folders)


def test_meshes_with_y_up():
    """iCub's legs, whose meshes' files say so and mean it, are as long as from joint to joint."""
    model, visuals = visuals_of("icub_description/robots/icub.urdf")
    scene_robot.turn_upright(model, visuals)
    data, placements = model.createData(), visuals.createData()
    pin.updateGeometryPlacements(model, data, visuals, placements, pin.neutral(model))
    for link, upper, lower in (
        ("upper_leg", "hip_yaw", "knee"),
        ("lower_leg", "knee", "ankle_pitch"),
    ):
        number = visuals.getGeometryId(f"l_{link}_0")
        geometry = visuals.geometryObjects[number].geometry
        geometry.computeLocalAABB()
        corners = np.array([geometry.aabb_local.min_, geometry.aabb_local.max_])
        heights = [placements.oMg[number].act(corner)[2] for corner in corners]
        joints = [
            data.oMi[model.getJointId(f"l_{joint}")].translation[2] for joint in (upper, lower)
        ]
        assert min(heights) <= min(joints) + 0.01
        assert max(heights) >= max(joints) - 0.01


@pytest.mark.parametrize(
    "urdf",
    [
        "borinot_description/urdf/borinot_flying_arm_2.urdf",
        "anymal_c_simple_description/urdf/anymal.urdf",
    ],
)
def test_meshes_that_stay(urdf):
    """Those of the one say so, too, but are not meant to be turned; the other's do not."""
    model, visuals = visuals_of(urdf)
    before = [visual.placement.copy() for visual in visuals.geometryObjects]
    scene_robot.turn_upright(model, visuals)
    assert [visual.placement for visual in visuals.geometryObjects] == before


# ---- Before repair ----


@pytest.fixture(scope="module")
def repaired(talos: Robot) -> tuple[Before, np.ndarray, Arrays, Summary]:
    return repaired_walk(talos)


@pytest.fixture(scope="module")
def compared(talos: Robot, repaired) -> scene.Recording:
    before, *after = repaired
    return scene.record(talos, *after, before=before)


@pytest.fixture(scope="module")
def compared_player(compared: scene.Recording) -> Player:
    return Player(compared)


def test_ghost_moves_as_before(talos, repaired, compared, compared_player):
    before, q, arrays, _ = repaired
    assert compared.note is None
    moments = list(zip(compared.times, frames_of(compared, arrays), strict=True))
    assert_moves(talos, before.q, "/world/before/robot", compared_player, moments)
    assert_moves(talos, q, "/world/robot", compared_player, moments)


def test_ghost_has_one_color_and_the_same_meshes(compared_player):
    """Their vertices are in the recording once."""
    objects = compared_player.at(0.0)
    ghosts = {name: item for name, item in objects.items() if "/before/robot/visual/" in name}
    assert len(ghosts) > 40
    assert {tuple(item["color"]) for item in ghosts.values()} == {scene.COLORS["ghost"]}
    assert {item["opacity"] for item in ghosts.values()} == {0.2}
    assert not any(item["cast_shadow"] for item in ghosts.values())
    places = {
        message["name"]: message["props"]["vertices"]["__binary_index"]
        for _, message in compared_player.messages
        if message["type"] == "MeshMessage" and "/visual/" in message["name"]
    }
    shared = [name for name in ghosts if name in places]
    assert len(shared) > 20
    for name in shared:
        assert places[name] == places[name.replace("/before", "")]


def test_ghost_of_collada(anymal, anymal_standing):
    """Whose meshes have colours of their own, and are as large in both."""
    nv = anymal.model.nv
    motion = Motion(np.arange(3) / 10.0, np.tile(anymal_standing, (3, 1)), *np.zeros((2, 3, nv)))
    schedule = ContactSchedule(list(anymal.contacts), np.ones((3, 4), dtype=bool))
    arrays, summary = report(anymal, motion, schedule)
    before = Before(motion.q, arrays, summary)
    player = Player(scene.record(anymal, motion.q, arrays, summary, before=before))
    messages = {message["name"]: message for _, message in player.messages if "props" in message}
    ghosts = {name: item for name, item in messages.items() if "/before/robot/visual/" in name}
    plain = [name for name, item in ghosts.items() if item["type"] == "MeshMessage"]
    assert len(plain) > 10
    assert all(tuple(item["props"]["color"]) == scene.COLORS["ghost"] for item in ghosts.values())
    objects = player.at(0.0)
    for name in plain:
        original = messages[name.replace("/before", "")]
        assert original["type"] == "GlbMessage"
        file = player._unpack(original["props"]["glb_data"])
        expected = trimesh.load_scene(io.BytesIO(bytes(file)), file_type="glb").bounds
        drawn = objects[name]["vertices"].reshape(-1, 3)
        assert_allclose([drawn.min(axis=0), drawn.max(axis=0)], expected, atol=1e-5)


def test_ghost_is_gone_in_between(compared, compared_player):
    """Every frame is there with it, then without; all else is the same."""
    assert len(compared.times_without_ghost) == len(compared.times)
    assert (compared.times_without_ghost > compared.times).all()
    assert (compared.times_without_ghost[:-1] < compared.times[1:]).all()
    for shown, hidden in list(zip(compared.times, compared.times_without_ghost, strict=True))[::9]:
        shown, hidden = compared_player.at(shown), compared_player.at(hidden)
        assert shown["/world/before"].pop("visible")
        assert not hidden["/world/before"].pop("visible")
        assert shown.keys() == hidden.keys()
        for name, item in shown.items():
            assert all(np.array_equal(value, hidden[name][key]) for key, value in item.items())


def test_no_ghost(recording, player):
    assert recording.times_without_ghost is None
    assert not [name for name in player.at(0.0) if "before" in name or "path" in name]


def test_points_before_and_after(repaired, compared, compared_player):
    """Where CoM and CoP are and were, and their paths within half a second."""
    before, _, after, summary = repaired
    ground = np.median([*summary["ground"].values()])
    time = after["time"] - after["time"][0]
    for now, frame in list(zip(compared.times, frames_of(compared, after), strict=True))[::7]:
        objects = compared_player.at(now)
        assert_allclose(
            objects["/world/before/com_before"]["position"], before.arrays["com"][frame]
        )
        ball = objects["/world/before/cop_before"]
        if ball["visible"]:
            cop = before.arrays["cop"][frame]
            assert_allclose(ball["position"], [*cop, ground + 0.004], atol=1e-7)
        else:
            away = before.arrays["cop"][frame] - before.arrays["com"][frame, :2]
            assert not np.linalg.norm(away) < 0.8
        near = np.abs(time - now) <= 0.5
        for name, arrays in (("before/com_before", before.arrays), ("com", after)):
            pieces = objects[f"/world/{name}_path"]["points"].reshape(-1, 2, 3)
            place = arrays["com"][near]
            distances = np.linalg.norm(pieces.reshape(-1, 1, 3) - place, axis=2)
            assert distances.min(axis=1).max() < 1e-6  # it has no other points
            assert distances.min(axis=0).max() < 0.02  # and comes by all of them
            # It goes on from where it was.
            assert_allclose(pieces[1:, 0], pieces[:-1, 1], atol=1e-9)


def test_paths_have_holes(repaired):
    """Where points are not known, or pressure is far from the feet."""

    class Lines:
        def add_line_segments(self, name, points, color, **options):
            return self

    lines = Lines()
    time = np.arange(90) / 30.0
    points = np.column_stack([time, time, time])
    points[40:50] = np.nan
    path = MovingPath(lines, "/path", time, points, (1, 2, 3), thickness=0.1)
    path.show(44)
    drawn = np.unique(lines.points.reshape(-1, 3)[:, 0])
    assert lines.visible
    assert_allclose(drawn, np.delete(time, np.s_[40:50])[29:50], atol=1e-6)
    points[:] = np.nan
    MovingPath(lines, "/path", time, points, (1, 2, 3), thickness=0.1).show(10)
    assert not lines.visible


def test_ghost_without_meshes(talos, repaired, tmp_path):
    urdf = tmp_path / "bare.urdf"
    text = re.sub(r"<visual>.*?</visual>", "", talos.urdf.read_text(), flags=re.DOTALL)
    urdf.write_text(text)
    robot = dataclasses.replace(talos, urdf=urdf)
    before, *after = repaired
    recording = scene.record(robot, *after, before=before)
    objects = Player(recording).at(0.0)
    drawn = objects["/world/before/robot"]
    assert np.unique(drawn["colors"].reshape(-1, 3), axis=0).tolist() == [[*scene.COLORS["ghost"]]]
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, before.q[0])
    places = np.array([placement.translation for placement in data.oMi[2:]])
    assert_allclose(drawn["points"].reshape(-1, 2, 3)[: len(places), 1], places, atol=1e-6)


# ---- Robots without meshes ----


def lines(player: Player, time: float) -> np.ndarray:
    return player.at(time)["/world/robot"]["points"].reshape(-1, 2, 3)


def assert_skeleton(robot: Robot, walk: Report, reason: str) -> None:
    q, arrays, _ = walk
    recording = scene.record(robot, *walk)
    assert re.search(reason, recording.note)
    assert "\n" not in recording.note
    data = robot.model.createData()
    time, frame = recording.times[50], frames_of(recording, arrays)[50]
    pin.forwardKinematics(robot.model, data, q[frame])
    drawn = lines(Player(recording), time)
    places = np.array([placement.translation for placement in data.oMi[2:]])
    count = len(places)
    assert_allclose(drawn[:count, 1], places, atol=1e-6)
    parents = [data.oMi[parent].translation for parent in robot.model.parents[2:]]
    assert_allclose(drawn[:count, 0], parents, atol=1e-6)
    soles = [arrays[f"contact.{name}.position"][frame] for name in robot.contacts]
    assert_allclose(drawn[count:, 1], soles, atol=1e-6)


def test_missing_meshes(talos, walk, tmp_path):
    urdf = tmp_path / "talos.urdf"
    urdf.write_text(talos.urdf.read_text().replace("package://", "package://nowhere/"))
    robot = dataclasses.replace(talos, urdf=urdf)
    assert_skeleton(robot, walk, r"^The robot is drawn as lines: its meshes .*nowhere")


def test_no_meshes(talos, walk, tmp_path):
    urdf = tmp_path / "bare.urdf"
    text = re.sub(r"<visual>.*?</visual>", "", talos.urdf.read_text(), flags=re.DOTALL)
    urdf.write_text(text)
    robot = dataclasses.replace(talos, urdf=urdf)
    assert_skeleton(robot, walk, r"^bare\.urdf has no visuals: the robot is drawn as lines\.$")


def test_meshes_that_cannot_be_shown(talos, walk, monkeypatch):
    def refuse(self, geometry, *_):
        if geometry.name.startswith("leg_left_2"):
            raise RuntimeError("Unsupported\ngeometry")
        return show(self, geometry, *_)

    kind = pinocchio.visualize.ViserVisualizer
    show = kind.loadViewerGeometryObject
    monkeypatch.setattr(kind, "loadViewerGeometryObject", refuse)
    assert_skeleton(talos, walk, r"\(Unsupported geometry\)")
    objects = Player(scene.record(talos, *walk)).at(0.0)
    assert not [name for name in objects if "visual" in name]


def test_points_for_feet(anymal, anymal_standing):
    """Contacts at points: no sole has corners, and two points no area."""
    nv = anymal.model.nv
    names = list(anymal.contacts)
    active = np.array([[True, True, True, True], [True, False, False, True], 4 * [False]])
    motion = Motion(
        np.array([0.0, 0.5, 1.0]),
        np.tile(anymal_standing, (3, 1)),
        np.zeros((3, nv)),
        np.zeros((3, nv)),
    )
    arrays, summary = report(anymal, motion, ContactSchedule(names, active))
    recording = scene.record(anymal, motion.q, arrays, summary)
    assert recording.note is None
    player = Player(recording)
    area, two = (player.at(time)["/world/support/area"]["vertices"] for time in (0.0, 0.5))
    assert len(np.unique(area.reshape(-1, 3), axis=0)) == 4
    assert len(np.unique(two.reshape(-1, 3), axis=0)) == 2
    assert not player.at(1.0)["/world/support/area"]["visible"]


def test_names_of_contacts(talos, walk):
    q, arrays, summary = walk
    old = next(iter(talos.contacts))
    new = "a/b\udcff\n<b>"
    robot = dataclasses.replace(
        talos,
        contacts={new if name == old else name: item for name, item in talos.contacts.items()},
    )
    arrays = {
        key.replace(f"contact.{old}.", f"contact.{new}."): array for key, array in arrays.items()
    }
    objects = Player(scene.record(robot, q, arrays, summary)).at(0.0)
    assert "/world/forces/0 a_b__<b>" in objects


def test_without_viser(talos, walk, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    for function in (scene.record, lambda *report: scene.show(*report, announce=print)):
        with pytest.raises(DynacomError, match=r"viser, which is not .*: pip install dynacom\[mot"):
            function(talos, *walk)


# ---- The live scene ----


def test_show(talos, walk, capsys):
    """It tells where it is, plays, is paused by its slider, and ends with its button."""
    addresses: list[str] = []
    thread = threading.Thread(
        target=scene.show, args=(talos, *walk), kwargs={"announce": addresses.append}, daemon=True
    )
    thread.start()
    wait_for(lambda: addresses, "the address")
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+", addresses[0])
    with open_page(addresses[0], width=640, height=480) as tab:
        time = tab.get_by_role("slider").first
        play = tab.get_by_label("Play", exact=True)
        play.wait_for()
        before = float(time.get_attribute("aria-valuenow"))
        wait_for(lambda: float(time.get_attribute("aria-valuenow")) != before, "it to play")
        assert play.is_checked()
        time.press("ArrowRight")
        wait_for(lambda: not play.is_checked(), "it to pause")
        assert tab.locator("input[disabled]").input_value() == "Solved"
        tab.get_by_role("button", name="Stop").click()
        thread.join(30.0)
        assert not thread.is_alive()
    assert capsys.readouterr() == ("", "")


def test_the_ghost_can_be_hidden(talos, repaired, monkeypatch):
    before, *after = repaired
    shown: list[scene.Scene] = []

    class Kept(scene.Scene):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            shown.append(self)

    monkeypatch.setattr(scene, "Scene", Kept)
    addresses: list[str] = []
    stop = threading.Event()
    more = {"announce": addresses.append, "stop": stop, "before": before}
    thread = threading.Thread(target=scene.show, args=(talos, *after), kwargs=more, daemon=True)
    thread.start()
    wait_for(lambda: addresses, "the address")
    with open_page(addresses[0], width=640, height=480) as tab:
        assert shown[0].ghost.visible
        tab.get_by_label("Before repair", exact=True).click()
        wait_for(lambda: not shown[0].ghost.visible, "the ghost to go")
        tab.get_by_label("Before repair", exact=True).click()
        wait_for(lambda: shown[0].ghost.visible, "the ghost to come")
    stop.set()
    thread.join(30.0)
    assert not thread.is_alive()


def test_show_is_stopped(talos, walk):
    stop = threading.Event()
    scene.show(talos, *walk, announce=lambda _: stop.set(), stop=stop, port=0)


# ---- Geometry ----


def test_convex_hull():
    rng = np.random.default_rng(0)
    for count in (3, 4, 8, 30):
        points = rng.standard_normal((count, 2)).round(1)
        hull = scene.convex_hull(np.concatenate([points, points]))
        expected = ConvexHull(points)
        assert_array_equal(np.unique(hull, axis=0), np.unique(points[expected.vertices], axis=0))
        after = np.roll(hull, -1, axis=0)
        area = np.sum(hull[:, 0] * after[:, 1] - hull[:, 1] * after[:, 0]) / 2.0
        assert area == pytest.approx(expected.volume)


@pytest.mark.parametrize("points", [[[1, 2]], [[1, 2], [1, 2]], [[1, 2], [3, 4]]])
def test_convex_hull_of_few_points(points):
    assert_array_equal(scene.convex_hull(np.array(points)), np.unique(points, axis=0))


def test_convex_hull_of_a_line():
    hull = scene.convex_hull(np.array([[0.0, 0.0], [2.0, 2.0], [1.0, 1.0]]))
    assert_array_equal(hull, [[0.0, 0.0], [2.0, 2.0]])


def test_closest_frames():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.01, 1.0, 30))
    wanted = rng.uniform(-1.0, 20.0, 100)
    expected = np.abs(time - wanted[:, None]).argmin(axis=1)
    assert_array_equal(scene.closest_frames(time, wanted), expected)
    assert_array_equal(scene.closest_frames(np.array([3.0]), [1.0, 5.0]), [0, 0])


def test_surface_corners(talos, walk):
    _, arrays, _ = walk
    for name, settings in talos.contacts.items():
        corners = scene.surface_corners(settings, arrays, name)
        for frame in (0, 50):
            quaternion = pin.Quaternion(arrays[f"contact.{name}.rotation"][frame])
            pose = pin.SE3(quaternion.matrix(), arrays[f"contact.{name}.position"][frame])
            x, y = settings.half_length, settings.half_width
            expected = [pose.act(np.array([a * x, b * y, 0.0])) for a in (1, -1) for b in (1, -1)]
            assert_allclose(np.sort(corners[frame], axis=0), np.sort(expected, axis=0))
