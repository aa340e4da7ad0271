"""What scripts/bench runs: measures, prints, and keeps the figures of docs/performance.md."""

import argparse
import re
import sys
from pathlib import Path

import measure
import page


def print_rows(rows):
    """Print times or instructions, the ratios to their references, and the goals of times."""
    table = [("name", "measured", "ratio", "goal", "reference")]
    for row in rows:
        is_time = "median_ns" in row
        measured = f"{row['median_ns']:.0f} ns" if is_time else f"{row['instructions']:.0f}"
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.3f}"
        goal = page.GOALS.get(row["name"], "") if is_time else ""
        table.append((row["name"], measured, ratio, goal, row["reference"] or ""))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for name, *numbers, reference in table:
        cells = [f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:], strict=False)]
        print("  ".join([f"{name:<{widths[0]}}", *cells, reference]).rstrip())


def main():
    parser = argparse.ArgumentParser(prog="scripts/bench", add_help=False)
    parser.add_argument("regex", nargs="?", type=re.compile)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--counts", action="store_true")
    what.add_argument("--jitter", type=float, metavar="MINUTES")
    what.add_argument("--batch", action="store_true")
    what.add_argument("--plots", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--record", action="store_true")
    arguments = parser.parse_intermixed_args()
    others = arguments.record, arguments.jitter, arguments.batch, arguments.plots
    if arguments.regex and any(others):
        parser.error("a REGEX goes with neither --record, --jitter, --batch nor --plots")

    if arguments.plots:
        page.write()
        return
    if arguments.jitter:
        part, result = "jitter", measure.jitter(arguments.jitter)
        print(page.jitter_conditions(result), page.jitter_table(result), sep="\n")
    elif arguments.batch:
        import batch  # needs DynaCoM, which the page does not

        part, result = "batch", batch.measure(arguments.quick)
        print(*page.batch_blocks(result).values(), sep="\n\n")
    else:
        # Valgrind does not know all processors' lanes, and clips take long there.
        counted = [name for name in page.GOAL_TABLE if not name.startswith("analyzeMotion")]
        default = "|".join(map(re.escape, counted)) if arguments.counts else ""
        regex = arguments.regex or re.compile(default)
        part = "counts" if arguments.counts else "times"
        result = getattr(measure, part)(regex, arguments.quick)
        if not result["rows"]:
            sys.exit(f"no benchmark matches '{regex.pattern}'")
        print_rows(result["rows"])
        for table in page.more_tables(result).values():
            print("", table, sep="\n")
    if arguments.json:
        arguments.json.write_text(page.to_json(result.get("rows", result)) + "\n")
    if arguments.record:
        page.record(part, result, rough=arguments.quick)


if __name__ == "__main__":
    main()
