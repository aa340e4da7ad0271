# SPDX-License-Identifier: BSD-2-Clause
"""YAML as people write it."""

import re
import sys
from pathlib import Path
from typing import Any

import yaml

from dynacom.errors import DynacomError


class _Loader(yaml.SafeLoader):
    """In which 1e-3 is a number, as in YAML 1.2, and a key that is there twice a mistake."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        seen = set()
        for key in keys:
            if (key.tag, key.value) in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"found the key '{key.value}' twice", problem_mark=key.start_mark
                )
            seen.add((key.tag, key.value))
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def parse_yaml(text: str) -> Any:
    """What a text holds.

    Raises:
        ValueError: it is not YAML.
    """
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(str(error)) from error


def read_yaml(path: str | Path) -> Any:
    """What a file holds.

    Raises:
        DynacomError: it cannot be read, or is not YAML.
    """
    try:
        return parse_yaml(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise DynacomError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:  # of encodings and dates, too
        raise DynacomError(f"{path}: must be YAML ({error})") from error


def is_number(value: Any) -> bool:
    """Whether it is a finite number, that a float can hold.

    YAML's true is none, although Python's is; its integers may be too large.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max
