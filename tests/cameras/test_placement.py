"""The placement check on rendered photos, whose truth is known."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from burg_drake.cameras import BoardEstimate, check_placement, target_shapes
from burg_drake.core import Array, InvalidInputError, dump_document
from burg_drake.scene import Scene, load_scene
from burg_drake.system_libraries import missing_render_libraries
from tests.cameras.placement_photo import Photo, ScenePhotographer
from tests.cameras.placement_views import INTRINSICS, X_SC, looking
from tests.thorough import thorough

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)
TRUTH = {
    "mug": (0.012, -0.008, 15.0),
    "bowl": (-0.015, 0.0, 0.0),
}
"""Displacements [m, deg]; the banana is missing."""


@functools.cache
def scene_of(*names: str) -> Scene:
    whole = load_scene("tabletop_six")
    kept = tuple(i for i in whole.document.instances if i.object in names)
    return Scene(replace(whole.document, instances=kept), whole.library, whole.path)


@functools.cache
def photographer(scene: Scene) -> ScenePhotographer:
    return ScenePhotographer(scene)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of(*TRUTH, "banana")


@pytest.fixture(scope="module")
def photo(scene: Scene) -> Photo:
    shapes = target_shapes(scene)
    X_SO: dict[str, Array | None] = {
        name: shapes[name].placed(np.array([x, y, np.deg2rad(turn)]))
        for name, (x, y, turn) in TRUTH.items()
    }
    taken = photographer(scene).take(X_SC, INTRINSICS, X_SO | {"banana": None})
    rng = np.random.default_rng(0)
    color = np.clip(np.round(taken.color + rng.normal(0, 3, taken.color.shape)), 0, 255)
    depth = np.round(taken.depth + rng.normal(0, 1e-3, taken.depth.shape), 3)
    return replace(taken, color=color.astype(np.uint8), depth=depth.astype(np.float32))


@needs_renderer
@pytest.mark.parametrize("method", ["silhouette", "depth"])
def test_rendered_objects_are_measured(scene: Scene, photo: Photo, method: str) -> None:
    depth = photo.depth if method == "depth" else None
    check = check_placement(scene, photo.color, INTRINSICS, depth=depth)
    assert check.method == method
    assert check.camera is not None
    for name, (x, y, turn) in TRUTH.items():
        found = check.instances[name]
        assert found.status == "measured", (name, found.reason)
        assert found.displacement is not None
        assert found.displacement_sd is not None
        assert np.hypot(found.displacement[0] - x, found.displacement[1] - y) < 8e-4, name
        off = np.abs(np.array(found.displacement) - (x, y)) / found.displacement_sd
        assert off.max() < 5.0, name
        if name == "bowl":
            assert found.angle is None
        else:
            assert found.angle is not None
            assert abs(np.rad2deg(found.angle) - turn) < 0.6, name
    banana = check.instances["banana"]
    assert (banana.status, banana.displacement) == ("not_seen", None)
    assert banana.reason == "nothing like it was found within 50 mm of its target"


def test_without_a_board_nothing_is_measured_and_the_reason_is_said(scene: Scene) -> None:
    check = check_placement(scene, np.full((480, 640, 3), 128, np.uint8), INTRINSICS)
    assert check.camera is None
    assert check.reason.startswith("the board was not found")
    assert {p.status for p in check.instances.values()} == {"not_seen"}
    assert "displacement" not in dump_document(check)


def test_objects_out_of_view_are_not_seen(scene: Scene) -> None:
    away = X_SC.copy()
    away[:3, 3] += (3.0, 0.0, 0.0)
    depth = np.full((480, 640), 1.0, np.float32)
    estimate = BoardEstimate(X_SC=away, valid=True)
    image = np.zeros((480, 640, 3), np.uint8)
    check = check_placement(scene, image, INTRINSICS, depth=depth, estimate=estimate)
    assert {p.reason for p in check.instances.values()} == {"it is out of view"}
    dark = check_placement(scene, image, INTRINSICS, estimate=estimate)
    assert dark.reason == "the board's paper and ink look alike in the photo; give it more light"


def test_inputs_that_cannot_be_used_are_named(scene: Scene) -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    with pytest.raises(InvalidInputError, match="the photo has 320 x 240"):
        check_placement(scene, np.zeros((240, 320, 3), np.uint8), INTRINSICS)
    with pytest.raises(
        InvalidInputError, match=r"the photo has shape \(480, 640\) and type float64"
    ):
        check_placement(scene, np.zeros((480, 640)), INTRINSICS)
    small = np.ones((240, 320), np.float32)
    with pytest.raises(InvalidInputError, match="the depth image has 320 x 240 pixels"):
        check_placement(scene, image, INTRINSICS, depth=small)
    millimetres = np.full((480, 640), 800.0, np.float32)
    with pytest.raises(InvalidInputError, match="is 800 m; give metres"):
        check_placement(scene, image, INTRINSICS, depth=millimetres)
    with pytest.raises(InvalidInputError, match="no pixel has a depth above 0"):
        check_placement(scene, image, INTRINSICS, depth=np.zeros((480, 640), np.float32))


@needs_renderer
@pytest.mark.parametrize("turn", [thorough(0.0), 150.0])
def test_by_depth_a_turned_mug_is_not_measured_wrongly_nor_one_with_a_hidden_handle(
    turn: float,
) -> None:
    alone = scene_of("mug")
    shape = target_shapes(alone)["mug"]
    handle = np.deg2rad(turn)
    X_SO = shape.placed(np.array([0.005, 0.005, handle]))
    # seen from the side, and from opposite to the handle, which the mug then hides
    p_SM, p_SH = X_SO[:3, 3], shape.placed(np.array([0.005, 0.005, handle]))[:3, 0]
    side = p_SM + 0.6 * np.array([-p_SH[1], p_SH[0], 0.0]) + (0.0, 0.0, 0.35)
    behind = p_SM - 0.7 * p_SH + (0.0, 0.0, 0.2)
    found = []
    for p_SC in (side, behind):
        X = looking(p_SC, p_SM)
        photo = photographer(alone).take(X, INTRINSICS, {"mug": X_SO}, supersampling=1)
        estimate = BoardEstimate(X_SC=X, valid=True)
        check = check_placement(
            alone, photo.color, INTRINSICS, depth=photo.depth, estimate=estimate
        )
        found.append(check.instances["mug"])
    seen, hidden = found
    assert seen.status == "measured" or turn > 0.0, seen.reason
    if seen.status == "measured":
        assert seen.displacement == pytest.approx((0.005, 0.005), abs=3e-4)
        assert seen.angle is not None
        assert np.rad2deg(seen.angle) == pytest.approx(turn, abs=0.5)
    assert hidden.status == "uncertain"
    assert "rotated by another" in hidden.reason or "another pose" in hidden.reason


@pytest.mark.thorough
@needs_renderer
def test_a_slender_object_turned_far_is_found() -> None:
    scene, name = scene_of("screwdriver"), "screwdriver"
    X_SO = target_shapes(scene)[name].placed(np.array([0.005, 0.005, np.deg2rad(90.0)]))
    taken = photographer(scene).take(X_SC, INTRINSICS, {name: X_SO})
    color = np.asarray(taken.color, dtype=np.uint8)
    found = check_placement(scene, color, INTRINSICS).instances[name]
    assert found.status == "measured", found.reason
    assert found.displacement is not None
    assert found.angle is not None
    assert np.hypot(found.displacement[0] - 0.005, found.displacement[1] - 0.005) < 8e-4
    assert abs(np.rad2deg(found.angle) - 90.0) < 0.6
