"""Sections of the report about grasps: margins, the best grasps, failed simulations."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    MarginNames,
    Stage,
    column_axis_label,
    column_title,
    display_order,
    display_unit,
    format_column_value,
)
from burg_drake.evaluation.report.page_elements import (
    GROUP_CLASSES,
    LIFTED_GROUP,
    ReportSection,
    present_groups,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.run_folder import Run
from burg_drake.visualization import (
    OUTCOME_GROUPS,
    HistogramSeries,
    Html,
    Limit,
    PageTable,
    mirrored_histogram,
)

MAIN_MARGINS = ("clearance", "slip", "tilt", "others_moved")
"""Main margins: tolerance to errors, firmness, disturbance of other objects."""
FURTHER_MARGINS = display_order(
    ("pad_force", "patch_area", "arm_clearance", "pushed", "tracking_distance"),
    MarginNames.all,
    without=(
        *MAIN_MARGINS,
        *("overlap", "joint_excess"),  # 0 of all that was executed
        *("lift", MarginNames.lift_height, "end_time"),  # follow from the settings
        *("duration", "tracking_error"),  # in the section about the arm
    ),
)
"""All other margins that differ between executed grasps."""


def margin_charts(
    columns: Mapping[str, Array], groups: NDArray[np.int8], trial: Mapping[str, float]
) -> list[Html]:
    """Distributions of the main margins; none if nothing was executed.

    Args:
        columns: columns (N,) of executed grasps by name.
        groups: (N,) groups of the grasps, see `group_indices`.
        trial: settings of the trial's phases, with the limits of a successful lift.
    """
    # Settings that limit what counts as lifted.
    limiting_settings = {"others_moved": "disturbance", "slip": "slip_limit", "tilt": "tilt_limit"}
    limits = {
        name: Limit(trial[limit] * display_unit(name)[1], "limit")
        for name, limit in limiting_settings.items()
        if trial.get(limit, math.inf) < math.pi  # no limit
    }
    return _margin_charts(MAIN_MARGINS, columns, groups, limits)


def further_margins(columns: Mapping[str, Array], groups: NDArray[np.int8]) -> ReportSection | None:
    """All other margins; None if nothing was executed."""
    charts = _margin_charts(FURTHER_MARGINS, columns, groups, {})
    if not charts:
        return None
    text = (
        "Read these like the margins above. Forces and contact patches are those at the"
        " moment when the outcome was decided."
    )
    return ReportSection("Further margins", text, charts=charts)


def executed_margins(
    columns: ResultRows, groups: NDArray[np.int8]
) -> tuple[dict[str, Array], NDArray[np.int8]]:
    """Columns and groups of the executed grasps, the arguments of `margin_charts`."""
    tried = columns["stage"] == Stage.EXECUTED.value
    names = [name for name in (*MAIN_MARGINS, *FURTHER_MARGINS) if name in columns]
    return {name: columns[name][tried] for name in names}, groups[tried]


def _margin_charts(
    margins: Sequence[str],
    columns: Mapping[str, Array],
    groups: NDArray[np.int8],
    limits: Mapping[str, Limit],
) -> list[Html]:
    charts = []
    for margin in margins:
        _, factor = display_unit(margin)
        values = columns.get(margin, np.empty(0)) * factor
        known = np.isfinite(values)
        if known.any():
            charts.append(_margin_chart(margin, values[known], groups[known], limits.get(margin)))
    return charts


def _margin_chart(
    margin: str, values: np.ndarray, groups: NDArray[np.int8], limit: Limit | None
) -> Html:
    def series(k: int) -> HistogramSeries:
        name = OUTCOME_GROUPS[k].name
        return HistogramSeries(values[groups == k], GROUP_CLASSES[name], name)

    failures = [series(k) for k in present_groups(groups) if k != LIFTED_GROUP]
    unit, _ = display_unit(margin)
    return mirrored_histogram(
        series(LIFTED_GROUP), failures, title=column_axis_label(margin), unit=unit, limit=limit
    )


def best_section(run: Run) -> ReportSection | None:
    """Section of the best grasps and the commands that show them; None if none was lifted."""
    per_object = 3  # Rows for each object.
    # Columns with their number of decimals.
    decimals = dict(clearance=1, slip=2, tilt=2, pad_force=1, patch_area=0, others_moved=2)
    best = run.best(per_object, each=True)
    if not best:
        return None
    head = ["grasp", "object", *map(column_title, decimals)]
    rows = []
    for row in map(run.row, best):
        cells = [format_column_value(name, row[name], digits) for name, digits in decimals.items()]
        rows.append([row["id"], row["object"], *cells])
    line = shlex.join(["burg-drake", "replay", str(run.path), "--grasp", best[0]])
    return ReportSection(
        "Best grasps",
        f"The {per_object} best grasps of each object: lifted, with the most room around the"
        " open hand (clearance), and so most likely to succeed when pose, mass and"
        " friction differ from the model. Among grasps with the same clearance (to 0.5"
        " mm) those with less slip, tilt and movement of other objects come first, then"
        " those with the larger contact patch. To watch a grasp, give its id:",
        PageTable(head, rows, range(2, len(head)), "ids"),
        command=line,
    )


def failure_section(run: Run) -> ReportSection | None:
    """Section of the grasps that could not be simulated, with reasons; None if there are none."""
    max_rows = 50  # Rows of the table of failures.
    failures = run.failures
    if not failures:
        return None
    rows = []
    for row in map(run.row, failures[:max_rows]):
        rows.append([row["id"], row["stage"], row["reason"]])
    more = f" The first {max_rows} are listed." if len(failures) > max_rows else ""
    text = f"{len(failures)} grasps could not be simulated; they count as not executed.{more}"
    return ReportSection(
        "Failures", text, PageTable(["grasp", "stage", "reason"], rows, style="ids")
    )
