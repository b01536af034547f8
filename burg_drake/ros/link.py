"""What the node needs of a ROS distribution, and what both distributions share."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.ros.board_node import Sighting
from burg_drake.ros.messages import (
    MessageClasses,
    camera_pose_message,
    compressed_message,
    frames_message,
    image_message,
    status_message,
)

NODE_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
TOPIC_NAME = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
COMPRESSED = "compressed"
"""Last part of the name of a topic with compressed images, by the convention of image_transport."""
QUEUE, TF_QUEUE = 10, 100
"""How many small messages may wait for a slow listener; tf's as in tf2_ros."""


class Parent(Enum):
    """Which frame is the parent of the other on tf."""

    CAMERA = "camera"
    BOARD = "board"
    NONE = "none"


@dataclass(frozen=True, kw_only=True)
class Names:
    """Names in the ROS graph.

    Attributes:
        node: of the node; what it publishes is below it.
        image: topic with images, compressed ones if its last part is `compressed`.
        camera_info: topic with the camera's intrinsics; `camera_info` beside the images if empty.
        board_frame: tf frame of the board.
        parent: whether the camera's frame is the parent of the board's, or the reverse, or the
            node leaves tf alone.
    """

    node: str = "burg_board"
    image: str
    camera_info: str = ""
    board_frame: str = "board"
    parent: Parent = Parent.CAMERA

    def __post_init__(self) -> None:
        if not NODE_NAME.fullmatch(self.node):
            raise InvalidInputError(
                f"node name {self.node!r} is not valid; it must be letters, digits and _, and"
                " start with a letter"
            )
        for topic in (self.image, self.camera_info or self.image):
            if not TOPIC_NAME.fullmatch(topic):
                raise InvalidInputError(
                    f"{topic!r} is not a valid topic name; give one such as /camera/image_raw"
                )
        if not self.board_frame or self.board_frame.startswith("/"):
            raise InvalidInputError(f"tf frame {self.board_frame!r} must not start with /")

    @property
    def compressed(self) -> bool:
        """The images are `sensor_msgs/CompressedImage`."""
        return self.image.rsplit("/", 1)[-1] == COMPRESSED

    @property
    def info_topic(self) -> str:
        """Where the intrinsics come from."""
        if self.camera_info:
            return self.camera_info
        base = self.image.removesuffix(f"/{COMPRESSED}") if self.compressed else self.image
        folder, slash, _ = base.rpartition("/")
        return f"{folder}{slash}camera_info"


class Publications:
    """The node's topics: overlay (plain and compressed), camera's pose, status, and tf."""

    def __init__(
        self,
        names: Names,
        classes: MessageClasses,
        advertise: Callable[[str, type, int], Any],
        listeners: Callable[[Any], int],
    ) -> None:
        """
        Args:
            names: of node and frames.
            classes: of the messages.
            advertise: a publisher for a topic (`~` is the node's name), a message class, and how
                many messages may wait for a slow listener.
            listeners: how many listen to a publisher.
        """
        self._names = names
        self._classes = classes
        self._listeners = listeners
        self._overlay = advertise("~/overlay", classes.Image, 1)
        self._compressed = advertise(f"~/overlay/{COMPRESSED}", classes.CompressedImage, 1)
        self._pose = advertise("~/camera_pose", classes.PoseWithCovarianceStamped, QUEUE)
        self._status = advertise("~/status", classes.String, QUEUE)
        self._frames = None
        if names.parent is not Parent.NONE:
            if classes.TFMessage is None:
                raise MissingDependencyError(
                    "tf2_msgs is not installed, so the frame of the board cannot be published on"
                    " tf; install it, or give none as parent frame"
                ).about("tf_parent")
            self._frames = advertise("/tf", classes.TFMessage, TF_QUEUE)

    def publish(self, sighting: Sighting, draw: Callable[[Sighting], Any]) -> None:
        """Publishes what an image says; pose and frame only where they are known, and the overlay
        only where somebody listens."""
        classes, names = self._classes, self._names
        self._status.publish(status_message(classes, sighting))
        if sighting.estimate.valid:
            self._pose.publish(camera_pose_message(classes, sighting, names.board_frame))
            if self._frames is not None and sighting.camera_frame:
                self._frames.publish(
                    frames_message(
                        classes,
                        sighting,
                        names.board_frame,
                        board_is_parent=names.parent is Parent.BOARD,
                    )
                )
        plain, compressed = self._listeners(self._overlay), self._listeners(self._compressed)
        drawn: NDArray[Any] | None = draw(sighting) if plain or compressed else None
        if drawn is not None and plain:
            self._overlay.publish(image_message(classes, sighting, drawn))
        if drawn is not None and compressed:
            self._compressed.publish(compressed_message(classes, sighting, drawn))


class Link(ABC):
    """A running node of ROS 1 or ROS 2.

    Attributes:
        publications: what it publishes.
        camera_info: the latest `sensor_msgs/CameraInfo`, None before the first.
    """

    publications: Publications
    camera_info: Any | None = None

    @abstractmethod
    def running(self) -> bool:
        """False once ROS, or Ctrl-C, has ended the node."""

    @abstractmethod
    def next_image(self, patience: float) -> Any | None:
        """The latest image that was not given yet, or None if none comes within `patience` [s]."""

    @abstractmethod
    def publishers(self) -> Mapping[str, int]:
        """How many publish each of the topics that the node listens to."""

    @abstractmethod
    def log(self, text: str, *, warning: bool = False) -> None:
        """A line in the log of ROS."""

    @abstractmethod
    def close(self) -> None:
        """Leaves the graph."""
