"""Rows of a table of results: the best ones, and those of one grasp."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, UnknownNameError, listing
from burg_drake.core.grasps import CONTESTED, Outcome
from burg_drake.evaluation.candidates import are_of
from burg_drake.evaluation.records.table import Columns

LENGTH_STEP = 1e-4
ANGLE_STEP = float(np.deg2rad(0.1))
AREA_STEP = 1e-6
"""Lengths [m], angles [rad] and areas [m2] count in whole steps: less tells no grasps apart."""
CLEARANCE_STEP = 5e-4
"""Clearances count in steps of 0.5 mm [m]."""
MAX_CLEARANCE_STEPS = 1e6
"""More steps of clearance than any grasp has."""
SLIP_SCALE = 0.005
TILT_SCALE = 0.1
PUSH_SCALE = 0.01
"""A slip of 5 mm, a tilt of 0.1 rad and a push of 10 mm weigh the same."""
MIN_ID_SIMILARITY = 0.7
"""Similarity of ids from which one is suggested for another: those of two grasps of one object
have 0.43 on average, an id and the first half of its digits more than 0.75."""


def best_rows(
    columns: Columns, count: int = 1, *, each: bool = False, only: Iterable[str] | None = None
) -> list[int]:
    """Indices of the lifted grasps that can be trusted most, best first; fewer if fewer were
    lifted.

    Ranked by the clearance of the open hand, in steps of 0.5 mm: of all margins of a row it tells
    best how often a grasp is lifted when pose, mass and friction are not quite what they are taken
    for, as four of five failures then are an open hand that hits something. Its rank correlation
    with that share is 0.6, that of all others from -0.35 to 0.25 (`benchmarks/best.py`). Of equal
    ones that which disturbed less, by slip / 5 mm + tilt / 0.1 rad + push of other objects / 10 mm,
    rounded to 0.1 mm and 0.1 deg; then by the larger contact patch of the weaker pad, rounded to
    1 mm2, by the higher score of the sampler, and by id. Contested ones, and those whose clearance
    is not known, rank last; other margins that are not known count as 0.

    Args:
        columns: a table of results.
        count: how many.
        each: so many of each object, in the order of the table, in place of all together.
        only: names of objects or instances; others are left out.

    Raises:
        UnknownNameError: the table has no such object or instance.
    """
    chosen = are_of(only, "the table", columns["object"], columns["instance"])
    lifted = np.flatnonzero((columns["outcome"] == Outcome.LIFTED) & chosen)
    lifted = _clearest(columns, lifted, count, each=each)
    room = _room(columns, lifted)
    penalty = (
        _rounded(columns["slip"][lifted], LENGTH_STEP) / SLIP_SCALE
        + _rounded(columns["tilt"][lifted], ANGLE_STEP) / TILT_SCALE
        + _rounded(columns["others_moved"][lifted], LENGTH_STEP) / PUSH_SCALE
    )
    patch = _rounded(columns["patch_area"][lifted], AREA_STEP)
    score = np.nan_to_num(columns["score"][lifted], nan=-np.inf)
    # equal sums may differ in their last digits
    order = np.lexsort((columns["id"][lifted], -score, -patch, penalty.round(9), -room))
    ranked = lifted[order].tolist()
    if not each:
        return [int(row) for row in ranked[:count]]
    objects = columns["object"]
    return [
        int(row)
        for name in dict.fromkeys(objects.tolist())
        for row in [row for row in ranked if objects[row] == name][:count]
    ]


def _room(columns: Columns, rows: NDArray[np.int64]) -> Array:
    """Clearances of some rows in whole steps; those of contested ones are behind all others."""
    clearance = columns["clearance"][rows] if "clearance" in columns else np.zeros(len(rows))
    steps = np.nan_to_num(np.floor(clearance / CLEARANCE_STEP + 1e-9), nan=-MAX_CLEARANCE_STEPS)
    if "confidence" not in columns or "judged_again" not in columns:  # of earlier releases
        return steps
    contested = columns["confidence"][rows] < CONTESTED
    contested &= columns["judged_again"][rows] == ""
    return np.where(contested, steps - 2.0 * MAX_CLEARANCE_STEPS, steps)


def _clearest(
    columns: Columns, rows: NDArray[np.int64], count: int, *, each: bool
) -> NDArray[np.int64]:
    """Those of some rows that can be among the first `count`, of each object or of all together:
    the others have less room than so many. To rank a million takes seconds."""
    groups = [rows]
    if each:
        objects = columns["object"][rows]
        groups = [rows[objects == name] for name in set(objects.tolist())]
    kept = []
    for mine in groups:
        room = _room(columns, mine)
        least = np.partition(room, len(room) - count)[-count] if 0 < count < len(room) else -np.inf
        kept.append(mine[room >= least])
    return np.sort(np.concatenate(kept)) if kept else rows


def _rounded(values: Array, step: float) -> Array:
    """The nearest multiples of a step; 0 for NaN."""
    return np.nan_to_num(np.round(values / step) * step)


def rows_of(columns: Columns, id: str, where: str) -> list[int]:
    """Indices of the rows of one grasp, at least one.

    Raises:
        UnknownNameError: there is none; the message names the nearest.
    """
    ids = columns["id"].tolist()
    rows = [row for row, known in enumerate(ids) if known == id]
    if not rows:
        raise unknown_grasp(id, ids, where)
    return rows


def unknown_grasp(id: str, ids: Sequence[str], where: str, hint: str = "") -> UnknownNameError:
    """The error about an id that nothing goes by; names those that are much like it, if any."""
    close = difflib.get_close_matches(id, ids, n=3, cutoff=MIN_ID_SIMILARITY)
    known = f"did you mean {' or '.join(close)}?" if close else f"known: {listing(ids)}"
    hint = f" ({hint})" if hint else ""
    return UnknownNameError(f"{where} has no judged grasp {id!r}; {known}{hint}")
