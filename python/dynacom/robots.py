# SPDX-License-Identifier: BSD-2-Clause
"""Robots from files: a model, and where it touches the ground.

A robot file is YAML::

    urdf: path          # beside this file, or in example-robot-data's folder `robots`
    contacts:
      - name: left_sole       # as in motions' contact_names and in results
        kind: 6d              # a rectangle; or `point`
        frame: left_sole_link # a frame of the URDF
        xyz: [0, 0, 0]        # optional, as in URDF: the contact has a frame of its own, placed
        rpy: [0, 0, 0]        #   like this in the one above [m], [rad]
        mu: 0.7
        weights: [1, 1, 1, 1, 1, 1]  # optional; three for a point
        friction: outer-pyramid      # optional: cone, inner-pyramid, or facets, of which there are
        facets: 8                    #   so many, the first one turned by an angle [rad]
        facet_angle: 0.0
        # kind 6d only
        gu: 0.05
        half_length: 0.1
        half_width: 0.05
        coupled_yaw: false    # optional
        # kind point only, optional
        world_aligned: true
        radius: 0.02
    friction: cone            # optional: by what motions are judged, see docs/verdict.md
    default:                  # optional: joints that are not zero where nothing is known of them
      left_elbow_joint: 0.5   #   [rad], or [m] where they slide
    joint_layouts:            # optional: joints of the robot's smaller versions, in their order
      - [left_hip_joint, left_knee_joint, right_hip_joint, right_knee_joint]

The contacts' keys from ``mu`` on are the fields of ``Contact6DSettings`` and
``ContactPointSettings``, and mean the same. The files in the package's folder ``robots`` are known
by their names.
"""

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from dynacom.dynacom_pywrap import (
    CollisionPoints,
    Contact6D,
    Contact6DSettings,
    ContactPoint,
    ContactPointSettings,
    DynaCoM,
    DynaCoMSettings,
    FrictionModel,
    findCollisionPoints,
)
from dynacom.errors import DynacomError
from dynacom.yaml_file import is_number, read_yaml

ContactSettings: TypeAlias = ContactPointSettings | Contact6DSettings

#: What friction is called in robot files, settings and on the command line.
FRICTION_MODELS: Mapping[str, FrictionModel] = {
    "cone": FrictionModel.Cone,
    "outer-pyramid": FrictionModel.OuterPyramid,
    "inner-pyramid": FrictionModel.InnerPyramid,
    "facets": FrictionModel.Facets,
}

#: What forces are compared with in verdicts, whatever gravity is [m/s^2].
STANDARD_GRAVITY = 9.81

_FOLDER = Path(__file__).with_name("robots")


@dataclass(frozen=True)
class ContactEntry:
    """One contact of a robot file."""

    name: str
    #: ``point`` or ``6d``.
    kind: str
    #: frame_name is the file's `frame`.
    settings: ContactSettings
    #: Of the contact's own frame in the file's `frame`, if it has one.
    placement: pin.SE3 | None


@dataclass(frozen=True)
class RobotFile:
    """What a robot file says; nothing else has been read."""

    path: Path
    #: As written in the file.
    urdf: str
    #: In the file's order, which is that of results.
    contacts: tuple[ContactEntry, ...]
    #: Joint's name -> its coordinate [rad, m].
    default: Mapping[str, float] = field(default_factory=dict)
    #: As in :class:`Robot`.
    joint_layouts: tuple[tuple[str, ...], ...] = ()
    friction: FrictionModel = FrictionModel.Cone

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem


