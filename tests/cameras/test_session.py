"""The live session: what it makes of frames, and that it goes on whatever happens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.cameras import (
    BoardEstimate,
    Frame,
    FrameProcessor,
    Intrinsics,
    ViewSettings,
    change_settings,
    check_settings,
    describe_pose,
    placement_order,
    position_sd,
)
from burg_drake.core import InvalidInputError, Pose, UnknownNameError, make_pose
from burg_drake.scene import Board, Scene, load_scene
from tests.cameras.synthetic import board_image

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))


def camera_at(x: float) -> np.ndarray:
    """Straight above the board."""
    return make_pose(np.diag([1.0, -1.0, -1.0]), (x, 0.21, 0.6))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def session(scene: Scene) -> FrameProcessor:
    return FrameProcessor(scene, CAMERA)


@pytest.fixture(scope="module")
def image(scene: Scene) -> np.ndarray:
    return board_image(scene.board, CAMERA, camera_at(0.3))


def test_looks_and_draws(session: FrameProcessor, image: np.ndarray) -> None:
    sight = session.locate(Frame(image, None, 0.0, "a"))
    assert sight.estimate.valid
    assert np.linalg.norm(sight.estimate.X_SC[:3, 3] - camera_at(0.3)[:3, 3]) < 1e-3
    drawn = session.draw(sight, ViewSettings())
    assert drawn.shape == image.shape and (drawn != image).any(axis=-1).mean() > 0.05
    alone = session.draw(sight, ViewSettings(guide="mug"))
    changed = (alone != image).any(axis=-1)
    assert 0 < changed.sum() < 0.5 * (drawn != image).any(axis=-1).sum()
    mug = session.scene.X_SO("mug")[:3, 3]
    p_C = np.linalg.inv(camera_at(0.3)) @ [*mug, 1.0]
    u, v = CAMERA.project(p_C[:3])
    rows, columns = np.nonzero(changed)
    assert rows.min() - 5 < v < rows.max() + 5 and columns.min() - 5 < u < columns.max() + 5


def test_steady(session: FrameProcessor, scene: Scene, image: np.ndarray) -> None:
    """With noise, the poses of a camera at rest that are drawn at differ less than the estimates;
    that of a moved camera follows within two frames."""
    rng = np.random.default_rng(0)

    def noisy(picture: np.ndarray) -> Frame:
        levels = picture + rng.normal(0.0, 12.0, picture.shape)
        return Frame(np.clip(levels, 0, 255).astype(np.uint8), None, 0.0, "a")

    sights = [session.locate(noisy(image), steady=True) for _ in range(20)]
    drawn = np.array([s.X_SC[:3, 3] for s in sights[5:]]).std(axis=0)
    estimated = np.array([s.estimate.X_SC[:3, 3] for s in sights[5:]]).std(axis=0)
    assert np.linalg.norm(drawn) < 0.6 * np.linalg.norm(estimated)
    elsewhere = board_image(scene.board, CAMERA, camera_at(0.33))
    moved = [session.locate(noisy(elsewhere), steady=True) for _ in range(2)][-1]
    assert np.array_equal(moved.X_SC, moved.estimate.X_SC)
    assert session.locate(noisy(image)).X_SC[0, 3] == pytest.approx(0.3, abs=2e-3)


def test_without_a_board_the_picture_says_so(session: FrameProcessor) -> None:
    empty = np.full((240, 320, 3), 90, dtype=np.uint8)
    sight = session.locate(Frame(empty, None, 0.0, "a"))
    assert not sight.estimate.valid
    drawn = session.draw(sight, ViewSettings())
    assert 0 < (drawn != empty).any(axis=-1).sum() < 0.3 * empty[..., 0].size


def test_print_scale(scene: Scene) -> None:
    """A board printed at 97 %, and told so, is seen where it is."""
    picture = board_image(scene.board, CAMERA, camera_at(0.3), scale=(0.97, 0.97))
    told = FrameProcessor(scene, CAMERA, print_scale=(0.97, 0.97))
    estimate = told.locate(Frame(picture, None, 0.0, "a")).estimate
    assert np.linalg.norm(estimate.X_SC[:3, 3] - camera_at(0.3)[:3, 3]) < 1e-3


def test_words(scene: Scene) -> None:
    assert describe_pose(BoardEstimate(reason="no marker"), scene.board) == "no marker"
    spread = np.diag([1.0, 1.0, 1.0, 1e-10, 4e-10, 9e-10])
    seen = BoardEstimate(X_SC=np.eye(4), valid=True, covariance=spread, ids=tuple(range(7)))
    assert position_sd(seen) == pytest.approx(3e-5)
    assert describe_pose(seen, Board()) == "7 of 54 markers, camera within 0.03 mm"
    doubtful = replace(seen, reason="printed at 99 %")
    assert describe_pose(doubtful, Board()).endswith("; printed at 99 %")


def test_settings_are_checked(scene: Scene) -> None:
    with pytest.raises(InvalidInputError, match=r"opacity 1\.5 is not a number from 0 to 1"):
        check_settings(scene, ViewSettings(opacity=1.5))
    with pytest.raises(UnknownNameError, match="did you mean 'mug'"):
        check_settings(scene, ViewSettings(guide="mugg"))


def test_placing_order(scene: Scene) -> None:
    order = placement_order(scene)
    assert sorted(order) == sorted(scene.instances)
    rows = [scene.X_SO(name)[1, 3] > 0.21 for name in order]
    assert rows == [True] * 3 + [False] * 3, "the far row comes first"
    first = scene.document.instances[0]
    above = replace(first, name="on_top", X_SO=Pose((0.3, 0.4, 0.2)))
    stacked = replace(scene.document, instances=(above, *scene.document.instances))
    assert placement_order(Scene(stacked, scene.library, scene.path))[-1] == "on_top"


def test_settings_keep_their_types(scene: Scene) -> None:
    """A browser sends 0 and 1 where a fraction is meant."""
    settings = ViewSettings()
    for opacity in (0, 0.45, 1, 0.3):
        settings = change_settings(scene, settings, {"opacity": opacity})
        assert settings.opacity == opacity
    for wrong in (True, "0.5", None, 10**400, float("nan")):
        with pytest.raises(InvalidInputError, match="opacity"):
            change_settings(scene, settings, {"opacity": wrong})
    with pytest.raises(InvalidInputError, match="names must be a bool, not 1"):
        change_settings(scene, settings, {"names": 1})
