# SPDX-License-Identifier: BSD-2-Clause
"""What a motion stands on, in sentences."""

from collections.abc import Iterator

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import MotionExamination, Terrain

# From which height on a ground is worth a question: most files have theirs at zero [m].
_FAR_FROM_ZERO = 0.1
# So many values are told one by one.
_LISTED = 4
# Schedules that differ in more of the frames than this are worth a word.
_DISAGREEMENT = 0.02


def ground_heights(found: MotionExamination) -> dict[str, float]:
    """Contact's name -> the median height of the ground under it while it is active [m].

    NaN where it never is.
    """
    return {contact.name: contact.height for contact in found.terrain.contacts}


def terrain_texts(options: AnalysisOptions, found: MotionExamination) -> Iterator[str]:
    """Sentences on the ground: where it is, how it moves, and what was not taken for it."""
    terrain, heights = found.terrain, ground_heights(found)
    known = {name: height for name, height in heights.items() if np.isfinite(height)}
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
    else:
        yield from _slope_texts(found)
        yield from _level_texts(terrain, known)
    if not found.analysis.bodies:  # who lies or kneels has the feet where they are
        yield from _held_texts(options, terrain)
    yield from _disagreement_texts(found)


def _text(value: float, digits: int) -> str:
    """A number without the sign of what is rounded to zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _list_text(texts: list[str]) -> str:
    """Values in their order, or, where there are many, from which to which they are."""
    if len(texts) > _LISTED:
        return f"{texts[0]} to {texts[-1]}"
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _slope_texts(found: MotionExamination) -> Iterator[str]:
    """If some stances are on ground that is not level."""
    if (gradient := found.inference.slope).any():
        angle = np.degrees(np.arctan(np.linalg.norm(gradient)))
        towards = np.degrees(np.arctan2(gradient[1], gradient[0]))
        yield (
            f"The ground is a slope of {angle:.1f} degrees, which rises towards "
            f"{_text(towards, 0)} degrees from the world's x axis."
        )
    elif slopes := {
        contact.name: _list_text([f"{np.degrees(angle):.1f}" for angle in contact.slopes])
        for contact in found.terrain.contacts
        if contact.slopes
    }:
        texts = "; by ".join(f"{name} on {angles} degrees" for name, angles in slopes.items())
        yield (
            f"Slopes are stood on, by {texts}. Where else they stand, the ground is taken for "
            "level."
        )


def _level_texts(terrain: Terrain, known: dict[str, float]) -> Iterator[str]:
    if any(len(contact.levels) > 1 for contact in terrain.contacts):
        steps = [
            f"{contact.name} stands at {_list_text([_text(h, 2) for h in contact.levels])} m"
            for contact in terrain.contacts
            if contact.levels
        ]
        yield f"{'; '.join(steps)}: steps or stairs, or feet that float."
    elif not any(contact.slopes for contact in terrain.contacts):
        text = ", ".join(f"{name} {_text(height, 3)} m" for name, height in known.items())
        yield f"Height of the ground: {text}."
    if abs(terrain.lowest) > _FAR_FROM_ZERO:
        yield "The ground is not near the height 0: is it this robot's motion?"


def _held_texts(options: AnalysisOptions, terrain: Terrain) -> Iterator[str]:
    """Feet, and corners of feet, that are at rest where nothing was seen to carry them."""
    for held in terrain.held:
        where = f"{100.0 * held.height:.0f} cm up at {held.begin:.2f} s"
        if held.parts:
            yield (
                f"{held.name} is tilted: its {' and '.join(held.parts)} rest {where}, and carry "
                "nothing."
            )
        elif np.isfinite(options.detection.ground_height):
            yield (
                f"{held.name} rests {where}, above the ground that --ground-height tells of, and "
                "so carries nothing."
            )
        else:
            yield (
                f"{held.name} rests {where}, where nothing was seen landed on, and so carries "
                "nothing: say by --schedule if there is a box."
            )


def _disagreement_texts(found: MotionExamination) -> Iterator[str]:
    """Contacts that are recorded, but which inference finds otherwise."""
    if found.inferred is None:
        return
    if texts := [
        f"{name} in {share:.0%}"
        for name, share in zip(found.schedule.names, found.disagreement, strict=True)
        if share > _DISAGREEMENT
    ]:
        yield (
            "What the motion needs would have contacts differ from those that are given: "
            f"{', '.join(texts)} of the frames."
        )
