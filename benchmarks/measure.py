"""Runs the executables of this folder, and Python's tick, and makes rows of what they measure.

A row is ``{"name": …, "reference": …, "median_ns": …, "ratio": …}``: a time, the name of what it is
measured against, and the ratio of the two; the last two are None where there is no reference.
"""

import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build/benchmarks"
NANOSECONDS = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}

# Of Google Benchmark: main.cpp.
CASES = ("bench_dynamics", "bench_distribution", "bench_analysis")
# Those of them that are timed by the clock on the wall.
IN_THREADS = re.compile(r"\d threads?$")
# What bench_walk measures, in its order.
OURS = ("distributeForce/walk/warm", "distributeForce/walk/cold")
EIQUADPROG = ("eiquadprog/plain/walk", "eiquadprog/fast/walk")
CLOCK = "walk/clock"
WAYS = (*OURS, *EIQUADPROG, CLOCK)
PERCENTILES = {"p99": 99, "p99.9": 99.9, "maximum": 100}
# The walk at the rate of its file, and at that of a controller; names of rows have the first word.
WALKS = {"walk": None, "walk_1kHz": 1000}

# What bench_boundary is asked: which caps on the iterations.
CAPS = (20, 50, 150, 100000)

# What bench_jitter measures of each tick, and the edges of its histograms [ns]: 20 bins a decade.
JITTER_SORTS = ("wake-up latency", "computation", "distributeForce")
BIN_EDGES = np.logspace(1, 9, 8 * 20 + 1)

PYTHON_TICK, PYTHON_BOUND = "python/tick", "2 x tick + 3 us"


def say(what):
    print(what, "...", file=sys.stderr, flush=True)


def run(*command):
    """Run an executable; return what it prints."""
    command = list(map(str, command))
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)} failed with status {done.returncode}:\n{done.stderr}")
    return done.stdout


def make_row(name, time, reference=None, reference_time=None):
    ratio = time / reference_time if reference else None
    return {"name": name, "reference": reference, "median_ns": time, "ratio": ratio}


def list_cases(executable):
    """{name: reference or None} of the cases of an executable."""
    lines = run(FOLDER / executable, "--list").splitlines()
    return {name: reference or None for name, reference in (line.split("\t") for line in lines)}


def choose(cases, regex):
    """Those that match, and all that these take to be measured."""
    chosen = [name for name in cases if regex.search(name)]
    return chosen, list(dict.fromkeys(chosen + [cases[name] for name in chosen if cases[name]]))


# ---- Times ----


def case_medians(executable, names, quick):
    """{name: median CPU time in ns} of these cases."""
    repetitions, min_time = (3, 0.01) if quick else (15, 0.02)
    # Other regular expressions do not know a space that is escaped.
    pattern = "|".join(map(re.escape, names)).replace(r"\ ", " ")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out.json")
        run(
            FOLDER / executable,
            f"--benchmark_filter=^({pattern})$",
            f"--benchmark_repetitions={repetitions}",
            f"--benchmark_min_time={min_time}",
            # What else the machine does then hits all alike.
            "--benchmark_enable_random_interleaving=true",
            f"--benchmark_out={out}",
            "--benchmark_out_format=json",
        )
        runs = json.loads(out.read_text())["benchmarks"]
    times = {}
    for entry in runs:
        if entry["run_type"] == "iteration":
            # Of several threads, what the first one takes says nothing.
            clock = "real_time" if IN_THREADS.search(entry["run_name"]) else "cpu_time"
            time = entry[clock] * NANOSECONDS[entry["time_unit"]]
            times.setdefault(entry["run_name"], []).append(time)
    return {name: statistics.median(times[name]) for name in names}


def case_rows(executable, regex, quick):
    cases = list_cases(executable)
    chosen, wanted = choose(cases, regex)
    if not chosen:
        return []
    say(executable)
    medians = {}
    # Several threads need all cores, and a memory that others have not left in pieces.
    for in_threads in (False, True):
        names = [name for name in wanted if bool(IN_THREADS.search(name)) == in_threads]
        if names:
            medians |= case_medians(executable, names, quick)
    return [make_row(name, medians[name], cases[name], medians.get(cases[name])) for name in chosen]


