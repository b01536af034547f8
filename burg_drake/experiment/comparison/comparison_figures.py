"""Sections of a comparison's page with matrices, figures and charts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from burg_drake.core import format_count, format_number
from burg_drake.evaluation import nice_step, section, table
from burg_drake.experiment.comparison.comparison import (
    Comparison,
    cell_name,
    margin_title,
    no_outliers_sentence,
    outcome_counts_text,
    outlier_name,
    success_description,
    too_few_trials_sentence,
    unpredictable_sentence,
)
from burg_drake.experiment.comparison.confusion_matrix import Agreement
from burg_drake.experiment.comparison.estimates import Estimate
from burg_drake.experiment.comparison.figure_tables import (
    Named,
    figure_cell,
    group_table,
    measure_table,
    named_row,
    number_cells,
    placement_groups,
    unpredictable_table,
)
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.margin_calibration import Bin, MarginCalibration
from burg_drake.visualization import Html, element

PLOT_SIZE = 330, 210  # width and height of a reliability plot in SVG units
PLOT_LEFT, PLOT_RIGHT = 38, 320  # x of the axes' ends
PLOT_TOP, PLOT_BOTTOM = 24, 172  # y of the shares 1 and 0


def reliability_plot(found: MarginCalibration, vertical: str) -> Html:
    """Share over a number: a dot with its interval for each bin, the isotonic fit as a line, and
    the share of all together dashed.

    Args:
        found: bins and fit; shares of what the trials stand for, if that is known.
        vertical: what the share is of.
    """
    title, unit, size = margin_title(found.name)
    ends = [size * found.bins[0].low, size * found.bins[-1].high]
    size_of_all = max(abs(end) for end in ends)
    spread = ends[1] - ends[0]
    step = nice_step((spread if spread > 1e-6 * size_of_all else size_of_all or 1.0) / 5)
    low, high = math.floor(ends[0] / step + 1e-9), math.ceil(ends[1] / step - 1e-9)
    low, high = (low, high) if low < high else (low - 1, high + 1)

    def x(value: float) -> float:
        along = (size * value - low * step) / ((high - low) * step)
        return PLOT_LEFT + (PLOT_RIGHT - PLOT_LEFT) * along

    named = f"{title} [{unit}]" if unit else title
    axis = [
        element(
            "text",
            f"{k * step:.6g}",
            x=f"{x(k * step / size):.1f}",
            y=PLOT_BOTTOM + 15,
        )
        for k in range(low, high + 1)
    ]
    return element(
        "svg",
        element("text", vertical, x=4, y=12, class_="title"),
        element("text", named, x=PLOT_RIGHT, y=PLOT_SIZE[1] - 5, class_="title end"),
        *_grid_lines(),
        element("g", *axis, class_="middle"),
        _mean_line((found.weighted or found.share).value),
        _isotonic_line(found, x),
        *(part for row in found.bins for part in _bin_marks(row, x, size, unit)),
        viewBox=f"0 0 {PLOT_SIZE[0]} {PLOT_SIZE[1]}",
        class_="plot",
        role="img",
        aria_label=f"{vertical} over {named}",
    )


def _share_height(share: float) -> float:
    """y of a share in a plot."""
    return PLOT_TOP + (PLOT_BOTTOM - PLOT_TOP) * (1.0 - share)


def _grid_lines() -> list[Html]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = f"{_share_height(share):.1f}"
        style = "axis" if share == 0.0 else "grid"
        parts.append(element("line", x1=PLOT_LEFT, x2=PLOT_RIGHT, y1=y, y2=y, class_=style))
        label = f"{100 * share:.0f} %" if share in (0.0, 0.5, 1.0) else ""
        parts.append(element("text", label, x=PLOT_LEFT - 5, y=y, dy="0.35em", class_="end"))
    return parts


def _mean_line(share: float | None) -> Html | None:
    if share is None:
        return None
    y = f"{_share_height(share):.1f}"
    return element(
        "g",
        element("line", x1=PLOT_LEFT, x2=PLOT_RIGHT, y1=y, y2=y, class_="base"),
        element("title", f"of all: {100 * share:.1f} %"),
    )


def _isotonic_line(found: MarginCalibration, x: Callable[[float], float]) -> Html | None:
    """The isotonic fit, which jumps half way between its steps."""
    points, steps = [], found.isotonic
    for k, step in enumerate(steps):
        start = (steps[k - 1].high + step.low) / 2 if k else step.low
        end = (step.high + steps[k + 1].low) / 2 if k + 1 < len(steps) else step.high
        points += [f"{x(value):.1f},{_share_height(step.share):.1f}" for value in (start, end)]
    return element("path", d="M" + " L".join(points), class_="fit") if points else None


def _bin_marks(row: Bin, x: Callable[[float], float], size: float, unit: str) -> list[Html]:
    at = row.share if row.weighted is None else row.weighted
    place = f"{x(row.mean):.1f}"
    tip = (
        f"{row.successes} of {row.trials} trials, {format_number(size * row.low)} to"
        f" {format_number(size * row.high)} {unit}".rstrip()
    )
    value, low, high = (f"{_share_height(v or 0.0):.1f}" for v in (at.value, at.low, at.high))
    return [
        element(
            "line", element("title", tip), x1=place, x2=place, y1=low, y2=high, class_="whisker"
        ),
        element("circle", element("title", tip), cx=place, cy=value, r=3.5, class_="dot"),
    ]


def matrix_section(comparison: Comparison, judged: Named) -> Html:
    """Confusion matrices of the trials, and of all grasps that they stand for."""
    title = "Verdicts of both runs" if comparison.kind == "runs" else "Verdicts and outcomes"
    blocks = []
    for name, judgement in judged:
        found = [("selected trials", judgement.selected)]
        if judgement.all_grasps is not None:
            found.append(("all grasps", judgement.all_grasps))
        elif comparison.kind == "runs":
            found = [("grasps", judgement.selected)]
        suffix = f", {name}" if name else ""
        blocks += [_matrix_table(comparison, f"{which}{suffix}", a) for which, a in found]
    text = "Rows: what the simulation predicted. Columns: what happened."
    if comparison.kind == "runs":
        text = "Rows: the first run. Columns: the second run."
    if any(j.all_grasps is not None for _, j in judged):
        text += (
            " Each selected trial counts once; for all grasps it counts for all the"
            " grasps that it was chosen from."
        )
    return section(title, text, element("div", *blocks, class_="beside"))


def _matrix_table(comparison: Comparison, title: str, found: Agreement) -> Html:
    runs = comparison.kind == "runs"
    judge, other = ("in the first", "in the second") if runs else ("predicted", "on the robot")

    def cell(name: str, style: str) -> Html:
        value = format_count(round(getattr(found, name)))
        tip = cell_name(comparison, name)
        return element(
            "td", element("b", value), element("small", name.upper()), class_=style, title=tip
        )

    rows = [
        named_row(f"{verdict} {judge}", *cells)
        for verdict, cells in (
            ("success", (cell("tp", "right"), cell("fp", "wrong"))),
            ("failure", (cell("fn", "wrong"), cell("tn", "right"))),
        )
    ]
    head = ["", f"success {other}", f"failure {other}"]
    return element(
        "div", element("h3", title[0].upper() + title[1:]), table(head, rows, style="confusion")
    )


def figure_section(comparison: Comparison, judged: Named) -> Html:
    """All measures with their intervals."""
    found = measure_table(comparison, judged).html("figures")
    return section("Figures", _describe_intervals(judged), found)


def unpredictable_section(judged: Judgement) -> Html | None:
    """Figures with and without failures that the hand alone does not predict."""
    if judged.unpredictable is None:
        return None
    return section(
        "What the hand alone cannot predict",
        unpredictable_sentence(judged),
        unpredictable_table(judged).html("figures"),
    )


def standing_out_section(judged: Judgement) -> Html:
    """Objects and causes whose verdicts are wrong more often than those of others."""
    if not judged.standing_out:
        return section("What stands out", no_outliers_sentence(judged))
    rows = []
    for one in judged.standing_out:
        cells = (
            one.kind,
            "success" if one.predicted else "failure",
            f"{one.wrong} of {one.trials}",
            f"{one.other_wrong} of {one.other_trials}",
            outcome_counts_text(one.ended),
            format_number(one.corrected),
        )
        rows.append(named_row(outlier_name(one), *(element("td", cell) for cell in cells)))
    apart = " Failures that the hand alone cannot predict are left out."
    if judged.unpredictable is None:
        apart = ""
    names = ["", "what", "predicted", "wrong", "others wrong"]
    names += ["how the wrongly predicted ones ended", "p"]
    return section(
        "What stands out",
        "Objects, verdicts and bodies in the way for which predictions were wrong more"
        " often than for others with the same prediction. p: one-sided mid-p of Fisher's"
        f" exact test with Holm's correction for the {judged.tested_groups} tested"
        f" groups: if nothing differs, nothing is named in 19 of 20 experiments.{apart}",
        table(names, rows),
    )


def _describe_intervals(judged: Named) -> str:
    weighted = any(j.all_grasps is not None for _, j in judged)
    text = "Intervals are 95 % intervals: Wilson's for shares, a Bayesian bootstrap for all others."
    if weighted:
        text = (
            "The grasps were chosen from strata. Figures of the selected trials describe"
            " this experiment. In figures for all grasps each trial stands for its share"
            " of a stratum; they describe what a user of the simulator can expect. 95 %"
            " intervals: Wilson's for shares of the selected trials; a Bayesian"
            " bootstrap within strata for all others."
        )
    return text


def group_section(title: str, text: str, head: str, groups: Sequence[FactorGroup]) -> Html:
    """Counts, and shares with their intervals as dots and lines, by object or scene."""
    max_rows = 60
    if len(groups) > max_rows:
        text += f" The first {max_rows} of {len(groups)}."
    return section(title, text, group_table(head, groups).html("groups", max_rows))


def margin_section(comparison: Comparison, judged: Judgement) -> Html | None:
    """What margins say about success; nothing where there are none."""
    max_plots = 4  # Margins with a plot, the most informative first.
    defined = [c for c in judged.calibration if c.auroc.value is not None]
    found = sorted(defined, key=_distance_from_chance, reverse=True)
    title = f"Do margins predict {success_description(comparison)}?"
    if not found:
        words = too_few_trials_sentence(comparison, judged)
        return section(title, words) if words else None
    weighted = any(c.auroc_weighted is not None for c in found)
    head = ["margin", "trials"]
    head += ["AUROC, selected trials", "AUROC, all grasps"] if weighted else ["AUROC"]
    rows = [_margin_row(c, weighted) for c in found]
    plots = [reliability_plot(c, success_description(comparison)) for c in found[:max_plots]]
    trials = "grasps, each trial standing for its share," if weighted else "trials"
    text = (
        "AUROC: how often, of a grasp that succeeded and one that failed, the one that"
        " succeeded has the better margin (↑ larger, ↓ smaller); 0.5 means that the"
        f" margin tells nothing. Dots: share of successes among {trials} in bins of about"
        " equally many trials, with Wilson's intervals. Line: the monotone curve that"
        " fits best; dashes: the share of all."
    )
    return section(
        title,
        text,
        element("div", *plots, class_="charts plots"),
        table(head, rows, numbers=range(1, len(head)), style="figures"),
    )


def _distance_from_chance(found: MarginCalibration) -> float:
    """How far the interval stays from telling nothing; plots are drawn of those that tell most."""
    area = found.auroc_weighted or found.auroc
    low, high = area.low, area.high
    return -1.0 if low is None or high is None else max(low - 0.5, 0.5 - high)


def _margin_row(c: MarginCalibration, weighted: bool) -> Html:
    found = (c.auroc, c.auroc_weighted) if weighted else (c.auroc,)
    name = f"{margin_title(c.name)[0]} {'↓' if c.smaller_is_better else '↑'}"
    figures = (figure_cell(f or Estimate.undefined(""), percent=False) for f in found)
    return named_row(name, *number_cells([format_count(c.trials)]), *figures)


def placement_section(judged: Judgement, of: str) -> Html | None:
    """Agreement by placement; nothing without real trials. `of` says of which trials."""
    p = judged.placement
    if p is None or not p.within.trials + p.beyond.trials:
        return None
    limit = f"{p.limit_mm:g} mm"
    within, beyond = f"every object within {limit}", f"an object more than {limit} off"
    groups = placement_groups(p, within, beyond)
    text = (
        "Where objects were off their planned places, the simulation judged another"
        " scene than the robot had. If agreement is much better in the first row, the"
        " cause is placement and not physics."
    )
    plots = [reliability_plot(c, "right verdicts") for c in (p.largest, p.target) if c.trials]
    whole = group_section(f"By placement of the objects{of}", text, "placement", groups)
    return element("div", whole, element("div", *plots, class_="charts plots"))
