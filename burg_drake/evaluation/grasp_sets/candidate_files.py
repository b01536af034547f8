"""Reads the grasps that a run judges from files, ours and those of other projects."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, UnknownNameError, listing, nearest
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import (
    INSTANCE,
    InstanceNames,
    Owners,
    by_instance,
    held_instances,
    require_instances,
)
from burg_drake.evaluation.grasp_sets.input import read_input
from burg_drake.evaluation.grasp_sets.near_objects import require_near
from burg_drake.evaluation.grasp_sets.pose_mistakes import FileReading
from burg_drake.evaluation.grasp_sets.run_set import of_instances, without_instance
from burg_drake.formats.common import (
    PANDA,
    PREGRASP_WIDTH,
    Gripper,
    PoseFrame,
    with_objects_renamed,
)
from burg_drake.scene.document import Scene, SceneLike, as_scene

OBJECT_ID, SCENE_ID = "object_id", "scene_id"
"""Columns by which files of several objects, or of several scenes, tell theirs apart."""
WIDTH_TOLERANCE = 1e-6
"""By which a width may be beyond the hand's opening and still be its end [m]: single precision."""
NO_OBJECT = -1
"""Object id of grasps of which it is not known."""


class MisplacedGraspsError(InvalidInputError):
    """Grasps of a file are nowhere near their objects.

    Attributes:
        grasps: by instance, in which `find_mistake` may find why.
    """

    def __init__(self, message: str, grasps: Mapping[str, GraspSet] | None = None) -> None:
        super().__init__(message)
        self.grasps = dict(grasps or {})


class NoSceneIdsError(InvalidInputError):
    """A file does not say which scene its grasps are of."""


@dataclass(frozen=True)
class GivenGrasps:
    """What was read of a file.

    Attributes:
        by_instance: grasps in the object frame by name of an instance, for `given_candidates`.
        notes: what of the file was left behind or changed, one sentence each.
    """

    by_instance: dict[str, GraspSet]
    notes: tuple[str, ...] = ()


def read_grasps(
    scene: SceneLike,
    path: str | Path,
    gripper: Gripper = PANDA,
    *,
    format: str | FileReading | None = None,
    objects: Mapping[str, str] | None = None,
    frame: PoseFrame | None = None,
    X_SF: Array | None = None,
    object_ids: Mapping[int, str] | None = None,
    scene_id: str | None = None,
) -> GivenGrasps:
    """Reads a grasp file and gives each grasp to an instance of the scene.

    Grasps of a file that names instances, such as `grasps.npz` of a run, stay on them. Those that
    are measured in the frame of their object go to every instance of it. Those that are measured
    in one frame for all, a camera's or a world's, go to the instance that they hold; see
    `candidates.scene_frame.held_instances`.

    Example::

        given = burg.grasps.read_grasps("tabletop_six", "graspnet.npy", X_SF=X_SC)  # of the camera
        burg.evaluate("tabletop_six", "panda_tabletop", "runs/network", grasps=given.by_instance)

    Args:
        scene: the scene.
        path: a file of any format in `formats.grasp_files`, or the folder of a run.
        gripper: the hand that the grasps are for.
        format: of the file; None to tell by the content. A `FileReading` corrects mistakes, too.
        objects: names of the scene's objects, or of its instances, by the names that the file has;
            a name by the empty text is for all grasps.
        frame: what the poses are measured in, in place of what the format says.
        X_SF: (4, 4) pose of the file's camera, or of its world, in the scene frame; a world is the
            scene frame if None.
        object_ids: names of instances by the file's object ids.
        scene_id: the one to take of a file of several scenes.

    Raises:
        InvalidInputError: the file cannot be read, or it is not told what its grasps belong to.
        UnknownNameError: an object, instance, scene or correction that is not there.
    """
    scene = as_scene(scene)
    reading = format if isinstance(format, FileReading) else FileReading(format)
    imported = read_input(path, reading.format, gripper, reading.correction)
    names = InstanceNames(scene, str(path), dict(objects or {}))
    grasps = _of_one_scene(imported.grasps, scene_id, names.path)
    frame = frame or imported.frame
    if frame == "object":
        if X_SF is not None or object_ids:
            raise InvalidInputError(
                f"the grasps of {path} are in the frames of their objects; leave out the"
                " pose and the object ids, which do not apply"
            )
        found = _of_names(grasps, names)
        return GivenGrasps(
            found, (*imported.notes, *_repeated(found, path), *_wide(grasps, path, gripper))
        )
    if frame == "camera" and X_SF is None:
        raise InvalidInputError(
            f"the grasps of {path} are in the frame of a camera; give the pose of the"
            " camera in the scene, or the frame that they are really in"
        ).about("X_SF", "frame")
    X_SF = np.eye(4) if X_SF is None else X_SF
    X_SG = X_SF @ grasps.X_OG
    measured = {**grasps.provenance, "X_SM": X_SF.tolist()}
    grasps = dataclasses.replace(grasps, provenance=measured)
    owner, held = _owners(grasps, X_SG, names, object_ids or {}, gripper)
    placed = by_instance(scene, without_instance(grasps), X_SG, owner)
    notes = _missed(placed, held, names)
    return GivenGrasps(
        placed,
        (*imported.notes, *notes, *_repeated(placed, path), *_wide(grasps, path, gripper)),
    )


