"""Sections of the report about failures: causes, obstacles, moved objects, arm, reachability."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    MOVED_PREFIX,
    TURNED_PREFIX,
    Array,
    BurgError,
    Outcome,
    Stage,
    display_unit,
    format_count,
    format_percent,
)
from burg_drake.evaluation.outcome_counts import Summary, TextValues, code_texts, member_codes
from burg_drake.evaluation.report.outcome_sections import outcome_text
from burg_drake.evaluation.report.page_elements import (
    GROUP_CLASSES,
    command,
    folded_section,
    number_cells,
    section,
    table,
    table_row,
)
from burg_drake.evaluation.results_table import Columns
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
    Child,
    Html,
    element,
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
"""Margin that ranks cases of an outcome by strength, by beginning of its name."""
CAUSE_MARGINS = tuple(name for name, _ in TYPICAL_MARGINS)


@dataclass(frozen=True, eq=False)
class CauseRows:
    """The grasps of one run or of many, by outcome, object and blocker.

    Attributes:
        outcomes: (N,) indices into `Outcome`.
        objects, blockers: of each grasp.
        margins: (N,) by name of `CAUSE_MARGINS`; those that the runs have.
        replay: the command that shows the grasp of a row.
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
        number: of grasps.
        objects, blockers: of these grasps, with their counts, most frequent first.
        typical: row of the median one.
    """

    outcome: Outcome
    number: int
    objects: tuple[tuple[str, int], ...]
    blockers: tuple[tuple[str, int], ...]
    typical: int


def rows_of_run(columns: Columns, path: str) -> CauseRows:
    """Those of a run in a folder."""
    ids = columns["id"]

    def replay(row: int) -> str:
        return shlex.join(["burg-drake", "replay", path, "--grasp", str(ids[row])])

    return CauseRows(
        outcomes=member_codes(columns["outcome"], tuple(Outcome)),
        objects=code_texts(columns["object"]),
        blockers=code_texts(columns["blocker"]),
        margins={name: columns[name] for name in CAUSE_MARGINS if name in columns},
        replay=replay,
    )


def find_causes(rows: CauseRows) -> list[Cause]:
    """Why grasps did not succeed, the most frequent cause first."""
    successes = (Outcome.LIFTED, Outcome.REACHABLE)  # Outcomes without a cause to look for.
    max_named = 3  # Objects and blockers that are listed for each outcome.
    found = []
    for place, outcome in enumerate(Outcome):
        mine = np.flatnonzero(rows.outcomes == place).astype(np.int64)
        if len(mine) and outcome not in successes:
            objects = rows.objects.most_common(mine, max_named)
            blockers = rows.blockers.most_common(mine, max_named)
            typical = typical_row(rows.margins, mine, outcome)
            found.append(Cause(outcome, len(mine), objects, blockers, typical))
    return sorted(found, key=lambda cause: -cause.number)


def typical_row(margins: Mapping[str, Array], rows: NDArray[np.int64], outcome: Outcome) -> int:
    """The median row of those with an outcome: by the margin that tells how strong a case it is,
    and by their order among equal ones; half of the cases are weaker, and half are stronger."""
    name = next((m for m, starts in TYPICAL_MARGINS if outcome.value.startswith(starts)), "")
    values = margins[name][rows] if name in margins else np.zeros(len(rows))
    known = np.isfinite(values)
    if known.any():
        rows, values = rows[known], values[known]
    order = np.argsort(values, kind="stable")
    return int(rows[order[(len(rows) - 1) // 2]])


def causes_section(rows: CauseRows) -> Html | None:
    """Each cause with its meaning, how often, where, and the command that shows a typical grasp;
    nothing where all grasps were lifted."""
    causes = find_causes(rows)
    if not causes:
        return None
    entries = (
        _cause_entry(cause, len(rows.outcomes), rows.replay(cause.typical)) for cause in causes
    )
    return section(
        "Why grasps fail",
        "The most frequent cause comes first. The command shows a typical case: half of"
        " the others are milder, half are worse.",
        element("div", *entries, class_="causes"),
    )


def _cause_entry(cause: Cause, whole: int, replay: str) -> Html:
    style = GROUP_CLASSES[outcome_group(cause.outcome).name]
    where = [f"on {_counted_names(cause.objects)}"]
    if cause.blockers:
        where.append(f"in the way: {_counted_names(cause.blockers)}")
    name = outcome_text(cause.outcome)
    share = f"{format_count(cause.number)} ({format_percent(cause.number / whole)})"
    return element(
        "article",
        element("h3", element("i", class_=style, aria_hidden="true"), name, element("span", share)),
        element("p", f"{cause.outcome.meaning}; {'; '.join(where)}"),
        command(replay),
    )


def _counted_names(named: tuple[tuple[str, int], ...]) -> str:
    return ", ".join(f"{name} ({format_count(number)})" for name, number in named)


def collision_section(columns: Columns) -> Html | None:
    """What the open hand collided with at the start and how deep; nothing if it never did."""
    collides = np.char.startswith(columns["outcome"], "collision_")
    if not collides.any():
        return None
    blockers = Counter(columns["blocker"][collides].tolist())
    rows = []
    for name, count in blockers.most_common():
        mask = collides & (columns["blocker"] == name)
        depth = columns["overlap"][mask] * 1e3
        own = int((columns["outcome"][mask] == Outcome.COLLISION_TARGET).sum())
        cells = [
            count,
            own or "·",
            count - own or "·",
            f"{np.median(depth):.1f} mm",
            f"{depth.max():.1f} mm",
        ]
        rows.append(table_row(name, *number_cells(cells)))
    head = ["body", "grasps", "as target", "as obstacle", "median depth", "deepest"]
    return folded_section(
        "Start collisions",
        "Bodies that the open hand overlaps at the grasp, and how far the hand would"
        " have to move back. Each grasp counts for one body, even if the hand overlaps"
        " several.",
        table(head, rows, numbers=(1, 2, 3, 4, 5)),
    )


def disturbed_section(columns: Columns, disturbance: float) -> Html | None:
    """Which objects were moved, turned and toppled in trials on others; nothing if all stayed where
    they were.

    Args:
        columns: the results.
        disturbance: displacement from which on a lifted grasp counts as disturbing [m].
    """
    min_displacement = 1e-3  # Metres from which an object counts as moved.
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
    toppled = _toppled(columns)
    rows = []
    for name in names:
        far = moved[name]
        mask = far >= min_displacement
        by, times = Counter(columns["instance"][mask].tolist()).most_common(1)[0]
        cells = [
            int(np.isfinite(far).sum()),
            found[name],
            int((far > disturbance).sum()) or "·",
            f"{np.median(far[mask]) * 1e3:.1f} mm",
            f"{far[mask].max() * 1e3:.1f} mm",
            _largest_turn(columns.get(TURNED_PREFIX + name), mask),
            toppled[name] or "·",
        ]
        cause = element("td", f"on {by} ({times})")
        rows.append(table_row(name, *number_cells(cells), cause))
    return folded_section(
        "What was disturbed",
        f"Objects that were moved by {min_displacement * 1e3:g} mm or more in trials on"
        " other objects, whatever the outcome. Displacement is that of the point that"
        " moved farthest. An object toppled if it stood before and lies at the end.",
        table(head, rows, numbers=(1, 2, 3, 4, 5, 6, 7)),
    )


def _toppled(columns: Columns) -> Counter[str]:
    """In how many trials each object was toppled."""
    texts = columns.get("toppled", np.empty(0, dtype=np.str_))
    return Counter(name for text in texts[texts != ""].tolist() for name in text.split(", "))


def _largest_turn(angle: Array | None, mask: NDArray[np.bool_]) -> str:
    """The largest of the chosen angles [rad] in degrees."""
    known = np.empty(0) if angle is None else angle[mask & np.isfinite(angle)]
    return f"{math.degrees(known.max()):.1f}°" if len(known) else "·"


def arm_section(summary: Summary, columns: Columns) -> Html | None:
    """What hindered the arm, and what was in its way; nothing if it was not asked."""
    # Outcomes between a clear hand and the trial.
    arm_outcomes = tuple(o for o in Outcome if o.stage in (Stage.REACHABLE, Stage.PLANNED))
    if summary.mode == "hand":
        return None
    clear, planned = summary.total.clear, summary.total.planned
    rows = []
    for outcome in arm_outcomes:
        count = summary.total.outcomes[outcome]
        if count:
            cells = number_cells((count, format_percent(count / clear)))
            cells += [element("td", outcome.meaning), element("td", _blockers(columns, outcome))]
            rows.append(table_row(outcome_text(outcome), *cells))
    share = f" ({format_percent(planned / clear)})" if clear else ""
    text = (
        f"The open hand is clear at {clear} grasps. The arm can execute {planned} of them"
        f"{share}: it has a collision-free path from home to the pregrasp, and can follow"
        " the straight approach and the lift. Each of the other grasps is listed under"
        " the first thing that fails."
    )
    head = ["outcome", "grasps", "of clear", "what it means", "main obstacles"]
    return folded_section(
        "What stopped the arm", text, table(head, rows, numbers=(1, 2)) if rows else ""
    )


def _blockers(columns: Columns, outcome: Outcome) -> str:
    named = columns["blocker"][(columns["outcome"] == outcome) & (columns["blocker"] != "")]
    found = Counter(named.tolist()).most_common(3)
    return ", ".join(f"{name} ({count})" for name, count in found)


def execution_section(summary: Summary, columns: Columns) -> Html | None:
    """How the arm executed its plans; nothing where it did not."""
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
            cells: list[Child] = [len(values), *(f"{figure:.3g} {unit}" for figure in figures)]
            rows.append(table_row(label, *number_cells(cells)))
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
    return section("Execution by the arm", text, table(head, rows, numbers=(1, 2, 3, 4)))


PICTURE_SETTINGS = ReachabilitySettings(spacing=0.043, redundant=(2, 6))
"""Half the points of the default, for a picture."""


def reachability_section(run: Run) -> Html | None:
    """The board without its objects, and where these stand on it; nothing for a run of the hand
    alone, nor if the files that it was judged with are gone or have changed."""
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
    count = len(reachability.tilt)
    steepest = max(PICTURE_SETTINGS.tilts_deg)
    return section(
        "Reach of the arm",
        f"Share of {count} hand orientations (straight down, and tilted by up to "
        f"{steepest:g}° to all sides) in which the arm reaches each place over the board"
        " without colliding with itself or the station. Outlines show where the objects"
        " stand; they are not obstacles here. Paths to these poses are not checked.",
        element("div", *charts, class_="charts"),
        reachability_key(),
    )


def _board_map(scene: Scene, station: Station) -> ReachabilityMap:
    """The map of a scene without objects; made once a process for the same contents."""
    key = scene.content, station.content
    if key not in _CACHED_MAPS:
        _CACHED_MAPS[key] = map_reachability(scene, station, settings=PICTURE_SETTINGS)
    return _CACHED_MAPS[key]


_CACHED_MAPS: dict[tuple[str, str], ReachabilityMap] = {}
