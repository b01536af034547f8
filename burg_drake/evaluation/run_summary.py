"""Summary of a run, of one scene or of many: counts, and notes on grasps that are missing or failed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    CPU_COLUMNS,
    DECIDED_STAGES,
    PUSHED_PREFIX,
    MarginNames,
    Outcome,
    Stage,
    list_names,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.grasp_sets.sampling import TABLE_WORDS, TARGET_WORDS, shortfall_note
from burg_drake.evaluation.outcome_counts import (
    STAGES_BY_MODE,
    OutcomeCounts,
    StageCost,
    Summary,
    contested_rows,
    count_pushes,
    count_short_lifts,
    member_codes,
    settled_rows,
    stage_cost,
)
from burg_drake.evaluation.results_table import Columns
from burg_drake.evaluation.run_folder import Run
from burg_drake.evaluation.table_parts import StoredRows
from burg_drake.evaluation.trial_origin import read_motion
from burg_drake.station import GraspMotion

ARM_REMEDY = "try another station, or another place on the board; mode `hand` leaves the arm out"
STAGE_REMEDIES = {
    Stage.CLEAR: "sample grasps at which the hand is clear, as is the default",
    Stage.REACHABLE: ARM_REMEDY,
    Stage.PLANNED: ARM_REMEDY,
    Stage.EXECUTED: "the table of results has the reason of each",
}
"""What would help, by the stage that stopped most grasps."""


def run_notes(run: Run) -> tuple[str, ...]:
    """A sentence for each usual mistake that given grasps show, for each instance with fewer grasps
    than asked, or for those that no grasps were given for, and, once all of its grasps are judged,
    for each object of which nothing could be executed, or that has too few lifted or failing ones
    for a run that is to be balanced."""
    return (
        *run.document.hints,
        *_missing_grasps_notes(run),
        *run_shortfall_notes(run),
        *_unexecuted_notes(run),
        *_balance_notes(run),
    )


def missing_grasps_note(objects: Iterable[str], given: Iterable[str]) -> str:
    """Which of the objects have no given grasp; "" if all have some."""
    missing = sorted({*objects} - {*given})
    return f"there are no grasps to judge for {list_names(missing)}" if missing else ""


def run_shortfall_notes(run: Run) -> list[str]:
    """A sentence for each instance with fewer grasps than were to be sampled."""
    asked = run.document.grasps.per_object
    if asked is None:
        return []
    found = Counter(run.candidates.instance.tolist())
    parts = run.candidates.grasps.provenance.get("parts", {})
    notes = (shortfall_note(name, asked, part, found[name]) for name, part in parts.items())
    return [note for note in notes if note]


def _missing_grasps_notes(run: Run) -> list[str]:
    grasps = run.document.grasps
    if grasps.per_object is not None:
        return []
    note = missing_grasps_note(grasps.objects, [name for name, n in grasps.objects.items() if n])
    return [note] if note else []


def _unexecuted_notes(run: Run) -> list[str]:
    columns, notes = run.results, []
    motion = read_motion(run.document.trial)
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
    if other := _motion_remedy(Outcome(_frequent_causes(outcomes, blockers)[0][0][0]), motion):
        remedy = f"{other} may help; {remedy}"
    causes = _causes_text(outcomes, blockers)
    return f"{name}: none of {_grasps_text(mine)} was executed: {causes}; {remedy}"


def _remedy(stage: Stage, *, given: bool) -> str:
    return (
        "burg-drake grasps show displays them at their object"
        if given and stage is Stage.CLEAR
        else STAGE_REMEDIES[stage]
    )


def _motion_remedy(outcome: Outcome, motion: GraspMotion) -> str:
    """Another motion of the hand that may avoid an outcome; "" if there is none."""
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
            causes = _causes_text(outcomes[mine], blockers[mine])
            remedy = _remedy(Stage.CLEAR, given=given)
            notes.append(f"{name}: none of {_grasps_text(mine)} is clear: {causes}; {remedy}")
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
        first = Outcome(_frequent_causes(outcomes[mine], blockers[mine])[0][0][0])
        if other := _motion_remedy(first, motion):
            causes = _causes_text(outcomes[mine], blockers[mine])
            notes.append(
                f"{name}: none of {_grasps_text(mine)} is reachable: {causes}; {other} may help"
            )
    return tuple(notes)


def _grasps_text(mine: np.ndarray) -> str:
    count = int(mine.sum())
    return f"{count:,} grasp{'' if count == 1 else 's'}"


def _causes_text(outcomes: NDArray[np.str_], blockers: NDArray[np.str_]) -> str:
    """The most frequent outcomes, with what was in the way."""
    named = _frequent_causes(outcomes, blockers)
    parts = [f"{_cause_words(Outcome(what), body)} in {count:,}" for (what, body), count in named]
    rest = len(outcomes) - sum(count for _, count in named)
    return ", ".join([*parts, *([f"others in {rest:,}"] if rest else [])])


def _frequent_causes(
    outcomes: NDArray[np.str_], blockers: NDArray[np.str_]
) -> list[tuple[tuple[str, str], int]]:
    """The most frequent pairs of outcome and blocker, with their counts."""
    max_causes = 3  # So many outcomes are named.
    return Counter(zip(outcomes.tolist(), blockers.tolist(), strict=True)).most_common(max_causes)


def _cause_words(outcome: Outcome, blocker: str) -> str:
    # Bodies that the open hand hits, in words.
    bodies = {Outcome.COLLISION_TARGET: TARGET_WORDS, Outcome.COLLISION_TABLE: TABLE_WORDS}
    if outcome.stage is Stage.CLEAR:
        return f"the open hand hits {bodies.get(outcome, blocker)}"
    return outcome.value.replace("_", " ") + (f" ({blocker})" if blocker else "")


def lifted_and_failed(run: Run) -> dict[str, tuple[int, int]]:
    """Numbers of lifted and of failing grasps by object, among the judged grasps that the run
    counts; see `EvaluationSettings.balanced_among`."""
    columns, grasps = run.results, run.document.grasps
    counted = np.isin(columns["stage"], [s.value for s in DECIDED_STAGES[grasps.balanced_among]])
    counted &= columns["outcome"] != Outcome.SIMULATION_FAILED.value
    lifted = columns["outcome"] == Outcome.LIFTED.value
    own = {name: counted & (columns["object"] == name) for name in grasps.objects}
    return {name: (int((m & lifted).sum()), int((m & ~lifted).sum())) for name, m in own.items()}


def _balance_notes(run: Run) -> list[str]:
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


Text = TypeVar("Text", bound=str)


def summarize_campaign(campaign: Campaign) -> Summary:
    """Counts what a run over many scenes has found so far."""
    document = campaign.document
    stages = [stage for stage in Stage if stage in STAGES_BY_MODE[document.mode]]
    names = [
        "object",
        "outcome",
        "stage",
        *("confidence", "judged_again"),
        MarginNames.lift_height,
        *(CPU_COLUMNS[s] for s in stages),
    ]
    approached = document.mode == "arm" or bool(document.trial.get("approach"))
    if approached:
        names += ["pushed", "instance", *(PUSHED_PREFIX + name for name in document.instances)]
    rows = campaign.rows(names)
    object, objects = rows.codes("object")
    by_object = dict(zip(objects, _count_groups(rows, object, objects), strict=True))
    by_scene = _count_groups(rows, rows.run, campaign.names)
    none = OutcomeCounts("", 0, Counter(), Counter(), Counter())
    costs = [stage_cost(rows.columns([CPU_COLUMNS[stage]]), stage) for stage in stages]
    sampled = [s for s in campaign.states.values() if s.sampling > 0.0]
    if sampled:
        grasps, seconds = sum(s.grasps for s in sampled), sum(s.sampling for s in sampled)
        costs.insert(0, StageCost("sampling", grasps, seconds, math.nan))
    only = document.grasps.only
    known = dict.fromkeys(o for entry in document.mine for o in entry.chosen(only).values())
    return Summary(
        objects=tuple(replace(by_object.get(name, none), name=name) for name in known),
        total=_count_groups(rows, np.zeros_like(rows.run), ["all"])[0],
        costs=tuple(costs),
        mode=document.mode,
        pushes=count_pushes(rows.columns(rows.table.column_names)) if approached else None,
        lifts=count_short_lifts(
            rows.column(MarginNames.lift_height), read_motion(document.trial).lift_height
        ),
        notes=_campaign_notes(campaign),
        scenes=tuple(by_scene),
        knows_confidence=bool(np.isfinite(rows.column("confidence")).any()),
        settled_by=tuple(sorted(text for text in rows.codes("judged_again")[1] if text)),
    )


def _count_groups(
    rows: StoredRows, keys: NDArray[np.int64], names: Sequence[str]
) -> list[OutcomeCounts]:
    """Grasps by object, by scene, or all.

    Args:
        rows: the grasps.
        keys: (N,) the place of each in `names`.
        names: of the groups.
    """
    outcome = _member_codes(rows, "outcome", tuple(Outcome))
    stage = _member_codes(rows, "stage", tuple(Stage))
    shape = (len(names), len(tuple(Outcome)), len(tuple(Stage)))
    flat = (keys * shape[1] + outcome) * shape[2] + stage
    counts = np.bincount(flat, minlength=math.prod(shape)).reshape(shape)
    codes, texts = rows.codes("judged_again")
    # parts of earlier releases lack the column: -1 is the last one, which is no text
    settled = np.array([*(text != "" for text in texts), False], dtype=bool)[codes]
    contested = contested_rows(rows.column("confidence"), settled)
    lifted = contested & (outcome == tuple(Outcome).index(Outcome.LIFTED))
    doubts = [
        np.bincount(keys[chosen], minlength=len(names)) for chosen in (contested, lifted, settled)
    ]
    return [
        _group_counts(name, counts[k], *(int(number[k]) for number in doubts))
        for k, name in enumerate(names)
    ]


def _member_codes(rows: StoredRows, name: str, members: Sequence[str]) -> NDArray[np.int64]:
    codes, texts = rows.codes(name)
    return np.array([list(members).index(text) for text in texts], dtype=np.int64)[codes]


def _group_counts(
    name: str, counts: NDArray[np.int64], contested: int, contested_lifts: int, settled: int
) -> OutcomeCounts:
    """Grasps of an object or a scene.

    Args:
        name: of it.
        counts: (outcomes, stages) how many there are.
        contested, contested_lifts, settled: see `OutcomeCounts`.
    """
    failed = counts[tuple(Outcome).index(Outcome.SIMULATION_FAILED)]
    return OutcomeCounts(
        name,
        int(counts.sum()),
        _counter_of_counts(tuple(Outcome), counts.sum(axis=1)),
        _counter_of_counts(tuple(Stage), counts.sum(axis=0)),
        _counter_of_counts(tuple(Stage), failed),
        contested=contested,
        contested_lifts=contested_lifts,
        settled=settled,
    )


def _counter_of_counts(members: Sequence[Text], counts: NDArray[np.int64]) -> Counter[Text]:
    found = zip(members, counts.tolist(), strict=True)
    return Counter({member: n for member, n in found if n})


def _campaign_notes(campaign: Campaign) -> tuple[str, ...]:
    max_listed = 5  # Scenes with too few grasps that are listed with what is missing.
    states, notes = campaign.states, [*campaign.document.hints]
    if empty := [n for n in campaign.names if n in states and states[n].state == "empty"]:
        notes.append(f"{len(empty)} scenes have no grasps to judge: {list_names(empty)}")
    if failed := list(campaign.failed):
        notes.append(f"{len(failed)} scenes could not be judged: {list_names(failed)}")
    short = [n for n in campaign.names if n in states and states[n].missing]
    notes += [f"scene {name}: {states[name].missing}" for name in short[:max_listed]]
    if len(short) > max_listed:
        notes.append(f"{len(short) - max_listed} more scenes have fewer grasps than were asked for")
    return tuple(notes)


def summarize(run: Run | Campaign) -> Summary:
    """Counts what a run, of one scene or of many, has found so far."""
    if not isinstance(run, Run):
        return summarize_campaign(run)
    columns, document = run.results, run.document
    outcome = member_codes(columns["outcome"], tuple(Outcome))
    stage = member_codes(columns["stage"], tuple(Stage))
    settled = settled_rows(columns["judged_again"])
    doubts = np.stack([contested_rows(columns["confidence"], settled), settled], axis=1)
    mine = {name: columns["object"] == name for name in document.grasps.objects}
    sampling = document.grasps
    costs = [
        stage_cost(columns, stage) for stage in Stage if stage in STAGES_BY_MODE[document.mode]
    ]
    if sampling.origin == "sampled" and sampling.count:
        costs.insert(0, StageCost("sampling", sampling.count, sampling.cpu, math.nan))
    return Summary(
        objects=tuple(
            _count_group(name, outcome[own], stage[own], doubts[own]) for name, own in mine.items()
        ),
        total=_count_group("all", outcome, stage, doubts),
        costs=tuple(costs),
        mode=document.mode,
        pushes=count_pushes(columns),
        lifts=count_short_lifts(
            columns[MarginNames.lift_height], read_motion(document.trial).lift_height
        ),
        notes=run_notes(run),
        knows_confidence=bool(np.isfinite(columns["confidence"]).any()),
        settled_by=tuple(name for name in np.unique(columns["judged_again"]).tolist() if name),
    )


def _count_group(
    name: str, outcome: np.ndarray, stage: np.ndarray, doubts: np.ndarray
) -> OutcomeCounts:
    """Counts grasps by the places (N,) of their outcomes in `Outcome` and stages in `Stage`, and
    whether they are contested, and settled (N, 2)."""
    contested, settled = doubts.T
    failed = stage[outcome == tuple(Outcome).index(Outcome.SIMULATION_FAILED)]
    return OutcomeCounts(
        name,
        len(outcome),
        _counter_of_codes(tuple(Outcome), outcome),
        _counter_of_codes(tuple(Stage), stage),
        _counter_of_codes(tuple(Stage), failed),
        contested=int(contested.sum()),
        contested_lifts=int((contested & (outcome == tuple(Outcome).index(Outcome.LIFTED))).sum()),
        settled=int(settled.sum()),
    )


def _counter_of_codes(members: tuple[Any, ...], codes: np.ndarray) -> Counter[Any]:
    counts = np.bincount(codes, minlength=len(members)).tolist()
    return Counter({member: n for member, n in zip(members, counts, strict=True) if n})
