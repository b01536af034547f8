"""The report of a run, of one scene or of many, as one self-contained HTML page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    CONTESTED_CONFIDENCE,
    Outcome,
    Stage,
    atomic_write,
    count_with_noun,
    format_count,
)
from burg_drake.evaluation.campaign_folder import SCENE_STATES_FILE, SCENES_FOLDER, Campaign
from burg_drake.evaluation.outcome_counts import OutcomeCounts, Summary, member_codes
from burg_drake.evaluation.report.failure_sections import (
    CAUSE_MARGINS,
    CauseRows,
    arm_section,
    collision_section,
    disturbed_section,
    execution_section,
    find_causes,
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
    margin_charts,
)
from burg_drake.evaluation.report.outcome_sections import (
    CERTAINTY_CLASSES,
    CountedBar,
    cascade_steps,
    certainty_bars,
    cost_section,
    count_section,
    early_losses,
    object_bars,
    outcome_bar,
    spread_sentences,
    success_interval,
    worst_first,
)
from burg_drake.evaluation.report.page_elements import (
    GROUP_CLASSES,
    group_indices,
    group_indices_of_codes,
    group_legend,
    group_style,
    present_groups,
)
from burg_drake.evaluation.report.pictures import (
    DRAWN_COLUMNS,
    instance_figures,
    object_pictures,
    scene_as_judged,
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
from burg_drake.evaluation.trial_origin import engine_label, protocol_of
from burg_drake.visualization import (
    OUTCOME_GROUPS,
    Html,
    RankedShare,
    interval_mark,
    ranked_chart,
    render_page,
)


def write_report(run: Run) -> None:
    """Writes the report of a run, complete or not, into its folder.

    Raises:
        InvalidInputError: it cannot be written.
    """
    atomic_write(run.report_path, report_page(run))


def report_page(run: Run) -> str:
    """The report as HTML."""
    summary, columns, document = summarize(run), run.rows(), run.document
    groups = group_indices(columns.codes("outcome"))
    disturbance = document.trial.get("disturbance", math.inf)
    scene, tried = scene_as_judged(run), executed_margins(columns, groups)
    closing = (
        best_section(run),
        count_section(summary),
        arm_section(summary, columns),
        collision_section(columns),
        disturbed_section(columns, disturbance),
        further_margins(*tried),
        failure_section(run),
        cost_section(summary),
        provenance_section(run),
    )
    return _render_report(
        summary,
        title=f"{document.scene.name} on {document.station.name}",
        about=_run_description(document, document.grasps.count),
        notice=_run_notice(run),
        scene_picture=scene_picture(scene, columns, groups) if scene else None,
        scenes=None,
        contested=run.contested,
        pictures=instance_figures(scene, columns, groups) if scene else None,
        causes=find_causes(rows_of_run(columns, str(run.path))),
        margins=margin_charts(*tried, document.trial),
        executed_groups=group_legend(present_groups(tried[1])),
        reach=reachability_section(run),
        execution=execution_section(summary, columns),
        repeat=repeat_section(run),
        closing=closing,
    )


def _render_report(summary: Summary, **values: object) -> str:
    """The page of a run, of one scene or of many, from its summary."""
    present = [g for g in OUTCOME_GROUPS if any(summary.total.outcomes[o] for o in g.outcomes)]
    return render_page(
        "evaluation/report/report.html.jinja",
        group_style=group_style(),
        interval_mark=interval_mark,
        summary=summary,
        interval_of_all=success_interval(summary, executed=False),
        interval_of_executed=success_interval(summary, executed=True),
        early_losses=early_losses(summary),
        spread_sentences=spread_sentences(summary),
        steps=cascade_steps(summary),
        objects=object_bars(summary),
        present_groups=[(GROUP_CLASSES[g.name], g.name) for g in present],
        certainty=certainty_bars(summary),
        certainty_legend=[(style, name) for name, style in CERTAINTY_CLASSES.items()],
        contested_confidence=CONTESTED_CONFIDENCE,
        **values,
    )


def _run_notice(run: Run) -> str:
    judged, mine = run.rows().count, len(run.assigned_ids)
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
    return " ".join(parts)


def write_campaign_report(campaign: Campaign) -> None:
    """Writes the report of a run over many scenes, complete or not, into its folder.

    Raises:
        InvalidInputError: it cannot be written.
        MissingDependencyError: pyarrow is not installed.
    """
    atomic_write(campaign.report_path, campaign_page(campaign))


def renew_report(campaign: Campaign) -> None:
    """Writes the report unless it is newer than all results of the scenes.

    Raises:
        InvalidInputError: it cannot be written.
    """
    known, report = campaign.path / SCENE_STATES_FILE, campaign.report_path
    since = known.stat().st_mtime_ns if known.exists() else 0
    if not report.exists() or report.stat().st_mtime_ns < since:
        write_campaign_report(campaign)


def campaign_page(campaign: Campaign) -> str:
    """The report as HTML."""
    text_columns = ("id", "object", "blocker", "outcome", "stage")
    document, summary = campaign.document, summarize(campaign)
    number = len(campaign.names)
    scenes = count_with_noun(number, "scene")
    names = {*MAIN_MARGINS, *FURTHER_MARGINS, *CAUSE_MARGINS, *text_columns, *DRAWN_COLUMNS}
    stored = campaign.rows(sorted(names))
    outcomes = member_codes(stored.codes("outcome"), tuple(Outcome))
    groups = group_indices_of_codes(outcomes)
    stages = member_codes(stored.codes("stage"), tuple(Stage))
    executed = stages == list(Stage).index(Stage.EXECUTED)
    tried = {n: stored.column(n)[executed] for n in (*MAIN_MARGINS, *FURTHER_MARGINS)}
    closing = (
        count_section(summary),
        further_margins(tried, groups[executed]),
        cost_section(summary),
        campaign_provenance_section(campaign),
    )
    return _render_report(
        summary,
        title=f"{scenes} on {document.station.name}",
        about=_run_description(document),
        notice=_campaign_notice(campaign, summary),
        scene_picture=None,
        scenes=_scene_shares(campaign, summary.scenes),
        contested=(),
        pictures=object_pictures(campaign, stored, groups),
        causes=find_causes(_cause_rows(campaign, stored, outcomes)),
        margins=margin_charts(tried, groups[executed], document.trial),
        executed_groups=group_legend(present_groups(groups[executed])),
        reach=None,
        execution=None,
        repeat=repeat_campaign_section(campaign),
        closing=closing,
    )


def _run_description(document: RunDocument | CampaignDocument, count: int | None = None) -> str:
    """Origin and number of the grasps, mode and protocol, engine, seed and day of a run."""
    how = "sampled" if document.grasps.origin == "sampled" else "given"
    grasps = f"{how} grasps" if count is None else f"{format_count(count)} {how} grasps"
    mode = f"mode {document.mode}"
    if (protocol := protocol_of(document.trial)) != "lift":
        mode += f", protocol {protocol}"
    facts = [grasps, mode, f"engine {engine_label(document.engine)}"]
    facts += [f"seed {document.seed}", *(s.started[:10] for s in document.stretches[:1])]
    return ", ".join(facts)


def _campaign_notice(campaign: Campaign, summary: Summary) -> str:
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
    return " ".join(parts)


def _report_link(campaign: Campaign, name: str) -> str:
    """Relative link from the report of all scenes to a scene's report; empty if there is none."""
    there = (campaign.folder(name) / REPORT_FILE).is_file()
    return quote(f"{SCENES_FOLDER}/{name}/{REPORT_FILE}") if there else ""


