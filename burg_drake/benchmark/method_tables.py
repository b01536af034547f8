"""Tables of a comparison of methods, as text and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from burg_drake.benchmark.benchmark_folder import BenchmarkResult
from burg_drake.benchmark.measures import COUNT_MEASURES, MEASURE_MEANINGS, BenchmarkMeasure
from burg_drake.benchmark.method_comparison import (
    SIGNIFICANCE_LEVEL,
    MethodComparison,
    MethodDifference,
)
from burg_drake.benchmark.robot_trials import RobotSuccess, robot_successes
from burg_drake.benchmark.robustness import ConditionEffect, condition_effects, without_effects
from burg_drake.core import NO_VALUE, TextTable, count_with_noun, format_duration, format_number
from burg_drake.experiment import TrialSheet

SUCCESS_MEASURES = {
    "top_success": "top grasp",
    "precision_3": "best 3",
    "precision_5": "best 5",
    "average_precision": "AP",
    "graspnet_ap": "GraspNet AP",
}
"""Heading of each measure of success."""
CLEARING_MEASURES = {
    "cleared": "cleared",
    "mean_picks": "mean picks",
    "pick_success": "pick success",
    "emptied": "emptied",
}
"""Heading of each measure of the protocol `clear`."""
STEP_MEASURES = {
    "answered": "answered",
    "clear": "clear",
    "reachable": "reach",
    "planned": "plan",
    "held": "held",
    "lifted": "lifted",
    "disturbed": "disturbed",
}
"""Heading of each measure of how far grasps get."""


TIME_MEANINGS = {"planning": "an answer", "motion": "the arm's motion to a grasp and up"}
"""What each time is of."""


class TableText(NamedTuple):
    """A table in words.

    Attributes:
        title: heading.
        head: names of the columns; the first one names the row.
        rows: cells by row.
        caption: what the columns mean.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""

    def text_table(self) -> TextTable:
        """The table for a terminal."""
        found = TextTable(self.title, caption=self.caption).names(self.head[0])
        found.numbers(*self.head[1:])
        for row in self.rows:
            found.row(*row)
        return found

    def markdown(self) -> str:
        """The table in GitHub's Markdown."""
        lines = [
            f"| {' | '.join(self.head)} |",
            f"|---|{'---:|' * (len(self.head) - 1)}",
            *(f"| {' | '.join(cell.replace('|', '¦') for cell in row)} |" for row in self.rows),
        ]
        notes = [f"- {note}" for note in self.caption.splitlines()]
        return "\n".join([f"**{self.title}**", "", *lines, "", *notes, ""])


def comparison_tables(comparison: MethodComparison) -> list[TableText]:
    """The tables of a comparison: success, how far grasps get, and differences of two or more."""
    first = comparison.results[0]
    budget, scenes = first.suite.budget, len(first.scene_names)
    title = (
        f"Success on {first.suite.name}, release {first.suite.release}"
        f" ({first.document.suite_hash[:8]}), {count_with_noun(scenes, 'scene')}"
        f"{_settings_text(first)}"
    )
    tables = [
        _measure_table(comparison, title, SUCCESS_MEASURES, with_times=True),
        _measure_table(
            comparison,
            f"Stages passed, up to {budget.grasps} grasps an image",
            STEP_MEASURES,
        ),
    ]
    tables.append(_answer_table(comparison))
    if first.document.protocol == "clear":
        tables.append(_measure_table(comparison, "Clearing the scenes", CLEARING_MEASURES))
    pairs = comparison.differences["top_success"], comparison.differences["average_precision"]
    if pairs[0]:
        tables.append(_difference_table([*pairs[0], *pairs[1]]))
    return tables


def all_tables(
    comparisons: Sequence[MethodComparison], sheets: Sequence[TrialSheet] = ()
) -> list[TableText]:
    """The tables of comparisons, suite by suite, of the effects of conditions, and of trials on a
    robot.

    Args:
        comparisons: methods of each suite.
        sheets: contents of trials files.

    Raises:
        InvalidInputError: the trials are of other grasps.
    """
    tables = [t for one in without_effects(comparisons) for t in comparison_tables(one)]
    return [*tables, *(table for table, _ in further_tables(comparisons, sheets))]


