"""Views: cameras stand where they are said to, and see something."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Pose,
    UnknownNameError,
    dump_document,
    parse_document,
)
from burg_drake.dataset import PlacedBox, View, ViewpointSettings, ViewSampler
from burg_drake.scene import load_scene
from burg_drake.station import Camera, Obstacle, Station, build_station_diagram, load_station

SCENE, STATION = load_scene("tabletop_six"), load_station("panda_tabletop")
X_WS = STATION.document.X_WS.matrix()


@cache
def centres() -> np.ndarray:
    """(N, 3) middles of the objects' meshes, by their own boxes, in S."""
    found = []
    for name, instance in SCENE.instances.items():
        middle = SCENE.library.surface(instance.object).bounds.mean(axis=0)
        found.append((SCENE.X_SO(name) @ [*middle, 1.0])[:3])
    return np.array(found)


def in_image(view: View) -> np.ndarray:
    """(N,) whether the objects' centres are in the image, by OpenCV."""
    X_CS = np.linalg.inv(view.X_SC)
    p_C = centres() @ X_CS[:3, :3].T + X_CS[:3, 3]
    of = view.intrinsics
    lens = np.array(of.distortion or (0.0,) * 4)
    pixel = cv2.projectPoints(p_C, np.zeros(3), np.zeros(3), of.K, lens)[0][:, 0]
    return (
        (p_C[:, 2] > 0)
        & (pixel >= -0.5).all(1)
        & (pixel < [of.width - 0.5, of.height - 0.5]).all(1)
    )


def draw(count: int, station: Station = STATION, **settings: object) -> list[View]:
    sampler = ViewSampler(SCENE, station, ViewpointSettings(**settings))
    rng = np.random.default_rng(0)
    return [sampler.sample(rng) for _ in range(count)]


def changed(**document: object) -> Station:
    return replace(STATION, document=replace(STATION.document, **document))


def test_the_sphere_is_where_it_is_asked_for() -> None:
    ranges = {"distance": (0.6, 0.9), "elevation_deg": (30.0, 60.0), "azimuth_deg": (10.0, 80.0)}
    views = draw(60, aim=0.0, roll_deg=(0.0, 0.0), **ranges)
    p_MC = np.array([v.X_SC[:3, 3] for v in views]) - centres().mean(axis=0)
    distance = np.linalg.norm(p_MC, axis=1)
    found = {
        "distance": distance,
        "elevation_deg": np.rad2deg(np.arcsin(p_MC[:, 2] / distance)),
        "azimuth_deg": np.rad2deg(np.arctan2(p_MC[:, 1], p_MC[:, 0])),
    }
    for name, (low, high) in ranges.items():
        assert low - 1e-6 <= found[name].min() < low + 0.15 * (high - low), name
        assert high + 1e-6 >= found[name].max() > high - 0.15 * (high - low), name
    R = np.array([v.X_SC[:3, :3] for v in views])
    np.testing.assert_allclose(R[:, :, 2], -p_MC / distance[:, None], atol=1e-9)  # looks there
    np.testing.assert_allclose(R[:, 2, 0], 0.0, atol=1e-12)  # level
    assert (R[:, 2, 1] < 0.0).all()  # the image's y points down


def test_roll_and_aim() -> None:
    views = draw(40, aim=0.1, roll_deg=(20.0, 30.0), elevation_deg=(40.0, 40.0))
    rolled = [np.arcsin(-v.X_SC[2, 0] / np.cos(np.deg2rad(40.0))) for v in views]
    assert (
        20.0 - 1e-6 <= np.rad2deg(np.abs(rolled)).min() < np.rad2deg(np.abs(rolled)).max() <= 30.1
    )
    to_middle = centres().mean(axis=0) - [v.X_SC[:3, 3] for v in views]
    along = np.array([v.X_SC[:3, 2] for v in views])
    beside = np.linalg.norm(np.cross(along, to_middle), axis=1)  # of the axis from the middle
    assert 0.05 < beside.max() <= 0.1


def test_the_station_s_camera_is_exactly_where_it_is() -> None:
    (view,) = draw(1, cameras=("overview",))
    camera = STATION.document.cameras["overview"]
    np.testing.assert_allclose(X_WS @ view.X_SC, camera.X_WC.matrix(), atol=1e-12)
    assert view.intrinsics.focal == camera.focal and view.depth_range == camera.depth_range


def test_jitter_stays_within_its_bounds() -> None:
    views = draw(50, cameras=("overview",), position_jitter=0.05, angle_jitter_deg=4.0)
    X_WC = STATION.document.cameras["overview"].X_WC.matrix()
    moved = [np.linalg.norm((X_WS @ v.X_SC)[:3, 3] - X_WC[:3, 3]) for v in views]
    turned = [cv2.Rodrigues(X_WC[:3, :3].T @ (X_WS @ v.X_SC)[:3, :3])[0] for v in views]
    angle = np.rad2deg(np.linalg.norm(turned, axis=1))
    assert 0.04 < max(moved) <= 0.05 and 3.0 < angle.max() <= 4.0


