"""Writes the USD file of an object: what is looked at, and what collides."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, Vt

from burg_drake.core import Array
from burg_drake.export.parts import VisualPart, collision_meshes, visual_parts
from burg_drake.export.usd_stage import bind_color, bind_friction, box_prim, new_stage, place
from burg_drake.objects.library import ObjectEntry, ObjectLibrary, Primitive

ROOT = "/Object"


def write_object(library: ObjectLibrary, entry: ObjectEntry, file: Path) -> None:
    """Writes the file of an object, whose default prim has the object frame O.

    Args:
        library: has the object.
        entry: of the object.
        file: to write; textures lie beside it.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: it is damaged.
    """
    stage = new_stage(file, ROOT)
    for i, part in enumerate(visual_parts(library, entry)):
        _add_visual(stage, f"visual_{i}", part, file.parent)
    collision = UsdGeom.Scope.Define(stage, f"{ROOT}/collision")
    collision.CreatePurposeAttr(UsdGeom.Tokens.guide)
    primitive = entry.contact.primitive
    if entry.contact.kind == "primitive" and primitive is not None:
        shape = _primitive(stage, f"{ROOT}/collision/primitive", primitive)
        UsdPhysics.CollisionAPI.Apply(shape)
    else:
        for i, piece in enumerate(collision_meshes(entry)):
            hull = library.mesh(piece)
            mesh = _mesh(stage, f"{ROOT}/collision/piece_{i:03d}", hull.vertices, hull.faces)
            UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
            collider = UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim())
            collider.CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    bind_friction(f"{ROOT}/friction", collision.GetPrim(), entry.friction)
    stage.GetRootLayer().Save()


def _add_visual(stage: Usd.Stage, name: str, part: VisualPart, folder: Path) -> None:
    mesh = _mesh(stage, f"{ROOT}/{name}", part.vertices, part.faces)
    mesh.CreateNormalsAttr(_vectors(part.normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    texture = ""
    if part.image is not None and part.uv is not None:
        texture = f"./{name}.png"
        part.image.convert("RGB").save(folder / f"{name}.png")
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(part.uv, dtype=np.float32)))
    bind_color(f"{ROOT}/{name}_color", mesh.GetPrim(), part.rgba, texture)


def _mesh(stage: Usd.Stage, path: str, vertices: Array, faces: NDArray[np.int64]) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = _vectors(vertices)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    flat = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(flat))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    return mesh


def _primitive(stage: Usd.Stage, path: str, primitive: Primitive) -> Usd.Prim:
    """The shape in O; the axis of a cylinder is its z."""
    X_OP, size = primitive.X_OP.matrix(), primitive.size
    if primitive.shape == "box":
        return box_prim(stage, path, X_OP, size)
    shape: Any
    if primitive.shape == "sphere":
        shape = UsdGeom.Sphere.Define(stage, path)
    else:
        shape = UsdGeom.Cylinder.Define(stage, path)
        shape.CreateAxisAttr(UsdGeom.Tokens.z)
        shape.CreateHeightAttr(size[1])
    shape.CreateRadiusAttr(size[0])
    shape.CreateExtentAttr(shape.ComputeExtentFromPlugins(shape, Usd.TimeCode.Default()))
    place(shape.GetPrim(), X_OP)
    return shape.GetPrim()


def _vectors(rows: Array) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))
