"""Reads grasps from files, gives them to instances of a scene, or changes their frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    distinct_texts,
    inverse,
    list_names,
    make_pose,
    suggest_names,
    transform_points,
)
from burg_drake.evaluation.candidates import (
    INSTANCE_COLUMN,
    InstanceNames,
    instances_by_name,
    require_instances,
    without_instance,
)
from burg_drake.evaluation.grasp_sets.input import read_input, split_by_instance
from burg_drake.evaluation.grasp_sets.pose_mistakes import FileReading, with_poses
from burg_drake.formats import (
    PANDA_GRIPPER,
    PREGRASP_WIDTH_COLUMN,
    Gripper,
    ImportedGrasps,
    PoseFrame,
    with_objects_renamed,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Scene, SceneLike, as_scene

MAX_BOX_DISTANCE = 0.25
"""Maximum distance from G to the bounding box at the nearest grasp [m]; no hand opens that far."""


def require_near(
    grasps: GraspSet, library: ObjectLibrary, source: str, *, is_file: bool = True
) -> None:
    """Refuses grasps if all grasps of an object are far from it.

    Args:
        grasps: grasps in their objects' frames; objects missing from the library are ignored.
        library: library with the objects.
        source: origin of the grasps, for the message.
        is_file: whether the origin is a file, whose object names the user can map.

    Raises:
        InvalidInputError: the nearest grasp of an object is more than `MAX_BOX_DISTANCE` from it.
    """
    for name in sorted(distinct_texts(grasps.object) & set(library.objects)):
        entry = library.entry(name)
        p_OG = grasps.X_OG[grasps.object == name, :3, 3]
        outside = np.maximum(0.0, np.maximum(entry.lower - p_OG, p_OG - np.array(entry.upper)))
        nearest = np.linalg.norm(outside, axis=-1).min()
        if nearest > MAX_BOX_DISTANCE:
            raise InvalidInputError(
                f"{source}: the nearest grasp of object {name!r} is {nearest:.3g} m away"
                " from it; are lengths in metres, is it the right object, and is the"
                " frame of the grasps right?"
            ).about("objects", "frame")


Owners = NDArray[np.str_]


def held_instances(
    scene: Scene, X_SG: Array, gripper: Gripper, among: Sequence[str] | None = None
) -> tuple[Owners, NDArray[np.bool_]]:
    """The free instance that each grasp holds.

    This is the instance with the surface nearest to the grasp point between the open fingers, along
    the closing direction. If no surface is between them, it is the instance with the nearest
    surface, as in GraspNet's evaluation (`eval_grasp` in graspnetAPI/utils/eval_utils.py).

    Args:
        scene: the scene.
        X_SG: (N, 4, 4) grasps in the scene frame.
        gripper: gives opening and reach of the finger tips.
        among: names of free instances; all if None.

    Returns:
        (N,) names, and (N,) whether a part of the instance is between the fingers.

    Raises:
        InvalidInputError: the scene has no free instance for the grasps.
    """
    names = list(scene.instances) if among is None else list(among)
    if not names:
        if len(X_SG):
            raise InvalidInputError(f"scene {scene.name!r} has no free objects to grasp")
        return np.empty(0, dtype=str), np.empty(0, dtype=bool)
    between = np.stack([_distance_between_fingers(scene, name, X_SG, gripper) for name in names])
    held = np.asarray(np.isfinite(between).any(axis=0))
    owner = between.argmin(axis=0)
    if not held.all():
        missed = X_SG[~held, :3, 3]
        beside = np.stack([_surface_distance(scene, name, missed) for name in names])
        owner[~held] = beside.argmin(axis=0)
    return np.array(names)[owner], held


def _distance_between_fingers(scene: Scene, name: str, X_SG: Array, gripper: Gripper) -> Array:
    """(N,) distance from G to the part of an instance between the fingers [m]; inf if there is
    none.
    """
    from burg_drake.geometry import RayCaster

    mesh = scene.library.surface(scene.instance(name).object)
    rays = RayCaster(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    X_OG = inverse(scene.X_SO(name)) @ X_SG
    reach = gripper.opening[1] / 2.0
    nearest = np.full(len(X_OG), np.inf)
    # at the grasp point, at the finger tips, and as far behind, in units of `gripper.tip`
    for height in (0.0, 1.0, -1.0):
        origins = X_OG[:, :3, 3] + height * gripper.tip * X_OG[:, :3, 2]
        for side in (1.0, -1.0):
            _, along = rays.first_hits(origins, side * X_OG[:, :3, 0], reach)
            along = np.where(along <= reach, along, np.inf)
            nearest = np.minimum(nearest, np.hypot(along, height * gripper.tip))
    return nearest


def _surface_distance(scene: Scene, name: str, p_SG: Array) -> Array:
    """(N,) distance from points (N, 3) to an instance [m], accurate to about 2.5 mm."""
    from scipy.spatial import cKDTree
    from trimesh.remesh import subdivide_to_size

    mesh = scene.library.surface(scene.instance(name).object)
    points, _ = subdivide_to_size(mesh.vertices, mesh.faces, 0.005, max_iter=20)
    distance, _ = cKDTree(points).query(transform_points(inverse(scene.X_SO(name)), p_SG))
    return np.asarray(distance)


def group_by_instance(
    scene: Scene, grasps: GraspSet, X_SG: Array, owner: Owners
) -> dict[str, GraspSet]:
    """Grasps in the frames of their objects, by instance in the scene's order.

    Args:
        scene: the scene.
        grasps: N grasps, whose own poses and objects are ignored.
        X_SG: (N, 4, 4) poses of the grasps in the scene frame.
        owner: (N,) names of instances.
    """
    sets = {}
    for name, instance in scene.instances.items():
        chosen = owner == name
        if not chosen.any():
            continue
        X_OG = inverse(scene.X_SO(name)) @ X_SG[chosen]
        sets[name] = with_poses(grasps.select(chosen), X_OG, object=instance.object)
    return sets


def join_in_frame(scene: Scene, grasps: Mapping[str, GraspSet], X_SF: Array) -> GraspSet:
    """Joins grasps of instances into one set measured in a frame of the scene; inverse of
    `group_by_instance`.

    Args:
        scene: the scene.
        grasps: grasps in the frames of their objects, by name of an instance.
        X_SF: (4, 4) pose of the frame F in the scene frame: of a camera, or the identity.

    Returns:
        The grasps with the column `instance`; `X_OG` holds poses in F.

    Raises:
        UnknownNameError: the scene has no such instance.
    """
    if not grasps:
        return GraspSet.create(np.empty((0, 4, 4)), object="", columns={INSTANCE_COLUMN: ""})
    X_FS = inverse(X_SF)
    placed = []
    for name, part in grasps.items():
        columns = {**part.columns, INSTANCE_COLUMN: np.full(len(part), name)}
        placed.append(with_poses(part, X_FS @ scene.X_SO(name) @ part.X_OG, columns=columns))
    return GraspSet.concatenate(placed)


class MisplacedGraspsError(InvalidInputError):
    """Grasps of a file are far from their objects.

    Attributes:
        grasps: grasps by instance, for `find_mistake`.
    """

    def __init__(self, message: str, grasps: Mapping[str, GraspSet] | None = None) -> None:
        super().__init__(message)
        self.grasps = dict(grasps or {})


class NoSceneIdsError(InvalidInputError):
    """A file does not name the scene of its grasps."""


@dataclass(frozen=True)
class GivenGrasps:
    """Grasps read from a file.

    Attributes:
        by_instance: grasps in the object frame by name of an instance, for `given_candidates`.
        notes: sentences about omitted or changed parts of the file.
    """

    by_instance: dict[str, GraspSet]
    notes: tuple[str, ...] = ()


def read_grasps(
    scene: SceneLike,
    path: str | Path,
    gripper: Gripper = PANDA_GRIPPER,
    *,
    format: str | FileReading | None = None,
    objects: Mapping[str, str] | None = None,
    frame: PoseFrame | None = None,
    X_SF: Array | None = None,
    object_ids: Mapping[int, str] | None = None,
    scene_id: str | None = None,
) -> GivenGrasps:
    """Reads a grasp file and gives each grasp to an instance of the scene.

    Grasps of a file that names instances, such as `grasps.npz` of a run, stay on these instances.
    Grasps in the frame of their object go to every instance of the object. Grasps in one common
    frame, of a camera or a world, go to the instance that they hold; see `held_instances`.

    Example::

        given = burg.grasps.read_grasps("tabletop_six", "graspnet.npy", X_SF=X_SC)  # of the camera
        burg.evaluate("tabletop_six", "panda_tabletop", "runs/network", grasps=given.by_instance)

    Args:
        scene: the scene.
        path: a file of any format in `formats.grasp_files`, or the folder of a run.
        gripper: the hand that the grasps are for.
        format: format of the file; None to detect it by content. A `FileReading` also corrects
            mistakes.
        objects: names of the scene's objects, or of its instances, by the names that the file has;
            a name under the empty text is for all grasps.
        frame: reference frame of the poses, in place of the format's.
        X_SF: (4, 4) pose of the file's camera, or of its world, in the scene frame; a world is the
            scene frame if None.
        object_ids: names of instances by the file's object ids.
        scene_id: scene whose grasps are read from a file of several scenes.

    Raises:
        InvalidInputError: the file cannot be read, or the objects of its grasps are unknown.
        UnknownNameError: an object, instance, scene or correction does not exist.
    """
    scene = as_scene(scene)
    reading = format if isinstance(format, FileReading) else FileReading(format)
    imported = read_input(path, reading.format, gripper, reading.correction)
    names = InstanceNames(scene, str(path), dict(objects or {}))
    grasps = _select_scene(imported.grasps, scene_id, names.path)
    frame = frame or imported.frame
    if frame == "object":
        if X_SF is not None or object_ids:
            raise InvalidInputError(
                f"the grasps of {path} are in the frames of their objects; leave out the"
                " pose and the object ids, which do not apply"
            )
        found, notes = _group_by_file_names(grasps, names), list(imported.notes)
    else:
        if frame == "camera" and X_SF is None:
            raise InvalidInputError(
                f"the grasps of {path} are in the frame of a camera; give the pose of the"
                " camera in the scene, or the frame that they are really in"
            ).about("X_SF", "frame")
        X_SF = np.eye(4) if X_SF is None else X_SF
        measured = {**grasps.provenance, "X_SM": X_SF.tolist()}
        grasps = dataclasses.replace(grasps, provenance=measured)
        X_SG = X_SF @ grasps.X_OG
        owner, held = _find_owners(grasps, X_SG, names, object_ids or {}, gripper)
        found = group_by_instance(scene, without_instance(grasps), X_SG, owner)
        notes = [*imported.notes, *_missed_objects_note(found, held, names)]
    notes += _repeated_grasps_note(found, path) + _wide_grasps_notes(grasps, path, gripper)
    return GivenGrasps(found, tuple(notes))


def _wide_grasps_notes(grasps: GraspSet, path: str | Path, gripper: Gripper) -> tuple[str, ...]:
    """Notes about widths beyond the opening of the hand."""
    widest, notes = gripper.opening[1], []
    widths = {
        "width": grasps.width,
        PREGRASP_WIDTH_COLUMN: grasps.columns.get(PREGRASP_WIDTH_COLUMN),
    }
    for name, values in widths.items():
        if values is None or not (values > widest + 1e-6).any():  # rounding of single precision
            continue
        notes.append(
            f"{name} of {(values > widest + 1e-6).sum()} of {len(grasps)} grasps of {path} is more"
            f" than the {1e3 * widest:g} mm to which hand {gripper.name!r} opens (the"
            f" largest is {1e3 * np.nanmax(values):.4g} mm); they are judged with the hand"
            f" open at {1e3 * widest:g} mm."
        )
    return tuple(notes)


def _repeated_grasps_note(by_instance: Mapping[str, GraspSet], path: str | Path) -> tuple[str, ...]:
    """A note about duplicate grasps, which `given_candidates` leaves out."""
    count = sum(len(part) - len(np.unique(part.id)) for part in by_instance.values())
    return (f"{count} grasps of {path} are duplicates; each is judged once.",) if count else ()


def group_by_names(scene: Scene, grasps: GraspSet) -> dict[str, GraspSet]:
    """Assigns grasps in object frames to the instances of a scene.

    Args:
        scene: the scene.
        grasps: grasps, which stay on the instances in their column `instance`; without that column
            they go to every instance of their object.

    Returns:
        The grasps by name of an instance, for `given_candidates`.

    Raises:
        InvalidInputError: the set does not name the objects of its grasps.
        UnknownNameError: the scene has no such object.
    """
    return _group_by_file_names(grasps, InstanceNames(scene, "the set", {}, is_file=False))


def _group_by_file_names(grasps: GraspSet, names: InstanceNames) -> dict[str, GraspSet]:
    """Like `group_by_names`, for a file with its own names of objects."""
    on_instances = INSTANCE_COLUMN in grasps.columns and not names.given
    found = split_by_instance(grasps) if on_instances else _group_by_objects(grasps, names)
    require_instances(names.scene, found, names.path)
    try:
        for part in found.values():
            require_near(part, names.scene.library, names.path, is_file=names.is_file)
    except InvalidInputError as error:
        raise MisplacedGraspsError(str(error), found).about(*error.arguments) from error
    return found


def _select_scene(grasps: GraspSet, scene_id: str | None, path: str) -> GraspSet:
    """The grasps of one scene of the file."""
    if "scene_id" not in grasps.columns:
        if scene_id is not None:
            raise NoSceneIdsError(f"{path} has no scene ids; leave the scene id out").about(
                "scene_id"
            )
        return grasps
    ids = grasps.columns["scene_id"].astype(str)
    known = sorted(set(ids.tolist()))
    if scene_id is None:
        if len(known) > 1:
            raise InvalidInputError(
                f"{path} has grasps of {len(known)} scenes; choose one of them: {list_names(known)}"
            ).about("scene_id")
        return grasps
    if scene_id not in known:
        raise UnknownNameError(
            f"{path} has no scene {scene_id!r}; {suggest_names(scene_id, known)}"
        )
    return grasps.select(ids == scene_id)


def _group_by_objects(grasps: GraspSet, names: InstanceNames) -> dict[str, GraspSet]:
    """Grasps in object frames by instance, in the scene's order."""
    foreign = sorted(distinct_texts(grasps.object))
    names.require_used(foreign)
    sets: dict[str, list[GraspSet]] = {name: [] for name in names.scene.instances}
    for name in foreign:
        chosen = grasps if len(foreign) == 1 else grasps.select(grasps.object == name)
        chosen = without_instance(chosen)
        for instance in names.instances_of(name):
            object = names.scene.instance(instance).object
            sets[instance].append(with_objects_renamed(chosen, {name: object}))
    return {
        name: parts[0] if len(parts) == 1 else GraspSet.concatenate(parts)
        for name, parts in sets.items()
        if parts
    }


