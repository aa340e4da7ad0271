"""Keeps what was measured in docs/performance.json, and writes docs/performance.md from that.

Of the page only the tables are written, between ``<!-- NAME -->`` and ``<!-- end of NAME -->``; the
pictures are docs/performance_*.svg.
"""

import datetime
import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import plots
from measure import EIQUADPROG, JITTER_SORTS, OURS, PYTHON_BOUND, PYTHON_TICK, WALKS, WAYS

DOCS = Path(__file__).resolve().parents[1] / "docs"
RECORD = DOCS / "performance.json"

# What rows are called, and their goals; those without one are shown beside the others.
GOAL_TABLE = {
    "distributeForce/soles/inside/vs_plain": ("2 soles, none active, cold", 0.15),
    "distributeForce/soles/inside/vs_fast": ("2 soles, none active, cold", 0.20),
    "distributeForce/soles/inside/vs_rt": ("2 soles, none active, cold", None),
    "distributeForce/soles/active2/vs_fast": ("2 soles, 2 active, cold", 0.5),
    "distributeForce/soles/active3/vs_fast": ("2 soles, 3 active, cold", 0.5),
    "distributeForce/soles/active4/vs_fast": ("2 soles, 4 active, cold", 0.5),
    "distributeForce/soles/active4/vs_rt": ("2 soles, 4 active, cold", None),
    "distributeForce/soles/active5/vs_fast": ("2 soles, 5 active, cold", 0.5),
    "distributeForce/soles/active6/vs_fast": ("2 soles, 6 active, cold", 0.5),
    "distributeForce/soles/slipping/vs_fast": ("2 soles, slipping, against 4 active", 1.0),
    "distributeForce/soles/slipping/vs_fast_inside": (
        "2 soles, slipping, against none active",
        1.0,
    ),
    "distributeForce/soles/tipping/vs_fast": ("2 soles, tipping, against 4 active", 1.0),
    "distributeForce/soles/tipping/vs_fast_inside": (
        "2 soles, tipping, against none active",
        1.0,
    ),
    "distributeForce/soles/lifted/vs_fast": ("2 soles, lifted, against 4 active", 1.0),
    "distributeForce/soles/lifted/vs_fast_inside": (
        "2 soles, lifted, against none active",
        1.0,
    ),
    "distributeForce/points/slipping/vs_fast": ("4 points, slipping, against `edge`", 1.0),
    "distributeForce/points/slipping/vs_fast_inside": (
        "4 points, slipping, against none active",
        1.0,
    ),
    "distributeForce/points/tipping/vs_fast": ("4 points, tipping, against `edge`", 1.0),
    "distributeForce/points/tipping/vs_fast_inside": (
        "4 points, tipping, against none active",
        1.0,
    ),
    "distributeForce/points/lifted/vs_fast": ("4 points, lifted, against `edge`", 1.0),
    "distributeForce/points/lifted/vs_fast_inside": (
        "4 points, lifted, against none active",
        1.0,
    ),
    "distributeForce/points/inside/vs_fast": ("4 points, none active, cold", 0.25),
    "distributeForce/points8/inside/vs_fast": ("8 points, none active, cold", 0.25),
    "distributeForce/soles4/inside/vs_fast": ("4 soles, none active, cold", 0.25),
    "distributeForce/walk/warm/vs_plain": ("the walk, warm, median", 0.15),
    "distributeForce/walk_1kHz/warm/vs_plain": ("the walk at 1 kHz, warm, median", None),
    "distributeForce/walk_1kHz/cold/vs_plain": ("the walk at 1 kHz, cold, median", None),
    "distributeForce/walk/warm/calls/p99.9": ("the walk, warm, p99.9 of all calls", 3.0),
    "distributeForce/walk/warm/ticks/p99.9": ("the walk, warm, p99.9 of ticks' medians", 3.0),
    "computeDynamics": ("`computeDynamics`, Talos", 1.02),
    "computeDynamics(data)": ("`computeDynamics(data)`, Talos", 0.1),
    PYTHON_TICK: ("a tick from Python, Talos", 1.0),
    "analyzeMotion/sway/avx512": ("G1 sways, AVX-512", 0.15),
    "analyzeMotion/sway/avx2": ("G1 sways, AVX2", 0.22),
    "analyzeMotion/dance/avx512": ("G1 dances, AVX-512", 0.5),
    "analyzeMotion/2 threads": ("two threads, a long clip", round(1 / 1.9, 3)),
    "analyzeMotions/2 threads": ("two threads, 64 clips", round(1 / 1.9, 3)),
}
# Of batches: what rows are called; their goal and whether that is to be reached or not exceeded.
BATCH_TABLE = {
    "command": ("`dynacom batch --jobs 2`, from its start to its end", (">=", 150_000)),
    "two": ("the same, from the first result to the last", (">=", 150_000)),
    "one worker": ("with `--jobs 1`", None),
    "one core": ("with `--jobs 1`, all on one core", None),
    "two workers over one": ("two workers over one", None),
    "two cores over one": ("two cores over one", (">=", 1.9)),
    "parent": ("peak memory of {more} clips over {few}: of the command", ("<=", 1.1)),
    "worker": ("peak memory of {more} clips over {few}: of the larger worker", ("<=", 1.1)),
    "ray": ("time of `--engine ray` over `--engine local`", ("<=", 1.5)),
}
GOALS = {name: goal for name, (_, goal) in GOAL_TABLE.items() if goal}


