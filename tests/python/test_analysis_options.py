# SPDX-License-Identifier: BSD-2-Clause
"""Settings from files and from texts."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

import dynacom
from dynacom import (
    AnalysisOptions,
    CentroidalFilterSettings,
    DetectionSettings,
    DynacomError,
    FaultLimit,
    LadderSettings,
    RepairSettings,
    VerdictSettings,
)
from dynacom.presets import PRESETS
from helpers import WALKS


@pytest.fixture
def options() -> AnalysisOptions:
    return AnalysisOptions()


def from_text(text: str) -> AnalysisOptions:
    options = AnalysisOptions()
    options.update_from_texts([text])
    return options


def changes(options: AnalysisOptions) -> dict[str, object]:
    """What differs from the defaults, by its path."""

    def flatten(values: dict, before: str = "") -> dict[str, object]:
        flat = {}
        for name, value in values.items():
            path = f"{before}{name}"
            flat |= flatten(value, f"{path}.") if isinstance(value, dict) else {path: value}
        return flat

    defaults = flatten(AnalysisOptions().to_dict())
    now = flatten(options.to_dict())
    assert list(now) == list(defaults)
    return {path: value for path, value in now.items() if value != defaults[path]}


def test_defaults(options):
    assert options.cutoff == "auto"
    assert options.omega == 0.0
    assert options.flat is True
    assert options.distance is True
    assert options.filter == CentroidalFilterSettings()
    assert options.detection == DetectionSettings()
    assert options.verdict == VerdictSettings()
    assert options.repair == RepairSettings()
    assert options.ladder == LadderSettings()
    options.validate()
    # Each has its own.
    options.detection.change = 3.0
    assert AnalysisOptions().detection.change == DetectionSettings().change != 3.0


def test_a_file(options, tmp_path):
    path = tmp_path / "settings.yaml"
    path.write_text("""
cutoff: 8
flat: false
distance: false
filter: {com: 0.02, window: 5}
repair: {displacement: 0.02, feet: false}
ladder: {rounds: 2, strict: true}
detection: {change: 3, ground_height: -0.1, ground_velocity: [-1, 0.5, 0]}
verdict:
  residual_force: {limit: 2e-1, allowed_share: 0.5}
  foot_sliding: {limit: 1}
  cop_force: 0.08
