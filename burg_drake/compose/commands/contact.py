"""Commands that move objects until they touch something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from burg_drake.compose.commands.command import label_of
from burg_drake.compose.document import State, Surroundings, bounds, known_scene, require_some
from burg_drake.core import Array, InvalidInputError, make_pose

Direction = Literal["x", "-x", "y", "-y"]

DIRECTIONS: dict[str, tuple[int, int]] = {"x": (0, 1), "-x": (0, -1), "y": (1, 1), "-y": (1, -1)}
"""Axis of the board and sign."""


@dataclass(frozen=True)
class SnapToContact:
    """Moves objects along the board until they touch something, or are at its edge.

    Attributes:
        names: instances; several move as one.
        direction: along an axis of the board.
    """

    names: tuple[str, ...]
    direction: Direction

    @property
    def label(self) -> str:
        return label_of("snap to contact", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        if self.direction not in DIRECTIONS:
            raise InvalidInputError(
                f"direction is {self.direction!r}; give one of {', '.join(DIRECTIONS)}"
            )
        axis, sign = DIRECTIONS[self.direction]
        spans = np.array([bounds(state, name)[:, axis] for name in names])
        edge = state.document.board.size[axis] - spans.max() if sign > 0 else spans.min()
        return _moved_to_contact(
            state, names, sign * np.eye(3)[axis], max(float(edge), 0.0), surroundings
        )


@dataclass(frozen=True)
class PutDown:
    """Lowers objects until they stand on the board or on what is below.

    What is in the board is lifted out of it.

    Attributes:
        names: instances; each goes down on its own, the lowest one first.
    """

    names: tuple[str, ...]

    @property
    def label(self) -> str:
        return label_of("put down", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        names = require_some(self.names, state)
        heights = {name: float(bounds(state, name)[0, 2]) for name in names}
        for name in sorted(names, key=heights.__getitem__):
            if heights[name] < 0.0:
                state = state.moved({name: _shifted(state, name, (0, 0, -heights[name]))})
            else:
                down = (0.0, 0.0, -1.0)
                state = _moved_to_contact(
                    state, (name,), np.array(down), heights[name], surroundings
                )
        return state.select(names)


def _moved_to_contact(
    state: State, names: tuple[str, ...], direction: Array, limit: float, around: Surroundings
) -> State:
    """Instances moved together along a direction (3,) as far as they go, at most `limit` [m]."""
    scene = known_scene(state, around.path)
    distance = around.checker.check(state).travel(scene, names, direction, limit)
    if distance <= 0.0:
        return state.select(names)
    X_SO = {name: _shifted(state, name, distance * direction) for name in names}
    return state.moved(X_SO).select(names)


def _shifted(state: State, name: str, offset: Array | tuple[float, float, float]) -> Array:
    return np.asarray(make_pose(p_AB=offset) @ state.X_SO(name))
