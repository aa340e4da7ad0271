# SPDX-License-Identifier: BSD-2-Clause
"""Summaries of a motion, and of many, to be printed."""

import math
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from dynacom.distance import distance_text
from dynacom.motion_report import TOO_SHORT
from dynacom.repair_summary import CHANGES, compared_values, moves

if TYPE_CHECKING:
    from dynacom.batch import BatchProgress
    from dynacom.batch_overview import Overview


#: Of verdicts, where they are printed.
VERDICT_COLORS = {
    "feasible": "green",
    "repairable": "dark_orange",
    "not feasible": "red",
    "unknown": "yellow",
}


def summary_table(summary: dict[str, Any]) -> Table:
    """The summary of a :class:`MotionReport`, as a table of two columns."""
    table = Table(show_header=False)
    table.add_column(style="bold", overflow="fold")
    table.add_column(overflow="fold")

    color = VERDICT_COLORS[summary["verdict"]]
    table.add_row("Verdict", f"[{color}]{summary['verdict']}[/]")
    if summary["distance"] is not None:
        table.add_row("Distance", distance_text(summary["distance"]))
    if summary["verdict"] == "unknown":
        table.add_row("  too_short", TOO_SHORT)
    else:
        for reason in summary["reasons"]:
            if reason["holds"]:
                table.add_row(f"  {reason['code']}", escape(reason["text"]))
        table.add_row("Without fault", _windows_text(summary))
    table.add_section()
    rate = summary["frame_rate"]
    at = f" at {rate:.6g} Hz" if rate else ""
    table.add_row("Motion", f"{summary['duration']:.3f} s, {summary['frames']} frames{at}")
    for status, count in summary["statuses"].items():
        table.add_row(f"  {status}", f"{count} ({count / summary['frames']:.1%})")
    table.add_row("Mass", f"{summary['mass']:.3f} kg")
    mean, change = summary["mean_vertical_force"], summary["momentum_change"]
    text = f"{_percent(mean)} of the weight"
    if change is not None and abs(change) >= 0.0005:
        text += f", of which {change:+.1%} ends in momentum"
    table.add_row("Mean vertical force", text)
    for entry in summary["cutoff_sensitivity"]:
        table.add_row(
            f"Residual at {entry['cutoff']:g} Hz",
            f"{_number(entry['residual_force_rms'])} m g, "
            f"{_number(entry['residual_torque_rms'])} m g m (RMS): {entry['verdict']}",
        )
    table.add_section()
    for name, contact in summary["contacts"].items():
        text = _percent(contact["weight_share"])
        if contact["active_share"] > 0.0:
            text += (
                f" ({_percent(contact['weight_share_while_active'])} while active, in "
                f"{contact['active_share']:.1%} of the frames)"
            )
        else:
            text += " (never active)"
        table.add_row(escape(f"Weight on {name}"), text)
    for name, compared in summary["measured"].items():
        table.add_row(
            escape(f"Measured on {name}"),
            f"f_z differs by {_number(compared['bias'][2])} N, {_number(compared['rms'][2])} N RMS",
        )
    _add_notes(table, summary["notes"])
    return table


# Of outcomes of repair, where they are printed.
_OUTCOME_COLORS = {"feasible": "green", "repaired": "green", "not repaired": "red"}


def repair_table(summary: dict[str, Any]) -> Table:
    """What summary.json holds of a :class:`RepairReport`, as a table: before → after."""
    repair = summary["repair"]
    table = Table(show_header=False)
    table.add_column(style="bold", overflow="fold")
    table.add_column(overflow="fold")

    color = _OUTCOME_COLORS[repair["outcome"]]
    table.add_row("Repair", f"[{color}]{repair['outcome']}[/]")
    for reason in repair["reasons"]:
        when = "" if reason["time"] is None else f" (at {reason['time']:.2f} s)"
        table.add_row(f"  {reason['code']}", escape(f"{reason['text']}{when}"))
        if reason.get("hint"):
            table.add_row("    what may help", escape(reason["hint"]))
    table.add_section()
    verdicts = [_verdict_text(repair, ending) for ending in ("_before", "")]
    table.add_row("Verdict", " → ".join(verdicts))
    table.add_row("  without the mark", _verdict_text(repair, "_filtered"))
    table.add_row("  as it was written", _verdict_text(repair, "_written"))
    for title, unit, *values in compared_values(repair):
        if unit == "frames":
            texts = [f"{count} ({count / summary['frames']:.1%})" for count in values]
        else:
            texts = [_value_text(value, unit) for value in values]
        table.add_row(title, " → ".join(texts))
    stances = repair["stances"]
    if stances["count"]:
        table.add_row("Stances held still", f"{stances['held']} of {stances['count']}")
    table.add_section()
    for key, title, unit in CHANGES:
        change = repair[key]
        what = f"{change['joint']}, " if change.get("joint") else ""
        table.add_row(
            title,
            f"{_value_text(change['rms'], unit)} (RMS), "
            f"up to {_value_text(change['largest'], unit)} "
            f"({escape(what)}frame {change['frame']}, at {change['time']:.2f} s)",
        )
    for title, unit, value in moves(repair):
        table.add_row(title, f"by {_value_text(value, unit)}")
    table.add_section()
    for rung in repair["rungs"]:
        table.add_row(f"Step: {rung['name']}", escape(rung["text"]))
    _add_notes(table, summary["notes"])
    return table


