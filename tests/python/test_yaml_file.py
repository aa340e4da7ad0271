# SPDX-License-Identifier: BSD-2-Clause
import re

import pytest

from dynacom import DynacomError
from dynacom.yaml_file import is_number, parse_yaml, read_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("-2E5", -2e5),
        (".5e+1", 5.0),
        ("7.e2", 700.0),
        ("1.5e3", 1500.0),
        ("6", 6),
        ("0.25", 0.25),
        ("1e", "1e"),
        ("e3", "e3"),
        ("1e3m", "1e3m"),
        ("'1e3'", "1e3"),
        ("{a: [1, 2e0], b: {c: 1}}", {"a": [1, 2.0], "b": {"c": 1}}),
        # What a merge brings is not there twice.
        ("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}", {"a": {"x": 1, "y": 2}, "b": {"x": 1, "y": 3}}),
        ("", None),
    ],
)
def test_values(tmp_path, text, value):
    for result in (parse_yaml(text), read_yaml(write(tmp_path, text))):
        assert result == value
        assert type(result) is type(value)


def write(folder, text):
    path = folder / "file.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("{", "flow node"),
        ("a: 1\na: 2", "found the key 'a' twice"),
        ("b: {c: [{a: 1, a: 2}]}", "found the key 'a' twice"),
        ("1: 2\n1: 3", "found the key '1' twice"),
        ("? [1]\n: 2", "unhashable key"),
        ("a: !!python/object:os.system {}", "could not determine a constructor"),
        ("a: 2020-99-99", "month must be in 1..12"),
        (1500 * "[", "recursion"),
    ],
)
def test_what_is_not_yaml(tmp_path, text, part):
    with pytest.raises(ValueError, match=re.escape(part)):
        parse_yaml(text)
    path = write(tmp_path, text)
    with pytest.raises(DynacomError, match=re.escape(part)) as caught:
        read_yaml(path)
    assert str(caught.value).startswith(f"{path}: must be YAML (")
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    for path, part in (
        (tmp_path / "none.yaml", "No such file or directory"),
        (tmp_path, "Is a directory"),
    ):
        with pytest.raises(DynacomError, match=re.escape(f"{path}: cannot be read ({part})")):
            read_yaml(path)
    latin = tmp_path / "latin.yaml"
    latin.write_bytes("a: für".encode("latin-1"))
    with pytest.raises(DynacomError, match=r"latin\.yaml: must be YAML \('utf-8' codec"):
        read_yaml(latin)


def test_numbers():
    for value in (0, -3, 2.5, 1.7e308):
        assert is_number(value)
    for value in (True, None, "1", [1], float("nan"), float("inf"), 10**400):
        assert not is_number(value)
