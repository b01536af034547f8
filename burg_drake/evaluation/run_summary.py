"""Summary of a run, of one scene or of many: counts, and notes on missing or failed grasps."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    CPU_COLUMNS,
    DECIDED_STAGES,
    PUSHED_PREFIX,
    BurgError,
    MarginNames,
    Outcome,
    Stage,
    count_with_noun,
    list_names,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.grasp_sets.sampling import TABLE_WORDS, TARGET_WORDS, shortfall_note
from burg_drake.evaluation.outcome_counts import (
    STAGES_BY_MODE,
    OutcomeCounts,
    StageCost,
    Summary,
    count_pushes,
    count_short_lifts,
    member_codes,
    stage_cost,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import TextValues, contested_rows
from burg_drake.evaluation.run_document import (
    CampaignDocument,
    RunDocument,
    devices_of,
    one_by_one_text,
)
from burg_drake.evaluation.run_folder import Run
from burg_drake.evaluation.table_parts import StoredRows
from burg_drake.evaluation.trial_origin import protocol_of, read_motion
from burg_drake.objects import ObjectEntry, load_library
from burg_drake.simulation import Population
from burg_drake.station import GraspMotion

ARM_REMEDY = "try another station, or another place on the board; mode `hand` leaves the arm out"
STAGE_REMEDIES = {
    Stage.CLEAR: "sample grasps at which the hand is clear, as is the default",
    Stage.REACHABLE: ARM_REMEDY,
    Stage.PLANNED: ARM_REMEDY,
    Stage.EXECUTED: "the table of results has the reason of each",
}
"""Advice by the stage that rejected most grasps."""


def run_notes(run: Run) -> tuple[str, ...]:
    """Notes on a run, one sentence each.

    They name usual mistakes in given grasps, instances with fewer grasps than asked for or with
    none given, several devices, grasps that a card left to the CPU and, once its grasps are judged,
    each object without executed grasps, or with too few lifted or failing grasps for a balanced
    run; a lift or retreat on which most grasps fail; and objects unlike those that confidence was
    measured on.
    """
    grasps = run.document.grasps
    missing = ""
    if grasps.per_object is None:
        given = [name for name, count in grasps.objects.items() if count]
        missing = missing_grasps_note(grasps.objects, given)
    return (
        *run.document.hints,
        *([missing] if missing else []),
        *run_shortfall_notes(run),
        *_protocol_notes(run),
        *_device_notes(run.document),
        *_unexecuted_notes(run),
        *_motion_notes(run),
        *_balance_notes(run),
        *_population_notes(run.rows(), [run.document.library.path]),
    )


def _protocol_notes(run: Run) -> list[str]:
    """A note on what outcomes mean where objects were shaken."""
    if protocol_of(run.document.trial) == "lift":
        return []
    return [
        "objects were shaken, alone and without gravity: here `lifted` means held to the end, and"
        " `slipped` lost before"
    ]


def _device_notes(document: RunDocument | CampaignDocument) -> list[str]:
    """Notes on a run on several devices, and on grasps that were executed on the CPU instead."""
    devices, one_by_one = devices_of(document), one_by_one_text(document.stretches)
    notes = [f"{one_by_one}; the others in parallel"] if one_by_one else []
    if len(devices) > 1:
        notes.append(
            f"the grasps were judged on {len(devices)} devices, whose results may differ by"
            f" rounding: {'; '.join(devices)}"
        )
    return notes


def _population_notes(rows: ResultRows | StoredRows, libraries: Iterable[str]) -> list[str]:
    """A note on the objects whose verdicts have a confidence that was not measured on such objects.

    Args:
        rows: rows of a run.
        libraries: folders of its object libraries; those that are gone are left out.
    """
    object = rows.codes("object")
    judged = np.unique(object.codes[np.isfinite(rows.column("confidence"))])
    names = [object.names[code] for code in judged.tolist()]
    entries: dict[str, ObjectEntry] = {}
    for folder in libraries if names else ():
        with contextlib.suppress(BurgError):
            entries |= load_library(folder).objects
    population = Population.of_calibration()
    found = {
        name: population.differences(entries[name]) for name in sorted(names) if name in entries
    }
    texts = [f"{name} ({', '.join(texts)})" for name, texts in found.items() if texts]
    if not texts:
        return []
    return [f"confidence may be wrong for {list_names(texts)}; it was measured on {population}"]


def missing_grasps_note(objects: Iterable[str], given: Iterable[str]) -> str:
    """Note on the objects without given grasps; "" if there are none."""
    missing = sorted({*objects} - {*given})
    return f"there are no grasps to judge for {list_names(missing)}" if missing else ""


def run_shortfall_notes(run: Run) -> list[str]:
    """Notes on instances with fewer sampled grasps than asked for."""
    asked = run.document.grasps.per_object
    if asked is None:
        return []
    found = run.candidates.counts
    parts = run.candidates.grasps.provenance.get("parts", {})
    notes = (shortfall_note(name, asked, part, found[name]) for name, part in parts.items())
    return [note for note in notes if note]


def _unexecuted_notes(run: Run) -> list[str]:
    rows, notes = run.rows(), []
    motion = read_motion(run.document.trial)
    given = run.document.grasps.origin == "given"
    outcome, objects = rows.codes("outcome"), rows.codes("object")
    executed = np.zeros(len(outcome.codes), dtype=bool)
    for name in outcome.names:
        if Outcome(name).stage is Stage.EXECUTED and name != Outcome.SIMULATION_FAILED:
            executed |= outcome.equal(name)
    for name, count in run.document.grasps.objects.items():
        mine = np.flatnonzero(objects.equal(name))
        if count and len(mine) == count and not executed[mine].any():
            causes = _causes_of_rows(outcome, rows.codes("blocker"), mine)
            ((stage, _),) = rows.codes("stage").most_common(mine, 1)
            remedy = _remedy(Stage(stage), given=given)
            if other := _motion_remedy(_most_frequent_outcome(causes), motion):
                remedy = f"{other} may help; {remedy}"
            notes.append(_none_note(name, "was executed", causes, remedy))
    return notes


Causes = Counter[tuple[str, str]]
"""Number of grasps by outcome and blocker."""


def _causes_of_rows(outcome: TextValues, blocker: TextValues, rows: NDArray[np.int64]) -> Causes:
    """Causes of the grasps in the given rows (M,), in the order in which they occur."""
    pairs = outcome.codes[rows].astype(np.int64) * len(blocker.names) + blocker.codes[rows]
    found, first, counts = np.unique(pairs, return_index=True, return_counts=True)
    causes: Causes = Counter()
    for k in np.argsort(first).tolist():
        what, body = divmod(int(found[k]), len(blocker.names))
        causes[outcome.names[what], blocker.names[body]] = int(counts[k])
    return causes


def _causes_of(outcomes: NDArray[np.str_], blockers: NDArray[np.str_]) -> Causes:
    """Causes of grasps with these outcomes and blockers (N,)."""
    return Counter(zip(outcomes.tolist(), blockers.tolist(), strict=True))


def _remedy(stage: Stage, *, given: bool) -> str:
    return (
        "burg-drake grasps show displays them at their object"
        if given and stage is Stage.CLEAR
        else STAGE_REMEDIES[stage]
    )


def _motion_remedy(outcome: Outcome, motion: GraspMotion) -> str:
    """Change of the hand's motion that may avoid an outcome; "" if there is none."""
    lift_outcomes = (Outcome.HAND_COLLISION_LIFT, Outcome.LIFT_LINE)
    retreat_outcomes = (Outcome.HAND_COLLISION_RETREAT, Outcome.RETREAT_LINE)
    motions = []
    if outcome in lift_outcomes and motion.shortest >= motion.lift_height:
        motions.append("a shorter lift (least_lift)")
    elif outcome in lift_outcomes and motion.shortest > 0.0:
        motions.append("a smaller least_lift")
    if outcome in lift_outcomes and not motion.retreat:
        motions.append("a retreat first")
    if outcome in retreat_outcomes:
        motions.append("a shorter retreat")
    return " or ".join(motions)


