"""The node of ROS 2, against a stand-in for rclpy: it shows that the node asks for what rclpy's
documentation offers, not that rclpy does as documented."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras.optics.intrinsics import Intrinsics
from burg_drake.core.arrays import Array
from burg_drake.core.errors import MissingDependencyError
from burg_drake.ros.board_node import BoardNode
from burg_drake.ros.distribution import connect
from burg_drake.ros.link import Names, Parent
from burg_drake.ros.loop import serve
from burg_drake.ros.messages import MessageClasses

try:
    import rclpy as installed
except ImportError:
    installed = None

pytestmark = pytest.mark.skipif(installed is not None, reason="the real rclpy is here")
PACKAGES = {
    "sensor_msgs": ("Image", "CompressedImage", "CameraInfo"),
    "geometry_msgs": ("PoseWithCovarianceStamped", "TransformStamped"),
    "tf2_msgs": ("TFMessage",),
    "std_msgs": ("String",),
}


class ExternalShutdownException(Exception):
    pass


@dataclass(kw_only=True)
class QoSProfile:
    depth: int
    reliability: str = "reliable"


@dataclass
class Publisher:
    message_class: type
    qos: QoSProfile
    listeners: int
    sent: list[Any] = field(default_factory=list)

    def publish(self, message: Any) -> None:
        assert isinstance(message, self.message_class)
        self.sent.append(message)

    def get_subscription_count(self) -> int:
        return self.listeners


@dataclass
class Graph:
    """What the stand-in's node knows: messages to come, and what became of them."""

    to_come: list[tuple[str, Any]] = field(default_factory=list)
    listeners: int = 1
    publishers: dict[str, Publisher] = field(default_factory=dict)
    subscriptions: dict[str, tuple[type, Callable[[Any], None], QoSProfile]] = field(
        default_factory=dict
    )
    log: list[str] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)
    name: str = ""

    def create_publisher(self, message_class: type, topic: str, qos: QoSProfile) -> Publisher:
        publisher = Publisher(message_class, qos, self.listeners)
        self.publishers[topic] = publisher
        return publisher

    def create_subscription(
        self, message_class: type, topic: str, callback: Any, qos: QoSProfile
    ) -> None:
        self.subscriptions[topic] = (message_class, callback, qos)

    def count_publishers(self, topic: str) -> int:
        return int(topic in self.subscriptions)

    def get_logger(self) -> Any:
        return SimpleNamespace(info=self.log.append, warning=self.log.append)

    def destroy_node(self) -> None:
        self.ended.append("node")


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch, ros2_classes: MessageClasses) -> Graph:
    """An installation of ROS 2 in which nothing happens but what the test says."""
    graph = Graph()

    class SingleThreadedExecutor:
        def add_node(self, node: Graph) -> None:
            assert node is graph

        def spin_once(self, timeout_sec: float) -> None:
            assert timeout_sec > 0.0
            if not graph.to_come:
                graph.ended.append("outside")
                raise ExternalShutdownException
            topic, message = graph.to_come.pop(0)
            graph.subscriptions[topic][1](message)

        def shutdown(self) -> None:
            graph.ended.append("executor")

    def create_node(name: str) -> Graph:
        graph.name = name
        return graph

    modules: dict[str, dict[str, Any]] = {
        "rclpy": {
            "init": lambda *, args, signal_handler_options: None,
            "create_node": create_node,
            "ok": lambda: "outside" not in graph.ended,
            "try_shutdown": lambda: graph.ended.append("context"),
        },
        "rclpy.executors": {
            "SingleThreadedExecutor": SingleThreadedExecutor,
            "ExternalShutdownException": ExternalShutdownException,
        },
        "rclpy.qos": {
            "QoSProfile": QoSProfile,
            "ReliabilityPolicy": SimpleNamespace(BEST_EFFORT="best effort"),
        },
        "rclpy.signals": {"SignalHandlerOptions": SimpleNamespace(NO=0)},
    }
    for package, names in PACKAGES.items():
        modules[package] = {}
        modules[f"{package}.msg"] = {name: getattr(ros2_classes, name) for name in names}
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return graph


