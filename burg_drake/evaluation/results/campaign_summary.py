"""A run over many scenes in numbers, from a few columns of its store."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import listing
from burg_drake.core.grasps import CPU_COLUMNS, LIFT_HEIGHT, PUSHED, Outcome, Stage
from burg_drake.evaluation.records import motion_in
from burg_drake.evaluation.results.contested import NEEDED, contested_rows
from burg_drake.evaluation.results.counts import (
    STAGES,
    OutcomeCounts,
    StageCost,
    Summary,
    pushes,
    stage_cost,
)
from burg_drake.evaluation.results.shortened_lifts import short_lifts
from burg_drake.evaluation.store import Campaign, StoredRows

OUTCOMES = tuple(Outcome)
ALL_STAGES = tuple(Stage)
Text = TypeVar("Text", bound=str)
SCENES_LISTED = 5
"""So many scenes with too few grasps are listed, each with what is missing, and why."""


def summarize_campaign(campaign: Campaign) -> Summary:
    """Counts what a run over many scenes has found so far."""
    document = campaign.document
    stages = [stage for stage in Stage if stage in STAGES[document.mode]]
    names = ["object", "outcome", "stage", *NEEDED, LIFT_HEIGHT, *(CPU_COLUMNS[s] for s in stages)]
    approached = document.mode == "arm" or bool(document.trial.get("approach"))
    if approached:
        names += ["pushed", "instance", *(PUSHED + name for name in document.instances)]
    rows = campaign.rows(names)
    object, objects = rows.codes("object")
    by_object = dict(zip(objects, _groups(rows, object, objects), strict=True))
    by_scene = _groups(rows, rows.run, campaign.names)
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
        total=_groups(rows, np.zeros_like(rows.run), ["all"])[0],
        costs=tuple(costs),
        mode=document.mode,
        pushes=pushes(rows.columns(rows.table.column_names)) if approached else None,
        lifts=short_lifts(rows.column(LIFT_HEIGHT), motion_in(document.trial).lift_height),
        notes=_notes(campaign),
        scenes=tuple(by_scene),
        knows_confidence=bool(np.isfinite(rows.column("confidence")).any()),
        settled_by=tuple(sorted(text for text in rows.codes("judged_again")[1] if text)),
    )


def _groups(rows: StoredRows, keys: NDArray[np.int64], names: Sequence[str]) -> list[OutcomeCounts]:
    """Grasps by object, by scene, or all.

    Args:
        rows: the grasps.
        keys: (N,) the place of each in `names`.
        names: of the groups.
    """
    outcome = _member_codes(rows, "outcome", OUTCOMES)
    stage = _member_codes(rows, "stage", ALL_STAGES)
    shape = (len(names), len(OUTCOMES), len(ALL_STAGES))
    flat = (keys * shape[1] + outcome) * shape[2] + stage
    counts = np.bincount(flat, minlength=math.prod(shape)).reshape(shape)
    codes, texts = rows.codes("judged_again")
    # parts of earlier releases lack the column: -1 is the last one, which is no text
    settled = np.array([*(text != "" for text in texts), False], dtype=bool)[codes]
    contested = contested_rows(rows.column("confidence"), settled)
    lifted = contested & (outcome == OUTCOMES.index(Outcome.LIFTED))
    doubts = [
        np.bincount(keys[chosen], minlength=len(names)) for chosen in (contested, lifted, settled)
    ]
    return [
        _group(name, counts[k], *(int(number[k]) for number in doubts))
        for k, name in enumerate(names)
    ]


def _member_codes(rows: StoredRows, name: str, members: Sequence[str]) -> NDArray[np.int64]:
    codes, texts = rows.codes(name)
    return np.array([list(members).index(text) for text in texts], dtype=np.int64)[codes]


def _group(
    name: str, counts: NDArray[np.int64], contested: int, contested_lifts: int, settled: int
) -> OutcomeCounts:
    """Grasps of an object or a scene.

    Args:
        name: of it.
        counts: (outcomes, stages) how many there are.
        contested, contested_lifts, settled: see `OutcomeCounts`.
    """
    failed = counts[OUTCOMES.index(Outcome.SIMULATION_FAILED)]
    return OutcomeCounts(
        name,
        int(counts.sum()),
        _counter(OUTCOMES, counts.sum(axis=1)),
        _counter(ALL_STAGES, counts.sum(axis=0)),
        _counter(ALL_STAGES, failed),
        contested=contested,
        contested_lifts=contested_lifts,
        settled=settled,
    )


def _counter(members: Sequence[Text], counts: NDArray[np.int64]) -> Counter[Text]:
    found = zip(members, counts.tolist(), strict=True)
    return Counter({member: n for member, n in found if n})


def _notes(campaign: Campaign) -> tuple[str, ...]:
    states, notes = campaign.states, [*campaign.document.hints]
    if empty := [n for n in campaign.names if n in states and states[n].state == "empty"]:
        notes.append(f"{len(empty)} scenes have no grasps to judge: {listing(empty)}")
    if failed := list(campaign.failed):
        notes.append(f"{len(failed)} scenes could not be judged: {listing(failed)}")
    short = [n for n in campaign.names if n in states and states[n].missing]
    notes += [f"scene {name}: {states[name].missing}" for name in short[:SCENES_LISTED]]
    if len(short) > SCENES_LISTED:
        notes.append(
            f"{len(short) - SCENES_LISTED} more scenes have fewer grasps than were asked for"
        )
    return tuple(notes)
