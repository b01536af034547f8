"""What a run found, in numbers: of one scene here, of many in `campaign_summary`."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from burg_drake.core.grasps import LIFT_HEIGHT, Outcome, Stage
from burg_drake.evaluation.records import motion_in
from burg_drake.evaluation.results.campaign_summary import summarize_campaign
from burg_drake.evaluation.results.contested import contested_rows, settled_rows
from burg_drake.evaluation.results.counts import (
    STAGES,
    OutcomeCounts,
    StageCost,
    Summary,
    pushes,
    stage_cost,
)
from burg_drake.evaluation.results.notes import run_notes
from burg_drake.evaluation.results.shortened_lifts import short_lifts
from burg_drake.evaluation.store import Campaign, Run, member_codes

OUTCOMES, ALL_STAGES = tuple(Outcome), tuple(Stage)


def summarize(run: Run | Campaign) -> Summary:
    """Counts what a run, of one scene or of many, has found so far."""
    if not isinstance(run, Run):
        return summarize_campaign(run)
    columns, document = run.results, run.document
    outcome = member_codes(columns["outcome"], OUTCOMES)
    stage = member_codes(columns["stage"], ALL_STAGES)
    settled = settled_rows(columns["judged_again"])
    doubts = np.stack([contested_rows(columns["confidence"], settled), settled], axis=1)
    mine = {name: columns["object"] == name for name in document.grasps.objects}
    sampling = document.grasps
    costs = [stage_cost(columns, stage) for stage in Stage if stage in STAGES[document.mode]]
    if sampling.origin == "sampled" and sampling.count:
        costs.insert(0, StageCost("sampling", sampling.count, sampling.cpu, math.nan))
    return Summary(
        objects=tuple(
            _group(name, outcome[own], stage[own], doubts[own]) for name, own in mine.items()
        ),
        total=_group("all", outcome, stage, doubts),
        costs=tuple(costs),
        mode=document.mode,
        pushes=pushes(columns),
        lifts=short_lifts(columns[LIFT_HEIGHT], motion_in(document.trial).lift_height),
        notes=run_notes(run),
        knows_confidence=bool(np.isfinite(columns["confidence"]).any()),
        settled_by=tuple(name for name in np.unique(columns["judged_again"]).tolist() if name),
    )


def _group(name: str, outcome: np.ndarray, stage: np.ndarray, doubts: np.ndarray) -> OutcomeCounts:
    """Counts grasps by the places (N,) of their outcomes in `Outcome` and stages in `Stage`, and
    whether they are contested, and settled (N, 2)."""
    contested, settled = doubts.T
    failed = stage[outcome == OUTCOMES.index(Outcome.SIMULATION_FAILED)]
    return OutcomeCounts(
        name,
        len(outcome),
        _counter(OUTCOMES, outcome),
        _counter(ALL_STAGES, stage),
        _counter(ALL_STAGES, failed),
        contested=int(contested.sum()),
        contested_lifts=int((contested & (outcome == OUTCOMES.index(Outcome.LIFTED))).sum()),
        settled=int(settled.sum()),
    )


def _counter(members: tuple[Any, ...], codes: np.ndarray) -> Counter[Any]:
    counts = np.bincount(codes, minlength=len(members)).tolist()
    return Counter({member: n for member, n in zip(members, counts, strict=True) if n})
