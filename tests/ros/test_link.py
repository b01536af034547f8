"""Names in the ROS graph."""

from __future__ import annotations

from typing import Any

import pytest

from burg_drake.core.errors import InvalidInputError
from burg_drake.ros.link import Names


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
    names = Names(image=image)
    assert (names.compressed, names.info_topic) == (compressed, info)
    assert Names(image=image, camera_info="/other").info_topic == "/other"


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"image": "/camera image"}, "'/camera image' is not the name of a topic"),
        ({"image": ""}, "'' is not the name of a topic"),
        ({"image": "/image/"}, "'/image/' is not"),
        ({"camera_info": "2/info"}, "'2/info' is not"),
        ({"node": "a/b"}, "node name 'a/b'"),
        ({"board_frame": "/board"}, "tf frame '/board' must not start with /"),
        ({"board_frame": ""}, "tf frame ''"),
    ],
)
def test_what_is_no_name(fields: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        Names(**{"image": "/image"} | fields)
