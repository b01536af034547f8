"""Rows of a table of results: the best ones, and those of one grasp."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

import numpy as np

from burg_drake.core.errors import UnknownNameError, listing
from burg_drake.core.frames import Array
from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.table import Columns

LENGTH_STEP = 1e-4
ANGLE_STEP = float(np.deg2rad(0.1))
AREA_STEP = 1e-6
"""Lengths [m], angles [rad] and areas [m2] count in whole steps: less tells no grasps apart."""
SLIP_SCALE = 0.005
TILT_SCALE = 0.1
PUSH_SCALE = 0.01
"""A slip of 5 mm, a tilt of 0.1 rad and a push of 10 mm weigh the same."""
ALIKE = 0.7
"""Similarity of ids from which one is suggested for another: those of two grasps of one object
have 0.43 on average, an id and the first half of its digits more than 0.75."""


def best_rows(columns: Columns, count: int = 1) -> list[int]:
    """Indices of the lifted grasps that disturbed least, best first; fewer if fewer were lifted.

    Ranked by slip / 5 mm + tilt / 0.1 rad + push of other objects / 10 mm, with slip, tilt and push
    rounded to 0.1 mm, 0.1 deg and 0.1 mm; equal ones by the larger contact patch of the weaker pad,
    rounded to 1 mm2, then by the higher score of the sampler, then by id.
    """
    (lifted,) = np.nonzero(columns["outcome"] == Outcome.LIFTED)
    penalty = (
        _rounded(columns["slip"][lifted], LENGTH_STEP) / SLIP_SCALE
        + _rounded(columns["tilt"][lifted], ANGLE_STEP) / TILT_SCALE
        + _rounded(columns["others_moved"][lifted], LENGTH_STEP) / PUSH_SCALE
    )
    patch = _rounded(columns["patch_area"][lifted], AREA_STEP)
    score = np.nan_to_num(columns["score"][lifted], nan=-np.inf)
    # equal sums may differ in their last digits
    ranked = np.lexsort((columns["id"][lifted], -score, -patch, penalty.round(9)))
    return [int(row) for row in lifted[ranked[:count]]]


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
    close = difflib.get_close_matches(id, ids, n=3, cutoff=ALIKE)
    known = f"did you mean {' or '.join(close)}?" if close else f"known: {listing(ids)}"
    hint = f" ({hint})" if hint else ""
    return UnknownNameError(f"{where} has no judged grasp {id!r}; {known}{hint}")
