"""Commands that line objects up with one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from burg_drake.compose.commands.command import label_of
from burg_drake.compose.document import State, Surroundings, bounds, require_some
from burg_drake.core import Array, InvalidInputError

Edge = Literal["left", "right", "top", "bottom", "center_x", "center_y"]
Axis = Literal["x", "y"]

EDGES: dict[str, tuple[int, str]] = {
    "left": (0, "lower"),
    "right": (0, "upper"),
    "center_x": (0, "middle"),
    "bottom": (1, "lower"),
    "top": (1, "upper"),
    "center_y": (1, "middle"),
}
"""Axis, and what of the bounds is aligned; the board is seen from above, y up."""


@dataclass(frozen=True)
class Align:
    """Brings edges of objects, or their middles, onto one line.

    Attributes:
        names: instances, two or more.
        edge: of their footprints that is aligned, with that of the outermost object.
    """

    names: tuple[str, ...]
    edge: Edge

    @property
    def label(self) -> str:
        return label_of(f"align {self.edge.replace('_', ' ')} of", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        if self.edge not in EDGES:
            raise InvalidInputError(f"cannot align {self.edge!r}; give one of {', '.join(EDGES)}")
        names = require_some(self.names, state, 2)
        axis, what = EDGES[self.edge]
        spans = np.array([bounds(state, name)[:, axis] for name in names])
        if what == "lower":
            shifts = spans[:, 0].min() - spans[:, 0]
        elif what == "upper":
            shifts = spans[:, 1].max() - spans[:, 1]
        else:
            shifts = (spans.min() + spans.max()) / 2 - spans.mean(axis=1)
        return _shifted(state, names, axis, shifts)


@dataclass(frozen=True)
class Distribute:
    """Makes the gaps between objects equal; the two outermost stay.

    Attributes:
        names: instances, three or more.
        axis: along which the gaps are.
    """

    names: tuple[str, ...]
    axis: Axis

    @property
    def label(self) -> str:
        return label_of(f"distribute along {self.axis}", tuple(self.names))

    def apply(self, state: State, surroundings: Surroundings) -> State:
        if self.axis not in ("x", "y"):
            raise InvalidInputError(f"cannot distribute along {self.axis!r}; give x or y")
        names = require_some(self.names, state, 3)
        axis = "xy".index(self.axis)
        spans = np.array([bounds(state, name)[:, axis] for name in names])
        order = np.argsort(spans.mean(axis=1), kind="stable")
        sizes = (spans[:, 1] - spans[:, 0])[order]
        first, last = spans[order[0], 0], spans[order[-1], 1]
        gap = (last - first - sizes.sum()) / (len(names) - 1)
        starts = first + np.concatenate([[0.0], np.cumsum(sizes[:-1] + gap)])
        shifts = np.zeros(len(names))
        shifts[order] = starts - spans[order, 0]
        shifts[order[[0, -1]]] = 0.0
        return _shifted(state, names, axis, shifts)


def _shifted(state: State, names: tuple[str, ...], axis: int, shifts: Array) -> State:
    X_SO = {}
    for name, shift in zip(names, shifts, strict=True):
        if abs(shift) > 1e-9:
            X_SO[name] = state.X_SO(name)
            X_SO[name][axis, 3] += shift
    return state.moved(X_SO).select(names)
