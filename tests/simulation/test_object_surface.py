"""Hand and objects meet in MuJoCo where the object's surface is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from trial_world import make_station

from burg_drake.core import Array, Pose
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument
from burg_drake.simulation import MujocoTrial

mujoco = pytest.importorskip("mujoco")

HALF_AXES = np.array((0.03, 0.045, 0.025))
"""Of the ellipsoid [m], whose centre is the origin of the objects."""


@pytest.fixture(scope="module")
def scene(measured_once: None, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """An ellipsoid in two coarse pieces, whose surface or whose pieces the pads touch."""
    fine, coarse = (trimesh.creation.icosphere(subdivisions=k) for k in (5, 2))
    for mesh in (fine, coarse):
        mesh.apply_scale(HALF_AXES)
    halves = tuple(
        trimesh.PointCloud(coarse.vertices[side * coarse.vertices[:, 0] >= -1e-9]).convex_hull
        for side in (1.0, -1.0)
    )
    sources = [
        ObjectSource(name=kind, mesh=fine, pieces=halves, contact=kind, mass=0.1)
        for kind in ("surface", "pieces")
    ]
    out = tmp_path_factory.mktemp("library")
    assert not build_library(sources, out, confirm=False).failed
    height = float(HALF_AXES[2])
    placed = tuple(
        Instance(object=name, X_SO=Pose((x, 0.2, height)))
        for name, x in (("surface", 0.2), ("pieces", 0.4))
    )
    document = SceneDocument(
        name="two", library=str(out), board=Board(size=(0.6, 0.4)), instances=placed
    )
    return Scene(document, load_library(out), Path("two"))


def directions() -> Array:
    """(400, 3) unit vectors, the first 100 close to the seam of the pieces."""
    u = np.random.default_rng(0).normal(size=(400, 3))
    u[:100, 0] *= 0.02
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def measure_errors(model: mujoco.MjModel, name: str) -> Array:
    """(400,) distances of an object's geoms beyond the ellipsoid, along rays to its centre [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = model.body(f"object {name}").id
    groups = np.array((0, 0, 0, 0, 0, 1), dtype=np.uint8)
    shown = model.geom_group.copy()
    model.geom_group[:] = np.where(model.geom_bodyid == body, 5, 0)
    start, far, hit = data.xpos[body], 0.1, np.zeros(1, dtype=np.int32)
    rays = directions()
    radii = [
        far - mujoco.mj_ray(model, data, start + far * u, -u, groups, 1, -1, hit) for u in rays
    ]
    model.geom_group[:] = shown
    return np.array(radii) - 1.0 / np.linalg.norm(rays / HALF_AXES, axis=1)


def test_geoms_follow_the_surface_also_at_seams(scene: Scene) -> None:
    model = MujocoTrial(scene, make_station()).world.model
    np.testing.assert_allclose(measure_errors(model, "surface"), 0.0, atol=2e-4)


def test_objects_touched_as_pieces_keep_them(scene: Scene) -> None:
    model = MujocoTrial(scene, make_station()).world.model
    errors = measure_errors(model, "pieces")
    assert errors.min() < -1e-3 and errors.max() < 1e-5
