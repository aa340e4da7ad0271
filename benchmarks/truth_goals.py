"""What docs/truth.md must show: goals, and what was measured of each."""

from dataclasses import dataclass

import numpy as np

# What differs by less is not shown, and no miss.
DIGITS = 1
# A residual force that is not larger by more is not above today's [m g].
SAME_FORCE = 1e-3
# Clips in which something carried that cannot, until contacts were found by what the motion needs.
CARRIED = {
    name: "tilted soles carried, whose heels rest 3.8 cm up"
    for name in ("B_HandsUp.csv", "B_HandsUp.npz")
}
# How many misses of many checks are named.
NAMED = 8


@dataclass(frozen=True)
class Goal:
    """A goal, and its checks: what was measured, and whether that meets it."""

    what: str
    goal: str
    checks: list

    @property
    def met(self):
        """None where nothing was measured."""
        return all(met for _, met in self.checks) if self.checks else None

    @property
    def measured(self):
        """Misses first, in bold."""
        ordered = sorted(self.checks, key=lambda check: check[1])
        return ", ".join(text if met else f"**{text}**" for text, met in ordered) or "not measured"


# ---- Kinds of trials ----


def is_simulated(name):
    return name.startswith("sim")


def is_robot(name):
    return name.startswith("icub")


def is_walk(name):
    """A person's, in full swing."""
    return "walk" in name and not is_simulated(name) and not is_robot(name)


def is_start(name):
    """A person's who stands, then walks."""
    return "start" in name


def is_other(name):
    """A person who squats, rises, jumps or runs."""
    return not any(kind(name) for kind in (is_simulated, is_robot, is_walk, is_start))


# ---- Checks ----


def shown_changes(figures):
    """Median / worst [ms], and how many were missed."""
    if not figures["changes"]:
        return "–"
    missed = f" ({figures['missed']})" if figures["missed"] else ""
    if figures["median"] is None:
        return f"–{missed}"
    return f"{figures['median']:.0f} / {figures['worst']:.0f}{missed}"


def shown_feet(figures):
    """The error of each foot's vertical force [%]; one number where all are the same."""
    texts = [f"{value:.{DIGITS}f}" for value in figures["feet"]]
    return texts[0] if len(set(texts)) == 1 else " ".join(texts)


def check_changes(name, figures, median, worst):
    met = not figures["missed"]
    if figures["median"] is not None:
        met = met and round(figures["median"]) <= median and round(figures["worst"]) <= worst
    return f"{name} {shown_changes(figures)}", met


def check_feet(name, figures, limits):
    """Limits: one for all feet, or one for each [%]."""
    limits = np.broadcast_to(limits, len(figures["feet"]))
    met = all(np.round(figures["feet"], DIGITS) <= np.round(limits, DIGITS))
    return f"{name} {shown_feet(figures)}", met


def check_wrong_frames(name, figures):
    text = f"{name} {figures['lost']:.1f} and {figures['made_up']:.1f}"
    return text, round(max(figures["lost"], figures["made_up"]), DIGITS) <= 0.5


def check_standing(name, figures):
    wrong = {key: figures[key] for key in ("moved", "gone", "made_up", "while_standing")}
    said = ", ".join(f"{number} {key.replace('_', ' ')}" for key, number in wrong.items() if number)
    return f"{name} ({said or 'the same'})", not said


def summed(checks, what):
    """Misses one by one, as far as they are not too many, and how many of how many met it."""
    missed = [check for check in checks if not check[1]]
    if not checks:
        return []
    text = f"{len(checks) - len(missed)} of {len(checks)} {what}"
    if len(missed) > NAMED:
        text = f"{len(missed) - NAMED} more, {text}"
    return [*missed[:NAMED], (text, True)]


# ---- Goals ----


def trial_goals(trials):
    """Goals for trials whose forces are known."""

    def each(kind, check, *cutoffs):
        return [
            check(name, *(case[variant][key] for variant, key in cutoffs))
            for name, case in trials.items()
            if kind(name)
        ]

    found, ten = ("found", "default"), ("found", "10")
    given = ("measured", "default")

    def no_worse(more):
        def check(name, ours, theirs):
            text, met = check_feet(name, ours, np.add(theirs["feet"], more))
            return f"{text} (with them {shown_feet(theirs)})", met

        return check

    def changes(median, worst):
        return lambda name, ours: check_changes(name, ours, median, worst)

    def feet(limit):
        return lambda name, ours: check_feet(name, ours, limit)

    def walk_feet(name, ours):
        return check_feet(name, ours, 5 if name.startswith("oc") else 4)

    def sways(name):
        return is_robot(name) and not trials[name]["found"]["default"]["changes"]

    def steps(name):
        return is_robot(name) and not sways(name)

    def throughout(name, ours):
        text = " ".join(f"{value:.1f}" for value in ours["active"])
        return f"{name} {text} %", all(value == 100 for value in ours["active"])

    force = "vertical force per foot, nRMSE"
    as_measured = "≤ the measured contacts' + 1 %"
    return [
        Goal("people walking: changes", "≤ 10 / 20 ms", each(is_walk, changes(10, 20), found)),
        Goal("people setting off: changes", "≤ 15 / 30 ms", each(is_start, changes(15, 30), found)),
        Goal(f"people walking: {force}", "≤ 4 %, oc 5 %", each(is_walk, walk_feet, found)),
        Goal(
            f"people setting off: {force}", as_measured, each(is_start, no_worse(1), found, given)
        ),
        Goal("iCub sways: both soles active", "100 %", each(sways, throughout, found)),
        Goal(f"iCub sways: {force}", as_measured, each(sways, no_worse(1), found, given)),
        Goal(
            f"squats, chair, drop jump, run: {force}",
            as_measured,
            each(is_other, no_worse(1), found, given),
        ),
        Goal("simulations: changes", "≤ 5 / 25 ms", each(is_simulated, changes(5, 25), found)),
        Goal(
            "simulations at 10 Hz: changes",
            "≤ 20 / 90 ms",
            each(is_simulated, changes(20, 90), ten),
        ),
        Goal(
            "simulations: loaded frames missed, frames made up",
            "≤ 0.5 % each",
            each(is_simulated, check_wrong_frames, found),
        ),
        Goal(f"simulations: {force}", "≤ 3 %", each(is_simulated, feet(3), found)),
        Goal(f"simulations at 10 Hz: {force}", "≤ 4 %", each(is_simulated, feet(4), ten)),
        Goal("iCub walks: changes", "≤ 10 / 50 ms", each(steps, changes(10, 50), found)),
        Goal(
            f"iCub walks: {force}",
            "≤ the measured contacts'",
            each(steps, no_worse(0), found, given),
        ),
    ]


