"""The report of a run, of one scene or of many, as one self-contained HTML page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from functools import partial
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Outcome, Stage, atomic_write, format_count, format_percent
from burg_drake.evaluation.campaign_folder import LEDGER_FILE, SCENES_FOLDER, Campaign
from burg_drake.evaluation.outcome_counts import OutcomeCounts, Summary, TextValues
from burg_drake.evaluation.report.failure_sections import (
    CAUSE_MARGINS,
    CauseRows,
    arm_section,
    causes_section,
    collision_section,
    disturbed_section,
    execution_section,
    reachability_section,
    rows_of_run,
)
from burg_drake.evaluation.report.grasp_sections import (
    FURTHER_MARGINS,
    MAIN_MARGINS,
    best_section,
    executed_margins,
    failure_section,
    further_margins,
    margin_section,
)
from burg_drake.evaluation.report.outcome_sections import (
    GROUP_COLUMNS,
    cascade_section,
    certainty_section,
    cost_section,
    count_section,
    group_row,
    objects_section,
    opening_section,
    worst_first,
)
from burg_drake.evaluation.report.page_elements import (
    closing_sections,
    command,
    group_indices,
    group_indices_of_codes,
    header,
    html_page,
    number_cells,
    section,
    table,
    table_row,
)
from burg_drake.evaluation.report.pictures import (
    DRAWN_COLUMNS,
    grasp_section,
    object_pictures,
    pictures_of,
    scene_picture,
)
from burg_drake.evaluation.report.reproduction import (
    campaign_provenance_section,
    provenance_section,
    repeat_campaign_section,
    repeat_section,
)
from burg_drake.evaluation.run_document import CampaignDocument, RunDocument
from burg_drake.evaluation.run_folder import REPORT_FILE, Run
from burg_drake.evaluation.run_summary import summarize
from burg_drake.evaluation.table_parts import StoredRows
from burg_drake.evaluation.trial_origin import engine_label
from burg_drake.visualization import Child, Html, element


def write_report(run: Run) -> None:
    """Writes the report of a run, complete or not, into its folder.

    Raises:
        InvalidInputError: it cannot be written.
    """
    atomic_write(run.report_path, report_page(run))


def report_page(run: Run) -> str:
    """The report as HTML."""
    summary, columns = summarize(run), run.results
    groups = group_indices(columns["outcome"])
    disturbance = run.document.trial.get("disturbance", math.inf)
    pictures, tried = pictures_of(run, groups), executed_margins(columns, groups)
    title = f"{run.document.scene.name} on {run.document.station.name}"
    return html_page(
        f"Grasp evaluation: {title}",
        header("Grasp evaluation", title, _about(run.document, run.document.grasps.count)),
        _run_notice(run),
        opening_section(summary),
        scene_picture(pictures),
        cascade_section(summary),
        objects_section(summary),
        certainty_section(summary, run.contested),
        grasp_section(pictures),
        causes_section(rows_of_run(columns, str(run.path))),
        margin_section(*tried, run.document.trial),
        reachability_section(run),
        execution_section(summary, columns),
        repeat_section(run),
        closing_sections(
            best_section(run),
            count_section(summary),
            arm_section(summary, columns),
            collision_section(columns),
            disturbed_section(columns, disturbance),
            further_margins(*tried),
            failure_section(run),
            cost_section(summary),
            provenance_section(run),
        ),
    )


def _run_notice(run: Run) -> Html | None:
    judged, mine = len(run.results["id"]), len(run.mine)
    parts = []
    if run.document.shard:
        number, _, whole = run.document.shard.partition("/")
        parts.append(
            f"This is shard {number} of {whole}: it judges {mine} of the "
            f"{len(run.candidates)} grasps. Merge the shards with burg-drake merge."
        )
    if judged < mine:
        parts.append(
            f"This run is not complete: {judged} of {mine} grasps are judged. Run the"
            " command under “How to repeat it” again to continue it."
        )
    return element("p", " ".join(parts), class_="notice") if parts else None


def write_campaign_report(campaign: Campaign) -> None:
    """Writes the report of a run over many scenes, complete or not, into its folder.

    Raises:
        InvalidInputError: it cannot be written.
        MissingDependencyError: pyarrow is not installed.
    """
    atomic_write(campaign.report_path, campaign_page(campaign))


def renew_report(campaign: Campaign) -> None:
    """Writes the report, unless it is as new as what is known of the scenes.

    Raises:
        InvalidInputError: it cannot be written.
    """
    known, report = campaign.path / LEDGER_FILE, campaign.report_path
    since = known.stat().st_mtime_ns if known.exists() else 0
    if not report.exists() or report.stat().st_mtime_ns < since:
        write_campaign_report(campaign)


def campaign_page(campaign: Campaign) -> str:
    """The report as HTML."""
    text_columns = ("id", "object", "blocker", "outcome", "stage")
    document, summary = campaign.document, summarize(campaign)
    number = len(campaign.names)
    title = f"{format_count(number)} scene{'' if number == 1 else 's'} on {document.station.name}"
    names = {*MAIN_MARGINS, *FURTHER_MARGINS, *CAUSE_MARGINS, *text_columns, *DRAWN_COLUMNS}
    stored = campaign.rows(sorted(names))
    outcomes = _member_indices(stored, "outcome", list(Outcome))
    groups = group_indices_of_codes(outcomes)
    executed = _member_indices(stored, "stage", list(Stage)) == list(Stage).index(Stage.EXECUTED)
    tried = {n: stored.column(n)[executed] for n in (*MAIN_MARGINS, *FURTHER_MARGINS)}
    return html_page(
        f"Grasp evaluation: {title}",
        header("Grasp evaluation of many scenes", title, _about(document)),
        _campaign_notice(campaign, summary),
        opening_section(summary),
        scenes_section(
            summary.scenes, partial(_report_link, campaign), partial(_report_command, campaign)
        ),
        cascade_section(summary),
        objects_section(summary),
        certainty_section(summary),
        object_pictures(campaign, stored, groups),
        causes_section(_cause_rows(campaign, stored, outcomes)),
        margin_section(tried, groups[executed], document.trial),
        repeat_campaign_section(campaign),
        closing_sections(
            count_section(summary),
            further_margins(tried, groups[executed]),
            cost_section(summary),
            campaign_provenance_section(campaign),
        ),
    )


def _about(document: RunDocument | CampaignDocument, count: int | None = None) -> str:
    """Origin and number of the grasps, mode, engine, seed and day of a run."""
    how = "sampled" if document.grasps.origin == "sampled" else "given"
    grasps = f"{how} grasps" if count is None else f"{format_count(count)} {how} grasps"
    facts = [grasps, f"mode {document.mode}", f"engine {engine_label(document.engine)}"]
    facts += [f"seed {document.seed}", *(s.started[:10] for s in document.stretches[:1])]
    return ", ".join(facts)


def _campaign_notice(campaign: Campaign, summary: Summary) -> Html | None:
    parts = []
    if campaign.document.shard:
        number, _, whole = campaign.document.shard.partition("/")
        parts.append(f"This is shard {number} of {whole}. Merge the shards with burg-drake merge.")
    if not campaign.complete:
        judged, expected = format_count(summary.total.judged), format_count(campaign.expected)
        parts.append(
            f"This run is not complete: {judged} of {expected} grasps are judged. Run the"
            " same command again to continue it."
        )
    return element("p", " ".join(parts), class_="notice") if parts else None


def _report_link(campaign: Campaign, name: str) -> str | None:
    """Where the report of a scene is, from that of all."""
    there = (campaign.folder(name) / REPORT_FILE).is_file()
    return quote(f"{SCENES_FOLDER}/{name}/{REPORT_FILE}") if there else None


def _report_command(campaign: Campaign, name: str) -> str:
    """The command that makes the report of a scene."""
    return shlex.join(["burg-drake", "report", str(campaign.folder(name))])


def _member_indices(stored: StoredRows, name: str, members: Sequence[str]) -> NDArray[np.int8]:
    """A column of texts (N,) as indices into the members."""
    codes, texts = stored.codes(name)
    return np.array([members.index(text) for text in texts], dtype=np.int8)[codes]


def _cause_rows(campaign: Campaign, stored: StoredRows, outcomes: NDArray[np.int8]) -> CauseRows:
    ends = np.cumsum(stored.counts)

    def replay(row: int) -> str:
        name = campaign.names[int(np.searchsorted(ends, row, side="right"))]
        id = stored.table.column("id")[row].as_py()
        return shlex.join(["burg-drake", "replay", str(campaign.folder(name)), "--grasp", id])

    return CauseRows(
        outcomes=outcomes,
        objects=TextValues(*stored.codes("object")),
        blockers=TextValues(*stored.codes("blocker")),
        margins={name: stored.column(name) for name in CAUSE_MARGINS},
        replay=replay,
    )


class _Layout:
    """Lengths in the chart of scenes, in SVG units."""

    width = 480
    height = 190
    left = 44  # Edges of the plot.
    right = 474
    top = 8
    bottom = 164


def scenes_section(
    scenes: Sequence[OutcomeCounts],
    link: Callable[[str], str | None],
    drill_down: Callable[[str], str],
) -> Html:
    """Success over scenes, worst first.

    Args:
        scenes: in the order of the run.
        link: where the report of a scene is, from the page; None if it has none.
        drill_down: the command that makes the report of a scene.
    """
    max_shown = 20  # Scenes that are shown with their outcomes.
    ranked = worst_first(scenes)
    shown = ranked[:max_shown]
    rows = [group_row(group, name=_scene_name(group.name, link)) for group in shown]
    how: list[Child] = []
    if any(link(group.name) is None for group in ranked):
        how = [element("p", "This command writes the report of one scene:", class_="note")]
        how.append(command(drill_down(ranked[0].name)))
    text = (
        "Success when executed in each scene with its 95 % interval, worst scene first."
        " Scenes in which nothing was executed come first and have no dot."
    )
    more = f" Below are the {max_shown} worst." if len(ranked) > max_shown else ""
    return section(
        "Outcomes by scene",
        text + more,
        ranked_chart(ranked),
        table(["scene", *GROUP_COLUMNS], rows, numbers=(1, 3), style="stacking"),
        *how,
        _all_scenes(ranked, link) if len(ranked) > max_shown else None,
    )


def ranked_chart(ranked: Sequence[OutcomeCounts]) -> Html:
    """A dot with its interval for each scene, from the worst on the left to the best."""
    step = (_Layout.right - _Layout.left) / max(len(ranked), 1)
    places = [_Layout.left + (k + 0.5) * step for k in range(len(ranked))]
    tried = [(x, group) for x, group in zip(places, ranked, strict=True) if group.executed]
    whiskers = "".join(
        f"M{x:.1f} {_share_y(group.interval[0]):.1f}V{_share_y(group.interval[1]):.1f}"
        for x, group in tried
    )
    marks: list[Child] = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y, text = f"{_share_y(share):.1f}", f"{100 * share:.0f} %"
        marks += [
            element("line", x1=_Layout.left, x2=_Layout.right, y1=y, y2=y, class_="grid"),
            element("text", text, x=_Layout.left - 6, y=y, dy="0.35em", class_="end"),
        ]
    label = f"{format_count(len(ranked))} scenes, worst to best"
    width = f"stroke-width:{min(max(0.5 * step, 0.5), 2.5):.2f}"
    return element(
        "svg",
        *marks,
        element("path", d=whiskers, class_="whiskers", style=width) if whiskers else None,
        *_scene_dots(tried, step),
        element("text", label, x=_Layout.left, y=_Layout.height - 6, class_="title"),
        viewBox=f"0 0 {_Layout.width} {_Layout.height}",
        class_="histogram ranked",
        role="img",
        aria_label=f"Success when executed of {_chart_description(ranked)}",
    )


def _scene_dots(tried: Sequence[tuple[float, OutcomeCounts]], step: float) -> list[Html]:
    max_named = 200  # With more scenes, dots do not tell their names.
    radius = min(max(0.35 * step, 0.8), 3.2)
    dots = []
    for x, group in tried:
        share = group.lifted / group.executed
        tip = f"{group.name}: {group.lifted} of {group.executed}, {format_percent(share)}"
        name = element("title", tip) if len(tried) <= max_named else None
        place = {"cx": f"{x:.1f}", "cy": f"{_share_y(share):.1f}", "r": f"{radius:.1f}"}
        dots.append(element("circle", *([name] if name else []), **place, class_="dot"))
    return dots


def _chart_description(ranked: Sequence[OutcomeCounts]) -> str:
    shares = [group.lifted / group.executed for group in ranked if group.executed]
    if not shares:
        return f"{len(ranked)} scenes: nothing was executed"
    return (
        f"{len(ranked)} scenes: from {format_percent(min(shares))} to {format_percent(max(shares))}"
    )


def _share_y(share: float) -> float:
    return _Layout.bottom - (_Layout.bottom - _Layout.top) * share


def _scene_name(name: str, link: Callable[[str], str | None]) -> Child:
    target = link(name)
    return name if target is None else element("a", name, href=target)


def _all_scenes(ranked: Sequence[OutcomeCounts], link: Callable[[str], str | None]) -> Html:
    max_listed = 2000  # Scenes that are listed.
    rows = []
    for group in ranked[:max_listed]:
        share = interval = "-"
        if group.executed:
            low, high = (f"{100 * bound:.0f}" for bound in group.interval)
            share, interval = format_percent(group.lifted / group.executed), f"{low} to {high} %"
        counts = map(format_count, (group.judged, group.executed, group.lifted))
        cells = number_cells([*counts, share, interval])
        rows.append(table_row(_scene_name(group.name, link), *cells))
    head = ["scene", "grasps", "executed", "lifted", "success", "95 % interval"]
    title = f"All {format_count(len(ranked))} scenes"
    if len(ranked) > max_listed:
        title = f"The {format_count(max_listed)} worst of {format_count(len(ranked))} scenes"
    summary = element("summary", element("h3", title))
    listed = table(head, rows, numbers=(1, 2, 3, 4, 5))
    return element("details", summary, listed, class_="screen")