def _value_text(value: float | None, unit: str) -> str:
    if unit == "rad":
        return _degrees(value)
    if unit in ("m", "m/s"):
        return _millimetres(value, f"m{unit}")
    return f"{_number(value)} {unit}" if unit else f"a factor of {value:g}"


def _verdict_text(repair: dict[str, Any], ending: str) -> str:
    verdict = repair[f"verdict{ending}"]
    codes = [code for code in repair[f"codes{ending}"] if code != verdict]
    text = f"[{VERDICT_COLORS[verdict]}]{verdict}[/]"
    return f"{text} ({', '.join(codes)})" if codes else text


def _millimetres(value: float | None, unit: str) -> str:
    if value is None:
        return "–"
    digits = ".3g" if abs(value) < 1.0 else ".0f"
    return f"{1e3 * value:{digits}} {unit}"


def _degrees(value: float | None) -> str:
    return "–" if value is None else f"{math.degrees(value):.{1 if value > 0.1 else 2}f}°"


def _add_notes(table: Table, notes: list[str]) -> None:
    if notes:
        table.add_section()
    for note in notes:
        table.add_row("Note", escape(note))


def _percent(value: float | None) -> str:
    """A share; a dash for one that does not exist, or is too large for numbers."""
    if value is None:
        return "–"
    return f"{value:.1%}" if abs(value) < 1e3 else f"{100 * value:.3g}%"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _windows_text(summary: dict[str, Any], listed: int = 8) -> str:
    windows = summary["windows"]
    shortest = summary["options"]["verdict"]["minimal_window"]
    if not windows:
        is_short = summary["duration"] < shortest
        return f"no window of {shortest:g} s or more" + (
            ": the clip is shorter" if is_short else ""
        )
    texts = [f"{begin:.2f} to {end:.2f} s" for begin, end in windows[:listed]]
    more = f", and {len(windows) - listed} more" if len(windows) > listed else ""
    return f"{summary['feasible_share']:.1%} of the frames: {', '.join(texts)}{more}"


def overview_table(found: "Overview", state: "BatchProgress") -> Table:
    """What a batch found, and how much of it was new, as a table of two columns."""
    table = Table(show_header=False)
    table.add_column(style="bold", overflow="fold")
    table.add_column(overflow="fold")

    def share(count: int) -> str:
        return f"{count} ({count / found.clips:.1%})" if found.clips else "0"

    table.add_row("Clips", str(found.clips))
    for verdict, color in VERDICT_COLORS.items():
        if found.verdicts[verdict] or verdict != "unknown":
            table.add_row(f"  {verdict}", f"[{color}]{share(found.verdicts[verdict])}[/]")
    table.add_row("  errors", share(found.errors))
    table.add_section()
    for code, count in found.codes.most_common():
        if count:
            table.add_row(code, share(count))
    if found.repairs:
        table.add_section()
        table.add_row("Repair", "")
        for outcome, count in found.outcomes.items():
            table.add_row(f"  {outcome}", share(count))
        table.add_row("  errors", share(found.repair_errors))
        for code, count in found.repair_codes.most_common():
            table.add_row(f"  {code}", f"left in {share(count)}")
    table.add_section()
    table.add_row("Motion", f"{found.duration:.1f} s, {found.frames} frames")
    for ground in found.grounds[:5]:
        table.add_row("Ground", escape(ground.text()))
    if state.known:
        table.add_row("Known before", f"{state.known} of {state.files} files")
    for row in found.failed[:5]:
        table.add_row("Error", escape(row["error"]))
    if found.errors > 5:
        table.add_row("", f"{found.errors - 5} more are in index.html and in clips.parquet")
    return table
