"""The node in ROS 1, by rospy."""

from __future__ import annotations

import http.client
import os
import threading
import xmlrpc.client
from collections.abc import Mapping
from typing import Any

from burg_drake.core import InvalidInputError
from burg_drake.ros.link import Link, Names, Publications
from burg_drake.ros.messages import message_classes

MASTER_VARIABLE = "ROS_MASTER_URI"
DEFAULT_MASTER = "http://localhost:11311"
MASTER_PATIENCE = 3.0
"""How long a master may take to answer [s]; rospy itself would ask for ever."""
BUFFER = 1 << 25
"""Bytes that a subscriber reads at once. With rospy's default of 65536 images pile up in the
socket, and a queue of length 1 gives old ones."""


class Ros1Link(Link):
    """A rospy node; see `Link`."""

    def __init__(self, names: Names, *, with_camera_info: bool = True) -> None:
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
        require_master(os.environ.get(MASTER_VARIABLE, DEFAULT_MASTER))
        self._rospy = rospy
        rospy.init_node(names.node, argv=["burg-drake"], disable_signals=True)
        self._news = threading.Condition()
        self._image: Any | None = None
        self.publications = Publications(
            names,
            classes,
            lambda topic, message, queue: rospy.Publisher(
                topic.replace("~/", "~"), message, queue_size=queue
            ),
            lambda publisher: int(publisher.get_num_connections()),
        )
        self._topics = {
            names.image: rospy.Subscriber(
                names.image,
                classes.CompressedImage if names.compressed else classes.Image,
                self._take_image,
                queue_size=1,
                buff_size=BUFFER,
            )
        }
        if with_camera_info:
            self._topics[names.info_topic] = rospy.Subscriber(
                names.info_topic, classes.CameraInfo, self._take_info, queue_size=1
            )

    def running(self) -> bool:
        """See `Link`."""
        return not self._rospy.is_shutdown()

    def next_image(self, patience: float) -> Any | None:
        """See `Link`."""
        with self._news:
            self._news.wait_for(lambda: self._image is not None, patience)
            image, self._image = self._image, None
        return image

    def publishers(self) -> Mapping[str, int]:
        """See `Link`."""
        return {topic: s.get_num_connections() for topic, s in self._topics.items()}

    def log(self, text: str, *, warning: bool = False) -> None:
        """See `Link`."""
        log = self._rospy.logwarn if warning else self._rospy.loginfo
        log("%s", text)

    def close(self) -> None:
        """See `Link`."""
        self._rospy.signal_shutdown("the node ends")

    def _take_image(self, message: Any) -> None:
        with self._news:
            self._image = message
            self._news.notify()

    def _take_info(self, message: Any) -> None:
        self.camera_info = message


class _Transport(xmlrpc.client.Transport):
    """One that does not wait for ever."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = MASTER_PATIENCE
        return connection


def require_master(uri: str) -> None:
    """Asks the master for its process id.

    Raises:
        InvalidInputError: there is none at that address.
    """
    try:
        proxy: Any = xmlrpc.client.ServerProxy(uri, transport=_Transport())
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
