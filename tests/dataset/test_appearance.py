"""Looks of scenes: drawn from a seed, written as plain data, and seen in Drake's images."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations, product

import cv2
import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.core import DocumentError, InvalidInputError, Pose, UnknownNameError
from burg_drake.dataset import (
    Appearance,
    AppearanceSettings,
    Distractor,
    Photometry,
    TableSurface,
    apply_photometry,
    distractor_boxes,
    draw_appearance,
    environment_file,
    environment_map,
    fill_background,
    read_appearance,
    render_parameters,
    table_texture,
)
from burg_drake.objects import load_library
from burg_drake.scene import load_scene
from burg_drake.station import Obstacle, load_station

CLUTTER = load_library("clutter")
SCENE, STATION = load_scene("tabletop_six"), load_station("panda_tabletop")
NOTHING = AppearanceSettings(
    lights=None,
    room=0.0,
    table=(),
    board=1.0,
    exposure=None,
    white_balance=0.0,
    gamma=None,
    blur=None,
    electrons=None,
    color_gain=0.0,
    distractors=(0, 0),
)


def drawn(seed: int, **settings: object) -> Appearance:
    rng = np.random.default_rng(seed)
    return draw_appearance(AppearanceSettings(**settings), SCENE, STATION, rng)


def linear(srgb: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    value = srgb / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def grey(value: int, size: int = 200) -> np.ndarray:
    return np.full((size, size, 3), value, np.uint8)


def made(image: np.ndarray, labels: np.ndarray | None = None, **settings: object) -> np.ndarray:
    gains = settings.pop("object_gains", ())
    look = Appearance(photometry=Photometry(**settings), object_gains=gains)
    return apply_photometry(image, labels, look, np.random.default_rng(0))


# --- drawing --------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_look_and_it_is_plain_data() -> None:
    for seed in range(20):
        look = drawn(seed)
        assert look == drawn(seed)
        assert read_appearance(json.loads(json.dumps(look.plain()))) == look
    assert len({drawn(seed).table for seed in range(20)}) == 20


def test_all_can_be_switched_off() -> None:
    look = draw_appearance(NOTHING, SCENE, STATION, np.random.default_rng(0))
    assert look == Appearance(library="clutter")


def test_settings_that_contradict_themselves_and_data_that_do_not_fit() -> None:
    with pytest.raises(InvalidInputError, match="exposure is 1 to 0; it must rise"):
        AppearanceSettings(exposure=(1.0, 0.0))
    with pytest.raises(InvalidInputError, match="shadows is 2; it must be 0 to 1"):
        AppearanceSettings(shadows=2.0)
    with pytest.raises(DocumentError, match="look: photometry: unknown key 'blurr'"):
        read_appearance({"version": 1, "photometry": {"blurr": 1.0}}, "look")
    light = {"direction": [0, 0, -1], "irradiance": 1.0}
    for wrong, said in (
        ({"photometry": {"blur": 1e9}}, "photometry: blur is 1e.09; it must be 0 to 100"),
        ({"photometry": {"exposure": 1e29}}, "exposure is 1e.29; it must be -20 to 20"),
        ({"photometry": {"gamma": 0.0}}, "gamma is 0; it must be 0.05 to 20"),
        ({"photometry": {"white_balance": [1, -1, 1]}}, "white_balance .* must be from 0 to 10000"),
        ({"room": -1}, "room is -1; give a seed from 0 to"),
        ({"table": {"pattern": "wood", "seed": -1}}, "seed is -1; give a seed from 0 to"),
        ({"lights": [light | {"irradiance": -1}]}, "irradiance is -1; it must be 0 to 10000"),
        ({"lights": [light | {"color": [1, 1, -1]}]}, "color .* must be from 0 to 10000"),
        ({"object_gains": [[1, 1, 1e9]]}, "object_gains .* must be from 0 to 10000"),
    ):
        with pytest.raises(DocumentError, match=f"look: .*{said}"):
            read_appearance({"version": 1, **wrong}, "look")
    for k in range(3):
        gains = np.where(np.arange(3) == k, np.nan, 1.0).tolist()
        with pytest.raises(InvalidInputError, match=r"object_gains .*0 to 10000"):
            Appearance(object_gains=(tuple(gains),))
    with pytest.raises(UnknownNameError, match="houshold"):
        drawn(0, distractors=(1, 1), distractor_library="houshold")


def test_lights_give_the_table_what_a_white_sheet_needs() -> None:
    for seed in range(40):
        look = drawn(seed, temperature=None)
        by_lights = sum(
            -light.direction[2] / np.linalg.norm(light.direction) * light.irradiance
            for light in look.lights
            if light.frame == "world"
        )
        assert 0.4 < by_lights + look.room_light <= 1.0 + 1e-9


def test_distractors_stand_on_the_table_clear_of_all() -> None:
    box = Obstacle(X_WB=Pose(translation=(0.3, 0.55, 0.1)), size=(0.5, 0.1, 0.2))
    station = replace(STATION, document=replace(STATION.document, background={"wall": box}))
    X_SW = np.linalg.inv(station.document.X_WS.matrix())

    def seen_from_above(corners: np.ndarray) -> np.ndarray:
        return cv2.convexHull(corners[:, :2].astype(np.float32))

    unit = np.array(list(product((-0.5, 0.5), repeat=3)))
    wall = (unit * box.size + box.X_WB.translation) @ X_SW[:3, :3].T + X_SW[:3, 3]
    board = np.array(list(product((0.0, SCENE.board.size[0]), (0.0, SCENE.board.size[1]))))
    taken = [seen_from_above(wall), seen_from_above(board)]
    count = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        settings = AppearanceSettings(distractors=(6, 6))
        hulls = list(taken)
        for one in draw_appearance(settings, SCENE, station, rng).distractors:
            X_SO = one.X_SO.matrix()
            p = CLUTTER.surface(one.object).vertices @ X_SO[:3, :3].T + X_SO[:3, 3]
            assert abs(p[:, 2].min()) < 2e-3
            p_W = np.linalg.inv(X_SW)[:3, :3] @ p.T + np.linalg.inv(X_SW)[:3, 3:]
            inside = np.abs(p_W[:2].T - station.document.table.center)
            assert (inside <= np.array(station.document.table.size[:2]) / 2).all()
            assert np.linalg.norm(p_W[:2], axis=0).min() > 0.15  # the arm's base
            hulls.append(seen_from_above(p))
            count += 1
        for a, b in combinations(hulls, 2):
            assert a is taken[0] or cv2.intersectConvexConvex(a, b)[0] == 0.0
    assert count > 30


def test_boxes_of_distractors_hold_them_and_no_more() -> None:
    settings = AppearanceSettings(distractors=(6, 6))
    look = draw_appearance(settings, SCENE, STATION, np.random.default_rng(1))
    boxes = distractor_boxes(look)
    assert len(boxes) == len(look.distractors) > 2
    for one, box in zip(look.distractors, boxes, strict=True):
        X_BO = np.linalg.inv(box.X_SB) @ one.X_SO.matrix()
        p_BO = CLUTTER.surface(one.object).vertices @ X_BO[:3, :3].T + X_BO[:3, 3]
        np.testing.assert_allclose(np.abs(p_BO).max(axis=0), box.half, atol=2e-3)


def test_distractors_may_stand_on_the_board_if_they_are_allowed_to() -> None:
    scene = replace(SCENE, document=replace(SCENE.document, instances=SCENE.document.instances[:1]))
    (w, h), (name,) = scene.board.size, scene.instances
    settings, found = AppearanceSettings(distractors=(8, 8), distractors_on_board=True), 0
    for seed in range(8):
        look = draw_appearance(settings, scene, STATION, np.random.default_rng(seed))
        for x, y, _ in (one.X_SO.translation for one in look.distractors):
            found += 0.0 < x < w and 0.0 < y < h
            assert np.hypot(*(scene.X_SO(name)[:2, 3] - (x, y))) > 0.05
    assert found


# --- textures and rooms ---------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", ["wood", "cloth", "stone", "plain"])
def test_textures_have_no_seams(pattern: str) -> None:
    look = Appearance(table=TableSurface(pattern=pattern, seed=7))
    png = table_texture(look)
    assert png == table_texture(look)
    assert png != table_texture(Appearance(table=TableSurface(pattern=pattern, seed=8)))
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(float)
    assert image.shape == (512, 512, 3) and 20.0 < image.mean() < 245.0
    for axis in (0, 1):
        steps = np.abs(np.diff(image, axis=axis)).mean(axis=(1 - axis, 2))
        seam = np.abs(image.take(0, axis) - image.take(-1, axis)).mean()
        assert seam <= 1.2 * steps.max() + 0.5


def test_rooms_have_a_floor_a_ceiling_and_no_seam() -> None:
    for seed in range(3):
        room = environment_map(seed).astype(float)
        assert room.shape == (512, 1024, 3)
        assert room[:40].mean() > room[-40:].mean() + 30.0
        steps = np.abs(np.diff(room, axis=1)).mean(axis=(0, 2))
        assert np.abs(room[:, 0] - room[:, -1]).mean() <= steps.max()
    assert (environment_map(0) != environment_map(1)).any()


def test_the_room_gives_the_table_its_light() -> None:
    path = environment_file(Appearance(room=3, room_light=0.6))
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    rows, columns = image.shape[:2]
    rng = np.random.default_rng(0)  # directions by the cosine of their angle from the vertical
    polar, azimuth = np.arcsin(np.sqrt(rng.random(200_000))), rng.uniform(0.0, 1.0, 200_000)
    seen = image[(polar / np.pi * rows).astype(int), (azimuth * columns).astype(int)]
    assert seen.mean() == pytest.approx(0.6, rel=0.03)
    assert path == environment_file(Appearance(room=3, room_light=0.6))
    with pytest.raises(InvalidInputError, match="no room"):
        environment_file(Appearance())
    with pytest.raises(InvalidInputError, match="there is no room"):
        Appearance(room_light=0.5)


LENS = Intrinsics(width=64, height=48, focal=(60.0, 60.0), center=(31.5, 23.5))
LEVEL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""A camera that looks along x of the world, its image level."""


