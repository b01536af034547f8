"""The steps as tables for terminals, and as JSON values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from burg_drake.core.documents import plain_data
from burg_drake.core.grasps import outcome_label
from burg_drake.core.terminal import TextTable, format_percent
from burg_drake.evaluation.results import pushes
from burg_drake.experiment.comparison import interval, plain
from burg_drake.experiment.gap.changes import Change, successes_by_object
from burg_drake.experiment.gap.report.sentences import (
    NOT_PREDICTABLE,
    TITLES,
    reality_words,
    replay_command,
    step_sentences,
)
from burg_drake.experiment.gap.step_agreement import StepAgreement
from burg_drake.experiment.gap.steps import GapSteps
from burg_drake.experiment.statistics import Estimate
from burg_drake.experiment.trials import Success

FIGURES = ("precision", "recall", "accuracy")


def steps_view(steps: GapSteps, found: Sequence[Change]) -> TextTable:
    """What each step keeps and loses."""
    table = TextTable("Where grasps are lost", caption=_caption(steps))
    table.names("step").numbers(
        "before", "lost", "won", "left", "lost %", "95 % CI", "not simulated"
    )
    table.texts("turned into")
    for change in found:
        lost, whole = len(change.lost), change.successes
        low, high = change.share_lost
        into = Counter(outcome_label(move.after) for move in change.lost)
        table.row(
            TITLES[change.step],
            *(str(n) for n in (whole, lost, len(change.won), whole - lost + len(change.won))),
            format_percent(lost / whole) if whole else "-",
            f"{100 * low:.0f}-{100 * high:.0f} %" if whole else "-",
            str(change.failed),
            ", ".join(f"{name} {count}" for name, count in into.most_common()),
        )
    return table


def _caption(steps: GapSteps) -> str:
    document = steps.document
    if not document.samples:
        return ""
    return (
        f"objects displaced: {document.place_mm:g} mm and {document.turn_deg:g} degrees (standard"
        f" deviations) in {document.samples} scenes; each grasp counts once a scene"
    )


def reality_view(agreement: Sequence[StepAgreement]) -> TextTable:
    """What each step does to the agreement with the robot."""
    table = TextTable(
        "Compared with the robot",
        caption=f"{reality_words(agreement)}; positive: success predicted",
    )
    table.names("step").numbers("trials", "TP", "FP", "FN", "TN", NOT_PREDICTABLE, *FIGURES)
    for one in agreement:
        found = one.found
        counts = (found.trials, *(f"{cell:g}" for cell in found.cells), one.unpredictable)
        table.row(
            TITLES[one.step], *map(str, counts), *(_share(one.estimated.figure(n)) for n in FIGURES)
        )
    return table


def _share(found: Estimate) -> str:
    if found.value is None:
        return "-"
    return f"{100 * found.value:.0f} {interval(found, percent=True)} %"


def gap_json(
    steps: GapSteps,
    found: Sequence[Change],
    agreement: Sequence[StepAgreement],
    success: Success,
) -> dict[str, Any]:
    """All figures, and the grasps that change."""
    results = {"arm": next((s.runs[0].results for s in steps.steps if s.name == "arm"), None)}
    pushed = None if results["arm"] is None else pushes(results["arm"])
    return {
        "success": success,
        "asked": plain_data(steps.document),
        "story": step_sentences(steps, found, success),
        "steps": [
            {
                "name": step.name,
                "runs": [str(run.path) for run in step.runs],
                "outcomes": dict(
                    Counter(v.outcome.value for run in step.runs for v in run.verdicts.values())
                ),
                "objects": {
                    name: {"successes": good, "grasps": all}
                    for name, (good, all) in successes_by_object(step, success).items()
                },
            }
            for step in steps.steps
        ],
        "changes": [_change_json(change) for change in found],
        "pushed": None if pushed is None else asdict(pushed),
        "reality": [
            {
                "step": one.step,
                "weighted": False,
                **plain(one.found),
                "all_grasps": plain(one.all_grasps),
                "unpredictable": one.unpredictable,
            }
            for one in agreement
        ],
    }


def _change_json(change: Change) -> dict[str, Any]:
    low, high = change.share_lost
    return {
        "step": change.step,
        "successes": change.successes,
        "lost": len(change.lost),
        "won": len(change.won),
        "not_simulated": change.failed,
        "share_lost": {"low": low, "high": high},
        "flow": [
            {"before": a.value, "after": b.value, "count": n}
            for (a, b), n in change.flow.most_common()
        ],
        "blockers": dict(change.blockers.most_common()),
        "grasps": [
            {
                "grasp": move.grasp,
                "object": move.object,
                "before": move.before.value,
                "after": move.after.value,
                "blocker": move.blocker,
                "replay": replay_command(move.run, move.grasp),
            }
            for move in (*change.lost, *change.won)
        ],
    }
