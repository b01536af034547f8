"""Candidates: the grasps of a run with their instances and ids. Selects instances by name."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    content_hash,
    distinct_texts,
    list_names,
    quote_value,
    suggest_names,
)
from burg_drake.evaluation.settings import select_share
from burg_drake.scene import Scene

INSTANCE_COLUMN = "instance"
"""Column of a grasp file: the placed object that each grasp belongs to."""
TRIAL_FRICTION_COLUMN = "trial_friction"
"""Column of grasps: friction coefficient of the target in the trial, in place of the library's."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One grasp on one instance.

    Attributes:
        id: `INSTANCE-GRASP`, unique in a run.
        instance: name of the placed object.
        X_OG: (4, 4) grasp in the object frame.
        friction: friction coefficient of the target; None for the library's.
        mass: mass of the target [kg]; None for the library's.
        width: distance between the contacts [m]; NaN if unknown.
        lift: length of the lift [m]; None for the motion's.
    """

    id: str
    instance: str
    X_OG: Array
    friction: float | None = None
    mass: float | None = None
    width: float = math.nan
    lift: float | None = None


class GraspIds(Sequence[str]):
    """Identifiers of grasps (instance and grasp joined by a hyphen), made on access.

    Args:
        instance: (N,) names of the placed objects.
        grasp: (N,) identifiers of the grasps.
    """

    def __init__(self, instance: NDArray[np.str_], grasp: NDArray[np.str_]) -> None:
        self._instance, self._grasp = instance, grasp

    def __len__(self) -> int:
        return len(self._grasp)

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> GraspIds: ...

    def __getitem__(self, index: int | slice) -> str | GraspIds:
        instance, grasp = self._instance[index], self._grasp[index]
        return GraspIds(instance, grasp) if isinstance(index, slice) else f"{instance}-{grasp}"

    def __iter__(self) -> Iterator[str]:
        step = 4096  # Identifiers made at a time.
        for begin in range(0, len(self), step):
            part = slice(begin, begin + step)
            pairs = zip(self._instance[part].tolist(), self._grasp[part].tolist(), strict=True)
            yield from (f"{instance}-{grasp}" for instance, grasp in pairs)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]


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
        return iter(self.at(range(len(self))))

    def __getitem__(self, row: int) -> Candidate:
        instance, width = str(self.instance[row]), float(self.grasps.width[row])
        friction = self.friction
        return Candidate(
            self.id[row],
            instance,
            self.grasps.X_OG[row],
            friction=None if friction is None else float(friction[row]),
            width=width,
        )

    @property
    def friction(self) -> Array | None:
        """(N,) friction coefficient of the target in the trial; None for the library's."""
        return self.grasps.columns.get(TRIAL_FRICTION_COLUMN)

    @property
    def id(self) -> Sequence[str]:
        """Identifiers in order: instance and grasp, joined by a hyphen."""
        return GraspIds(self.instance, self.grasps.id)

    @property
    def counts(self) -> dict[str, int]:
        """Number of grasps of each instance that has some."""
        changes = np.flatnonzero(self.instance[1:] != self.instance[:-1]) + 1
        counts: Counter[str] = Counter()
        for begin, end in pairwise([0, *changes.tolist(), len(self)]):
            if begin < end:
                counts[str(self.instance[begin])] += end - begin
        return counts

    def at(self, rows: Sequence[int] | NDArray[np.int64]) -> Sequence[Candidate]:
        """Candidates at the given rows (M,), each made on access."""
        return _ChosenCandidates(self, rows)

    def rows(self, ids: Sequence[str]) -> NDArray[np.int64]:
        """Rows (M,) of the grasps with these identifiers; -1 for unknown identifiers."""
        hashes, order = self._sorted_hashes
        wanted = _hashes(ids, len(ids))
        found = np.full(len(ids), -1, dtype=np.int64)
        known = self.id
        for k, i in enumerate(np.searchsorted(hashes, wanted).tolist()):
            while i < len(order) and hashes[i] == wanted[k]:
                if known[order[i]] == ids[k]:
                    found[k] = order[i]
                    break
                i += 1
        return found

    def __getstate__(self) -> dict[str, object]:
        # Other processes hash texts differently.
        return {name: value for name, value in vars(self).items() if name != "_sorted_hashes"}

    @cached_property
    def _sorted_hashes(self) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
        """Hashes of the identifiers in ascending order, and the row of each.

        Takes 12 bytes per grasp, a tenth of what a dictionary takes.
        """
        hashes = _hashes(self.id, len(self))
        order = np.argsort(hashes, kind="stable").astype(np.uint32)
        return hashes[order], order

    @cached_property
    def content(self) -> str:
        """Hash of poses, widths, instances, and friction if it is not the library's."""
        friction = [] if self.friction is None else [self.friction]
        return content_hash(self.grasps.X_OG, self.grasps.width, self.id, *friction)

    def save(self, path: Path) -> None:
        """Writes a grasp file that `load` and `GraspSet.load` read back bit for bit."""
        self.grasps.with_columns(instance=self.instance).save(path)

    @classmethod
    def load(cls, path: Path) -> Candidates:
        """Reads a file written by `save`.

        Raises:
            InvalidInputError: it is not such a file.
        """
        grasps = GraspSet.load(path)
        if INSTANCE_COLUMN not in grasps.columns:
            raise InvalidInputError(f"{path} does not say on which instance each grasp is")
        columns = dict(grasps.columns)
        instance = columns.pop(INSTANCE_COLUMN)
        return cls(dataclasses.replace(grasps, columns=columns), instance)