def _wide(grasps: GraspSet, path: str | Path, gripper: Gripper) -> tuple[str, ...]:
    """A note about widths to which the hand does not open."""
    widest, notes = gripper.opening[1], []
    arriving = grasps.columns.get(PREGRASP_WIDTH)
    for name, values in (("width", grasps.width), (PREGRASP_WIDTH, arriving)):
        beyond = None if values is None else values[values > widest + WIDTH_TOLERANCE]
        if beyond is not None and len(beyond):
            notes.append(
                f"{name} of {len(beyond)} of {len(grasps)} grasps of {path} is more than"
                f" the {1e3 * widest:g} mm to which hand {gripper.name!r} opens (the"
                f" largest is {1e3 * beyond.max():.4g} mm); they are judged with the hand"
                f" open at {1e3 * widest:g} mm."
            )
    return tuple(notes)


def _repeated(by_instance: Mapping[str, GraspSet], path: str | Path) -> tuple[str, ...]:
    """A note about grasps that are there several times, which `given_candidates` leaves out."""
    count = sum(len(part) - len(np.unique(part.id)) for part in by_instance.values())
    return (f"{count} grasps of {path} are duplicates; each is judged once.",) if count else ()


def by_names(scene: Scene, grasps: GraspSet) -> dict[str, GraspSet]:
    """Gives grasps in the frames of their objects to the instances of a scene.

    Args:
        scene: the scene.
        grasps: with a column `instance` they stay on the instances that it names; else they go to
            every instance of their object.

    Returns:
        The grasps by name of an instance, for `given_candidates`.

    Raises:
        InvalidInputError: the set does not say which object its grasps are of.
        UnknownNameError: the scene has no such object.
    """
    return _of_names(grasps, InstanceNames(scene, "the set", {}, is_file=False))


def _of_names(grasps: GraspSet, names: InstanceNames) -> dict[str, GraspSet]:
    """The same, with the names of a file."""
    on_instances = INSTANCE in grasps.columns and not names.given
    found = of_instances(grasps) if on_instances else _of_objects(grasps, names)
    require_instances(names.scene, found, names.path)
    try:
        for part in found.values():
            require_near(part, names.scene.library, names.path, is_file=names.is_file)
    except InvalidInputError as error:
        raise MisplacedGraspsError(str(error), found).about(*error.arguments) from error
    return found


