"""Measures ``dynacom batch``: made-up clips from CSV to Parquet, on two cores.

All runs are processes of their own, and find their files in the kernel's cache.
"""

import importlib.util
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import batch_shares
import clips
import numpy as np
import pyarrow.parquet
from measure import say

TIMED_BATCH = Path(__file__).with_name("timed_batch.py")
CORES = 2
PROCESSES = "parent", "worker"
# How often a batch's memory is looked at [s].
LOOK = 0.02


# ---- Batches ----


@contextmanager
def cores(number):
    """What is started meanwhile has so many cores, or what there are."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:number])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def look_at_memory(process):
    """Peaks of a batch, its own and that of the largest of its workers [kB], once it has ended."""
    peaks = {}  # by process
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    while process.poll() is None:
        for pid in (str(process.pid), *children.read_text().split()):
            try:
                status = Path(f"/proc/{pid}/status").read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue
            # None of a process that has ended.
            if "VmHWM:" in status:
                peaks[pid] = int(status.split("VmHWM:")[1].split()[0])
        time.sleep(LOOK)
    parent = peaks.pop(str(process.pid))
    return {"parent": parent, "worker": max(peaks.values(), default=0)}


def run(command, *, look=False):
    """Run a batch: when it started and ended, processor time of all its processes, what it said."""
    command = list(map(str, command))
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    # The folder is none from which Python would take modules.
    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryFile("w+") as said,
        tempfile.TemporaryFile("w+") as errors,
    ):
        process = subprocess.Popen(command, cwd=folder, stdout=said, stderr=errors)
        peaks = look_at_memory(process) if look else {}
        status = process.wait()
        end, after = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
        said.seek(0)
        errors.seek(0)
        if status:
            sys.exit(f"{' '.join(command)} failed with status {status}:\n{errors.read()}")
        text = said.read()
    cpu = sum(getattr(after, name) - getattr(before, name) for name in ("ru_utime", "ru_stime"))
    return {"start": start, "end": end, "cpu": cpu, "said": text, **peaks}


def run_command(folder, jobs=CORES):
    """``dynacom batch`` for the clips in a folder; and its table."""
    with tempfile.TemporaryDirectory() as out:
        options = ("--robot", "g1", "--fps", clips.FPS, "--jobs", jobs, "--out", out)
        command = (sys.executable, "-m", "dynacom", "batch", folder, "--no-distance", *options)
        done = run(command)
        table = pyarrow.parquet.read_table(Path(out, "clips.parquet"), memory_map=False)
    check(len(table), table["status"].to_pylist().count("error"), folder)
    return done | {"seconds": done["end"] - done["start"], "table": table}


def run_timed(folder, jobs=CORES, *, engine="local", look=False):
    """The same, for the seconds to its first result, from there to the last, and to its end."""
    with tempfile.TemporaryDirectory() as out:
        command = (sys.executable, TIMED_BATCH, out, engine, jobs, clips.FPS, folder)
        done = run(command, look=look)
    told = json.loads(done["said"].splitlines()[-1])
    check(told["clips"], told["errors"], folder)
    return {
        "clips": told["clips"],
        "starting": told["first"] - done["start"],
        "working": told["last"] - told["first"],
        "ending": done["end"] - told["last"],
        "rate": told["frames"] / (told["last"] - told["first"]),
        **({name: done[name] for name in PROCESSES} if look else {}),
    }


def check(judged, errors, folder):
    expected = sum(1 for _ in folder.rglob("*.csv"))
    if errors or judged != expected:
        sys.exit(f"a batch of {expected} clips judged {judged}, {errors} of them with an error")


def copy(files, folder, times):
    """A folder with so many times the clips, which takes no more room."""
    for index in range(times):
        part = folder / f"{index:04}"
        part.mkdir(parents=True)
        for file in files:
            (part / file.name).hardlink_to(file)
    return folder


# ---- Frames a second ----


def rates(folder, few, repetitions):
    """Medians of frames a second, and what the clips are."""
    frames = clips.FRAMES * sum(1 for _ in folder.iterdir())
    ways = {"two": (CORES, 2), "one worker": (CORES, 1), "one core": (1, 1)}
    commands, starts, timed = [], [], {way: [] for way in ways}
    for _ in range(repetitions):  # in turns
        with cores(CORES):
            commands.append(run_command(folder))
            starts.append(run_command(few))
        for way, (number, jobs) in ways.items():
            with cores(number):
                timed[way].append(run_timed(folder, jobs))
    median = statistics.median
    table = commands[0]["table"]
    # Of a clip, without start-up.
    processor_time = median(run["cpu"] for run in commands) - median(run["cpu"] for run in starts)
    more = len(table) - len(starts[0]["table"])
    return {
        "repetitions": repetitions,
        "rates": {
            "command": frames / median(run["seconds"] for run in commands),
            **{way: median(run["rate"] for run in runs) for way, runs in timed.items()},
        },
        "starting_s": median(run["starting"] for run in timed["two"]),
        "ending_s": median(run["ending"] for run in timed["two"]),
        "cpu_s": processor_time / more,
        "clips": {
            "number": len(table),
            "feasible": float(np.mean(table["feasible"])),
            **{
                name: float(np.mean(table[f"{name}_share"]))
                for name in ("solved", "relaxed", "no_contact")
            },
        },
    }


# ---- Memory ----


def memory(files, folder, numbers):
    """Peaks of batches of so many times the clips."""
    rows = []
    for number in numbers:
        with cores(CORES):
            done = run_timed(copy(files, folder / f"{number} times", number), look=True)
        rows.append({name: done[name] for name in ("clips", *PROCESSES)})
    return rows


# ---- Ray ----


def engines(files, folder, seconds, rate):
    """{engine: run} of a job of so many seconds, of what does so many frames a second."""
    number = math.ceil(seconds * rate / (clips.FRAMES * len(files)))
    many = copy(files, folder / "many", number)
    runs = {}
    for engine in ("local", "ray"):
        say(f"batch, {engine}, {number * len(files)} clips")
        with cores(CORES):
            done = run_timed(many, engine=engine, look=engine == "local")
        runs[engine] = done
    return runs


def measure(quick):
    """All that docs/performance.md says of batches."""
    number, repetitions, seconds = (200, 2, 5) if quick else (1000, 9, 75)
    with tempfile.TemporaryDirectory(prefix="dynacom-bench-") as temporary:
        folder, few = Path(temporary, "clips"), Path(temporary, "few")
        folder.mkdir()
        say(f"making {number} clips")
        files = clips.write_clips(folder, number)
        copy(files[:CORES], few, 1)  # for each worker one
        say("batch")
        result = {"lanes": batch_shares.count_lanes(), **rates(folder, few, repetitions)}
        say("batch, shares")
        result |= batch_shares.measure(files[::4], repetitions=5)
        say("batch, memory")
        result["memory"] = memory(files, Path(temporary), (1, 4))
        if importlib.util.find_spec("ray"):
            result["engines"] = engines(files, Path(temporary), seconds, result["rates"]["two"])
        else:
            say("Ray is not installed: no batch with it")
    return result
