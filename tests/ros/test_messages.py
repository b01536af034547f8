"""Messages that are published, filled into classes that are as strict as those of ROS 2."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import BoardEstimate
from burg_drake.core import make_pose, rot_z
from burg_drake.ros import (
    MessageClasses,
    Sighting,
    camera_pose_message,
    compressed_message,
    image_message,
    status_message,
    transform_message,
)

DOWN = np.diag([1.0, -1.0, -1.0])
STANDARD_DEVIATIONS = np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])


@pytest.fixture
def sighting(ros2_classes: MessageClasses) -> Sighting:
    """A camera that looks straight down from 0.8 m, turned by 90 degrees."""
    return Sighting(
        stamp=ros2_classes.Image().header.stamp,
        camera_frame="eye",
        estimate=BoardEstimate(
            X_SC=make_pose(rot_z(np.pi / 2) @ DOWN, (0.3, 0.2, 0.8)),
            valid=True,
            reprojection_error=0.123,
            ids=(3, 7, 8),
            covariance=np.diag(STANDARD_DEVIATIONS**2) + 1e-3,
        ),
    )


def numbers(*vectors: object) -> list[float]:
    return [value for vector in vectors for value in vars(vector).values()]


def test_camera_pose(ros2_classes: MessageClasses, sighting: Sighting) -> None:
    """The axis of that half turn lies between x and y."""
    message = camera_pose_message(ros2_classes, sighting, "board")
    assert message.header.frame_id == "board" and message.header.stamp is sighting.stamp
    pose = message.pose.pose
    half = np.sqrt(0.5)
    assert numbers(pose.position) == pytest.approx([0.3, 0.2, 0.8])
    assert numbers(pose.orientation) == pytest.approx([half, half, 0.0, 0.0])


def test_covariance_has_the_translation_first(
    ros2_classes: MessageClasses, sighting: Sighting
) -> None:
    covariance = np.reshape(
        camera_pose_message(ros2_classes, sighting, "board").pose.covariance, (6, 6)
    )
    expected = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]) ** 2
    assert np.diag(covariance) == pytest.approx(expected + 1e-3)
    assert covariance[0, 3] == pytest.approx(1e-3)


@pytest.mark.parametrize("board_is_parent", [False, True])
def test_frames(ros2_classes: MessageClasses, sighting: Sighting, board_is_parent: bool) -> None:
    """The origin of the parent, seen from the child, and back."""
    message = transform_message(ros2_classes, sighting, "board", board_is_parent=board_is_parent)
    (transform,) = message.transforms
    parent, child = ("board", "eye") if board_is_parent else ("eye", "board")
    assert (transform.header.frame_id, transform.child_frame_id) == (parent, child)
    assert transform.header.stamp is sighting.stamp
    # From 0.8 m above, x of the camera is y of the board, y of the camera is x of the board.
    expected = [0.3, 0.2, 0.8] if board_is_parent else [-0.2, -0.3, 0.8]
    assert numbers(transform.transform.translation) == pytest.approx(expected)
    half = np.sqrt(0.5)
    assert numbers(transform.transform.rotation) == pytest.approx([half, half, 0.0, 0.0])


def test_images(ros2_classes: MessageClasses, sighting: Sighting) -> None:
    image = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    message = image_message(ros2_classes, sighting, image)
    assert (message.height, message.width, message.step) == (2, 3, 9)
    assert (message.encoding, message.header.frame_id) == ("rgb8", "eye")
    assert bytes(message.data) == image.tobytes()


def test_compressed_images(ros2_classes: MessageClasses, sighting: Sighting) -> None:
    image = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    message = compressed_message(ros2_classes, sighting, image)
    bgr = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(bgr[..., ::-1].astype(int) - image).max() <= 4


def test_status(ros2_classes: MessageClasses, sighting: Sighting) -> None:
    assert status_message(ros2_classes, sighting).data == "3 markers, 0.12 px"
    lost = replace(sighting, estimate=BoardEstimate(reason="too dark"))
    assert status_message(ros2_classes, lost).data == "no pose: too dark"
    nameless = replace(sighting, camera_frame="")
    assert status_message(ros2_classes, nameless).data == (
        "3 markers, 0.12 px; not sent to tf, as the images have no frame_id"
    )


def test_the_classes_of_the_tests_are_strict(ros2_classes: MessageClasses) -> None:
    """What rclpy's messages refuse, these refuse, too."""
    message = ros2_classes.PoseWithCovarianceStamped()
    with pytest.raises(AssertionError):
        message.pose.pose.position.x = np.float32(1.0)
    with pytest.raises(AssertionError):
        message.pose.covariance = [0] * 36
    with pytest.raises(AssertionError):
        ros2_classes.Image().data = SimpleNamespace()
    with pytest.raises(AssertionError):
        message.header.seq = 3
