"""Grasps that are measured in one frame for a whole scene, and the instances that they hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, inverse, transform_points
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates.candidates import INSTANCE
from burg_drake.formats.common import Gripper
from burg_drake.scene.document import Scene

LINES = (0.0, 1.0, -1.0)
"""Heights along the approach, in units of the tips' reach, at which it is looked between the pads:
at the grasp point, at the finger tips, and as far behind."""
SPACING = 0.005
"""Of the points of a surface to which the distance of a grasp is taken [m]."""

Owners = NDArray[np.str_]


def held_instances(
    scene: Scene, X_SG: Array, gripper: Gripper, among: Sequence[str] | None = None
) -> tuple[Owners, NDArray[np.bool_]]:
    """The free instance that each grasp is about.

    It is the one whose surface is nearest to the grasp point among all that lies between the open
    fingers, along the closing direction. Where nothing does, it is the one with the nearest
    surface, as GraspNet's evaluation assigns its grasps (`eval_grasp` in
    graspnetAPI/utils/eval_utils.py).

    Args:
        scene: the scene.
        X_SG: (N, 4, 4) grasps in the scene frame.
        gripper: gives opening and reach of the finger tips.
        among: names of free instances; all if None.

    Returns:
        (N,) names, and (N,) whether something of it lies between the fingers.

    Raises:
        InvalidInputError: there are grasps, but no instance.
    """
    names = list(scene.instances) if among is None else list(among)
    if not names:
        if len(X_SG):
            raise InvalidInputError(f"scene {scene.name!r} has no free objects to grasp")
        return np.empty(0, dtype=str), np.empty(0, dtype=bool)
    between = np.stack([_distance_between(scene, name, X_SG, gripper) for name in names])
    held = np.asarray(np.isfinite(between).any(axis=0))
    owner = between.argmin(axis=0)
    if not held.all():
        missed = X_SG[~held, :3, 3]
        beside = np.stack([_distance_beside(scene, name, missed) for name in names])
        owner[~held] = beside.argmin(axis=0)
    return np.array(names)[owner], held


def _distance_between(scene: Scene, name: str, X_SG: Array, gripper: Gripper) -> Array:
    """(N,) distance from G to what of an instance lies between the fingers [m]; inf if nothing."""
    from burg_drake.geometry import RayCaster

    mesh = scene.library.surface(scene.instance(name).object)
    rays = RayCaster(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    X_OG = inverse(scene.X_SO(name)) @ X_SG
    reach = gripper.opening[1] / 2.0
    nearest = np.full(len(X_OG), np.inf)
    for height in LINES:
        origins = X_OG[:, :3, 3] + height * gripper.tip * X_OG[:, :3, 2]
        for side in (1.0, -1.0):
            _, along = rays.first_hits(origins, side * X_OG[:, :3, 0], reach)
            along = np.where(along <= reach, along, np.inf)
            nearest = np.minimum(nearest, np.hypot(along, height * gripper.tip))
    return nearest


def _distance_beside(scene: Scene, name: str, p_SG: Array) -> Array:
    """(N,) distance from points (N, 3) to an instance, good to half of `SPACING` or so [m]."""
    from trimesh.remesh import subdivide_to_size

    mesh = scene.library.surface(scene.instance(name).object)
    points, _ = subdivide_to_size(mesh.vertices, mesh.faces, SPACING, max_iter=20)
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(transform_points(inverse(scene.X_SO(name)), p_SG))
    return np.asarray(distance)


def by_instance(scene: Scene, grasps: GraspSet, X_SG: Array, owner: Owners) -> dict[str, GraspSet]:
    """Grasps in the frames of their objects, by instance in the scene's order.

    Args:
        scene: the scene.
        grasps: N grasps; their poses and objects do not matter.
        X_SG: (N, 4, 4) their poses in the scene frame.
        owner: (N,) names of instances.
    """
    sets = {}
    for name, instance in scene.instances.items():
        chosen = owner == name
        if not chosen.any():
            continue
        sets[name] = GraspSet.create(
            inverse(scene.X_SO(name)) @ X_SG[chosen],
            object=instance.object,
            width=grasps.width[chosen],
            score=grasps.score[chosen],
            provenance=grasps.provenance,
            columns={key: values[chosen] for key, values in grasps.columns.items()},
        )
    return sets


def in_frame(scene: Scene, grasps: Mapping[str, GraspSet], X_SF: Array) -> GraspSet:
    """One set of grasps of instances, measured in a frame of the scene: the way back.

    Args:
        scene: the scene.
        grasps: in the frames of their objects, by name of an instance.
        X_SF: (4, 4) the frame in the scene frame: of a camera, or the identity.

    Returns:
        The grasps with the column `instance`; `X_OG` holds poses in F.

    Raises:
        UnknownNameError: the scene has no such instance.
    """
    if not grasps:
        return GraspSet.create(np.empty((0, 4, 4)), object="", columns={INSTANCE: ""})
    X_FS = inverse(X_SF)
    placed = [
        GraspSet.create(
            X_FS @ scene.X_SO(name) @ part.X_OG,
            object=part.object,
            width=part.width,
            score=part.score,
            provenance=part.provenance,
            columns={**part.columns, INSTANCE: np.full(len(part), name)},
        )
        for name, part in grasps.items()
    ]
    return GraspSet.concatenate(placed)
