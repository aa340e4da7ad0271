# SPDX-License-Identifier: BSD-2-Clause
"""The report as a page: one HTML file that needs nothing else, no network either.

Its parts lie beside this file: page.html, page.css and page.js, which draws the plots and moves
plots and scene through time together.
"""

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from dynacom import scene
from dynacom.distance import distance_text
from dynacom.errors import DynacomError
from dynacom.motion_report import TOO_SHORT
from dynacom.page_html import number_text, percent_text, table, time_button
from dynacom.page_repair import before_points, change_columns, repair_section, shown_before
from dynacom.repair_change import Before
from dynacom.robots import Robot


def write_page(
    path: str | Path,
    robot: Robot,
    q: np.ndarray,
    arrays: Mapping[str, np.ndarray],
    summary: Mapping[str, Any],
    *,
    before: Before | None = None,
    scene_rate: float = 15.0,
) -> None:
    """Writes a report's page.

    Args:
        path: of the HTML file.
        q: (T, nq), the motion's configurations.
        arrays: of the report, a row per frame.
        summary: of the report. A `repair` in it has a section of its own, see docs/repair.md.
        before: the motion before repair, to be compared in scene and plots. Where the summary says
            that nothing was changed, it is not asked.
        scene_rate: frames per second of the 3D scene, at most; plots have all frames.

    Raises:
        DynacomError: plotly is not installed. Without viser, or without the robot's meshes, there
            is a page, which says what it lacks.
        OSError: the file cannot be written.
        ValueError: the motion before has another size.
    """
    before = shown_before(before, summary)
    plotly = _plotly()
    recording, note = None, None
    try:
        recording = scene.record(robot, q, arrays, summary, scene_rate, before=before)
        note = recording.note
    except DynacomError as error:
        note = f"There is no 3D scene: {error}."
    points = _points(summary)
    if before is not None:
        points = before_points(points)
    columns = _columns(robot, arrays, summary)
    if before is not None:
        columns |= change_columns(robot, q, arrays, before)
    data = {
        "columns": list(columns),
        "statuses": _statuses(arrays),
        "contacts": [
            {
                "name": name,
                "color": _css(scene.contact_color(number)),
                "measured": f"{number}.measured" in columns,
                "parts": _parts(arrays, name),
                "corners": sum(key.startswith(f"{number}.corner") for key in columns) // 2,
            }
            for number, name in enumerate([*robot.contacts, *summary["bodies"]])
        ],
        "points": points,
        "colors": {name: _css(color) for name, color in scene.COLORS.items()},
        "thresholds": {reason["code"]: reason["threshold"] for reason in summary["reasons"]},
        "windows": summary["windows"],
        "sceneTimes": _times(recording and recording.times),
        "sceneTimesWithoutGhost": _times(recording and recording.times_without_ghost),
    }
    page = Template(_read("page.html")).substitute(
        title=f"{escape(summary['clip'])}: {escape(summary['verdict'])}",
        style=_read("page.css"),
        script=_read("page.js"),
        head=_head(summary),
        repair=repair_section(summary, before),
        verdict=_verdict(summary),
        notes=_notes([*summary["notes"], *([note] if note else [])]),
        contacts=_contacts(robot, summary),
        sensitivity=_sensitivity(summary),
        measured=_measured(summary),
        key=_key(robot, summary, points) + ("" if before is None else _GHOST),
        dashed="; dashed: the file's" if any(c["measured"] for c in data["contacts"]) else "",
        change_class="none" if before is None else "",
        distance_class="" if summary["distance"] else "none",
        scene_class="" if recording else "none",
        data=_json(data),
        # One row a column, the time in double precision.
        numbers=_pack(
            columns.pop("time").astype("<f8").tobytes()
            + np.array(list(columns.values())).astype("<f4").tobytes()
        ),
        scene="" if recording is None else _pack(recording.html.encode()),
        plotly=_pack(plotly.encode()),
    )
    # Names of files may hold what is no text.
    Path(path).write_text(page, encoding="utf-8", errors="replace")


def _plotly() -> str:
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise DynacomError(
            "the report's page needs plotly, which is not installed: pip install dynacom[motion]"
        ) from error
    return get_plotlyjs()


