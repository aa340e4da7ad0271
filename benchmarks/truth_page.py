"""Writes docs/truth.md from docs/truth.json, and from what thresholds had found before."""

import json
from pathlib import Path
from statistics import median

from truth_goals import goals, ratios, shown_changes, shown_feet

DOCS = Path(__file__).resolve().parents[1] / "docs"
FIGURES, THRESHOLDS, PAGE = (
    DOCS / name for name in ("truth.json", "truth_thresholds.json", "truth.md")
)
# The page without its tables.
TEMPLATE = Path(__file__).with_name("truth_template.md")
# What every trial is filtered with, besides what suits its kind.
CUTOFFS = {"4": 4.0, "6": 6.0, "10": 10.0, "none": None}
NONE = "–"


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def numbers(values, digits):
    """Numbers with a space between them, None as a dash."""
    return " ".join(NONE if value is None else f"{value:.{digits}f}" for value in values)


def hertz(cutoff):
    return "none" if cutoff is None else f"{cutoff:g} Hz"


def variants(figures, thresholds):
    """(trial, its cut-off, {variant: figures at each cut-off}) of each trial."""
    for name, case in figures["trials"].items():
        before = thresholds["trials"].get(name, {}).get("found")
        sorts = {
            "thresholds": before,
            "found": case["found"],
            "measured contacts": case["measured"],
        }
        yield name, hertz(case["cutoff"]), {sort: rows for sort, rows in sorts.items() if rows}


def tabulate(figures, thresholds, show, sorts, titles=None):
    """A row per trial: for each sort of contacts a column per title."""
    titles = titles or [""]
    head = ["trial", "filter", *(f"{sort}{title}" for title in titles for sort in sorts)]
    rows = []
    for name, cutoff, cases in variants(figures, thresholds):
        cells = {sort: show(cases[sort]["default"]) for sort in sorts if sort in cases}
        empty = [NONE] * len(titles)
        rows.append(
            [name, cutoff]
            + [cells.get(sort, empty)[index] for index in range(len(titles)) for sort in sorts]
        )
    return table(head, rows)


def goal_table(figures, thresholds):
    said = {True: "yes", False: "**no**", None: "–"}
    rows = [
        [goal.what, goal.goal, goal.measured, said[goal.met]] for goal in goals(figures, thresholds)
    ]
    return table(["what", "goal", "measured", "met"], rows)


def change_table(figures, thresholds):
    def show(row):
        return shown_changes(row), f"{row['lost']:.1f}", f"{row['made_up']:.1f}"

    titles = [" [ms]", ": lost", ": made up"]
    return tabulate(figures, thresholds, show, ["thresholds", "found"], titles)


def feet_table(figures, thresholds):
    sorts = ["thresholds", "found", "measured contacts"]
    return tabulate(figures, thresholds, lambda row: [shown_feet(row)], sorts)


def whole_table(figures, thresholds):
    def show(row):
        return numbers(row["whole"], 2), numbers(row["cop"], 0)

    sorts = ["thresholds", "found", "measured contacts"]
    return tabulate(figures, thresholds, show, sorts, [": force", ": CoP"])


def filter_table(figures, thresholds):
    keys = [*CUTOFFS, "noise"]

    def show(row):
        feet = sum(row["feet"]) / len(row["feet"])
        changes = shown_changes(row)
        return f"{feet:.1f}" if changes == NONE else f"{changes}; {feet:.1f}"

    rows = [
        [name if index == 0 else "", sort, *(show(cases[sort][key]) for key in keys)]
        for name, _, cases in variants(figures, thresholds)
        for index, sort in enumerate(cases)
    ]
    titles = [hertz(CUTOFFS[key]) if key in CUTOFFS else "with noise" for key in keys]
    return table(["trial", "contacts", *titles], rows)


VERDICT = ["verdict", "distance [mm]", "codes"]


def status_table(figures, thresholds):
    rows = [
        [
            name,
            cutoff,
            ", ".join(f"{key} {value:.0f}" for key, value in case["statuses"].items()),
            *verdict_cells(case),
        ]
        for name, cutoff, cases in variants(figures, thresholds)
        for case in [cases["found"]["default"]]
    ]
    return table(["trial", "filter", "statuses", *VERDICT], rows)


def verdict_cells(row):
    codes = [] if row["verdict"] == "feasible" else row["codes"]
    return [row["verdict"], numbers([row["distance"]], 1), ", ".join(codes)]