def _hashes(ids: Iterable[str], count: int) -> NDArray[np.int64]:
    """Hashes (N,) of identifiers, of which each takes eight bytes; a text takes fifty."""
    return np.fromiter(map(hash, ids), np.int64, count)


class _ChosenCandidates(Sequence[Candidate]):
    """Candidates at chosen rows, see `Candidates.at`."""

    def __init__(self, candidates: Candidates, rows: Sequence[int] | NDArray[np.int64]) -> None:
        self._candidates, self._rows = candidates, rows

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Candidate: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Candidate]: ...

    def __getitem__(self, index: int | slice) -> Candidate | Sequence[Candidate]:
        if isinstance(index, slice):
            return _ChosenCandidates(self._candidates, self._rows[index])
        return self._candidates[int(self._rows[index])]


def share_rows(count: int, shard: str) -> NDArray[np.int64]:
    """Rows of the candidates in a shard, out of `count`; all rows without a shard."""
    return np.array(select_share(range(count), shard), dtype=np.int64)


def given_candidates(scene: Scene, grasps: Mapping[str, GraspSet]) -> Candidates:
    """Candidates from the user's own grasps.

    Args:
        scene: the scene.
        grasps: grasps in the object frame, by name of a free instance. Instances that are not
            named get none; of equal grasps on an instance the first one is kept.

    Raises:
        UnknownNameError: there is no free instance of that name.
        InvalidInputError: a set holds grasps of another object.
    """
    require_instances(scene, grasps)
    for name, grasp_set in grasps.items():
        expected = scene.instance(name).object
        others = distinct_texts(grasp_set.object) - {expected, ""}
        if others:
            raise InvalidInputError(
                f"the grasps given for {name!r} are of object {min(others)!r}, but "
                f"{name!r} is object {expected!r} in the scene"
            )
    known = {name: without_instance(grasps[name]) for name in scene.instances if name in grasps}
    return join_candidates({name: drop_equal_grasps(part) for name, part in known.items()})


def without_instance(grasps: GraspSet) -> GraspSet:
    """The grasps without the column `instance`."""
    columns = {name: values for name, values in grasps.columns.items() if name != INSTANCE_COLUMN}
    return dataclasses.replace(grasps, columns=columns)


def require_instances(scene: Scene, names: Iterable[str], path: str = "") -> None:
    """Refuses names that are not free instances of a scene.

    Args:
        scene: the scene with the instances.
        names: names of the instances that grasps are given for.
        path: path of the grasp file, for the message.

    Raises:
        UnknownNameError: there is no such instance.
    """
    for name in names:
        if name not in scene.instances:
            where = f"{path}: " if path else ""
            raise UnknownNameError(
                f"{where}grasps are given for {quote_value(name)}, which is not a"
                f" free instance of scene {scene.name!r}; {suggest_names(name, scene.instances)}"
            )


def join_candidates(by_instance: dict[str, GraspSet]) -> Candidates:
    """Candidates from grasps by instance name; provenances are kept by instance."""
    if not by_instance:
        return Candidates(GraspSet.create(np.empty((0, 4, 4)), object=""), np.empty(0, dtype=str))
    counts = {name: len(grasps) for name, grasps in by_instance.items() if len(grasps)}
    names = np.array([*counts], dtype=str)
    if len(names) == 1:
        owner = np.broadcast_to(names, [*counts.values()])  # takes no memory
    else:
        owner = np.repeat(names, [*counts.values()])
    grasps = GraspSet.concatenate(by_instance.values())
    parts = dict(zip(by_instance, grasps.provenance["parts"], strict=True))
    return Candidates(dataclasses.replace(grasps, provenance={"parts": parts}), owner)


def drop_equal_grasps(grasps: GraspSet) -> GraspSet:
    """Keeps the first of equal grasps, in the given order."""
    hashes = _hashes(grasps.id, len(grasps))  # sorted in less memory than texts
    if len(np.unique(hashes)) == len(grasps):
        return grasps
    _, first = np.unique(grasps.id, return_index=True)
    return grasps if len(first) == len(grasps) else grasps.select(np.sort(first))


