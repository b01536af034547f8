"""Writes a scene as USD with rigid-body physics, for Isaac Sim, Omniverse and others.

`scene.usda` places the objects, says what moves and what it weighs, and refers to one file an
object, which has what is looked at and the convex pieces that collide. Up is z, lengths are metres.
Poses are in double precision, the numbers of physics and meshes in single.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from burg_drake.core import quaternion_from_rotation
from burg_drake.export.layout import Layout, PlacedObject
from burg_drake.export.legal_names import LegalNames
from burg_drake.export.usd_object import write_object
from burg_drake.export.usd_stage import bind_color, bind_friction, box_prim, new_stage, place
from burg_drake.objects.library import MassProperties
from burg_drake.station.world import FixedBox

USD_FILE = "scene.usda"
OBJECTS = "objects"
"""Folder with one folder an object."""
WORLD = "/World"
GRAVITY = 9.81


def write_usd(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `scene.usda` and the files of objects that it refers to.

    Args:
        layout: what to write.
        folder: empty.

    Returns:
        What became other than it is in the scene, one sentence each.

    Raises:
        UnknownNameError: a mesh is missing.
        MeshError: it is damaged.
    """
    names = LegalNames.of_usd(layout)
    for name, entry in layout.entries.items():
        write_object(layout.library, entry, folder / OBJECTS / name / "object.usdc")
    stage = new_stage(folder / USD_FILE, WORLD)
    scene = UsdPhysics.Scene.Define(stage, "/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0.0, 0.0, -1.0))
    scene.CreateGravityMagnitudeAttr(GRAVITY)
    for placed in layout.objects:
        _add_object(stage, f"{WORLD}/{names[placed.name]}", placed)
    for name, box in layout.boxes.items():
        _add_box(stage, f"{WORLD}/{names[name]}", name, box)
    stage.GetRootLayer().Save()
    return names.notes


def _add_object(stage: Usd.Stage, path: str, placed: PlacedObject) -> None:
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    prim.SetDisplayName(placed.name)
    prim.GetReferences().AddReference(f"./{OBJECTS}/{placed.object}/object.usdc")
    place(prim, placed.X_WO)
    if not placed.fixed:
        UsdPhysics.RigidBodyAPI.Apply(prim)
        _add_mass(prim, placed.entry.mass_properties)


def _add_mass(prim: Usd.Prim, properties: MassProperties) -> None:
    """Mass and inertia, which USD has by principal axes."""
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
    """A body that does not move, as it is no rigid body."""
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    prim.SetDisplayName(name)
    cube = box_prim(stage, f"{path}/box", box.X_WB, box.size)
    UsdPhysics.CollisionAPI.Apply(cube)
    bind_color(f"{path}/color", cube, box.color)
    bind_friction(f"{path}/friction", cube, box.friction)
