"""The page on where grasps are lost: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.core.files import atomic_write
from burg_drake.core.terminal import format_percent
from burg_drake.evaluation.records import engine_label
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    header,
    html_page,
    join,
    section,
    tiles,
)
from burg_drake.experiment.gap.changes import Change, gap_changes
from burg_drake.experiment.gap.report.flow import STYLE
from burg_drake.experiment.gap.report.sections import (
    change_section,
    flow_section,
    objects_section,
    push_section,
    reality_section,
)
from burg_drake.experiment.gap.report.sentences import TITLES, step_sentences
from burg_drake.experiment.gap.step_agreement import StepAgreement
from burg_drake.experiment.gap.steps import GapSteps
from burg_drake.experiment.trials import Success

REPORT_FILE = "gap.html"


def write_gap_report(
    steps: GapSteps, success: Success, agreement: Sequence[StepAgreement], command_line: str
) -> None:
    """Writes the page into the folder of the steps.

    Args:
        steps: all steps.
        success: what counts.
        agreement: with real trials, if there are any.
        command_line: that makes it again.

    Raises:
        InvalidInputError: it cannot be written.
    """
    page = gap_page(steps, success, agreement, command_line)
    atomic_write(steps.path / REPORT_FILE, page)


def gap_page(
    steps: GapSteps, success: Success, agreement: Sequence[StepAgreement], command_line: str
) -> str:
    """The page as HTML."""
    found = gap_changes(steps, success)
    document = steps.first.document
    title = f"{document.scene.name} on {document.station.name}"
    return html_page(
        f"Where grasps are lost: {title}",
        element("style", Html(STYLE)),
        header("Where grasps are lost", title, _about(steps, success)),
        *_paragraphs(step_sentences(steps, found, success)),
        tiles(_tiles(steps, found)),
        flow_section(steps, found),
        objects_section(steps, success),
        *(change_section(change) for change in found),
        push_section(steps),
        reality_section(agreement),
        _reproduction(steps, command_line),
    )


def _about(steps: GapSteps, success: Success) -> str:
    document = steps.first.document
    counts = "lifted, and nothing else disturbed" if success == "lifted" else "lifted and held"
    about = f"{document.grasps.count} grasps, engine {engine_label(document.engine)}"
    return f"{about}; success: {counts}"


def _paragraphs(sentences: Sequence[str]) -> list[Html]:
    return [element("p", " ".join(sentences), class_="lead")]


def _tiles(steps: GapSteps, found: Sequence[Change]) -> list[tuple[str, Child, str]]:
    whole = len(steps.first.candidates)
    entries: list[tuple[str, Child, str]] = [("Grasps", f"{whole}", "the same in every step")]
    first = found[0].successes if found else 0
    if found and found[0].step != "placed":
        entries.append((TITLES["hand"].capitalize(), f"{first}", "succeed"))
    for change in found:
        left = change.successes - len(change.lost) + len(change.won)
        if change.step == "placed":
            share = format_percent(left / change.successes) if change.successes else "-"
            entries.append(("Objects displaced", share, "of these succeed again"))
        else:
            note = f"{len(change.lost)} lost, {len(change.won)} won"
            entries.append((TITLES[change.step].capitalize(), f"{left}", note))
    return entries


def _reproduction(steps: GapSteps, command_line: str) -> Html:
    document = steps.document
    facts = [("folder", str(steps.path))]
    facts += [
        (TITLES[step.name], ", ".join(str(run.path) for run in step.runs) or "-")
        for step in steps.steps
    ]
    if document.samples:
        noise = f"{document.place_mm:g} mm, {document.turn_deg:g} degrees, seed {document.seed}"
        redrawn = (
            f"{sum(document.redrawn)} displaced positions were drawn again, as something was"
            " there already"
        )
        facts.append(("displaced by", f"{noise}; {redrawn}"))
        for scene, names in document.kept.items():
            facts.append((f"scene {scene}", f"{', '.join(names)} as planned: no other place found"))
    facts.append(("versions", ", ".join(f"{k} {v}" for k, v in document.versions.items())))
    listed = [join(element("dt", name), element("dd", fact)) for name, fact in facts]
    return section(
        "How to repeat",
        "Every step is an ordinary run, which burg-drake report, replay and robustness"
        " can open. If interrupted, the same command continues it.",
        command(command_line),
        element("dl", *listed, class_="facts"),
    )
