"""Hydroelastic meshes of objects, as Drake makes them for contact, and cuts through them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import GeometryId, SceneGraph, TriangleSurfaceMesh
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import ConvexHull

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.objects import ObjectLibrary
from burg_drake.station import add_models

HIGH_PRESSURE_COLOR = np.array([0.90, 0.10, 0.08])
"""Colour of the highest pressure in an object. Colours are linear in the pressure."""


@dataclass(frozen=True)
class HydroelasticMesh:
    """Mesh of a geometry in hydroelastic contact, in the object frame O.

    Attributes:
        vertices: (V, 3) [m].
        faces: (F, 3) triangles of the surface.
        tetrahedra: (T, 4) of a compliant geometry; none of a rigid one.
        pressure: (V,) share of the hydroelastic modulus, in [0, 1]; 0 throughout if rigid.
    """

    vertices: Array
    faces: NDArray[np.int64]
    tetrahedra: NDArray[np.int64]
    pressure: Array

    @property
    def compliant(self) -> bool:
        """Whether it has a pressure field."""
        return len(self.tetrahedra) > 0


def hydroelastic_meshes(
    library: ObjectLibrary, names: Iterable[str]
) -> dict[str, tuple[HydroelasticMesh, ...]]:
    """The hydroelastic meshes of objects, by name.

    Args:
        library: library whose SDFs to load.
        names: names of its objects.

    Raises:
        InvalidInputError: Drake cannot load an SDF.
    """
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 1e-3)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    found = {}
    for name in names:
        path = library.path(library.entry(name).sdf)
        try:
            (model,) = add_models(parser, path)
        except RuntimeError as error:
            raise InvalidInputError(
                f"{path} cannot be loaded ({' '.join(str(error).split())}); build the library"
                f" {library.name!r} again"
            ) from error
        (body,) = plant.GetBodyIndices(model)
        ids = plant.GetCollisionGeometriesForBody(plant.get_body(body))
        meshes = (_hydroelastic_mesh(scene_graph, id_) for id_ in ids)
        found[name] = tuple(mesh for mesh in meshes if mesh is not None)
    return found


def _hydroelastic_mesh(scene_graph: SceneGraph, geometry: GeometryId) -> HydroelasticMesh | None:
    inspector = scene_graph.model_inspector()
    mesh = inspector.maybe_get_hydroelastic_mesh(geometry)
    if mesh is None:
        return None
    X_OG = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
    vertices = transform_points(X_OG, np.array(mesh.vertices()).reshape(-1, 3))
    if isinstance(mesh, TriangleSurfaceMesh):
        faces = np.array([[t.vertex(k) for k in range(3)] for t in mesh.triangles()])
        return HydroelasticMesh(vertices, faces, np.empty((0, 4), int), np.zeros(len(vertices)))
    tetrahedra = np.array([[t.vertex(k) for k in range(4)] for t in mesh.tetrahedra()])
    faces = boundary_faces(tetrahedra)
    return HydroelasticMesh(vertices, faces, tetrahedra, convex_depth(vertices, faces))


def boundary_faces(tetrahedra: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces (F, 3) that belong to only one of some tetrahedra (T, 4)."""
    # Vertices of the face opposite to each vertex, counter-clockwise from outside.
    corners = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    faces = tetrahedra[:, corners].reshape(-1, 3)
    _, index, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return faces[np.sort(index[count == 1])]


def convex_depth(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """Depth of points below the surface of a convex body, relative to the deepest point.

    Drake's pressure is the hydroelastic modulus times this share; all compliant geometries of a
    library are convex.

    Args:
        vertices: (V, 3) on the surface and inside [m].
        faces: (F, 3) triangles of the surface.

    Returns:
        (V,) in [0, 1].
    """
    planes = ConvexHull(vertices).equations  # outward normals and offsets
    depth = -(vertices @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    depth = np.maximum(depth, 0.0)
    depth[np.unique(faces)] = 0.0
    return depth / max(depth.max(), np.finfo(float).tiny)


def cut_open(
    mesh: HydroelasticMesh, point: Array, normal: Array
) -> tuple[Array, NDArray[np.int64], Array]:
    """Cuts a compliant mesh with a plane; returns the surface of the rest, with the cut closed.

    Args:
        mesh: compliant mesh.
        point: (3,) point of the plane [m].
        normal: (3,) normal of the plane, towards the removed side.

    Returns:
        Vertices (N, 3) [m], triangles (M, 3) and pressure (N,), as in `HydroelasticMesh`.
    """
    height = (mesh.vertices - point) @ normal
    corners: list[Array] = []  # of triangles: x, y, z, pressure
    points = np.column_stack([mesh.vertices, mesh.pressure])
    for face in mesh.faces:
        kept = _clip_polygon(points[face], height[face])
        corners += [kept[[0, k, k + 1]] for k in range(1, len(kept) - 1)]
    crossed = (height[mesh.tetrahedra] < 0.0).any(axis=1) & (height[mesh.tetrahedra] >= 0.0).any(
        axis=1
    )
    for tetrahedron in mesh.tetrahedra[crossed]:
        section = _cut_tetrahedron(points[tetrahedron], height[tetrahedron])
        corners += [section[[0, k, k + 1]] for k in range(1, len(section) - 1)]
    stacked = np.reshape(corners, (-1, 4))
    faces = np.arange(len(stacked)).reshape(-1, 3)
    return stacked[:, :3], faces, stacked[:, 3]


def _clip_polygon(polygon: Array, height: Array) -> Array:
    """The part of a convex polygon (K, D) where `height` (K,) is negative."""
    kept = []
    for k in range(len(polygon)):
        n = (k + 1) % len(polygon)
        if height[k] < 0.0:
            kept.append(polygon[k])
        if (height[k] < 0.0) != (height[n] < 0.0):
            kept.append(_zero_crossing(polygon[k], polygon[n], height[k], height[n]))
    return np.array(kept)


def _cut_tetrahedron(corners: Array, height: Array) -> Array:
    """The polygon (3 or 4, D) in which a plane cuts a tetrahedron (4, D)."""
    below, above = np.flatnonzero(height < 0.0), np.flatnonzero(height >= 0.0)
    cut = [
        _zero_crossing(corners[i], corners[j], height[i], height[j]) for i in below for j in above
    ]
    return np.array(cut)[[0, 1, 3, 2]] if len(cut) == 4 else np.array(cut)


def _zero_crossing(a: Array, b: Array, height_a: float, height_b: float) -> Array:
    return a + (b - a) * (height_a / (height_a - height_b))


def pressure_colors(pressure: Array) -> Array:
    """(N, 3) colours of pressures (N,)."""
    low_color = np.array([0.55, 0.72, 0.90])  # Of zero pressure.
    return low_color + (HIGH_PRESSURE_COLOR - low_color) * np.asarray(pressure)[:, None]
