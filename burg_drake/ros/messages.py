"""Fills the messages that the node publishes, from the classes of ROS 1 or ROS 2 alike."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, inverse, quaternion_from_rotation
from burg_drake.ros.board_node import Sighting
from burg_drake.ros.images import jpeg

ROTATION_LAST = np.array([3, 4, 5, 0, 1, 2])
"""Our covariances have the rotation first, those of `geometry_msgs` the translation."""


@dataclass(frozen=True)
class MessageClasses:
    """The messages of a ROS distribution.

    Attributes:
        TFMessage: None where tf2_msgs is not installed.
        octets: makes of bytes what a field `uint8[]` takes.
    """

    Image: type
    CompressedImage: type
    CameraInfo: type
    PoseWithCovarianceStamped: type
    TransformStamped: type
    String: type
    TFMessage: Any
    octets: Callable[[bytes], Any]


def message_classes(octets: Callable[[bytes], Any]) -> MessageClasses:
    """Those that are installed; their modules have the same names in ROS 1 and ROS 2.

    Raises:
        ImportError: a package is not there.
    """
    packages = {
        "sensor_msgs": ("Image", "CompressedImage", "CameraInfo"),
        "geometry_msgs": ("PoseWithCovarianceStamped", "TransformStamped"),
        "std_msgs": ("String",),
    }
    found = {
        name: getattr(importlib.import_module(f"{package}.msg"), name)
        for package, names in packages.items()
        for name in names
    }
    try:
        found["TFMessage"] = importlib.import_module("tf2_msgs.msg").TFMessage
    except ImportError:
        found["TFMessage"] = None
    return MessageClasses(**found, octets=octets)


def image_message(classes: MessageClasses, sighting: Sighting, image: NDArray[np.uint8]) -> Any:
    """`sensor_msgs/Image` of (H, W, 3) RGB, with the header of the image that was seen."""
    message = classes.Image()
    _head(message, sighting, sighting.camera_frame)
    message.height, message.width = image.shape[:2]
    message.encoding = "rgb8"
    message.is_bigendian = 0
    message.step = 3 * message.width
    message.data = classes.octets(image.tobytes())
    return message


def compressed_message(
    classes: MessageClasses, sighting: Sighting, image: NDArray[np.uint8]
) -> Any:
    """`sensor_msgs/CompressedImage` of (H, W, 3) RGB as JPEG."""
    message = classes.CompressedImage()
    _head(message, sighting, sighting.camera_frame)
    message.format = "rgb8; jpeg compressed bgr8"  # as image_transport's plugin has it
    message.data = classes.octets(jpeg(image))
    return message


def camera_pose_message(classes: MessageClasses, sighting: Sighting, board_frame: str) -> Any:
    """`geometry_msgs/PoseWithCovarianceStamped`: the camera's optical frame in the board's.

    Its covariance is of x, y, z and rotations about the fixed axes x, y, z of the board's frame.
    """
    message = classes.PoseWithCovarianceStamped()
    _head(message, sighting, board_frame)
    X_SC, covariance = sighting.estimate.X_SC, sighting.estimate.covariance
    pose = message.pose.pose
    _put(pose.position, pose.orientation, X_SC)
    reordered = covariance[np.ix_(ROTATION_LAST, ROTATION_LAST)]
    message.pose.covariance = [float(value) for value in reordered.ravel()]
    return message


def frames_message(
    classes: MessageClasses, sighting: Sighting, board_frame: str, *, board_is_parent: bool
) -> Any:
    """`tf2_msgs/TFMessage` with the board's frame in the camera's, or the reverse."""
    transform = classes.TransformStamped()
    X_SC, camera_frame = sighting.estimate.X_SC, sighting.camera_frame
    if board_is_parent:
        parent, child, X_parent_child = board_frame, camera_frame, X_SC
    else:
        parent, child, X_parent_child = camera_frame, board_frame, inverse(X_SC)
    _head(transform, sighting, parent)
    transform.child_frame_id = child
    _put(transform.transform.translation, transform.transform.rotation, X_parent_child)
    message = classes.TFMessage()
    message.transforms = [transform]
    return message


def status_message(classes: MessageClasses, sighting: Sighting) -> Any:
    """`std_msgs/String`."""
    message = classes.String()
    message.data = sighting.status
    return message


def _head(message: Any, sighting: Sighting, frame: str) -> None:
    message.header.stamp = sighting.stamp
    message.header.frame_id = frame


def _put(position: Any, orientation: Any, X: Array) -> None:
    """Writes a (4, 4) pose; messages of ROS 2 take no other numbers than Python's own."""
    position.x, position.y, position.z = (float(value) for value in X[:3, 3])
    quaternion = quaternion_from_rotation(X[:3, :3])
    orientation.w, orientation.x, orientation.y, orientation.z = (float(v) for v in quaternion)
