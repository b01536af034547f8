"""The node in ROS 2, by rclpy."""

from __future__ import annotations

import array
import time
from collections.abc import Mapping
from typing import Any

from burg_drake.ros.link import Link, Names, Publications
from burg_drake.ros.messages import message_classes


class Ros2Link(Link):
    """An rclpy node; see `Link`."""

    def __init__(self, names: Names, *, with_camera_info: bool = True) -> None:
        """
        Args:
            names: of node, topics and frames.
            with_camera_info: listen for the camera's intrinsics, too.

        Raises:
            ImportError: rclpy or a message package is not installed.
        """
        import rclpy
        from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
        from rclpy.qos import QoSProfile
        from rclpy.signals import SignalHandlerOptions

        classes = message_classes(lambda octets: array.array("B", octets))
        self._rclpy = rclpy
        self._ended = ExternalShutdownException
        # Ctrl-C stays Python's: rclpy's handlers end the context under a publisher that is at work.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(names.node)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._image: Any | None = None
        self.publications = Publications(
            names,
            classes,
            lambda topic, message, queue: self._node.create_publisher(
                message, topic, QoSProfile(depth=queue)
            ),
            lambda publisher: int(publisher.get_subscription_count()),
        )
        self._topics = {
            names.image: (
                classes.CompressedImage if names.compressed else classes.Image,
                self._take_image,
            )
        }
        if with_camera_info:
            self._topics[names.info_topic] = (classes.CameraInfo, self._take_info)
        self._subscriptions: dict[str, Any] = {}
        self._incompatible: set[str] = set()
        for topic in self._topics:
            self._subscribe(topic, reliable=True)

    def _subscribe(self, topic: str, *, reliable: bool) -> None:
        """Listens to a topic; depth 1 keeps the latest message alone.

        A reliable subscription is asked for first, although it hears reliable publishers alone: an
        image is sent in hundreds of packets, and with best effort one that is lost costs the image
        (two of three at 640 x 480, by Fast DDS on one machine).
        """
        from rclpy.event_handler import SubscriptionEventCallbacks
        from rclpy.qos import QoSProfile, ReliabilityPolicy

        if topic in self._subscriptions:
            self._node.destroy_subscription(self._subscriptions[topic])
        policy = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        message_class, take = self._topics[topic]
        self._subscriptions[topic] = self._node.create_subscription(
            message_class,
            topic,
            take,
            QoSProfile(depth=1, reliability=policy),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=lambda event: self._incompatible.add(topic)
            ),
        )

    def running(self) -> bool:
        """See `Link`."""
        return bool(self._rclpy.ok())

    def next_image(self, patience: float) -> Any | None:
        """See `Link`."""
        deadline = time.monotonic() + patience
        try:
            while self._image is None and (left := deadline - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=left)
                while self._incompatible:
                    self._subscribe_with_best_effort(self._incompatible.pop())
        except self._ended:
            return None
        image, self._image = self._image, None
        return image

    def _subscribe_with_best_effort(self, topic: str) -> None:
        self.log(
            f"{topic} is published with best-effort reliability, so an image is lost if one of its"
            " packets is lost; publish it as reliable to receive more images"
        )
        self._subscribe(topic, reliable=False)

    def publishers(self) -> Mapping[str, int]:
        """See `Link`."""
        return {topic: int(self._node.count_publishers(topic)) for topic in self._topics}

    def log(self, text: str, *, warning: bool = False) -> None:
        """See `Link`."""
        logger = self._node.get_logger()
        # rclpy allows one severity a calling line.
        if warning:
            logger.warning(text)
        else:
            logger.info(text)

    def close(self) -> None:
        """See `Link`."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._rclpy.try_shutdown()

    def _take_image(self, message: Any) -> None:
        self._image = message

    def _take_info(self, message: Any) -> None:
        self.camera_info = message
