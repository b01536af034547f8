"""Where the hand goes, as the numbers of a recorded run, as text, and as options of a command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from burg_drake.core import declared, option_of
from burg_drake.station.document import GraspMotion

DIRECTION = "lift_direction"
NUMBERED = tuple(f"{DIRECTION}_{k}" for k in (1, 2, 3))
"""Its numbers in a record."""


def gathered(values: Mapping[str, object]) -> dict[str, object]:
    """Recorded values with the direction as one list, if its three numbers are there."""
    if not all(name in values for name in NUMBERED):
        return dict(values)
    others = {name: value for name, value in values.items() if name not in NUMBERED}
    return others | {DIRECTION: [values[name] for name in NUMBERED]}


def motion_in(values: Mapping[str, float]) -> GraspMotion:
    """The motion among recorded numbers. What releases before motions could be chosen did not
    record was as it is by default.

    Raises:
        FieldError: a number cannot be used.
    """
    known = {field.name for field in fields(GraspMotion)}
    found = {k: v for k, v in gathered(values).items() if k in known}
    if DIRECTION in found:
        x, y, z = (values[name] for name in NUMBERED)
        found[DIRECTION] = (x, y, z)
    return GraspMotion(**found)  # type: ignore[arg-type]


def without_motion(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers of other settings."""
    known = {field.name for field in fields(GraspMotion)}.union(NUMBERED)
    return {name: value for name, value in values.items() if name not in known}


def motion_text(motion: GraspMotion) -> str:
    """A motion for people."""
    parts = [f"standoff {_mm(motion.standoff)} mm"]
    if motion.retreat:
        parts.append(f"retreat {_mm(motion.retreat)} mm")
    least = f"{_mm(motion.shortest)} to " if motion.shortest < motion.lift_height else ""
    parts.append(f"lift {least}{_mm(motion.lift_height)} mm")
    x, y, z = motion.lift_direction
    if (x, y) != (0.0, 0.0) or z < 0.0:
        parts[-1] += f" along [{', '.join(map(_exact, motion.lift_direction))}]"
    return ", ".join(parts)


def motion_options(motion: GraspMotion, usual: GraspMotion) -> list[str]:
    """Words of a command line that ask for a motion where a station's usual one is another."""
    words: list[str] = []
    for name in declared(GraspMotion):
        option = option_of(GraspMotion, name)
        value = getattr(motion, name)
        if value == getattr(usual, name):
            continue
        if name == DIRECTION:
            words += [option, *(repr(part) for part in value)]
        else:  # that nothing less than the whole lift is allowed has no option of its own
            words += [option, _millimetres(motion.lift_height if value is None else value)]
    return words


def _millimetres(length: float) -> str:
    """What the option reads as this length [m], in few digits where there are."""
    text = _mm(length)
    return text if float(text) / 1000.0 == length else repr(1000.0 * length)


def _mm(length: float) -> str:
    return _exact(1e3 * length)


def _exact(value: float) -> str:
    """What tells two values apart, but not the rounding of one."""
    return f"{value:.12g}"
