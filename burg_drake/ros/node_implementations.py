"""The node in ROS 1 (rospy) and in ROS 2 (rclpy)."""

from __future__ import annotations

import array
import http.client
import os
import threading
import time
import xmlrpc.client
from collections.abc import Mapping
from typing import Any

from burg_drake.core import InvalidInputError
from burg_drake.ros.ros_node import NodeNames, Publications, RosNode, message_classes

MASTER_VARIABLE = "ROS_MASTER_URI"  # Environment variable with the address of the ROS master.
MASTER_TIMEOUT = 3.0  # Seconds for the master to answer; rospy itself would retry forever.


class Ros1Node(RosNode):
    """A rospy node; see `RosNode`."""

    def __init__(self, names: NodeNames, *, with_camera_info: bool = True) -> None:
        """
        Args:
            names: of node, topics and frames.
            with_camera_info: listen for the camera's intrinsics, too.

        Raises:
            InvalidInputError: no master answers.
            ImportError: rospy or a message package is not installed.
        """
        import rospy

        classes = message_classes(bytes)
        # Address of the ROS master if the variable is not set.
        require_master(os.environ.get(MASTER_VARIABLE, "http://localhost:11311"))
        self._rospy = rospy
        rospy.init_node(names.node, argv=["burg-drake"], disable_signals=True)
        self._image_arrived = threading.Condition()
        self.publications = Publications(
            names,
            classes,
            lambda topic, message, queue: rospy.Publisher(
                topic.replace("~/", "~"), message, queue_size=queue
            ),
            lambda publisher: int(publisher.get_num_connections()),
        )
        # Bytes per read. With rospy's 65536, images pile up in the socket and arrive late.
        self._topics = {
            topic: rospy.Subscriber(topic, message, store, queue_size=1, buff_size=1 << 25)
            for topic, (message, store) in self._handlers(names, classes, with_camera_info).items()
        }

    def running(self) -> bool:
        """See `RosNode`."""
        return not self._rospy.is_shutdown()

    def next_image(self, timeout: float) -> Any | None:
        """See `RosNode`."""
        with self._image_arrived:
            self._image_arrived.wait_for(lambda: self._image is not None, timeout)
            image, self._image = self._image, None
        return image

    def publishers(self) -> Mapping[str, int]:
        """See `RosNode`."""
        return {topic: s.get_num_connections() for topic, s in self._topics.items()}

    def log(self, text: str, *, warning: bool = False) -> None:
        """See `RosNode`."""
        log = self._rospy.logwarn if warning else self._rospy.loginfo
        log("%s", text)

    def close(self) -> None:
        """See `RosNode`."""
        self._rospy.signal_shutdown("the node ends")

    def _store_image(self, message: Any) -> None:
        with self._image_arrived:
            self._image = message
            self._image_arrived.notify()


class _TimeoutTransport(xmlrpc.client.Transport):
    """An XML-RPC transport with a timeout."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = MASTER_TIMEOUT
        return connection


def require_master(uri: str) -> None:
    """Checks that a ROS master answers.

    Raises:
        InvalidInputError: no master answers at that address.
    """
    try:
        proxy: Any = xmlrpc.client.ServerProxy(uri, transport=_TimeoutTransport())
        code = proxy.getPid("/burg_drake")[0]
        reason = "" if code == 1 else f"it answered {code}"
    except (
        OSError,
        ValueError,
        TypeError,
        xmlrpc.client.Error,
        http.client.HTTPException,
    ) as error:
        reason = str(error) or type(error).__name__
    if reason:
        raise InvalidInputError(
            f"no ROS master at {uri} ({reason}); start roscore, or set {MASTER_VARIABLE}"
        )


class Ros2Node(RosNode):
    """An rclpy node; see `RosNode`."""

    def __init__(self, names: NodeNames, *, with_camera_info: bool = True) -> None:
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
        self._shutdown_error = ExternalShutdownException
        # Ctrl-C stays Python's: rclpy's handlers end the context under a publisher that is at work.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(names.node)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.publications = Publications(
            names,
            classes,
            lambda topic, message, queue: self._node.create_publisher(
                message, topic, QoSProfile(depth=queue)
            ),
            lambda publisher: int(publisher.get_subscription_count()),
        )
        self._topics = self._handlers(names, classes, with_camera_info)
        self._subscriptions: dict[str, Any] = {}
        self._incompatible: set[str] = set()
        for topic in self._topics:
            self._subscribe(topic, reliable=True)

    def _subscribe(self, topic: str, *, reliable: bool) -> None:
        """Subscribes to a topic; depth 1 keeps only the latest message.

        A reliable subscription is tried first, although it only receives from reliable publishers:
        an image is sent in hundreds of packets, and with best effort a lost one costs the image
        (two of three at 640 x 480, with Fast DDS on one machine).
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
        """See `RosNode`."""
        return bool(self._rclpy.ok())

    def next_image(self, timeout: float) -> Any | None:
        """See `RosNode`."""
        deadline = time.monotonic() + timeout
        try:
            while self._image is None and (left := deadline - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=left)
                while self._incompatible:
                    self._subscribe_with_best_effort(self._incompatible.pop())
        except self._shutdown_error:
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
        """See `RosNode`."""
        return {topic: int(self._node.count_publishers(topic)) for topic in self._topics}

    def log(self, text: str, *, warning: bool = False) -> None:
        """See `RosNode`."""
        logger = self._node.get_logger()
        # rclpy allows one severity a calling line.
        if warning:
            logger.warning(text)
        else:
            logger.info(text)

    def close(self) -> None:
        """See `RosNode`."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._rclpy.try_shutdown()