def _read(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _pack(content: bytes) -> str:
    """Text for a script element that the page unpacks."""
    return base64.b64encode(gzip.compress(content, mtime=0)).decode("ascii")


def _json(value: Any) -> str:
    """JSON for a script element: nothing in it can end that."""
    text = json.dumps(value, allow_nan=False)  # in ASCII
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _times(times: np.ndarray | None) -> list[float]:
    return [] if times is None else times.round(6).tolist()


def _css(color: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


# What shows and hides the ghost.
_GHOST = (
    '<label><input type="checkbox" id="ghost" checked> '
    f'<i style="background: {_css(scene.COLORS["ghost"])}"></i> ghost: before repair</label>'
)


# ---- What is plotted ----


def _statuses(arrays: Mapping[str, np.ndarray]) -> list[str]:
    return sorted({str(status) for status in arrays["status"]})


def _parts(arrays: Mapping[str, np.ndarray], contact: str) -> list[str]:
    """What the parts of a contact are called, if it has any."""
    begin, end = f"contact.{contact}.", ".active"
    names = [key.removeprefix(begin) for key in arrays if key.startswith(begin)]
    return [name.removesuffix(end) for name in names if name.endswith(end)]


def _points(summary: Mapping[str, Any]) -> dict[str, str]:
    """Whose paths are drawn: array's name -> what it is called."""
    points = {"com": "CoM", "cop": "CoP", "vrp": "VRP"}
    return points | ({"feasible_com": "feasible CoM"} if summary["distance"] else {})


def _columns(
    robot: Robot, arrays: Mapping[str, np.ndarray], summary: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """What page.js plots: name -> a value per frame. The first is `time`."""
    weight = summary["weight"]
    statuses = _statuses(arrays)
    columns = {
        "time": arrays["time"],
        "status": np.array([statuses.index(str(status)) for status in arrays["status"]]),
        "residual_force": np.linalg.norm(arrays["residual"][:, :3], axis=1) / weight,
        "residual_torque": np.linalg.norm(arrays["residual"][:, 3:], axis=1) / weight,
        "needed": arrays["ground_force"][:, 2] / weight,
    }
    if summary["distance"]:
        columns["distance"] = 1e3 * arrays["distance"]
    for name in _points(summary):
        columns[f"{name}_x"], columns[f"{name}_y"] = arrays[name].T[:2]
    for number, (name, settings) in enumerate(robot.contacts.items()):
        key = f"contact.{name}"
        up = scene.rotation_matrices(arrays[f"{key}.rotation"])[:, 2]
        columns[f"{number}.active"] = arrays[f"{key}.active"]
        columns[f"{number}.confidence"] = arrays[f"{key}.confidence"]
        for part, place in enumerate(_parts(arrays, name)):
            columns[f"{number}.part{part}"] = arrays[f"{key}.{place}.active"]
        columns[f"{number}.force"] = np.sum(up * arrays[f"{key}.force"], axis=1) / weight
        if f"{key}.measured_force" in arrays:
            columns[f"{number}.measured"] = (
                np.sum(up * arrays[f"{key}.measured_force"], axis=1) / weight
            )
        columns[f"{number}.friction"] = arrays[f"{key}.cone_usage"]
        columns[f"{number}.yaw"] = arrays[f"{key}.yaw_usage"]
        corners = scene.surface_corners(settings, arrays, name)
        for corner in range(corners.shape[1]):
            columns[f"{number}.corner{corner}_x"] = corners[:, corner, 0]
            columns[f"{number}.corner{corner}_y"] = corners[:, corner, 1]
    for number, link in enumerate(summary["bodies"], len(robot.contacts)):
        key = f"body.{link}"
        columns[f"{number}.active"] = arrays[f"{key}.active"]
        columns[f"{number}.confidence"] = arrays[f"{key}.confidence"]
        columns[f"{number}.force"] = arrays[f"{key}.force"][:, 2] / weight
        for usage in ("friction", "yaw"):  # of which nothing is known
            columns[f"{number}.{usage}"] = np.full(len(arrays["time"]), np.nan)
        columns[f"{number}.corner0_x"], columns[f"{number}.corner0_y"] = arrays[
            f"{key}.position"
        ].T[:2]
    return columns


# ---- What is written ----


def _head(summary: Mapping[str, Any]) -> str:
    statuses = ", ".join(f"{count} {escape(name)}" for name, count in summary["statuses"].items())
    facts = [
        f"{summary['frames']} frames in {number_text(summary['duration'], 's', 4)}"
        f" ({number_text(summary['frame_rate'], 'Hz')})",
        statuses,
        number_text(summary["mass"], "kg", 4),
        f"ω = {number_text(summary['omega'], 'rad/s')}",
        f"mean vertical force {number_text(summary['mean_vertical_force'], 'm g', 4)}",
    ]
    return (
        f"<h1>{escape(summary['clip'])} <span>on {escape(summary['robot'])}</span></h1>"
        f"<p class='facts'>{' · '.join(facts)}</p>"
    )


def _verdict(summary: Mapping[str, Any]) -> str:
    verdict = summary["verdict"]
    kinds = {"feasible": "good", "repairable": "fair", "not feasible": "bad"}
    kind = kinds.get(verdict, "unknown")
    held = [item for item in summary["reasons"] if item["holds"] and kind != "unknown"]
    others = [item for item in summary["reasons"] if item not in held]
    parts = [
        f'<section class="verdict {kind}">',
        f"<h2>{escape(verdict[:1].upper() + verdict[1:])}</h2>",
    ]
    if summary["distance"]:
        text = distance_text(summary["distance"], time_button)
        parts.append(f'<p class="caption distance">Distance: {text}</p>')
    if kind == "unknown":
        parts.append(f"<p><code>too_short</code> {escape(TOO_SHORT)}</p>")
    else:
        parts.append(_windows(summary))
    if held:
        parts.append(_reasons(held))
    if others:
        plural = "reasons do" if len(others) > 1 else "reason does"
        title = "What was measured" if kind == "unknown" else f"{len(others)} {plural} not hold"
        parts += [
            f"<details><summary>{title}</summary>",
            _reasons(others),
            "</details>",
        ]
    return "".join([*parts, "</section>"])


def _windows(summary: Mapping[str, Any], listed: int = 20) -> str:
    windows = summary["windows"]
    if not windows:
        return '<p class="caption">No window without fault.</p>'
    texts = [f"{time_button(begin)} to {time_button(end)}" for begin, end in windows[:listed]]
    if len(windows) > listed:
        texts.append(f"and {len(windows) - listed} more")
    share = percent_text(summary["feasible_share"])
    return (
        f'<p class="caption">Windows without fault, {share} of the frames: {", ".join(texts)}</p>'
    )


def _reasons(reasons: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (
            f"<code>{escape(reason['code'])}</code> {escape(reason['text'])}",
            f"{reason['frames']} ({percent_text(reason['share'])})",
            percent_text(reason["allowed_share"]),
            number_text(reason["worst"], reason["unit"]),
            number_text(reason["threshold"], reason["unit"]),
            time_button(reason["time"]),
        )
        for reason in reasons
    ]
    titles = ("Reason", "Frames", "allowed", "Worst", "threshold", "at")
    return table(titles, rows, "reasons")


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f"<ul class='notes'>{items}</ul>"


def _dot(color: tuple[int, int, int]) -> str:
    return f'<i style="background: {_css(color)}"></i>'


def _key(robot: Robot, summary: Mapping[str, Any], points: Mapping[str, str]) -> str:
    """What the scene's colours mean."""
    colors = {title: scene.COLORS[name] for name, title in points.items()}
    colors["support"] = scene.COLORS["support"]
    for number, name in enumerate([*robot.contacts, *summary["bodies"]]):
        colors[f"force on {name}"] = scene.contact_color(number)
    return "".join(f"<span>{_dot(color)} {escape(text)}</span>" for text, color in colors.items())


def _contacts(robot: Robot, summary: Mapping[str, Any]) -> str:
    rows = []
    for number, name in enumerate(robot.contacts):
        contact = summary["contacts"][name]
        rows.append(
            (
                f"{_dot(scene.contact_color(number))} {escape(name)}",
                percent_text(contact["active_share"]),
                percent_text(contact["weight_share"]),
                number_text(contact["largest_vertical_force"], "m g"),
                number_text(contact["largest_cone_usage"]),
                number_text(summary["ground"].get(name), "m"),
            )
        )
    for number, (link, body) in enumerate(summary["bodies"].items(), len(robot.contacts)):
        rows.append(
            (
                f"{_dot(scene.contact_color(number))} {escape(link)}",
                percent_text(body["active_share"]),
                percent_text(body["weight_share"]),
                number_text(body["largest_vertical_force"], "m g"),
                number_text(None),
                number_text(None),
            )
        )
    titles = (
        "Contact",
        "Active",
        "Share of weight",
        "Largest vertical force",
        "Largest use of the friction cone",
        "Ground at",
    )
    return f"<section><h2>Contacts</h2>{table(titles, rows)}</section>"


def _sensitivity(summary: Mapping[str, Any]) -> str:
    entries = summary["cutoff_sensitivity"]
    if not entries:
        return ""
    rows = [
        (
            number_text(entry["cutoff"], "Hz")
            + (" *" if entry["cutoff"] == summary["cutoff"] else ""),
            escape(entry["verdict"]),
            number_text(entry["residual_force_rms"], "m g"),
            number_text(entry["residual_torque_rms"], "m g·m"),
            percent_text(entry["relaxed_share"]),
        )
        for entry in entries
    ]
    titles = (
        "Cut-off",
        "Verdict",
        "Residual force, RMS",
        "Residual moment, RMS",
        "Frames out of reach",
    )
    return (
        "<section><h2>How it depends on the filter</h2>"
        f"{table(titles, rows)}<p class='caption'>* used for this report</p></section>"
    )


def _measured(summary: Mapping[str, Any]) -> str:
    if not summary["measured"]:
        return ""
    kinds = {"bias": "bias", "rms": "RMS", "correlation": "correlation"}
    rows = [
        (f"{escape(name)}, {title}", *map(number_text, values[kind]))
        for name, values in summary["measured"].items()
        for kind, title in kinds.items()
    ]
    axes = [f"{letter}<sub>{axis}</sub>" for letter in "fτ" for axis in "xyz"]
    return (
        "<section><h2>Computed against the file's forces</h2>"
        f"{table(('', *axes), rows)}"
        "<p class='caption'>Computed minus the file's, in the contacts' frames, N and N·m.</p>"
        "</section>"
    )
