"""The state of a session (scene, library and selection) and the history of its states."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, Pose, UnknownNameError, suggest_names
from burg_drake.objects import ObjectEntry, ObjectLibrary
from burg_drake.scene import Instance, Scene, SceneDocument


@dataclass(frozen=True)
class State:
    """A scene and the selected instances; commands return new states.

    Attributes:
        document: the scene.
        library: the library that the instances refer to.
        selection: names of selected instances, in the order in which they were selected.
    """

    document: SceneDocument
    library: ObjectLibrary
    selection: tuple[str, ...] = ()

    @property
    def instances(self) -> dict[str, Instance]:
        """All instances by name: the free ones first, then the background."""
        placed = (*self.document.instances, *self.document.background)
        return {instance_name(instance): instance for instance in placed}

    def instance(self, name: str) -> Instance:
        """An instance, free or fixed.

        Raises:
            UnknownNameError: there is no instance of that name.
        """
        known = self.instances
        if name not in known:
            raise UnknownNameError(
                f"scene {self.document.name!r} has no instance {name!r};"
                f" {suggest_names(name, known)}"
            )
        return known[name]

    def entry(self, name: str) -> ObjectEntry:
        """The library's entry of an instance."""
        return self.library.entry(self.instance(name).object)

    def X_SO(self, name: str) -> Array:
        """(4, 4) pose of an instance in the scene frame."""
        return self.instance(name).X_SO.matrix()

    def scene(self, path: Path) -> Scene:
        """The scene, as if read from `path`."""
        return Scene(self.document, self.library, path)

    def select(self, names: Iterable[str]) -> State:
        """The state with these instances selected.

        Raises:
            UnknownNameError: there is no such instance.
        """
        selection = tuple(dict.fromkeys(names))
        for name in selection:
            self.instance(name)
        return replace(self, selection=selection)

    def replace_instances(self, change: Callable[[Instance], Instance | None]) -> State:
        """The state with each instance replaced, or removed where `change` returns None."""
        document = replace(
            self.document,
            instances=tuple(filter(None, map(change, self.document.instances))),
            background=tuple(filter(None, map(change, self.document.background))),
        )
        changed = replace(self, document=document)
        instances = changed.instances
        return replace(changed, selection=tuple(n for n in self.selection if n in instances))

    def with_poses(self, X_SO: Mapping[str, Array]) -> State:
        """The state with instances at new poses (4, 4), rounded by `Pose.readable`.

        Raises:
            UnknownNameError: there is no such instance.
        """
        # An instance keeps its digits if all matrix entries differ by less.
        pose_tolerance = 1e-9
        for name in X_SO:
            self.instance(name)

        def place(instance: Instance) -> Instance:
            X = X_SO.get(instance_name(instance))
            if X is None or np.abs(X - instance.X_SO.matrix()).max() < pose_tolerance:
                return instance
            return replace(instance, X_SO=Pose.readable(X))

        return self.replace_instances(place)

    def with_instances(self, new: Iterable[Instance], *, fixed: Collection[str] = ()) -> State:
        """The state with new instances, selected; those named in `fixed` are background."""
        new = tuple(new)
        document = self.document
        document = replace(
            document,
            instances=(*document.instances, *(i for i in new if instance_name(i) not in fixed)),
            background=(*document.background, *(i for i in new if instance_name(i) in fixed)),
        )
        return replace(self, document=document, selection=tuple(map(instance_name, new)))


def instance_name(instance: Instance) -> str:
    """The name of an instance; that of its object if it has none of its own."""
    return instance.name or instance.object


def rename_instance(instance: Instance, name: str) -> Instance:
    """The instance with another name, left out if it is the object's name."""
    return replace(instance, name="" if name == instance.object else name)