def _find_owners(
    grasps: GraspSet,
    X_SG: Array,
    names: InstanceNames,
    object_ids: Mapping[int, str],
    gripper: Gripper,
) -> tuple[Owners, NDArray[np.bool_]]:
    """(N,) instances of grasps (N, 4, 4) in the scene frame, and (N,) which grasps are assigned by
    the file or have a part of the instance between the fingers.
    """
    names.require_used([""])
    among = names.instances_of("") if names.given else None
    owner = _named_owners(grasps, names, object_ids)
    unnamed = owner == ""
    held = np.ones(len(owner), dtype=bool)
    owner[unnamed], held[unnamed] = held_instances(names.scene, X_SG[unnamed], gripper, among)
    return owner.astype(str), held


def _missed_objects_note(
    placed: Mapping[str, GraspSet], held: NDArray[np.bool_], names: InstanceNames
) -> tuple[str, ...]:
    """A note about grasps that hold nothing.

    Raises:
        MisplacedGraspsError: no grasp holds anything.
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
    """(N,) instances by object ids; empty texts for unknown ids."""
    named = np.full(len(grasps), "", dtype=object)
    if not object_ids:
        return named
    if "object_id" not in grasps.columns:
        raise InvalidInputError(f"{names.path} has no object ids; leave their names out").about(
            "object_ids"
        )
    ids = grasps.columns["object_id"]
    unknown = sorted(set(ids.tolist()) - {*object_ids, -1})  # -1: the object is not known
    if unknown:
        raise InvalidInputError(
            f"{names.path} has grasps of object id {unknown[0]}, but no instance is named"
            " for it; named are "
            f"{', '.join(f'{number}={name}' for number, name in object_ids.items())}"
        ).about("object_ids")
    for number, name in object_ids.items():
        instance, *others = instances_by_name(names.scene, name)
        if others:
            raise InvalidInputError(
                f"object id {number} is named {name!r}, but scene {names.scene.name!r}"
                f" has several of those: {', '.join((instance, *others))}; name one of"
                " them"
            )
        named[ids == number] = instance
    return named


FRAME_WORDS = {"object": "the frame of their object", "world": "a scene", "camera": "a camera"}
"""Descriptions of the reference frames of files."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenScene:
    """Known facts about the scene in which a file's grasps were seen or are to be placed.

    Attributes:
        scene: the scene.
        X_SF: (4, 4) pose in the scene frame of the camera, or of a world that is not the scene
            frame.
        object_ids: names of instances by the file's object ids.
        scene_id: scene whose grasps are read from a file of several scenes.
        correction: corrections of mistakes in the file, see `pose_mistakes`.
    """

    scene: Scene | None = None
    X_SF: Array | None = None
    object_ids: Mapping[int, str] = field(default_factory=dict)
    scene_id: str | None = None
    correction: Sequence[str] = ()


