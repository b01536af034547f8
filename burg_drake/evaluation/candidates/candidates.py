"""The grasps that a run judges: which grasp, on which instance of the scene, under which id."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    content_hash,
    nearest,
    quoted,
)
from burg_drake.core.grasps import GraspSet
from burg_drake.scene.document import Scene

INSTANCE = "instance"
"""Column of a grasp file: the placed object that each grasp belongs to."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One grasp on one instance.

    Attributes:
        id: `INSTANCE-GRASP`, unique in a run.
        instance: name of the placed object.
        X_OG: (4, 4) grasp in the object frame.
        friction: the target's coefficient, in place of the library's.
        mass: of the target, in place of the library's [kg].
        width: distance of the contacts [m]; NaN if unknown.
        lift: length of the lift, in place of the motion's [m].
    """

    id: str
    instance: str
    X_OG: Array
    friction: float | None = None
    mass: float | None = None
    width: float = math.nan
    lift: float | None = None


@dataclass(frozen=True, eq=False)
class Candidates:
    """N grasps on instances of a scene, grouped by instance.

    Attributes:
        grasps: the grasps in the frames of their objects.
        instance: (N,) names of the placed objects.
    """

    grasps: GraspSet
    instance: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.grasps)

    def __iter__(self) -> Iterator[Candidate]:
        grasps = zip(self.id, self.instance, self.grasps.X_OG, self.grasps.width, strict=True)
        for id, instance, X_OG, width in grasps:
            yield Candidate(id, str(instance), X_OG, width=float(width))

    @cached_property
    def id(self) -> list[str]:
        """Identifiers in order: instance and grasp, joined by a hyphen."""
        return [f"{i}-{g}" for i, g in zip(self.instance, self.grasps.id, strict=True)]

    @cached_property
    def content(self) -> str:
        """Hash of poses, widths and instances."""
        return content_hash(self.grasps.X_OG, self.grasps.width, self.id)

    def save(self, path: Path) -> None:
        """Writes a grasp file that `load`, and `GraspSet.load`, read back bit for bit."""
        self.grasps.with_columns(instance=self.instance).save(path)

    @classmethod
    def load(cls, path: Path) -> Candidates:
        """Reads a file written by `save`.

        Raises:
            InvalidInputError: the file is something else.
        """
        grasps = GraspSet.load(path)
        if INSTANCE not in grasps.columns:
            raise InvalidInputError(f"{path} does not say on which instance each grasp is")
        columns = {name: values for name, values in grasps.columns.items() if name != INSTANCE}
        return cls(dataclasses.replace(grasps, columns=columns), grasps.columns[INSTANCE])


def given_candidates(scene: Scene, grasps: Mapping[str, GraspSet]) -> Candidates:
    """Candidates from the user's own grasps.

    Args:
        scene: the scene.
        grasps: grasps in the object frame by name of a free instance. Instances that are not
            named get none; of equal grasps on an instance the first one is kept.

    Raises:
        UnknownNameError: no free instance goes by such a name.
        InvalidInputError: a set holds grasps of another object.
    """
    require_instances(scene, grasps)
    for name, grasp_set in grasps.items():
        expected = scene.instance(name).object
        others = set(grasp_set.object.tolist()) - {expected, ""}
        if others:
            raise InvalidInputError(
                f"the grasps given for {name!r} are of object {min(others)!r}, but "
                f"{name!r} is object {expected!r} in the scene"
            )
    return join_candidates(
        {name: distinct(grasps[name]) for name in scene.instances if name in grasps}
    )


def require_instances(scene: Scene, names: Iterable[str], path: str = "") -> None:
    """Refuses names that no free instance goes by.

    Args:
        scene: with the instances.
        names: of the instances that grasps are given for.
        path: of their file, for the message.

    Raises:
        UnknownNameError: there is no such instance.
    """
    for name in names:
        if name not in scene.instances:
            raise UnknownNameError(
                f"{path}{': ' if path else ''}grasps are given for {quoted(name)}, which is not a"
                f" free instance of scene {scene.name!r}; {nearest(name, scene.instances)}"
            )


def join_candidates(by_instance: dict[str, GraspSet]) -> Candidates:
    """Candidates from grasps by the name of their instance; provenances are kept by instance."""
    if not by_instance:
        return Candidates(GraspSet.create(np.empty((0, 4, 4)), object=""), np.empty(0, dtype=str))
    names = [name for name, grasps in by_instance.items() for _ in range(len(grasps))]
    grasps = GraspSet.concatenate(by_instance.values())
    parts = dict(zip(by_instance, grasps.provenance["parts"], strict=True))
    return Candidates(
        dataclasses.replace(grasps, provenance={"parts": parts}), np.array(names, dtype=str)
    )


def distinct(grasps: GraspSet) -> GraspSet:
    """The first one of equal grasps, in the order that there is."""
    _, first = np.unique(grasps.id, return_index=True)
    return grasps.select(np.sort(first))