def clip_table(figures, thresholds):
    before, parts = thresholds["clips"], ratios(figures["clips"], thresholds["clips"])
    head = [
        "clip",
        "force: thresholds",
        "found",
        "ours / thresholds",
        "all feet always",
        "moment: thresholds",
        "found",
    ]
    head += ["largest: thresholds", "found", "within limits: thresholds", "found"]
    head += ["faster than 1 m/s", "fastest", *VERDICT]

    def pair(name, key, form):
        return [
            format(row[key], form) if "error" not in row else NONE
            for row in (before.get(name, {"error": ""}), figures["clips"][name])
        ]

    rows, unread = [], []
    for name, row in figures["clips"].items():
        if "error" in row:
            unread.append(f"- {name}: {row['error'].removeprefix(f'{name}: ')}")
            continue
        ratio = f"{parts[name]:.2f}" if name in parts else NONE
        rows.append(
            [name, *pair(name, "force_rms", ".3f"), ratio, f"{row['force_bound']:.3f}"]
            + pair(name, "torque_rms", ".3f")
            + [*pair(name, "force_largest", ".2f"), *pair(name, "within", ".0f")]
            + [f"{row['fast']:.1f} %", numbers([row["fastest"]], 2), *verdict_cells(row)]
        )
    text = table(head, rows)
    if unread:
        text += "\n\nThese cannot be read:\n\n" + "\n".join(unread)
    return text


def walk_table(figures, thresholds):
    head = ["walk", "contacts", "changes", "worst [frames]", "gone", "made up"]
    rows = [
        [name if sort == "thresholds" else "", sort]
        + [row[name][key] for key in ("changes", "worst", "gone", "made_up")]
        for name in figures["walks"]
        for sort, row in (("thresholds", thresholds["walks"]), ("found", figures["walks"]))
    ]
    return table(head, rows)


def standing_table(figures, thresholds):
    keys = ["changes", "moved", "worst", "gone", "made_up", "while_standing"]
    head = [
        "clip",
        "at rest at its ends",
        "changes",
        "moved by more than a frame",
        "worst [frames]",
    ]
    head += ["gone", "made up in it", "made up while it stands"]
    rows = [
        [name, "yes" if row["at_rest"] else "no", *(row[key] for key in keys)]
        for name, row in figures.get("standing", {}).items()
    ]
    return table(head, rows)


def constant_table(figures, thresholds):
    head = ["constant", "times", "largest median [ms]", "in", "most missed", "in", "force [%]"]
    rows = []
    for name, factors in figures.get("constants", {}).items():
        for factor, row in factors.items():
            if "error" in row:
                rows.append([f"`{name}`", factor, *[NONE] * 4, f"refused: {row['error']}"])
                continue
            missed = row["missed_of"] if row["missed"] else NONE
            rows.append(
                [f"`{name}`", factor, f"{row['median']:.0f}", row["median_of"], row["missed"]]
                + [missed, f"{row['force']:.1f}"]
            )
    return table(head, rows)


def share_table(figures, thresholds):
    shares = figures["shares"]
    kinds = list(next(iter(shares.values())))
    rows = [[name, *(f"{row[kind]:.1f}" for kind in kinds)] for name, row in shares.items()]
    medians = (median(row[kind] for row in shares.values()) for kind in kinds)
    rows.append(["median", *(f"{value:.1f}" for value in medians)])
    return table(["trial", *kinds], rows)


TABLES = {
    "goals": goal_table,
    "changes": change_table,
    "feet": feet_table,
    "whole": whole_table,
    "filters": filter_table,
    "shares": share_table,
    "statuses": status_table,
    "clips": clip_table,
    "walks": walk_table,
    "standing": standing_table,
    "constants": constant_table,
}


def write_dates(dates):
    """When the sections were measured: some take long, and may be older than the others."""
    last = max(dates.values())
    older = [f"{section} on {date}" for section, date in dates.items() if date != last]
    return f"{last} ({', '.join(older)})" if older else last


def page(figures, thresholds):
    """The text of docs/truth.md."""
    tables = {name: write(figures, thresholds) for name, write in TABLES.items()}
    dates = {"date": write_dates(figures["dates"]), "before": thresholds["date"]}
    template = TEMPLATE.read_text(encoding="utf-8")
    return template.format(**dates, **tables, none=NONE)


def write():
    """Writes the page from what is kept."""
    figures, thresholds = (
        json.loads(path.read_text(encoding="utf-8")) for path in (FIGURES, THRESHOLDS)
    )
    PAGE.write_text(page(figures, thresholds), encoding="utf-8")
