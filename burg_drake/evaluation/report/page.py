"""The report of a run for people: one HTML page that needs nothing else.

It answers in the order in which a reader asks: what came out, where grasps were lost, on which
objects, how they look, why they fail, by which margin; what the arm reaches; and how to repeat it.
Tables for closer study follow, folded.
"""

from __future__ import annotations

import math

from burg_drake.core.files import atomic_write
from burg_drake.core.terminal import format_count
from burg_drake.evaluation.records import engine_label
from burg_drake.evaluation.report.elements import (
    Html,
    closing_section,
    element,
    group_indices,
    header,
    html_page,
)
from burg_drake.evaluation.report.sections import (
    arm_section,
    best_section,
    cascade_section,
    causes_section,
    certainty_section,
    collision_section,
    cost_section,
    count_section,
    disturbed_section,
    execution_section,
    failure_section,
    further_margins,
    grasp_section,
    margin_section,
    objects_section,
    opening_section,
    pictures_of,
    provenance,
    reachability_section,
    repeat_section,
    rows_of_run,
    scene_picture,
    tried_margins,
)
from burg_drake.evaluation.results import summarize
from burg_drake.evaluation.store import Run


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
    pictures, tried = pictures_of(run, groups), tried_margins(columns, groups)
    title = f"{run.document.scene.name} on {run.document.station.name}"
    return html_page(
        f"Grasp evaluation: {title}",
        header("Grasp evaluation", title, _about(run)),
        _notice(run),
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
        closing_section(
            best_section(run),
            count_section(summary),
            arm_section(summary, columns),
            collision_section(columns),
            disturbed_section(columns, disturbance),
            further_margins(*tried),
            failure_section(run),
            cost_section(summary),
            provenance(run),
        ),
    )


def _about(run: Run) -> str:
    document = run.document
    how = "sampled" if document.grasps.origin == "sampled" else "given"
    day = document.stretches[0].started[:10] if document.stretches else ""
    engine = engine_label(document.engine)
    about = (
        f"{format_count(document.grasps.count)} {how} grasps, mode {document.mode}, engine {engine}"
    )
    about += f", seed {document.seed}"
    return f"{about}{', ' if day else ''}{day}"


def _notice(run: Run) -> Html | None:
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
