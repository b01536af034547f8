"""Sections about numbers that may tell of success: margins, and placement of the objects."""

from __future__ import annotations

from burg_drake.core.terminal import format_count
from burg_drake.evaluation.report.elements import Html, element, section, table
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.groups import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.report.figures import figure_cell, group_section
from burg_drake.experiment.comparison.report.plots import reliability_plot
from burg_drake.experiment.comparison.wording import (
    margin_title,
    success_of,
    too_few_for_margins,
)
from burg_drake.experiment.statistics import Estimate, MarginCalibration

MOST_PLOTS = 4


def margin_section(comparison: Comparison, judged: Judgement) -> Html | None:
    """What margins say about success; nothing where there are none."""
    defined = [c for c in judged.calibration if c.auroc.value is not None]
    found = sorted(defined, key=_informative, reverse=True)
    if not found:
        words = too_few_for_margins(comparison, judged)
        return section(f"Do margins predict {success_of(comparison)}?", words) if words else None
    weighted = any(c.auroc_weighted is not None for c in found)
    head = ["margin", "trials"]
    head += ["AUROC, selected trials", "AUROC, all grasps"] if weighted else ["AUROC"]
    rows = [_row(c, weighted) for c in found]
    plots = [reliability_plot(c, success_of(comparison)) for c in found[:MOST_PLOTS]]
    trials = "grasps, each trial standing for its share," if weighted else "trials"
    text = (
        "AUROC: how often, of a grasp that succeeded and one that failed, the one that"
        " succeeded has the better margin (↑ larger, ↓ smaller); 0.5 means that the"
        f" margin tells nothing. Dots: share of successes among {trials} in bins of about"
        " equally many trials, with Wilson's intervals. Line: the monotone curve that"
        " fits best; dashes: the share of all."
    )
    return section(
        f"Do margins predict {success_of(comparison)}?",
        text,
        element("div", *plots, class_="charts plots"),
        table(head, rows, numbers=range(1, len(head)), style="figures"),
    )


def _informative(found: MarginCalibration) -> float:
    """How far the interval stays from telling nothing; plots are drawn of those that tell most."""
    area = found.auroc_weighted or found.auroc
    low, high = area.low, area.high
    return -1.0 if low is None or high is None else max(low - 0.5, 0.5 - high)


def _row(c: MarginCalibration, weighted: bool) -> Html:
    found = (c.auroc, c.auroc_weighted) if weighted else (c.auroc,)
    return element(
        "tr",
        element(
            "th", f"{margin_title(c.name)[0]} {'↓' if c.smaller_is_better else '↑'}", scope="row"
        ),
        element("td", format_count(c.trials), class_="number"),
        *(figure_cell(f or Estimate.undefined(""), percent=False) for f in found),
    )


def placement_section(judged: Judgement, of: str) -> Html | None:
    """Agreement by placement; nothing without real trials. `of` says of which trials."""
    p = judged.placement
    if p is None or not p.within.trials + p.beyond.trials:
        return None
    limit = f"{p.limit_mm:g} mm"
    groups = [
        FactorGroup(name=f"every object within {limit}", agreement=p.within),
        FactorGroup(name=f"an object more than {limit} off", agreement=p.beyond),
        FactorGroup(name="not all measured", agreement=p.unmeasured),
    ]
    text = (
        "Where objects were off their planned places, the simulation judged another"
        " scene than the robot had. If agreement is much better in the first row, the"
        " cause is placement and not physics."
    )
    plots = [reliability_plot(c, "right verdicts") for c in (p.largest, p.target) if c.trials]
    whole = group_section(f"By placement of the objects{of}", text, "placement", groups)
    return element("div", whole, element("div", *plots, class_="charts plots"))
