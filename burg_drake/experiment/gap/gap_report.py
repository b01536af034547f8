"""Page about the steps at which grasps are lost: one self-contained HTML file."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import (
    PUSHED_PREFIX,
    Outcome,
    atomic_write,
    count_with_noun,
    format_percent,
    outcome_label,
)
from burg_drake.evaluation import (
    GROUP_CLASSES,
    MIN_PUSH,
    command,
    count_pushes,
    engine_label,
    header,
    html_page,
    section,
    tiles,
)
from burg_drake.experiment.comparison.finding_tables import FindingTable, cross_table
from burg_drake.experiment.gap.gap_steps import (
    Change,
    GapSteps,
    StepAgreement,
    gap_changes,
    successes_by_object,
)
from burg_drake.experiment.gap.gap_words import (
    GAP_STEP_TITLES,
    left_out_sentence,
    reality_table,
    replay_arguments,
    step_sentences,
)
from burg_drake.experiment.trials.trial_sheet import Success
from burg_drake.visualization import (
    OUTCOME_GROUPS,
    Child,
    Html,
    element,
    interval_mark,
    join,
    outcome_group,
)

GAP_REPORT_FILE = "gap.html"  # Page about a gap measurement, in its folder.


def write_gap_report(
    steps: GapSteps, success: Success, agreement: Sequence[StepAgreement], command_line: str
) -> None:
    """Writes the page into the folder of the steps.

    Args:
        steps: all steps.
        success: criterion of success.
        agreement: agreement with real trials, if there are any.
        command_line: command that repeats the measurement.

    Raises:
        InvalidInputError: it cannot be written.
    """
    page = gap_page(steps, success, agreement, command_line)
    atomic_write(steps.path / GAP_REPORT_FILE, page)


def gap_page(
    steps: GapSteps, success: Success, agreement: Sequence[StepAgreement], command_line: str
) -> str:
    """The page as HTML."""
    found = gap_changes(steps, success)
    document = steps.first.document
    title = f"{document.scene.name} on {document.station.name}"
    return html_page(
        f"Where grasps are lost: {title}",
        element("style", Html(FLOW_CHART_STYLE)),
        header("Where grasps are lost", title, _subtitle(steps, success)),
        element("p", " ".join(step_sentences(steps, found, success)), class_="lead"),
        tiles(_tiles(steps, found)),
        flow_section(steps, found),
        objects_section(steps, success),
        *(change_section(change) for change in found),
        push_section(steps),
        reality_table(agreement).section() if agreement and agreement[0].selected.trials else None,
        _reproduction_section(steps, command_line),
    )


def _subtitle(steps: GapSteps, success: Success) -> str:
    document = steps.first.document
    counts = "lifted, and nothing else disturbed" if success == "lifted" else "lifted and held"
    about = f"{document.grasps.count} grasps, engine {engine_label(document.engine)}"
    return f"{about}; success: {counts}"


def _tiles(steps: GapSteps, changes: Sequence[Change]) -> list[tuple[str, Child, str]]:
    grasps = len(steps.first.candidates)
    entries: list[tuple[str, Child, str]] = [("Grasps", f"{grasps}", "the same in every step")]
    first = changes[0].successes if changes else 0
    if changes and changes[0].step != "placed":
        entries.append((GAP_STEP_TITLES["hand"].capitalize(), f"{first}", "succeed"))
    for change in changes:
        left = change.successes - len(change.lost) + len(change.won)
        if change.step == "placed":
            share = format_percent(left / change.successes) if change.successes else "-"
            entries.append(("Objects displaced", share, "of these succeed again"))
        else:
            note = f"{len(change.lost)} lost, {len(change.won)} won"
            entries.append((GAP_STEP_TITLES[change.step].capitalize(), f"{left}", note))
    return entries


def _reproduction_section(steps: GapSteps, command_line: str) -> Html:
    document = steps.document
    facts = [("folder", str(steps.path))]
    facts += [
        (GAP_STEP_TITLES[step.name], ", ".join(str(run.path) for run in step.runs) or "-")
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


GAP_STEP_DESCRIPTIONS = {
    "reach": "The same simulation of the hand, but only of grasps that the arm can execute: with"
    " a posture within its limits, a straight approach, a straight lift and a path, all"
    " free of collisions.",
    "arm": "The whole arm executes the grasps that it can reach, from the pregrasp on, with"
    " controllers that yield; here the hand may push objects before it closes.",
    "placed": "The hand goes where it was planned to go, but the objects stand a little off. It"
    " counts as a collision if the open hand overlaps a displaced object. The arm knows"
    " where things stand and plans its path again. Each grasp counts once a scene.",
}
"""Description of each step."""


def flow_section(steps: GapSteps, changes: Sequence[Change]) -> Html | None:
    """Section with the chart of all steps."""
    if not changes:
        return None
    columns = []
    for step in steps.steps:
        outcomes = Counter(v.outcome for run in step.runs for v in run.verdicts.values())
        placed = step.name == "placed"
        scenes = f" in {count_with_noun(len(step.runs), 'scene')}" if placed else ""
        columns.append(FlowColumn(GAP_STEP_TITLES[step.name] + scenes, outcomes))
    scale = [1.0 / max(len(step.runs), 1) for step in steps.steps]
    return section(
        "From step to step",
        "How grasps end in each step; the colour of a band is that of the outcome in the"
        " next step. In displaced scenes only grasps that succeeded in the step before"
        " are tried, each once a scene.",
        element("div", flow_chart(columns, [c.flow for c in changes], scale), class_="scroll"),
    )


def objects_section(steps: GapSteps, success: Success) -> Html:
    """Section with the successes of each object in each step."""
    by_step = [successes_by_object(step, success) for step in steps.steps]
    head = ["grasps", *(GAP_STEP_TITLES[step.name] for step in steps.steps)]
    rows = []
    for name, (_, grasps) in by_step[0].items():
        cells: list[Child] = [grasps]
        for step, counts in zip(steps.steps, by_step, strict=True):
            good, all = counts.get(name, (0, 0))
            share = f"{good} of {all}" if all else "-"
            cells.append(share if step.name == "placed" else good)
        rows.append((name, cells))
    return section(
        "By object",
        "Grasps of each object that succeed in each step; in displaced scenes, successful trials.",
        cross_table("object", head, rows),
    )


def change_section(change: Change) -> Html:
    """Section on the changes by one step: outcomes, objects, blockers and grasps."""
    lost, whole = len(change.lost), change.successes
    parts: list[Child] = []
    if whole:
        low, high = change.share_lost
        share = f"{lost} of {whole} successes are lost ({format_percent(lost / whole)})"
        mark = interval_mark(lost / whole, low, high)
        parts.append(element("p", f"{share} ", mark))
    if change.failed:
        parts.append(element("p", left_out_sentence(change)))
    if change.lost or change.won:
        parts += [_flow_table(change), _objects_table(change), _change_list(change)]
    title = GAP_STEP_TITLES[change.step].capitalize()
    return section(title, GAP_STEP_DESCRIPTIONS[change.step], *parts)


def _flow_table(change: Change) -> Html:
    """Table of outcomes that differ before and after the step."""
    changed = {pair: count for pair, count in change.flow.items() if pair[0] is not pair[1]}
    found = FindingTable().texts("before", "after").numbers("grasps").texts("in the way")
    for (before, after), count in sorted(changed.items(), key=lambda item: -item[1]):
        blockers = Counter(
            m.blocker for m in change.moves if (m.before, m.after) == (before, after) and m.blocker
        )
        names = ", ".join(f"{name} {n}" for name, n in blockers.most_common(3))
        found.row(outcome_label(before), outcome_label(after), count, names or "-")
    return found.page_table()


def _objects_table(change: Change) -> Html | None:
    """Table of the changes by object."""
    lost = Counter(move.object for move in change.lost)
    if not lost:
        return None
    held_before = Counter(m.object for m in change.moves if m.lost or m.before.held)
    found = FindingTable().names("object").numbers("lost").texts("what they become")
    for name, count in lost.most_common():
        into = Counter(m.after for m in change.lost if m.object == name)
        outcomes = ", ".join(f"{outcome_label(o)} {n}" for o, n in into.most_common(3))
        found.row(name, f"{count} of {held_before[name]}", outcomes)
    return found.page_table()


def _change_list(change: Change) -> Html:
    """List of the changed grasps with the commands that show them."""
    max_rows = 40  # Maximum number of grasps in the table of a step.
    moves = [*change.lost, *change.won]
    found = FindingTable(max_page_rows=max_rows)
    found.names("grasp").texts("before", "after", "in the way", "command")
    for move in moves:
        before, after = outcome_label(move.before), outcome_label(move.after)
        line = shlex.join(replay_arguments(move.run, move.grasp))
        grasp, replay = element("code", move.grasp), element("code", line, class_="copy")
        found.row(grasp, before, after, move.blocker or "-", replay)
    first = shlex.join(replay_arguments(moves[0].run, moves[0].grasp))
    more = f", the first {max_rows} of {len(moves)}" if len(moves) > max_rows else ""
    inside = join(
        element("p", "To watch one of them (replay also shows what was in the way):"),
        command(first),
        found.page_table(),
    )
    return element("details", element("summary", f"Grasps that change{more}"), inside)


def push_section(steps: GapSteps) -> Html | None:
    """Section on objects that the hand pushes before it closes."""
    arm = next((step.runs[0] for step in steps.steps if step.name == "arm"), None)
    columns = {} if arm is None else arm.results
    sentence = count_pushes(columns)
    if sentence is None:
        return None
    measured = np.isfinite(columns["pushed"])
    missing = np.full(len(measured), np.nan)
    target_push = np.array(
        [
            columns.get(f"{PUSHED_PREFIX}{name}", missing)[k]
            for k, name in enumerate(columns["instance"])
        ]
    )
    rows = []
    for name in dict.fromkeys(columns["object"].tolist()):
        of_object = measured & (columns["object"] == name)
        if not of_object.any():
            continue
        push_mm = 1e3 * target_push[of_object]
        pushed = push_mm > 1e3 * MIN_PUSH
        held = np.array([Outcome(o).held for o in columns["outcome"][of_object]])
        cells: list[Child] = [
            int(of_object.sum()),
            int(pushed.sum()),
            f"{np.median(push_mm):.1f}",
            f"{push_mm.max():.1f}",
            f"{int((held & pushed).sum())} of {int(pushed.sum())}",
            f"{int((held & ~pushed).sum())} of {int((~pushed).sum())}",
        ]
        rows.append((name, cells))
    limit = f"{1e3 * MIN_PUSH:g} mm"
    head = ["trials", f"pushed over {limit}", "median [mm]", "largest [mm]"]
    head += ["held if pushed", "held if not"]
    return section(
        "Pushed before the hand closes",
        f"{sentence} The table counts only the object to be grasped.",
        cross_table("object", head, rows),
    )


FLOW_CHART_SIZE = 1000, 430  # width and height in SVG units
FLOW_CHART_TOP = 34  # space for the column headings
NODE_WIDTH = 14
NODE_GAP = 19  # space for a name between two nodes
FLOW_CHART_STYLE = """
.flow { width: 100%; min-width: 680px; height: auto; }
.flow text { font-size: 13px; fill: var(--ink); paint-order: stroke; stroke: var(--paper);
  stroke-width: 3px; stroke-linejoin: round; }
