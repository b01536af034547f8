"""The leaderboard: one self-contained page with the methods of any number of suites."""

from __future__ import annotations

import base64
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

import numpy as np

from burg_drake.benchmark.benchmark_folder import SUITE_FILE, JudgedAnswer, Round
from burg_drake.benchmark.method_comparison import MethodComparison
from burg_drake.benchmark.method_tables import (
    CLEARING_MEASURES,
    STEP_MEASURES,
    SUCCESS_MEASURES,
    TableText,
    comparison_tables,
    further_tables,
    measure_text,
    time_columns,
)
from burg_drake.benchmark.robustness import without_effects
from burg_drake.benchmark.suite import load_suite
from burg_drake.cameras import encode_jpeg
from burg_drake.core import (
    NO_VALUE,
    Listener,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    atomic_write,
    count_with_noun,
    format_duration,
    outcome_label,
)
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
_PACKAGES = ("burg_drake", "drake")
"""Packages whose versions are shown."""


@dataclass(frozen=True, kw_only=True)
class LeaderboardExtras:
    """What a leaderboard shows besides the tables of its comparisons.

    Attributes:
        sheets: contents of trials files, for success on a robot.
        replays: pages of replays, by folder of the run and id of the grasp.
        pictures: JPEG of each scene, by hash of the suite and name of the scene.
    """

    sheets: Sequence[TrialSheet] = ()
    replays: Mapping[tuple[Path, str], Path] = field(default_factory=dict)
    pictures: Mapping[tuple[str, str], bytes] = field(default_factory=dict)