@dataclass(frozen=True, eq=False)
class Joints:
    """Joints of one degree of freedom, of which a motion's file can give a number."""

    names: tuple[str, ...]
    #: (n,) Where they begin in a configuration.
    idx_q: np.ndarray
    #: (n,) Whether they turn; the others slide.
    turns: np.ndarray
    #: (n,) Whether they have no limits: in a configuration they are a cosine and a sine.
    unlimited: np.ndarray

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Name -> its place among the names."""
        return {name: place for place, name in enumerate(self.names)}

    def take(self, names: Sequence[str]) -> "Joints":
        """Some of them, in another order."""
        if tuple(names) == self.names:
            return self
        places = [self.places[name] for name in names]
        return Joints(tuple(names), self.idx_q[places], self.turns[places], self.unlimited[places])


@dataclass(frozen=True)
class Robot:
    """A model and the settings of its contacts."""

    name: str
    #: With the contacts' own frames; its root joint is a free-flyer. Prints a line per joint.
    model: pin.Model = field(repr=False)
    #: Contact's name -> its settings, in the order of the file.
    contacts: Mapping[str, ContactSettings]
    #: The file that the model was read from.
    urdf: Path
    #: (nq,) What joints are where nothing is known of them: neutral, or as the robot file says.
    default: np.ndarray = field(repr=False, compare=False)
    #: Names of joints, in their order, of the robot's smaller versions: for motions that have fewer
    #: joints than the robot, and no names. No two are equally long.
    joint_layouts: tuple[tuple[str, ...], ...] = field(default=(), repr=False)
    #: By what motions are judged where a contact is an outer pyramid, as it is by default, and
    #: where links touch something. What :meth:`dynacom` makes knows nothing of it.
    friction: FrictionModel = FrictionModel.Cone

    @cached_property
    def joints(self) -> Joints:
        """All but the free-flyer and what else has several degrees of freedom.

        They stand in the model's order.
        """
        model = self.model
        # Behind the universe and the free-flyer.
        found = [index for index in range(2, model.njoints) if model.nvs[index] == 1]
        joints = [model.joints[index] for index in found]
        return Joints(
            tuple(model.names[index] for index in found),
            np.array([joint.idx_q for joint in joints], dtype=int),
            np.array([joint.shortname().startswith("JointModelR") for joint in joints], dtype=bool),
            np.array([joint.nq == 2 for joint in joints], dtype=bool),
        )

    @cached_property
    def collision_points(self) -> CollisionPoints:
        """Where its links may touch something besides the contacts: by the URDF's geometry.

        Meshes are read, once.
        """
        return findCollisionPoints(self.dynacom(), str(self.urdf))

    def dynacom(self, inactive: Iterable[str] = ()) -> DynaCoM:
        """A new DynaCoM of this robot, which knows all its contacts.

        Args:
            inactive: names of the contacts that shall not be active; the others are, in the order
                of the file.

        Raises:
            ValueError: a name is not that of a contact.
        """
        inactive = set(inactive)
        if unknown := inactive - set(self.contacts):
            raise ValueError(
                f"inactive must name contacts of {self.name} ({', '.join(self.contacts)}), "
                f"got {', '.join(sorted(unknown))}"
            )
        robot = DynaCoM(self.model)
        for name, settings in self.contacts.items():
            is_point = isinstance(settings, ContactPointSettings)
            contact = ContactPoint(settings) if is_point else Contact6D(settings)
            robot.addContact(contact, name, name not in inactive)
        return robot

    def with_payload(
        self, frame: str, mass: float, position: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> "Robot":
        """A new robot: this one with a point mass fixed to it.

        Args:
            frame: name of a frame of the model.
            mass: of the load, positive [kg].
            position: (3,) of the load, in that frame [m].

        Raises:
            DynacomError: no frame, or more than one, has that name, or the frame is the world's;
                the mass is not positive, or a number is not finite.
        """
        where = f"payload of {self.name}"
        if not (math.isfinite(mass) and mass > 0.0):
            raise DynacomError(f"{where}: mass must be positive and finite, got {mass}")
        position = np.asarray(position, dtype=float)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise DynacomError(f"{where}: position must be 3 finite numbers, got {position}")
        holder = self.model.frames[_find_frame(self.model, frame, where)]
        model = self.model.copy()
        load = pin.Inertia(float(mass), position, np.zeros((3, 3)))
        model.appendBodyToJoint(holder.parentJoint, load, holder.placement)
        return replace(self, model=model)

    def with_gravity(self, gravity: float) -> "Robot":
        """A new robot: this one where gravity is another, on the moon say.

        Args:
            gravity: downward, not negative [m/s^2].

        Raises:
            DynacomError: the number is negative, or not finite.
        """
        if not (math.isfinite(gravity) and gravity >= 0.0):
            raise DynacomError(
                f"gravity of {self.name}: must be finite and >= 0 m/s^2, got {gravity}"
            )
        model = self.model.copy()
        model.gravity.linear = np.array([0.0, 0.0, -float(gravity)])
        return replace(self, model=model)


class Payload(NamedTuple):
    """The arguments of :meth:`Robot.with_payload`."""

    frame: str
    #: [kg]
    mass: float
    #: In the frame [m].
    position: tuple[float, float, float]


def list_robots() -> list[Path]:
    """The robot files that come with the package, by name."""
    return sorted(_FOLDER.glob("*.yaml"))


def load_robot(name_or_path: str | Path) -> Robot:
    """Reads a robot: its file, its URDF, and the frames that its contacts add.

    Args:
        name_or_path: a name that ``dynacom robots`` lists, or the path of a file (.yaml or .yml).

    Raises:
        DynacomError: the file, or its URDF, is not there or is not valid; the message names the
            file, the contact and the key, what was expected and what was got.
    """
    file = read_robot_file(_find_robot_file(name_or_path))
    urdf = _find_urdf(file.urdf, file.path.parent, f"{file.path}: urdf", "a file beside this one")
    return _make_robot(file, urdf)


def make_robot(urdf: str | Path, contacts: Iterable[str], name: str | None = None) -> Robot:
    """A robot without a robot file.

    Args:
        urdf: path of a file, or of one in example-robot-data's folder ``robots``.
        contacts: texts ``FRAME:KIND:KEY=VALUE,...`` with the keys of robot files, for example
            ``left_sole:6d:half_length=0.1,half_width=0.06,mu=0.7,gu=0.08``. The numbers of a vector
            are separated by slashes, ``xyz=0/0/0.02``. A contact without the key ``name`` has that
            of its frame.
        name: the robot's, by default that of the URDF file without its suffix.

    Raises:
        DynacomError: the URDF is not there or is not valid, or a text is not that of a contact; the
            message names it, what was expected and what was got.
    """
    entries = [_parse_contact(text) for text in contacts]
    if not entries:
        raise DynacomError(f"{urdf}: contacts must be given, got none")
    path = _find_urdf(str(urdf), Path(), "urdf", "a file")
    _check_names(entries, path)
    robot = _make_robot(RobotFile(path, str(urdf), tuple(entries)), path)
    return robot if name is None else replace(robot, name=name)


def parse_payload(text: str) -> Payload:
    """Reads ``FRAME:MASS`` or ``FRAME:MASS@x,y,z``, in kg and m.

    Whether the robot has such a frame, and whether the mass can be one, is for
    :meth:`Robot.with_payload` to say.

    Raises:
        DynacomError: the text is another.
    """
    frame, _, load = text.rpartition(":")
    mass, at, place = load.partition("@")
    try:
        x, y, z = map(float, place.split(",") if at else "000")
        payload = Payload(frame, float(mass), (x, y, z))
    except ValueError:
        payload = None
    if payload is None or not frame:
        raise DynacomError(f"payload must be FRAME:MASS or FRAME:MASS@x,y,z, got '{text}'")
    return payload


def read_robot_file(path: str | Path) -> RobotFile:
    """Reads and checks a robot file, without its URDF.

    Raises:
        DynacomError: as :func:`load_robot`.
    """
    path = Path(path)
    content = read_yaml(path)
    keys = _check_keys(content, _ROBOT_KEYS, str(path))
    contacts = []
    for index, item in enumerate(keys["contacts"]):
        where = f"{path}: contacts[{index}]"
        if not isinstance(item, dict):
            raise DynacomError(f"{where} must be a mapping, got {item!r}")
        if isinstance(item.get("name"), str):
            where = f"{path}: contact '{item['name']}'"
        contacts.append(_read_contact(item, where))
    _check_names(contacts, path)
    return RobotFile(
        path,
        keys["urdf"],
        tuple(contacts),
        keys.get("default", {}),
        keys.get("joint_layouts", ()),
        keys.get("friction", FrictionModel.Cone),
    )


# What a file may hold: a reader for every key. A reader returns the value to use, or raises
# ValueError with what it expected.


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError("a text that is not empty")
    return value


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise ValueError("a list that is not empty")
    return value


def _boolean(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def _number(value: Any) -> float:
    if not is_number(value):
        raise ValueError("a finite number")
    return float(value)


def _numbers(count: int) -> Callable[[Any], np.ndarray]:
    def read(value: Any) -> np.ndarray:
        if not isinstance(value, list) or len(value) != count or not all(map(is_number, value)):
            raise ValueError(f"a list of {count} finite numbers")
        return np.array(value, dtype=float)

    return read


def _whole_number(value: Any) -> int:
    if not is_number(value) or value != int(value):
        raise ValueError("a whole number")
    if abs(value) >= 2**31:
        raise ValueError("a whole number of 32 bits")
    return int(value)


def _friction(value: Any) -> FrictionModel:
    if not isinstance(value, str) or value not in FRICTION_MODELS:
        raise ValueError(f"one of {', '.join(FRICTION_MODELS)}")
    return FRICTION_MODELS[value]


def _coordinates(value: Any) -> dict[str, float]:
    if not isinstance(value, dict) or not all(
        isinstance(joint, str) and is_number(number) for joint, number in value.items()
    ):
        raise ValueError("a mapping of joints' names to finite numbers")
    return {joint: float(number) for joint, number in value.items()}


def _layouts(value: Any) -> tuple[tuple[str, ...], ...]:
    if not isinstance(value, list) or not all(
        isinstance(layout, list) and layout and all(isinstance(joint, str) for joint in layout)
        for layout in value
    ):
        raise ValueError("a list of lists of joints' names")
    return tuple(map(tuple, value))


_Reader: TypeAlias = Callable[[Any], Any]


@dataclass(frozen=True)
class _Keys:
    required: dict[str, _Reader]
    optional: dict[str, _Reader]


_SETTINGS = {"point": ContactPointSettings, "6d": Contact6DSettings}

_ROBOT_KEYS = _Keys(
    {"urdf": _text, "contacts": _list},
    {"friction": _friction, "default": _coordinates, "joint_layouts": _layouts},
)

# The keys that are not fields of the settings.
_PLACE_REQUIRED = {"name": _text, "kind": _text, "frame": _text}
_PLACE_OPTIONAL = {"xyz": _numbers(3), "rpy": _numbers(3)}
_PLACE_KEYS = _PLACE_REQUIRED.keys() | _PLACE_OPTIONAL.keys()
_FRICTION_KEYS = {"friction": _friction, "facets": _whole_number, "facet_angle": _number}

_CONTACT_KEYS = {
    "point": _Keys(
        _PLACE_REQUIRED | {"mu": _number},
        _PLACE_OPTIONAL
        | {"weights": _numbers(3)}
        | _FRICTION_KEYS
        | {"world_aligned": _boolean, "radius": _number},
    ),
    "6d": _Keys(
        _PLACE_REQUIRED
        | {"mu": _number, "gu": _number, "half_length": _number, "half_width": _number},
        _PLACE_OPTIONAL | {"weights": _numbers(6), "coupled_yaw": _boolean} | _FRICTION_KEYS,
    ),
}


def _check_keys(content: Any, keys: _Keys, where: str) -> dict[str, Any]:
    """The values of a mapping that has all required keys, perhaps optional ones, and no other."""
    readers = keys.required | keys.optional
    if not isinstance(content, dict):
        raise DynacomError(
            f"{where}: must be a mapping with the keys {', '.join(readers)}, got {content!r}"
        )
    for key in content:
        if key not in readers:
            raise DynacomError(f"{where}: unknown key {key!r}, expected {', '.join(readers)}")
    for key in keys.required:
        if key not in content:
            raise DynacomError(f"{where}: missing key '{key}', got {', '.join(map(str, content))}")
    values = {}
    for key, value in content.items():
        try:
            values[key] = readers[key](value)
        except ValueError as error:
            raise DynacomError(f"{where}: {key} must be {error}, got {value!r}") from error
    return values


def _read_contact(item: dict[Any, Any], where: str) -> ContactEntry:
    # First of all, because it says which other keys there may be.
    if item.get("kind") not in list(_SETTINGS):
        raise DynacomError(
            f"{where}: kind must be {' or '.join(_SETTINGS)}, got {item.get('kind')!r}"
        )
    kind = item["kind"]
    values = _check_keys(item, _CONTACT_KEYS[kind], where)

    settings = _SETTINGS[kind]()
    settings.frame_name = values["frame"]
    for key in values.keys() - _PLACE_KEYS:
        setattr(settings, key, values[key])
    try:
        settings.validate()
    except ValueError as error:
        raise DynacomError(f"{where}: {error}") from error

    placement = None
    if "xyz" in values or "rpy" in values:
        rotation = pin.rpy.rpyToMatrix(values.get("rpy", np.zeros(3)))
        placement = pin.SE3(rotation, values.get("xyz", np.zeros(3)))
    return ContactEntry(values["name"], kind, settings, placement)


def _parse_contact(text: str) -> ContactEntry:
    where = f"contact '{text}'"
    expected = "FRAME:KIND:KEY=VALUE,..."
    frame, kind, *rest = text.split(":", 2) if text.count(":") > 1 else ("", "")
    if not frame:
        raise DynacomError(f"{where}: must be {expected}")
    item: dict[str, Any] = {"frame": frame, "kind": kind}
    for pair in rest[0].split(","):
        key, equals, value = pair.partition("=")
        if not equals:
            raise DynacomError(f"{where}: must be {expected}, got '{pair}' for KEY=VALUE")
        if key in item:
            raise DynacomError(f"{where}: {key} must be given once, got '{pair}'")
        item[key] = value if key == "name" else _parse_value(value)
    return _read_contact({"name": frame} | item, where)


def _parse_value(text: str) -> Any:
    """What YAML would make of it, with slashes for lists."""
    if text in ("true", "false"):
        return text == "true"
    try:
        numbers = [float(word) for word in text.split("/")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else numbers[0]


def _check_names(contacts: Iterable[ContactEntry], path: Path) -> None:
    for name, count in Counter(contact.name for contact in contacts).items():
        if count > 1:
            raise DynacomError(f"{path}: contact '{name}': name is taken by another contact")


def _find_robot_file(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        return path
    known = {file.stem: file for file in list_robots()}
    if str(name_or_path) not in known:
        raise DynacomError(
            f"robot must be one of {', '.join(known)} or the path of a .yaml file, "
            f"got '{name_or_path}'"
        )
    return known[str(name_or_path)]


def _find_urdf(urdf: str, folder: Path, where: str, place: str) -> Path:
    """Where the file is.

    Args:
        folder: that `urdf` is relative to, if it is not in example-robot-data.
        where, place: what the message calls `urdf`, and a file in `folder`.
    """
    # One rule for the package's files and for users', so that a copy of one of ours works.
    if (folder / urdf).is_file():
        return folder / urdf
    # The package is files only: it has no module that could be asked where they are.
    shared = [
        robots
        for entry in sys.path
        if (robots := Path(entry, "cmeel.prefix/share/example-robot-data/robots")).is_dir()
    ]
    for robots in shared:
        if (robots / urdf).is_file():
            return robots / urdf
    if shared:
        raise DynacomError(f"{where} must be {place} or in example-robot-data, got '{urdf}'")
    raise DynacomError(
        f"{where} '{urdf}' is not {place}, and example-robot-data, which may have it, is not "
        "installed: pip install dynacom[robots]"
    )


def _make_robot(file: RobotFile, urdf: Path) -> Robot:
    model = _read_urdf(urdf, file.path)
    default = _make_default(model, file)
    _check_layouts(model, file)
    contacts = {}
    for entry in file.contacts:
        where = f"{file.path}: contact '{entry.name}'"
        frame = _find_frame(model, entry.settings.frame_name, where)
        if entry.placement is not None:
            entry.settings.frame_name = _add_frame(model, frame, entry, where)
        contacts[entry.name] = entry.settings
    return Robot(file.name, model, contacts, urdf, default, file.joint_layouts, file.friction)


def _read_urdf(urdf: Path, path: Path) -> pin.Model:
    settings = DynaCoMSettings()
    settings.urdf = str(urdf)
    try:
        return DynaCoM(settings).getModel().copy()
    except ValueError as error:
        raise DynacomError(f"{path}: urdf: {error}") from error


def _find_joint(model: pin.Model, name: str, where: str) -> int:
    # Behind the universe and the free-flyer.
    for joint in range(2, model.njoints):
        if model.names[joint] == name and model.nvs[joint] == 1:
            return joint
    raise DynacomError(f"{where} must name joints of the URDF that turn or slide, got '{name}'")


def _make_default(model: pin.Model, file: RobotFile) -> np.ndarray:
    step = np.zeros(model.nv)
    for name, value in file.default.items():
        joint = _find_joint(model, name, f"{file.path}: default")
        step[model.idx_vs[joint]] = value
        # Joints without limits have a sine and a cosine.
        if model.nqs[joint] == 1:
            index = model.idx_qs[joint]
            lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
            if not lower <= value <= upper:
                raise DynacomError(
                    f"{file.path}: default: {name} must be within its limits, {lower:g} to "
                    f"{upper:g}, got {value:g}"
                )
    default = pin.integrate(model, pin.neutral(model), step)
    default.flags.writeable = False
    return default


def _check_layouts(model: pin.Model, file: RobotFile) -> None:
    where = f"{file.path}: joint_layouts"
    lengths = {model.njoints - 2}
    for layout in file.joint_layouts:
        for name, count in Counter(layout).items():
            _find_joint(model, name, where)
            if count > 1:
                raise DynacomError(f"{where} must name a joint once, got '{name}' {count} times")
        # A motion without names is known by how many joints it has.
        if len(layout) in lengths:
            raise DynacomError(
                f"{where} must differ in length from each other and from the robot's "
                f"{model.njoints - 2} joints, got one of {len(layout)}"
            )
        lengths.add(len(layout))


def _find_frame(model: pin.Model, name: str, where: str) -> int:
    frames = [index for index, frame in enumerate(model.frames) if frame.name == name]
    if len(frames) != 1:
        raise DynacomError(
            f"{where}: frame must be the name of one frame of the URDF, got '{name}', which "
            f"{len(frames) or 'none'} of them have"
        )
    if model.frames[frames[0]].parentJoint == 0:
        raise DynacomError(f"{where}: frame must be the robot's, got the world's, '{name}'")
    return frames[0]


def _add_frame(model: pin.Model, parent_id: int, entry: ContactEntry, where: str) -> str:
    """Adds the contact's own frame to the model; returns its name."""
    name = f"{entry.name}_contact"
    if model.existFrame(name):
        raise DynacomError(
            f"{where}: the frame that xyz and rpy place would be called '{name}', which the URDF "
            "has already"
        )
    parent = model.frames[parent_id]
    placement = parent.placement * entry.placement
    model.addFrame(
        pin.Frame(name, parent.parentJoint, parent_id, placement, pin.FrameType.OP_FRAME)
    )
    return name
