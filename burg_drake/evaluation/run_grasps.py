"""A run as a `GraspSet`: its grasps with all that is known of them as columns."""

from __future__ import annotations

import dataclasses

import numpy as np

from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.table import GIVEN, TEXT

LEFT_OUT = ("id", "object", "width", "score", "X_OG", *"xyz", "qw", "qx", "qy", "qz")
"""Columns of the results that a `GraspSet` has in its own way; so it has those of `GIVEN`."""


def run_grasps(run: Run) -> GraspSet:
    """All grasps of a run, in order, judged or not.

    Args:
        run: complete or not.

    Returns:
        The grasps with the column `instance` and those of the results table, see
        `evaluation.table`; NaN or empty for grasps that are not judged yet. The identifier of a
        grasp is the run's without the instance.
    """
    candidates, results = run.candidates, run.results
    row = {id: i for i, id in enumerate(candidates.id)}
    judged = np.array([row[id] for id in results["id"].tolist()], dtype=int)
    columns = {}
    for name, values in results.items():
        if name in LEFT_OUT or name.startswith(GIVEN):
            continue
        text = name in TEXT
        filled = np.full(len(candidates), "" if text else np.nan, values.dtype if text else float)
        filled[judged] = values
        columns[name] = filled
    columns["instance"] = candidates.instance
    grasps = candidates.grasps
    return dataclasses.replace(grasps, columns={**grasps.columns, **columns})
