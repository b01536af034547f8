"""What keys do with what is selected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from burg_drake.compose import ComposeSession
from burg_drake.compose.commands import Delete, Duplicate, MoveObjects, PutDown, SetPose, Turn
from burg_drake.compose.document import nearest_stable_pose
from burg_drake.core import InvalidInputError

MOVE_STEP, FINE_MOVE_STEP = 5e-3, 1e-3
"""By which an arrow moves what is selected [m]."""
TURN_DEG = 15.0

DIRECTIONS = {
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "far": (0.0, 1.0, 0.0),
    "near": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}


def selection_calls(session: ComposeSession) -> dict[str, Callable[[], Any]]:
    """Actions by the names of `shortcuts.SHORTCUTS`, of those that are about the selection."""

    def selected() -> tuple[str, ...]:
        return session.view.selection

    calls: dict[str, Callable[[], Any]] = {
        "undo": session.undo,
        "redo": session.redo,
        "all": lambda: session.select(session.view.instances),
        "delete": lambda: session.do(Delete(selected())),
        "duplicate": lambda: session.do(Duplicate(selected())),
        "put_down": lambda: session.do(PutDown(selected())),
        "turn_left": lambda: session.do(Turn(selected(), TURN_DEG)),
        "turn_right": lambda: session.do(Turn(selected(), -TURN_DEG)),
        "next_pose": lambda: next_pose(session),
    }
    for name, direction in DIRECTIONS.items():
        for kind, step in ((name, MOVE_STEP), (f"{name}_finely", FINE_MOVE_STEP)):
            offset = step * np.array(direction)
            calls[kind] = partial(shift, session, offset)
    return calls


def shift(session: ComposeSession, offset: Any) -> None:
    """Moves what is selected by an offset (3,) in S [m]."""
    view = session.view
    X_SO = {name: view.X_SO(name) for name in view.selection}
    for X in X_SO.values():
        X[:3, 3] += offset
    session.do(MoveObjects(X_SO, changes_height=True))


def next_pose(session: ComposeSession) -> None:
    """Brings what is selected, of one kind, to the stable pose after the one it is in.

    Raises:
        InvalidInputError: nothing is selected, or it has no stable poses.
    """
    view = session.view
    if not view.selection:
        raise InvalidInputError("nothing is selected; select an object")
    first = view.selection[0]
    found = nearest_stable_pose(view.state, first)
    if found is None:
        raise InvalidInputError(f"{first!r} has no stable poses")
    count = len(view.state.entry(first).stable_poses)
    session.do(SetPose(view.selection, (found[0] + 1) % count))
