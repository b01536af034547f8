"""Choose between ROS 1 and ROS 2, and start the node."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.core import MissingDependencyError

if TYPE_CHECKING:
    from burg_drake.ros.ros_node import NodeNames, RosNode

CLIENT_LIBRARIES = {1: "rospy", 2: "rclpy"}  # Python client library of each version of ROS.
SYSTEM_PACKAGES = Path("/usr/lib/python3/dist-packages")
"""Python packages of Debian and Ubuntu (rospy), which virtual environments do not see."""
ROS_1_HINT = (
    "for ROS 1 source /opt/ros/noetic/setup.bash or, on Debian, run: sudo apt-get install"
    " python3-rospy python3-sensor-msgs python3-geometry-msgs python3-tf2-msgs"
)
ROS_2_HINT = (
    "for ROS 2 source /opt/ros/jazzy/setup.bash, and install burg_drake for the same Python; or, on"
    " Linux with Python 3.11, run: pip install 'ros-rclpy[fastrtps]' ros-sensor-msgs"
    " ros-geometry-msgs ros-std-msgs"
)


def choose_distribution(wanted: int | None, environment: Mapping[str, str] = os.environ) -> int:
    """Chooses ROS 1 or 2: the requested one, else the one whose set-up script was sourced, else the
    one whose client library can be imported.

    As a last resort, Debian's package folder is appended to the path: ROS's pure Python packages
    are found there, and this environment's packages come first.

    Args:
        wanted: 1, 2 or None.
        environment: environment variables.

    Raises:
        MissingDependencyError: the client library cannot be imported; the message says why and what
            to install.
    """
    version_variable = environment.get("ROS_VERSION", "")
    order = sorted(CLIENT_LIBRARIES, key=lambda version: str(version) != version_variable)
    if wanted:
        order = [wanted]
    failures = []
    for version in order:
        failure = _try_import(CLIENT_LIBRARIES[version])
        if failure is None:
            return version
        failures.append(failure)
    raise MissingDependencyError(f"{'; '.join(failures)}. {_installation_hint(order)}")


def start_ros_node(version: int, names: NodeNames, *, with_camera_info: bool) -> RosNode:
    """Starts the node; `Ros1Node` and `Ros2Node` document further errors.

    Raises:
        MissingDependencyError: message packages are not installed.
    """
    try:
        from burg_drake.ros.node_implementations import Ros1Node, Ros2Node

        return (Ros1Node if version == 1 else Ros2Node)(names, with_camera_info=with_camera_info)
    except MissingDependencyError:
        raise
    except ImportError as error:
        raise MissingDependencyError(f"{error}. {_installation_hint([version])}") from error


def _try_import(name: str) -> str | None:
    """Tries to import a module; returns the error, or None."""
    try:
        importlib.import_module(name)
        return None
    except ImportError as error:
        failure = str(error)
    if not SYSTEM_PACKAGES.is_dir() or str(SYSTEM_PACKAGES) in sys.path:
        return failure
    sys.path.append(str(SYSTEM_PACKAGES))
    second_failure = _try_import(name)
    if second_failure is not None:
        sys.path.remove(str(SYSTEM_PACKAGES))
    return second_failure


def _installation_hint(versions: Sequence[int]) -> str:
    hints = {1: ROS_1_HINT, 2: ROS_2_HINT}
    text = "; ".join(hints[version] for version in versions)
    return text[0].upper() + text[1:]
