# SPDX-License-Identifier: BSD-2-Clause
"""Results appear whole or not at all."""

import os

import pytest

from dynacom import results_folder as module
from dynacom.results_folder import results_folder

NAMES = ["a.txt", "b.txt", "c.txt"]


def contents(folder):
    """Every file below, and what it holds; folders hold None."""
    return {
        str(path.relative_to(folder)): path.read_text() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def write(folder, text="new"):
    for name in NAMES:
        (folder / name).write_text(text)


@pytest.fixture(params=["absent", "nested", "empty", "old"])
def out(request, tmp_path):
    """A folder in one of the states in which it may be before."""
    out = tmp_path / "out"
    if request.param == "nested":
        return out / "a" / "b"
    if request.param != "absent":
        out.mkdir()
    if request.param == "old":
        write(out, "old")
        (out / "mine.txt").write_text("mine")
    return out


def test_files_appear(out, tmp_path):
    before = contents(out) if out.exists() else {}
    with results_folder(out) as folder:
        write(folder)
        assert {name: text for name, text in contents(out).items() if name[0] != "."} == before
    assert contents(out) == before | dict.fromkeys(NAMES, "new")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_interrupted_while_writing(out, tmp_path, error):
    before = contents(tmp_path)
    with pytest.raises(type(error)), results_folder(out) as folder:
        write(folder, "half")
        raise error
    assert contents(tmp_path) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(5, "Input/output error")])
@pytest.mark.parametrize("after", [False, True])
def test_interrupted_while_moving(out, tmp_path, monkeypatch, error, after):
    """At every move, before it or after."""
    before = contents(tmp_path)
    replace, moves = os.replace, 0

    def interrupted(source, target):
        nonlocal moves
        moves += 1
        if moves != stop:
            return replace(source, target)
        if after:
            replace(source, target)
        raise error

    stop, done = 0, False
    while not done:
        stop, moves = stop + 1, 0
        with monkeypatch.context() as patch:
            patch.setattr(module.os, "replace", interrupted)
            try:
                with results_folder(out) as folder:
                    write(folder)
                done = True
            except type(error):
                assert contents(tmp_path) == before, stop
    assert stop - 1 == (6 if "a.txt" in before or "out/a.txt" in before else 3)
    assert contents(out).items() >= dict.fromkeys(NAMES, "new").items()


def test_a_folder_in_the_place_of_a_file(tmp_path):
    out = tmp_path / "out"
    (out / "b.txt").mkdir(parents=True)
    (out / "b.txt" / "mine").write_text("mine")
    (out / "a.txt").write_text("old")
    before = contents(out)
    with pytest.raises(OSError, match=r"b\.txt is a folder"), results_folder(out) as folder:
        write(folder)
    assert contents(out) == before


def test_a_file_in_the_place_of_the_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    for path in (file, file / "out"):
        with pytest.raises(OSError, match=r"exists|Not a directory"), results_folder(path):
            pytest.fail("it cannot be used")
    assert contents(tmp_path) == {"file": "mine"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_locked_folder(tmp_path):
    out = tmp_path / "locked"
    out.mkdir(mode=0o500)
    with pytest.raises(PermissionError), results_folder(out):
        pytest.fail("it cannot be used")


def test_files_are_as_readable_as_any(tmp_path):
    with results_folder(tmp_path / "out") as folder:
        write(folder)
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "out" / "a.txt").stat().st_mode & 0o777 == 0o666 & ~umask