def further_tables(
    comparisons: Sequence[MethodComparison], sheets: Sequence[TrialSheet]
) -> list[tuple[TableText, str]]:
    """The tables beyond those of each suite, with what each is about; see `all_tables`."""
    found = []
    effects = condition_effects(comparisons)
    if effects:
        about = "What noise of the depth, errors of the camera's pose and other friction cost."
        found.append((robustness_table(effects), about))
    if sheets:
        results = [result for one in comparisons for result in one.results]
        table = robot_table(robot_successes(results, sheets))
        found.append((table, "The best grasp of each image, in simulation and on the robot."))
    return found


def robot_table(successes: Sequence[RobotSuccess]) -> TableText:
    """The table of methods on a robot and in simulation."""
    rows = [
        (
            one.name,
            NO_VALUE if one.rendered is None else measure_text(one.rendered),
            measure_text(one.simulated),
            measure_text(one.real),
            NO_VALUE if np.isnan(one.agreement) else _percent(one.agreement),
            str(one.tried),
            str(one.infeasible),
            str(one.open),
        )
        for one in successes
    ]
    caption = (
        "success of the best grasp of each image in percent, with the 95 % confidence interval over"
        " scenes\n"
        "rendered: planned on rendered images of the same scenes, in simulation\n"
        "simulated, robot: planned on the given images, in simulation and on the robot\n"
        "agree: tried grasps that ended alike in simulation and on the robot\n"
        "infeasible: images without a grasp, or whose best one is out of reach or collides;"
        " failures\n"
        "open: still to be tried; until then in brackets the range that they leave open"
    )
    head = ("method", "rendered", "simulated", "robot", "agree", "tried", "infeasible", "open")
    return TableText("Simulation and robot", head, tuple(rows), caption)


def robustness_table(effects: Sequence[ConditionEffect]) -> TableText:
    """The table of the effects of conditions on methods."""
    rows = []
    for effect in effects:
        known = effect.result.document
        rows.append(
            (
                f"{known.name} on {known.suite}",
                str(known.conditions),
                measure_text(effect.measures["top_success"]),
                measure_text(effect.measures["average_precision"]),
                measure_text(effect.usual["average_precision"]),
                _difference_text(effect.difference),
                format_number(effect.difference.corrected),
            )
        )
    caption = (
        "AP before: under the conditions of the suite\n"
        "change: of AP in percentage points with its 95 % confidence interval, on the same scenes\n"
        "p: paired permutation test over scenes, corrected by Holm for the rows of this table"
    )
    head = ("method", "conditions", "top grasp", "AP", "AP before", "change", "p")
    return TableText("Robustness", head, tuple(rows), caption)


def _settings_text(result: BenchmarkResult) -> str:
    """Settings of a benchmark other than the usual ones."""
    known = result.document
    parts = [
        *(["first image of each scene"] if known.protocol == "clear" else []),
        *(["for tuning"] if known.split == "tuning" else []),
        *(["depth only"] if known.depth_only else []),
        *([f"settled by {known.settled}"] if known.settled else []),
        *([str(known.conditions)] if known.conditions.changes else []),
        *([f"images {known.images[:8]} of a real camera"] if known.images else []),
    ]
    return "".join(f", {part}" for part in parts)


def measure_text(measure: BenchmarkMeasure, name: str = "") -> str:
    """A measure with its interval, and what contested verdicts leave open; shares in percent."""
    if np.isnan(measure.value):
        return NO_VALUE
    number = partial(format_number, decimals=1) if name in COUNT_MEASURES else _percent
    text = number(measure.value)
    if not np.isnan(measure.low):
        text += f" ({number(measure.low)}-{number(measure.high)})"
    least, most = number(measure.least), number(measure.most)
    return text if least == most else f"{text} [{least}-{most}]"