def level_camera(heading: float) -> np.ndarray:
    X_WC = np.eye(4)
    c, s = np.cos(heading), np.sin(heading)
    X_WC[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ LEVEL
    return X_WC


def test_the_room_is_seen_where_it_is() -> None:
    room = environment_map(5).astype(float)
    empty = np.tile(np.array([255, 0, 254], np.uint8), (48, 64, 1))
    for quarter, column in enumerate((512, 256, 0, 768)):  # +x, +y, -x, -y
        seen = fill_background(empty, level_camera(quarter * np.pi / 2), LENS, Appearance(room=5))
        around = room.take(range(column - 1, column + 1), axis=1, mode="wrap")[255:257]
        np.testing.assert_allclose(seen[23:25, 31:33].mean((0, 1)), around.mean((0, 1)), atol=2.0)
    assert (fill_background(empty, np.eye(4), LENS, Appearance()) == 150).all()


def test_edges_show_the_room_behind_them_and_nothing_else_changes() -> None:
    inside, key, behind = np.array([40.0, 120.0, 60.0]), np.array([255.0, 0.0, 254.0]), 150.0
    image = np.tile(inside.astype(np.uint8), (48, 64, 1))
    image[:, 32:] = key
    image[:, 31] = np.round(0.7 * inside + 0.3 * key)
    seen = fill_background(image, np.eye(4), LENS, Appearance()).astype(float)
    np.testing.assert_allclose(seen[:, 31], np.tile(0.7 * inside + 0.3 * behind, (48, 1)), atol=2.0)
    assert (seen[:, :31] == inside).all() and (seen[:, 32:] == behind).all()
    solid = grey(90, 48)
    assert fill_background(solid, np.eye(4), LENS, Appearance(room=1)) is solid


# --- photometry -----------------------------------------------------------------------------------


def test_an_image_to_which_nothing_is_done_stays_as_it_is() -> None:
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    assert (made(image) == image).all()


def test_exposure_and_white_balance_multiply_the_light() -> None:
    after = made(grey(90), exposure=1.0, white_balance=(1.2, 1.0, 0.5))[0, 0]
    np.testing.assert_allclose(linear(after) / linear(np.array(90)), [2.4, 2.0, 1.0], rtol=0.02)
    assert (made(grey(200), exposure=3.0) == 255).all()


def test_noise_grows_with_the_root_of_the_light() -> None:
    for value in (60, 128, 220):
        light = linear(made(grey(value), electrons=5000.0).astype(float))
        wanted = np.sqrt(linear(np.array(value)) / 5000.0)
        assert light.std() == pytest.approx(wanted, rel=0.05)
        assert light.mean() == pytest.approx(linear(np.array(value)), rel=0.01)
    assert (made(grey(128), electrons=5000.0) == made(grey(128), electrons=5000.0)).all()


def test_blur_adds_up_light_and_keeps_its_sum() -> None:
    image = grey(0, 41)
    image[20, 20] = 255
    light = linear(made(image, blur=1.0).astype(float))
    assert light.sum() == pytest.approx(3.0, rel=0.05)
    assert light[20, 20, 0] == pytest.approx(1.0 / (2.0 * np.pi), rel=0.1)


def test_gains_change_the_object_that_they_are_of() -> None:
    labels = np.zeros((200, 200), np.uint16)
    labels[:100], labels[100:150] = 2, 1
    after = made(grey(100), labels, object_gains=((1.0, 1.0, 1.0), (1.5, 1.0, 0.5)))
    assert (after[100:] == 100).all()
    np.testing.assert_allclose(
        linear(after[0, 0]) / linear(np.array(100)), [1.5, 1, 0.5], rtol=0.02
    )
    with pytest.raises(InvalidInputError, match="need the label image, with 200 x 200"):
        made(grey(100), object_gains=((1.0, 1.0, 1.0),))
    with pytest.raises(InvalidInputError, match="label 2 has no gain"):
        made(grey(100), labels, object_gains=((1.0, 1.0, 1.0),))


def test_lights_of_the_renderer() -> None:
    look = drawn(1, shadows=1.0, lights=(3, 3), room_light=0.0)
    parameters = render_parameters(look)
    assert parameters.cast_shadows and parameters.environment_map is None
    kinds = [light.type for light in parameters.lights]
    assert kinds == ["directional", "point", "point", "point"]  # one of them casts shadows
    assert parameters.lights[0].intensity >= look.lights[0].irradiance * np.pi * 0.99
    plain = render_parameters(Appearance(distractors=(Distractor(object="mug", X_SO=Pose()),)))
    assert not plain.cast_shadows and not plain.force_to_pbr
