"""The first lines of a report: what came out, in two or three sentences and a few large figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import clustered_interval
from burg_drake.core.grasps import Outcome
from burg_drake.core.terminal import format_count, format_percent
from burg_drake.evaluation.report.elements import Child, Html, element, tiles
from burg_drake.evaluation.report.sections.outcomes import STOPPED
from burg_drake.evaluation.results import OutcomeCounts, Summary

ALIKE = (
    "Intervals are Wilson's 95 % intervals for independent grasps. Grasps on one object"
    " are alike, so the range for other objects is wider."
)
MANY = 8
"""From so many scenes on, quartiles tell more than the worst and the best."""
BY_SCENE = (
    "Intervals are 95 % intervals for other scenes of the same kind. They follow from"
    " how much the scenes differ, and are never narrower than Wilson's."
)
"""What the intervals stand for, in a run and in one over many scenes."""


def opening_section(summary: Summary) -> Html:
    """Sentences with figures and intervals, and the same figures large."""
    sentences = [
        _success(summary),
        _cascade(summary),
        _spread(summary.scenes, "scene"),
        _spread(summary.objects, "object"),
    ]
    first, *rest = [text.replace(" %", "\u00a0%") for text in sentences if text]
    note = BY_SCENE if summary.scenes else ALIKE
    return element(
        "div",
        element("p", element("b", first), *(f" {text}" for text in rest), class_="lead"),
        tiles(_tiles(summary)),
        element("p", note, class_="note") if summary.total.judged else None,
    )


def interval_text(summary: Summary, *, executed: bool) -> str:
    """The 95 % interval of the share of grasps that were lifted, such as "79 to 93 %".

    Args:
        summary: of a run, of one scene or of many.
        executed: of those that were executed, not of all.
    """
    groups = summary.scenes or (summary.total,)
    whole = [group.executed if executed else group.judged for group in groups]
    low, high = clustered_interval([group.lifted for group in groups], whole)
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def grasps(number: int) -> str:
    """So many grasps."""
    return f"{format_count(number)} grasp{'' if number == 1 else 's'}"


def _success(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return "No grasp is judged yet."
    if not total.lifted:
        return f"None of {grasps(total.judged)} lifted its object."
    interval = interval_text(summary, executed=False)
    share = f"{format_percent(total.lifted / total.judged)}, 95 % interval {interval}"
    return f"{format_count(total.lifted)} of {grasps(total.judged)} lifted their object ({share})."


def _cascade(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return ""
    if not total.executed:
        return f"Nothing was executed: {_losses(summary)}."
    whole = "by the whole arm" if summary.mode == "arm" else "by the hand"
    share = f"{format_percent(total.lifted / total.executed)}, interval"
    share += f" {interval_text(summary, executed=True)}"
    text = f"Of the {format_count(total.executed)} that were executed {whole} in simulation,"
    text += f" {format_count(total.lifted)} succeeded ({share})."
    if total.executed < total.judged:
        text += f" The others ended before that: {_losses(summary)}."
    return text


def _losses(summary: Summary) -> str:
    """What was lost before the trial, by stage."""
    words = {
        "clear": "the open hand collides",
        "reachable": "hand or arm cannot reach the grasp",
        "planned": "the arm has no path",
        "executed": "the simulation failed",
    }
    counts = [
        (sum(summary.total.outcomes[o] for o in STOPPED[step]), text)
        for step, text in words.items()
    ]
    return ", ".join(f"{text} in {format_count(number)}" for number, text in counts if number)


def _spread(groups: Sequence[OutcomeCounts], what: str) -> str:
    """The best and the worst object or scene of those that were tried."""
    tried = [group for group in groups if group.executed]
    if len(tried) < 2:
        return ""
    shares = [group.lifted / group.executed for group in tried]
    if min(shares) == max(shares):
        where = "In" if what == "scene" else "On"
        return f"{where} each {what} that was tried it is {format_percent(shares[0])}."
    if what == "scene" and len(tried) >= MANY:
        low, middle, high = np.quantile(shares, [0.25, 0.5, 0.75])
        return (
            f"In half of the scenes, success when executed is between {format_percent(low)} and"
            f" {format_percent(high)} (median {format_percent(middle)})."
        )
    low, high = (tried[shares.index(pick(shares))] for pick in (min, max))
    return (
        f"By {what}, success when executed is between {format_percent(min(shares))} ({low.name}:"
        f" {low.lifted} of {low.executed}) and {format_percent(max(shares))} ({high.name}:"
        f" {high.lifted} of {high.executed})."
    )


def _tiles(summary: Summary) -> list[tuple[str, Child, str]]:
    total = summary.total
    screened = "the open hand is clear" if summary.mode == "hand" else "hand and arm find a path"
    besides = (
        ("disturbed others", total.outcomes[Outcome.LIFTED_DISTURBED]),
        ("turned in the hand", total.outcomes[Outcome.LIFTED_TURNED]),
    )
    extra = "".join(f"; {format_count(n)} more {what}" for what, n in besides if n)
    scenes = f" in {format_count(len(summary.scenes))} scenes" if summary.scenes else ""
    objects = f"on {len(summary.objects)} object{'' if len(summary.objects) == 1 else 's'}"
    return [
        ("Grasps judged", format_count(total.judged), objects + scenes),
        ("Executed", format_count(total.executed), screened),
        (
            "Lifted",
            format_count(total.lifted),
            f"of {format_count(total.executed)} executed{extra}",
        ),
        (
            "Success when executed",
            format_percent(total.lifted / total.executed) if total.executed else "-",
            f"{interval_text(summary, executed=True)} (95 % interval)"
            if total.executed
            else "nothing executed",
        ),
        (
            "Success of all",
            format_percent(total.lifted / total.judged) if total.judged else "-",
            f"{interval_text(summary, executed=False)} (95 % interval)"
            if total.judged
            else "nothing judged",
        ),
    ]