@pytest.mark.parametrize("name", ["panda_tabletop", "ur5e_tabletop"])
def test_the_arm_brings_the_wrist_s_camera_there(name: str) -> None:
    station = load_station(name)
    X_HC = Pose(translation=(0.06, 0.01, 0.02), rpy_deg=(5.0, -10.0, 90.0))
    views = draw(3, station, cameras=("wrist",), X_HC=X_HC, distance=(0.35, 0.6))
    built = build_station_diagram(SCENE, station, robot="arm")
    plant, context = built.plant, built.diagram.CreateDefaultContext()
    inside = plant.GetMyMutableContextFromRoot(context)
    hand = plant.GetBodyByName(station.hand.body)
    for view in views:
        assert view.posture is not None
        for joint, q in zip(built.arm_joints, view.posture, strict=True):
            joint.set_angle(inside, q)
        X_WC = plant.EvalBodyPoseInWorld(inside, hand).GetAsMatrix4() @ X_HC.matrix()
        X_SC = np.linalg.inv(station.document.X_WS.matrix()) @ X_WC
        np.testing.assert_allclose(X_SC, view.X_SC, atol=1e-7)
        query = built.diagram.GetOutputPort("geometry_query").Eval(context)
        frames = {plant.GetBodyFrameIdOrThrow(i) for i in built.robot_bodies}
        for pair in query.ComputePointPairPenetration():
            ids = [query.inspector().GetFrameId(g) for g in (pair.id_A, pair.id_B)]
            assert not frames.intersection(ids) or pair.depth < 1e-3, ids


def test_the_usual_place_on_the_wrist_looks_along_the_fingers() -> None:
    (view,) = draw(1, cameras=("wrist",), distance=(0.4, 0.5))
    built = build_station_diagram(SCENE, STATION, robot="arm", weld_objects=True)
    context = built.plant.CreateDefaultContext()
    for joint, q in zip(built.arm_joints, view.posture or (), strict=True):
        joint.set_angle(context, q)
    tips = [built.plant.GetBodyByName(f.body) for f in STATION.hand.fingers]
    X_WC = X_WS @ view.X_SC
    p_C = [np.linalg.inv(X_WC) @ [*b.EvalPoseInWorld(context).translation(), 1.0] for b in tips]
    assert abs(p_C[0][1] - p_C[1][1]) < 1e-6 < abs(p_C[0][0] - p_C[1][0])  # left and right
    assert all(0.04 < p[1] < 0.1 for p in p_C)  # below the axis


def test_every_view_sees_its_share_of_the_objects() -> None:
    narrow = Intrinsics(width=320, height=240, focal=(500.0, 500.0), center=(159.5, 119.5))
    settings = ViewpointSettings(aim=0.3, in_view=0.5)
    rng = np.random.default_rng(1)
    sampler = ViewSampler(SCENE, STATION, settings, intrinsics=narrow, depth_range=(0.1, 2.0))
    seen = [int(in_image(sampler.sample(rng)).sum()) for _ in range(40)]
    assert min(seen) == 3
    few = ViewSampler(SCENE, STATION, replace(settings, in_view=0.0), intrinsics=narrow)
    assert min(int(in_image(few.sample(rng)).sum()) for _ in range(60)) in (1, 2)


def test_nothing_solid_is_around_the_camera_or_before_all_objects() -> None:
    x, y, _ = (X_WS @ [*centres().mean(axis=0), 1.0])[:3]
    wall = Obstacle(X_WB=Pose(translation=(x, y + 0.45, 0.5)), size=(3.0, 0.3, 1.0))
    views = draw(60, changed(background={"wall": wall}), in_view=1.0, aim=0.0)
    p_W = np.array([(X_WS @ v.X_SC)[:3, 3] for v in views])
    behind = p_W[p_W[:, 1] > y + 0.6]
    assert len(behind) < len(views)
    for start in behind:  # only over the wall's edge, seen in steps along each line
        for p_SO in centres():
            line = np.linspace(start, (X_WS @ [*p_SO, 1.0])[:3], 400)
            within = np.abs(line - [x, y + 0.45, 0.5]) < [1.5, 0.15, 0.5]
            assert not within.all(axis=1).any()
    assert not (np.abs(p_W - [x, y + 0.45, 0.5]) < [1.5, 0.15, 0.5]).all(axis=1).any()


