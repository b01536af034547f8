"""The grasps that a run judges: which grasp, on which instance of the scene, under which id."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.content import content_hash, rng_from
from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.frames import Array
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.approach import ApproachCone
from burg_drake.objects.entry import ObjectEntry
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station

DEFAULT_APPROACH_ANGLE_DEG = 75.0
"""Keeps the hand above the horizontal, and leaves out pairs of an object's bottom and top for
friction up to tan(15 deg) = 0.27: one of the two fingers would be below the table."""

DOWN_DIGITS = 6
"""Straight down in an object's frame is rounded, so that instances of one object that differ by a
turn about the vertical share their grasps."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One grasp on one instance.

    Attributes:
        id: `INSTANCE-GRASP`, unique in a run.
        instance: name of the placed object.
        X_OG: (4, 4) grasp in the object frame.
        friction: the target's coefficient, in place of the library's.
        mass: of the target, in place of the library's [kg].
    """

    id: str
    instance: str
    X_OG: Array
    friction: float | None = None
    mass: float | None = None


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
        for id, instance, X_OG in zip(self.id, self.instance, self.grasps.X_OG, strict=True):
            yield Candidate(id, str(instance), X_OG)

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
        runs = [[name, len(list(group))] for name, group in groupby(self.instance.tolist())]
        provenance = {**self.grasps.provenance, "instances": runs}
        dataclasses.replace(self.grasps, provenance=provenance).save(path)

    @classmethod
    def load(cls, path: Path) -> Candidates:
        """Reads a file written by `save`.

        Raises:
            InvalidInputError: the file is something else.
        """
        grasps = GraspSet.load(path)
        provenance = dict(grasps.provenance)
        runs = provenance.pop("instances", None)
        if runs is None or sum(count for _, count in runs) != len(grasps):
            raise InvalidInputError(f"{path} does not say which instance each grasp belongs to")
        names = [name for name, count in runs for _ in range(count)]
        return cls(dataclasses.replace(grasps, provenance=provenance), np.array(names, dtype=str))


def sample_candidates(
    scene: Scene,
    station: Station,
    n: int,
    seed: int,
    approach_angle_deg: float = DEFAULT_APPROACH_ANGLE_DEG,
) -> Candidates:
    """Samples antipodal grasps on every free instance.

    The random stream follows from the seed and the object's content alone. All instances of an
    object that lie on the same side get the same grasps, whatever else stands in the scene.

    Args:
        scene: the scene; its background objects get no grasps.
        station: gives the opening of the hand.
        n: grasps for each instance; there are fewer where the object has no more.
        seed: of the run.
        approach_angle_deg: largest angle between the approach and straight down, above 0 to
            180; with 180 the hand comes from anywhere.

    Raises:
        InvalidInputError: n is below 1, or the angle out of its range.
        UnknownNameError: the mesh file of an object is missing.
    """
    if n < 1:
        raise InvalidInputError(f"grasps per object is {n}; give 1 or more")
    if not 0.0 < approach_angle_deg <= 180.0:
        raise InvalidInputError(
            f"approach angle is {approach_angle_deg:g} degrees; give more than 0, at most 180"
        )
    wanted: dict[str, tuple[str, ApproachCone | None]] = {}
    for name, instance in scene.instances.items():
        cone = _approach_cone(scene, station, name, approach_angle_deg)
        wanted[name] = instance.object, cone
    sampled = {
        (object, cone): _sample_object(scene, station, object, n, seed, cone)
        for object, cone in dict.fromkeys(wanted.values())
    }
    return _join({name: sampled[key] for name, key in wanted.items()})


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
    for name, grasp_set in grasps.items():
        if name not in scene.instances:
            raise UnknownNameError(
                f"grasps are given for {name!r}, which is not a free instance of scene"
                f" {scene.name!r}; {nearest(name, scene.instances)}"
            )
        expected = scene.instance(name).object
        others = set(grasp_set.object.tolist()) - {expected, ""}
        if others:
            raise InvalidInputError(
                f"grasps given for {name!r} belong to object {min(others)!r}; the scene has"
                f" object {expected!r} there"
            )
    return _join({name: _distinct(grasps[name]) for name in scene.instances if name in grasps})


def read_grasps(scene: Scene, path: str | Path) -> dict[str, GraspSet]:
    """Reads a grasp file for `given_candidates`.

    Args:
        scene: the scene.
        path: grasps.npz of a run, whose grasps stay on their instances; or any other file of a
            `GraspSet`, whose grasps go to every instance of their object.

    Raises:
        InvalidInputError: the file is something else.
        UnknownNameError: grasps of an object or on an instance that the scene does not have.
    """
    grasps = GraspSet.load(path)
    if "instances" in grasps.provenance:
        return _of_run(Candidates.load(Path(path)))
    objects = {name: scene.instance(name).object for name in scene.instances}
    unknown = sorted(set(grasps.object.tolist()) - set(objects.values()))
    if unknown:
        raise UnknownNameError(
            f"{path} has grasps of object {unknown[0]!r}, which is not in scene {scene.name!r};"
            f" {nearest(unknown[0], set(objects.values()))}"
        )
    members = {name: grasps.object == object for name, object in objects.items()}
    return {name: grasps.select(mask) for name, mask in members.items() if mask.any()}


def _of_run(candidates: Candidates) -> dict[str, GraspSet]:
    """The grasps by instance, each set with its own provenance."""
    parts = candidates.grasps.provenance.get("parts", {})
    sets = {}
    for name in dict.fromkeys(candidates.instance.tolist()):
        chosen = candidates.grasps.select(candidates.instance == name)
        sets[name] = dataclasses.replace(chosen, provenance=parts.get(name, {}))
    return sets


def _join(by_instance: dict[str, GraspSet]) -> Candidates:
    if not by_instance:
        return Candidates(GraspSet.create(np.empty((0, 4, 4)), object=""), np.empty(0, dtype=str))
    names = [name for name, grasps in by_instance.items() for _ in range(len(grasps))]
    grasps = GraspSet.concatenate(by_instance.values())
    parts = dict(zip(by_instance, grasps.provenance["parts"], strict=True))
    return Candidates(
        dataclasses.replace(grasps, provenance={"parts": parts}), np.array(names, dtype=str)
    )


def _distinct(grasps: GraspSet) -> GraspSet:
    _, first = np.unique(grasps.id, return_index=True)
    return grasps.select(np.sort(first))


def _approach_cone(
    scene: Scene, station: Station, instance: str, angle_deg: float
) -> ApproachCone | None:
    """The cone about straight down, seen from an instance; None if it holds every direction."""
    if angle_deg == 180.0:
        return None
    X_WO = station.document.X_WS.matrix() @ scene.X_SO(instance)
    x, y, z = np.round(-X_WO[2, :3], DOWN_DIGITS) + 0.0  # no negative zeros
    return ApproachCone((x, y, z), np.deg2rad(angle_deg))


def _sample_object(
    scene: Scene, station: Station, name: str, n: int, seed: int, cone: ApproachCone | None
) -> GraspSet:
    from burg_drake.grasping.antipodal import sample_antipodal

    entry: ObjectEntry = scene.library.entry(name)
    return _distinct(
        sample_antipodal(
            scene.library.surface(name),
            n,
            rng_from("antipodal", seed, entry.build),
            friction=entry.friction,
            opening=station.hand.opening,
            approach_cone=cone,
            object=name,
        )
    )
