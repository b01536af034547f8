"""Commands as a user in a hurry gives them: some cannot be done, and are refused.

What a command is about is only known when it is given; so these are functions that make one of the
names of what is there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from burg_drake.compose import (
    AddObject,
    Align,
    Clear,
    Command,
    Delete,
    Distribute,
    Duplicate,
    MoveObjects,
    PutDown,
    RandomConfiguration,
    Rename,
    SetBoard,
    SetFixed,
    SetPose,
    SnapToContact,
    SnapToGrid,
    Turn,
    board_size,
)
from burg_drake.core import make_pose, rotation_from_rpy
from burg_drake.scene import Board

Make = Callable[[Sequence[str]], Command]
"""Makes a command of the names of all instances."""

OBJECTS = ("marble", "box", "can", "screwdriver")

lengths = st.floats(-0.1, 0.5)
angles = st.floats(-180.0, 180.0)
spots = st.tuples(lengths, lengths)
poses = st.builds(
    lambda p, rpy: make_pose(rotation_from_rpy(np.deg2rad(rpy)), p),
    st.tuples(lengths, lengths, lengths | st.just(float("nan"))),
    st.tuples(angles, angles, angles),
)


def of_some(command: Callable[..., Command], *arguments: st.SearchStrategy[Any]) -> Any:
    """A strategy for commands on up to four instances."""

    def make(chosen: list[int], rest: tuple[Any, ...]) -> Make:
        return lambda names: command(_picked(chosen, names), *rest)

    chosen = st.lists(st.integers(0, 7), min_size=1, max_size=4, unique=True)
    return st.builds(make, chosen, st.tuples(*arguments))


def _picked(chosen: list[int], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names[i % len(names)] for i in chosen)) if names else ("nobody",)


def _moved(names: tuple[str, ...], X_SO: Any) -> Command:
    return MoveObjects(dict.fromkeys(names[:1], X_SO))


def _renamed(names: tuple[str, ...], new: str) -> Command:
    return Rename(names[0], new)


def _alone(command: Any) -> Any:
    return lambda names: command


adding = st.builds(
    _alone,
    st.builds(AddObject, st.sampled_from(OBJECTS), st.sampled_from((0, 0, 1)), st.none() | spots),
)
commands = st.one_of(
    adding,
    of_some(Delete),
    of_some(Duplicate, st.none() | spots),
    of_some(_moved, poses),
    of_some(SetPose, st.integers(0, 1)),
    of_some(Turn, angles),
    of_some(_renamed, st.sampled_from(("red", "blue", "table", "../red", ""))),
    of_some(SetFixed, st.booleans()),
    of_some(Align, st.sampled_from(("left", "top", "center_x", "middle"))),
    of_some(Distribute, st.sampled_from(("x", "y"))),
    of_some(SnapToGrid, st.sampled_from((0.0, 0.01, 0.05))),
    of_some(SnapToContact, st.sampled_from(("x", "-x", "y", "-y"))),
    of_some(PutDown),
    st.builds(
        _alone, st.builds(RandomConfiguration, st.integers(0, 9), st.sampled_from((None, 0, 3)))
    ),
    st.builds(lambda s: _alone(SetBoard(Board(size=board_size(s)))), st.sampled_from(("A4", "A2"))),
    st.just(_alone(Clear())),
)
"""Of all kinds."""
