# SPDX-License-Identifier: BSD-2-Clause
"""The mark of motions that are exact: whoever reads them must not filter them.

Formats that can hold it have it as JSON under the key :data:`MARK`. CSV cannot: there it is in a
summary beside the file, which tells the file by its name and by what it holds.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from dynacom.dynacom_pywrap import __version__

#: The array, the key, or the entry of the metadata that holds it.
MARK = "dynacom"

# A summary is no longer than this [bytes]; whatever is longer is somebody else's.
_LONGEST = 1 << 20


def mark_text() -> str:
    """What is written into the file."""
    return json.dumps({"exact": True, "version": __version__})


def is_mark(text: object) -> bool:
    """Whether this, of whatever type, says that a motion is exact."""
    if isinstance(text, bytes):
        text = text.decode("utf-8", "replace")
    return isinstance(text, str) and _says_exact(_parse(text))


def mark_of(path: str | Path) -> dict[str, Any]:
    """What marks a file from beside it: the entry ``repair`` of a summary.

    Args:
        path: the file, as it was written.

    Returns:
        Its name, ``file``, the SHA-256 of its bytes, ``sha256``, and ``exact``, which is True.

    Raises:
        OSError: the file cannot be read.
    """
    path = Path(path)
    return _entry(path, path.read_bytes())


def is_marked_beside(path: Path, content: bytes) -> bool:
    """Whether a summary beside the file marks it: the folder's, or the file's own.

    Args:
        content: of the file.
    """
    for summary in (path.with_name("summary.json"), path.with_name(f"{path.name}.summary.json")):
        try:
            if summary.stat().st_size > _LONGEST:
                continue
            found = _parse(summary.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError):  # mostly, it is not there
            continue
        found = found.get("repair") if isinstance(found, dict) else None
        # The hash, which takes long, only for a summary of this file.
        if _says_exact(found) and found.get("file") == path.name:
            expected = _entry(path, content)
            if {key: found.get(key) for key in expected} == expected:
                return True
    return False


def _entry(path: Path, content: bytes) -> dict[str, Any]:
    return {"file": path.name, "sha256": hashlib.sha256(content).hexdigest(), "exact": True}


def _says_exact(found: object) -> bool:
    return isinstance(found, dict) and found.get("exact") is True


def _parse(text: str) -> object:
    """None where it is no JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
