"""Executes a recorded trial again and compares: outcome and margins have to be the same bits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from burg_drake.core import JUDGING, software_versions
from burg_drake.core.grasps import (
    ARM_SCREEN_MARGINS,
    LIFT_HEIGHT,
    MARGINS,
    PREFIXES,
    TRIAL_MARGINS,
    VERDICT_FIELDS,
    Margins,
    Mode,
    Stage,
    Verdict,
    shown_figures,
)
from burg_drake.evaluation.records import (
    RecordedTrial,
    TrialOrigin,
    motion_text,
)
from burg_drake.evaluation.stages import build_judge, judge_grasp, mode_for
from burg_drake.motion.plans import Plan
from burg_drake.scene.document import Scene
from burg_drake.simulation.trials import TrialResult
from burg_drake.station.document import GraspMotion, Station

MAX_ROUNDING_ERROR = 1e-14
"""Relative difference that a table gets which a program wrote again with 15 digits, as
spreadsheets do, or has read without care for the last bit."""


@dataclass(frozen=True)
class Difference:
    """A result that is not as recorded.

    Attributes:
        name: of the result.
        recorded, now: its values; NaN or an empty text where there is none.
    """

    name: str
    recorded: float | str
    now: float | str

    @property
    def rounding(self) -> bool:
        """Whether a table that was written again by another program explains it."""
        if isinstance(self.recorded, str) or isinstance(self.now, str):
            return False
        return math.isclose(self.recorded, self.now, rel_tol=MAX_ROUNDING_ERROR)

    def __str__(self) -> str:
        return f"{self.name}: recorded {self.recorded!r}, now {self.now!r}"


def rerun(
    scene: Scene, station: Station, trial: RecordedTrial, origin: TrialOrigin
) -> tuple[Verdict, Plan | None]:
    """Judges a grasp again as its row tells.

    The arm is asked only where it has decided, or has executed the grasp.

    Returns:
        The verdict, and the plan that the arm executed, if it did.

    Raises:
        InvalidInputError: settings that this release lacks, or an unsound scene.
    """
    judge = build_judge(
        scene,
        station,
        engine=origin.engine,
        mode=mode_for(station, decisive_mode(trial, origin)),
        settings=origin.settings(),
    )
    verdict = judge_grasp(judge, trial.candidate)
    return verdict, judge.plan


def decisive_mode(trial: RecordedTrial, origin: TrialOrigin) -> Mode:
    """The least that has to be asked to come to the same verdict."""
    stage = None if trial.verdict is None else trial.verdict.stage
    by_hand = stage is Stage.CLEAR or (origin.mode == "reach" and stage is Stage.EXECUTED)
    return "hand" if by_hand else origin.mode


def differences(recorded: Verdict, now: Verdict) -> list[Difference]:
    """Results that are not the same bits; times and arm configurations are not compared."""
    there, here = _results(recorded), _results(now)
    if "clearance" not in there:  # of a release that did not measure it
        here.pop("clearance", None)
    if math.isnan(recorded.margins.get(LIFT_HEIGHT, math.nan)):  # likewise, or of a trial alone
        here.pop(LIFT_HEIGHT, None)
    if math.isnan(recorded.margins.get("others_turned", math.nan)):  # it watched centres of mass
        there, here = (_but_motions_of_others(found) for found in (there, here))
    # The arm may have passed a grasp on, and is not asked again.
    for name in ARM_SCREEN_MARGINS:
        if name not in here:
            there.pop(name, None)
    found = []
    for name in {**there, **here}:
        empty = "" if isinstance(there.get(name, here.get(name)), str) else math.nan
        a, b = there.get(name, empty), here.get(name, empty)
        if _bits(a) != _bits(b):
            found.append(Difference(name, a, b))
    return found


def comparison(found: Sequence[Difference], origin: TrialOrigin) -> list[str]:
    """What `differences` found as lines for people; `as recorded` if every bit is the same."""
    if not found:
        return ["as recorded"]
    if all(difference.rounding for difference in found):
        names = ", ".join(difference.name for difference in found)
        return [f"as recorded, except for the last digits of {names}, which the table rounds"]
    there = origin.versions
    here = software_versions({**JUDGING, **origin.engine.packages})
    changed = [
        f"{name} {there[name]}, now {here[name]}"
        for name in there
        if name in here and there[name] != here[name].replace(" ", "_")
    ]
    versions = f" (with {'; '.join(changed)})" if changed else ""
    return [f"differs from what was recorded{versions}", *map(str, found)]


def _results(verdict: Verdict) -> dict[str, float | str]:
    """What is compared, by the name that people read: texts first."""
    found = {
        name: value
        for one in VERDICT_FIELDS
        for name, value in one.compared(getattr(verdict, one.name)).items()
    }
    if found.get("end_time") == 0.0:  # a trial that never began has an end at 0, or none
        del found["end_time"]
    return dict(sorted(found.items(), key=lambda one: not isinstance(one[1], str)))


def _but_motions_of_others(found: Mapping[str, float | str]) -> dict[str, float | str]:
    """Results without what tells how far objects were moved and turned."""
    names = {"others_moved", "others_turned", "toppled", "pushed"}
    of_each = tuple(prefix.replace("_", " ") for prefix in PREFIXES.values())
    return {k: v for k, v in found.items() if k not in names and not k.startswith(of_each)}


def _bits(value: float | str) -> str:
    return value if isinstance(value, str) else float(value).hex()


def arm_figures(verdict: Verdict) -> list[str]:
    """What the screen of the arm has measured, as lines for people; none if it was not asked."""
    of_arm = [n for n in MARGINS if n not in TRIAL_MARGINS and n != LIFT_HEIGHT]
    figures = shown_figures(verdict.margins, of_arm)
    return [figures] if figures else []


def motion_figures(trial: RecordedTrial, origin: TrialOrigin) -> list[str]:
    """Where the hand goes, as lines for people; none if that is the usual way."""
    motion = origin.settings().motion
    if motion is None or motion == GraspMotion():
        return []
    whole = trial.lift is None or trial.lift >= motion.lift_height
    room = "" if whole else f"; there is room to lift it {1e3 * (trial.lift or 0.0):g} mm"
    return [f"motion: {motion_text(motion)}{room}"]


def as_result(verdict: Verdict) -> TrialResult:
    """A verdict as a trial returns it."""
    margins = Margins(**{k: v for k, v in verdict.margins.items() if k in _OF_TRIALS})
    return TrialResult(outcome=verdict.outcome, **verdict.of_trial() | {"margins": margins})


_OF_TRIALS = Margins().of_trial().keys()