.flow .head { font-weight: 600; font-size: 14px; }
.flow path { opacity: 0.38; }
.scroll + .scroll { margin-top: 20px; }
"""
"""CSS of the chart."""
Flow = Counter[tuple[Outcome, Outcome]]


@dataclass(frozen=True)
class FlowColumn:
    """A column of the flow chart: one step.

    Attributes:
        title: name of the step.
        counts: number of grasps by outcome.
    """

    title: str
    counts: Counter[Outcome]


def flow_chart(
    columns: Sequence[FlowColumn], flows: Sequence[Flow], scale: Sequence[float]
) -> Html:
    """Flow chart of the outcomes of all steps.

    Args:
        columns: one per step.
        flows: counts between each column and the next; grasps that are in no flow end in their
            column.
        scale: grasps per count in each column, such as 1/5 if each grasp was judged in five scenes.
    """
    whole = max((c.counts.total() * s for c, s in zip(columns, scale, strict=True)), default=1.0)
    rows = max(len(_count_by_group(column)) for column in columns)
    width, height = FLOW_CHART_SIZE
    unit = (height - FLOW_CHART_TOP - NODE_GAP * rows) / max(whole, 1e-9)
    names_width = 190  # width of the names of the last column
    step = (width - names_width - NODE_WIDTH) / max(len(columns) - 1, 1)
    places = [_node_tops(c, s * unit) for c, s in zip(columns, scale, strict=True)]
    bands: list[Html] = []
    for k, flow in enumerate(flows):
        bands += _draw_bands(flow, places[k], places[k + 1], k * step, step, scale[k + 1] * unit)
    nodes = [
        part
        for k, column in enumerate(columns)
        for part in _draw_nodes(column, places[k], k * step, scale[k] * unit)
    ]
    return element(
        "svg",
        *bands,
        *nodes,
        viewBox=f"0 0 {width} {height}",
        class_="flow",
        role="img",
        aria_label="Flow of grasps between outcomes; the tables below have the numbers",
    )


def _count_by_group(column: FlowColumn) -> dict[str, int]:
    found = {g.name: sum(column.counts[o] for o in g.outcomes) for g in OUTCOME_GROUPS}
    return {name: count for name, count in found.items() if count}


def _node_tops(column: FlowColumn, unit: float) -> dict[str, float]:
    """Upper edge of each group's node."""
    y, places = float(FLOW_CHART_TOP), {}
    for name, count in _count_by_group(column).items():
        places[name] = y
        y += count * unit + NODE_GAP
    return places


