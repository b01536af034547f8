"""Rows of a table of results: the best ones, and those of one grasp."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

import numpy as np

from burg_drake.core.errors import UnknownNameError
from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.table import Columns

SLIP_SCALE = 0.005
TILT_SCALE = 0.1
PUSH_SCALE = 0.01
"""A slip of 5 mm, a tilt of 0.1 rad and a push of 10 mm weigh the same."""


def best_rows(columns: Columns, count: int = 1) -> list[int]:
    """Indices of the lifted grasps that disturbed least, best first; fewer if fewer were lifted.

    Ranked by slip / 5 mm + tilt / 0.1 rad + push of other objects / 10 mm; equal ones by id.
    """
    penalty = (
        columns["slip"] / SLIP_SCALE
        + columns["tilt"] / TILT_SCALE
        + columns["others_moved"] / PUSH_SCALE
    )
    (lifted,) = np.nonzero(columns["outcome"] == Outcome.LIFTED)
    ranked = sorted(zip(np.nan_to_num(penalty[lifted]), columns["id"][lifted], lifted, strict=True))
    return [int(row) for *_, row in ranked[:count]]


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
    """The error about an id that nothing goes by; names the nearest ones, as there are many."""
    close = difflib.get_close_matches(id, ids, n=3, cutoff=0.3)
    meant = f"did you mean {' or '.join(close)}? " if close else ""
    return UnknownNameError(f"{where} has no judged grasp {id!r}; {meant}{hint}".rstrip("; "))
