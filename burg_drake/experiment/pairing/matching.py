"""The same grasps in two tables of results: by scene and id, and by what they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.experiment.pairing.result_table import ID, ResultTable
from burg_drake.experiment.pairing.text_codes import text_keys
from burg_drake.experiment.statistics import Rows, Values

SCENE = "scene_content"
KEY: tuple[str, ...] = (SCENE, ID)
_FAR = np.uint64(0x9E3779B97F4A7C15)
CONTENT: tuple[str, ...] = ("x", "y", "z", "qw", "qx", "qy", "qz", "width")
"""What makes a grasp, beside its instance, which is a part of its id."""
SAME = 1e-9
"""Poses and widths that differ less are the same [m, 1]: tables may have come as texts."""


@dataclass(frozen=True, eq=False)
class Match:
    """Rows of two tables that are about the same grasp.

    Attributes:
        first, second: (N,) rows.
        other_content: grasps that only have their id in common.
        only_first, only_second: grasps of one table alone.
    """

    first: Rows
    second: Rows
    other_content: int
    only_first: int
    only_second: int


def match_rows(first: ResultTable, second: ResultTable) -> Match:
    """Finds the grasps that two tables have in common; of equal rows the first one counts."""
    if first.id.same(second.id) and first.texts[SCENE].same(second.texts[SCENE]):
        one = other = np.arange(len(first))
    else:
        _, one, other = np.intersect1d(_keys(first), _keys(second), return_indices=True)
        order = np.argsort(one)
        one, other = one[order], other[order]
    same = np.ones(len(one), dtype=bool)
    whole = one is other
    for name in CONTENT:
        if whole and first.same(second, name):
            continue
        a, b = first.numbers[name][one], second.numbers[name][other]
        same &= (np.abs(a - b) <= SAME) | (np.isnan(a) & np.isnan(b))
    return Match(
        one[same],
        other[same],
        int((~same).sum()),
        len(first) - len(one),
        len(second) - len(other),
    )


def _keys(table: ResultTable) -> Values:
    scenes = table.texts[SCENE]
    return table.id.keys + (text_keys(np.array(scenes.names)) * _FAR)[scenes.index]
