"""Grasps of a file in the frame in which another file wants them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from burg_drake.core import Array, InvalidInputError, inverse, make_pose
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import in_frame
from burg_drake.evaluation.grasp_sets.candidate_files import read_grasps
from burg_drake.evaluation.grasp_sets.input import read_input
from burg_drake.evaluation.grasp_sets.pose_mistakes import FileReading
from burg_drake.formats.common import (
    PANDA,
    Gripper,
    ImportedGrasps,
    PoseFrame,
    with_objects_renamed,
)
from burg_drake.scene.document import Scene

IN_WORDS = {"object": "the frame of their object", "world": "a scene", "camera": "a camera"}


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenScene:
    """What is known of the scene in which a file's grasps were seen, or are to be placed.

    Attributes:
        scene: where objects stand.
        X_SF: (4, 4) the camera in the scene frame; where a world is not the scene frame, that.
        object_ids: names of instances by the file's object ids.
        scene_id: the one to take of a file of several scenes.
        correction: mistakes of the file that are made up for, see `pose_mistakes`.
    """

    scene: Scene | None = None
    X_SF: Array | None = None
    object_ids: Mapping[int, str] = field(default_factory=dict)
    scene_id: str | None = None
    correction: Sequence[str] = ()


def read_in_frame(
    path: str | Path,
    wanted: PoseFrame,
    gripper: Gripper = PANDA,
    *,
    format: str | None = None,
    frame: PoseFrame | None = None,
    objects: Mapping[str, str] | None = None,
    seen: SeenScene | None = None,
) -> ImportedGrasps:
    """Reads grasps and measures them in another frame, with the help of a scene where it takes one.

    Args:
        path: the file, or the folder of a run.
        wanted: the frame; in that of their object, grasps get the column `instance`.
        gripper: the hand that they are for.
        format: of the file; None to tell by the content.
        frame: what its poses are measured in, in place of what the format says.
        objects: new names of objects by those that the file has; one by the empty text is for all.
        seen: the scene, as far as it is known.

    Raises:
        InvalidInputError: the file cannot be read, or a scene or the camera's pose is missing.
        UnknownNameError: an object, instance or scene that is not there.
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
                f"{path} has grasps in {IN_WORDS[given]}, but they are wanted in "
                f"{IN_WORDS[wanted]}; give the pose of the camera in the scene"
            ).about("X_SF")
        grasps = _moved(imported.grasps, seen.X_SF if given == "camera" else inverse(seen.X_SF))
        return ImportedGrasps(grasps, wanted, imported.notes)
    if seen.scene is None:
        raise InvalidInputError(
            f"{path} has grasps in {IN_WORDS[given]}, but they are wanted in "
            f"{IN_WORDS[wanted]}; give the scene in which the objects stand"
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
    X_SX = make_pose() if seen.X_SF is None else seen.X_SF
    grasps = _with_ids(in_frame(seen.scene, placed.by_instance, X_SX), seen.object_ids)
    return ImportedGrasps(grasps, wanted, placed.notes)


def _moved(grasps: GraspSet, X_TF: Array) -> GraspSet:
    """The same grasps, measured in T instead of F."""
    return GraspSet.create(
        X_TF @ grasps.X_OG,
        object=grasps.object,
        width=grasps.width,
        score=grasps.score,
        provenance=grasps.provenance,
        columns=grasps.columns,
    )


def _with_ids(grasps: GraspSet, object_ids: Mapping[int, str]) -> GraspSet:
    """With the column `object_id` of GraspNet's files, where ids of instances are given."""
    if not object_ids:
        return grasps
    ids = {name: number for number, name in object_ids.items()}
    instances = grasps.columns["instance"].tolist()
    return grasps.with_columns(object_id=np.array([ids.get(name, -1) for name in instances]))
