"""Sections of the report about margins: by how much grasps succeeded, and failed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import (
    LIFT_HEIGHT,
    MARGINS,
    Stage,
    shown_axis,
    shown_order,
    shown_unit,
)
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.report.elements import (
    LIFTED,
    STYLES,
    Html,
    Limit,
    Series,
    element,
    folded,
    group_legend,
    mirrored_histogram,
    present,
    section,
)
from burg_drake.visualization.style import GROUPS

DISTURBED = "others_moved"
LIMITS = {DISTURBED: "disturbance", "slip": "slip_limit", "tilt": "tilt_limit"}
"""Settings that say from which value of a margin on what is held does not count as lifted."""
CHOSEN = ("clearance", "slip", "tilt", DISTURBED)
"""What tells most about a grasp: how exact it must be met, how firmly it holds, what it moves."""
FURTHER = shown_order(
    ("pad_force", "patch_area", "arm_clearance", "pushed", "tracking_distance"),
    MARGINS,
    without=(
        *CHOSEN,
        *("overlap", "joint_excess"),  # 0 of all that was executed
        *("lift", LIFT_HEIGHT, "end_time"),  # follow from what was asked for
        *("duration", "tracking_error"),  # in the section about the arm
    ),
)
"""All others that differ between executed grasps."""


def margin_section(
    columns: Mapping[str, Array], groups: NDArray[np.int8], trial: Mapping[str, float]
) -> Html | None:
    """The chosen margins; nothing where nothing was executed.

    Args:
        columns: (N,) by name, of grasps that came to a trial.
        groups: (N,) of each, see `outcome_groups`.
        trial: settings of the trial's phases, with the limits of what counts as lifted.
    """
    limits = {
        name: Limit(trial[limit] * shown_unit(name)[1], "limit")
        for name, limit in LIMITS.items()
        if trial.get(limit, math.inf) < math.pi  # an angle or a length that limits nothing
    }
    charts = _charts(CHOSEN, columns, groups, limits)
    if not charts:
        return None
    return section(
        "Margins",
        "Margins of all executed grasps: above the axis those that lifted their object,"
        " below it all others, each half on its own scale. Dashed lines are medians."
        " Slip and tilt are measured from the grip on, for grasps that both fingers"
        " held.",
        element("div", *charts, class_="charts"),
        group_legend(present(groups)),
    )


def further_margins(columns: Mapping[str, Array], groups: NDArray[np.int8]) -> Html | None:
    """The others; likewise."""
    charts = _charts(FURTHER, columns, groups, {})
    if not charts:
        return None
    text = (
        "Read these like the margins above. Forces and contact patches are those at the"
        " moment when the outcome was decided."
    )
    return folded("Further margins", text, element("div", *charts, class_="charts"))


def tried_margins(
    columns: Columns, groups: NDArray[np.int8]
) -> tuple[dict[str, Array], NDArray[np.int8]]:
    """What `margin_section` asks for, of a table of results and its groups (N,)."""
    tried = columns["stage"] == Stage.EXECUTED.value
    names = [name for name in (*CHOSEN, *FURTHER) if name in columns]
    return {name: columns[name][tried] for name in names}, groups[tried]


def _charts(
    margins: Sequence[str],
    columns: Mapping[str, Array],
    groups: NDArray[np.int8],
    limits: Mapping[str, Limit],
) -> list[Html]:
    charts = []
    for margin in margins:
        _, factor = shown_unit(margin)
        values = columns.get(margin, np.empty(0)) * factor
        known = np.isfinite(values)
        if known.any():
            charts.append(_chart(margin, values[known], groups[known], limits.get(margin)))
    return charts


def _chart(margin: str, values: np.ndarray, groups: NDArray[np.int8], limit: Limit | None) -> Html:
    series = {
        k: Series(values[groups == k], STYLES[GROUPS[k].name], GROUPS[k].name)
        for k in {LIFTED, *present(groups)}
    }
    success = series.pop(LIFTED)
    failures = [series[k] for k in sorted(series)]
    unit, _ = shown_unit(margin)
    return mirrored_histogram(success, failures, title=shown_axis(margin), unit=unit, limit=limit)
