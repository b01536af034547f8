"""Triangles of visual shapes, for ray casting, and vertices of the hulls of meshes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometrySet,
    Mesh,
    Role,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices, MeshError, report_read_errors, transform_points

Triangles = tuple[Array, Indices]


def hull_vertices(shape: Convex | Mesh) -> Array:
    """Vertices (V, 3) of the convex hull of a mesh [m]."""
    hull = shape.GetConvexHull()
    return np.array([hull.vertex(i) for i in range(hull.num_vertices())])


@dataclass(frozen=True, eq=False)
class VisibleSurface:
    """A visual shape of a body.

    Attributes:
        body: the body.
        vertices: (V, 3) in the body's frame [m].
        faces: (F, 3).
    """

    body: BodyIndex
    vertices: Array
    faces: Indices


def visible_surfaces(plant: MultibodyPlant, scene_graph: SceneGraph) -> list[VisibleSurface]:
    """All visual shapes, in order of registration.

    Balls and cylinders are meshed as in Drake's renderer.

    Raises:
        InvalidInputError: a mesh file cannot be read, or has no faces.
    """
    inspector = scene_graph.model_inspector()
    everything = GeometrySet(inspector.GetAllGeometryIds())
    seen = inspector.GetGeometryIds(everything, Role.kPerception)
    found = []
    for geometry in sorted(seen, key=lambda one: one.get_value()):
        frame = inspector.GetFrameId(geometry)
        body = plant.GetBodyFromFrameId(frame) or plant.world_body()
        vertices, faces = shape_triangles(inspector.GetShape(geometry))
        X_FG = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        found.append(VisibleSurface(body.index(), transform_points(X_FG, vertices), faces))
    return found


def shape_triangles(shape: Shape) -> Triangles:
    """Vertices (V, 3) [m] and faces (F, 3) of a visual shape; empty if it has no surface.

    Raises:
        InvalidInputError: a mesh file cannot be read, or has no faces.
    """
    mesh = _shape_trimesh(shape)
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64).reshape(-1, 3)


def _shape_trimesh(shape: Shape) -> trimesh.Trimesh:
    if isinstance(shape, Mesh):
        return _mesh_shape_trimesh(shape)
    if isinstance(shape, Box):
        return trimesh.creation.box((shape.width(), shape.depth(), shape.height()))
    if isinstance(shape, Sphere):
        return trimesh.creation.icosphere(radius=shape.radius())
    if isinstance(shape, Cylinder):
        return trimesh.creation.cylinder(shape.radius(), shape.length())
    if isinstance(shape, Capsule):
        capsule = trimesh.creation.capsule(shape.length(), shape.radius())
        capsule.vertices -= capsule.bounds.mean(axis=0)
        return capsule
    if isinstance(shape, Ellipsoid):
        ball = trimesh.creation.icosphere()
        ball.vertices *= (shape.a(), shape.b(), shape.c())
        return ball
    return trimesh.Trimesh()


def _mesh_shape_trimesh(shape: Mesh) -> trimesh.Trimesh:
    source = shape.source()
    with report_read_errors(source.description(), "a mesh that can be seen"):
        if source.is_path():
            path = Path(source.path())
            read = _read_mesh(path, None, path.suffix, path.stat().st_mtime_ns)
        else:
            file = source.in_memory().mesh_file
            read = _read_mesh(None, file.contents(), file.extension(), 0)
        if not len(read.faces) or not np.isfinite(read.vertices).all():
            raise MeshError(
                "it has no faces, or vertices that are not finite; build the library that has it"
                " again"
            )
    return trimesh.Trimesh(read.vertices * shape.scale3(), read.faces, process=False)


@lru_cache(maxsize=64)
def _read_mesh(path: Path | None, content: bytes | None, kind: str, age: int) -> trimesh.Trimesh:
    """Reads a mesh from a file, or from its content; `age` invalidates the cache when the file
    changes. Cached, as scenes share objects."""
    source = str(path) if content is None else io.BytesIO(content)
    return trimesh.load(
        source, file_type=kind.lstrip("."), force="mesh", process=False, skip_materials=True
    )