@dataclass(frozen=True)
class MotionRemedy:
    """A shorter motion of the hand that may make more grasps reachable.

    Attributes:
        text: what most grasps fail on, and what may help; one sentence.
        setting: the field of `GraspMotion` to change.
        value: its new value [m].
    """

    text: str
    setting: Literal["least_lift", "retreat"]
    value: float


def motion_remedy(outcomes: Iterable[str], motion: GraspMotion) -> MotionRemedy | None:
    """What may help if most grasps at which the open hand is clear fail on the lift or the retreat.

    Args:
        outcomes: the outcome of each grasp.
        motion: motion of the hand.

    Returns:
        The shorter lift or retreat; None if most grasps fail on neither, or it is short already.
    """
    short_lift, min_retreat = 0.02, 0.02  # Metres.
    counts = Counter(map(Outcome, outcomes))
    clear = sum(n for outcome, n in counts.items() if outcome.stage is not Stage.CLEAR)
    of_lift = counts[Outcome.HAND_COLLISION_LIFT] + counts[Outcome.LIFT_LINE]
    of_retreat = counts[Outcome.HAND_COLLISION_RETREAT] + counts[Outcome.RETREAT_LINE]
    grasps = count_with_noun(clear, "grasp")
    if 2 * of_lift > clear and motion.shortest > short_lift:
        text = (
            f"{of_lift:,} of {grasps} fail on the lift of {1e3 * motion.shortest:g} mm; one as high"
            f" as there is room, at least {1e3 * short_lift:g} mm, may help"
        )
        return MotionRemedy(text, "least_lift", short_lift)
    if 2 * of_retreat > clear and motion.retreat > min_retreat:
        shorter = round(motion.retreat / 2.0, 3)
        text = (
            f"{of_retreat:,} of {grasps} fail on the retreat of {1e3 * motion.retreat:g} mm; one of"
            f" {1e3 * shorter:g} mm may help"
        )
        return MotionRemedy(text, "retreat", shorter)
    return None


