"""Sections of the report about failures: causes, obstacles, moved objects, arm, reachability."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    MOVED_PREFIX,
    NO_VALUE,
    TURNED_PREFIX,
    Array,
    BurgError,
    Outcome,
    Stage,
    display_unit,
    format_percent,
)
from burg_drake.evaluation.outcome_counts import Summary, member_codes
from burg_drake.evaluation.report.outcome_sections import outcome_text
from burg_drake.evaluation.report.page_elements import GROUP_CLASSES, ReportSection
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import TextValues
from burg_drake.evaluation.run_folder import Run
from burg_drake.motion import (
    ReachabilityMap,
    ReachabilitySettings,
    map_reachability,
    without_free_objects,
)
from burg_drake.scene import Scene
from burg_drake.station import Station
from burg_drake.visualization import (
    Html,
    PageTable,
    object_outlines,
    outcome_group,
    reachability_chart,
    reachability_key,
)

TYPICAL_MARGINS = (
    ("overlap", ("collision_",)),
    ("joint_excess", ("joint_limit",)),
    ("arm_clearance", ("arm_collision", "hand_collision_")),
    ("others_moved", ("lifted_disturbed",)),
    ("tilt", ("lifted_turned",)),
    ("slip", ("slipped", "dropped")),
    ("lift", ("blocked",)),
)
"""Margin that ranks the cases of an outcome by severity, by prefix of the outcome's name."""
CAUSE_MARGINS = tuple(name for name, _ in TYPICAL_MARGINS)


@dataclass(frozen=True, eq=False)
class CauseRows:
    """Outcome, object and blocker of the grasps of one run or of many.

    Attributes:
        outcomes: (N,) indices into `Outcome`.
        objects, blockers: (N,) object and blocker of each grasp.
        margins: (N,) the available margins of `CAUSE_MARGINS` by name.
        replay: returns the command that shows the grasp of a row.
    """

    outcomes: NDArray[np.int8]
    objects: TextValues
    blockers: TextValues
    margins: Mapping[str, Array]
    replay: Callable[[int], str]


@dataclass(frozen=True)
class Cause:
    """Grasps with the same outcome.

    Attributes:
        outcome: the outcome.
        number: number of grasps.
        objects, blockers: counts of the grasps' objects and blockers, most frequent first.
        share: share of all grasps.
        replay: command that shows the median grasp.
    """

    outcome: Outcome
    number: int
    objects: tuple[tuple[str, int], ...]
    blockers: tuple[tuple[str, int], ...]
    share: float
    replay: str

    @property
    def name(self) -> str:
        """Displayed name of the outcome."""
        return outcome_text(self.outcome)

    @property
    def style(self) -> str:
        """CSS class of the outcome's colour."""
        return GROUP_CLASSES[outcome_group(self.outcome).name]


def rows_of_run(columns: ResultRows, path: str) -> CauseRows:
    """The rows of a run in a folder."""

    def replay(row: int) -> str:
        (id,) = columns.cells("id", np.array([row])).tolist()
        return shlex.join(["burg-drake", "replay", path, "--grasp", id])

    return CauseRows(
        outcomes=member_codes(columns.codes("outcome"), tuple(Outcome)),
        objects=columns.codes("object"),
        blockers=columns.codes("blocker"),
        margins={name: columns[name] for name in CAUSE_MARGINS if name in columns},
        replay=replay,
    )


def find_causes(rows: CauseRows) -> list[Cause]:
    """Causes of failure, most frequent first."""
    successes = (Outcome.LIFTED, Outcome.REACHABLE)  # Outcomes that are no failures.
    max_named = 3  # Number of objects and blockers listed for each outcome.
    found = []
    for code, outcome in enumerate(Outcome):
        mine = np.flatnonzero(rows.outcomes == code).astype(np.int64)
        if len(mine) and outcome not in successes:
            objects = rows.objects.most_common(mine, max_named)
            blockers = rows.blockers.most_common(mine, max_named)
            replay = rows.replay(typical_row(rows.margins, mine, outcome))
            share = len(mine) / len(rows.outcomes)
            found.append(Cause(outcome, len(mine), objects, blockers, share, replay))
    return sorted(found, key=lambda cause: -cause.number)