def to_json(value, *, depth=3):
    """JSON with a line for each entry of the outer containers, so that changes can be read."""
    if depth and isinstance(value, dict):
        entries = [f"{json.dumps(key)}: {to_json(value[key], depth=depth - 1)}" for key in value]
        return "{\n" + ",\n".join(entries) + "\n}"
    if depth and isinstance(value, list) and isinstance(value[0], dict):
        return "[\n" + ",\n".join(map(json.dumps, value)) + "\n]"
    return json.dumps(value)


def machine():
    """What figures were measured on, in a few words."""
    processor = subprocess.run(["lscpu"], capture_output=True, text=True).stdout
    model = re.search(r"Model name: *(.*)", processor)
    compiler = subprocess.run(
        [os.environ.get("CXX", "g++"), "-dumpfullversion"], capture_output=True, text=True
    ).stdout.strip()
    return (
        f"{model[1] if model else platform.machine()}, {os.cpu_count()} cores, "
        f"{platform.freedesktop_os_release()['PRETTY_NAME']}, g++ {compiler}"
    )


def record(part, result, *, rough):
    """Put a result in the place of the last one of its part, and write the page."""
    parts = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    today = datetime.date.today().isoformat()
    parts[part] = {"date": today, "machine": machine(), "rough": rough, **result}
    RECORD.write_text(to_json(dict(sorted(parts.items()))) + "\n")
    write()


# ---- Tables ----


def markdown(header, rows):
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def microseconds(nanoseconds):
    return f"{nanoseconds / 1000:.2f} µs"


def show_reference(name):
    """The name of a reference, as one says it."""
    if name == PYTHON_BOUND:
        return "2 × C++ + 3 µs"
    if name == "computeCentroidalMomentumTimeVariation":
        return "Pinocchio"
    if name.startswith("Pinocchio and eiquadprog"):
        return "Pinocchio + eiquadprog plain"
    if name.endswith(" thread"):
        return "one thread"
    if name.endswith(", median"):
        return "its median"
    solver, variant, *problem = name.split("/")
    return f"{solver} {variant}"


def goal_rows(times):
    """(what, row, goal) of all that the table of goals shows; goal is None where there is none."""
    rows = {row["name"]: row for row in times["rows"]}
    shown = {name: entry for name, entry in GOAL_TABLE.items() if name in rows}
    return [(what, rows[name], goal) for name, (what, goal) in shown.items()]


def goals_table(times):
    lines = []
    for what, row, goal in goal_rows(times):
        reference = microseconds(row["median_ns"] / row["ratio"])
        lines.append(
            (
                what,
                microseconds(row["median_ns"]),
                f"{show_reference(row['reference'])}, {reference}",
                f"**{row['ratio']:.3f}**"
                if goal and row["ratio"] > goal
                else f"{row['ratio']:.3f}",
                f"≤ {goal:g}" if goal else "",
            )
        )
    return markdown(("what", "measured", "reference", "ratio", "goal"), lines)


def cases_table(times):
    """distributeForce, cold and warm, beside eiquadprog fast."""
    rows = {row["name"]: row for row in times["rows"]}
    lines = []
    for name, cold in rows.items():
        found = re.fullmatch("distributeForce/(\\w+/\\w+)/vs_fast", name)
        if not found or found[1].startswith("walk"):
            continue
        warm = rows[f"distributeForce/{found[1]}/warm/vs_fast"]
        of = cold["reference"].removeprefix("eiquadprog/fast/")
        time = microseconds(cold["median_ns"] / cold["ratio"])
        lines.append(
            (
                found[1].replace("/", ", "),
                microseconds(cold["median_ns"]),
                microseconds(warm["median_ns"]),
                time if of == found[1] else f"{time} ({of.replace('/', ', ')})",
                f"{cold['ratio']:.2f}",
                f"{warm['ratio']:.2f}",
            )
        )
    header = ("case", "cold", "warm", "eiquadprog fast", "ratio, cold", "ratio, warm")
    return markdown(header, lines)


