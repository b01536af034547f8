"""Baseline planners on depth images that the tests compute from rays, without a renderer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from burg_drake.benchmark import (
    Observation,
    antipodal,
    observation_id,
    oracle,
    random_grasps,
    top_down,
)
from burg_drake.scene import load_scene
from burg_drake.station import load_station
from tests.thorough import thorough

Array = NDArray[np.float64]
Plan = Callable[[Observation], dict[str, Any]]
PLANS: tuple[Plan, ...] = (antipodal, top_down, random_grasps)

SIZE = (240, 320)
K = np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]])
BOUNDS = np.array([[0.0, 0.0, 0.0], [0.5, 0.4, 0.4]])
TIP = 0.0095
HAND = {"name": "hand", "opening": [0.0, 0.08], "tip": TIP, "X_HG": np.eye(4).tolist()}
BOX_MIDDLE, BOX_SIZE, BOX_TURN = np.array([0.16, 0.2, 0.03]), np.array([0.12, 0.04, 0.06]), 0.5
CYLINDER_MIDDLE, CYLINDER_RADIUS, CYLINDER_HEIGHT = np.array([0.34, 0.22]), 0.025, 0.1


def camera_pose(elevation: float = 60.0, distance: float = 0.7) -> Array:
    """`X_SC` (4, 4) of a camera in front of the board that looks at its middle."""
    e = np.deg2rad(elevation)
    z = np.array([0.0, np.cos(e), -np.sin(e)])
    x = np.array([1.0, 0.0, 0.0])
    X_SC = np.eye(4)
    X_SC[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    X_SC[:3, 3] = np.array([0.25, 0.2, 0.03]) - distance * z
    return X_SC


def cast_box(origin: Array, rays: Array) -> Array:
    """Distance (...) along rays (..., 3) to the box, by the slab method; inf for a miss."""
    c, s = np.cos(BOX_TURN), np.sin(BOX_TURN)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    o, d = (origin - BOX_MIDDLE) @ R, rays @ R
    with np.errstate(divide="ignore"):
        ends = np.stack([(side * BOX_SIZE / 2 - o) / d for side in (-1.0, 1.0)])
    near, far = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    return np.where(near < far, near, np.inf)


def cast_cylinder(origin: Array, rays: Array) -> Array:
    """Distance (...) along rays (..., 3) to the upright cylinder; inf for a miss."""
    o, d = origin[:2] - CYLINDER_MIDDLE, rays[..., :2]
    a, b = (d**2).sum(-1), (o * d).sum(-1)
    root = b**2 - a * (o @ o - CYLINDER_RADIUS**2)
    side = np.where(root > 0.0, (-b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
    height = origin[2] + np.where(np.isfinite(side), side, 0.0) * rays[..., 2]
    side = np.where((height > 0.0) & (height < CYLINDER_HEIGHT), side, np.inf)
    lid = (CYLINDER_HEIGHT - origin[2]) / rays[..., 2]
    on_lid = np.linalg.norm(o + lid[..., None] * d, axis=-1) < CYLINDER_RADIUS
    return np.minimum(side, np.where(on_lid, lid, np.inf))


def observe(
    *shapes: Any, X_WS: Array | None = None, target: int | None = None, noise: float = 0.0
) -> Observation:
    """Depth image of shapes on a table: functions that return distances along rays."""
    X_SC = camera_pose()
    row, column = np.mgrid[: SIZE[0], : SIZE[1]]
    pixels = np.stack([column, row, np.ones(SIZE)], axis=-1)
    rays = pixels @ np.linalg.inv(K).T @ X_SC[:3, :3].T  # of depth 1
    origin = X_SC[:3, 3]
    depths = np.stack([-origin[2] / rays[..., 2], *(shape(origin, rays) for shape in shapes)])
    depth = depths.min(axis=0)
    if noise:
        depth = depth + np.random.default_rng(1).normal(scale=noise, size=SIZE)
    X_WS = np.eye(4) if X_WS is None else X_WS
    parts = {
        "color": None,
        "depth": depth.astype(np.float32),
        "K": K,
        "X_WC": X_WS @ X_SC,
        "X_WS": X_WS,
        "bounds": BOUNDS,
        "hand": HAND,
        "segmentation": depths.argmin(axis=0).astype(np.uint16),
    }
    return Observation(id=observation_id(**parts), target=target, **parts)


def in_scene(observation: Observation, answer: dict[str, Any]) -> Array:
    """(N, 4, 4) `X_SG` of an answer."""
    return np.linalg.inv(observation.X_CS) @ answer["X_CG"]


def tips(X_SG: Array, opening: float = 0.08) -> Array:
    """(N, 2, 3) middle of the inner edges of both open fingers."""
    ends = np.array([[side * opening / 2, 0.0, TIP, 1.0] for side in (-1.0, 1.0)])
    return np.einsum("nij,kj->nki", X_SG, ends)[..., :3]


def box_short_side() -> Array:
    """(3,) direction across the box."""
    return np.array([-np.sin(BOX_TURN), np.cos(BOX_TURN), 0.0])


@pytest.fixture(scope="module")
def both() -> Observation:
    """A box as object 1 and a cylinder as object 2, with noise of 1 mm."""
    return observe(cast_box, cast_cylinder, noise=0.001)


@pytest.fixture(scope="module")
def answers(both: Observation) -> dict[Plan, dict[str, Any]]:
    """Answers of all planners to `both`."""
    return {plan: plan(both) for plan in PLANS}


def distances(X_SG: Array) -> tuple[Array, Array]:
    """(N,) horizontal distances of grasps from the middles of box and cylinder [m]."""
    p = X_SG[:, :2, 3]
    box = np.linalg.norm(p - BOX_MIDDLE[:2], axis=1)
    return box, np.linalg.norm(p - CYLINDER_MIDDLE, axis=1)


def test_antipodal_closes_across_the_short_side_of_a_box() -> None:
    observation = observe(cast_box, noise=0.001)
    answer = antipodal(observation)
    X_SG = in_scene(observation, answer)[:3]
    assert (np.abs(X_SG[:, :3, 0] @ box_short_side()) > np.cos(np.deg2rad(12.0))).all()
    assert answer["width"][:3] == pytest.approx(0.04, abs=0.008)
    across = (X_SG[:, :3, 3] - BOX_MIDDLE) @ box_short_side()
    steep = X_SG[:, 2, 2] < -0.99
    assert steep.any()
    assert np.abs(across[steep]).max() < 0.006


def test_antipodal_closes_on_the_diameter_of_a_cylinder() -> None:
    observation = observe(cast_cylinder, noise=0.001)
    answer = antipodal(observation)
    X_SG = in_scene(observation, answer)[:3]
    assert answer["width"][:3] == pytest.approx(2 * CYLINDER_RADIUS, abs=0.008)
    assert np.linalg.norm(X_SG[0, :2, 3] - CYLINDER_MIDDLE) < 0.012
    # The finger tips are below the top, and above the table.
    assert (tips(X_SG)[..., 2].mean(axis=1) < CYLINDER_HEIGHT - 0.01).all()


def test_open_fingers_are_clear_of_table_and_objects(
    both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    answer = answers[antipodal]
    X_SG = in_scene(both, answer)
    assert 10 <= len(X_SG) <= 50
    corners = np.array(
        [
            [side * (0.04 + out), y, TIP, 1.0]
            for side in (-1, 1)
            for out in (0.0, 0.015)
            for y in (-0.01, 0.01)
        ]
    )
    p_SP = np.einsum("nij,kj->nki", X_SG, corners)[..., :3]
    assert (p_SP[..., 2] > 0.0).all()
    c, s = np.cos(BOX_TURN), np.sin(BOX_TURN)
    q = (p_SP - BOX_MIDDLE) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert not (np.abs(q) < BOX_SIZE / 2).all(axis=-1).any()
    near = np.linalg.norm(p_SP[..., :2] - CYLINDER_MIDDLE, axis=-1) < CYLINDER_RADIUS
    assert not (near & (p_SP[..., 2] < CYLINDER_HEIGHT)).any()


@pytest.mark.parametrize("plan", PLANS)
def test_answers_are_poses_best_first_that_approach_the_scene(
    plan: Plan, both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    answer = answers[plan]
    X_CG, n = answer["X_CG"], len(answer["score"])
    assert X_CG.shape == (n, 4, 4)
    assert answer["width"].shape == (n,)
    R = X_CG[:, :3, :3]
    np.testing.assert_allclose(
        R.transpose(0, 2, 1) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    assert (np.diff(answer["score"]) <= 0.0).all()
    assert (X_CG[:, 2, 2] > 0.0).all()  # away from the camera
    assert (in_scene(both, answer)[:, 2, 2] < -0.49).all()  # within 60 degrees of straight down


@pytest.mark.parametrize("plan", PLANS)
def test_equal_observations_get_equal_answers(
    plan: Plan, both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    first, second = answers[plan], plan(replace(both))
    for name in ("X_CG", "width", "score"):
        np.testing.assert_array_equal(first[name], second[name])


def test_random_grasps_follow_the_id_of_the_observation(
    both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    other = random_grasps(replace(both, id="f" * 64))
    assert not np.allclose(answers[random_grasps]["X_CG"], other["X_CG"])


@pytest.mark.parametrize("plan", PLANS)
def test_a_move_of_the_whole_world_changes_nothing_for_the_camera(
    plan: Plan, both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    X = np.eye(4)
    X[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    X[:3, 3] = [1.0, -2.0, 0.5]
    moved = replace(both, X_WC=X @ both.X_WC, X_WS=X @ both.X_WS)
    np.testing.assert_allclose(plan(moved)["X_CG"], answers[plan]["X_CG"], atol=1e-6)


@pytest.mark.parametrize(
    ("target", "plan"),
    [(1, antipodal), thorough(2, antipodal)]
    + [(target, plan) for target in (1, 2) for plan in PLANS[1:]],
)
def test_grasps_are_on_the_target(plan: Plan, target: int, both: Observation) -> None:
    observation = replace(both, target=target)
    box, cylinder = distances(in_scene(observation, plan(observation)))
    assert len(box) > 0
    assert ((box < cylinder) == (target == 1)).all()


@pytest.mark.parametrize("plan", PLANS)
def test_an_empty_table_gives_no_grasps(plan: Plan) -> None:
    assert plan(observe(noise=0.001))["X_CG"].shape == (0, 4, 4)


@pytest.mark.parametrize("plan", PLANS)
def test_an_image_without_depth_gives_no_grasps(plan: Plan, both: Observation) -> None:
    empty = replace(both, depth=np.zeros(SIZE, np.float32))
    assert plan(empty)["X_CG"].shape == (0, 4, 4)


def test_top_down_holds_each_object_across_its_short_axis(
    both: Observation, answers: dict[Plan, dict[str, Any]]
) -> None:
    answer = answers[top_down]
    X_SG = in_scene(both, answer)
    np.testing.assert_allclose(X_SG[:, :3, 2], np.tile([0.0, 0.0, -1.0], (2, 1)), atol=1e-9)
    box, cylinder = distances(X_SG)
    on_box = int(box.argmin())
    assert abs(X_SG[on_box, :3, 0] @ box_short_side()) > np.cos(np.deg2rad(8.0))
    assert answer["width"][on_box] == pytest.approx(0.04, abs=0.008)
    assert answer["width"][1 - on_box] == pytest.approx(2 * CYLINDER_RADIUS, abs=0.008)
    assert max(box.min(), cylinder.min()) < 0.015


def test_a_wall_beside_the_box_keeps_the_fingers_away() -> None:
    def cast_wall(origin: Array, rays: Array) -> Array:
        """Distance (...) to a wall of 15 cm along y, which leaves no room for the whole palm."""
        o, d = origin - np.array([0.05, 0.2, 0.075]), rays
        with np.errstate(divide="ignore"):
            ends = np.stack([(s * np.array([0.02, 0.6, 0.15]) / 2 - o) / d for s in (-1.0, 1.0)])
        near, far = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        return np.where(near < far, near, np.inf)

    observation = observe(cast_box, cast_wall)
    answer = antipodal(replace(observation, target=1))
    X_SG = in_scene(observation, answer)
    assert len(X_SG)
    palm = np.array([[x, y, TIP - 0.05, 1.0] for x in (-0.1, 0.1) for y in (-0.02, 0.02)])
    p_SP = np.einsum("nij,kj->nki", X_SG, palm)[..., :3]
    inside = (np.abs(p_SP[..., 0] - 0.05) < 0.01) & (p_SP[..., 2] < 0.15)
    assert not inside.any()


def test_oracle_holds_its_target_on_opposite_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all grasps that it answers with, a few were tried."""
    monkeypatch.setattr("burg_drake.benchmark.oracle_planner.WANTED_GRASPS", 3)
    station, scene = load_station("panda_tabletop"), load_scene("tabletop_six")
    target = list(scene.instances).index("screwdriver") + 1
    observation = replace(observe(), target=target)  # the oracle does not look at the image
    answer = oracle(observation, scene, station)
    X_SG = in_scene(observation, answer)
    assert 2 <= len(X_SG) <= 50
    assert (np.diff(answer["score"]) <= 0.0).all()
    X_OG = np.linalg.inv(scene.X_SO("screwdriver")) @ X_SG
    mesh = scene.library.surface(scene.instance("screwdriver").object)
    length, cosine = sides(mesh, X_OG, np.array([0.0, 0.45, 0.9]) * 0.0095)
    near = np.abs(length - answer["width"][:, None]) <= 1e-3
    assert (near & (cosine > np.cos(np.deg2rad(45.0)))).any(axis=1).all()


