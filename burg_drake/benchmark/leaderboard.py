"""The leaderboard: one self-contained page with the methods of any number of suites."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

import numpy as np

from burg_drake.benchmark.benchmark_folder import JudgedAnswer, Round
from burg_drake.benchmark.method_comparison import MethodComparison
from burg_drake.benchmark.method_tables import (
    CLEARING_MEASURES,
    STEP_MEASURES,
    SUCCESS_MEASURES,
    TableText,
    comparison_tables,
    further_tables,
    measure_text,
    planning_time,
)
from burg_drake.benchmark.robustness import without_effects
from burg_drake.core import NO_VALUE, atomic_write, count_with_noun, format_duration, outcome_label
from burg_drake.evaluation import (
    GROUP_CLASSES,
    REPORT_FILE,
    command,
    header,
    html_page,
    number_cells,
    section,
    table,
)
from burg_drake.experiment import TrialSheet
from burg_drake.visualization import OUTCOME_GROUPS, Html, element

OUTCOME_CLASSES = {
    outcome: GROUP_CLASSES[group.name] for group in OUTCOME_GROUPS for outcome in group.outcomes
}
"""CSS class of each outcome."""


def write_leaderboard(
    comparisons: Sequence[MethodComparison],
    path: str | Path,
    *,
    sheets: Sequence[TrialSheet] = (),
) -> Path:
    """Writes the leaderboard; links to reports are relative to the page.

    Args:
        comparisons: methods of each suite.
        path: file to write (.html).
        sheets: contents of trials files, for success on a robot.
    """
    path = Path(path)
    atomic_write(path, leaderboard_page(comparisons, path.parent, sheets))
    return path


def leaderboard_page(
    comparisons: Sequence[MethodComparison], folder: Path, sheets: Sequence[TrialSheet] = ()
) -> str:
    """The page as HTML.

    Args:
        comparisons: methods of each suite.
        folder: folder of the page.
        sheets: contents of trials files.
    """
    methods = len({name for one in comparisons for name in one.names})
    suites = [one.results[0].suite.name for one in comparisons]
    script, style = (
        (files("burg_drake.benchmark") / f"leaderboard.{kind}").read_text(encoding="utf-8")
        for kind in ("js", "css")
    )
    parts = [part for one in without_effects(comparisons) for part in _suite_sections(one, folder)]
    parts += [
        section(one.title, summary, _text_table(one), _caption(one))
        for one, summary in further_tables(comparisons, sheets)
    ]
    return html_page(
        "Grasp planners compared",
        element("style", Html(style)),
        header(
            "Benchmark",
            "Grasp planners compared",
            f"{count_with_noun(methods, 'method')} on {', '.join(dict.fromkeys(suites))};"
            " click a heading to sort by it",
        ),
        *parts,
        element("script", Html(script)),
    )


def _suite_sections(comparison: MethodComparison, folder: Path) -> list[Html]:
    success, steps, *others = comparison_tables(comparison)
    suite = comparison.results[0].suite
    found = [
        section(
            success.title,
            suite.description,
            _measure_table(comparison, SUCCESS_MEASURES, with_times=True),
            _caption(success),
        ),
        section(
            steps.title,
            "Of all judged grasps, the share that passed each stage: where a method loses.",
            _measure_table(comparison, STEP_MEASURES),
            _caption(steps),
        ),
    ]
    if comparison.results[0].document.protocol == "clear":
        clearing = others.pop(0)
        found.append(
            section(
                clearing.title,
                "Objects that were taken away, with one executed grasp for each image.",
                _measure_table(comparison, CLEARING_MEASURES),
                _caption(clearing),
            )
        )
    found += [
        section(one.title, "Pairs of methods on the same scenes.", _text_table(one), _caption(one))
        for one in others
    ]
    found.append(
        section(
            f"The best grasp in each scene of {suite.name}",
            "How it ended. A scene opens the report of its grasps; a failed grasp is shown by the"
            " command below with its id.",
            _scene_table(comparison, folder),
            command("burg-drake replay RESULT/trials/scenes/SCENE --grasp ID"),
        )
    )
    return found


def _caption(text: TableText) -> Html:
    lines = [element("li", line) for line in text.caption.splitlines()]
    return element("ul", *lines, class_="caption")


def _measure_table(
    comparison: MethodComparison, heads: dict[str, str], *, with_times: bool = False
) -> Html:
    """Measures by method, with numbers to sort by."""
    rows = []
    names = [name for name in heads if name in comparison.measures[comparison.names[0]]]
    for result in comparison.results:
        measures = comparison.measures[result.document.name]
        cells = [element("th", result.document.name, scope="row")]
        cells += [
            element(
                "td",
                measure_text(measures[name]),
                class_="number",
                data_value=_sortable(measures[name].value),
            )
            for name in names
        ]
        if with_times:
            seconds = planning_time(result)
            cells.append(
                element(
                    "td", format_duration(seconds), class_="number", data_value=_sortable(seconds)
                )
            )
        rows.append(element("tr", *cells))
    head = ["method", *(heads[name] for name in names), *(["time"] if with_times else [])]
    return table(head, rows, numbers=range(1, len(head)), style="sortable")


def _sortable(value: float) -> str:
    return "-1" if np.isnan(value) else f"{value:.9g}"


def _text_table(text: TableText) -> Html:
    rows = [
        element("tr", element("th", row[0], scope="row"), *number_cells(row[1:]))
        for row in text.rows
    ]
    return table(text.head, rows, numbers=range(1, len(text.head)), style="sortable")


def _scene_table(comparison: MethodComparison, folder: Path) -> Html:
    """How the best grasp of each method ended, by scene and camera."""
    rows = []
    firsts = [result.rounds[0] for result in comparison.results]
    for k, (scene, camera) in enumerate(firsts[0].cases):
        label = scene if len(comparison.results[0].suite.cameras) == 1 else f"{scene}, {camera}"
        cells = [
            _best_grasp_cell(first, result.answers[k], folder)
            for first, result in zip(firsts, comparison.results, strict=True)
        ]
        rows.append(element("tr", element("th", label, scope="row"), *cells))
    return table(["scene", *comparison.names], rows)


def _best_grasp_cell(round: Round, answer: JudgedAnswer, folder: Path) -> Html:
    if answer.answer.error:
        return element("td", "no answer", title=answer.answer.error)
    if not answer.verdicts or answer.verdicts[0] is None:
        return element("td", NO_VALUE, title="no grasp")
    outcome, id = answer.verdicts[0].outcome, answer.ids[0]
    report = round.run_folder(answer.answer.scene) / REPORT_FILE
    content: Html | str = outcome_label(outcome)
    if report.exists():
        address = os.path.relpath(report.resolve(), folder.resolve()).replace(os.sep, "/")
        content = element("a", content, href=quote(address))
    return element("td", content, class_=f"outcome {OUTCOME_CLASSES[outcome]}", title=id)
