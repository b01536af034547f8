"""Scenes whose objects stand elsewhere than planned, and the grasps that a robot was told to do.

The robot goes where the grasp was planned: X_WG stays. So an object that stands elsewhere is
grasped elsewhere, at X_O'G = inv(X_WO') X_WO X_OG.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from burg_drake.core import Array, inverse
from burg_drake.core.documents import Pose
from burg_drake.evaluation.candidates import Candidates
from burg_drake.scene.document import Scene


def displaced_scene(scene: Scene, X_SO: Mapping[str, Array]) -> Scene:
    """The scene with some of its free objects elsewhere.

    Args:
        scene: as planned.
        X_SO: (4, 4) poses in the scene frame by name of an instance. One that is the planned pose,
            bit for bit, changes nothing, so that a scene in which all are has the same content.
    """
    instances = tuple(
        replace(instance, X_SO=Pose.from_matrix(X_SO[name], quaternion=True))
        if name in X_SO and not np.array_equal(X_SO[name], instance.X_SO.matrix())
        else instance
        for name, instance in scene.instances.items()
    )
    if instances == scene.document.instances:
        return scene
    document = replace(scene.document, instances=instances, origin=None)
    return Scene(document, scene.library, scene.path)


def commanded(planned: Scene, now: Scene, instance: str, X_OG: Array) -> Array:
    """(N, 4, 4) or (4, 4) grasps in the frame of their object where it stands now, for hands that
    go where they were told to when it stood as planned.

    Args:
        planned, now: the same scene, with objects in two places.
        instance: the target.
        X_OG: (N, 4, 4) or (4, 4) grasps as planned; of an object that stands there, they are
            returned as they are, to the last bit.
    """
    there, here = planned.X_SO(instance), now.X_SO(instance)
    if np.array_equal(there, here):
        return X_OG
    X_OO = inverse(here) @ there
    moved: Array = X_OO @ X_OG
    moved[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return moved


def commanded_candidates(planned: Scene, now: Scene, candidates: Candidates) -> Candidates:
    """All grasps of a run as `commanded`; they keep their ids, by which they are told to be the
    same motions of the hand."""
    X_OG = candidates.grasps.X_OG.copy()
    for name in np.unique(candidates.instance).tolist():
        of = candidates.instance == name
        X_OG[of] = commanded(planned, now, name, X_OG[of])
    return Candidates(replace(candidates.grasps, X_OG=X_OG), candidates.instance)