@pytest.fixture
def messages(
    picture: NDArray[np.uint8],
    intrinsics: Intrinsics,
    image_message: Callable[..., Any],
    info_message: Callable[..., Any],
    ros2_classes: MessageClasses,
) -> list[tuple[str, Any]]:
    """A camera_info and an image, as they come in ROS 2: data are an array."""
    image = image_message(ros2_classes.octets(picture.tobytes()), (480, 640), "rgb8", step=1920)
    image.header.stamp = ros2_classes.Image().header.stamp
    return [("/camera/camera_info", info_message(intrinsics)), ("/camera/image_raw", image)]


def test_from_image_to_tf(graph: Graph, messages: list[Any], scene: Any, X_SC: Array) -> None:
    graph.to_come = messages
    stamp = messages[1][1].header.stamp
    link = connect(2, Names(image="/camera/image_raw"), with_camera_info=True)
    serve(link, BoardNode(scene))
    link.close()

    sent = {topic: publisher.sent for topic, publisher in graph.publishers.items()}
    assert sorted(sent) == ["/tf", "~/camera_pose", "~/overlay", "~/overlay/compressed", "~/status"]
    assert all(len(of_topic) == 1 for of_topic in sent.values())
    position = sent["~/camera_pose"][0].pose.pose.position
    assert [position.x, position.y, position.z] == pytest.approx(X_SC[:3, 3], abs=1e-3)
    (transform,) = sent["/tf"][0].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("camera_optical", "board")
    assert transform.header.stamp is stamp and sent["~/overlay"][0].header.stamp is stamp
    assert " markers, " in sent["~/status"][0].data
    assert graph.name == "burg_board"
    assert "the board is in sight" in graph.log[0]
    assert graph.ended == ["outside", "executor", "node", "context"]


def test_the_latest_image_wins_and_any_camera_is_heard(
    graph: Graph, ros2_classes: MessageClasses
) -> None:
    connect(2, Names(image="/camera/image_raw/compressed"), with_camera_info=True)
    message_class, _, qos = graph.subscriptions["/camera/image_raw/compressed"]
    assert message_class is ros2_classes.CompressedImage
    assert (qos.depth, qos.reliability) == (1, "best effort")
    assert graph.subscriptions["/camera/camera_info"][2].reliability == "best effort"


def test_nobody_listens(graph: Graph, messages: list[Any], scene: Any) -> None:
    """No overlay is drawn then; and tf is left alone where that is wanted."""
    graph.to_come, graph.listeners = messages, 0
    names = Names(image="/camera/image_raw", parent=Parent.NONE)
    serve(connect(2, names, with_camera_info=True), BoardNode(scene))
    assert not graph.publishers["~/overlay"].sent
    assert not graph.publishers["~/overlay/compressed"].sent
    assert graph.publishers["~/camera_pose"].sent
    assert "/tf" not in graph.publishers


def test_images_without_a_frame_stay_off_tf(graph: Graph, messages: list[Any], scene: Any) -> None:
    messages[1][1].header.frame_id = ""
    graph.to_come = messages
    serve(connect(2, Names(image="/camera/image_raw"), with_camera_info=True), BoardNode(scene))
    assert graph.publishers["~/camera_pose"].sent and not graph.publishers["/tf"].sent


def test_a_package_of_messages_is_missing(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)
    with pytest.raises(MissingDependencyError, match=r"tf2_msgs.*For ROS 2 source"):
        connect(2, Names(image="/camera/image_raw"), with_camera_info=True)


def test_every_message_class_is_in_a_package() -> None:
    named = {name for names in PACKAGES.values() for name in names}
    assert named == {f.name for f in fields(MessageClasses)} - {"octets"}
