"""Runs the benchmarks and prints each median beside that of its reference.

A benchmark that is measured against another one of the same executable says so by its label:
``state.SetLabel("reference=<name of the other>")``.
"""

import argparse
import json
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

NANOSECONDS = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}


def run(executable, names=None, *, repetitions=1, min_time=1e-6):
    """Run those benchmarks of an executable; return {name: (median CPU time in ns, reference)}."""
    names_filter = "|".join(map(re.escape, names)) if names else ".*"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out.json")
        command = [
            executable,
            f"--benchmark_filter=^({names_filter})$",
            f"--benchmark_repetitions={repetitions}",
            f"--benchmark_min_time={min_time}",
            f"--benchmark_enable_random_interleaving={str(repetitions > 1).lower()}",
            f"--benchmark_out={out}",
            "--benchmark_out_format=json",
        ]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{executable.name} failed with status {done.returncode}:\n{done.stderr}")
        runs = json.loads(out.read_text())["benchmarks"]

    times, references = {}, {}
    for entry in runs:
        if entry.get("error_occurred"):
            sys.exit(f"{entry['run_name']} failed: {entry['error_message']}")
        if entry["run_type"] != "iteration":
            continue
        name = entry["run_name"]
        times.setdefault(name, []).append(entry["cpu_time"] * NANOSECONDS[entry["time_unit"]])
        label = re.fullmatch("reference=(.*)", entry.get("label", ""))
        references[name] = label[1] if label else None
    return {name: (statistics.median(times[name]), references[name]) for name in times}


def measure(executable, regex, **settings):
    """Measure the benchmarks that match, and their references; return the rows of the table."""
    references = {name: reference for name, (_, reference) in run(executable).items()}
    chosen = [name for name in references if regex.search(name)]
    if not chosen:
        return []
    wanted = dict.fromkeys(chosen + [references[name] for name in chosen if references[name]])
    if unknown := wanted.keys() - references.keys():
        sys.exit(f"{executable.name} has no benchmark {', '.join(sorted(unknown))} to refer to")

    medians = {name: median for name, (median, _) in run(executable, wanted, **settings).items()}
    rows = []
    for name in chosen:
        reference = references[name]
        rows.append(
            {
                "name": name,
                "reference": reference,
                "median_ns": medians[name],
                "ratio": medians[name] / medians[reference] if reference else None,
            }
        )
    return rows


def main():
    parser = argparse.ArgumentParser(prog="scripts/bench", add_help=False)
    parser.add_argument("folder", type=Path)
    parser.add_argument("regex", nargs="?", type=re.compile, default=re.compile(""))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_intermixed_args()
    settings = {"repetitions": 9, "min_time": 0.1}
    if arguments.quick:
        settings = {"repetitions": 3, "min_time": 0.01}

    rows = []
    for path in sorted(arguments.folder.iterdir()):
        if path.is_file() and path.stat().st_mode & 0o100 and path.suffix == "":
            print(f"{path.name} ...", file=sys.stderr)
            rows += measure(path.resolve(), arguments.regex, **settings)
    if not rows:
        sys.exit(f"no benchmark matches '{arguments.regex.pattern}'")

    table = [("name", "median", "reference", "ratio")]
    for row in rows:
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.3f}"
        table.append((row["name"], f"{row['median_ns']:.0f} ns", row["reference"] or "", ratio))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for name, median, reference, ratio in table:
        print(f"{name:<{widths[0]}}  {median:>{widths[1]}}  {reference:<{widths[2]}}  {ratio:>5}")
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