@dataclass(frozen=True)
class InstanceNames:
    """Mapping from the object names of a grasp file to instances of a scene.

    Attributes:
        scene: the scene with the instances.
        path: path of the file, for messages.
        given: names of objects or instances of the scene, by object names in the file; the key ""
            stands for any name in the file.
        is_file: whether the grasps come from a file, so that the user can map its names.
    """

    scene: Scene
    path: str
    given: Mapping[str, str]
    is_file: bool = True

    def require_used(self, foreign: Collection[str]) -> None:
        """Refuses given names that the file does not have.

        Args:
            foreign: object names in the file.

        Raises:
            UnknownNameError: a name in `given` is not among them.
            InvalidInputError: one name is given for a file with several objects.
        """
        names = [name for name in foreign if name]
        for name in self.given:
            if name and name not in names:
                known = suggest_names(name, names) if names else "it names no objects"
                raise UnknownNameError(f"{self.path} has no grasps of object {name!r}; {known}")
        if "" in self.given and len(foreign) > 1:
            raise InvalidInputError(
                f"{self.path} has grasps of {len(foreign)} objects ({list_names(names)});"
                " say which of them is which of the scene, as THEIRS=OURS"
            ).about("objects")

    def instances_of(self, foreign: str) -> list[str]:
        """Free instances that the grasps of one of the file's objects go to.

        Raises:
            InvalidInputError: neither the file nor `given` names the object.
            UnknownNameError: the scene has no such object.
        """
        meant = self.given.get(foreign, self.given.get(""))
        if meant is not None:
            return instances_by_name(self.scene, meant)
        known = {instance.object for instance in self.scene.instances.values()}
        if not foreign:
            how = "" if self.is_file else " (GraspSet.create(..., object=NAME))"
            raise InvalidInputError(
                f"{self.path} does not name the object of its grasps; name it{how};"
                f" scene {self.scene.name!r} has {list_names(sorted(known))}"
            ).about("objects")
        if foreign not in known:
            how = f"say which of the scene's objects it is, {foreign}=NAME; "
            how = how if self.is_file else ""
            raise UnknownNameError(
                f"{self.path} has grasps of object {foreign!r}, which is not in scene"
                f" {self.scene.name!r}; {how}{suggest_names(foreign, known)}"
            ).about("objects")
        return instances_by_name(self.scene, foreign)


def instances_by_name(scene: Scene, name: str) -> list[str]:
    """All free instances of the object of that name, else the instance of that name.

    Raises:
        UnknownNameError: there is no such object or instance.
    """
    instances = scene.instances
    found = [key for key, instance in instances.items() if instance.object == name]
    found = found or [key for key in instances if key == name]
    if not found:
        known = {*instances, *(instance.object for instance in instances.values())}
        raise UnknownNameError(
            f"scene {scene.name!r} has no free instance {name!r}; {suggest_names(name, known)}"
        )
    return found


def chosen_instances(scene: Scene, only: Iterable[str] | None) -> tuple[str, ...]:
    """Free instances selected by object or instance names, in the scene's order.

    Without names, all free instances.

    Raises:
        UnknownNameError: a name is neither an object nor an instance of the scene.
    """
    names = list(only or scene.instances)
    chosen = {key for name in names for key in instances_by_name(scene, name)}
    return tuple(key for key in scene.instances if key in chosen)


def select_instances(
    scene: Scene, by_instance: Mapping[str, GraspSet], only: Iterable[str] | None
) -> Mapping[str, GraspSet]:
    """Grasps on the instances selected by object or instance names; all without names.

    Raises:
        UnknownNameError: a name is neither an object nor an instance of the scene.
        InvalidInputError: there are no grasps on the selected instances.
    """
    names = list(only or ())
    if not names:
        return by_instance
    chosen = chosen_instances(scene, names)
    found = {name: by_instance[name] for name in chosen if len(by_instance.get(name, ()))}
    if not found:
        known = list_names([name for name, grasps in by_instance.items() if len(grasps)])
        raise InvalidInputError(
            f"there are no grasps of {list_names(names)}; there are some of {known}"
        )
    return found


def rows_of_names(
    only: Iterable[str] | None,
    where: str,
    objects: NDArray[np.str_],
    instances: NDArray[np.str_] | None,
) -> NDArray[np.bool_]:
    """Mask (N,) of the grasps whose object or instance is named; all True without names.

    Args:
        only: names of objects or instances.
        where: source of the grasps, for messages.
        objects: (N,) object of each grasp.
        instances: (N,) instance of each grasp; None if unknown.

    Raises:
        UnknownNameError: there are no grasps of that name.
    """
    names = list(only or ())
    columns = [objects] if instances is None else [objects, instances]
    if not names:
        return np.ones(len(objects), dtype=bool)
    known = {name for column in columns for name in column.tolist()}
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"{where} has no grasps of {name!r}; {suggest_names(name, known)}"
            )
    named: NDArray[np.bool_] = np.any([np.isin(column, names) for column in columns], axis=0)
    return named
