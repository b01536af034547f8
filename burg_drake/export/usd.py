"""Writes a scene as USD with rigid-body physics, for Isaac Sim, Omniverse and others.

`scene.usda` places the objects and has their masses. It refers to one file for each object, which
has the visual mesh and the convex collision pieces. Up is z, lengths are metres. Poses are in
double precision, values of physics and meshes in single.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from burg_drake.core import Array, Rgba, quaternion_from_rotation
from burg_drake.export.layout import Layout, PlacedObject, prim_names, renaming_notes
from burg_drake.export.object_parts import VisualPart, collision_meshes, visual_parts
from burg_drake.objects import MassProperties, ObjectEntry, ObjectLibrary, Primitive
from burg_drake.station import FixedBox


def write_usd(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `scene.usda` and the files of objects that it refers to.

    Args:
        layout: scene and station to write.
        folder: empty folder.

    Returns:
        Notes on differences from the scene, one sentence each.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: the mesh is damaged.
    """
    names = prim_names(layout)
    for name, entry in layout.entries.items():
        write_usd_object(layout.library, entry, folder / "objects" / name / "object.usdc")
    stage = new_stage(folder / "scene.usda", "/World")
    scene = UsdPhysics.Scene.Define(stage, "/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0.0, 0.0, -1.0))
    scene.CreateGravityMagnitudeAttr(9.81)
    for placed in layout.objects:
        _add_object(stage, f"/World/{names[placed.name]}", placed)
    for name, box in layout.boxes.items():
        _add_box(stage, f"/World/{names[name]}", name, box)
    stage.GetRootLayer().Save()
    return renaming_notes(names)


def _add_object(stage: Usd.Stage, path: str, placed: PlacedObject) -> None:
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    prim.SetDisplayName(placed.name)
    prim.GetReferences().AddReference(f"./objects/{placed.object}/object.usdc")
    set_pose(prim, placed.X_WO)
    if not placed.fixed:
        UsdPhysics.RigidBodyAPI.Apply(prim)
        _add_mass(prim, placed.entry.mass_properties)


def _add_mass(prim: Usd.Prim, properties: MassProperties) -> None:
    """Adds mass and inertia, which USD takes as principal moments and axes."""
    ixx, iyy, izz, ixy, ixz, iyz = properties.inertia
    moments, axes = np.linalg.eigh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    w, *xyz = quaternion_from_rotation(axes).tolist()
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(properties.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*properties.center_of_mass))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(w, Gf.Vec3f(*xyz)))


def _add_box(stage: Usd.Stage, path: str, name: str, box: FixedBox) -> None:
    """Adds a static box, without the rigid-body API."""
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    prim.SetDisplayName(name)
    cube = add_box_prim(stage, f"{path}/box", box.X_WB, box.size)
    UsdPhysics.CollisionAPI.Apply(cube)
    bind_color(f"{path}/color", cube, box.color)
    bind_friction(f"{path}/friction", cube, box.friction)


def write_usd_object(library: ObjectLibrary, entry: ObjectEntry, file: Path) -> None:
    """Writes the file of an object, whose default prim has the object frame O.

    Args:
        library: library with the object.
        entry: library entry of the object.
        file: file to write; textures are written beside it.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: the mesh is damaged.
    """
    stage = new_stage(file, "/Object")
    for i, part in enumerate(visual_parts(library, entry)):
        _add_visual(stage, f"visual_{i}", part, file.parent)
    collision = UsdGeom.Scope.Define(stage, "/Object/collision")
    collision.CreatePurposeAttr(UsdGeom.Tokens.guide)
    primitive = entry.contact.primitive
    if entry.contact.kind == "primitive" and primitive is not None:
        shape = _add_primitive(stage, "/Object/collision/primitive", primitive)
        UsdPhysics.CollisionAPI.Apply(shape)
    else:
        for i, piece in enumerate(collision_meshes(entry)):
            hull = library.mesh(piece)
            path = f"/Object/collision/piece_{i:03d}"
            mesh = _add_mesh(stage, path, hull.vertices, hull.faces)
            UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
            collider = UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim())
            collider.CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    bind_friction("/Object/friction", collision.GetPrim(), entry.friction)
    stage.GetRootLayer().Save()