def require_instance_names(names: Iterable[str], state: State, least: int = 1) -> tuple[str, ...]:
    """The names given to a command, without repetitions.

    Raises:
        InvalidInputError: there are fewer than `least`.
        UnknownNameError: there is no such instance.
    """
    names = tuple(dict.fromkeys(names))
    for name in names:
        state.instance(name)
    if len(names) < least:
        what = "nothing is selected" if not names else f"only {names[0]!r} is selected"
        if len(names) > 1:
            what = f"only {len(names)} objects are selected"
        raise InvalidInputError(f"{what}; select {least} or more objects")
    return names


@dataclass(frozen=True)
class HistoryStep:
    """A state, and the label of the command that led to it.

    Attributes:
        label: label of the command.
        state: after the command.
    """

    label: str
    state: State


class History:
    """States from the first to the last, and the current position.

    States share all unchanged instances, so that a step takes little memory.
    """

    def __init__(self, first: State) -> None:
        self.steps = [HistoryStep("", first)]
        self.position = 0

    @property
    def state(self) -> State:
        """The current state."""
        return self.steps[self.position].state

    @property
    def undo_label(self) -> str | None:
        """Label of the step that `undo` takes back; None at the beginning."""
        return self.steps[self.position].label if self.position else None

    @property
    def redo_label(self) -> str | None:
        """Label of the step that `redo` takes again; None at the end."""
        return self.steps[self.position + 1].label if self._can_redo else None

    def add(self, step: HistoryStep) -> None:
        """Adds a step after the current one, and drops the undone steps."""
        self.steps[self.position + 1 :] = [step]
        self.position += 1

    def undo(self) -> State:
        """Goes back one step; returns that state with the changed instances selected.

        Raises:
            InvalidInputError: there is nothing to undo.
        """
        if not self.position:
            raise InvalidInputError("there is nothing to undo")
        self.position -= 1
        return _select_changes(self.state, self.steps[self.position + 1].state)

    def redo(self) -> State:
        """Goes forward to the step that was undone last; returns its state.

        Raises:
            InvalidInputError: there is nothing to redo.
        """
        if not self._can_redo:
            raise InvalidInputError("there is nothing to redo")
        self.position += 1
        return self.state

    def rename(self, name: str, reference: str, library: ObjectLibrary) -> None:
        """Changes the scene's name and the reference to a library in every step."""

        def renamed(state: State) -> State:
            document = replace(state.document, name=name)
            if state.library.root == library.root:
                document = replace(document, library=reference)
            return state if document == state.document else replace(state, document=document)

        self.steps = [HistoryStep(step.label, renamed(step.state)) for step in self.steps]

    def replace_library(self, library: ObjectLibrary) -> None:
        """Replaces the states' library of the same folder with its reloaded content."""
        self.steps = [
            HistoryStep(s.label, replace(s.state, library=library))
            if s.state.library.root == library.root
            else s
            for s in self.steps
        ]

    @property
    def _can_redo(self) -> bool:
        return self.position + 1 < len(self.steps)


def _select_changes(state: State, other: State) -> State:
    """`state` with the instances selected that differ from `other`."""
    instances = other.instances
    fixed = set(state.document.background), set(other.document.background)
    changed = [
        name
        for name, instance in state.instances.items()
        if instances.get(name) != instance or (instance in fixed[0]) != (instance in fixed[1])
    ]
    return replace(state, selection=tuple(changed))


AMEND_PERIOD = 3.0
"""Seconds after a step during which a further step may replace it."""


class StepAmendment:
    """Decides whether a step replaces the last one, so that a number typed digit by digit is one
    step."""

    def __init__(self) -> None:
        self._field = ""
        self._step: HistoryStep | None = None
        self._end = 0.0

    def allows(self, field: str, history: History) -> bool:
        """Whether the last step is recent, of the same field, and still the last."""
        return (
            bool(field)
            and field == self._field
            and history.steps[-1] is self._step
            and history.position == len(history.steps) - 1
            and time.monotonic() < self._end
        )

    def begin(self, field: str, step: HistoryStep) -> None:
        """Remembers a step of a field; of no field if `field` is empty."""
        self._field = field
        self._step = step
        self._end = time.monotonic() + AMEND_PERIOD

    def end(self) -> None:
        """Makes the next step a separate one."""
        self._field = ""
