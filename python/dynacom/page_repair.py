# SPDX-License-Identifier: BSD-2-Clause
"""What a report's page shows of a repair: its section, and columns to plot."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from dynacom.page_html import number_text, table, time_button
from dynacom.repair_change import Before, change_arrays, com_change
from dynacom.repair_summary import CHANGES, compared_values, moves
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
_GHOST = (
    "What it was before is the ghost in the scene, pale and dotted from above, and blue among "
    "residuals."
)


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
    texts = (_moves_text(repair, before), _stances(repair), _file_text(repair))
    details = " ".join(filter(None, texts))
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
    rows = [
        ("Verdict", _verdict(repair, "_before"), _verdict(repair, "")),
        ("Verdict, without the mark", None, _verdict(repair, "_filtered")),
        ("Verdict, as it was written", None, _verdict(repair, "_written")),
    ]
    for title, unit, *values in compared_values(repair):
        rows.append((title, *(None if v is None else _value_text(v, unit) for v in values)))
    for title, *values in rows:
        if any(value is not None for value in values):
            yield title, *("–" if value is None else value for value in values)


def _value_text(value: float | None, unit: str) -> str:
    """A value in the unit in which people want it."""
    if value is None:
        return number_text(None)
    if unit == "frames":
        return str(value)
    if unit == "rad":
        return f"{_long_text(float(np.degrees(value)))}°"
    if unit in ("m", "m/s"):
        return _long_text(1e3 * value, f"m{unit}")
    unit = unit.replace("m g m", "m g·m")
    if 0.0 < value < 1e-6:  # which is rounding
        return f"&lt;&nbsp;10<sup>−6</sup>&nbsp;{unit}"
    return number_text(value, unit)


def _long_text(value: float, unit: str = "") -> str:
    """With three digits, or all in front of the point."""
    return number_text(value, unit, max(3, len(f"{abs(value):.0f}")))


def _verdict(repair: Mapping[str, Any], ending: str) -> str | None:
    verdict = repair.get(f"verdict{ending}")
    if verdict is None:
        return None
    codes = [code for code in repair.get(f"codes{ending}") or [] if code != verdict]
    text = f"<b>{escape(verdict)}</b>"
    return f"{text}<small>{escape(', '.join(codes))}</small>" if codes else text


def _changes(repair: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    for key, title, unit in CHANGES:
        change = repair.get(key)
        if not change:
            continue
        largest = _value_text(change.get("largest"), unit)
        where = [change["joint"]] if change.get("joint") else []
        if change.get("frame") is not None:
            where.append(f"frame {change['frame']}")
        if where:
            largest += f"<small>{escape(', '.join(where))}</small>"
        yield title, _value_text(change.get("rms"), unit), largest, time_button(change.get("time"))


def _moves_text(repair: Mapping[str, Any], before: Before | None) -> str:
    texts = [
        f"{title} by {_value_text(value, unit) if unit else f'a factor of {number_text(value)}'}."
        for title, unit, value in moves(repair)
    ]
    is_elsewhere = any(unit for _, unit, _ in moves(repair))
    if before is not None and is_elsewhere:
        texts.append("The changes above are besides that; displacements over time include it.")
    return " ".join(texts)


def _stances(repair: Mapping[str, Any]) -> str:
    stances = repair.get("stances") or {}
    if stances.get("count") is None or stances.get("held") is None:
        return ""
    return f"{stances['held']} of {stances['count']} stances are held still."


def _reasons(reasons: Sequence[Mapping[str, Any]]) -> str:
    rows = ((_reason_text(reason), time_button(reason.get("time"))) for reason in reasons)
    return _table_of(("What could not be mended", "at"), rows, "reasons")


def _reason_text(reason: Mapping[str, Any]) -> str:
    text = f"<code>{escape(reason.get('code') or '')}</code> {escape(reason.get('text') or '')}"
    hint = reason.get("hint")
    return f"{text}<small>What may help: {escape(hint)}</small>" if hint else text


def _rungs(rungs: Sequence[Mapping[str, Any]]) -> str:
    if not rungs:
        return ""
    items = "".join(
        f"<li><b>{escape(rung.get('name') or '')}</b> {escape(rung.get('text') or '')}</li>"
        for rung in rungs
    )
    plural = "s" if len(rungs) > 1 else ""
    return f"<details><summary>{len(rungs)} step{plural}</summary><ol>{items}</ol></details>"