""")
    options.update_from_file(path)
    assert changes(options) == {
        "cutoff": 8.0,
        "flat": False,
        "distance": False,
        "filter.com": 0.02,
        "filter.window": 5.0,
        "detection.change": 3.0,
        "detection.ground_height": -0.1,
        "detection.ground_velocity": [-1.0, 0.5, 0.0],
        "verdict.residual_force.limit": 0.2,
        "verdict.residual_force.allowed_share": 0.5,
        "verdict.foot_sliding.limit": 1.0,
        "verdict.cop_force": 0.08,
        "repair.displacement": 0.02,
        "repair.feet": False,
        "ladder.rounds": 2,
        "ladder.strict": True,
    }
    assert type(options.ladder.rounds) is int
    assert options.verdict.residual_force == FaultLimit(0.2, 0.5)
    assert options.detection.ground_height == -0.1
    assert options.detection.ground_velocity.tolist() == [-1.0, 0.5, 0.0]


@pytest.mark.parametrize("text", ["", "# nothing\n", "{}"])
def test_an_empty_file_changes_nothing(options, tmp_path, text):
    path = tmp_path / "settings.yaml"
    path.write_text(text)
    options.update_from_file(path)
    assert changes(options) == {}


def test_what_is_given_back_can_be_read(options, tmp_path):
    """The settings in summary.json are a settings file."""
    options.update_from_texts(["cutoff=null", "omega=3", "verdict.cop_outside.limit=0.5"])
    path = tmp_path / "settings.yaml"
    for text in (json.dumps(options.to_dict(), allow_nan=False), yaml.safe_dump(options.to_dict())):
        path.write_text(text)
        again = AnalysisOptions()
        again.update_from_file(path)
        assert again.to_dict() == options.to_dict()
        assert again == options


def test_constants_are_described_as_in_the_manual(root):
    """With their defaults: one docstring each, and no row too many."""
    text = (root / "docs" / "verdict.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `detection\.(\w+)` \| (.*?) ?\| (.*?) \|$", text, re.MULTILINE)
    settings = DetectionSettings()
    names = re.findall(r"(\w+)=", repr(settings))
    assert [name for name, _, _ in rows] == names
    for name, default, meaning in rows:
        if not name.startswith("ground_"):
            assert float(default) == getattr(settings, name)
            assert getattr(DetectionSettings, name).__doc__ == meaning, name


def test_every_setting_can_be_set_by_a_text():
    """And each is one of its own."""

    def paths(values: dict, before: str = "") -> list[str]:
        found = []
        for name, value in values.items():
            path = f"{before}{name}"
            found += paths(value, f"{path}.") if isinstance(value, dict) else [path]
        return found

    every = paths(AnalysisOptions().to_dict())
    costs = repr(CentroidalFilterSettings()).count("=")
    verdict = repr(dynacom.VerdictSettings()).count("=") + len(dynacom.describeFaults())
    repair = repr(RepairSettings()).count("=") + repr(LadderSettings()).count("=")
    constants = len(every) - 2 - 6 - costs - verdict - repair
    assert constants == repr(DetectionSettings()).count("=") - 2 > 30
    for path in every:
        value, text = 0.51, "0.51"
        if path in ("flat", "distance"):
            value, text = False, "false"
        elif path in ("feet_only", "repair.pinned_ends", "ladder.strict"):
            value, text = True, "true"
        elif path in ("repair.feet", "repair.joints"):
            value, text = False, "false"
        elif path == "friction":
            value, text = "facets", "facets"
        elif path == "ladder.rounds":
            value, text = 4, "4"
        elif path == "ladder.largest_stretch":
            value, text = 1.5, "1.5"
        elif path.endswith("ground_velocity"):
            value, text = [1.0, -0.5, 0.0], "[1, -0.5, 0]"
        # What has a least must not be less than it, and the other way round.
        texts = [f"{path}={text}"]
        for end, other, bound in (("_least", "_greatest", "0.6"), ("_greatest", "_least", "0.001")):
            if path.endswith(end) and path.replace(end, other) in every:
                texts.append(f"{path.replace(end, other)}={bound}")
        options = AnalysisOptions()
        options.update_from_texts(texts)
        found = changes(options)
        assert found[path] == value
        assert len(found) <= len(texts)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cutoff=null", {"cutoff": None}),
        ("cutoff=1e-3", {"cutoff": 0.001}),
        ("cutoff=0", {"cutoff": 0.0}),
        ("cutoff=auto", {}),
        ("flat=no", {"flat": False}),
        (
            "detection={change: 0.01, rate: 1}",
            {"detection.change": 0.01, "detection.rate": 1.0},
        ),
        ("verdict.cop_force=0", {"verdict.cop_force": 0.0}),
        ("verdict.discontinuity={limit: 2}", {"verdict.discontinuity.limit": 2.0}),
    ],
)
def test_texts(text, expected):
    assert changes(from_text(text)) == expected


def test_the_cut_off_as_a_number(options):
    assert np.isnan(options.cutoff_number)
    options.update_from_texts(["cutoff=7"])
    assert options.cutoff_number == 7.0
    options.update_from_texts(["cutoff=null"])
    assert options.cutoff_number == 0.0
    options.update_from_texts(["cutoff=auto"])
    assert options.to_dict()["cutoff"] == "auto"


def test_null_is_the_ground_that_is_estimated(options):
    options.update_from_texts(["detection.ground_height=0.3"])
    assert options.detection.ground_height == 0.3
    options.update_from_texts(["detection.ground_height=null"])
    assert np.isnan(options.detection.ground_height)
    assert options.to_dict()["detection"]["ground_height"] is None


def test_ranges_are_looked_at_when_all_is_set(options):
    """One setting may need another, whichever comes first."""
    texts = ["detection.speed_scale_least=1", "detection.speed_scale_greatest=2"]
    for order in (texts, texts[::-1]):
        options = AnalysisOptions()
        options.update_from_texts(order)
        found = options.detection.speed_scale_least, options.detection.speed_scale_greatest
        assert found == (1.0, 2.0)


def test_the_last_counts(options):
    options.update_from_texts(["cutoff=3", "omega=1", "cutoff=4"])
    assert changes(options) == {"cutoff": 4.0, "omega": 1.0}


# Presets.


def test_presets_are_those_documented(root):
    text = (root / "docs" / "verdict.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|", text.split("### Presets")[1], re.MULTILINE)
    assert rows[: len(PRESETS)] == list(PRESETS)


@pytest.mark.parametrize("name", ["talos", "g1", "solo12"])
def test_presets_of_robots(options, name):
    """Newtons of people are parts of the robot's weight."""
    robot = dynacom.load_robot(name)
    weight = 9.81 * robot.dynacom().getMass()
    options.update_from_preset("opensim", robot)
    assert options.verdict.residual_force == FaultLimit(25.0 / weight, 0.0)
    assert options.verdict.residual_torque == FaultLimit(75.0 / weight, 0.0)
    assert options.verdict.flight_with_support_needed == FaultLimit(25.0 / weight, 0.0)
    assert len(changes(options)) == 6

    own = robot.dynacom()
    rest = np.zeros(robot.model.nv)
    own.computeDynamics(robot.default, rest, rest)
    heights = []
    for contact in robot.contacts:
        pose, settings = own.getContact(contact).getSurfacePose(), robot.contacts[contact]
        x, y = (getattr(settings, f"half_{side}", 0.0) for side in ("length", "width"))
        corners = [[sx * x, sy * y, 0.0] for sx in (-1, 1) for sy in (-1, 1)]
        heights += [pose.act(np.array(corner))[2] for corner in corners]
    height = own.getCoM()[2] - min(heights)
    assert 0.1 < height < 1.2
    options.update_from_preset("hicks", robot)
    assert options.verdict.residual_force == FaultLimit(0.05, 0.0)
    assert options.verdict.residual_torque.limit == pytest.approx(0.01 * height)
    assert options.verdict.residual_torque.allowed_share == 0.0
    assert options.verdict.flight_with_support_needed == FaultLimit(0.05, 0.0)
    heavy = robot.with_payload(robot.model.frames[-1].name, 3.0)
    options.update_from_preset("opensim", heavy)
    assert options.verdict.residual_force.limit == pytest.approx(25.0 / (weight + 3.0 * 9.81))