def remedy_of_run(run: Run) -> MotionRemedy | None:
    """`motion_remedy` of the grasps of a run that are judged so far."""
    outcome = run.rows().codes("outcome")
    names = np.array(outcome.names, dtype=object)[outcome.codes]
    return motion_remedy(names.tolist(), read_motion(run.document.trial))


def _motion_notes(run: Run) -> list[str]:
    remedy = remedy_of_run(run)
    return [remedy.text] if remedy else []


def unclear_notes(
    objects: NDArray[np.str_],
    outcomes: NDArray[np.str_],
    blockers: NDArray[np.str_],
    *,
    given: bool,
) -> tuple[str, ...]:
    """Notes on objects without a grasp at which the open hand is clear.

    Args:
        objects, outcomes, blockers: (N,) object, outcome and blocker of each grasp.
        given: whether the grasps are the user's own.
    """
    clear = ~np.isin(outcomes, [o.value for o in Outcome if o.stage is Stage.CLEAR])
    notes = []
    for name in dict.fromkeys(objects.tolist()):
        mine = objects == name
        if not clear[mine].any():
            remedy = _remedy(Stage.CLEAR, given=given)
            causes = _causes_of(outcomes[mine], blockers[mine])
            notes.append(_none_note(name, "is clear", causes, remedy))
    return tuple(notes)


def unmoved_notes(
    objects: NDArray[np.str_],
    outcomes: NDArray[np.str_],
    blockers: NDArray[np.str_],
    motion: GraspMotion,
) -> tuple[str, ...]:
    """Notes on objects without reachable grasps for which another motion of the hand may help.

    That is the case if most of their grasps fail at the lift or the retreat.

    Args:
        objects, outcomes, blockers: (N,) object, outcome and blocker of each grasp.
        motion: motion of the hand.
    """
    notes = []
    for name in dict.fromkeys(objects.tolist()):
        mine = objects == name
        if (outcomes[mine] == Outcome.REACHABLE).any():
            continue
        causes = _causes_of(outcomes[mine], blockers[mine])
        if other := _motion_remedy(_most_frequent_outcome(causes), motion):
            notes.append(_none_note(name, "is reachable", causes, f"{other} may help"))
    return tuple(notes)


def _none_note(name: str, achievement: str, causes: Causes, remedy: str) -> str:
    """Note that none of an object's grasps gets that far, with the three most frequent causes."""
    count, named = causes.total(), causes.most_common(3)
    parts = [f"{_cause_words(Outcome(what), body)} in {n:,}" for (what, body), n in named]
    if rest := count - sum(n for _, n in named):
        parts.append(f"others in {rest:,}")
    grasps = count_with_noun(count, "grasp")
    return f"{name}: none of {grasps} {achievement}: {', '.join(parts)}; {remedy}"