def test_cameras_on_the_sphere_see_past_what_is_besides() -> None:
    middle = centres().mean(axis=0)
    X_SB = np.eye(4)
    X_SB[:3, 3] = np.add(middle, (0.0, 0.45, 0.5))
    wall = PlacedBox("wall", X_SB, np.array([1.5, 0.15, 1.5]))
    near = ViewpointSettings(aim=0.0, cameras=("sphere", "overview"))
    plain, walled = (ViewSampler(SCENE, STATION, near, besides=b) for b in ((), (wall,)))
    turn = [np.random.default_rng(k) for k in range(40)]
    free = [plain.sample(rng, "sphere") for rng in turn]
    turn = [np.random.default_rng(k) for k in range(40)]
    kept = [walled.sample(rng, "sphere") for rng in turn]
    side = np.array([view.X_SC[1, 3] - middle[1] for view in free])
    assert (side > 0.3).any()
    for view, other, y in zip(free, kept, side, strict=True):
        assert other.X_SC[1, 3] - middle[1] < 0.3  # neither in the wall nor behind it
        if y < 0.3:  # as it is without the wall
            assert (view.X_SC == other.X_SC).all()
    X_SB[:3, 3] = (np.linalg.inv(X_WS) @ STATION.document.cameras["overview"].X_WC.matrix())[:3, 3]
    around = PlacedBox("post", X_SB, np.array([0.2, 0.2, 0.2]))
    still = ViewSampler(SCENE, STATION, near, besides=(around,))
    assert still.sample(np.random.default_rng(0), "overview").camera == "overview"


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"elevation_deg": (-60.0, -50.0), "distance": (0.5, 0.6)}, "200 show fewer than 1 of 6"),
        ({"distance": (0.1, 0.1), "elevation_deg": (-90.0, -90.0), "draws": 5}, "in 'table'"),
        ({"cameras": ("wrist",), "distance": (3.0, 4.0), "draws": 20}, "out of the arm's reach"),
    ],
)
def test_a_scene_outside_the_camera_s_view_is_an_error_that_says_why(
    settings: dict[str, object], reason: str
) -> None:
    with pytest.raises(InvalidInputError, match="no view of scene") as caught:
        draw(1, **settings)
    assert reason in str(caught.value) and SCENE.name in str(caught.value)


def test_a_station_s_camera_that_looks_away_or_is_inside_something() -> None:
    camera = STATION.document.cameras["overview"]
    away = Camera(X_WC=Pose.from_matrix(camera.X_WC.matrix() @ np.diag([1.0, -1.0, -1.0, 1.0])))
    with pytest.raises(InvalidInputError, match="'away', 1 show fewer than 1 of 6"):
        draw(1, changed(cameras={"away": away}), cameras=("away",))
    inside = Obstacle(X_WB=Pose(translation=camera.X_WC.translation), size=(0.1, 0.1, 0.1))
    with pytest.raises(InvalidInputError, match="1 have the camera in 'post'"):
        draw(1, changed(background={"post": inside}), cameras=("overview",))


def test_what_is_not_there() -> None:
    with pytest.raises(UnknownNameError, match="no camera 'bord'; did you mean 'board'"):
        draw(1, cameras=("bord",))
    with pytest.raises(InvalidInputError, match="give intrinsics"):
        draw(1, changed(cameras={}))
    with pytest.raises(InvalidInputError, match="needs an arm, but station 'panda_tabletop'"):
        draw(1, changed(arm=None), cameras=("wrist",))
    with pytest.raises(UnknownNameError, match="views cannot be from camera 'wrist'"):
        ViewSampler(SCENE, STATION).sample(np.random.default_rng(0), "wrist")


def test_the_same_generator_gives_the_same_views() -> None:
    names = ("sphere", "overview", "board")
    one, other = draw(12, cameras=names), draw(12, cameras=names)
    assert all(
        (a.X_SC == b.X_SC).all() and a.camera == b.camera for a, b in zip(one, other, strict=True)
    )
    assert {view.camera for view in one} == {*names}


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A document with settings in it."""

    version: int = 1
    views: ViewpointSettings


def test_settings_are_part_of_documents() -> None:
    X_HC = Pose(translation=(0.1, 0.0, 0.0))
    recipe = Recipe(views=ViewpointSettings(cameras=("wrist",), X_HC=X_HC, aim=0.2))
    assert parse_document(dump_document(recipe), Recipe, "r.yaml") == recipe
    for wrong in ("distance: [2, 1]", "in_view: 1.5", "cameras: []", "roll_deg: [0, 400]"):
        key = wrong.partition(":")[0]
        with pytest.raises(DocumentError, match=f"r.yaml:3: views: {key}"):
            parse_document(f"version: 1\nviews:\n  {wrong}\n", Recipe, "r.yaml")