def test_strict_is_a_tenth(options, talos):
    options.update_from_preset("strict", talos)
    found = changes(options)
    defaults = AnalysisOptions().to_dict()["verdict"]
    assert {path.split(".")[1] for path in found} == set(defaults) - {
        *("downward_normal", "discontinuity"),
        *(name for name, value in defaults.items() if not isinstance(value, dict)),
    }
    for path, value in found.items():
        _, code, field = path.split(".")
        assert field == "limit"
        assert value == pytest.approx(0.1 * defaults[code]["limit"])


def test_presets_that_cannot_be(options, talos, tmp_path):
    with pytest.raises(
        DynacomError, match="^unknown preset 'lax', expected hicks, opensim, strict$"
    ):
        options.update_from_preset("lax", talos)
    with pytest.raises(DynacomError, match="^preset hicks: talos must have contacts"):
        options.update_from_preset("hicks", replace(talos, contacts={}))
    assert changes(options) == {}


# Errors.


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("cutoff", ["setting must be NAME=VALUE", "got 'cutoff'"]),
        ("cutoff=", ["setting must be NAME=VALUE", "got 'cutoff='"]),
        ("", ["setting must be NAME=VALUE", "got ''"]),
        ("=3", ["setting '=3'", "unknown setting ''", "feet_only, friction, distance"]),
        ("speed=3", ["setting 'speed=3'", "unknown setting 'speed'", "expected cutoff"]),
        ("detection.mu=3", ["detection: unknown setting 'mu'", "expected rest_speed_part"]),
        ("verdict.feasible=3", ["verdict: unknown setting 'feasible'", "residual_force"]),
        ("verdict.cop_outside.share=3", ["cop_outside: unknown", "expected limit, allowed_share"]),
        ("cutoff=six", ["cutoff must be a finite number, auto or null", "got 'six'"]),
        ("cutoff=[1", ["cutoff must be a finite number", "got '[1'"]),
        ("cutoff=.inf", ["cutoff must be a finite number", "got inf"]),
        ("cutoff=2020-99-99", ["cutoff must be a finite number", "got '2020-99-99'"]),
        (f"cutoff=1{400 * '0'}", ["cutoff must be a finite number", "got 1000"]),
        ("cutoff.x=1", ["cutoff must be a finite number", "got {'x': 1}"]),
        ("cutoff=-1", ["settings: cutoff must be finite and >= 0 Hz, auto or none, got -1"]),
        ("omega=-1", ["settings: omega must be finite and >= 0 rad/s, got -1"]),
        ("omega=auto", ["omega must be a finite number, got 'auto'"]),
        ("omega=null", ["omega must be a finite number", "got None"]),
        ("flat=1", ["flat must be true or false", "got 1"]),
        ("distance=1", ["distance must be true or false", "got 1"]),
        ("filter.com=0", ["CentroidalFilterSettings.com must be finite and > 0, got 0"]),
        ("filter=1", ["filter: must be a mapping with com", "got 1"]),
        ("verdict.repairable_distance=0", ["VerdictSettings.repairable_distance must be", "got 0"]),
        ("detection=3", ["detection: must be a mapping with rest_speed_part", "got 3"]),
        ("detection.rate=true", ["detection: rate must be a finite number", "got True"]),
        ("detection.rate=-1", ["settings: DetectionSettings.rate must be", "got -1"]),
        ("detection.force_scale_least=1", ["DetectionSettings.force_scale_greatest must be >="]),
        ("detection.ground_velocity=1", ["detection: ground_velocity must be", "got 1"]),
        ("detection.ground_velocity=[1, 0]", ["ground_velocity must be", "got [1, 0]"]),
        ("detection.ground_velocity=[1, 0, x]", ["ground_velocity must be", "got [1, 0, 'x']"]),
        ("detection.ground_velocity=[1, 0, 1]", ["ground_velocity must be finite and level"]),
        ("detection.ground_height=.nan", ["ground_height must be a finite number or null", "nan"]),
        ("verdict.cop_outside=1", ["verdict: cop_outside: must be a mapping with limit", "got 1"]),
        ("verdict.cop_outside.limit=-1", ["VerdictSettings.cop_outside.limit must be", "got -1"]),
        ("verdict.cop_outside.allowed_share=2", ["allowed_share must be from 0 to 1", "got 2"]),
    ],
)  # fmt: skip
def test_errors_name_the_thing_and_change_nothing(options, text, parts):
    with pytest.raises(DynacomError) as caught:
        options.update_from_texts(["omega=2", "verdict.cop_force=0.5", text])
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message
    assert changes(options) == {}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("{", ["must be YAML"]),
        ("[1]", ["must be a mapping with cutoff, omega, flat, feet_only", "got [1]"]),
        ("cutoff", ["must be a mapping with", "got 'cutoff'"]),
        ("1: 2", ["unknown setting 1", "expected cutoff"]),
        ("cutoff: 1\ncutoff: 2", ["must be YAML", "'cutoff' twice"]),
        ("omega: 2\nverdict: {foot_sliding: {limit: x}}", ["verdict: foot_sliding: limit", "'x'"]),
        ("omega: 2\ndetection: {rate: 0}", ["DetectionSettings.rate must be finite and > 0"]),
        ("omega: 2\nverdict:", ["verdict: must be a mapping with", "got None"]),
    ],
)
def test_errors_in_files(options, tmp_path, text, parts):
    path = tmp_path / "settings.yaml"
    path.write_text(text)
    with pytest.raises(DynacomError, match=f"^{re.escape(str(path))}: ") as caught:
        options.update_from_file(path)
    for part in parts:
        assert part in str(caught.value)
    assert changes(options) == {}


def test_files_that_cannot_be_read(options, tmp_path):
    with pytest.raises(DynacomError, match=r"none\.yaml: cannot be read \(No such file"):
        options.update_from_file(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("cutoff", -1.0, "cutoff must be finite and >= 0 Hz, auto or none, got -1"),
        ("cutoff", np.nan, "cutoff must be finite and >= 0 Hz, auto or none, got nan"),
        ("cutoff", "six", "cutoff must be a number of Hz, auto or none, got 'six'"),
        ("omega", np.inf, "omega must be finite and >= 0 rad/s, got inf"),
        ("detection", None, "DetectionSettings.rate must be finite"),
        ("verdict", None, "VerdictSettings.cop_force must be finite"),
    ],
)
def test_analyze_refuses_what_is_out_of_range(options, tmp_path, name, value, message):
    """Before it reads anything, and although the motion has derivatives of its own."""
    if name == "detection":
        options.detection.rate = -1.0
    elif name == "verdict":
        options.verdict.cop_force = -1.0
    else:
        setattr(options, name, value)
    for path in (WALKS / "talos_walk.npz", tmp_path / "none.npz"):
        with pytest.raises(ValueError, match=f"^{message}"):
            dynacom.analyze(path, "talos", options=options)