def interpolate(walk, rate):
    """The arrays of a walk at this rate [Hz]; a foot stands if it does just before or just after.

    Between these frames the wrench goes over from foot to foot: it takes both.
    """
    frames = walk["t"]
    t = np.arange(round((frames[-1] - frames[0]) * rate)) / rate + frames[0]
    before = np.searchsorted(frames, t + 1e-9, side="right") - 1
    between = {
        key: np.column_stack([np.interp(t, frames, column) for column in walk[key].T])
        for key in ("q", "v", "a")
    }
    # Frames are so close that a straight line between quaternions is as good as an arc.
    between["q"][:, 3:7] /= np.linalg.norm(between["q"][:, 3:7], axis=1, keepdims=True)
    after = np.minimum(before + 1, len(frames) - 1)
    return {**between, "contacts": walk["contacts"][before] | walk["contacts"][after]}


def write_walk(rate=None):
    """Write the bundled walk of Talos for walk.hpp; return the file, and which soles stand when."""
    walk = dict(np.load(ROOT / "examples/data/talos_walk.npz"))
    names = list(walk["contact_names"])
    if rate:
        walk.update(interpolate(walk, rate))
    soles = walk["contacts"][:, [names.index("left_sole"), names.index("right_sole")]]
    path = FOLDER / f"talos_walk_{rate or 'frames'}.txt"
    np.savetxt(path, np.hstack([soles, walk["q"], walk["v"], walk["a"]]), fmt="%.17g")
    return path, soles


def walk_times(path, ticks, quick):
    """Times of each call [ns], repetitions x ways x ticks; and the iterations of each tick."""
    say("bench_walk")
    repetitions = max(10, (16_000 if quick else 318_000) // ticks)
    with tempfile.TemporaryDirectory() as folder:
        samples = Path(folder, "samples")
        iterations = json.loads(run(FOLDER / "bench_walk", path, samples, repetitions))
        times = np.fromfile(samples, np.float32)
    return times.reshape(repetitions, len(WAYS), ticks).astype(float), iterations


def walk_rows(walk, times, soles):
    """Rows of the medians against eiquadprog, over all ticks and by support; and of percentiles."""
    rows = []

    def add(name, time, reference=None, reference_time=None):
        def rename(name):
            return name and name.replace("walk", walk)

        rows.append(make_row(rename(name), time, rename(reference), reference_time))

    supports = {"": soles.any(1), "/single": soles.sum(1) == 1, "/double": soles.sum(1) == 2}
    for support, ticks in supports.items():
        medians = {way: float(np.median(times[:, i, ticks])) for i, way in enumerate(WAYS)}
        for way in EIQUADPROG:
            add(way + support, medians[way])
        for way in OURS:
            for reference in EIQUADPROG:
                name = f"{way}{support}/vs_{reference.split('/')[1]}"
                add(name, medians[way], reference + support, medians[reference])
    for i, way in enumerate(WAYS):
        median = float(np.median(times[:, i]))
        # Of all calls; and of the ticks' own medians, which leaves out what else the machine did.
        for kind, sample in (("calls", times[:, i]), ("ticks", np.median(times[:, i], axis=0))):
            for label, percent in PERCENTILES.items():
                value = float(np.percentile(sample, percent))
                add(f"{way}/{kind}/{label}", value, f"{way}, median", median)
    add(CLOCK, median)
    return rows


def walk_profile(times, soles):
    """What the walk's picture shows: how many soles, and the medians of the ticks."""
    medians = np.median(times, axis=0).round().astype(int)
    profile = {way: medians[i].tolist() for i, way in enumerate(WAYS)}
    return {"soles": soles.sum(1).tolist(), "ticks": profile}


def iterations_profile(iterations):
    """Of a walk, warm and cold: all iterations, in how many ticks there were more, how many."""
    return {
        start: {
            "ticks": len(ticks),
            "all": int(np.sum(ticks)),
            "repeated": int(np.sum(np.array(ticks) > 1)),
            "most": int(np.max(ticks)),
        }
        for start, ticks in iterations.items()
    }


def walks(regex, quick):
    """Rows of the walks that match; the picture of the first; and iterations."""
    result = {"rows": []}
    for walk, rate in WALKS.items():
        path, soles = write_walk(rate)
        rows = walk_rows(walk, np.ones((1, len(WAYS), len(soles))), soles)
        if not any(regex.search(row["name"]) for row in rows):
            continue
        samples, iterations = walk_times(path, len(soles), quick)
        rows = walk_rows(walk, samples, soles)
        result["rows"] += [row for row in rows if regex.search(row["name"])]
        if rate is None:
            result["walk"] = walk_profile(samples, soles)
        result.setdefault("iterations", {})[walk] = iterations_profile(iterations)
    return result


def boundary(regex, quick):
    """Rows of what wrenches next to the boundary take, by cap; and how many had no answer."""
    names = {
        (robot, cap): f"distributeForce/{robot}/boundary/cap{cap}"
        for cap in CAPS
        for robot in ("soles", "points")
    }
    chosen = [key for key in names if regex.search(names[key])]
    if not chosen:
        return {"rows": []}
    say("bench_boundary")
    number, repetitions = (500, 5) if quick else (5000, 9)
    caps = dict.fromkeys(cap for _, cap in chosen)
    lines = run(FOLDER / "bench_boundary", number, repetitions, *caps).splitlines()
    rows, kept = [], []
    for entry in map(json.loads, lines):
        times = entry.pop("times")
        key = entry["robot"], entry["cap"]
        if key not in chosen:
            continue
        values = {label: float(np.percentile(times, p)) for label, p in PERCENTILES.items()}
        values["median"] = statistics.median(times)
        rows += [make_row(f"{names[key]}/{label}", value) for label, value in values.items()]
        kept.append({**entry, "wrenches": number, **values})
    return {"rows": rows, "boundary": kept}


def python_row(quick):
    """The tick in Python, beside that in C++ of the same minute."""
    say("python_tick.py")
    python, cpp = [], []
    for _ in range(1 if quick else 5):
        tick = json.loads(run(sys.executable, ROOT / "benchmarks/python_tick.py"))
        python.append(tick["median_ns"])
        cpp.append(case_medians("bench_dynamics", ["tick"], quick)["tick"])
    bound = 2 * statistics.median(cpp) + 3000
    return make_row(PYTHON_TICK, statistics.median(python), PYTHON_BOUND, bound)


def times(regex, quick):
    """All that is timed and matches, with what the page shows besides."""
    result = {"rows": []}
    for executable in CASES:
        result["rows"] += case_rows(executable, regex, quick)
    for part in (walks(regex, quick), boundary(regex, quick)):
        result["rows"] += part.pop("rows")
        result.update(part)
    if regex.search(PYTHON_TICK):
        result["rows"].append(python_row(quick))
    return result


# ---- Instructions ----


def count(executable, name, number):
    """Instructions that one call takes: preparing cancels out of two runs of different length."""
    say(name)
    totals = []
    with tempfile.TemporaryDirectory() as folder:
        for times in (number, 2 * number):
            out = Path(folder, "out")
            command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}"]
            run(*command, FOLDER / executable, "--repeat", name, times)
            totals.append(int(re.search(r"^totals: (\d+)", out.read_text(), re.M)[1]))
    return (totals[1] - totals[0]) / number