def _report_command(campaign: Campaign, name: str) -> str:
    """Command that writes the report of a scene."""
    return shlex.join(["burg-drake", "report", str(campaign.folder(name))])


def _cause_rows(campaign: Campaign, stored: StoredRows, outcomes: NDArray[np.int8]) -> CauseRows:
    ends = np.cumsum(stored.counts)

    def replay(row: int) -> str:
        name = campaign.names[int(np.searchsorted(ends, row, side="right"))]
        id = stored.table.column("id")[row].as_py()
        return shlex.join(["burg-drake", "replay", str(campaign.folder(name)), "--grasp", id])

    return CauseRows(
        outcomes=outcomes,
        objects=stored.codes("object"),
        blockers=stored.codes("blocker"),
        margins={name: stored.column(name) for name in CAUSE_MARGINS},
        replay=replay,
    )


@dataclass(frozen=True)
class SceneShares:
    """Success by scene, worst first.

    Attributes:
        number: number of scenes.
        chart: chart with a dot for each scene.
        links: relative links to the reports of scenes by name; empty if there is none.
        worst: scenes that are shown with their outcomes.
        listed: all scenes, or the worst if there are too many.
        command: command that writes the report of one scene; empty if all scenes have one.
    """

    number: int
    chart: Html
    links: Mapping[str, str]
    worst: Sequence[CountedBar]
    listed: Sequence[OutcomeCounts]
    command: str


def _scene_shares(campaign: Campaign, scenes: Sequence[OutcomeCounts]) -> SceneShares:
    """Success over scenes, worst first."""
    max_shown, max_listed = 20, 2000  # Scenes with their outcomes, and in the list of all.
    ranked = worst_first(scenes)
    links = {counts.name: _report_link(campaign, counts.name) for counts in ranked}
    shares = [RankedShare(c.name, c.lifted, c.executed, c.interval) for c in ranked]
    return SceneShares(
        number=len(ranked),
        chart=ranked_chart(shares),
        links=links,
        worst=[outcome_bar(counts) for counts in ranked[:max_shown]],
        listed=ranked[:max_listed] if len(ranked) > max_shown else (),
        command="" if all(links.values()) else _report_command(campaign, ranked[0].name),
    )
