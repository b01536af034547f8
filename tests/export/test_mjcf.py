"""MJCF as MuJoCo reads it, and as Drake does."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from burg_drake.core import Array
from burg_drake.export import Exported
from burg_drake.scene import Scene
from burg_drake.station import Station
from tests.export.mass_matrix import inertia_matrix


@pytest.fixture(scope="module")
def model(exports: dict[str, Exported]) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(exports["mjcf"].main))


@pytest.fixture
def data(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def pose(data: mujoco.MjData, name: str) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
    return X


def test_everything_is_where_the_documents_put_it(
    data: mujoco.MjData, X_WO: dict[str, Array], station: Station
) -> None:
    for name, X in X_WO.items():
        np.testing.assert_allclose(pose(data, name), X, atol=1e-15, err_msg=name)
    for name, box in station.document.background.items():
        np.testing.assert_allclose(pose(data, name), box.X_WB.matrix(), atol=1e-15)


def test_bodies_weigh_what_the_library_says(model: mujoco.MjModel, scene: Scene) -> None:
    for name in scene.instances:
        listed, body = scene.entry(name).mass_properties, model.body(name)
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, body.iquat)
        R = axes.reshape(3, 3)
        assert body.mass == pytest.approx(listed.mass, rel=1e-12)
        np.testing.assert_allclose(body.ipos, listed.center_of_mass, atol=1e-12)
        np.testing.assert_allclose(
            R @ np.diag(body.inertia) @ R.T, inertia_matrix(listed.inertia), atol=1e-9
        )


def test_what_is_free_and_what_is_not(
    model: mujoco.MjModel, scene: Scene, station: Station
) -> None:
    assert model.njnt == len(scene.instances)
    assert {model.joint(i).name for i in range(model.njnt)} == set(scene.instances)
    for name in ("bowl", "table", *station.document.background):
        assert model.body(name).dofnum == 0


def test_pieces_collide_and_visuals_do_not(model: mujoco.MjModel, scene: Scene) -> None:
    for name in scene.instances:
        entry, body = scene.entry(name), model.body(name)
        geoms = [model.geom(i) for i in range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])]
        colliding = [g for g in geoms if g.contype[0]]
        expected = 1 if entry.contact.kind == "primitive" else len(entry.pieces)
        assert len(colliding) == expected
        assert {g.friction[0] for g in colliding} == {entry.friction}
        assert len(geoms) > expected
    assert model.geom(model.body("table").geomadr[0]).friction[0] == 0.5


@pytest.mark.parametrize("colliding", [False, True])
def test_geoms_fill_the_bounding_box_of_the_object(
    model: mujoco.MjModel, data: mujoco.MjData, scene: Scene, colliding: bool
) -> None:
    """Of the vertices that MuJoCo has compiled, where it has put them."""
    for name in ("mug", "box"):
        X_OW, points = np.linalg.inv(pose(data, name)), []
        for i in range(model.ngeom):
            geom = model.geom(i)
            if geom.bodyid[0] != model.body(name).id or bool(geom.contype[0]) != colliding:
                continue
            mesh = model.mesh(geom.dataid[0])
            start = mesh.vertadr[0]
            vertices = model.mesh_vert[start : start + mesh.vertnum[0]]
            placed = data.geom(i).xpos + vertices @ data.geom(i).xmat.reshape(3, 3).T
            points.append(placed @ X_OW[:3, :3].T + X_OW[:3, 3])
        points = np.concatenate(points)
        entry = scene.entry(name)
        np.testing.assert_allclose(points.min(axis=0), entry.lower, atol=1e-3)
        np.testing.assert_allclose(points.max(axis=0), entry.upper, atol=1e-3)


def test_objects_stay(
    model: mujoco.MjModel, data: mujoco.MjData, scene: Scene, X_WO: dict[str, Array]
) -> None:
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    for name in scene.instances:
        moved = pose(data, name) - X_WO[name]
        assert np.abs(moved[:3, 3]).max() < 1e-3, name
        assert np.abs(moved[:3, :3]).max() < 5e-3, name


def test_drake_reads_it_too(
    exports: dict[str, Exported], scene: Scene, X_WO: dict[str, Array]
) -> None:
    plant = MultibodyPlant(0.002)
    Parser(plant).AddModels(str(exports["mjcf"].main))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for name, X in X_WO.items():
        body = plant.GetBodyByName(name)
        np.testing.assert_allclose(
            plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4(), X, atol=1e-15
        )
        if name in scene.instances:
            assert body.default_mass() == pytest.approx(scene.entry(name).mass)