def counts(regex, quick):
    """Rows of all cases that match, with ``instructions`` instead of ``median_ns``."""
    rows = []
    for executable in CASES:
        cases = list_cases(executable)
        chosen, wanted = choose(cases, regex)
        # So many that all neighbours of a wrench have their turn, equally often.
        number = {name: count(executable, name, 16 if quick else 160) for name in wanted}
        for name in chosen:
            reference = cases[name]
            ratio = number[name] / number[reference] if reference else None
            row = {"name": name, "reference": reference, "instructions": number[name]}
            rows.append({**row, "ratio": ratio})
    return {"rows": rows}


# ---- Jitter ----


def stolen():
    """Seconds that a hypervisor took away from this machine's cores since it started."""
    with open("/proc/stat") as file:
        ticks = int(file.readline().split()[8])
    return ticks / os.sysconf("SC_CLK_TCK")


def jitter(minutes):
    """A loop of 1 kHz for so long: percentiles and histograms of three times of each tick [ns]."""
    say("bench_jitter")
    path, _ = write_walk()
    before = stolen()
    with tempfile.TemporaryDirectory() as folder:
        samples = Path(folder, "samples")
        permitted = json.loads(run(FOLDER / "bench_jitter", path, samples, 60 * minutes))
        late, dynamics, distribution = np.fromfile(samples, np.float32).reshape(-1, 3).T
    result = {"minutes": minutes, "ticks": len(late), **permitted}
    result["stolen_s"] = round(stolen() - before, 2)
    result["overruns"] = int(np.sum(late + dynamics + distribution > 1e6))
    sorts = zip(JITTER_SORTS, (late, dynamics + distribution, distribution), strict=True)
    for sort, sample in sorts:
        percentiles = {"median": 50, **PERCENTILES}
        result[sort] = {key: float(np.percentile(sample, p)) for key, p in percentiles.items()}
        bins, _ = np.histogram(sample.clip(BIN_EDGES[0], BIN_EDGES[-1]), BIN_EDGES)
        result[sort]["bins"] = bins.tolist()
    return result
