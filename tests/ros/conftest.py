"""Camera and board that the tests of the node share, and messages without ROS."""

from __future__ import annotations

import array
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, grasp_from_axes
from burg_drake.ros import MessageClasses
from burg_drake.scene import Scene, load_scene
from tests.cameras.synthetic import board_image

INTRINSICS = Intrinsics(
    width=640,
    height=480,
    focal=(612.0, 610.0),
    center=(322.5, 238.0),
    distortion=(0.06, -0.12, 0.0008, -0.0005, 0.02),
)
STAMP = SimpleNamespace(secs=12, nsecs=345)


@pytest.fixture(scope="session")
def scene() -> Scene:
    """The built-in one."""
    return load_scene("tabletop_six")


@pytest.fixture(scope="session")
def X_SC() -> Array:
    """A camera 0.7 m above the board, looking at it askew."""
    forward = np.array([0.15, 0.35, -0.9]) / np.linalg.norm([0.15, 0.35, -0.9])
    right = np.cross(forward, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(forward, [0.0, 0.0, 1.0]))
    eye = np.array([0.297, 0.21, 0.0]) - 0.7 * forward
    return grasp_from_axes(right, forward, eye)


@pytest.fixture(scope="session")
def picture(scene: Scene, X_SC: Array) -> NDArray[np.uint8]:
    """What the camera sees: (480, 640, 3) RGB."""
    return board_image(scene.board, INTRINSICS, X_SC)


@pytest.fixture(scope="session")
def intrinsics() -> Intrinsics:
    """Of that camera, with a lens that distorts."""
    return INTRINSICS


@pytest.fixture
def image_message() -> Callable[..., Any]:
    """Makes a `sensor_msgs/Image` as far as its fields go; see `_image_message`."""
    return _image_message


@pytest.fixture
def info_message() -> Callable[..., Any]:
    """Makes a `sensor_msgs/CameraInfo` as far as its fields go; see `_info_message`."""
    return _info_message


def _image_message(data: bytes, shape: tuple[int, int], encoding: str, **fields: Any) -> Any:
    """Of 12.000000345 s; rows without padding unless `step` is given."""
    height, width = shape
    return SimpleNamespace(
        **{
            "header": SimpleNamespace(stamp=STAMP, frame_id="camera_optical"),
            "height": height,
            "width": width,
            "encoding": encoding,
            "is_bigendian": 0,
            "step": len(data) // height if height else 0,
            "data": data,
        }
        | fields
    )


def _info_message(intrinsics: Intrinsics, **fields: Any) -> Any:
    """With the names that the fields have in ROS 2."""
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    whole = SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0, do_rectify=False)
    return SimpleNamespace(
        **{
            "header": SimpleNamespace(stamp=STAMP, frame_id="camera_optical"),
            "width": intrinsics.width,
            "height": intrinsics.height,
            "distortion_model": "plumb_bob",
            "d": list(intrinsics.distortion),
            "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            "p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            "binning_x": 0,
            "binning_y": 0,
            "roi": whole,
        }
        | fields
    )


def _strict(name: str, **fields: Callable[[], Any]) -> type:
    """A message class that checks its fields as the generated ones of ROS 2 do.

    Args:
        name: of the class.
        fields: what makes the initial value of each; values assigned later have its type, lists
            its length (unless that is 0) and the type of its items, arrays its typecode.
    """

    def start(self: Any) -> None:
        for field, make in fields.items():
            object.__setattr__(self, field, make())

    def assign(self: Any, field: str, value: Any) -> None:
        assert field in fields, f"{name} has no field {field}"
        initial = fields[field]()
        assert isinstance(value, type(initial)), f"{name}.{field} = {value!r}"
        if isinstance(initial, array.array):
            assert value.typecode == initial.typecode
        if isinstance(initial, list) and initial:
            assert len(value) == len(initial)
            assert all(isinstance(item, type(initial[0])) for item in value)
        object.__setattr__(self, field, value)

    return type(name, (), {"__init__": start, "__setattr__": assign})


@pytest.fixture(scope="session")
def ros2_classes() -> MessageClasses:
    """Stand-ins for the messages of ROS 2, after their definitions in `common_interfaces`."""

    def octets() -> array.array:
        return array.array("B")

    time = _strict("Time", sec=int, nanosec=int)
    header = _strict("Header", stamp=time, frame_id=str)
    vector = _strict("Vector3", x=float, y=float, z=float)
    rotation = _strict("Quaternion", x=float, y=float, z=float, w=float)
    pose = _strict("Pose", position=vector, orientation=rotation)
    uncertain = _strict("PoseWithCovariance", pose=pose, covariance=lambda: [0.0] * 36)
    transform = _strict("Transform", translation=vector, rotation=rotation)
    image = {"height": int, "width": int, "encoding": str, "is_bigendian": int, "step": int}
    return MessageClasses(
        Image=_strict("Image", header=header, data=octets, **image),
        CompressedImage=_strict("CompressedImage", header=header, format=str, data=octets),
        CameraInfo=_strict("CameraInfo"),
        PoseWithCovarianceStamped=_strict(
            "PoseWithCovarianceStamped", header=header, pose=uncertain
        ),
        TransformStamped=_strict(
            "TransformStamped", header=header, child_frame_id=str, transform=transform
        ),
        TFMessage=_strict("TFMessage", transforms=list),
        String=_strict("String", data=str),
        octets=lambda data: array.array("B", data),
    )
