# SPDX-License-Identifier: BSD-2-Clause
"""What a report's page shows of a repair: its section, and columns to plot."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from dynacom.page_html import number_text, table, time_button
from dynacom.repair_change import Before, change_arrays, com_change
from dynacom.robots import Robot

# Outcome -> the section's kind, its title, and what it says.
_OUTCOMES = {
    "repaired": ("good", "Repair: done", "The motion was changed as this says."),
    "feasible": (
        "good",
        "Repair: nothing to do",
        "Nothing was changed: the motion was feasible as it was. So there is no ghost.",
    ),
    "not repaired": (
        "bad",
        "Repair: not done",
        "The motion was changed as this says, which does not suffice.",
    ),
}
_GHOST = "What it was before is the ghost in the scene, and pale or dotted in the plots."


def shown_before(before: Before | None, summary: Mapping[str, Any]) -> Before | None:
    """The motion before repair, if that has changed anything."""
    outcome = (summary.get("repair") or {}).get("outcome")
    return None if outcome == "feasible" else before


def before_points(points: Mapping[str, str]) -> dict[str, str]:
    """Points to draw, name -> title, with those before repair in front of CoM and CoP."""
    found = {}
    for name, title in points.items():
        if name in ("com", "cop"):
            found[f"{name}_before"] = f"{title} before"
        found[name] = title
    return found


def change_columns(
    robot: Robot, q: np.ndarray, arrays: Mapping[str, np.ndarray], before: Before
) -> dict[str, np.ndarray]:
    """What page.js plots of the change: name -> a value per frame.

    Args:
        q, arrays: (T, nq), and of the report, after repair.

    Raises:
        ValueError: the motions have other sizes.
    """
    change = change_arrays(robot, before, q)
    weight = before.summary["weight"]
    columns = {
        "change_root": 1e3 * change["root"],
        "change_joints": np.degrees(change["joints"]),
        "change_com": 1e3 * com_change(before, arrays),
    }
    for name, part in (("force", slice(3)), ("torque", slice(3, 6))):
        missing = np.linalg.norm(before.arrays["residual"][:, part], axis=1) / weight
        columns[f"residual_{name}_before"] = missing
    for name in ("com", "cop"):
        for axis, letter in enumerate("xy"):
            columns[f"{name}_before_{letter}"] = before.arrays[name][:, axis]
    return columns


# ---- The section ----


def repair_section(summary: Mapping[str, Any], before: Before | None) -> str:
    """The section of a report that has `repair` in its summary, else nothing.

    Args:
        before: the motion that is shown beside the repaired one.
    """
    repair = summary.get("repair")
    if not repair:
        return ""
    outcome = repair.get("outcome")
    unknown = ("unknown", "Repair", escape(outcome or ""))
    kind, title, text = _OUTCOMES.get(outcome, unknown)
    sentences = text if before is None else f"{text} {_GHOST}"
    details = " ".join(filter(None, (_stances(repair), _file_text(repair))))
    parts = [
        f'<section class="repair {kind}"><h2>{title}</h2>',
        f'<p class="caption">{sentences}</p>',
        '<div class="tables">',
        _table_of(("", "Before", "After"), _compared(repair)),
        _table_of(("Changed", "RMS", "Largest", "at"), _changes(repair)),
        "</div>",
        f'<p class="caption">{details}</p>' if details else "",
        _reasons(repair.get("reasons") or []),
        _rungs(repair.get("rungs") or []),
        "</section>",
    ]
    return "".join(parts)


def _table_of(titles: Sequence[str], rows: Iterator[Sequence[str]], kind: str = "") -> str:
    """A table, unless it has no rows."""
    found = list(rows)
    return table(titles, found, kind) if found else ""


def _file_text(repair: Mapping[str, Any]) -> str:
    if not repair.get("file"):
        return ""
    text = f"Written to <b>{escape(repair['file'])}</b>"
    if repair.get("exact") is not None:
        text += ", marked as exact" if repair["exact"] else ", without a mark"
    if repair.get("sha256"):
        text += f' (SHA-256 <span class="sum">{escape(repair["sha256"])}</span>)'
    return f"{text}."


def _compared(repair: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """What there was before and is after, of what is known."""
    before, after = (repair.get(name) or {} for name in ("missing_before", "missing"))
    stances = repair.get("stances") or {}
    verdicts = [_verdict(repair, ending) for ending in ("_before", "", "_filtered")]
    rows = [
        ("Verdict", *verdicts[:2]),
        ("Verdict, filtered", None, verdicts[2]),
        *_pair("Missing force, RMS", before, after, "force_rms", _plain("m g")),
        *_pair("Missing moment, RMS", before, after, "torque_rms", _plain("m g·m")),
        *_pair("Frames out of reach", before, after, "frames", str),
    ]
    for title, key, unit in (
        ("Stance, largest speed", "largest_speed", "mm/s"),
        ("Stance, largest drift", "largest_drift", "mm"),
    ):
        values = {"before": stances.get(f"{key}_before")}, {"before": stances.get(key)}
        rows += _pair(title, *values, "before", _millimetres(unit))
    for title, *values in rows:
        if any(value is not None for value in values):
            yield title, *("–" if value is None else value for value in values)


def _pair(
    title: str,
    before: Mapping[str, Any],
    after: Mapping[str, Any],
    key: str,
    text: Callable[[Any], str],
) -> list[tuple[str, str | None, str | None]]:
    values = (before.get(key), after.get(key))
    return [(title, *(None if value is None else text(value) for value in values))]


def _plain(unit: str) -> Callable[[float], str]:
    return lambda value: number_text(value, unit)


def _millimetres(unit: str = "mm") -> Callable[[float | None], str]:
    return lambda value: number_text(None if value is None else 1e3 * value, unit)


def _degrees(value: float | None) -> str:
    return number_text(None if value is None else float(np.degrees(value)), "°")


def _verdict(repair: Mapping[str, Any], ending: str) -> str | None:
    verdict = repair.get(f"verdict{ending}")
    if verdict is None:
        return None
    codes = [code for code in repair.get(f"codes{ending}") or [] if code != verdict]
    text = f"<b>{escape(verdict)}</b>"
    return f"{text}<small>{escape(', '.join(codes))}</small>" if codes else text


def _changes(repair: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    for key, title, text in (
        ("root", "Root, displaced", _millimetres()),
        ("joints", "Joints, turned", _degrees),
        ("com", "Centre of mass, displaced", _millimetres()),
    ):
        change = repair.get(key)
        if not change:
            continue
        largest = text(change.get("largest"))
        if change.get("joint"):
            largest += f"<small>{escape(change['joint'])}</small>"
        yield title, text(change.get("rms")), largest, time_button(change.get("time"))


def _stances(repair: Mapping[str, Any]) -> str:
    stances = repair.get("stances") or {}
    if stances.get("count") is None or stances.get("held") is None:
        return ""
    return f"{stances['held']} of {stances['count']} stances are held still."


def _reasons(reasons: Sequence[Mapping[str, Any]]) -> str:
    rows = (
        (
            f"<code>{escape(reason.get('code') or '')}</code> {escape(reason.get('text') or '')}",
            time_button(reason.get("time")),
        )
        for reason in reasons
    )
    return _table_of(("What could not be mended", "at"), rows, "reasons")


def _rungs(rungs: Sequence[Mapping[str, Any]]) -> str:
    if not rungs:
        return ""

    def count(value: int | None) -> str:
        return "–" if value is None else str(value)

    rows = [
        (
            f"<b>{escape(rung.get('name') or '')}</b> {escape(rung.get('text') or '')}",
            count(rung.get("missing_frames_before")),
            count(rung.get("missing_frames_after")),
        )
        for rung in rungs
    ]
    titles = ("Step", "Frames out of reach before", "after")
    plural = "s" if len(rungs) > 1 else ""
    return f"<details><summary>{len(rungs)} step{plural}</summary>{table(titles, rows)}</details>"
