"""The node's interface to ROS: names, message classes, published topics and subscriptions.

Both ROS distributions share this code; `node_implementations` has the differences.
"""

from __future__ import annotations

import importlib
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras import encode_jpeg
from burg_drake.core import (
    Array,
    Bytes,
    InvalidInputError,
    MissingDependencyError,
    inverse,
    quaternion_from_rotation,
)
from burg_drake.ros.board_node import Sighting


@dataclass(frozen=True)
class MessageClasses:
    """The message classes of a ROS distribution.

    Attributes:
        TFMessage: None where tf2_msgs is not installed.
        octets: converts bytes to the type of a field `uint8[]`.
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
    """Imports the message classes; their modules have the same names in ROS 1 and ROS 2.

    Raises:
        ImportError: a package is not installed.
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


def image_message(classes: MessageClasses, sighting: Sighting, image: Bytes) -> Any:
    """Builds a `sensor_msgs/Image` of (H, W, 3) RGB, with the header of the input image."""
    message = classes.Image()
    _set_header(message, sighting, sighting.camera_frame)
    message.height, message.width = image.shape[:2]
    message.encoding = "rgb8"
    message.is_bigendian = 0
    message.step = 3 * message.width
    message.data = classes.octets(image.tobytes())
    return message


def compressed_message(classes: MessageClasses, sighting: Sighting, image: Bytes) -> Any:
    """`sensor_msgs/CompressedImage` of (H, W, 3) RGB as JPEG."""
    message = classes.CompressedImage()
    _set_header(message, sighting, sighting.camera_frame)
    message.format = "rgb8; jpeg compressed bgr8"  # as image_transport's plugin has it
    message.data = classes.octets(encode_jpeg(image, 95))
    return message


def camera_pose_message(classes: MessageClasses, sighting: Sighting, board_frame: str) -> Any:
    """`geometry_msgs/PoseWithCovarianceStamped`: the camera's optical frame in the board's.

    Its covariance is of x, y, z and rotations about the fixed axes x, y, z of the board's frame.
    """
    # ROS has the translation first, covariances of this project the rotation.
    ros_order = np.array([3, 4, 5, 0, 1, 2])
    message = classes.PoseWithCovarianceStamped()
    _set_header(message, sighting, board_frame)
    X_SC, covariance = sighting.estimate.X_SC, sighting.estimate.covariance
    pose = message.pose.pose
    _set_pose(pose.position, pose.orientation, X_SC)
    reordered = covariance[np.ix_(ros_order, ros_order)]
    message.pose.covariance = [float(value) for value in reordered.ravel()]
    return message


def transform_message(
    classes: MessageClasses, sighting: Sighting, board_frame: str, *, board_is_parent: bool
) -> Any:
    """`tf2_msgs/TFMessage` with the board's frame in the camera's, or the reverse."""
    transform = classes.TransformStamped()
    X_SC, camera_frame = sighting.estimate.X_SC, sighting.camera_frame
    if board_is_parent:
        parent, child, X_parent_child = board_frame, camera_frame, X_SC
    else:
        parent, child, X_parent_child = camera_frame, board_frame, inverse(X_SC)
    _set_header(transform, sighting, parent)
    transform.child_frame_id = child
    _set_pose(transform.transform.translation, transform.transform.rotation, X_parent_child)
    message = classes.TFMessage()
    message.transforms = [transform]
    return message


def status_message(classes: MessageClasses, sighting: Sighting) -> Any:
    """`std_msgs/String`."""
    message = classes.String()
    message.data = sighting.status
    return message


def _set_header(message: Any, sighting: Sighting, frame: str) -> None:
    message.header.stamp = sighting.stamp
    message.header.frame_id = frame


def _set_pose(position: Any, orientation: Any, X: Array) -> None:
    """Writes a (4, 4) pose to a message; ROS 2 only accepts Python's own numbers."""
    position.x, position.y, position.z = (float(value) for value in X[:3, 3])
    quaternion = quaternion_from_rotation(X[:3, :3])
    orientation.w, orientation.x, orientation.y, orientation.z = (float(v) for v in quaternion)


NODE_NAME_PATTERN = re.compile(r"[A-Za-z]\w*", re.ASCII)  # Valid names of a node.
TOPIC_NAME_PATTERN = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)  # Valid topics.
COMPRESSED_SUFFIX = "compressed"
"""Last part of the name of a topic with compressed images (image_transport)."""


class ParentFrame(Enum):
    """The parent frame on tf."""

    CAMERA = "camera"
    BOARD = "board"
    NONE = "none"