def _draw_nodes(column: FlowColumn, places: dict[str, float], x: float, unit: float) -> list[Html]:
    parts = [element("text", column.title, x=f"{x:.1f}", y=16, class_="head")]
    for name, count in _count_by_group(column).items():
        height = max(count * unit, 1.0)
        tip = element("title", f"{count} {name}")
        y = places[name]
        parts.append(
            element(
                "rect",
                tip,
                x=f"{x:.1f}",
                y=f"{y:.1f}",
                width=NODE_WIDTH,
                height=f"{height:.1f}",
                class_=GROUP_CLASSES[name],
            )
        )
        middle = f"{y + height / 2 + 4.5:.1f}"
        label = element("text", f"{count} {name}", x=f"{x + NODE_WIDTH + 6:.1f}", y=middle)
        parts.append(label)
    return parts


def _draw_bands(
    flow: Flow,
    before: dict[str, float],
    after: dict[str, float],
    x: float,
    step: float,
    unit: float,
) -> list[Html]:
    pairs: Counter[tuple[str, str]] = Counter()
    for (a, b), count in flow.items():
        pairs[outcome_group(a).name, outcome_group(b).name] += count
    starts, ends = dict(before), dict(after)
    order = [group.name for group in OUTCOME_GROUPS]
    parts = []
    for pair in sorted(pairs, key=lambda pair: (order.index(pair[0]), order.index(pair[1]))):
        first, second = pair
        thick = pairs[pair] * unit
        tip = element("title", f"{pairs[pair]}: {first} → {second}")
        shape = _band_path(x + NODE_WIDTH, starts[first], x + step, ends[second], thick)
        parts.append(element("path", tip, d=shape, class_=GROUP_CLASSES[second]))
        starts[first] += thick
        ends[second] += thick
    return parts


def _band_path(x0: float, y0: float, x1: float, y1: float, thick: float) -> str:
    middle = (x0 + x1) / 2
    return (
        f"M{x0:.1f},{y0:.1f}C{middle:.1f},{y0:.1f} {middle:.1f},{y1:.1f} {x1:.1f},{y1:.1f}"
        f"V{y1 + thick:.1f}C{middle:.1f},{y1 + thick:.1f} {middle:.1f},{y0 + thick:.1f}"
        f" {x0:.1f},{y0 + thick:.1f}Z"
    )
