"""Fraction of each object that a station camera sees, computed with rays."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.cameras.intrinsics import NEAR_DISTANCE, Intrinsics, camera_intrinsics
from burg_drake.cameras.scene_mesh import SceneMesh, build_scene_mesh
from burg_drake.core import Array, inverse, make_pose, transform_points
from burg_drake.geometry import RayCaster
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station


def visible_from(scene: SceneLike, station: StationLike, camera: str) -> dict[str, float]:
    """Computes the visible share of each free object's silhouette in a station's camera.

    The silhouette is that of the object alone in an unbounded image. Its visible part is in the
    image and not hidden by another object, the table or an obstacle of the station. The arm is
    ignored.

    Args:
        scene: objects with their poses.
        station: station with the camera and the obstacles.
        camera: name of the camera.

    Returns:
        0 to 1 by instance, in the scene's order; 0 for objects behind the camera.

    Raises:
        UnknownNameError: there is no such camera, or a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    scene, station = as_scene(scene), as_station(station)
    document = station.camera(camera)
    intrinsics = camera_intrinsics(document)
    X_SW = inverse(station.document.X_WS.matrix())
    X_SC = X_SW @ document.X_WC.matrix()
    shape = build_scene_mesh(scene)
    caster = _scene_ray_caster(shape, station, X_SW)
    return {name: _visible_share(shape, caster, name, intrinsics, X_SC) for name in scene.instances}


def _scene_ray_caster(shape: SceneMesh, station: Station, X_SW: Array) -> RayCaster:
    """Ray caster for objects, whose faces come first, table and obstacles."""
    document = station.document
    x, y = document.table.center
    boxes = [(make_pose(np.eye(3), (x, y, -0.5 * document.table.size[2])), document.table.size)]
    boxes += [(box.X_WB.matrix(), box.size) for box in document.background.values()]
    vertices, faces = [shape.outline.vertices], [shape.outline.faces]
    for X_WB, size in boxes:
        mesh = trimesh.creation.box(size)
        faces.append(np.asarray(mesh.faces, np.int64) + sum(len(some) for some in vertices))
        vertices.append(transform_points(X_SW @ X_WB, mesh.vertices))
    return RayCaster(np.concatenate(vertices), np.concatenate(faces))


def _visible_share(
    shape: SceneMesh, caster: RayCaster, name: str, intrinsics: Intrinsics, X_SC: Array
) -> float:
    max_slope = 20.0  # Points farther off the axis are outside of every camera's view.
    alone = shape.select((name,))
    p_CV = transform_points(inverse(X_SC), alone.outline.vertices)
    in_front = p_CV[p_CV[:, 2] >= NEAR_DISTANCE]
    if not len(in_front):
        return 0.0
    image_points = np.clip(in_front[:, :2] / in_front[:, 2:], -max_slope, max_slope)
    directions = _direction_grid(image_points.min(axis=0), image_points.max(axis=0))
    along_S = directions @ X_SC[:3, :3].T
    along_S /= np.linalg.norm(along_S, axis=1, keepdims=True)
    start = np.broadcast_to(X_SC[:3, 3], along_S.shape)
    hit = alone.rays.first_hits(start, along_S)[0] >= 0
    if not hit.any():
        return 0.0
    pixel = intrinsics.project(directions[hit])
    size = np.array((intrinsics.width, intrinsics.height))
    inside = ((pixel >= -0.5) & (pixel <= size - 0.5)).all(axis=1)
    face = caster.first_hits(start[hit], along_S[hit])[0]
    owner = np.append(shape.owner, -1)[np.clip(face, -1, len(shape.owner))]
    return float((inside & (owner == shape.names.index(name))).mean())


def _direction_grid(lower: Array, upper: Array) -> Array:
    """(N, 3) directions at z = 1, at the centres of a rectangle's grid cells."""
    rays_per_side = 96  # Visible fractions are accurate to about 0.01.
    share = (np.arange(rays_per_side) + 0.5) / rays_per_side
    x, y = (low + share * (high - low) for low, high in zip(lower, upper, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return np.concatenate([grid, np.ones((len(grid), 1))], axis=1)
