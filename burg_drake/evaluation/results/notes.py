"""What a run lacks and why: objects with fewer grasps than asked, objects with no trial."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import listing
from burg_drake.core.grasps import STAGES_AMONG, Outcome, Stage
from burg_drake.evaluation.candidates import SELF, TABLE, shortfall
from burg_drake.evaluation.records import Columns, motion_in
from burg_drake.evaluation.store import Run
from burg_drake.station.document import GraspMotion

CAUSES = 3
"""So many outcomes are named."""
HIT = {Outcome.COLLISION_TARGET: SELF, Outcome.COLLISION_TABLE: TABLE}
REMEDY_OF_ARM = "try another station, or another place on the board; mode `hand` leaves the arm out"
REMEDY_OF_GIVEN = "burg-drake grasps show displays them at their object"
"""What would help where grasps were given and the open hand is not clear."""
REMEDIES = {
    Stage.CLEAR: "sample grasps at which the hand is clear, as is the default",
    Stage.REACHABLE: REMEDY_OF_ARM,
    Stage.PLANNED: REMEDY_OF_ARM,
    Stage.EXECUTED: "the table of results has the reason of each",
}
"""What would help, by the stage that stopped most grasps."""
NO_LIFT = (Outcome.HAND_COLLISION_LIFT, Outcome.LIFT_LINE)
NO_RETREAT = (Outcome.HAND_COLLISION_RETREAT, Outcome.RETREAT_LINE)


def run_notes(run: Run) -> tuple[str, ...]:
    """A sentence for each usual mistake that given grasps show, for each instance with fewer grasps
    than asked, or for those that no grasps were given for, and, once all of its grasps are judged,
    for each object of which nothing could be executed, or that has too few lifted or failing ones
    for a run that is to be balanced."""
    return (
        *run.document.hints,
        *_without_grasps(run),
        *shortfalls(run),
        *_unexecuted(run),
        *_unbalanced(run),
    )


def missing_grasps_note(objects: Iterable[str], given: Iterable[str]) -> str:
    """Which of the objects have no given grasp; "" if all have some."""
    missing = sorted({*objects} - {*given})
    return f"there are no grasps to judge for {listing(missing)}" if missing else ""


def shortfalls(run: Run) -> list[str]:
    """A sentence for each instance with fewer grasps than were to be sampled."""
    asked = run.document.grasps.per_object
    if asked is None:
        return []
    found = Counter(run.candidates.instance.tolist())
    parts = run.candidates.grasps.provenance.get("parts", {})
    notes = (shortfall(name, asked, part, found[name]) for name, part in parts.items())
    return [note for note in notes if note]


def _without_grasps(run: Run) -> list[str]:
    grasps = run.document.grasps
    if grasps.per_object is not None:
        return []
    note = missing_grasps_note(grasps.objects, [name for name, n in grasps.objects.items() if n])
    return [note] if note else []


def _unexecuted(run: Run) -> list[str]:
    columns, notes = run.results, []
    motion = motion_in(run.document.trial)
    given = run.document.grasps.origin == "given"
    for name, count in run.document.grasps.objects.items():
        mine = columns["object"] == name
        outcomes = columns["outcome"][mine]
        tried = np.isin(outcomes, [o.value for o in Outcome if o.stage is Stage.EXECUTED])
        executed = tried & (outcomes != Outcome.SIMULATION_FAILED)
        if count and len(outcomes) == count and not executed.any():
            notes.append(_unexecuted_note(name, columns, mine, motion, given=given))
    return notes


def _unexecuted_note(
    name: str, columns: Columns, mine: np.ndarray, motion: GraspMotion, *, given: bool
) -> str:
    stages = Counter(columns["stage"][mine].tolist())
    remedy = _remedy(Stage(stages.most_common(1)[0][0]), given=given)
    outcomes, blockers = columns["outcome"][mine], columns["blocker"][mine]
    if other := _other_motion(Outcome(_counted(outcomes, blockers)[0][0][0]), motion):
        remedy = f"{other} may help; {remedy}"
    causes = _causes(outcomes, blockers)
    return f"{name}: none of {_grasps(mine)} was executed: {causes}; {remedy}"


def _remedy(stage: Stage, *, given: bool) -> str:
    return REMEDY_OF_GIVEN if given and stage is Stage.CLEAR else REMEDIES[stage]


def _other_motion(outcome: Outcome, motion: GraspMotion) -> str:
    """Another motion of the hand that may avoid an outcome; "" if there is none."""
    motions = []
    if outcome in NO_LIFT and motion.shortest >= motion.lift_height:
        motions.append("a shorter lift (least_lift)")
    elif outcome in NO_LIFT and motion.shortest > 0.0:
        motions.append("a smaller least_lift")
    if outcome in NO_LIFT and not motion.retreat:
        motions.append("a retreat first")
    if outcome in NO_RETREAT:
        motions.append("a shorter retreat")
    return " or ".join(motions)


def unclear_notes(
    objects: NDArray[np.str_],
    outcomes: NDArray[np.str_],
    blockers: NDArray[np.str_],
    *,
    given: bool = False,
) -> tuple[str, ...]:
    """A sentence for each object whose grasps all end because the open hand collides.

    Args:
        objects, outcomes, blockers: (N,) of each grasp.
        given: whether the grasps are the user's own.
    """
    clear = ~np.isin(outcomes, [o.value for o in Outcome if o.stage is Stage.CLEAR])
    notes = []
    for name in dict.fromkeys(objects.tolist()):
        mine = objects == name
        if not clear[mine].any():
            causes = _causes(outcomes[mine], blockers[mine])
            remedy = _remedy(Stage.CLEAR, given=given)
            notes.append(f"{name}: none of {_grasps(mine)} is clear: {causes}; {remedy}")
    return tuple(notes)


def unmoved_notes(
    objects: NDArray[np.str_],
    outcomes: NDArray[np.str_],
    blockers: NDArray[np.str_],
    motion: GraspMotion,
) -> tuple[str, ...]:
    """A sentence for each object of which the arm can execute no grasp, where that is most often
    because of the lift or the retreat, and another motion of the hand may help.

    Args:
        objects, outcomes, blockers: (N,) of each grasp.
        motion: that was asked for.
    """
    notes = []
    for name in dict.fromkeys(objects.tolist()):
        mine = objects == name
        if (outcomes[mine] == Outcome.REACHABLE).any():
            continue
        first = Outcome(_counted(outcomes[mine], blockers[mine])[0][0][0])
        if other := _other_motion(first, motion):
            causes = _causes(outcomes[mine], blockers[mine])
            notes.append(
                f"{name}: none of {_grasps(mine)} is reachable: {causes}; {other} may help"
            )
    return tuple(notes)


def _grasps(mine: np.ndarray) -> str:
    count = int(mine.sum())
    return f"{count:,} grasp{'' if count == 1 else 's'}"


def _causes(outcomes: NDArray[np.str_], blockers: NDArray[np.str_]) -> str:
    """The most frequent outcomes, with what was in the way."""
    named = _counted(outcomes, blockers)
    parts = [f"{_words(Outcome(what), body)} in {count:,}" for (what, body), count in named]
    rest = len(outcomes) - sum(count for _, count in named)
    return ", ".join([*parts, *([f"others in {rest:,}"] if rest else [])])


def _counted(
    outcomes: NDArray[np.str_], blockers: NDArray[np.str_]
) -> list[tuple[tuple[str, str], int]]:
    """The most frequent pairs of outcome and blocker, with their counts."""
    return Counter(zip(outcomes.tolist(), blockers.tolist(), strict=True)).most_common(CAUSES)


def _words(outcome: Outcome, blocker: str) -> str:
    if outcome.stage is Stage.CLEAR:
        return f"the open hand hits {HIT.get(outcome, blocker)}"
    return outcome.value.replace("_", " ") + (f" ({blocker})" if blocker else "")


def lifted_and_failed(run: Run) -> dict[str, tuple[int, int]]:
    """Numbers of lifted and of failing grasps by object, among the judged grasps that the run
    counts; see `EvaluationSettings.balanced_among`."""
    columns, grasps = run.results, run.document.grasps
    counted = np.isin(columns["stage"], [s.value for s in STAGES_AMONG[grasps.balanced_among]])
    counted &= columns["outcome"] != Outcome.SIMULATION_FAILED.value
    lifted = columns["outcome"] == Outcome.LIFTED.value
    own = {name: counted & (columns["object"] == name) for name in grasps.objects}
    return {name: (int((m & lifted).sum()), int((m & ~lifted).sum())) for name, m in own.items()}


def _unbalanced(run: Run) -> list[str]:
    """Once all grasps are judged, a sentence for each object with fewer lifted or failing grasps
    than asked for, or that there is none."""
    grasps = run.document.grasps
    if not grasps.until_balanced or not run.complete:
        return []
    notes = []
    for name, counts in lifted_and_failed(run).items():
        parts = [
            f"{n} of the {grasps.until_balanced} {what}"
            for n, what in zip(counts, ("lifted", "failing"), strict=True)
            if n < grasps.until_balanced
        ]
        if parts:
            among = grasps.balanced_among
            counted = "" if among == "all" else f" (only {among} grasps count)"
            notes.append(
                f"{name}: only {' and '.join(parts)} grasps were found{counted} among "
                f"{grasps.objects[name]:,} grasps (max_grasps_per_object is "
                f"{grasps.max_per_object:,})"
            )
    asked = grasps.until_balanced
    return notes or [f"every object has {asked} lifted and {asked} failing grasps, as asked for"]
