"""Sections of the report about outcomes: opening, stages, counts by object, certainty, cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import (
    CONTESTED_CONFIDENCE,
    Outcome,
    Stage,
    clustered_interval,
    format_count,
    format_duration,
    format_number,
    format_percent,
)
from burg_drake.evaluation.outcome_counts import OutcomeCounts, Summary
from burg_drake.evaluation.report.charts import BarPart, interval_mark, legend, stacked_bar
from burg_drake.evaluation.report.page_elements import (
    GROUP_CLASSES,
    folded_section,
    number_cells,
    section,
    table,
    table_row,
    tiles,
)
from burg_drake.visualization import OUTCOME_GROUPS, Child, Html, element, join, outcome_group

STAGE_LOSSES = {
    stage: tuple(o for o in Outcome if o.stage is stage and o is not Outcome.SIMULATION_FAILED)
    for stage in Stage
}
"""Outcomes by the stage that they end at, but for failed simulations."""
STEP_LOSSES = {
    "clear": STAGE_LOSSES[Stage.CLEAR],
    "reachable": STAGE_LOSSES[Stage.REACHABLE],
    "planned": STAGE_LOSSES[Stage.PLANNED],
    "executed": (Outcome.SIMULATION_FAILED,),
    "held": tuple(o for o in STAGE_LOSSES[Stage.EXECUTED] if not o.held),
    "lifted": (Outcome.LIFTED_DISTURBED, Outcome.LIFTED_TURNED),
}
"""Outcomes that stop a grasp on its way to each step of the funnel."""
GROUP_COLUMNS = ("grasps", "outcomes", "lifted / executed", "share with 95 % interval")
"""Columns of `group_row` behind the name."""


def objects_section(summary: Summary) -> Html:
    """Stacked outcomes and success share of each object."""
    max_objects = 40  # Of more objects, those with the lowest shares are shown.
    head, objects = ["object", *GROUP_COLUMNS], list(summary.objects)
    more = ""
    if len(objects) > max_objects:
        objects = worst_first(objects)[:max_objects]
        whole = len(summary.objects)
        more = f" The {max_objects} of {whole} objects with the lowest shares are shown."
    rows = [group_row(group) for group in objects]
    if len(objects) > 1:
        rows.append(group_row(summary.total, "total"))
    present = [g for g in OUTCOME_GROUPS if any(summary.total.outcomes[o] for o in g.outcomes)]
    return section(
        "Outcomes by object",
        f"How all grasps ended. Shares count only executed grasps.{more}",
        table(head, rows, numbers=(1, 3), style="stacking"),
        legend([(GROUP_CLASSES[g.name], g.name) for g in present]),
        *(element("p", note, class_="notice") for note in summary.notes),
        *([element("p", str(summary.lifts))] if summary.lifts else []),
    )


def worst_first(groups: Sequence[OutcomeCounts]) -> list[OutcomeCounts]:
    """Groups by their success when executed; those of which nothing was executed come first, and
    of equal shares those that are less certain."""

    def rank(group: OutcomeCounts) -> tuple[float, float]:
        return (group.lifted / group.executed if group.executed else -1.0), group.interval[0]

    return sorted(groups, key=rank)


def group_row(group: OutcomeCounts, style: str = "", name: Child = None) -> Html:
    """Grasps of an object, a scene or all, in a row under `GROUP_COLUMNS`.

    Args:
        group: to show.
        style: CSS class.
        name: in place of the group's own.
    """
    parts = []
    for outcomes in OUTCOME_GROUPS:
        inside = {o: group.outcomes[o] for o in outcomes.outcomes if group.outcomes[o]}
        detail = ", ".join(f"{count} {outcome_text(o)}" for o, count in inside.items())
        tip = f"{outcomes.name}: {detail}"
        parts.append(BarPart(sum(inside.values()), GROUP_CLASSES[outcomes.name], tip))
    share: Child = element("span", "nothing executed", class_="faint")
    if group.executed:
        mark = interval_mark(group.lifted / group.executed, *group.interval)
        share = join(mark, f" {format_percent(group.lifted / group.executed)}")
    lifted = f"{format_count(group.lifted)} / {format_count(group.executed)}"
    return table_row(
        group.name if name is None else name,
        *number_cells([format_count(group.judged)]),
        element("td", stacked_bar(parts, group.judged), class_="wide"),
        *number_cells([lifted]),
        element("td", share, class_="estimate"),
        style=style,
    )


def count_section(summary: Summary) -> Html:
    """Matrix of objects and outcomes."""
    seen = [o for o in Outcome if summary.total.outcomes[o]]
    groups = [*summary.objects, *([summary.total] if len(summary.objects) > 1 else [])]
    rows = []
    for group in groups:
        cells = number_cells(group.outcomes[o] or "·" for o in seen)
        style = "total" if group is summary.total else ""
        rows.append(table_row(group.name, *cells, style=style))
    head = ["object", *(outcome_text(o) for o in seen)]
    matrix = table(head, rows, numbers=tuple(range(1, len(head))), style="matrix")
    return folded_section("Counts", "Every grasp ends with exactly one outcome.", matrix)


def cost_section(summary: Summary) -> Html:
    """CPU time by stage."""
    head = ["stage", "grasps", "CPU time", "median", "grasps per CPU second"]
    rows = []
    for cost in summary.costs:
        durations = format_duration(cost.seconds), format_duration(cost.median)
        cells = number_cells([cost.grasps, *durations, format_number(cost.rate)])
        rows.append(table_row(cost.name, *cells))
    text = "CPU time of the worker processes, without their start."
    if summary.mode != "hand":
        text += " The time for reachable includes the search for motions of the arm."
    if summary.mode == "arm":
        text += " The time for planned is that of timing them."
    return folded_section("Cost", text, table(head, rows, numbers=(1, 2, 3, 4)))


def outcome_text(outcome: Outcome) -> str:
    """An outcome for people."""
    return outcome.value.replace("_", " ")


STEP_MEANINGS = {
    "candidates": "grasps that were judged",
    "clear": "the open hand overlaps nothing",
    "reachable": "hand and arm reach the grasp",
    "planned": "the arm has a path there and can follow the lift",
    "executed": "the trial was simulated to its end",
    "held": "both fingers hold the object to the end",
    "lifted": "not turned in the hand, and nothing else was disturbed",
}
"""What grasps have passed that are counted at each step."""


def cascade_section(summary: Summary) -> Html:
    """A bar a stage: what passes, then what is lost there in the colour of its outcomes."""
    total, steps = summary.total, summary.steps
    funnel = total.funnel
    rows = [
        _step_row(total, step, funnel[before] if before else None)
        for step, before in zip(steps, [None, *steps[:-1]], strict=True)
    ]
    return section(
        "From candidates to lifts",
        "How many grasps pass each stage, and what stopped the others.",
        element("ol", *rows, class_="cascade"),
    )


def _step_row(total: OutcomeCounts, step: str, before: int | None) -> Html:
    passed, whole = total.funnel[step], max(total.judged, 1)
    share = f"{format_percent(passed / whole)} of all"
    if before and passed < before < whole:
        share += f", {format_percent(passed / before)} of the stage before"
    lost = _lost_text(total, step)
    name = element("b", step), " ", element("span", STEP_MEANINGS[step], class_="faint")
    return element(
        "li",
        element("span", *name, class_="step"),
        element("span", format_count(passed), class_="passed"),
        _step_bar(total, step, passed, whole),
        element(
            "span",
            element("span", share, class_="faint"),
            element("span", f" · lost {lost}", class_="lost") if lost else None,
            class_="share",
        ),
    )


def _step_bar(total: OutcomeCounts, step: str, passed: int, whole: int) -> Html:
    parts = [element("i", class_="pass", style=f"width:{100 * passed / whole:.2f}%")]
    for group in OUTCOME_GROUPS:
        lost = sum(
            total.outcomes[o] for o in STEP_LOSSES.get(step, ()) if outcome_group(o) is group
        )
        if lost:
            width = f"width:{100 * lost / whole:.2f}%"
            parts.append(element("i", class_=GROUP_CLASSES[group.name], style=width))
    return element("span", *parts, class_="track", aria_hidden="true")


def _lost_text(total: OutcomeCounts, step: str) -> str:
    lost = [
        (total.outcomes[o], outcome_text(o)) for o in STEP_LOSSES.get(step, ()) if total.outcomes[o]
    ]
    if not lost:
        return ""
    parts = [f"{format_count(n)} {name}" for n, name in sorted(lost, key=lambda pair: -pair[0])]
    return f"{format_count(sum(n for n, _ in lost))}: {', '.join(parts)}"


CERTAINTY_CLASSES = {
    "lifted": GROUP_CLASSES["lifted"],
    "contested": "contested",
    "failed": GROUP_CLASSES["lost during lift or hold"],
}
"""CSS classes of certain and of contested verdicts."""


def certainty_section(summary: Summary, contested: Sequence[str] = ()) -> Html | None:
    """A bar an object of its executed grasps; nothing where no verdict has a confidence.

    Args:
        summary: of a run.
        contested: ids of the contested grasps, if they are to be named.
    """
    if not summary.knows_confidence or not summary.total.executed:
        return None
    settled = summary.total.settled
    head = ["object", "executed", "verdicts", "contested", *(["settled"] if settled else [])]
    width = len(head)
    tried = [group for group in summary.objects if group.executed]
    rows = [_certainty_row(group, bool(settled)) for group in tried]
    if len(tried) > 1:
        rows.append(_certainty_row(summary.total, bool(settled), "total"))
    text = (
        f"A verdict is contested if its confidence is below {CONTESTED_CONFIDENCE:g}: with slightly"
        " different friction, pose, shape or lifting speed, the object may be held"
        " instead of lost, or lost instead of held. The margins below show how close"
        " other verdicts are to a limit."
    )
    if settled:
        text += f" Judged again by {', '.join(summary.settled_by)}, whose verdicts count:"
        text += f" {format_count(settled)}."
    return section(
        "How sure the verdicts are",
        text,
        table(head, rows, numbers=(1, *range(3, width)), style="stacking"),
        legend([(style, name) for name, style in CERTAINTY_CLASSES.items()]),
        _contested_names(contested),
    )


def _contested_names(contested: Sequence[str]) -> Html | None:
    """Which grasps are contested, as far as there is room."""
    max_named = 12  # Contested grasps that are named.
    if not contested:
        return None
    ids = [
        join(", " if k else "", element("code", id)) for k, id in enumerate(contested[:max_named])
    ]
    more = len(contested) - max_named
    return element("p", "Contested: ", *ids, f" and {more} more" if more > 0 else "", class_="note")


def _certainty_row(group: OutcomeCounts, settled: bool, style: str = "") -> Html:
    lifts, losses = group.contested_lifts, group.contested - group.contested_lifts
    counts = (group.surely_lifted, group.contested, group.surely_lost)
    tips = (
        f"lifted: {group.surely_lifted}",
        f"contested: {lifts} lifted, {losses} failed",
        f"failed: {group.surely_lost}",
    )
    parts = list(map(BarPart, counts, CERTAINTY_CLASSES.values(), tips))
    further = [group.contested, group.settled] if settled else [group.contested]
    return table_row(
        group.name,
        *number_cells([format_count(group.executed)]),
        element("td", stacked_bar(parts, group.executed), class_="wide"),
        *number_cells(map(format_count, further)),
        style=style,
    )


def opening_section(summary: Summary) -> Html:
    """Sentences with figures and intervals, and the same figures large."""
    of_grasps = (
        "Intervals are Wilson's 95 % intervals for independent grasps. Grasps on one object"
        " are alike, so the range for other objects is wider."
    )
    # What the intervals stand for, in a run and in one over many scenes.
    of_scenes = (
        "Intervals are 95 % intervals for other scenes of the same kind. They follow from"
        " how much the scenes differ, and are never narrower than Wilson's."
    )
    sentences = [
        _success_sentence(summary),
        _cascade_sentence(summary),
        _spread_sentence(summary.scenes, "scene"),
        _spread_sentence(summary.objects, "object"),
    ]
    first, *rest = [text.replace(" %", "\u00a0%") for text in sentences if text]
    note = of_scenes if summary.scenes else of_grasps
    return element(
        "div",
        element("p", element("b", first), *(f" {text}" for text in rest), class_="lead"),
        tiles(_key_figures(summary)),
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


def grasp_count_text(number: int) -> str:
    """So many grasps."""
    return f"{format_count(number)} grasp{'' if number == 1 else 's'}"


def _success_sentence(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return "No grasp is judged yet."
    if not total.lifted:
        return f"None of {grasp_count_text(total.judged)} lifted its object."
    interval = interval_text(summary, executed=False)
    share = f"{format_percent(total.lifted / total.judged)}, 95 % interval {interval}"
    number = f"{format_count(total.lifted)} of {grasp_count_text(total.judged)}"
    return f"{number} lifted their object ({share})."


def _cascade_sentence(summary: Summary) -> str:
    total = summary.total
    if not total.judged:
        return ""
    if not total.executed:
        return f"Nothing was executed: {_losses_text(summary)}."
    whole = "by the whole arm" if summary.mode == "arm" else "by the hand"
    share = f"{format_percent(total.lifted / total.executed)}, interval"
    share += f" {interval_text(summary, executed=True)}"
    text = f"Of the {format_count(total.executed)} that were executed {whole} in simulation,"
    text += f" {format_count(total.lifted)} succeeded ({share})."
    if total.executed < total.judged:
        text += f" The others ended before that: {_losses_text(summary)}."
    return text


def _losses_text(summary: Summary) -> str:
    """What was lost before the trial, by stage."""
    words = {
        "clear": "the open hand collides",
        "reachable": "hand or arm cannot reach the grasp",
        "planned": "the arm has no path",
        "executed": "the simulation failed",
    }
    counts = [
        (sum(summary.total.outcomes[o] for o in STEP_LOSSES[step]), text)
        for step, text in words.items()
    ]
    return ", ".join(f"{text} in {format_count(number)}" for number, text in counts if number)


def _spread_sentence(groups: Sequence[OutcomeCounts], what: str) -> str:
    """The best and the worst object or scene of those that were tried."""
    min_scenes = 8  # From so many scenes on, quartiles tell more than the extremes.
    tried = [group for group in groups if group.executed]
    if len(tried) < 2:
        return ""
    shares = [group.lifted / group.executed for group in tried]
    if min(shares) == max(shares):
        where = "In" if what == "scene" else "On"
        return f"{where} each {what} that was tried it is {format_percent(shares[0])}."
    if what == "scene" and len(tried) >= min_scenes:
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


def _key_figures(summary: Summary) -> list[tuple[str, Child, str]]:
    total = summary.total
    screened = "the open hand is clear" if summary.mode == "hand" else "hand and arm find a path"
    besides = (
        ("disturbed others", total.outcomes[Outcome.LIFTED_DISTURBED]),
        ("turned in the hand", total.outcomes[Outcome.LIFTED_TURNED]),
    )
    extra = "".join(f"; {format_count(n)} more {what}" for what, n in besides if n)
    scenes = f" in {format_count(len(summary.scenes))} scenes" if summary.scenes else ""
    executed = format_count(total.executed)
    objects = f"on {len(summary.objects)} object{'' if len(summary.objects) == 1 else 's'}"
    return [
        ("Grasps judged", format_count(total.judged), objects + scenes),
        ("Executed", executed, screened),
        ("Lifted", format_count(total.lifted), f"of {executed} executed{extra}"),
        ("Success when executed", *_success_figure(summary, executed=True)),
        ("Success of all", *_success_figure(summary, executed=False)),
    ]


def _success_figure(summary: Summary, *, executed: bool) -> tuple[str, str]:
    """The share of grasps that were lifted, and its interval."""
    whole = summary.total.executed if executed else summary.total.judged
    if not whole:
        return "-", f"nothing {'executed' if executed else 'judged'}"
    interval = interval_text(summary, executed=executed)
    return format_percent(summary.total.lifted / whole), f"{interval} (95 % interval)"