def ratios(clips, before):
    """Residual force, ours / today's: of the clips that could be read then and can be now."""
    return {
        name: figures["force_rms"] / max(before[name]["force_rms"], 1e-9)
        for name, figures in clips.items()
        if "error" not in figures and "error" not in before.get(name, {"error": ""})
    }


def median_of(values):
    values = list(values)
    return float(np.median(values)) if values else np.nan


def clip_goals(clips, before):
    """Goals for clips whose forces nobody knows."""
    read = {name: figures for name, figures in clips.items() if "error" not in figures}
    parts = ratios(clips, before)
    bounds = {
        name: read[name]["force_bound"] / max(before[name]["force_rms"], 1e-9) for name in parts
    }
    flat = [part for name, part in parts.items() if name not in CARRIED]
    larger = {
        name: (
            f"{name} {read[name]['force_rms']:.3f}, was {before[name]['force_rms']:.3f}",
            read[name]["force_rms"] <= before[name]["force_rms"] + SAME_FORCE,
        )
        for name in parts
    }
    named = [
        (f"{text}: {CARRIED[name]}", True)
        for name, (text, met) in larger.items()
        if name in CARRIED and not met
    ]
    others = [(text, met or name in CARRIED) for name, (text, met) in larger.items()]
    slow = [
        (f"{name} {figures['fast']:.1f} %", figures["fast"] <= 1) for name, figures in read.items()
    ]
    kick = [
        (f"{figures['force_rms']:.3f}", round(figures["force_rms"], 3) <= 0.04)
        for name, figures in read.items()
        if name.startswith("airkick")
    ]
    force = "residual force RMS"
    return [
        Goal(f"airkick_stand: {force}", "≤ 0.04 m g", kick),
        Goal(
            f"clips: median of {force}, ours / today's",
            "≤ 0.35",
            [
                (
                    f"{median_of(parts.values()):.2f} over {len(parts)} clips",
                    bool(round(median_of(parts.values()), 2) <= 0.35),
                ),
                (f"{median_of(flat):.2f} without those that tilted soles carried", True),
                (
                    f"{median_of(bounds.values()):.2f} if all feet carried all the time, wherever "
                    "they are",
                    True,
                ),
            ],
        ),
        Goal(
            f"clips: {force} above today's",
            "none but what is named",
            [*summed(others, "clips are not"), *named],
        ),
        Goal("clips: frames in contact faster than 1 m/s", "≤ 1 %", summed(slow, "clips")),
    ]


def robustness_goals(figures):
    """Goals for what must not change the contacts."""
    walks = [
        (
            f"{name} {row['worst']} frames"
            + "".join(
                f", {row[key]} {key.replace('_', ' ')}" for key in ("gone", "made_up") if row[key]
            ),
            not (row["moved"] or row["gone"] or row["made_up"]),
        )
        for name, row in figures["walks"].items()
    ]
    standing = figures.get("standing", {})
    resting, moving = (
        summed(
            [check_standing(*item) for item in standing.items() if item[1]["at_rest"] == rest],
            "clips",
        )
        for rest in (True, False)
    )
    constants = [
        check_constant(f"{name} × {factor}", row)
        for name, factors in figures.get("constants", {}).items()
        for factor, row in factors.items()
    ]
    minute = "a minute of standing before and after it"
    return [
        Goal("bundled walks, derivatives recomputed: changes", "within 2 frames", walks),
        Goal(f"each clip at rest at its ends, with {minute}", "the same to a frame", resting),
        Goal(f"each clip cut in motion, with {minute}", "the same to a frame", moving),
        Goal(
            "constants × 0.6 and × 1.6, one at a time: medians; most changes missed in a trial",
            "≤ 20 ms; ≤ 1",
            summed(constants, "runs"),
        ),
    ]


def check_constant(name, row):
    if "error" in row:
        return f"{name} is refused, since it is out of its range", True
    text = f"{name} {row['median']:.0f} ms in {row['median_of']}"
    if row["missed"]:
        text += f", {row['missed']} missed in {row['missed_of']}"
    return text, round(row["median"]) <= 20 and row["missed"] <= 1


def goals(figures, thresholds):
    """All goals, those that are missed first."""
    every = [
        *trial_goals(figures["trials"]),
        *clip_goals(figures["clips"], thresholds["clips"]),
        *robustness_goals(figures),
    ]
    return sorted(every, key=lambda goal: {False: 0, None: 1, True: 2}[goal.met])