def _of_one_scene(grasps: GraspSet, scene_id: str | None, path: str) -> GraspSet:
    """The grasps of one scene of the file."""
    if SCENE_ID not in grasps.columns:
        if scene_id is not None:
            raise NoSceneIdsError(f"{path} has no scene ids; leave the scene id out").about(
                "scene_id"
            )
        return grasps
    ids = grasps.columns[SCENE_ID].astype(str)
    known = sorted(set(ids.tolist()))
    if scene_id is None:
        if len(known) > 1:
            raise InvalidInputError(
                f"{path} has grasps of {len(known)} scenes; choose one of them: {listing(known)}"
            ).about("scene_id")
        return grasps
    if scene_id not in known:
        raise UnknownNameError(f"{path} has no scene {scene_id!r}; {nearest(scene_id, known)}")
    return grasps.select(ids == scene_id)


def _of_objects(grasps: GraspSet, names: InstanceNames) -> dict[str, GraspSet]:
    """Grasps in object frames by instance, in the scene's order."""
    foreign = sorted(set(grasps.object.tolist()))
    names.require_used(foreign)
    sets: dict[str, list[GraspSet]] = {name: [] for name in names.scene.instances}
    for name in foreign:
        chosen = without_instance(grasps.select(grasps.object == name))
        for instance in names.of_object(name):
            object = names.scene.instance(instance).object
            sets[instance].append(with_objects_renamed(chosen, {name: object}))
    return {
        name: parts[0] if len(parts) == 1 else GraspSet.concatenate(parts)
        for name, parts in sets.items()
        if parts
    }


def _owners(
    grasps: GraspSet,
    X_SG: Array,
    names: InstanceNames,
    object_ids: Mapping[int, str],
    gripper: Gripper,
) -> tuple[Owners, NDArray[np.bool_]]:
    """(N,) instances that grasps (N, 4, 4) in the scene frame belong to, and which of them are told
    by the file, or have something of it between their fingers."""
    names.require_used([""])
    among = names.of_object("") if names.given else None
    owner = _named_owners(grasps, names, object_ids)
    open_ = owner == ""
    held = np.ones(len(owner), dtype=bool)
    owner[open_], held[open_] = held_instances(names.scene, X_SG[open_], gripper, among)
    return owner.astype(str), held


def _missed(
    placed: Mapping[str, GraspSet],
    held: NDArray[np.bool_],
    names: InstanceNames,
) -> tuple[str, ...]:
    """A note about grasps that hold nothing.

    Raises:
        MisplacedGraspsError: none holds anything.
    """
    missed = int((~held).sum())
    if not missed:
        return ()
    if missed == len(held):
        raise MisplacedGraspsError(
            f"none of the {missed} grasps of {names.path} has an object of scene "
            f"{names.scene.name!r} between its fingers; is it the right scene, and is the"
            " pose of the camera or workspace right?",
            placed,
        ).about("X_SF", "frame")
    return (
        f"{missed} of {len(held)} grasps have no object between their fingers; each was"
        " assigned to the object with the nearest surface.",
    )


def _named_owners(
    grasps: GraspSet, names: InstanceNames, object_ids: Mapping[int, str]
) -> NDArray[np.object_]:
    """(N,) instances that object ids tell; empty texts where they do not."""
    named = np.full(len(grasps), "", dtype=object)
    if not object_ids:
        return named
    if OBJECT_ID not in grasps.columns:
        raise InvalidInputError(f"{names.path} has no object ids; leave their names out").about(
            "object_ids"
        )
    ids = grasps.columns[OBJECT_ID]
    unknown = sorted(set(ids.tolist()) - {*object_ids, NO_OBJECT})
    if unknown:
        raise InvalidInputError(
            f"{names.path} has grasps of object id {unknown[0]}, but no instance is named"
            " for it; named are "
            f"{', '.join(f'{number}={name}' for number, name in object_ids.items())}"
        ).about("object_ids")
    for number, name in object_ids.items():
        instance, *others = names.called(name)
        if others:
            raise InvalidInputError(
                f"object id {number} is named {name!r}, but scene {names.scene.name!r}"
                f" has several of those: {', '.join((instance, *others))}; name one of"
                " them"
            )
        named[ids == number] = instance
    return named