def sides(mesh: trimesh.Trimesh, X: Array, ahead: Array) -> tuple[Array, Array]:
    """Distances (N, M) of the mesh's sides on lines between two fingers, and the smaller cosines of
    their normals with them; 0 and -1 where a line meets nothing.

    Args:
        mesh: an object.
        X: (N, 4, 4) grasps on it.
        ahead: (M,) distances of the lines from a grasp's origin along its approach [m].
    """
    across = np.repeat(X[:, :3, 0], len(ahead), axis=0)
    middles = (X[:, None, :3, 3] + ahead[:, None] * X[:, None, :3, 2]).reshape(-1, 3)
    ends, cosines = np.full((2, *middles.shape), np.inf), np.full((2, len(middles)), -1.0)
    for k, side in enumerate((-1.0, 1.0)):  # from each finger inwards
        origins = middles + side * 0.06 * across
        hits, rays, faces = mesh.ray.intersects_location(origins, -side * across)
        away = np.linalg.norm(hits - origins[rays], axis=1)
        nearest = np.argsort(-away, kind="stable")  # the last one that is written is the nearest
        ends[k, rays[nearest]] = hits[nearest]
        normals = side * mesh.face_normals[faces[nearest]]
        cosines[k, rays[nearest]] = (normals * across[rays[nearest]]).sum(axis=1)
    missed = ~np.isfinite(ends).all(axis=(0, 2))
    ends[:, missed] = 0.0
    shape = (len(X), len(ahead))
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    return length.reshape(shape), np.where(missed, -1.0, cosines.min(axis=0)).reshape(shape)
