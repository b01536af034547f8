"""The node without ROS: images and camera_info in, poses and overlays out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array
from burg_drake.ros import BoardNode
from burg_drake.scene import Scene
from tests.cameras.synthetic import board_image

Make = Callable[..., Any]


@pytest.fixture
def message(picture: NDArray[np.uint8], image_message: Make) -> Any:
    return image_message(picture.tobytes(), (480, 640), "rgb8")


def test_pose_and_header(
    scene: Scene, intrinsics: Intrinsics, message: Any, info_message: Make, X_SC: Array
) -> None:
    sighting = BoardNode(scene).locate(message, info_message(intrinsics))
    assert sighting.estimate.valid, sighting.estimate.reason
    assert pytest.approx(X_SC, abs=1e-3) == sighting.estimate.X_SC
    assert sighting.stamp is message.header.stamp
    assert sighting.camera_frame == "camera_optical"


def test_intrinsics_of_a_file_stand_in_for_camera_info(
    scene: Scene, intrinsics: Intrinsics, message: Any, X_SC: Array
) -> None:
    sighting = BoardNode(scene, intrinsics=intrinsics).locate(message, None)
    assert pytest.approx(X_SC, abs=1e-3) == sighting.estimate.X_SC


def test_a_board_that_came_out_of_the_printer_smaller(
    scene: Scene, intrinsics: Intrinsics, image_message: Make, X_SC: Array
) -> None:
    """Along x by 3 percent, along y by 2."""
    scale = (0.97, 0.98)
    small = board_image(scene.board, intrinsics, X_SC, scale=scale)
    message = image_message(small.tobytes(), (480, 640), "rgb8")
    node = BoardNode(scene, intrinsics=intrinsics, print_scale=scale)
    assert pytest.approx(X_SC, abs=1e-3) == node.locate(message, None).estimate.X_SC


def test_overlay_changes_the_image_where_objects_stand(
    scene: Scene, intrinsics: Intrinsics, message: Any, picture: NDArray[np.uint8]
) -> None:
    node = BoardNode(scene, intrinsics=intrinsics)
    drawn = node.draw(node.locate(message, None))
    assert drawn is not None and drawn.shape == picture.shape
    assert 0.05 < (drawn != picture).any(axis=2).mean() < 0.8


def test_resolution_may_change(
    scene: Scene,
    intrinsics: Intrinsics,
    message: Any,
    picture: NDArray[np.uint8],
    image_message: Make,
    info_message: Make,
    X_SC: Array,
) -> None:
    """Between the two, one image comes with the camera_info of before."""
    node = BoardNode(scene)
    cut = np.ascontiguousarray(picture[60:460, 40:620])
    small = image_message(cut.tobytes(), cut.shape[:2], "rgb8")
    whole = info_message(intrinsics)
    part = info_message(intrinsics)
    part.roi = type(part.roi)(
        **vars(part.roi) | dict(x_offset=40, y_offset=60, width=580, height=400)
    )
    seen = [node.locate(*pair) for pair in ((message, whole), (small, whole), (small, part))]
    assert [sighting.estimate.valid for sighting in seen] == [True, False, True]
    assert seen[1].estimate.reason == (
        "the image has 580 x 400 pixels, but its camera_info says 640 x 480"
    )
    assert pytest.approx(X_SC, abs=1e-3) == seen[2].estimate.X_SC
    for sighting in seen:
        drawn = node.draw(sighting)
        assert drawn is not None and sighting.image is not None
        assert drawn.shape == sighting.image.shape and (drawn != sighting.image).any()


def test_without_camera_info_the_overlay_says_so(scene: Scene, message: Any) -> None:
    node = BoardNode(scene)
    sighting = node.locate(message, None)
    assert "no camera_info message has arrived yet" in sighting.estimate.reason
    drawn = node.draw(sighting)
    assert drawn is not None
    changed = (drawn != sighting.image).any(axis=2)
    assert changed[:40].any() and not changed[40:].any()


def test_damaged_image(scene: Scene, intrinsics: Intrinsics, message: Any) -> None:
    node = BoardNode(scene, intrinsics=intrinsics)
    message.data = message.data[:1000]
    sighting = node.locate(message, None)
    assert sighting.estimate.reason.startswith("the image is damaged: 1000 bytes")
    assert node.draw(sighting) is None


@pytest.mark.parametrize("shape", [(1, 1), (2, 500), (30, 40)])
def test_tiny_images(
    shape: tuple[int, int],
    scene: Scene,
    intrinsics: Intrinsics,
    image_message: Make,
    info_message: Make,
) -> None:
    """They show nothing, and do no harm."""
    node = BoardNode(scene)
    height, width = shape
    image = image_message(bytes(3 * height * width), shape, "rgb8")
    sighting = node.locate(image, info_message(intrinsics, width=width, height=height))
    assert not sighting.estimate.valid and sighting.estimate.reason
    drawn = node.draw(sighting)
    assert drawn is not None and drawn.shape == (*shape, 3)
