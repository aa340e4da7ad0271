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
CASES = ("bench_dynamics", "bench_distribution")
# What bench_walk measures, in its order.
OURS = ("distributeForce/walk/warm", "distributeForce/walk/cold")
EIQUADPROG = ("eiquadprog/plain/walk", "eiquadprog/fast/walk")
CLOCK = "walk/clock"
WAYS = (*OURS, *EIQUADPROG, CLOCK)
PERCENTILES = {"p99": 99, "p99.9": 99.9, "maximum": 100}

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
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out.json")
        run(
            FOLDER / executable,
            f"--benchmark_filter=^({'|'.join(map(re.escape, names))})$",
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
            time = entry["cpu_time"] * NANOSECONDS[entry["time_unit"]]
            times.setdefault(entry["run_name"], []).append(time)
    return {name: statistics.median(times[name]) for name in names}


def case_rows(executable, regex, quick):
    cases = list_cases(executable)
    chosen, wanted = choose(cases, regex)
    if not chosen:
        return []
    say(executable)
    medians = case_medians(executable, wanted, quick)
    return [make_row(name, medians[name], cases[name], medians.get(cases[name])) for name in chosen]


def write_walk():
    """Write the bundled walk of Talos for walk.hpp; return the file, and which soles stand when."""
    walk = np.load(ROOT / "examples/data/talos_walk.npz")
    names = list(walk["contact_names"])
    soles = walk["contacts"][:, [names.index("left_sole"), names.index("right_sole")]]
    path = FOLDER / "talos_walk.txt"
    np.savetxt(path, np.hstack([soles, walk["q"], walk["v"], walk["a"]]), fmt="%.17g")
    return path, soles


def walk_times(path, ticks, quick):
    """Times of each call [ns], repetitions x ways x ticks."""
    say("bench_walk")
    repetitions = 50 if quick else 1000
    with tempfile.TemporaryDirectory() as folder:
        samples = Path(folder, "samples")
        run(FOLDER / "bench_walk", path, samples, repetitions)
        times = np.fromfile(samples, np.float32)
    return times.reshape(repetitions, len(WAYS), ticks).astype(float)


def walk_rows(times, soles):
    """Rows of the medians against eiquadprog, over all ticks and by support; and of percentiles."""
    rows = []
    supports = {"": soles.any(1), "/single": soles.sum(1) == 1, "/double": soles.sum(1) == 2}
    for support, ticks in supports.items():
        medians = {way: float(np.median(times[:, i, ticks])) for i, way in enumerate(WAYS)}
        rows += [make_row(way + support, medians[way]) for way in EIQUADPROG]
        for way in OURS:
            for reference in EIQUADPROG:
                name = f"{way}{support}/vs_{reference.split('/')[1]}"
                rows.append(make_row(name, medians[way], reference + support, medians[reference]))
    for i, way in enumerate(WAYS):
        median = float(np.median(times[:, i]))
        # Of all calls; and of the ticks' own medians, which leaves out what else the machine did.
        for kind, sample in (("calls", times[:, i]), ("ticks", np.median(times[:, i], axis=0))):
            for label, percent in PERCENTILES.items():
                value = float(np.percentile(sample, percent))
                rows.append(make_row(f"{way}/{kind}/{label}", value, f"{way}, median", median))
    rows.append(make_row(CLOCK, median))
    return rows


def walk_profile(times, soles):
    """What the walk's picture shows: how many soles, and the medians of the ticks."""
    medians = np.median(times, axis=0).round().astype(int)
    profile = {way: medians[i].tolist() for i, way in enumerate(WAYS)}
    return {"soles": soles.sum(1).tolist(), "ticks": profile}


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
    """All that is timed and matches; where the walk is among it, what its picture shows too."""
    result = {"rows": []}
    for executable in CASES:
        result["rows"] += case_rows(executable, regex, quick)
    path, soles = write_walk()
    names = [row["name"] for row in walk_rows(np.ones((1, len(WAYS), len(soles))), soles)]
    if any(map(regex.search, names)):
        samples = walk_times(path, len(soles), quick)
        result["rows"] += [row for row in walk_rows(samples, soles) if regex.search(row["name"])]
        result["walk"] = walk_profile(samples, soles)
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
