"""Counts of lifted and failing grasps of each object, and notes on objects with too few."""

from __future__ import annotations

import numpy as np

from burg_drake.core.grasps import STAGES_AMONG, Outcome
from burg_drake.evaluation.store import Run


def lifted_and_failed(run: Run) -> dict[str, tuple[int, int]]:
    """Numbers of lifted and of failing grasps by object, among the judged grasps that the run
    counts; see `EvaluationSettings.balanced_among`."""
    columns, grasps = run.results, run.document.grasps
    counted = np.isin(columns["stage"], [s.value for s in STAGES_AMONG[grasps.balanced_among]])
    counted &= columns["outcome"] != Outcome.SIMULATION_FAILED.value
    lifted = columns["outcome"] == Outcome.LIFTED.value
    own = {name: counted & (columns["object"] == name) for name in grasps.objects}
    return {name: (int((m & lifted).sum()), int((m & ~lifted).sum())) for name, m in own.items()}


def unbalanced_notes(run: Run) -> list[str]:
    """A sentence for each object with fewer lifted or failing grasps than asked for, once all
    grasps are judged."""
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
            counted = "" if among == "all" else f" ({among} ones count)"
            notes.append(
                f"{name}: {' and '.join(parts)} grasps asked for{counted}, after"
                f" {grasps.objects[name]:,} grasps (max_grasps_per_object is"
                f" {grasps.max_per_object:,})"
            )
    return notes
