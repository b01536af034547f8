"""Grasps that are called antipodal and clear are so for pads that have a size."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.core import Array, GraspSet
from burg_drake.evaluation import sample_grasps, scored_set
from burg_drake.scene import load_scene
from burg_drake.station import load_station

PAD_Y, PAD_Z = np.linspace(-8.7e-3, 8.7e-3, 20), np.linspace(-8.9e-3, 9.4e-3, 20)
"""The Franka Hand's rubber tips, 17.5 x 18.5 mm (franka_ros)."""
PRESSED = 3e-4
"""How far 40 N press a patch of 100 mm2 into 7.6 mm of rubber of 1e7 Pa [m]."""


def pad_angles(mesh: trimesh.Trimesh, grasps: GraspSet) -> Array:
    """(N,) angle between the closing line and the mean normal that a pad is pressed against, the
    larger one of both sides [deg]; by a grid of rays of trimesh."""
    y, z = (values.ravel() for values in np.meshgrid(PAD_Y, PAD_Z))
    angles = np.zeros(len(grasps))
    for i, X_OG in enumerate(grasps.X_OG):
        for side in (1.0, -1.0):
            p_G = np.stack([np.full(len(y), 0.04 * side), y, z], axis=1)
            p_O, line = p_G @ X_OG[:3, :3].T + X_OG[:3, 3], -side * X_OG[:3, 0]
            hit, ray, face = mesh.ray.intersects_location(
                p_O, np.broadcast_to(line, p_O.shape), multiple_hits=False
            )
            distance = (hit - p_O[ray]) @ line
            depth = np.maximum(distance.min() + PRESSED - distance, 0.0)
            normal = -(depth @ mesh.face_normals[face])
            cosine = (normal @ line) / np.linalg.norm(normal)
            angles[i] = max(angles[i], np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return angles


def test_pads_meet_the_object_where_the_grasp_is() -> None:
    """On the wall of a mug beside its handle a pad meets the handle first, at up to 92 degrees;
    elsewhere one edge of a pad meets the curved wall, and the mug turns until it lies flat. The
    rays know nothing of that turn, by which a grasp may be better than they tell."""
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    mug = sample_grasps(scene, station, 200, only=["mug"])
    assert len(mug) == 200
    assert (pad_angles(scene.library.surface("mug"), mug) > 45.0).sum() <= 1
    scored, friction = scored_set(mug, scene.library, station, scene), scene.entry("mug").friction
    assert scored.column("antipodal_angle").max() <= np.arctan(friction)
    assert scored.column("friction_needed").max() <= friction
    assert scored.column("clearance").min() >= 0.0
