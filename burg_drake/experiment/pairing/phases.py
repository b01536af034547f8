"""What trials of two runs did with a grasp, and what they counted: runs that differ in it are no
two opinions of one question, whatever engine gave them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import Mode, RealOutcome
from burg_drake.evaluation.records import HASH_DIGITS, read_trial_settings
from burg_drake.experiment.pairing.side import JudgedRuns

TITLES = {"lift_height": "lift"}
"""What settings are called that are not called by their names."""
UNITS = {
    **dict.fromkeys(("standoff", "retreat", "lift_height", "least_lift"), "m"),
    **dict.fromkeys(("slip_limit", "disturbance", "creep_distance"), "m"),
    **dict.fromkeys(("lift_time", "hold_time", "steady_time", "settled_time"), "s"),
    **dict.fromkeys(("poll", "close_timeout"), "s"),
    **dict.fromkeys(("creep_speed", "settled_speed"), "m/s"),
    "tilt_limit": "degrees",
}
"""Units of settings in messages; others have none."""
APPROACH = "approach"
"""Whether a trial began at the pregrasp; of the whole arm it does, whatever was asked."""
Value = float | bool | tuple[float, ...] | None


def unpredictable_outcomes(mode: Mode, *, approach: bool) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of a mode can predict: of the hand alone those of an arm, and
    a collision on the approach that its trials leave out.

    Args:
        mode: of the run.
        approach: whether its trials approach.
    """
    if mode != "hand":
        return frozenset()
    of_arm = [outcome for outcome in RealOutcome if outcome.of_arm]
    return frozenset(of_arm if approach else [*of_arm, RealOutcome.HAND_COLLISION_APPROACH])


def unpredictable_for(judged: JudgedRuns) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of some runs can predict."""
    document = judged.found.document
    settings = read_trial_settings(document.trial, str(judged.path))
    return unpredictable_outcomes(document.mode, approach=settings.approach)


def require_same_phases(first: JudgedRuns, second: JudgedRuns) -> None:
    """Refuses runs whose verdicts answer different questions, so that no engine is to blame where
    they differ: other phases of a trial, other limits of what counts, another station.

    Raises:
        InvalidInputError: names all that differs, with both values.
    """
    causes = []
    phases = phases_apart(first, second)
    if phases:
        causes.append(f"with different phases: {'; '.join(phases)}")
    stations = [judged.found.document.station for judged in (first, second)]
    if stations[0].content != stations[1].content:
        one, other = (f"{s.name} ({s.content[:HASH_DIGITS]})" for s in stations)
        causes.append(f"on different stations: {one} and {other}")
    if causes:
        raise InvalidInputError(
            f"{first.path} and {second.path} were made {'; and '.join(causes)}; evaluate the grasps"
            f" of one ({first.grasps_place}) again as those of the other"
        )


def approach_note(first: JudgedRuns, second: JudgedRuns) -> str:
    """What to know of runs that are compared though only one of them, of the whole arm, has
    approached; empty of others."""
    still = [
        which
        for which, judged in (("first", first), ("second", second))
        if not _phases(judged)[APPROACH]
    ]
    if len(still) != 1:
        return ""
    other = "second" if still[0] == "first" else "first"
    return (
        f"the hand alone did not approach in the {still[0]} run; the whole arm did in the {other}"
    )


def phases_apart(first: JudgedRuns, second: JudgedRuns) -> list[str]:
    """Settings of trials in which the runs of two folders differ, with both values. What a run did
    not record is what it was then. Whether the hand alone approaches is no such difference to the
    whole arm, which does; see `approach_note`."""
    one, other = (_phases(judged) for judged in (first, second))
    if "arm" in (first.found.document.mode, second.found.document.mode):
        del one[APPROACH]
    return [
        f"{TITLES.get(name, name.replace('_', ' '))} {_both(name, one[name], other[name])}"
        for name in one
        if not _same(one[name], other[name])
    ]


def _phases(judged: JudgedRuns) -> dict[str, Value]:
    """All settings of a run's trials by name; those of the motion first, each as what it comes
    to."""
    from burg_drake.simulation.trials import NO_LIMITS

    settings = read_trial_settings(judged.found.document.trial, str(judged.path))
    motion = settings.motion
    assert motion is not None  # what was not recorded is the default
    values: dict[str, Value] = {f.name: getattr(motion, f.name) for f in fields(motion)}
    values |= {f.name: getattr(settings, f.name) for f in fields(settings) if f.name != "motion"}
    values["lift_direction"] = tuple(motion.direction_W.tolist())
    if motion.shortest == motion.lift_height:
        values["least_lift"] = None
    unlimited: Mapping[str, float] = NO_LIMITS
    values[APPROACH] = settings.approach or judged.found.document.mode == "arm"
    return {k: None if k in unlimited and v == unlimited[k] else v for k, v in values.items()}


def _same(one: Value, other: Value) -> bool:
    """Whether values are the same, but for the rounding of a direction's length."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return all(math.isclose(a, b, abs_tol=1e-12) for a, b in zip(one, other, strict=True))
    return one == other


def _both(name: str, one: Value, other: Value) -> str:
    return f"{_text(name, one)} and {_text(name, other)}"


def _text(name: str, value: Value) -> str:
    """A value for people, to digits that tell any two apart."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{part:.12g}' for part in value)}]"
    unit = UNITS.get(name, "")
    number = math.degrees(value) if unit == "degrees" else value
    return f"{number:.12g} {unit}".rstrip()
