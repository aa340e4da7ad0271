# SPDX-License-Identifier: BSD-2-Clause
"""What a motion stands on, in numbers and in sentences."""

from collections.abc import Iterator

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import MotionExamination, Stance
from dynacom.robots import Robot

# From which height on a ground is worth a question: most files have theirs at zero [m].
_FAR_FROM_ZERO = 0.1
# Stances that differ by more than this stand on different levels [m].
_LEVEL = 0.05
# A foot that is held in the air is worth a word after so long [s].
_HELD = 0.5
# Schedules that differ in more of the frames than this are worth a word.
_DISAGREEMENT = 0.02


def ground_heights(robot: Robot, found: MotionExamination) -> dict[str, float | None]:
    """Contact's name -> the median height of the ground under it while it is active [m].

    None where it never is.
    """
    heights = {}
    # What C++ hands out is a copy: once is enough.
    actives, ground = np.asarray(found.schedule.active), found.ground
    for index, name in enumerate(robot.contacts):
        values = ground[actives[:, index], index]
        values = values[np.isfinite(values)]
        heights[name] = float(np.median(values)) if len(values) else None
    return heights


def terrain_texts(
    robot: Robot, options: AnalysisOptions, found: MotionExamination
) -> Iterator[str]:
    """Sentences on the ground: where it is, how it moves, and what was not taken for it."""
    heights = ground_heights(robot, found)
    known = {name: height for name, height in heights.items() if height is not None}
    velocity = found.inference.ground_velocity
    is_told = np.isfinite(options.detection.ground_velocity).all()
    if velocity.any():
        yield (
            f"The ground moves by ({_text(velocity[0], 2)}, {_text(velocity[1], 2)}) m/s: a "
            f"treadmill{', as --ground-velocity says' if is_told else ''}. Speeds of contacts are "
            f"relative to it{'' if is_told else '; --ground-velocity says another'}."
        )
    if not heights:
        yield "The robot has no contacts."
    elif not np.asarray(found.schedule.active).any():
        yield f"No contact {'of the robot file ' if found.analysis.bodies else ''}is ever active."
    elif not known:
        yield (
            "Contacts are active, but nowhere at rest"
            + (" on a ground that moves so" if velocity.any() else "")
            + ": where the ground is, is not known."
        )
    elif slope := _slope_text(robot, found):
        yield slope
    else:
        yield from _level_texts(robot, found, known)
    if not found.analysis.bodies:  # who lies or kneels has the feet where they are
        yield from _held_texts(robot, options, found)
    yield from _disagreement_texts(found)