def walk_table(times, walk="walk"):
    rows = {row["name"]: row["median_ns"] for row in times["rows"]}
    lines = []
    for way in WAYS:
        row = way.replace("walk", walk)
        is_ours = way in OURS
        medians = [
            rows.get(f"{row}{support}/vs_fast" if is_ours else row + support)
            for support in ("", "/single", "/double")
        ]
        percentiles = [
            rows[f"{row}/{kind}/{label}"]
            for kind in ("calls", "ticks")
            for label in ("p99", "p99.9", "maximum")
        ]
        name = f"`distributeForce`, {way.split('/')[-1]}" if is_ours else way.split("/")[1]
        if way in EIQUADPROG:
            name = "eiquadprog " + name
        cells = (f"{time / 1000:.2f}" if time else "" for time in medians + percentiles)
        lines.append((name, *cells))
    header = ["", "median", "one sole", "two soles", "p99", "p99.9", "maximum"]
    header += ["ticks' p99", "ticks' p99.9", "ticks' maximum"]
    return markdown(header, lines)


def iterations_table(iterations):
    """What a warm start gives along the walks."""
    rates = {walk: f"{rate} Hz" if rate else "that of its frames" for walk, rate in WALKS.items()}
    lines = []
    for walk, starts in iterations.items():
        for start, of in starts.items():
            numbers = (of["ticks"], of["all"], of["repeated"], of["most"])
            lines.append((rates[walk], start, *map(str, numbers)))
    header = ("rate", "start", "ticks", "iterations", "ticks with more than one", "the most")
    return markdown(header, lines)


def boundary_table(boundary):
    robots = {"soles": "2 soles", "points": "4 points"}
    lines = [
        (
            robots[row["robot"]],
            f"{row['cap']}",
            f"{100 * row['failures'] / row['wrenches']:.1f} %",
            f"{row['iterations']}",
            *(f"{row[label] / 1000:.0f} µs" for label in ("median", "p99", "maximum")),
        )
        for row in boundary
    ]
    header = ("contacts", "cap", "without an answer", "most iterations")
    return markdown((*header, "median", "p99", "maximum"), lines)


def more_tables(times):
    """What is no row: iterations, and how many wrenches had no answer."""
    tables = {"iterations": iterations_table, "boundary": boundary_table}
    return {name: table(times[name]) for name, table in tables.items() if name in times}


def counts_table(counts):
    lines = []
    for row in counts["rows"]:
        if row["name"] not in GOAL_TABLE:
            continue
        lines.append(
            (
                GOAL_TABLE[row["name"]][0],
                f"{row['instructions']:.0f}",
                f"{show_reference(row['reference'])}, {row['instructions'] / row['ratio']:.0f}",
                f"{row['ratio']:.3f}",
            )
        )
    return markdown(("what", "instructions", "reference", "ratio"), lines)


def jitter_table(jitter):
    labels = ("median", "p99", "p99.9", "maximum")
    lines = [
        (sort, *(f"{jitter[sort][label] / 1000:.1f} µs" for label in labels))
        for sort in JITTER_SORTS
    ]
    return markdown(("", *labels), lines)


def jitter_conditions(jitter):
    said = {True: "granted", False: "refused"}
    return (
        f"{jitter['ticks']} ticks in {jitter['minutes']:g} min on {jitter['cores']} cores; "
        f"`SCHED_FIFO` was {said[jitter['fifo']]}, `mlockall` {said[jitter['locked']]}; "
        f"a hypervisor took {jitter['stolen_s']:.1f} s away from the cores; "
        f"{jitter['overruns']} ticks ended more than 1 ms after they were due."
    )


def batch_values(batch):
    """{name: value} of what there are goals for."""
    rates = batch["rates"]
    few, more = batch["memory"][0], batch["memory"][1]
    values = {
        **rates,
        "two workers over one": rates["two"] / rates["one worker"],
        "two cores over one": rates["two"] / rates["one core"],
        **{process: more[process] / few[process] for process in ("parent", "worker")},
    }
    if engines := batch.get("engines"):
        values["ray"] = engines["local"]["rate"] / engines["ray"]["rate"]
    return values


def batch_table(batch):
    values = batch_values(batch)
    numbers = {"few": batch["memory"][0]["clips"], "more": batch["memory"][1]["clips"]}
    lines = []
    for name, (what, goal) in BATCH_TABLE.items():
        value, shown_goal = values.get(name), ""
        if value is None:
            shown = "not measured"
        else:
            shown = f"{value:,.0f} frames/s" if name in batch["rates"] else f"{value:.2f}"
        if goal:
            relation, limit = goal
            shown_goal = f"{'≥' if relation == '>=' else '≤'} {limit:,g}"
            if value is not None and (value < limit if relation == ">=" else value > limit):
                shown = f"**{shown}**"
        lines.append((what.format_map(numbers), shown, shown_goal))
    return markdown(("what", "measured", "goal"), lines)