def _most_frequent_outcome(causes: Causes) -> Outcome:
    """The outcome of the most frequent cause."""
    return Outcome(causes.most_common(1)[0][0][0])


def _cause_words(outcome: Outcome, blocker: str) -> str:
    # Words for the bodies that the open hand hits.
    bodies = {Outcome.COLLISION_TARGET: TARGET_WORDS, Outcome.COLLISION_TABLE: TABLE_WORDS}
    if outcome.stage is Stage.CLEAR:
        return f"the open hand hits {bodies.get(outcome, blocker)}"
    return outcome.value.replace("_", " ") + (f" ({blocker})" if blocker else "")


def lifted_and_failed(run: Run) -> dict[str, tuple[int, int]]:
    """Numbers of lifted and of failing grasps by object.

    Only counts the grasps of `EvaluationSettings.balanced_among`.
    """
    rows, grasps = run.rows(), run.document.grasps
    stages, objects, outcomes = map(rows.codes, ("stage", "object", "outcome"))
    among = [stage.value for stage in DECIDED_STAGES[grasps.balanced_among]]
    counted = np.isin(stages.names, among)[stages.codes]
    counted &= ~outcomes.equal(Outcome.SIMULATION_FAILED)
    lifted = outcomes.equal(Outcome.LIFTED)
    own = {name: counted & objects.equal(name) for name in grasps.objects}
    return {name: (int((m & lifted).sum()), int((m & ~lifted).sum())) for name, m in own.items()}


def _balance_notes(run: Run) -> list[str]:
    """Notes on a balanced run that is complete.

    They name objects with fewer lifted or failing grasps than asked for, or say there are none.
    """
    grasps = run.document.grasps
    if not grasps.until_balanced or not run.complete:
        return []
    notes = []
    for name, counts in lifted_and_failed(run).items():
        pairs = zip(counts, ("lifted", "failing"), strict=True)
        asked = grasps.until_balanced
        parts = [f"{n} of the {asked} {what}" for n, what in pairs if n < asked]
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


def summarize(run: Run | Campaign) -> Summary:
    """Summarizes the verdicts so far of a run, of one scene or of many."""
    document = run.document
    stages = STAGES_BY_MODE[document.mode]
    approached = document.mode == "arm" or bool(document.trial.get("approach"))
    instances = run.instances if isinstance(run, Run) else run.document.instances
    names = [
        *("object", "outcome", "stage", "confidence", "judged_again"),
        MarginNames.lift_height,
        *(CPU_COLUMNS[stage] for stage in stages),
        *(["pushed", "instance"] if approached else []),
        *(PUSHED_PREFIX + name for name in (instances if approached else ())),
    ]
    table = run.rows(names)
    judges = table.codes("judged_again")
    # parts of earlier releases lack the column: code -1 selects the appended False
    settled = np.array([*(name != "" for name in judges.names), False], dtype=bool)[judges.codes]
    confidence = table.column("confidence")
    rows = _CodedRows(
        member_codes(table.codes("outcome"), tuple(Outcome)),
        member_codes(table.codes("stage"), tuple(Stage)),
        contested_rows(confidence, settled),
        settled,
    )
    object, objects = table.codes("object")
    by_object = dict(zip(objects, rows.count_groups(object, objects), strict=True))
    none = OutcomeCounts("", 0, Counter(), Counter(), Counter())
    costs = [stage_cost(table.columns([CPU_COLUMNS[stage]]), stage) for stage in stages]
    return Summary(
        objects=tuple(replace(by_object.get(n, none), name=n) for n in _asked_objects(run)),
        total=rows.count_all(),
        costs=(*_sampling_cost(run), *costs),
        mode=document.mode,
        pushes=count_pushes(table.columns(names)) if approached else None,
        lifts=count_short_lifts(
            table.column(MarginNames.lift_height), read_motion(document.trial).lift_height
        ),
        notes=run_notes(run) if isinstance(run, Run) else _campaign_notes(run, table),
        scenes=(() if isinstance(run, Run) else tuple(rows.count_groups(table.run, run.names))),
        knows_confidence=bool(np.isfinite(confidence).any()),
        settled_by=tuple(sorted(name for name in judges.names if name)),
    )