def planning_time(result: BenchmarkResult) -> float:
    """Median time of an answer [s]; NaN without answers."""
    times = [one.answer.seconds for one in result.answers if not one.answer.error]
    return float(np.median(times)) if times else float("nan")


def motion_time(result: BenchmarkResult) -> float:
    """Median time of the arm's motion to a grasp and up [s]; NaN unless the arm is simulated."""
    times = [
        verdict.margins["duration"]
        for one in result.answers
        for verdict in one.verdicts
        if verdict is not None and "duration" in verdict.margins
    ]
    return float(np.nanmedian(times)) if times else float("nan")


def time_columns(comparison: MethodComparison) -> dict[str, list[float]]:
    """Times by heading, a value [s] for each method; without those that no method has."""
    found = {
        "planning": [planning_time(one) for one in comparison.results],
        "motion": [motion_time(one) for one in comparison.results],
    }
    return {name: times for name, times in found.items() if not np.isnan(times).all()}


def _percent(share: float) -> str:
    return format_number(100.0 * share, 0)


def _measure_table(
    comparison: MethodComparison, title: str, heads: dict[str, str], *, with_times: bool = False
) -> TableText:
    rows = []
    known = comparison.measures[comparison.names[0]]
    heads = {name: head for name, head in heads.items() if name in known}
    times = time_columns(comparison) if with_times else {}
    for k, result in enumerate(comparison.results):
        measures = comparison.measures[result.document.name]
        cells = [measure_text(measures[name], name) for name in heads]
        durations = [format_duration(column[k]) for column in times.values()]
        rows.append((result.document.name, *cells, *durations))
    meanings = [f"{head}: {MEASURE_MEANINGS[name]}" for name, head in heads.items()]
    if with_times:
        meanings += [f"{name}: median time of {TIME_MEANINGS[name]}" for name in times]
        meanings.append(
            "in percent, in parentheses the 95 % confidence interval over scenes, in brackets the"
            " range that contested verdicts leave open: trials that a small change would turn over"
        )
    head = ("method", *heads.values(), *times)
    return TableText(title, head, tuple(rows), "\n".join(meanings))


def _answer_table(comparison: MethodComparison) -> TableText:
    rows = []
    for result in comparison.results:
        answers = [one.answer for one in result.answers]
        counts = (
            len(answers),
            sum(bool(one.error) for one in answers),
            sum(not one.error and not one.answered for one in answers),
            sum(one.answered for one in answers),
            sum(len(one.grasps) for one in answers),
            sum(not one.is_judged for one in result.answers),
        )
        rows.append((result.document.name, *map(str, counts)))
    caption = (
        "failed: images without an answer that could be read\n"
        "empty: images with an answer without grasps\n"
        "judged: the best grasps within the budget, without those near a better one\n"
        "left out: images of scenes that could not be judged, which count nowhere"
    )
    head = ("method", "images", "failed", "empty", "grasps", "judged", "left out")
    return TableText("Answers", head, tuple(rows), caption)


def _difference_table(differences: Sequence[MethodDifference]) -> TableText:
    rows = tuple(
        (
            f"{d.first} - {d.second}",
            SUCCESS_MEASURES[d.measure],
            _difference_text(d),
            format_number(d.p_value),
            format_number(d.corrected),
            "yes" if d.is_significant else "not significant",
        )
        for d in differences
    )
    caption = (
        "difference: in percentage points with its 95 % confidence interval, on the same scenes\n"
        "p: paired permutation test over scenes; corrected by Holm for the pairs of a measure\n"
        f"differ: yes if the corrected p is below {SIGNIFICANCE_LEVEL:g}; otherwise these scenes do"
        " not show a difference, which does not mean that there is none"
    )
    head = ("methods", "measure", "difference", "p", "corrected", "differ")
    return TableText("Differences", head, rows, caption)


def _difference_text(d: MethodDifference) -> str:
    interval = "" if np.isnan(d.low) else f" ({_signed(d.low)} to {_signed(d.high)})"
    return f"{_signed(d.difference)}{interval}"


def _signed(share: float) -> str:
    return f"{100.0 * share:+.0f}"