def batch_conditions(batch):
    of = batch["clips"]
    shares = {name: f"{100 * value:.0f} %" for name, value in of.items() if name != "number"}
    return (
        f"{of['number']:,} clips of 10 s at 30 fps, {shares['feasible']} of them feasible; of "
        f"their frames {shares['solved']} are `Solved`, {shares['relaxed']} `Relaxed`, "
        f"{shares['no_contact']} `NoContact`. {batch['lanes']} lanes; medians of "
        f"{batch['repetitions']} runs. The first result came {batch['starting_s']:.2f} s after the "
        f"start, and the process ended {batch['ending_s']:.2f} s after the last."
    )


def shares_table(batch):
    shares = batch["shares"]
    total = sum(shares.values())
    lines = [
        (step, f"{1e3 * seconds:.2f} ms", f"{100 * seconds / total:.0f} %")
        for step, seconds in shares.items()
    ]
    lines.append(("all of these", f"{1e3 * total:.2f} ms", "100 %"))
    lines.append(("the batch itself, without start-up", f"{1e3 * batch['cpu_s']:.2f} ms", ""))
    return markdown(("step", "time a clip", "share"), lines)


def readers_table(batch):
    lines = [(name, f"{1e3 * seconds:.2f} ms") for name, seconds in batch["readers"].items()]
    return markdown(("reader", "time a clip"), lines)


def memory_table(batch):
    rows = list(batch["memory"])
    if engines := batch.get("engines"):
        rows.append(engines["local"])
    lines = [
        (f"{row['clips']:,}", *(f"{row[name] / 1024:.0f} MiB" for name in ("parent", "worker")))
        for row in rows
    ]
    return markdown(("clips", "the command", "the larger worker"), lines)


def engines_table(batch):
    lines = [
        (
            engine,
            f"{run['clips']:,}",
            f"{run['starting']:.1f} s",
            f"{run['working']:.1f} s",
            f"{run['rate']:,.0f}",
            f"{run['ending']:.1f} s",
        )
        for engine, run in batch["engines"].items()
    ]
    header = ("engine", "clips", "to the first result", "to the last", "frames/s", "to the end")
    return markdown(header, lines)


def batch_blocks(batch):
    """All that the page says of batches, block by block."""
    blocks = {
        "batch": f"{batch_conditions(batch)}\n\n{batch_table(batch)}",
        "batch_shares": shares_table(batch),
        "batch_readers": readers_table(batch),
        "batch_memory": memory_table(batch),
    }
    measured = "engines" in batch
    blocks["batch_engines"] = engines_table(batch) if measured else "Ray was not installed."
    return blocks


def provenance(part):
    rough = ", roughly (`--quick`)" if part["rough"] else ""
    return f"Measured on {part['date']}{rough}: {part['machine']}."


def write():
    """Write tables and pictures from docs/performance.json."""
    parts = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    blocks, goals = {}, []
    if times := parts.get("times"):
        blocks["when"] = provenance(times)
        blocks["goals"] = goals_table(times)
        blocks["cases"] = cases_table(times)
        names = {row["name"] for row in times["rows"]}
        for walk in WALKS:
            if f"distributeForce/{walk}/warm/vs_fast" in names:
                blocks[walk] = walk_table(times, walk)
        blocks.update(more_tables(times))
        goals = [
            (f"{what.replace('`', '')} / {show_reference(row['reference'])}", row["ratio"], goal)
            for what, row, goal in goal_rows(times)
            if goal
        ]
    if counts := parts.get("counts"):
        blocks["counts"] = f"{provenance(counts)}\n\n{counts_table(counts)}"
    if jitter := parts.get("jitter"):
        conditions = f"{provenance(jitter)} {jitter_conditions(jitter)}"
        blocks["jitter"] = f"{conditions}\n\n{jitter_table(jitter)}"
    if batch := parts.get("batch"):
        blocks.update(batch_blocks(batch))
        blocks["batch"] = f"{provenance(batch)} {blocks['batch']}"

    path = DOCS / "performance.md"
    text = path.read_text()
    for name, block in blocks.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        if text.count(begin) != 1 or text.count(end) != 1:
            sys.exit(f"{path.name} has no place, or several, for {name}")
        before, rest = text.split(begin)
        text = before + begin + block + "\n" + rest[rest.index(end) :]
    path.write_text(text)
    plots.draw(parts, goals, DOCS)
