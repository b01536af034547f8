"""The base class of commands, and the commands that change the board or the library."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

from burg_drake.compose.scene_checker import Surroundings
from burg_drake.compose.state import State, instance_name
from burg_drake.core import InvalidInputError, UnknownNameError, list_names, suggest_names
from burg_drake.objects import ObjectLibrary
from burg_drake.printout import PAPER_SIZES
from burg_drake.scene import Board

MAX_COORDINATE = 100.0
"""Metres; largest coordinate of an object and largest side of a board."""


class Command(Protocol):
    """A step that a user takes: a small frozen dataclass."""

    @property
    def label(self) -> str:
        """What the command does, as text of the undo button: `move mug`."""

    def apply(self, state: State, surroundings: Surroundings) -> State:
        """The state after the command, with the changed instances selected.

        Raises:
            BurgError: the command cannot be applied; its one-line message says why.
        """


@dataclass(frozen=True)
class InstancesCommand:
    """Base class of commands about instances.

    Attributes:
        names: instances.
    """

    verb: ClassVar[str]

    names: tuple[str, ...]

    @property
    def label(self) -> str:
        return command_label(self.verb, self.names)


def command_label(verb: str, names: Iterable[str]) -> str:
    """The verb with the instance's name, or with the number of instances if there are several."""
    names = tuple(names)
    if not 0 < len(names) <= 2:
        return f"{verb} {len(names)} objects"
    return f"{verb} {' and '.join(names)}"


def require_number(value: float, what: str, lower: float, upper: float, unit: str) -> float:
    """A number from a field.

    Raises:
        InvalidInputError: it is not a number, not finite, or outside of the range.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not lower <= number <= upper:
        given = f"{value:g}" if isinstance(value, float | int) else repr(value)
        raise InvalidInputError(
            f"{what} is {given}; give a number from {lower:g} to {upper:g} {unit}".rstrip()
        )
    return number


def require_coordinate(value: float, what: str) -> float:
    """A coordinate or an offset from a field [m]; errors as of `require_number`."""
    return require_number(value, what, -MAX_COORDINATE, MAX_COORDINATE, "m")


BOARD_SIZES = {name: size for name, size in PAPER_SIZES.items() if name.startswith("A")}
"""Short and long side in metres by name of the paper, A4 to A0."""


@dataclass(frozen=True)
class SetBoard:
    """Replaces the board; objects stay where they are in its frame."""

    board: Board

    label = "change board"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        _ = self.board.layout  # refuses markers that do not fit
        return replace(state, document=replace(state.document, board=self.board))


def board_size(name: str, *, upright: bool = False) -> tuple[float, float]:
    """Extents along x and y of a board of paper size [m], across unless `upright`.

    Raises:
        UnknownNameError: there is no size of that name.
    """
    if name not in BOARD_SIZES:
        raise UnknownNameError(
            f"board size {name!r} does not exist; {suggest_names(name, BOARD_SIZES)}"
        )
    short, long = BOARD_SIZES[name]
    return (short, long) if upright else (long, short)


def board_size_name(size: tuple[float, float]) -> str | None:
    """The name of a board's size in either orientation; None for a custom size."""
    sides = sorted(size)
    for name, paper in BOARD_SIZES.items():
        if all(abs(a - b) < 1e-6 for a, b in zip(sides, paper, strict=True)):
            return name
    return None


def require_objects_of_scene(state: State, library: ObjectLibrary) -> None:
    """Refuses a library that lacks objects of a scene.

    Raises:
        UnknownNameError: objects are missing; the message lists their instances.
        InvalidInputError: a free instance has no mass in it.
    """
    used = {instance.object for instance in state.instances.values()}
    missing = sorted(used - library.objects.keys())
    if missing:
        raise UnknownNameError(
            f"library {library.root} has no {list_names([repr(m) for m in missing])}; delete their"
            " instances first, or choose a library that has them"
        )
    heavy = [instance_name(i) for i in state.document.instances if library.entry(i.object).is_fixed]
    if heavy:
        raise InvalidInputError(
            f"library {library.root} has no mass for {list_names(heavy)}; make them background"
            " first"
        )


@dataclass(frozen=True)
class UseLibrary:
    """Takes the objects from another library.

    Attributes:
        library: must have all objects of the scene.
        reference: reference to the library, in the scene's document.
    """

    library: ObjectLibrary
    reference: str

    @property
    def label(self) -> str:
        return f"use library {self.library.name}"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        require_objects_of_scene(state, self.library)
        document = replace(state.document, library=self.reference)
        return replace(state, document=document, library=self.library)
