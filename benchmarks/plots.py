"""Draws docs/performance_*.svg."""

import re

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from measure import BIN_EDGES, EIQUADPROG, JITTER_SORTS, OURS

# The same figures make the same files: no date, no random identifiers.
plt.rcParams.update(
    {
        "svg.hashsalt": "dynacom",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.axisbelow": True,
        "axes.grid": True,
        "grid.color": "0.88",
        "legend.frameon": False,
    }
)
MET, MISSED, OTHER = "#2a7f9e", "#c8553d", "#8a8a8a"


def save(figure, folder, name):
    figure.savefig(folder / f"performance_{name}.svg", metadata={"Date": None})
    plt.close(figure)


def draw_goals(goals, folder):
    """Each ratio or time as a share of its goal; goals are (what, value, goal)."""
    labels, ratios, limits = map(np.array, zip(*goals, strict=True))
    shares, places, widest = ratios / limits, np.arange(len(goals)), 2.0
    figure, axes = plt.subplots(figsize=(8, 0.26 * len(goals) + 0.9), layout="constrained")
    colours = np.where(shares <= 1, MET, MISSED)
    axes.barh(places, shares.clip(max=widest), color=colours, height=0.65)
    axes.axvline(1, color="black", linewidth=1)
    for place, share, ratio, limit in zip(places, shares, ratios, limits, strict=True):
        cut = "»" if share > widest else ""
        axes.text(widest, place, cut, va="center", ha="right", color="white", weight="bold")
        axes.text(widest + 0.04, place, f"{ratio:.3f} of {limit:g}", va="center", fontsize=8)
    axes.set_yticks(places, labels)
    axes.set_ylim(len(goals) - 0.4, -0.6)
    axes.set_xlim(0, widest + 0.4)
    axes.set_xticks(np.arange(0, widest + 0.1, 0.5))
    axes.grid(False, axis="y")
    axes.set_xlabel("share of its goal (1: just met)")
    save(figure, folder, "goals")


def draw_growth(times, folder):
    """Time against the number of contacts: linear for distributeForce, logarithmic for all."""
    curves = {}
    for row in times["rows"]:
        found = re.fullmatch(
            r"(distributeForce|eiquadprog/fast)/(points|soles)(\d+)/inside(/warm)?(?:/vs_fast)?",
            row["name"],
        )
        if found:
            solver, kind, number, warm = found.groups()
            label = "eiquadprog fast" if solver != "distributeForce" else "warm" if warm else "cold"
            curves.setdefault((kind, label), []).append((int(number), row["median_ns"] / 1000))
    figure, (linear, logarithmic) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
    colours = {"points": MET, "soles": MISSED}
    solvers = {
        "cold": {"linestyle": "-", "marker": ""},
        "warm": {"linestyle": "", "markersize": 4, "markerfacecolor": "white"},
        "eiquadprog fast": {"linestyle": ":", "markersize": 2},
    }
    for solver, style in solvers.items():
        for kind, marker in (("points", "o"), ("soles", "s")):
            numbers, values = zip(*sorted(curves[kind, solver]), strict=True)
            how = {"marker": marker, "color": colours[kind], "label": f"{kind}, {solver}", **style}
            logarithmic.plot(numbers, values, **how)
            if solver != "eiquadprog fast":
                linear.plot(numbers, values, **how)
    linear.set_xlim(0, 16.5)
    linear.set_ylim(0)
    linear.set_title("distributeForce", fontsize=9)
    logarithmic.set_xscale("log", base=2)
    logarithmic.set_yscale("log")
    logarithmic.set_xticks([1, 2, 4, 8, 16], ["1", "2", "4", "8", "16"])
    logarithmic.yaxis.set_major_formatter("{x:g}")
    logarithmic.set_title("beside eiquadprog, logarithmic", fontsize=9)
    for axes in (linear, logarithmic):
        axes.set_xlabel("contacts")
        axes.set_ylabel("time of a distribution [µs]")
        axes.legend(fontsize=7)
    save(figure, folder, "growth")


def draw_walk(walk, folder):
    """The median of each tick."""
    ticks = np.arange(len(walk["soles"]))
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    double = np.array(walk["soles"]) == 2
    axes.fill_between(
        ticks,
        0,
        1,
        where=double,
        step="mid",
        color="0.93",
        linewidth=0,
        transform=axes.get_xaxis_transform(),
        label="both soles on the ground",
    )
    for way, colour in zip((EIQUADPROG[1], *reversed(OURS)), (OTHER, MISSED, MET), strict=True):
        label = "eiquadprog fast" if way in EIQUADPROG else f"distributeForce, {way.split('/')[-1]}"
        axes.step(
            ticks,
            np.array(walk["ticks"][way]) / 1000,
            where="mid",
            color=colour,
            linewidth=1,
            label=label,
        )
    axes.set_xlim(0, len(ticks) - 1)
    axes.set_ylim(0)
    axes.set_xlabel("tick of the walk")
    axes.set_ylabel("median time of a distribution [µs]")
    axes.grid(False, axis="x")
    figure.legend(loc="outside upper center", ncols=4, fontsize=8)
    save(figure, folder, "walk")


def draw_jitter(jitter, folder):
    """How often each time was seen."""
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    for sort, colour in zip(JITTER_SORTS, (OTHER, MET, MISSED), strict=True):
        counts = np.array(jitter[sort]["bins"])
        seen = np.flatnonzero(counts)
        first, last = seen[0], seen[-1] + 1
        shown = counts[first:last], BIN_EDGES[first : last + 1] / 1000
        axes.stairs(*shown, fill=True, color=colour, alpha=0.35)
        axes.stairs(*shown, color=colour, linewidth=1.2, label=sort)
    axes.axvline(1000, color="black", linewidth=1, linestyle=":", label="period")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(0.1)
    axes.set_ylim(0.7)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("time [µs]")
    axes.set_ylabel("ticks per bin (20 bins a decade)")
    figure.legend(loc="outside upper center", ncols=4, fontsize=8)
    save(figure, folder, "jitter")


def draw(parts, goals, folder):
    """Draw all pictures that there are figures for; goals as in draw_goals()."""
    if times := parts.get("times"):
        draw_goals(goals, folder)
        draw_growth(times, folder)
        draw_walk(times["walk"], folder)
    if jitter := parts.get("jitter"):
        draw_jitter(jitter, folder)
