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

# What rows are called, and the goals of their ratios; those without one are shown for comparison.
COLD, ACTIVE4 = "2 soles, none active, cold", "2 soles, 4 active, cold"
GOAL_TABLE = {
    "distributeForce/soles/inside/vs_plain": (COLD, 0.11),
    "distributeForce/soles/inside/vs_fast": (COLD, 0.2),
    "distributeForce/soles/inside/vs_rt": (COLD, None),
    "distributeForce/soles/inside/vs_DAQP_feet": (COLD, 0.3),
    "distributeForce/soles/inside/vs_DAQP_wrench": (COLD, None),
    "distributeForce/soles/inside/vs_PIQP_wrench": (COLD, None),
    "distributeForce/soles/inside/vs_ProxQP_wrench": (COLD, None),
    **{
        f"distributeForce/soles/active{active}/vs_{peer}": (f"2 soles, {active} active, cold", goal)
        for active in range(2, 7)
        for peer, goal in {"fast": 0.27, "DAQP_feet": 0.7}.items()
    },
    "distributeForce/soles/active4/vs_rt": (ACTIVE4, None),
    "distributeForce/soles/active4/vs_DAQP_wrench": (ACTIVE4, None),
    "distributeForce/soles/active4/vs_PIQP_wrench": (ACTIVE4, None),
    "distributeForce/soles/active4/vs_ProxQP_wrench": (ACTIVE4, None),
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
    "distributeForce/soles_cones/inside/vs_pyramids": ("exact cones, 2 soles, none active", 1.05),
    "distributeForce/soles_cones/limit/vs_pyramids": ("exact cones, 2 soles, at the limit", 1.5),
    "distributeForce/soles_cones/slipping/vs_pyramids": ("exact cones, 2 soles, slipping", 2.0),
    "distributeForce/soles_cones/tipping/vs_pyramids": ("exact cones, 2 soles, tipping", 2.0),
    "distributeForce/points_cones/inside/vs_pyramids": ("exact cones, 4 points, none active", 1.05),
    "distributeForce/points_cones/limit/vs_pyramids": ("exact cones, 4 points, at the limit", 1.5),
    "distributeForce/points_cones/slipping/vs_pyramids": ("exact cones, 4 points, slipping", 2.0),
    "distributeForce/points_cones/tipping/vs_pyramids": ("exact cones, 4 points, tipping", 2.0),
    "distributeForce/octagons/inside/vs_pyramids": ("2 polygons of 8, none active", 1.1),
    "distributeForce/octagons/active/vs_pyramids": ("2 polygons of 8, active", 1.6),
    "distributeForce/points/inside/vs_fast": ("4 points, none active, cold", 0.25),
    "distributeForce/points8/inside/vs_fast": ("8 points, none active, cold", 0.25),
    "distributeForce/soles4/inside/vs_fast": ("4 soles, none active, cold", 0.25),
    "distributeForce/walk/warm/vs_plain": ("the walk, warm, median", 0.15),
    "distributeForce/walk_1kHz/warm/vs_plain": ("the walk at 1 kHz, warm, median", None),
    "distributeForce/walk_1kHz/cold/vs_plain": ("the walk at 1 kHz, cold, median", None),
    "distributeForce/walk/warm/calls/p99.9": ("the walk, warm, p99.9 of all calls", 3.0),
    "computeDynamics": ("`computeDynamics`, Talos", 1.02),
    "computeDynamics(data)": ("`computeDynamics(data)`, Talos", 0.1),
    PYTHON_TICK: ("a tick from Python, Talos", 1.0),
    "analyzeMotion/sway/avx512": ("G1 sways, AVX-512", 0.15),
    "analyzeMotion/sway/avx2": ("G1 sways, AVX2", 0.22),
    "analyzeMotion/dance/avx512": ("G1 dances, AVX-512", 0.5),
    "analyzeMotion/dance, corners, cones/avx512": (
        "G1 dances, corners with exact cones, AVX-512",
        0.25,
    ),
    "analyzeMotion/2 threads": ("two threads, a long clip", round(1 / 1.9, 3)),
    "analyzeMotions/2 threads": ("two threads, 64 clips", round(1 / 1.9, 3)),
}
# The same for goals of times [µs].
TIME_TABLE = {
    "distributeForce/walk/warm/ticks/p99.9": ("the walk, warm, p99.9 of ticks' medians", 1.0),
    "distributeForce/soles/leaning/vs_fast": ("2 soles, leaning out of reach", 5.0),
    "distributeForce/points8/leaning/vs_fast": ("8 points, leaning out of reach", 10.0),
    "distributeForce/soles/boundary/cap150/p99": ("2 soles, next to the boundary, p99", 50.0),
}
# What references are called.
PEERS = {
    "DAQP/wrench": "DAQP, wrench moves",
    "DAQP/feet": "DAQP, feet move",
    "PIQP/wrench": "PIQP, wrench moves",
    "ProxQP/wrench": "ProxQP, wrench moves",
    "distributeForce/soles": "rectangles with pyramids",
    "distributeForce/points": "points with pyramids",
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
GOALS = {name: f"{goal:.2f}" for name, (_, goal) in GOAL_TABLE.items() if goal}
GOALS |= {name: f"{goal:g} µs" for name, (_, goal) in TIME_TABLE.items()}


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
    return PEERS.get(f"{solver}/{variant}", f"{solver} {variant}")


def goal_rows(times):
    """(what, row, value, goal) of all that the table of goals shows.

    The value is a ratio, or a time [µs] where the goal is one; goal is None where there is none.
    """
    rows = {row["name"]: row for row in times["rows"]}
    shown = [
        (what, rows[name], rows[name]["ratio"], goal)
        for name, (what, goal) in GOAL_TABLE.items()
        if name in rows
    ]
    shown += [
        (what, rows[name], rows[name]["median_ns"] / 1000, goal)
        for name, (what, goal) in TIME_TABLE.items()
        if name in rows
    ]
    return shown


def goals_table(times):
    lines = []
    for what, row, value, goal in goal_rows(times):
        measured, reference, ratio = microseconds(row["median_ns"]), "", ""
        shown_goal = f"≤ {goal:g}" if goal else ""
        missed = "**" if goal and value > goal else ""
        if row["name"] in TIME_TABLE:
            measured, shown_goal = f"{missed}{measured}{missed}", f"{shown_goal} µs"
        else:
            time = microseconds(row["median_ns"] / row["ratio"])
            reference = f"{show_reference(row['reference'])}, {time}"
            ratio = f"{missed}{row['ratio']:.3f}{missed}"
        lines.append((what, measured, reference, ratio, shown_goal))
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


def goal_label(what, row):
    """What the picture of goals says of one."""
    of = "µs" if row["name"] in TIME_TABLE else show_reference(row["reference"])
    return f"{what.replace('`', '')} / {of}"


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
            (goal_label(what, row), value, goal)
            for what, row, value, goal in goal_rows(times)
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