@dataclass(frozen=True, kw_only=True)
class NodeNames:
    """Names in the ROS graph.

    Attributes:
        node: of the node, and namespace of its topics.
        image: topic with images, compressed ones if its last part is `compressed`.
        camera_info: topic with the camera's intrinsics; `camera_info` beside the images if empty.
        board_frame: tf frame of the board.
        parent: the parent frame on tf: the camera's, the board's, or no transform is published.
    """

    node: str = "burg_board"
    image: str
    camera_info: str = ""
    board_frame: str = "board"
    parent: ParentFrame = ParentFrame.CAMERA

    def __post_init__(self) -> None:
        if not NODE_NAME_PATTERN.fullmatch(self.node):
            raise InvalidInputError(
                f"node name {self.node!r} is not valid; it must be letters, digits and _, and"
                " start with a letter"
            )
        for topic in (self.image, self.camera_info or self.image):
            if not TOPIC_NAME_PATTERN.fullmatch(topic):
                raise InvalidInputError(
                    f"{topic!r} is not a valid topic name; give one such as /camera/image_raw"
                )
        if not self.board_frame or self.board_frame.startswith("/"):
            raise InvalidInputError(f"tf frame {self.board_frame!r} must not start with /")

    @property
    def compressed(self) -> bool:
        """Whether the images are `sensor_msgs/CompressedImage`."""
        return self.image.rsplit("/", 1)[-1] == COMPRESSED_SUFFIX

    @property
    def info_topic(self) -> str:
        """Topic of the intrinsics."""
        if self.camera_info:
            return self.camera_info
        base = self.image.removesuffix(f"/{COMPRESSED_SUFFIX}") if self.compressed else self.image
        folder, slash, _ = base.rpartition("/")
        return f"{folder}{slash}camera_info"


class Publications:
    """The node's topics: overlay (plain and compressed), camera's pose, status, and tf."""

    def __init__(
        self,
        names: NodeNames,
        classes: MessageClasses,
        advertise: Callable[[str, type, int], Any],
        listeners: Callable[[Any], int],
    ) -> None:
        """
        Args:
            names: of node and frames.
            classes: of the messages.
            advertise: creates a publisher from a topic (`~` is the node's name), a message class
                and a queue size.
            listeners: returns a publisher's number of subscribers.
        """
        queue_size = 10  # Small messages that may wait for a slow subscriber.
        self._names = names
        self._classes = classes
        self._listeners = listeners
        self._overlay = advertise("~/overlay", classes.Image, 1)
        self._compressed = advertise(f"~/overlay/{COMPRESSED_SUFFIX}", classes.CompressedImage, 1)
        self._pose = advertise("~/camera_pose", classes.PoseWithCovarianceStamped, queue_size)
        self._status = advertise("~/status", classes.String, queue_size)
        self._frames = None
        if names.parent is not ParentFrame.NONE:
            if classes.TFMessage is None:
                raise MissingDependencyError(
                    "tf2_msgs is not installed, so the frame of the board cannot be published on"
                    " tf; install it, or give none as parent frame"
                ).about("tf_parent")
            self._frames = advertise("/tf", classes.TFMessage, 100)  # As in tf2_ros.

    def publish(self, sighting: Sighting, draw: Callable[[Sighting], Any]) -> None:
        """Publishes a sighting: pose and transform only if known, and the overlay only if it has
        subscribers.
        """
        classes, names = self._classes, self._names
        self._status.publish(status_message(classes, sighting))
        if sighting.estimate.valid:
            self._pose.publish(camera_pose_message(classes, sighting, names.board_frame))
            if self._frames is not None and sighting.camera_frame:
                is_parent = names.parent is ParentFrame.BOARD
                self._frames.publish(
                    transform_message(
                        classes, sighting, names.board_frame, board_is_parent=is_parent
                    )
                )
        plain, compressed = self._listeners(self._overlay), self._listeners(self._compressed)
        drawn: NDArray[Any] | None = draw(sighting) if plain or compressed else None
        if drawn is not None and plain:
            self._overlay.publish(image_message(classes, sighting, drawn))
        if drawn is not None and compressed:
            self._compressed.publish(compressed_message(classes, sighting, drawn))


class RosNode(ABC):
    """A running node of ROS 1 or ROS 2.

    Attributes:
        publications: published topics.
        camera_info: the latest `sensor_msgs/CameraInfo`; None before the first.
    """

    publications: Publications
    camera_info: Any | None = None
    _image: Any | None = None

    @abstractmethod
    def running(self) -> bool:
        """Whether the node runs; False once ROS or Ctrl-C has ended it."""

    @abstractmethod
    def next_image(self, timeout: float) -> Any | None:
        """Waits for the latest new image; None after `timeout` [s]."""

    @abstractmethod
    def publishers(self) -> Mapping[str, int]:
        """Number of publishers of each subscribed topic."""

    @abstractmethod
    def log(self, text: str, *, warning: bool = False) -> None:
        """Writes a line to the log of ROS."""

    @abstractmethod
    def close(self) -> None:
        """Shuts down the node."""

    def _handlers(
        self, names: NodeNames, classes: MessageClasses, with_camera_info: bool
    ) -> dict[str, tuple[type, Callable[[Any], None]]]:
        """Message class and callback of each subscribed topic."""
        image_class = classes.CompressedImage if names.compressed else classes.Image
        handlers: dict[str, tuple[type, Callable[[Any], None]]] = {
            names.image: (image_class, self._store_image)
        }
        if with_camera_info:
            handlers[names.info_topic] = (classes.CameraInfo, self._store_camera_info)
        return handlers

    def _store_image(self, message: Any) -> None:
        self._image = message

    def _store_camera_info(self, message: Any) -> None:
        self.camera_info = message
