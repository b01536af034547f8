"""Which instances of a scene, and which grasps, names stand for: names in a grasp file, and names
by which a user chooses."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, UnknownNameError, listing, nearest
from burg_drake.core.grasps import GraspSet
from burg_drake.scene.document import Scene


@dataclass(frozen=True)
class InstanceNames:
    """Names of a grasp file and the instances that are meant.

    Attributes:
        scene: has the instances.
        path: the file, for messages.
        given: names of the scene's objects or instances by the file's names; by the empty text for
            whatever the file has.
        is_file: whether it is a file, of which a user can say what its names mean.
    """

    scene: Scene
    path: str
    given: Mapping[str, str]
    is_file: bool = True

    def require_used(self, foreign: Collection[str]) -> None:
        """Refuses names for what the file does not have.

        Args:
            foreign: names in the file.

        Raises:
            UnknownNameError: one of `given` is not among them.
            InvalidInputError: one name is given for several.
        """
        names = [name for name in foreign if name]
        for name in self.given:
            if name and name not in names:
                known = nearest(name, names) if names else "it names no objects"
                raise UnknownNameError(f"{self.path} has no grasps of object {name!r}; {known}")
        if "" in self.given and len(foreign) > 1:
            raise InvalidInputError(
                f"{self.path} has grasps of {len(foreign)} objects ({listing(names)});"
                " say which of them is which of the scene, as THEIRS=OURS"
            ).about("objects")

    def of_object(self, foreign: str) -> list[str]:
        """The free instances that grasps of an object of the file are for.

        Raises:
            InvalidInputError: the file does not name the object, and nobody else does.
            UnknownNameError: the scene has no such object.
        """
        meant = self.given.get(foreign, self.given.get(""))
        if meant is not None:
            return self.called(meant)
        known = {instance.object for instance in self.scene.instances.values()}
        if not foreign:
            how = "" if self.is_file else " (GraspSet.create(..., object=NAME))"
            raise InvalidInputError(
                f"{self.path} does not name the object of its grasps; name it{how};"
                f" scene {self.scene.name!r} has {listing(sorted(known))}"
            ).about("objects")
        if foreign not in known:
            how = (
                f"say which of the scene's objects it is, {foreign}=NAME; " if self.is_file else ""
            )
            raise UnknownNameError(
                f"{self.path} has grasps of object {foreign!r}, which is not in scene"
                f" {self.scene.name!r}; {how}{nearest(foreign, known)}"
            ).about("objects")
        return self.called(foreign)

    def called(self, name: str) -> list[str]:
        """All free instances of an object, or else the one of that name.

        Raises:
            UnknownNameError: there are none.
        """
        return instances_called(self.scene, name)


def instances_called(scene: Scene, name: str) -> list[str]:
    """All free instances of an object, or else the one of that name.

    Raises:
        UnknownNameError: there are none.
    """
    instances = scene.instances
    found = [key for key, instance in instances.items() if instance.object == name]
    found = found or [key for key in instances if key == name]
    if not found:
        known = {*instances, *(instance.object for instance in instances.values())}
        raise UnknownNameError(
            f"scene {scene.name!r} has no free instance {name!r}; {nearest(name, known)}"
        )
    return found


def chosen_instances(scene: Scene, only: Iterable[str] | None) -> tuple[str, ...]:
    """The free instances that some names stand for, in the order of the scene; all if there are no
    names.

    Raises:
        UnknownNameError: a name stands for none.
    """
    names = list(only or scene.instances)
    chosen = {key for name in names for key in instances_called(scene, name)}
    return tuple(key for key in scene.instances if key in chosen)


def on_chosen(
    scene: Scene, by_instance: Mapping[str, GraspSet], only: Iterable[str] | None
) -> Mapping[str, GraspSet]:
    """The grasps on the instances that some names stand for; all if there are no names.

    Raises:
        UnknownNameError: a name stands for no instance of the scene.
        InvalidInputError: there are no grasps on any of them.
    """
    names = list(only or ())
    if not names:
        return by_instance
    chosen = chosen_instances(scene, names)
    found = {name: by_instance[name] for name in chosen if len(by_instance.get(name, ()))}
    if not found:
        there = listing([name for name, grasps in by_instance.items() if len(grasps)])
        raise InvalidInputError(
            f"there are no grasps of {listing(names)}; there are some of {there}"
        )
    return found


def are_of(
    only: Iterable[str] | None,
    where: str,
    objects: NDArray[np.str_],
    instances: NDArray[np.str_] | None = None,
) -> NDArray[np.bool_]:
    """Which grasps are of objects or instances that go by some names, (N,); all without names.

    Args:
        only: the names.
        where: the grasps are, for messages.
        objects: (N,) object of each grasp.
        instances: (N,) instance of each grasp, if it is known.

    Raises:
        UnknownNameError: no grasp is of that name.
    """
    names = list(only or ())
    holders = [objects] if instances is None else [objects, instances]
    if not names:
        return np.ones(len(objects), dtype=bool)
    known = {name for column in holders for name in column.tolist()}
    for name in names:
        if name not in known:
            raise UnknownNameError(f"{where} has no grasps of {name!r}; {nearest(name, known)}")
    held: NDArray[np.bool_] = np.any([np.isin(column, names) for column in holders], axis=0)
    return held