def read_in_frame(
    path: str | Path,
    wanted: PoseFrame,
    gripper: Gripper = PANDA_GRIPPER,
    *,
    format: str | None = None,
    frame: PoseFrame | None = None,
    objects: Mapping[str, str] | None = None,
    seen: SeenScene | None = None,
) -> ImportedGrasps:
    """Reads grasps, converted to another frame, with a scene if necessary.

    Args:
        path: the file, or the folder of a run.
        wanted: the new frame; in object frames, grasps get the column `instance`.
        gripper: the hand that the grasps are for.
        format: format of the file; None to detect it by content.
        frame: reference frame of the poses in the file, in place of the format's.
        objects: new names of objects by the file's names; a name under the empty text is for all.
        seen: the scene, as far as known.

    Raises:
        InvalidInputError: the file cannot be read, or a scene or the camera's pose is missing.
        UnknownNameError: an object, instance or scene does not exist.
    """
    seen = seen or SeenScene()
    imported = read_input(path, format, gripper, seen.correction)
    given = frame or imported.frame
    if given == wanted:
        grasps = with_objects_renamed(imported.grasps, objects or {})
        return ImportedGrasps(grasps, wanted, imported.notes)
    if "object" not in (given, wanted):
        if seen.X_SF is None:
            raise InvalidInputError(
                f"{path} has grasps in {FRAME_WORDS[given]}, but they are wanted in "
                f"{FRAME_WORDS[wanted]}; give the pose of the camera in the scene"
            ).about("X_SF")
        X_TF = seen.X_SF if given == "camera" else inverse(seen.X_SF)
        grasps = with_poses(imported.grasps, X_TF @ imported.grasps.X_OG)
        return ImportedGrasps(grasps, wanted, imported.notes)
    if seen.scene is None:
        raise InvalidInputError(
            f"{path} has grasps in {FRAME_WORDS[given]}, but they are wanted in "
            f"{FRAME_WORDS[wanted]}; give the scene in which the objects stand"
        ).about("scene")
    if wanted == "camera" and seen.X_SF is None:
        raise InvalidInputError("grasps in the frame of a camera need its pose; give it").about(
            "X_SF"
        )
    placed = read_grasps(
        seen.scene,
        path,
        gripper,
        format=FileReading(format, tuple(seen.correction)),
        objects=objects,
        frame=given,
        X_SF=None if given == "object" else seen.X_SF,
        object_ids=seen.object_ids if wanted == "object" else None,
        scene_id=seen.scene_id,
    )
    if wanted == "object":
        named = [
            part.with_columns(instance=np.full(len(part), name))
            for name, part in placed.by_instance.items()
        ]
        return ImportedGrasps(GraspSet.concatenate(named), wanted, placed.notes)
    X_SF = make_pose() if seen.X_SF is None else seen.X_SF
    grasps = _add_object_ids(join_in_frame(seen.scene, placed.by_instance, X_SF), seen.object_ids)
    return ImportedGrasps(grasps, wanted, placed.notes)


def _add_object_ids(grasps: GraspSet, object_ids: Mapping[int, str]) -> GraspSet:
    """Adds the column `object_id` of GraspNet's files, if ids of instances are given."""
    if not object_ids:
        return grasps
    ids = {name: number for number, name in object_ids.items()}
    instances = grasps.columns["instance"].tolist()
    return grasps.with_columns(object_id=np.array([ids.get(name, -1) for name in instances]))
