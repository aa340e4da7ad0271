"""README is true: every block of code in it runs. The C++ block is a test of ctest's."""

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", (ROOT / "README.md").read_text(), re.M | re.S)


# Commands that a test cannot wait for, and what their usage must say.
TAKE_LONG = {
    "scripts/test --sanitize": "ThreadSanitizer",
    "scripts/reliability": "1,000,000 of all sorts, each answer certified",
    "scripts/truth": "beside motions whose forces were measured or simulated",
}


def blocks(language):
    return [text for kind, text in BLOCKS if kind == language]


def commands():
    """Every command of the shell blocks, without its comment; a line depends on none before it."""
    for text in blocks("bash"):
        for line in text.splitlines():
            if command := line.split(" #")[0].strip():
                yield command


def test_every_block_is_tested():
    assert {kind for kind, _ in BLOCKS} == {"bash", "python", "cpp", "cmake"}
    assert len(blocks("cpp")) == 1  # tests/CMakeLists.txt takes the first


@pytest.mark.parametrize("code", blocks("python"))
def test_python(code, capsys):
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "Solved" in printed
    assert "left_sole" in printed and "right_sole" in printed


def test_cmake():
    (code,) = blocks("cmake")
    consumer = (ROOT / "tests/wheel/consumer/CMakeLists.txt").read_text()
    package, link = code.splitlines()
    assert package in consumer
    assert re.search(re.escape(link).replace("main", r"\w+"), consumer)


@pytest.mark.parametrize("command", list(commands()))
def test_command(command, tmp_path):
    if command == "scripts/test":
        # This runs in it; so does CI.
        assert "scripts/test" in (ROOT / ".ci/run").read_text()
        return
    if command in TAKE_LONG:
        # What README says of them stands in what they say of themselves.
        script, *options = command.split()
        usage = subprocess.run([ROOT / script, "-h"], capture_output=True, text=True, check=True)
        first, *rest = usage.stdout.splitlines()
        assert first.startswith(f"Usage: {script}")
        assert all(f"[{option}]" in first for option in options)
        assert TAKE_LONG[command] in " ".join(rest)
        return
    # What is written goes to a folder of the test's, so paths of the project become absolute.
    absolute = re.sub(r"(?<![\w/.])(\.venv|scripts|examples)/", rf"{ROOT}/\1/", command)
    environment = dict(os.environ, PATH=f"{ROOT}/.venv/bin:{os.environ['PATH']}")
    done = subprocess.run(
        ["bash", "-ec", absolute], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    if "--json bench.json" in command:
        rows = json.loads((tmp_path / "bench.json").read_text())
        assert {row["name"].split("/")[0] for row in rows} == {"distributeForce"}
        for row in rows:
            assert set(row) == {"name", "reference", "median_ns", "ratio"}
            assert row["median_ns"] > 0 and row["name"] in done.stdout
            if row["reference"] is None:  # next to the boundary others have no answer
                assert "/boundary/" in row["name"] and row["ratio"] is None
            else:
                assert row["ratio"] > 0 and row["reference"] in done.stdout
        assert any(row["reference"] for row in rows)
    if "anymal_trot" in command:
        assert re.search(r"Solved +│ 74 ", done.stdout) and re.search(
            r"Relaxed +│ 120 ", done.stdout
        )
    if command == "scripts/demo":
        assert "demo_output/report.html" in done.stdout.splitlines()


def test_every_motion_and_script_is_shown():
    shown = " ".join(commands())
    for motion in (ROOT / "examples/data").glob("*.npz"):
        assert f"examples/data/{motion.name}" in shown
    # Setup is what the others begin with.
    for script in {path.name for path in (ROOT / "scripts").iterdir()} - {"setup"}:
        assert f"scripts/{script}" in shown


def test_links():
    """Links within the project lead to files of the project."""
    for document in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for link in re.findall(r"\]\(([^)]+)\)", document.read_text()):
            if "://" not in link:
                assert (document.parent / link.split("#")[0]).exists(), f"{document.name}: {link}"
