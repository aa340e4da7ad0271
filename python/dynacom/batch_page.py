# SPDX-License-Identifier: BSD-2-Clause
"""The page of a batch: one HTML file that needs nothing else, no network either."""

import math
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from string import Template

from dynacom.batch_overview import Overview
from dynacom.batch_repair import REASONS
from dynacom.batch_row import Job, Row
from dynacom.batch_store import whole, writing
from dynacom.dynacom_pywrap import __version__
from dynacom.motion_report import FAULTS, TOO_SHORT

# So many folders' grounds are told.
_GROUNDS = 20

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$clips clips of $robot</title>
<style>
:root { color-scheme: light dark; --line: #8884; --ok: #2a8a4a; --bad: #c8382e;
  --mid: #e08a00; --err: #8a6d1d; }
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem;
  padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; }
td, th { text-align: left; padding: .25rem .6rem; border-bottom: 1px solid var(--line);
  vertical-align: top; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
.sortable td:first-child { overflow-wrap: anywhere; min-width: 12rem; }
.sortable td:nth-child(2):last-child { overflow-wrap: anywhere; }
.sortable td:nth-child(2):not(:last-child) { white-space: nowrap; }
.sortable td:nth-child(3) { overflow-wrap: break-word; min-width: 16rem; }
.bars td:first-child { width: 28rem; } .bars td.n { width: 8rem; white-space: nowrap; }
.bar { height: .9rem; min-width: 1px; background: var(--bad); border-radius: 2px; }
.ok { background: var(--ok); } .mid { background: var(--mid); } .err { background: var(--err); }
th button { font: inherit; font-weight: 600; text-align: inherit; background: none; border: 0;
  padding: 0; color: inherit; cursor: pointer; }
th[aria-sort=ascending] button::after { content: " \\2191"; }
th[aria-sort=descending] button::after { content: " \\2193"; }
small { opacity: .75; }
</style>
</head>
<body>
<h1>$clips clips of $robot</h1>
<p>$frames frames, $duration of motion, $feasible of it in windows without fault. The table of all
clips is <code>clips.parquet</code> beside this page.</p>
$grounds
<h2>Verdicts</h2>
<table class="bars">$verdicts</table>
<h2>Reasons</h2>
<p>Clips in which each fault holds; a clip may have several.</p>
<table class="bars">$reasons</table>
$repair
<h2>Clips, the worst first</h2>
$worst
<h2>Errors</h2>
$errors
<p><small>DynaCoM $version</small></p>
<script>
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  table.querySelectorAll("th button").forEach((button, column) => {
    button.addEventListener("click", () => {
      const head = button.parentElement;
      const down = head.getAttribute("aria-sort") !== "descending";
      for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = row => row.cells[column].dataset.value ?? row.cells[column].textContent;
      const numeric = head.classList.contains("n");
      const compare = (a, b) => numeric ? key(a) - key(b) : key(a).localeCompare(key(b));
      const rows = [...body.rows].sort((a, b) => (down ? -1 : 1) * compare(a, b));
      body.append(...rows);
    });
  });
}
</script>
</body>
</html>
""")


def write_index(
    path: Path, found: Overview, links: Mapping[tuple[str, str | None], str], job: Job
) -> None:
    """Writes the page.

    Args:
        links: file's name and clip -> its report, relative to the page.

    Raises:
        DynacomError: it cannot be written.
    """
    verdicts = (
        ("feasible", found.verdicts["feasible"], "ok"),
        ("repairable", found.verdicts["repairable"], "mid"),
        ("not feasible", found.verdicts["not feasible"], ""),
        ("unknown: too short", found.verdicts["unknown"], "err"),
        ("error", found.errors, "err"),
    )
    reasons = ((f"{code}: {FAULTS[code][1]}", n, "") for code, n in found.codes.most_common())
    page = _PAGE.substitute(
        clips=found.clips,
        robot=escape(job.robot.name.encode("utf-8", "backslashreplace").decode()),
        frames=found.frames,
        duration=_duration(found.duration),
        feasible=f"{found.feasible_frames / max(found.frames, 1):.1%}",
        verdicts=_bars(verdicts, found.clips),
        reasons=_bars(reasons, found.clips),
        grounds="".join(f"<p>{escape(ground.text())}</p>" for ground in found.grounds[:_GROUNDS]),
        repair=_repair(found),
        worst=_worst(found, links),
        errors=_errors(found),
        version=escape(__version__),
    )
    with writing(path.parent), whole(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _repair(found: Overview) -> str:
    """The section on repair, if there was one."""
    if not found.repairs:
        return ""
    kinds = {"feasible": "ok", "repaired": "mid", "not repaired": ""}
    outcomes = [(outcome, count, kinds[outcome]) for outcome, count in found.outcomes.items()]
    outcomes.append(("failed", found.repair_errors, "err"))
    reasons = ((f"{code}: {REASONS[code]}", n, "") for code, n in found.repair_codes.most_common())
    parts = [
        "<h2>Repair</h2>",
        "<p>Clips that are feasible, as they are or repaired, are in the folder "
        "<code>repaired</code> beside this page.</p>",
        f'<table class="bars">{_bars(outcomes, found.clips)}</table>',
    ]
    if found.repair_codes:
        parts += [
            "<p>What is left in clips that are not repaired; in one there may be several.</p>",
            f'<table class="bars">{_bars(reasons, found.clips)}</table>',
        ]
    if found.repair_failed:
        parts.append(_failed(found.repair_failed, "repair_error", found.repair_errors))
    return "".join(parts)


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def _bars(entries: Iterable[tuple[str, int, str]], total: int) -> str:
    rows = []
    for text, count, kind in entries:
        share = count / total if total else 0.0
        bar = f'<div class="bar {kind}" style="width: {100 * share:.2f}%"></div>' if count else ""
        rows.append(
            f'<tr><td>{escape(text)}</td><td class="n">{count} ({share:.1%})</td>'
            f"<td>{bar}</td></tr>"
        )
    return "".join(rows)


def _title(row: Row) -> str:
    return row["file"] if row["clip"] is None else f"{row['file']}: {row['clip']}"


def _worst(found: Overview, links: Mapping[tuple[str, str | None], str]) -> str:
    judged = found.judged
    if not judged:
        return "<p>No clip could be judged.</p>"
    rows = []
    for row in found.worst:
        title = escape(_title(row))
        if link := links.get((row["file"], row["clip"])):
            title = f'<a href="{escape(link)}">{title}</a>'
        rows.append(
            f"<tr><td>{title}</td>"
            f"<td>{escape(row['verdict'])}</td>"
            f"<td>{_reasons(row)}</td>"
            + _number(row["severity"], f"{row['severity']:.1%}")
            + _number(row["feasible_share"], f"{row['feasible_share']:.1%}")
            + _number(_millimetres(row["distance_rms"]))
            + _number(_millimetres(row["distance_max"]))
            + (_repair_cells(row) if found.repairs else "")
            + _number(row["residual_force_rms"])
            + _number(row["residual_torque_rms"])
            + _number(row["mean_vertical_force"])
            + _number(row["duration"], f"{row['duration']:.2f}")
            + "</tr>"
        )
    titles = (
        ("Clip", ""),
        ("Verdict", ""),
        ("Reasons", ""),
        ("Frames at fault", "n"),
        ("In windows", "n"),
        ("Distance RMS [mm]", "n"),
        ("Distance at most [mm]", "n"),
        *((("Repair", ""), ("Root displaced at most [mm]", "n")) if found.repairs else ()),
        ("Residual force RMS [m g]", "n"),
        ("Residual moment RMS [m g m]", "n"),
        ("Mean vertical force [m g]", "n"),
        ("Duration [s]", "n"),
    )
    note = f"<p>{len(rows)} of {judged}.</p>" if len(rows) < judged else ""
    return note + _table(titles, rows)


def _repair_cells(row: Row) -> str:
    outcome = row["repair"] if row["repair_error"] is None else "failed"
    if row["repair_reasons"]:
        outcome += f": {row['repair_reasons'].replace('+', ', ')}"
    return f"<td>{escape(outcome)}</td>{_number(_millimetres(row['repair_root_max']))}"


def _reasons(row: Row) -> str:
    if row["verdict"] == "unknown":
        return escape(f"too_short: {TOO_SHORT}")
    texts = [
        f"{code} ({row[f'{code}.frames']} frames, up to {_worst_text(row, code)} {unit})"
        for code, (unit, _) in FAULTS.items()
        if row[f"{code}.holds"]
    ]
    return "<br>".join(map(escape, texts))


def _errors(found: Overview) -> str:
    if not found.errors:
        return "<p>None.</p>"
    return _failed(found.failed, "error", found.errors)


def _failed(failed: list[Row], column: str, count: int) -> str:
    """A table of errors, of so many."""
    rows = [
        f"<tr><td>{escape(_title(row))}</td><td>{escape(row[column])}</td></tr>" for row in failed
    ]
    note = f"<p>{len(rows)} of {count}.</p>" if len(rows) < count else ""
    return note + _table((("Clip", ""), ("Error", "")), rows)


def _table(titles: Iterable[tuple[str, str]], rows: list[str]) -> str:
    heads = "".join(
        f'<th class="{kind}"><button>{escape(title)}</button></th>' for title, kind in titles
    )
    return (
        f'<table class="sortable"><thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _worst_text(row: Row, code: str) -> str:
    worst = row[f"{code}.worst"]
    return "∞" if worst is None else format(worst, ".3g")


def _millimetres(metres: float | None) -> float | None:
    return None if metres is None else 1e3 * metres


def _number(value: float | None, text: str | None = None) -> str:
    if value is None:  # it does not exist, or is too large for numbers
        value, text = math.nan, "–"
    # As JavaScript reads it.
    key = repr(value).replace("inf", "Infinity").replace("nan", "-Infinity")
    return f'<td class="n" data-value="{key}">{text or format(value, ".3g")}</td>'
