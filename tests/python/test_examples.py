"""The examples run, and twins print the same."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_are_examples():
    assert [path.stem for path in EXAMPLES] == [
        "01_centroidal_wrench",
        "02_force_distribution",
        "03_control_loop",
        "04_motion",
        "05_many_motions",
        "06_repair",
        "07_exact_cone",
        "08_hand_on_a_rail",
        "09_slope",
    ]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_twins(path):
    printed = run(sys.executable, path)
    assert printed == run(ROOT / "build/examples" / path.stem)
    assert printed.strip()