def _asked_objects(run: Run | Campaign) -> Iterable[str]:
    """Names of the objects whose grasps are judged, in the order of the scenes."""
    if isinstance(run, Run):
        return run.document.grasps.objects
    only = run.document.grasps.only
    entries = run.document.assigned_scenes
    return dict.fromkeys(
        object for entry in entries for object in entry.selected_instances(only).values()
    )


def _sampling_cost(run: Run | Campaign) -> list[StageCost]:
    """CPU time of the sampling; empty if grasps were given."""
    if isinstance(run, Run):
        grasps = run.document.grasps
        known = grasps.origin == "sampled" and grasps.count > 0
        sampled = [(grasps.count, grasps.cpu)] if known else []
    else:
        sampled = [(s.grasps, s.sampling) for s in run.states.values() if s.sampling > 0.0]
    if not sampled:
        return []
    counts, seconds = zip(*sampled, strict=True)
    return [StageCost("sampling", sum(counts), sum(seconds), math.nan)]


@dataclass(frozen=True, eq=False)
class _CodedRows:
    """Verdicts of N grasps as arrays.

    Attributes:
        outcome, stage: (N,) indices in `Outcome` and `Stage`.
        contested, settled: (N,) see `OutcomeCounts`.
    """

    outcome: NDArray[np.integer]
    stage: NDArray[np.integer]
    contested: NDArray[np.bool_]
    settled: NDArray[np.bool_]

    def count_all(self) -> OutcomeCounts:
        """Counts of all grasps together."""
        (total,) = self.count_groups(np.zeros(len(self.outcome), dtype=np.int64), ["all"])
        return total

    def count_groups(self, keys: NDArray[Any], names: Sequence[str]) -> list[OutcomeCounts]:
        """Counts by group; `keys` (N,) are indices in the names of the groups."""
        outcomes, stages = tuple(Outcome), tuple(Stage)
        shape = (len(names), len(outcomes), len(stages))
        flat = (keys.astype(np.int64) * shape[1] + self.outcome) * shape[2] + self.stage
        counts = np.bincount(flat, minlength=math.prod(shape)).reshape(shape)
        lifted = self.contested & (self.outcome == outcomes.index(Outcome.LIFTED))
        contested, contested_lifts, settled = (
            np.bincount(keys[chosen], minlength=len(names)).tolist()
            for chosen in (self.contested, lifted, self.settled)
        )
        failed = counts[:, outcomes.index(Outcome.SIMULATION_FAILED)]
        return [
            OutcomeCounts(
                name,
                int(counts[k].sum()),
                +Counter(dict(zip(outcomes, counts[k].sum(axis=1).tolist(), strict=True))),
                +Counter(dict(zip(stages, counts[k].sum(axis=0).tolist(), strict=True))),
                +Counter(dict(zip(stages, failed[k].tolist(), strict=True))),
                contested=contested[k],
                contested_lifts=contested_lifts[k],
                settled=settled[k],
            )
            for k, name in enumerate(names)
        ]


def _campaign_notes(campaign: Campaign, rows: ResultRows | StoredRows) -> tuple[str, ...]:
    max_listed = 5  # Scenes with too few grasps that are listed with their notes.
    states, notes = campaign.states, [*campaign.document.hints]
    notes += _device_notes(campaign.document)
    notes += _population_notes(rows, campaign.document.libraries)
    if empty := [n for n in campaign.names if n in states and states[n].state == "empty"]:
        notes.append(f"{len(empty)} scenes have no grasps to judge: {list_names(empty)}")
    if failed := list(campaign.failed):
        notes.append(f"{len(failed)} scenes could not be judged: {list_names(failed)}")
    short = [n for n in campaign.names if n in states and states[n].missing]
    notes += [f"scene {name}: {states[name].missing}" for name in short[:max_listed]]
    if len(short) > max_listed:
        notes.append(f"{len(short) - max_listed} more scenes have fewer grasps than were asked for")
    return tuple(notes)
