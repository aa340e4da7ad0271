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
        # kind 6d only
        gu: 0.05
        half_length: 0.1
        half_width: 0.05
        # kind point only, optional
        world_aligned: true
        radius: 0.02

The keys from ``mu`` on are the fields of ``Contact6DSettings`` and ``ContactPointSettings``, and
mean the same. The files in the package's folder ``robots`` are known by their names.
"""

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
import yaml

from dynacom.dynacom_pywrap import (
    Contact6D,
    Contact6DSettings,
    ContactPoint,
    ContactPointSettings,
    DynaCoM,
    DynaCoMSettings,
)
from dynacom.errors import DynacomError

ContactSettings: TypeAlias = ContactPointSettings | Contact6DSettings

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

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem


@dataclass(frozen=True)
class Robot:
    """A model and the settings of its contacts."""

    name: str
    #: With the contacts' own frames; its root joint is a free-flyer. Prints a line per joint.
    model: pin.Model = field(repr=False)
    #: Contact's name -> its settings, in the order of the file.
    contacts: Mapping[str, ContactSettings]
    #: The file that the model was read from; it says where the meshes are.
    urdf: Path

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
    urdf = _find_urdf(file)
    model = _read_urdf(file.path, urdf)
    contacts = {}
    for entry in file.contacts:
        frame = _find_frame(model, entry, file.path)
        if entry.placement is not None:
            entry.settings.frame_name = _add_frame(model, frame, entry, file.path)
        contacts[entry.name] = entry.settings
    return Robot(file.name, model, contacts, urdf)


def read_robot_file(path: str | Path) -> RobotFile:
    """Reads and checks a robot file, without its URDF.

    Raises:
        DynacomError: as :func:`load_robot`.
    """
    path = Path(path)
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DynacomError(f"{path}: cannot be read ({error.strerror})") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise DynacomError(f"{path}: must be YAML ({error})") from error

    keys = _check_keys(content, _ROBOT_KEYS, str(path))
    names = set()
    contacts = []
    for index, item in enumerate(keys["contacts"]):
        entry = _read_contact(item, index, path)
        if entry.name in names:
            raise DynacomError(f"{path}: contact '{entry.name}': name is taken by another contact")
        names.add(entry.name)
        contacts.append(entry)
    return RobotFile(path, keys["urdf"], tuple(contacts))


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


def _is_number(value: Any) -> bool:
    # YAML's true is no number, although Python's is; its integers may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _number(value: Any) -> float:
    if not _is_number(value):
        raise ValueError("a finite number")
    return float(value)


def _numbers(count: int) -> Callable[[Any], np.ndarray]:
    def read(value: Any) -> np.ndarray:
        if not isinstance(value, list) or len(value) != count or not all(map(_is_number, value)):
            raise ValueError(f"a list of {count} finite numbers")
        return np.array(value, dtype=float)

    return read


_Reader: TypeAlias = Callable[[Any], Any]


@dataclass(frozen=True)
class _Keys:
    required: dict[str, _Reader]
    optional: dict[str, _Reader]


_SETTINGS = {"point": ContactPointSettings, "6d": Contact6DSettings}

_ROBOT_KEYS = _Keys({"urdf": _text, "contacts": _list}, {})

# The keys that are not fields of the settings.
_PLACE_REQUIRED = {"name": _text, "kind": _text, "frame": _text}
_PLACE_OPTIONAL = {"xyz": _numbers(3), "rpy": _numbers(3)}
_PLACE_KEYS = _PLACE_REQUIRED.keys() | _PLACE_OPTIONAL.keys()

_CONTACT_KEYS = {
    "point": _Keys(
        _PLACE_REQUIRED | {"mu": _number},
        _PLACE_OPTIONAL | {"weights": _numbers(3), "world_aligned": _boolean, "radius": _number},
    ),
    "6d": _Keys(
        _PLACE_REQUIRED
        | {"mu": _number, "gu": _number, "half_length": _number, "half_width": _number},
        _PLACE_OPTIONAL | {"weights": _numbers(6)},
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


def _read_contact(item: Any, index: int, path: Path) -> ContactEntry:
    where = f"{path}: contacts[{index}]"
    if not isinstance(item, dict):
        raise DynacomError(f"{where} must be a mapping, got {item!r}")
    if isinstance(item.get("name"), str):
        where = f"{path}: contact '{item['name']}'"
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


def _find_urdf(file: RobotFile) -> Path:
    # One rule for the package's files and for users', so that a copy of one of ours works.
    beside = file.path.parent / file.urdf
    if beside.is_file():
        return beside
    # The package is files only: it has no module that could be asked where they are.
    folders = [
        folder
        for entry in sys.path
        if (folder := Path(entry, "cmeel.prefix/share/example-robot-data/robots")).is_dir()
    ]
    for folder in folders:
        if (folder / file.urdf).is_file():
            return folder / file.urdf
    if folders:
        raise DynacomError(
            f"{file.path}: urdf must be a file beside this one or in example-robot-data, "
            f"got '{file.urdf}'"
        )
    raise DynacomError(
        f"{file.path}: urdf '{file.urdf}' is not beside this file, and example-robot-data, which "
        "may have it, is not installed: pip install dynacom[robots]"
    )


def _read_urdf(path: Path, urdf: Path) -> pin.Model:
    settings = DynaCoMSettings()
    settings.urdf = str(urdf)
    try:
        return DynaCoM(settings).getModel().copy()
    except ValueError as error:
        raise DynacomError(f"{path}: urdf: {error}") from error


def _find_frame(model: pin.Model, entry: ContactEntry, path: Path) -> int:
    name = entry.settings.frame_name
    frames = [index for index, frame in enumerate(model.frames) if frame.name == name]
    if len(frames) != 1:
        raise DynacomError(
            f"{path}: contact '{entry.name}': frame must be the name of one frame of the URDF, "
            f"got '{name}', which {len(frames) or 'none'} of them have"
        )
    return frames[0]


def _add_frame(model: pin.Model, parent_id: int, entry: ContactEntry, path: Path) -> str:
    """Adds the contact's own frame to the model; returns its name."""
    name = f"{entry.name}_contact"
    if model.existFrame(name):
        raise DynacomError(
            f"{path}: contact '{entry.name}': the frame that xyz and rpy place would be called "
            f"'{name}', which the URDF has already"
        )
    parent = model.frames[parent_id]
    placement = parent.placement * entry.placement
    model.addFrame(
        pin.Frame(name, parent.parentJoint, parent_id, placement, pin.FrameType.OP_FRAME)
    )
    return name
