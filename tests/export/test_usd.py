"""USD as OpenUSD reads it."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdShade

from burg_drake.core import Array
from burg_drake.export import Exported
from burg_drake.scene import Scene
from burg_drake.station import Station
from tests.export.mass_matrix import inertia_matrix

LEGAL = {"2-can.b": "_2_can_b"}


@pytest.fixture(scope="module")
def stage(exports: dict[str, Exported]) -> Usd.Stage:
    return Usd.Stage.Open(str(exports["usd"].main))


def prim(stage: Usd.Stage, name: str) -> Usd.Prim:
    found = stage.GetPrimAtPath(f"/World/{LEGAL.get(name, name)}")
    assert found.IsValid(), name
    return found


def pose(of: Usd.Prim) -> Array:
    """Gf has row vectors."""
    return np.array(UsdGeom.Xformable(of).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T


def test_units_and_up(stage: Usd.Stage) -> None:
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    assert stage.GetDefaultPrim() == stage.GetPrimAtPath("/World")


def test_names_that_usd_does_not_allow_are_told(
    stage: Usd.Stage, exports: dict[str, Exported]
) -> None:
    assert prim(stage, "2-can.b").GetDisplayName() == "2-can.b"
    assert (
        "'2-can.b' is called '_2_can_b' in the export, as the format does not allow the name"
        in (exports["usd"].notes)
    )


def test_everything_is_where_the_documents_put_it(
    stage: Usd.Stage, X_WO: dict[str, Array], station: Station
) -> None:
    for name, X in X_WO.items():
        np.testing.assert_allclose(pose(prim(stage, name)), X, atol=1e-15, err_msg=name)
    for name, box in station.document.background.items():
        X_WB = box.X_WB.matrix()
        X_WB[:3, :3] *= box.size
        cube = stage.GetPrimAtPath(f"/World/{name}/box")
        np.testing.assert_allclose(pose(cube), X_WB, atol=1e-15)


def test_bodies_weigh_what_the_library_says(stage: Usd.Stage, scene: Scene) -> None:
    for name in scene.instances:
        listed, body = scene.entry(name).mass_properties, prim(stage, name)
        mass = UsdPhysics.MassAPI(body)
        axes = Gf.Matrix3d(Gf.Quatd(mass.GetPrincipalAxesAttr().Get()))
        R = np.array(axes).T
        inertia = R @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ R.T
        assert mass.GetMassAttr().Get() == pytest.approx(listed.mass, rel=1e-6)
        np.testing.assert_allclose(
            mass.GetCenterOfMassAttr().Get(), listed.center_of_mass, atol=1e-7
        )
        np.testing.assert_allclose(inertia, inertia_matrix(listed.inertia), atol=1e-8)


def test_what_is_free_and_what_is_not(stage: Usd.Stage, scene: Scene) -> None:
    free = [p.GetPath().name for p in stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)]
    assert free == [LEGAL.get(name, name) for name in scene.instances]


def test_hulls_collide_with_the_friction_of_the_object(
    stage: Usd.Stage, scene: Scene, X_WO: dict[str, Array]
) -> None:
    for name in X_WO:
        entry = scene.entry(name)
        colliders = [p for p in Usd.PrimRange(prim(stage, name)) if p.HasAPI("PhysicsCollisionAPI")]
        if entry.contact.kind == "primitive":
            assert [p.GetTypeName() for p in colliders] == ["Cylinder"]
        else:
            assert len(colliders) == len(entry.pieces)
        for collider in colliders:
            if collider.IsA(UsdGeom.Mesh):
                approximation = UsdPhysics.MeshCollisionAPI(collider).GetApproximationAttr()
                assert approximation.Get() == "convexHull"
            material, _ = UsdShade.MaterialBindingAPI(collider).ComputeBoundMaterial("physics")
            friction = UsdPhysics.MaterialAPI(material).GetDynamicFrictionAttr().Get()
            assert friction == pytest.approx(entry.friction)


@pytest.mark.parametrize("purpose", [UsdGeom.Tokens.default_, UsdGeom.Tokens.guide])
def test_what_is_seen_and_what_collides_fill_the_bounding_box(
    stage: Usd.Stage, scene: Scene, purpose: str
) -> None:
    for name in ("mug", "box"):
        points = [
            np.array(UsdGeom.Mesh(p).GetPointsAttr().Get())
            for p in Usd.PrimRange(prim(stage, name))
            if p.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(p).ComputePurpose() == purpose
        ]
        found = np.concatenate(points)
        np.testing.assert_allclose(found.min(axis=0), scene.entry(name).lower, atol=1e-3)
        np.testing.assert_allclose(found.max(axis=0), scene.entry(name).upper, atol=1e-3)


def test_openusd_finds_nothing_wrong(stage: Usd.Stage) -> None:
    validation = pytest.importorskip("pxr.UsdValidation")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    errors = validation.ValidationContext(validators).Validate(stage)
    assert [e.GetMessage() for e in errors] == []