def typical_row(margins: Mapping[str, Array], rows: NDArray[np.int64], outcome: Outcome) -> int:
    """Index of the median row of an outcome, by the margin that ranks its cases by severity."""
    name = next((m for m, starts in TYPICAL_MARGINS if outcome.value.startswith(starts)), "")
    values = margins[name][rows] if name in margins else np.zeros(len(rows))
    known = np.isfinite(values)
    if known.any():
        rows, values = rows[known], values[known]
    order = np.argsort(values, kind="stable")
    return int(rows[order[(len(rows) - 1) // 2]])


def collision_section(columns: ResultRows) -> ReportSection | None:
    """Section of the bodies that the open hand overlaps at the grasp; None if there are none."""
    outcomes, blockers = columns.codes("outcome"), columns.codes("blocker")
    overlap = columns["overlap"]
    collision = [name.startswith("collision_") for name in outcomes.names]
    collides = np.array(collision, dtype=bool)[outcomes.codes]
    on_target = np.array([name == Outcome.COLLISION_TARGET for name in outcomes.names], dtype=bool)
    if not collides.any():
        return None
    found = np.unique(blockers.codes[collides], return_index=True, return_counts=True)
    order = np.lexsort((found[1], -found[2]))
    rows = []
    for code, count in zip(found[0][order].tolist(), found[2][order].tolist(), strict=True):
        name = blockers.names[code]
        mask = collides & (blockers.codes == code)
        depth = overlap[mask] * 1e3
        own = int(on_target[outcomes.codes[mask]].sum())
        cells = [
            name,
            count,
            own or NO_VALUE,
            count - own or NO_VALUE,
            f"{np.median(depth):.1f} mm",
            f"{depth.max():.1f} mm",
        ]
        rows.append(cells)
    head = ["body", "grasps", "as target", "as obstacle", "median depth", "deepest"]
    return ReportSection(
        "Start collisions",
        "Bodies that the open hand overlaps at the grasp, and how far the hand would"
        " have to move back. Each grasp counts for one body, even if the hand overlaps"
        " several.",
        PageTable(head, rows, (1, 2, 3, 4, 5)),
    )


def disturbed_section(columns: ResultRows, disturbance: float) -> ReportSection | None:
    """Section of objects that were moved, turned or toppled in trials on others; None if there are
    none.

    Args:
        columns: the results.
        disturbance: displacement above which a lifted grasp counts as disturbing [m].
    """
    min_displacement = 1e-3  # Metres above which an object counts as moved.
    names = [name.removeprefix(MOVED_PREFIX) for name in columns if name.startswith(MOVED_PREFIX)]
    moved = {name: columns[MOVED_PREFIX + name] for name in names}
    found = {name: int((far >= min_displacement).sum()) for name, far in moved.items()}
    names = sorted((name for name in names if found[name]), key=lambda name: -found[name])
    if not names:
        return None
    limit = f"over {disturbance * 1e3:g} mm"
    head = [
        "object",
        "trials on others",
        "moved",
        limit,
        "median",
        "farthest",
        "turned by at most",
        "toppled",
        "main causes: trials",
    ]
    toppled = _count_toppled(columns)
    rows = []
    for name in names:
        far = moved[name]
        mask = far >= min_displacement
        by, times = Counter(columns["instance"][mask].tolist()).most_common(1)[0]
        cells = [
            name,
            int(np.isfinite(far).sum()),
            found[name],
            int((far > disturbance).sum()) or NO_VALUE,
            f"{np.median(far[mask]) * 1e3:.1f} mm",
            f"{far[mask].max() * 1e3:.1f} mm",
            _largest_turn(columns.get(TURNED_PREFIX + name), mask),
            toppled[name] or NO_VALUE,
            f"on {by} ({times})",
        ]
        rows.append(cells)
    return ReportSection(
        "What was disturbed",
        f"Objects that were moved by {min_displacement * 1e3:g} mm or more in trials on"
        " other objects, whatever the outcome. Displacement is that of the point that"
        " moved farthest. An object toppled if it stood before and lies at the end.",
        PageTable(head, rows, (1, 2, 3, 4, 5, 6, 7)),
    )


def _count_toppled(columns: ResultRows) -> Counter[str]:
    """Number of trials in which each object was toppled."""
    texts = columns.get("toppled", np.empty(0, dtype=np.str_))
    return Counter(name for text in texts[texts != ""].tolist() for name in text.split(", "))


def _largest_turn(angle: Array | None, mask: NDArray[np.bool_]) -> str:
    """The largest of the chosen angles [rad] in degrees."""
    known = np.empty(0) if angle is None else angle[mask & np.isfinite(angle)]
    return f"{math.degrees(known.max()):.1f}°" if len(known) else NO_VALUE


def arm_section(summary: Summary, columns: ResultRows) -> ReportSection | None:
    """Section of outcomes of the arm, with obstacles; None if the arm was not checked."""
    # Outcomes between a clear hand and the trial.
    arm_outcomes = tuple(o for o in Outcome if o.stage in (Stage.REACHABLE, Stage.PLANNED))
    if summary.mode == "hand":
        return None
    clear, planned = summary.total.clear, summary.total.planned
    rows = []
    for outcome in arm_outcomes:
        count = summary.total.outcomes[outcome]
        if count:
            share, blockers = format_percent(count / clear), _count_blockers(columns, outcome)
            rows.append([outcome_text(outcome), count, share, outcome.meaning, blockers])
    share = f" ({format_percent(planned / clear)})" if clear else ""
    text = (
        f"The open hand is clear at {clear} grasps. The arm can execute {planned} of them"
        f"{share}: it has a collision-free path from home to the pregrasp, and can follow"
        " the straight approach and the lift. Each of the other grasps is listed under"
        " the first thing that fails."
    )
    head = ["outcome", "grasps", "of clear", "what it means", "main obstacles"]
    found = PageTable(head, rows, (1, 2)) if rows else None
    return ReportSection("What stopped the arm", text, found)


def _count_blockers(columns: ResultRows, outcome: Outcome) -> str:
    named = columns["blocker"][(columns["outcome"] == outcome) & (columns["blocker"] != "")]
    found = Counter(named.tolist()).most_common(3)
    return ", ".join(f"{name} ({count})" for name, count in found)


def execution_section(summary: Summary, columns: ResultRows) -> ReportSection | None:
    """Section on the arm's execution of its plans; None if there was none."""
    if "tracking_error" not in columns or not np.isfinite(columns["tracking_error"]).any():
        return None
    rows = []
    for name, label in (
        ("duration", "duration of the motion"),
        ("tracking_error", "largest joint error"),
        ("tracking_distance", "largest error of the grasp frame"),
        ("pushed", "largest push before the hand closed"),
    ):
        unit, factor = display_unit(name)
        values = columns[name][np.isfinite(columns[name])] * factor
        if len(values):
            figures = (np.median(values), np.quantile(values, 0.95), values.max())
            rows.append([label, len(values), *(f"{figure:.3g} {unit}" for figure in figures)])
    touches = Counter(t for t in columns["touched"].tolist() if t)
    text = "How closely the simulated arm followed its plans within its torque limits."
    text += f" {summary.pushes}" if summary.pushes else ""
    if touches:
        found = ", ".join(f"{name} ({count})" for name, count in touches.most_common(3))
        text += (
            f" In {sum(touches.values())} trials the robot touched something that was not"
            f" planned: {found}."
        )
    head = ["", "trials", "median", "95 %", "most"]
    return ReportSection("Execution by the arm", text, PageTable(head, rows, (1, 2, 3, 4)))


PICTURE_SETTINGS = ReachabilitySettings(spacing=0.043, redundant=(2, 6))
"""Half the default number of points, which suffices for a picture."""


@dataclass(frozen=True)
class ReachCharts:
    """Reachability maps of the board without objects.

    Attributes:
        charts: a map for each height.
        key: legend of their colours.
        orientations: number of hand orientations that were tried at each place.
        max_tilt_deg: largest tilt of the orientations.
    """

    charts: Sequence[Html]
    key: Html
    orientations: int
    max_tilt_deg: float


def reachability_section(run: Run) -> ReachCharts | None:
    """Reachability of the board without objects, with the objects' places; None for a run of the
    hand alone, or if the run's input files are gone or have changed.
    """
    if run.document.mode == "hand":
        return None
    try:
        scene, station = run.scene(), run.station()
        reachability = _board_map(without_free_objects(scene), station)
    except BurgError:
        return None
    around = object_outlines(scene)
    charts = [
        reachability_chart(reachability, height, around)
        for height in range(len(reachability.heights))
    ]
    return ReachCharts(
        charts, reachability_key(), len(reachability.tilt), max(PICTURE_SETTINGS.tilts_deg)
    )


def _board_map(scene: Scene, station: Station) -> ReachabilityMap:
    """The map of a scene without objects; made once per process for the same content."""
    key = scene.content, station.content
    if key not in _CACHED_MAPS:
        _CACHED_MAPS[key] = map_reachability(scene, station, settings=PICTURE_SETTINGS)
    return _CACHED_MAPS[key]


_CACHED_MAPS: dict[tuple[str, str], ReachabilityMap] = {}
