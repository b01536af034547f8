"""The report of a run for people: one HTML page that needs nothing else."""

from __future__ import annotations

import math

from burg_drake.core.figures import duration, percent
from burg_drake.core.files import atomic_write
from burg_drake.evaluation.origin import engine_label
from burg_drake.evaluation.report.arm import arm_section, execution_section
from burg_drake.evaluation.report.bodies import collision_section, disturbed_section
from burg_drake.evaluation.report.grasps import best_section, failure_section, margin_section
from burg_drake.evaluation.report.markup import Child, Html, element
from burg_drake.evaluation.report.outcomes import (
    cost_section,
    count_section,
    funnel_section,
    objects_section,
)
from burg_drake.evaluation.report.provenance import provenance
from burg_drake.evaluation.report.reachability import reachability_section
from burg_drake.evaluation.report.style import style_sheet
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.summary import Summary, summarize


def write_report(run: Run) -> None:
    """Writes the report of a run, complete or not, into its folder.

    Raises:
        InvalidInputError: it cannot be written.
    """
    atomic_write(run.report_path, report_page(run))


def report_page(run: Run) -> str:
    """The report as HTML."""
    summary, columns = summarize(run), run.results
    title = f"{run.document.scene.name} on {run.document.station.name}"
    sections = [
        _header(run, title),
        _notice(run),
        _tiles(summary),
        objects_section(summary),
        funnel_section(summary),
        count_section(summary),
        collision_section(columns),
        arm_section(summary, columns),
        reachability_section(run),
        execution_section(summary, columns),
        margin_section(columns),
        disturbed_section(columns, run.document.trial.get("disturbance", math.inf)),
        best_section(run),
        failure_section(run),
        cost_section(summary),
        provenance(run),
    ]
    return "<!DOCTYPE html>\n" + element(
        "html",
        element(
            "head",
            element("meta", charset="utf-8"),
            element("meta", name="viewport", content="width=device-width, initial-scale=1"),
            element("title", f"Grasp evaluation: {title}"),
            element("style", Html(style_sheet())),
        ),
        element("body", *sections),
        lang="en",
    )


def _header(run: Run, title: str) -> Html:
    document = run.document
    count = document.grasps.count
    how = "sampled" if document.grasps.origin == "sampled" else "given"
    day = document.stretches[0].started[:10] if document.stretches else ""
    engine = engine_label(document.engine)
    about = f"{count} {how} grasps, engine {engine}, seed {document.seed}"
    return element(
        "header",
        element("p", "Grasp evaluation", class_="kind"),
        element("h1", title),
        element("p", f"{about}{', ' if day else ''}{day}", class_="about"),
    )


def _notice(run: Run) -> Html | None:
    judged, total = len(run.results["id"]), len(run.mine)
    text = ""
    if run.document.shard:
        number, _, count = run.document.shard.partition("/")
        text = (
            f"This is shard {number} of {count}: of {len(run.candidates)} grasps {total} are judged"
            " here. burg-drake merge unites the shards. "
        )
    if judged < total:
        text += (
            f"This run is not complete: {judged} of {total} grasps are judged. The command at the"
            " end of this page goes on with it."
        )
    return element("p", text.strip(), class_="notice") if text else None


def _tiles(summary: Summary) -> Html:
    total = summary.total
    low, high = total.interval
    share = percent(total.lifted / total.executed) if total.executed else "-"
    interval = f"{100 * low:.0f} to {100 * high:.0f} % (95 % interval)" if total.executed else ""
    trial = next((c for c in summary.costs if c.name == "executed"), None)
    screened = "clear" if summary.mode == "hand" else "clear and feasible for the arm"
    by_arm = "; by the whole arm" if summary.mode == "arm" else ""
    disturbed = total.held - total.lifted
    disturbing = f"; {disturbed} more disturbed others" if disturbed else ""
    tiles: list[tuple[str, Child, str]] = [
        ("Grasps judged", total.judged, f"on {len(summary.objects)} objects"),
        ("Executed", total.executed, f"those found {screened}{by_arm}"),
        ("Lifted", total.lifted, f"of {total.executed} executed{disturbing}"),
        ("Success when executed", share, interval),
        ("CPU time of a trial", duration(trial.median) if trial else "-", "median"),
    ]
    return element(
        "dl",
        *(
            element("div", element("dt", name), element("dd", value, element("small", note)))
            for name, value, note in tiles
        ),
        class_="tiles",
    )
