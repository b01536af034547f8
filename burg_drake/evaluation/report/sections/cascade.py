"""The cascade: how many grasps pass each stage, and what was lost on the way and to what."""

from __future__ import annotations

from burg_drake.core.terminal import format_count, format_percent
from burg_drake.evaluation.report.elements import STYLES, Html, element, section
from burg_drake.evaluation.report.sections.outcomes import STOPPED, label
from burg_drake.evaluation.results import OutcomeCounts, Summary
from burg_drake.visualization.style import GROUPS, group_of

MEANING = {
    "candidates": "grasps that were judged",
    "clear": "the open hand overlaps nothing",
    "reachable": "hand and arm reach the grasp",
    "planned": "the arm has a path there and can follow the lift",
    "executed": "the trial was simulated to its end",
    "held": "both fingers hold the object to the end",
    "lifted": "not turned in the hand, and nothing else was disturbed",
}


def cascade_section(summary: Summary) -> Html:
    """A bar a stage: what passes, then what is lost there in the colour of its outcomes."""
    total, steps = summary.total, summary.steps
    funnel = total.funnel
    rows = [
        _row(total, step, funnel[before] if before else None)
        for step, before in zip(steps, [None, *steps[:-1]], strict=True)
    ]
    return section(
        "From candidates to lifts",
        "How many grasps pass each stage, and what stopped the others.",
        element("ol", *rows, class_="cascade"),
    )


def _row(total: OutcomeCounts, step: str, before: int | None) -> Html:
    passed, whole = total.funnel[step], max(total.judged, 1)
    share = f"{format_percent(passed / whole)} of all"
    if before and passed < before < whole:
        share += f", {format_percent(passed / before)} of the stage before"
    lost = _lost(total, step)
    name = element("b", step), " ", element("span", MEANING[step], class_="faint")
    return element(
        "li",
        element("span", *name, class_="step"),
        element("span", format_count(passed), class_="passed"),
        _bar(total, step, passed, whole),
        element(
            "span",
            element("span", share, class_="faint"),
            element("span", f" · lost {lost}", class_="lost") if lost else None,
            class_="share",
        ),
    )


def _bar(total: OutcomeCounts, step: str, passed: int, whole: int) -> Html:
    parts = [element("i", class_="pass", style=f"width:{100 * passed / whole:.2f}%")]
    for group in GROUPS:
        lost = sum(total.outcomes[o] for o in STOPPED.get(step, ()) if group_of(o) is group)
        if lost:
            width = f"width:{100 * lost / whole:.2f}%"
            parts.append(element("i", class_=STYLES[group.name], style=width))
    return element("span", *parts, class_="track", aria_hidden="true")


def _lost(total: OutcomeCounts, step: str) -> str:
    lost = [(total.outcomes[o], label(o)) for o in STOPPED.get(step, ()) if total.outcomes[o]]
    if not lost:
        return ""
    parts = [f"{format_count(n)} {name}" for n, name in sorted(lost, key=lambda pair: -pair[0])]
    return f"{format_count(sum(n for n, _ in lost))}: {', '.join(parts)}"
