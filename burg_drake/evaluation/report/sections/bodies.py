"""Sections of the report about bodies: what was in the hand's way, and what was pushed around."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import MOVED, TURNED, Outcome
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.report.elements import Html, element, folded, table

MIN_DISPLACEMENT = 1e-3
"""Objects count as moved from this displacement on [m]."""


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
        numbers = [element("td", c, class_="number zero" if c == "·" else "number") for c in cells]
        rows.append(element("tr", element("th", name, scope="row"), *numbers))
    head = ["body", "grasps", "as target", "as obstacle", "median depth", "deepest"]
    return folded(
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
    names = [name.removeprefix(MOVED) for name in columns if name.startswith(MOVED)]
    moved = {name: columns[MOVED + name] for name in names}
    found = {name: int((far >= MIN_DISPLACEMENT).sum()) for name, far in moved.items()}
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
        ("main causes: trials"),
    ]
    toppled = _toppled(columns)
    rows = []
    for name in names:
        far = moved[name]
        mask = far >= MIN_DISPLACEMENT
        by, times = Counter(columns["instance"][mask].tolist()).most_common(1)[0]
        cells = [
            int(np.isfinite(far).sum()),
            found[name],
            int((far > disturbance).sum()) or "·",
            f"{np.median(far[mask]) * 1e3:.1f} mm",
            f"{far[mask].max() * 1e3:.1f} mm",
            _largest_turn(columns.get(TURNED + name), mask),
            toppled[name] or "·",
        ]
        numbers = [element("td", c, class_="number zero" if c == "·" else "number") for c in cells]
        cause = element("td", f"on {by} ({times})")
        rows.append(element("tr", element("th", name, scope="row"), *numbers, cause))
    return folded(
        "What was disturbed",
        f"Objects that were moved by {MIN_DISPLACEMENT * 1e3:g} mm or more in trials on"
        " other objects, whatever the outcome. Displacement is that of the point that"
        " moved farthest. An object toppled if it stood before and lies at the end.",
        table(head, rows, numbers=(1, 2, 3, 4, 5, 6, 7)),
    )


def _toppled(columns: Columns) -> Counter[str]:
    """In how many trials each object was toppled."""
    texts = columns.get("toppled", np.empty(0, dtype=np.str_))
    return Counter(name for text in texts[texts != ""].tolist() for name in text.split(", "))


def _largest_turn(angle: Array | None, mask: NDArray[np.bool_]) -> str:
    """The largest of the angles [rad] that are chosen, for people."""
    known = np.empty(0) if angle is None else angle[mask & np.isfinite(angle)]
    return f"{math.degrees(known.max()):.1f}°" if len(known) else "·"
