"""The report of a run over many scenes: one page for all, from which each scene's is reached."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from functools import partial
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.files import atomic_write
from burg_drake.core.grasps import Outcome, Stage
from burg_drake.core.terminal import format_count
from burg_drake.evaluation.records import LEDGER_FILE, engine_label
from burg_drake.evaluation.report.elements import (
    Html,
    closing_section,
    element,
    groups_of_codes,
    header,
    html_page,
)
from burg_drake.evaluation.report.sections import (
    CHOSEN,
    FURTHER,
    MARGINS_ASKED,
    CauseRows,
    campaign_facts,
    cascade_section,
    causes_section,
    certainty_section,
    cost_section,
    count_section,
    further_margins,
    margin_section,
    object_pictures,
    objects_section,
    opening_section,
    repeat_campaign,
    scenes_section,
)
from burg_drake.evaluation.results import Summary, summarize
from burg_drake.evaluation.store import REPORT_FILE, SCENES_FOLDER, Campaign, StoredRows, Texts

TEXTS = ("object", "blocker", "outcome", "stage")
POSES = ("x", "y", "z", "qw", "qx", "qy", "qz", "width")


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
    document, summary = campaign.document, summarize(campaign)
    number = len(campaign.names)
    title = f"{format_count(number)} scene{'' if number == 1 else 's'} on {document.station.name}"
    names = {*CHOSEN, *FURTHER, *MARGINS_ASKED, *TEXTS, *POSES, "id"}
    stored = campaign.rows(sorted(names))
    outcomes = _members(stored, "outcome", [outcome.value for outcome in Outcome])
    groups = groups_of_codes(outcomes)
    tried, own = _tried(stored, groups)
    return html_page(
        f"Grasp evaluation: {title}",
        header("Grasp evaluation of many scenes", title, _about(campaign)),
        _notice(campaign, summary),
        opening_section(summary),
        scenes_section(summary.scenes, partial(_link, campaign), partial(_drill_down, campaign)),
        cascade_section(summary),
        objects_section(summary),
        certainty_section(summary),
        object_pictures(campaign, stored, groups),
        causes_section(_rows(campaign, stored, outcomes)),
        margin_section(tried, own, document.trial),
        repeat_campaign(campaign),
        closing_section(
            count_section(summary),
            further_margins(tried, own),
            cost_section(summary),
            campaign_facts(campaign),
        ),
    )


def _about(campaign: Campaign) -> str:
    document = campaign.document
    how = "sampled" if document.grasps.origin == "sampled" else "given"
    day = document.stretches[0].started[:10] if document.stretches else ""
    about = f"{how} grasps, mode {document.mode}, engine {engine_label(document.engine)}"
    return f"{about}, seed {document.seed}{', ' if day else ''}{day}"


def _notice(campaign: Campaign, summary: Summary) -> Html | None:
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


def _link(campaign: Campaign, name: str) -> str | None:
    """Where the report of a scene is, from that of all."""
    there = (campaign.folder(name) / REPORT_FILE).is_file()
    return quote(f"{SCENES_FOLDER}/{name}/{REPORT_FILE}") if there else None


def _drill_down(campaign: Campaign, name: str) -> str:
    """The command that makes the report of a scene."""
    return shlex.join(["burg-drake", "report", str(campaign.folder(name))])


def _members(stored: StoredRows, name: str, members: list[str]) -> NDArray[np.int8]:
    """A column of texts (N,) as places among the members."""
    codes, texts = stored.codes(name)
    return np.array([members.index(text) for text in texts], dtype=np.int8)[codes]


def _tried(
    stored: StoredRows, groups: NDArray[np.int8]
) -> tuple[Mapping[str, Array], NDArray[np.int8]]:
    """Margins of grasps that came to a trial, and their groups."""
    stages = [stage.value for stage in Stage]
    tried = _members(stored, "stage", stages) == stages.index(Stage.EXECUTED)
    return {name: stored.column(name)[tried] for name in (*CHOSEN, *FURTHER)}, groups[tried]


def _rows(campaign: Campaign, stored: StoredRows, outcomes: NDArray[np.int8]) -> CauseRows:
    ends = np.cumsum(stored.counts)

    def replay(row: int) -> str:
        name = campaign.names[int(np.searchsorted(ends, row, side="right"))]
        id = stored.table.column("id")[row].as_py()
        return shlex.join(["burg-drake", "replay", str(campaign.folder(name)), "--grasp", id])

    return CauseRows(
        outcomes=outcomes,
        objects=Texts(*stored.codes("object")),
        blockers=Texts(*stored.codes("blocker")),
        margins={name: stored.column(name) for name in MARGINS_ASKED},
        replay=replay,
    )