def write_leaderboard(
    comparisons: Sequence[MethodComparison],
    path: str | Path,
    *,
    extras: LeaderboardExtras | None = None,
) -> Path:
    """Writes the leaderboard; links to reports and replays are relative to the page.

    Args:
        comparisons: methods of each suite.
        path: file to write (.html).
        extras: trials, replays and pictures; none if None.
    """
    path = Path(path)
    extras = extras or LeaderboardExtras()
    methods = len({name for one in comparisons for name in one.names})
    suites = [one.results[0].suite.name for one in comparisons]
    script, style = (
        (files("burg_drake.benchmark") / f"leaderboard.{kind}").read_text(encoding="utf-8")
        for kind in ("js", "css")
    )
    shown = without_effects(comparisons)
    parts = [part for one in shown for part in _suite_sections(one, path.parent, extras)]
    parts += [
        section(one.title, summary, _text_table(one), _caption(one))
        for one, summary in further_tables(comparisons, extras.sheets)
    ]
    parts.append(_method_section(comparisons, path.parent))
    page = html_page(
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
    atomic_write(path, page)
    return path


def failed_grasps(comparisons: Sequence[MethodComparison], count: int) -> list[tuple[Path, str]]:
    """Failures to replay: for each method up to `count` best grasps of an image that did not lift
    their object, different outcomes first. Folder of the run and id of each grasp."""
    found: list[tuple[Path, str]] = []
    for comparison in without_effects(comparisons):
        for result in comparison.results:
            first = result.rounds[0]
            seen: Counter[Outcome] = Counter()
            ranked = []
            for k, one in enumerate(result.answers):
                verdict = one.verdicts[0] if one.verdicts else None
                if verdict is not None and verdict.outcome is not Outcome.LIFTED:
                    run = first.run_folder(one.answer.scene)
                    ranked.append((seen[verdict.outcome], k, run, one.ids[0]))
                    seen[verdict.outcome] += 1
            found += [(run, id) for _, _, run, id in sorted(ranked)[:count]]
    return found


def scene_pictures(
    comparisons: Sequence[MethodComparison], *, progress: bool | Listener = False
) -> dict[tuple[str, str], bytes]:
    """What the first camera of each suite sees, as small JPEG by hash of the suite and scene.

    Args:
        comparisons: methods of each suite.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        BurgError: the objects of a suite are not at hand, or there is no renderer of colours.
    """
    import cv2

    width = 320  # pixels
    found: dict[tuple[str, str], bytes] = {}
    total = sum(len(one.results[0].scene_names) for one in comparisons)
    with Reporter(progress) as reporter:
        meter = ProgressMeter(reporter.show, Progress("rendering", total=total, unit="scenes"))
        for comparison in comparisons:
            result = comparison.results[0]
            suite = load_suite(result.path / SUITE_FILE)
            camera = replace(suite.document.cameras[0], noise=False, color=True).scene_camera()
            image = camera.intrinsics
            size = (width, round(width * image.height / image.width))
            scenes = {**suite.scenes("test"), **suite.scenes("tuning")}
            for name in result.scene_names:
                key = (result.document.suite_hash, name)
                if key not in found:
                    color = camera.observe(scenes[name], suite.station).color
                    assert color is not None
                    small = cv2.resize(color, size, interpolation=cv2.INTER_AREA)
                    found[key] = encode_jpeg(small, 80)
                meter.step()
    return found


def _suite_sections(
    comparison: MethodComparison, folder: Path, extras: LeaderboardExtras
) -> list[Html]:
    success, steps, answers, *others = comparison_tables(comparison)
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
    found.append(
        section(
            answers.title,
            "What the planners answered, and how much of it was judged.",
            _text_table(answers),
            _caption(answers),
        )
    )
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
            "How it ended. An outcome opens the report of the scene's grasps; the command below"
            " shows the grasp with an id again.",
            _scene_table(comparison, folder, extras),
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
    times = time_columns(comparison) if with_times else {}
    for k, result in enumerate(comparison.results):
        measures = comparison.measures[result.document.name]
        cells = [element("th", result.document.name, scope="row")]
        cells += [
            element(
                "td",
                measure_text(measures[name], name),
                class_="number",
                data_value=_sortable(measures[name].value),
            )
            for name in names
        ]
        for column in times.values():
            text, value = format_duration(column[k]), _sortable(column[k])
            cells.append(element("td", text, class_="number", data_value=value))
        rows.append(element("tr", *cells))
    head = ["method", *(heads[name] for name in names), *times]
    return table(head, rows, numbers=range(1, len(head)), style="sortable")


def _sortable(value: float) -> str:
    return "-1" if np.isnan(value) else f"{value:.9g}"


def _text_table(text: TableText) -> Html:
    rows = [
        element("tr", element("th", row[0], scope="row"), *number_cells(row[1:]))
        for row in text.rows
    ]
    return table(text.head, rows, numbers=range(1, len(text.head)), style="sortable")


def _method_section(comparisons: Sequence[MethodComparison], folder: Path) -> Html:
    """Which planner each result is of, where it lies, and the versions of its software."""
    rows = []
    for result in (result for one in comparisons for result in one.results):
        known = result.document
        cells = [
            element("th", known.name, scope="row"),
            element("td", known.suite),
            element("td", str(known.conditions)),
            element("td", element("code", known.planner)),
            element("td", element("a", result.path.name, href=_address(result.path, folder))),
            element("td", ", ".join(f"{n} {known.versions.get(n, NO_VALUE)}" for n in _PACKAGES)),
            *number_cells([format_duration(known.times.total)]),
        ]
        rows.append(element("tr", *cells))
    head = (
        *("method", "suite", "conditions", "planner", "result", "versions"),
        "run time",
    )
    return section(
        "Results",
        "Which planner each result is of, where it lies, and with which versions it was made.",
        table(head, rows, numbers=range(6, len(head)), style="sortable"),
    )


def _address(path: Path, folder: Path) -> str:
    """Relative address of a file for a page in a folder."""
    return quote(os.path.relpath(path.resolve(), folder.resolve()).replace(os.sep, "/"))


def _scene_table(comparison: MethodComparison, folder: Path, extras: LeaderboardExtras) -> Html:
    """How the best grasp of each method ended, by scene and camera."""
    rows = []
    suite_hash = comparison.results[0].document.suite_hash
    firsts = [result.rounds[0] for result in comparison.results]
    for k, (scene, camera) in enumerate(firsts[0].cases):
        label = scene if len(comparison.results[0].suite.cameras) == 1 else f"{scene}, {camera}"
        cells = [
            _best_grasp_cell(first, result.answers[k], folder, extras)
            for first, result in zip(firsts, comparison.results, strict=True)
        ]
        picture = extras.pictures.get((suite_hash, scene))
        head = [label] if picture is None else [_picture(picture, scene), label]
        rows.append(element("tr", element("th", *head, scope="row"), *cells))
    return table(["scene", *comparison.names], rows)


def _picture(jpeg: bytes, scene: str) -> Html:
    data = base64.b64encode(jpeg).decode("ascii")
    return element("img", src=f"data:image/jpeg;base64,{data}", alt=f"scene {scene}", width="160")


def _best_grasp_cell(
    round: Round, answer: JudgedAnswer, folder: Path, extras: LeaderboardExtras
) -> Html:
    if answer.answer.error:
        why = element("details", element("summary", "no answer"), answer.answer.error)
        return element("td", why)
    if not answer.verdicts:
        return element("td", "no grasp")
    if answer.verdicts[0] is None:
        return element("td", "not judged")
    outcome, id = answer.verdicts[0].outcome, answer.ids[0]
    run = round.run_folder(answer.answer.scene)
    content: list[Html | str] = [outcome_label(outcome)]
    if (run / REPORT_FILE).exists():
        content = [element("a", *content, href=_address(run / REPORT_FILE, folder))]
    if (run, id) in extras.replays:
        content += [" ", element("a", "replay", href=_address(extras.replays[run, id], folder))]
    content.append(element("small", id))
    return element("td", *content, class_=f"outcome {OUTCOME_CLASSES[outcome]}")