def _text(value: float, digits: int) -> str:
    """A number without the sign of what is rounded to zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _owners(robot: Robot, found: MotionExamination) -> list[str | None]:
    """The contact that each part belongs to; None for parts of other links."""
    names = list(robot.contacts)
    return [names[part.contact] if part.contact < len(names) else None for part in found.parts]


def _stances(found: MotionExamination) -> Iterator[Stance]:
    """Those of contacts: other links rest anywhere."""
    count = len(found.schedule.names)
    of_contact = [part.contact < count for part in found.parts]
    for stance in found.inference.stances:
        if of_contact[stance.part]:
            yield stance


def _used(found: MotionExamination) -> Iterator[Stance]:
    """The stances in which their part is active at some time."""
    active = np.asarray(found.inference.schedule.active)
    for stance in _stances(found):
        if stance.on_ground and active[stance.first : stance.behind, stance.part].any():
            yield stance


def _slope_text(robot: Robot, found: MotionExamination) -> str | None:
    """If some stances are on ground that is not level."""
    if (gradient := found.inference.slope).any():
        towards = np.degrees(np.arctan2(gradient[1], gradient[0]))
        return (
            f"The ground is a slope of {_angle(gradient):.1f} degrees, which rises towards "
            f"{_text(towards, 0)} degrees from the world's x axis."
        )
    owners = _owners(robot, found)
    angles: dict[str, set[str]] = {}
    for stance in _used(found):
        if (gradient := stance.slope).any():
            angles.setdefault(owners[stance.part], set()).add(f"{_angle(gradient):.1f}")
    if not angles:
        return None
    texts = []
    for name, own in angles.items():
        *first, last = sorted(own, key=float)
        texts.append(f"{name} on {', '.join(first)}{' and ' if first else ''}{last} degrees")
    return (
        f"Slopes are stood on, by {'; by '.join(texts)}. Where else they stand, the ground is "
        "taken for level."
    )


def _angle(gradient: np.ndarray) -> float:
    """Of a slope [degrees]."""
    return float(np.degrees(np.arctan(np.linalg.norm(gradient))))


def _level_texts(robot: Robot, found: MotionExamination, known: dict[str, float]) -> Iterator[str]:
    levels: dict[str, list[float]] = {}
    owners = _owners(robot, found)
    for stance in _used(found):
        own = levels.setdefault(owners[stance.part], [])
        if all(abs(stance.height - level) > _LEVEL for level in own):
            own.append(stance.height)
    steps = []
    for name, own in levels.items():
        if len(own) > 1:
            *first, last = (_text(height, 2) for height in sorted(own))
            steps.append(f"{name} stands at {', '.join(first)} and {last} m")
    if steps:
        yield f"{'; '.join(steps)}: steps or stairs, or feet that float."
    else:
        text = ", ".join(f"{name} {_text(height, 3)} m" for name, height in known.items())
        yield f"Height of the ground: {text}."
    lowest = min((stance.height for stance in _used(found)), default=min(known.values()))
    if abs(lowest) > _FAR_FROM_ZERO:
        yield "The ground is not near the height 0: is it this robot's motion?"


def _held_texts(robot: Robot, options: AnalysisOptions, found: MotionExamination) -> Iterator[str]:
    """Feet, and corners of feet, that are at rest where nothing was seen to carry them."""
    time, active = found.analysis.time, np.asarray(found.schedule.active)
    lowest: dict[tuple[str, bool], tuple[float, Stance]] = {}
    tilted: dict[str, set[str]] = {}
    on_ground = [stance.height for stance in _used(found)]
    owners, parts = _owners(robot, found), found.parts
    for stance in _stances(found):
        lasts = time[stance.behind - 1] - time[stance.first]
        name, part = owners[stance.part], parts[stance.part]
        if stance.on_ground or lasts < _HELD:
            continue
        # The rest of it carries.
        is_tilted = bool(active[stance.first : stance.behind, part.contact].all())
        if is_tilted:
            tilted.setdefault(name, set()).add(part.name.removeprefix(f"{name}."))
        key = name, is_tilted
        if key not in lowest or stance.height < lowest[key][0]:
            lowest[key] = stance.height, stance
    ground, is_given = options.detection.ground_height, True
    if np.isnan(ground):
        ground, is_given = np.median(on_ground) if on_ground else 0.0, False
    for (name, is_tilted), (height, stance) in lowest.items():
        where = f"{100.0 * (height - ground):.0f} cm up at {time[stance.first]:.2f} s"
        if is_tilted:
            yield (
                f"{name} is tilted: its {' and '.join(sorted(tilted[name]))} rest {where}, and "
                "carry nothing."
            )
        elif is_given:
            yield (
                f"{name} rests {where}, above the ground that --ground-height tells of, and so "
                "carries nothing."
            )
        else:
            yield (
                f"{name} rests {where}, where nothing was seen landed on, and so carries nothing: "
                "say by --schedule if there is a box."
            )


def _disagreement_texts(found: MotionExamination) -> Iterator[str]:
    """Contacts that are recorded, but which inference finds otherwise."""
    if found.inferred is None:
        return
    given, own = np.asarray(found.schedule.active), np.asarray(found.inferred.active)
    shares = (given != own).mean(axis=0)
    if texts := [
        f"{name} in {share:.0%}"
        for name, share in zip(found.schedule.names, shares, strict=True)
        if share > _DISAGREEMENT
    ]:
        yield (
            "What the motion needs would have contacts differ from those that are given: "
            f"{', '.join(texts)} of the frames."
        )