def _add_visual(stage: Usd.Stage, name: str, part: VisualPart, folder: Path) -> None:
    mesh = _add_mesh(stage, f"/Object/{name}", part.vertices, part.faces)
    mesh.CreateNormalsAttr(_vector_array(part.normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    texture = ""
    if part.image is not None and part.uv is not None:
        texture = f"./{name}.png"
        part.image.convert("RGB").save(folder / f"{name}.png")
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(part.uv, dtype=np.float32)))
    bind_color(f"/Object/{name}_color", mesh.GetPrim(), part.rgba, texture)


def _add_mesh(
    stage: Usd.Stage, path: str, vertices: Array, faces: NDArray[np.int64]
) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = _vector_array(vertices)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    flat = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(flat))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    return mesh


def _add_primitive(stage: Usd.Stage, path: str, primitive: Primitive) -> Usd.Prim:
    """Adds a primitive at its pose in O; the axis of a cylinder is its z."""
    X_OP, size = primitive.X_OP.matrix(), primitive.size
    if primitive.shape == "box":
        return add_box_prim(stage, path, X_OP, size)
    shape: Any
    if primitive.shape == "sphere":
        shape = UsdGeom.Sphere.Define(stage, path)
    else:
        shape = UsdGeom.Cylinder.Define(stage, path)
        shape.CreateAxisAttr(UsdGeom.Tokens.z)
        shape.CreateHeightAttr(size[1])
    shape.CreateRadiusAttr(size[0])
    shape.CreateExtentAttr(shape.ComputeExtentFromPlugins(shape, Usd.TimeCode.Default()))
    set_pose(shape.GetPrim(), X_OP)
    return shape.GetPrim()


def _vector_array(rows: Array) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))


def new_stage(path: Path, root: str) -> Usd.Stage:
    """Makes a stage in metres and kilograms, z up, with an Xform as its default prim.

    Args:
        path: file of the stage; its folder is made.
        root: path of the default prim.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, root).GetPrim())
    return stage


def set_pose(prim: Usd.Prim, X_AB: Array) -> None:
    """Sets the pose (4, 4) of a prim in its parent."""
    shape = UsdGeom.Xformable(prim)
    w, *xyz = quaternion_from_rotation(X_AB[:3, :3]).tolist()
    shape.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*X_AB[:3, 3].tolist()))
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, Gf.Vec3d(*xyz)))


def add_box_prim(stage: Usd.Stage, path: str, X_AB: Array, size: Sequence[float]) -> Usd.Prim:
    """Adds a box by the pose (4, 4) of its centre in its parent and its extents [m]."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
    set_pose(cube.GetPrim(), X_AB)
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*size))
    return cube.GetPrim()


def bind_color(path: str, prim: Usd.Prim, rgba: Rgba, texture: str = "") -> None:
    """Gives a prim a colour or a texture.

    Args:
        path: path of the new material.
        prim: prim to colour.
        rgba: sRGB colour, as in images and MTL files, and opacity.
        texture: image file relative to the stage's file; the primvar `st` has its coordinates.
    """
    stage = prim.GetStage()
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(rgba[3])
    diffuse = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if texture:
        diffuse.ConnectToSource(_add_texture(stage, path, texture))
    else:
        diffuse.Set(Gf.Vec3f(*(_linear_from_srgb(value) for value in rgba[:3])))
    surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(surface)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def bind_friction(path: str, prim: Usd.Prim, coefficient: float) -> None:
    """Sets the friction coefficient of colliders at and below a prim, without restitution."""
    material = UsdShade.Material.Define(prim.GetStage(), path)
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(coefficient)
    physics.CreateDynamicFrictionAttr(coefficient)
    physics.CreateRestitutionAttr(0.0)
    binding = UsdShade.MaterialBindingAPI.Apply(prim)
    binding.Bind(material, materialPurpose="physics")


def _linear_from_srgb(value: float) -> float:
    """Linear light of an sRGB value in [0, 1] (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _add_texture(stage: Usd.Stage, path: str, file: str) -> UsdShade.Output:
    place = UsdShade.Shader.Define(stage, f"{path}/place")
    place.CreateIdAttr("UsdPrimvarReader_float2")
    place.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    found = place.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(file))
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for direction in ("wrapS", "wrapT"):
        texture.CreateInput(direction, Sdf.ValueTypeNames.Token).Set("repeat")
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(found)
    return texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
