# SPDX-License-Identifier: BSD-2-Clause
"""docs/verdict.md is true: its tables are the code's, its examples are read."""

import re
from dataclasses import replace

import numpy as np
import pytest

import dynacom
from dynacom import AnalysisOptions
from helpers import WALKS


@pytest.fixture(scope="module")
def text(root) -> str:
    return (root / "docs" / "verdict.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def summary(talos) -> dict:
    """Of a clip that has everything: planned forces, and a filter."""
    clip = dynacom.read_motion(WALKS / "talos_walk.npz", talos)
    options = AnalysisOptions(cutoff=6.0)
    return dynacom.analyze(replace(clip, v=None, a=None), talos, options=options).summary


def table(text: str, header: str) -> list[list[str]]:
    """The rows of all tables whose header begins like that."""
    rows = []
    for block in re.findall(r"^\|.*\n\|-.*\n((?:\|.*\n)+)", text, flags=re.MULTILINE):
        before = text[: text.index(block)].splitlines()[-2]
        if before.startswith(header):
            rows += [
                [cell.strip() for cell in row.strip("|").split("|")] for row in block.splitlines()
            ]
    assert rows
    return rows


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def test_settings_and_their_defaults(text, root):
    """Each one once; those of repair stand in its own manual."""
    rows = table(text, "| setting | default")
    rows += table((root / "docs" / "repair.md").read_text(encoding="utf-8"), "| setting | default")
    values = {"": None, "null": None, "true": True, "false": False, "auto": "auto"}
    documented = {
        names(cell)[0]: values[default] if default in values else float(default)
        for cell, default, _ in rows
    }
    assert len(documented) == len(rows)
    expected = {}
    for name, value in AnalysisOptions().to_dict().items():
        if isinstance(value, dict):
            for field, part in value.items():
                if not isinstance(part, dict):
                    expected[f"{name}.{field}"] = part
        else:
            expected[name] = value
    assert documented == expected


def test_limits(text):
    documented = {
        names(cell)[0]: {"limit": float(limit), "allowed_share": float(share)}
        for cell, _, limit, share, _ in table(text, "| code | unit")
    }
    settings = AnalysisOptions().to_dict()["verdict"]
    verdict = {name: value for name, value in settings.items() if isinstance(value, dict)}
    assert documented == verdict
    assert list(documented) == list(verdict)


def test_units(text, summary):
    documented = {names(row[0])[0]: row[1] for row in table(text, "| code | unit")}
    assert documented == {entry["code"]: entry["unit"] for entry in summary["reasons"]}


def test_the_summary_field_by_field(text, summary):
    documented = [row[0] for row in table(text, "| key | what")]
    keys = [name for cell in documented for name in names(cell)]
    reason, contact = summary["reasons"][0], summary["contacts"]["left_sole"]
    assert sorted(keys) == sorted([*summary, *reason, *contact])
    assert keys[: len(summary)] == list(summary)
    rows = {names(cell)[0]: what for cell, what, *_ in table(text, "| key | what")}
    for key, value in (
        ("cutoff_sensitivity", summary["cutoff_sensitivity"][0]),
        ("unexplained", summary["unexplained"]),
        ("measured", summary["measured"]["left_sole"]),
    ):
        assert set(value) <= set(names(rows[key])), key


VERDICT = dynacom.VerdictSettings()


def test_other_numbers(text):
    """Those in sentences."""
    words = " ".join(text.split())
    assert f"off by at most {100 * dynacom.kVelocityMismatch:g} %" in words
    assert f"the accelerations by at most {100 * dynacom.kAccelerationMismatch:g} %" in words
    assert f"below {dynacom.kMaximalCutoff:g} of the frame rate" in words
    assert f"up to {dynacom.kExactNoise:g} g it is" in words
    part, thinned = dynacom.kMeasuredCutoffPart, dynacom.kThinnedRate
    assert f"{dynacom.kMeasuredCutoff:g} Hz, or {part:g} of the frame rate if" in words
    assert f"at {thinned:g} frames a second" in words
    assert f"{dynacom.kRoundedCutoff:g} Hz: the motion is exact, but was rounded" in words
    force, torque = dynacom.kUnsureForce, dynacom.kUnsureTorque
    assert f"more than {force:g} m g or {torque:g} m g m beyond its weight" in words
    assert dynacom.kEvenTimes == 0.1
    assert "up to a tenth of a frame away" in words
    assert f"fewer than {dynacom.kMinimalFrames} frames tell nothing" in words
    assert f"those of {VERDICT.minimal_window:g} s or more" in words
    assert f"less than {VERDICT.interruption:g} s is overlooked" in words
    assert f"vertical force is below {VERDICT.cop_force:g} m g" in words


def test_examples(text, tmp_path):
    """Of a schedule and of settings, and of settings on the command line."""
    schedule, settings = re.findall(r"^```yaml\n(.*?)^```$", text, flags=re.M | re.S)
    path = tmp_path / "file.yaml"
    path.write_text(schedule)
    time = np.arange(200) / 50.0
    read = dynacom.read_schedule(path, time, ["left_sole", "right_sole"])
    assert read.active.sum(axis=0).tolist() == [60 + 61, 12 + 109]
    dynacom.write_schedule(read, time, path)
    # The first contact is as one is written.
    assert schedule.split("right_sole")[0] == path.read_text().split("right_sole")[0]

    path.write_text(settings)
    options = AnalysisOptions()
    options.update_from_file(path)
    assert options.cutoff == 8.0
    assert options.verdict.residual_force == dynacom.FaultLimit(0.05, 0.01)

    (command,) = re.findall(r"^```bash\n(.*?)^```$", text, flags=re.M | re.S)
    options = AnalysisOptions()
    options.update_from_texts(re.findall(r"--set (\S+)", command))
    assert options.verdict.residual_force == dynacom.FaultLimit(1e-6, 0.0)
