"""The first lines of a report: what came out, in two or three sentences and a few large figures."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.core.figures import count, percent
from burg_drake.core.statistics import wilson_interval
from burg_drake.evaluation.report.html_page import tiles
from burg_drake.evaluation.report.markup import Child, Html, element
from burg_drake.evaluation.report.outcomes import STOPPED, label
from burg_drake.evaluation.summary import Group, Summary

INTERVALS = (
    "Intervals hold 95 % (Wilson's), and take grasps as independent draws; grasps on one object are"
    " alike, so that for other objects the range is wider."
)


def headline(summary: Summary) -> Html:
    """Sentences with figures and intervals, and the same figures large."""
    sentences = [_success(summary), _cascade(summary), _spread(summary.objects)]
    first, *rest = [sentence for sentence in sentences if sentence]
    return element(
        "div",
        element("p", element("b", first), *(f" {sentence}" for sentence in rest), class_="lead"),
        tiles(_tiles(summary)),
        element("p", INTERVALS, class_="note") if summary.total.judged else None,
    )


def share_text(part: int, whole: int) -> str:
    """A share with its interval, such as "87.8 %, interval 79 to 93 %"."""
    return f"{percent(part / whole)}, interval {interval_text(part, whole)}"


def interval_text(part: int, whole: int) -> str:
    """The 95 % interval of a share, such as "79 to 93 %"."""
    low, high = wilson_interval(part, whole)
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def grasps(number: int) -> str:
    """So many grasps."""
    return f"{count(number)} grasp{'' if number == 1 else 's'}"


def _success(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return "No grasp is judged yet."
    if not total.lifted:
        return f"None of {grasps(total.judged)} lifted its object."
    share = share_text(total.lifted, total.judged)
    return f"{count(total.lifted)} of {grasps(total.judged)} lifted their object ({share})."


def _cascade(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return ""
    if not total.executed:
        return f"Nothing was executed: {_losses(summary)}."
    whole = "by the whole arm" if summary.mode == "arm" else "by the hand"
    share = share_text(total.lifted, total.executed)
    text = f"Of the {count(total.executed)} that were executed {whole} in simulation,"
    text += f" {count(total.lifted)} succeeded ({share})."
    if total.executed < total.judged:
        text += f" The others ended before that: {_losses(summary)}."
    return text


def _losses(summary: Summary) -> str:
    """What was lost before the trial, by stage."""
    words = {
        "clear": "the open hand collides",
        "reachable": "hand or arm cannot be there",
        "planned": "the arm has no way",
        "executed": "the simulation failed",
    }
    counts = [
        (sum(summary.total.outcomes[o] for o in STOPPED[step]), text)
        for step, text in words.items()
    ]
    return ", ".join(f"{text} in {count(number)}" for number, text in counts if number)


def _spread(objects: Sequence[Group]) -> str:
    """The best and the worst object of those that were tried."""
    tried = [group for group in objects if group.executed]
    if len(tried) < 2:
        return ""
    shares = [group.lifted / group.executed for group in tried]
    if min(shares) == max(shares):
        return f"Success when executed is the same on all objects: {percent(shares[0])}."
    low, high = (tried[shares.index(pick(shares))] for pick in (min, max))
    return (
        f"By object, success when executed is between {percent(min(shares))} ({low.name}:"
        f" {low.lifted} of {low.executed}) and {percent(max(shares))} ({high.name}: {high.lifted}"
        f" of {high.executed})."
    )


def _tiles(summary: Summary) -> list[tuple[str, Child, str]]:
    total = summary.total
    screened = "the open hand is clear" if summary.mode == "hand" else "hand and arm find a way"
    disturbed = total.held - total.lifted
    extra = f"; {count(disturbed)} more disturbed others" if disturbed else ""
    of_all = "of executed", percent(total.lifted / total.executed) if total.executed else "-"
    objects = f"on {len(summary.objects)} object{'' if len(summary.objects) == 1 else 's'}"
    worst = _worst(summary)
    return [
        ("Grasps judged", count(total.judged), objects),
        ("Executed", count(total.executed), screened),
        ("Lifted", count(total.lifted), f"of {count(total.executed)} executed{extra}"),
        (
            "Success when executed",
            of_all[1],
            f"{interval_text(total.lifted, total.executed)} (95 % interval)"
            if total.executed
            else "nothing executed",
        ),
        ("Most frequent loss", worst[0], worst[1]),
    ]


def _worst(summary: Summary) -> tuple[str, str]:
    """What stops most grasps, and how many."""
    outcomes = summary.total.outcomes
    lost = [(outcomes[o], label(o)) for part in STOPPED.values() for o in part if outcomes[o]]
    if not lost:
        return "none", "every judged grasp lifted" if summary.total.judged else ""
    number, name = max(lost, key=lambda pair: pair[0])
    return count(number), name
