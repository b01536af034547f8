"""What a session holds at one moment: the scene, its library, and what is selected."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, UnknownNameError, nearest
from burg_drake.core.documents import Pose
from burg_drake.objects.library import ObjectEntry, ObjectLibrary
from burg_drake.scene.document import Instance, Scene, SceneDocument

SAME = 1e-9
"""Poses whose numbers differ by less are one; an instance then keeps all of its digits."""


@dataclass(frozen=True)
class State:
    """A scene and what of it is selected; commands make new ones of it.

    Attributes:
        document: the scene.
        library: that the instances refer to.
        selection: names of selected instances, in the order in which they were selected.
    """

    document: SceneDocument
    library: ObjectLibrary
    selection: tuple[str, ...] = ()

    @property
    def instances(self) -> dict[str, Instance]:
        """All instances by name: the free ones first, then the background."""
        placed = (*self.document.instances, *self.document.background)
        return {name_of(instance): instance for instance in placed}

    def instance(self, name: str) -> Instance:
        """An instance, free or fixed.

        Raises:
            UnknownNameError: there is none of that name.
        """
        known = self.instances
        if name not in known:
            raise UnknownNameError(
                f"scene {self.document.name!r} has no instance {name!r}; {nearest(name, known)}"
            )
        return known[name]

    def entry(self, name: str) -> ObjectEntry:
        """The library's entry of an instance."""
        return self.library.entry(self.instance(name).object)

    def X_SO(self, name: str) -> Array:
        """(4, 4) pose of an instance in the scene frame."""
        return self.instance(name).X_SO.matrix()

    def scene(self, path: Path) -> Scene:
        """The scene, as if it were read from `path`."""
        return Scene(self.document, self.library, path)

    def select(self, names: Iterable[str]) -> State:
        """The same with other instances selected.

        Raises:
            UnknownNameError: one of them is not there.
        """
        selection = tuple(dict.fromkeys(names))
        for name in selection:
            self.instance(name)
        return replace(self, selection=selection)

    def changed(self, change: Callable[[Instance], Instance | None]) -> State:
        """The same with each instance replaced, or taken away where `change` gives None."""
        document = replace(
            self.document,
            instances=_each(self.document.instances, change),
            background=_each(self.document.background, change),
        )
        there = {name_of(i) for i in (*document.instances, *document.background)}
        return replace(
            self, document=document, selection=tuple(n for n in self.selection if n in there)
        )

    def moved(self, X_SO: Mapping[str, Array]) -> State:
        """The same with instances at other poses (4, 4); rounded as `Pose.readable` has it.

        Raises:
            UnknownNameError: one of them is not there.
        """
        for name in X_SO:
            self.instance(name)

        def place(instance: Instance) -> Instance:
            X = X_SO.get(name_of(instance))
            if X is None or np.abs(X - instance.X_SO.matrix()).max() < SAME:
                return instance
            return replace(instance, X_SO=Pose.readable(X))

        return self.changed(place)

    def added(self, new: Iterable[Instance], *, fixed: Collection[str] = ()) -> State:
        """The same with more instances, selected; those named in `fixed` are background."""
        new = tuple(new)
        document = self.document
        document = replace(
            document,
            instances=(*document.instances, *(i for i in new if name_of(i) not in fixed)),
            background=(*document.background, *(i for i in new if name_of(i) in fixed)),
        )
        return replace(self, document=document, selection=tuple(map(name_of, new)))


def name_of(instance: Instance) -> str:
    """What an instance goes by."""
    return instance.name or instance.object


def named(instance: Instance, name: str) -> Instance:
    """The same instance by another name, which is not written where it is the object's."""
    return replace(instance, name="" if name == instance.object else name)


def unused_name(wanted: str, taken: Collection[str]) -> str:
    """`wanted`, or with the first number behind it that makes it unused: mug, mug_2, mug_3."""
    if wanted not in taken:
        return wanted
    number = 2
    while f"{wanted}_{number}" in taken:
        number += 1
    return f"{wanted}_{number}"


def require_some(names: Iterable[str], state: State, least: int = 1) -> tuple[str, ...]:
    """Names that a command was given, each once.

    Raises:
        InvalidInputError: fewer than `least`.
        UnknownNameError: one is not there.
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


def _each(
    instances: tuple[Instance, ...], change: Callable[[Instance], Instance | None]
) -> tuple[Instance, ...]:
    return tuple(new for new in map(change, instances) if new is not None)
