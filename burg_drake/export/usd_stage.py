"""Stages, poses and materials of USD as exports use them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade

from burg_drake.core import Array, quaternion_from_rotation
from burg_drake.core.terminal import Rgba


def new_stage(path: Path, root: str) -> Usd.Stage:
    """A stage in metres and kilograms, z up, with an Xform as its default prim.

    Args:
        path: of its file; the folder is made.
        root: path of the default prim.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, root).GetPrim())
    return stage


def place(prim: Usd.Prim, X_AB: Array) -> None:
    """Gives a prim a pose (4, 4) in its parent."""
    shape = UsdGeom.Xformable(prim)
    w, *xyz = quaternion_from_rotation(X_AB[:3, :3]).tolist()
    shape.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*X_AB[:3, 3].tolist()))
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, Gf.Vec3d(*xyz)))


def box_prim(stage: Usd.Stage, path: str, X_AB: Array, size: Sequence[float]) -> Usd.Prim:
    """A box with a pose (4, 4) of its centre in its parent and extents [m]."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreateExtentAttr([Gf.Vec3f(-0.5), Gf.Vec3f(0.5)])
    place(cube.GetPrim(), X_AB)
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*size))
    return cube.GetPrim()


def bind_color(path: str, prim: Usd.Prim, rgba: Rgba, texture: str = "") -> None:
    """Lets a prim be looked at in a colour, or with a texture.

    Args:
        path: of the new material.
        prim: gets it.
        rgba: colour as pictures and MTL files have it (sRGB), and opacity.
        texture: image file relative to the stage's own; its place is by the primvar `st`.
    """
    stage = prim.GetStage()
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(rgba[3])
    diffuse = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if texture:
        diffuse.ConnectToSource(_texture(stage, path, texture))
    else:
        diffuse.Set(Gf.Vec3f(*(linear(value) for value in rgba[:3])))
    surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(surface)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def bind_friction(path: str, prim: Usd.Prim, coefficient: float) -> None:
    """Lets colliders at a prim and under it have a friction coefficient; they do not bounce."""
    material = UsdShade.Material.Define(prim.GetStage(), path)
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(coefficient)
    physics.CreateDynamicFrictionAttr(coefficient)
    physics.CreateRestitutionAttr(0.0)
    binding = UsdShade.MaterialBindingAPI.Apply(prim)
    binding.Bind(material, materialPurpose="physics")


def linear(value: float) -> float:
    """Linear light of an sRGB value in [0, 1] (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _texture(stage: Usd.Stage, path: str, file: str) -> UsdShade.Output:
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
