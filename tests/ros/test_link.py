"""Names in the ROS graph, and what is published under them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.ros import BoardNode, MessageClasses, NodeNames, ParentFrame, Publications, Sighting


@pytest.mark.parametrize(
    ("image", "compressed", "info"),
    [
        ("/camera/color/image_raw", False, "/camera/color/camera_info"),
        ("/camera/image_raw/compressed", True, "/camera/camera_info"),
        ("image", False, "camera_info"),
        ("camera/image/compressed", True, "camera/camera_info"),
    ],
)
def test_topics_beside_the_images(image: str, compressed: bool, info: str) -> None:
    names = NodeNames(image=image)
    assert (names.compressed, names.info_topic) == (compressed, info)
    assert NodeNames(image=image, camera_info="/other").info_topic == "/other"


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"image": "/camera image"}, "'/camera image' is not a valid topic name"),
        ({"image": ""}, "'' is not a valid topic name"),
        ({"image": "/image/"}, "'/image/' is not"),
        ({"camera_info": "2/info"}, "'2/info' is not"),
        ({"node": "a/b"}, "node name 'a/b'"),
        ({"board_frame": "/board"}, "tf frame '/board' must not start with /"),
        ({"board_frame": ""}, "tf frame ''"),
    ],
)
def test_what_is_no_name(fields: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        NodeNames(**{"image": "/image"} | fields)


# --- what is published ----------------------------------------------------------------------------


@dataclass
class Graph:
    """Publishers that keep what they are given.

    Attributes:
        listeners: of each topic.
        sent: messages by topic.
    """

    listeners: int = 1
    sent: dict[str, list[Any]] = field(default_factory=dict)

    def publications(self, names: NodeNames, classes: MessageClasses) -> Publications:
        return Publications(names, classes, self.advertise, lambda publisher: self.listeners)

    def advertise(self, topic: str, message_class: type, queue: int) -> Any:
        messages = self.sent.setdefault(topic, [])

        class Publisher:
            def publish(self, message: Any) -> None:
                assert isinstance(message, message_class)
                messages.append(message)

        return Publisher()


@pytest.fixture
def node(scene: Any, intrinsics: Intrinsics) -> BoardNode:
    return BoardNode(scene, intrinsics=intrinsics)


@pytest.fixture
def sighting(
    node: BoardNode,
    picture: NDArray[np.uint8],
    image_message: Callable[..., Any],
    ros2_classes: MessageClasses,
) -> Sighting:
    image = image_message(ros2_classes.octets(picture.tobytes()), (480, 640), "rgb8")
    image.header.stamp = ros2_classes.Image().header.stamp
    return node.locate(image, None)


def test_nobody_listens(node: BoardNode, sighting: Sighting, ros2_classes: MessageClasses) -> None:
    """No overlay is drawn then; and tf is left alone where that is wanted."""
    graph = Graph(listeners=0)
    names = NodeNames(image="/image", parent=ParentFrame.NONE)
    graph.publications(names, ros2_classes).publish(sighting, node.draw)
    assert not graph.sent["~/overlay"] and not graph.sent["~/overlay/compressed"]
    assert len(graph.sent["~/camera_pose"]) == len(graph.sent["~/status"]) == 1
    assert "/tf" not in graph.sent


def test_images_without_a_frame_stay_off_tf(
    node: BoardNode, sighting: Sighting, ros2_classes: MessageClasses
) -> None:
    graph = Graph()
    publications = graph.publications(NodeNames(image="/image"), ros2_classes)
    publications.publish(sighting, node.draw)
    publications.publish(replace(sighting, camera_frame=""), node.draw)
    assert len(graph.sent["~/camera_pose"]) == 2
    ((transform,),) = (message.transforms for message in graph.sent["/tf"])
    assert (transform.header.frame_id, transform.child_frame_id) == ("camera_optical", "board")


def test_tf_needs_its_messages(ros2_classes: MessageClasses) -> None:
    classes = replace(ros2_classes, TFMessage=None)
    with pytest.raises(MissingDependencyError, match=r"tf2_msgs .* parent frame"):
        Graph().publications(NodeNames(image="/image"), classes)
    Graph().publications(NodeNames(image="/image", parent=ParentFrame.NONE), classes)
