"""The steps of a session, to undo and redo without limit."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from burg_drake.compose.document.state import State, name_of
from burg_drake.core import InvalidInputError
from burg_drake.objects.library import ObjectLibrary


@dataclass(frozen=True)
class HistoryStep:
    """A state, and what led to it.

    Attributes:
        label: of the command.
        state: after it.
    """

    label: str
    state: State


class History:
    """States from the first to the last, and where among them the session is.

    States share all instances that a step leaves alone, so that a step takes little memory.
    """

    def __init__(self, first: State) -> None:
        self.steps = [HistoryStep("", first)]
        self.position = 0

    @property
    def state(self) -> State:
        """The present state."""
        return self.steps[self.position].state

    @property
    def undo_label(self) -> str | None:
        """Of the step that `undo` takes back; None at the beginning."""
        return self.steps[self.position].label if self.position else None

    @property
    def redo_label(self) -> str | None:
        """Of the step that `redo` takes again; None at the end."""
        return self.steps[self.position + 1].label if self._can_redo else None

    def add(self, step: HistoryStep) -> None:
        """Adds a step behind the present one; what was undone is gone."""
        self.steps[self.position + 1 :] = [step]
        self.position += 1

    def undo(self) -> State:
        """The state before the present step, with what that step changed selected.

        Raises:
            InvalidInputError: there is none.
        """
        if not self.position:
            raise InvalidInputError("there is nothing to undo")
        self.position -= 1
        return _selecting_changes(self.state, self.steps[self.position + 1].state)

    def redo(self) -> State:
        """The state after the step that was undone last.

        Raises:
            InvalidInputError: there is none.
        """
        if not self._can_redo:
            raise InvalidInputError("there is nothing to redo")
        self.position += 1
        return self.state

    def go_to(self, position: int) -> None:
        """Goes to a step by its number, the first state being 0.

        Raises:
            IndexError: there is none.
        """
        if not 0 <= position < len(self.steps):
            raise IndexError(f"step {position} of {len(self.steps)}")
        self.position = position

    def rename(self, name: str, reference: str, library: ObjectLibrary) -> None:
        """Gives the scene of every step another name, and a library another reference."""

        def renamed(state: State) -> State:
            document = replace(state.document, name=name)
            if state.library.root == library.root:
                document = replace(document, library=reference)
            return state if document == state.document else replace(state, document=document)

        self.steps = [HistoryStep(step.label, renamed(step.state)) for step in self.steps]

    def replace_library(self, library: ObjectLibrary) -> None:
        """Puts what a library's folder holds now in place of what it held before."""
        self.steps = [
            HistoryStep(s.label, replace(s.state, library=library))
            if s.state.library.root == library.root
            else s
            for s in self.steps
        ]

    @property
    def _can_redo(self) -> bool:
        return self.position + 1 < len(self.steps)


def _selecting_changes(state: State, other: State) -> State:
    """`state` with those instances selected that are not the same in `other`."""
    there = {name_of(i): i for i in (*other.document.instances, *other.document.background)}
    fixed = set(state.document.background), set(other.document.background)
    changed = [
        name
        for name, instance in state.instances.items()
        if there.get(name) != instance or (instance in fixed[0]) != (instance in fixed[1])
    ]
    return replace(state, selection=tuple(changed))


AMEND_PERIOD = 3.0
"""A step is amended no later than that after it was taken [s]."""


class Amending:
    """The last step, as long as a further one may take its place: a number that is typed digit by
    digit is one step."""

    def __init__(self) -> None:
        self._field = ""
        self._step: HistoryStep | None = None
        self._end = 0.0

    def allows(self, field: str, history: History) -> bool:
        """Whether the last step is of the same field, recent, and nothing has happened since."""
        return (
            bool(field)
            and field == self._field
            and history.steps[-1] is self._step
            and history.position == len(history.steps) - 1
            and time.monotonic() < self._end
        )

    def begin(self, field: str, step: HistoryStep) -> None:
        """A step of a field is taken; of none if that is empty."""
        self._field = field
        self._step = step
        self._end = time.monotonic() + AMEND_PERIOD

    def end(self) -> None:
        """What comes next is a step of its own."""
        self._field = ""
