"""The command `burg-drake ros` in a real ROS 2: rclpy and its messages from wheels, over Fast DDS.

`tools/setup/test_programs.sh` installs the wheels, which there are for Python 3.11, in an
environment of their own beside that of the tests.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, inverse, make_pose, rotation_angle, rotation_from_quaternion
from tests.hang_guard import HANG_GUARD
from tests.ros.test_ros1 import camera_info

ROS2_PYTHON = Path(__file__).parents[2] / ".venv-ros2" / "bin" / "python"
CAMERA = Path(__file__).with_name("ros2_camera.py")
NODE = ("ros", "tabletop_six", "--tf-parent", "none")


def environment() -> dict[str, str]:
    """Of both processes: messages stay on this machine, and do not meet those of another test.
    The packages of the running Python come along; those of ROS are in the other environment."""
    packages = [path for path in sys.path if path and Path(path).is_dir()]
    packages = [path for path in packages if path.endswith("-packages") or _has_package(path)]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(packages),
        "ROS_VERSION": "2",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def _has_package(folder: str) -> bool:
    return (Path(folder) / "burg_drake").is_dir()


@pytest.mark.parametrize(("reliability", "images"), [("reliable", 12), ("best_effort", 2)])
def test_a_node_in_a_real_ros(
    tmp_path: Path,
    picture: NDArray[np.uint8],
    intrinsics: Intrinsics,
    X_SC: Array,
    reliability: str,
    images: int,
) -> None:
    """Every image of a reliable camera is answered, although it comes in hundreds of packets."""
    if not ROS2_PYTHON.exists():
        pytest.skip(f"no ROS 2: there is no {ROS2_PYTHON.parents[1].name} (Python 3.11 only)")
    picture_file = tmp_path / "picture.npy"
    np.save(picture_file, picture)
    info = camera_info(intrinsics)
    lower = {k.lower(): [float(v) for v in info[k]] for k in "KDP"}
    plain = {k: v for k, v in info.items() if k not in "KDP"}
    info_file = tmp_path / "info.json"
    info_file.write_text(json.dumps(plain | lower))
    log = tmp_path / "node.log"
    with log.open("w") as out:
        node = subprocess.Popen(
            [ROS2_PYTHON, "-m", "burg_drake.apps.cli", *NODE],
            env=environment(),
            stdout=out,
            stderr=subprocess.STDOUT,
        )
        try:
            shown = subprocess.run(
                [
                    ROS2_PYTHON,
                    CAMERA,
                    tmp_path / "picture.npy",
                    info_file,
                    reliability,
                    str(images),
                    str(HANG_GUARD),
                ],
                env=environment(),
                capture_output=True,
                text=True,
                timeout=2 * HANG_GUARD,  # the camera says first what it waited for
                check=False,
            )
            node.send_signal(signal.SIGINT)
            code = node.wait(HANG_GUARD)
        finally:
            node.kill()
            node.wait()
    told = log.read_text()
    assert shown.returncode == 0, (shown.stderr, told)
    answers = json.loads(shown.stdout)
    assert len(answers) == images
    for answer in answers:
        check_pose(answer, X_SC)
        assert answer["overlay"] == [480, 640, "rgb8"]
    assert code == 0 and "Traceback" not in told
    assert "the board is in sight" in told
    # Images that arrive before the first camera_info have no pose.
    assert re.search(r"images a second, \d+ % with a pose", told)
    assert ("with best-effort" in told) == (reliability == "best_effort")
    if reliability == "reliable":
        assert [answer["sent"] for answer in answers] == [1] * images


def check_pose(answer: dict[str, Any], X_SC: Array) -> None:
    X_error = inverse(X_SC) @ make_pose(rotation_from_quaternion(answer["q_wxyz"]), answer["p"])
    assert answer["frame"] == "board"
    assert np.linalg.norm(X_error[:3, 3]) < 2e-4
    assert rotation_angle(X_error[:3, :3]) < np.radians(0.02)
