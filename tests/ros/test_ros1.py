"""The command `burg-drake ros` in a real ROS 1: master, publishers and listeners are Debian's own.

The other side (`robot.py`) makes and reads images by cv_bridge. Needs Debian's packages of ROS;
`.ci/run` installs them where that is allowed.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics, Overlay
from burg_drake.core import Array, inverse, make_pose, rotation_angle, rotation_from_quaternion
from burg_drake.scene import Scene
from tests.hang_guard import HANG_GUARD

ROBOT = Path(__file__).with_name("robot.py")
DEBIAN = "/usr/bin/python3"
NEEDED = "rospy, rosmaster.master, cv_bridge.boost.cv_bridge_boost, tf2_msgs.msg"
CAMERA = "wrist_camera_optical_frame"


def why_not() -> str:
    """What is missing on this machine for ROS 1, or nothing."""
    if not Path(DEBIAN).exists():
        return f"there is no {DEBIAN}"
    for python, environment, code in (
        (DEBIAN, {}, f"import {NEEDED}"),
        (sys.executable, None, "import burg_drake.ros.distribution as d; d.choose(1)"),
    ):
        tried = subprocess.run(
            [python, "-c", code], capture_output=True, text=True, env=environment, check=False
        )
        if tried.returncode:
            return f"no ROS 1 for {python}: {tried.stderr.strip().splitlines()[-1]}"
    return ""


@dataclass
class Ended:
    """What a node left behind."""

    code: int
    log: str


@dataclass
class Trial:
    """Answers by step and topic, and how the two nodes ended."""

    steps: list[dict[str, Any]]
    nodes: dict[str, Ended]


STEPS = ("bgr8", "rgb8", "rgba8", "mono8", "size", "large", "binned", "empty")
LOST = ("size", "empty")


def camera_info(intrinsics: Intrinsics, scale: int = 1, binning: int = 0) -> dict[str, Any]:
    """Fields of the message for a camera with `scale` times the pixels a side."""
    fx, fy = (scale * f for f in intrinsics.focal)
    cx, cy = (scale * (c + 0.5) - 0.5 for c in intrinsics.center)
    return {
        "width": scale * intrinsics.width,
        "height": scale * intrinsics.height,
        "distortion_model": "plumb_bob",
        "D": intrinsics.distortion,
        "K": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
        "P": [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
        "binning_x": binning,
        "binning_y": binning,
    }


def plan(folder: Path, picture: NDArray[np.uint8], intrinsics: Intrinsics) -> dict[str, Any]:
    """Images in several encodings, one of another size than its camera_info, another resolution,
    merged pixels, and an image without a board."""
    bgr = picture[..., ::-1]
    images = {
        "whole": bgr,
        "large": cv2.resize(bgr, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC),
        "empty": np.full_like(bgr, 120),
    }
    for name, image in images.items():
        cv2.imwrite(str(folder / f"{name}.png"), image)
    shown = {"size": "large"} | {name: name for name in images}
    infos = {
        "large": camera_info(intrinsics, scale=2),
        "binned": camera_info(intrinsics, scale=2, binning=2),
    }
    nodes = ("first", "second")
    told = [f"{node}/status" for node in nodes] + ["first/overlay", "second/overlay/compressed"]
    found = [*told, "first/camera_pose", "second/camera_pose", "tf/board"]
    steps = [
        {
            "stamp": stamp_of(name),
            "image": str(folder / f"{shown.get(name, 'whole')}.png"),
            "encoding": name if name.endswith("8") else "bgr8",
            "camera_info": infos.get(name, camera_info(intrinsics)),
            "frame": CAMERA,
            "text": "no pose" if name in LOST else "markers",
            "wait": told if name in LOST else found,
        }
        for name in STEPS
    ]
    topics = {"image": "/wrist/image_raw", "camera_info": "/wrist/camera_info"}
    return {"topics": topics, "nodes": nodes, "answers": str(folder), "steps": steps}


def stamp_of(name: str) -> list[int]:
    """Seconds and nanoseconds of a step's first image."""
    return [1700000000 + STEPS.index(name), 250000]


def start_node(
    name: str, image: str, options: list[str], environment: dict[str, str], log: TextIO
) -> Any:
    arguments = ["ros", "tabletop_six", "--name", name, "--image", image, *options]
    return subprocess.Popen(
        [sys.executable, "-m", "burg_drake.apps.cli", *arguments],
        env=environment,
        stdout=log,
        stderr=subprocess.STDOUT,
    )


def play(folder: Path, picture: NDArray[np.uint8], intrinsics: Intrinsics) -> Trial:
    """Starts a master and two nodes, plays all steps, and ends the nodes by a signal each."""
    (folder / "plan.json").write_text(json.dumps(plan(folder, picture, intrinsics)))
    ros = {
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder / "home"),
        "ROS_LOG_DIR": str(folder / "log"),
        "PATH": os.environ["PATH"],
    }
    master = subprocess.Popen([DEBIAN, ROBOT, "master"], env=ros, stdout=subprocess.PIPE, text=True)
    children = {"master": master}
    try:
        assert master.stdout is not None
        ros["ROS_MASTER_URI"] = master.stdout.readline().strip()
        with (folder / "first.log").open("w") as first, (folder / "second.log").open("w") as second:
            ours = {**os.environ, **ros}
            children["first"] = start_node("first", "/wrist/image_raw", [], ours, first)
            children["second"] = start_node(
                "second",
                "/wrist/image_raw/compressed",
                ["--frame", "sheet", "--tf-parent", "none"],
                ours,
                second,
            )
            subprocess.run(
                [DEBIAN, ROBOT, "show", folder / "plan.json"],
                env=ros,
                check=True,
                timeout=HANG_GUARD,
            )
            children["first"].send_signal(signal.SIGINT)
            children["second"].send_signal(signal.SIGTERM)
            nodes = {
                name: Ended(children[name].wait(HANG_GUARD), (folder / f"{name}.log").read_text())
                for name in ("first", "second")
            }
    finally:
        for child in children.values():
            child.kill()
            child.wait()
    return Trial(json.loads((folder / "answers.json").read_text()), nodes)


def pose_of(answer: dict[str, Any]) -> Array:
    x, y, z, w = answer["q_xyzw"]
    return make_pose(rotation_from_quaternion([w, x, y, z]), answer["p"])


def step(trial: Trial, name: str) -> dict[str, Any]:
    """Answers of a step; nothing is played after one that failed."""
    number = STEPS.index(name)
    answers = trial.steps[min(number, len(trial.steps) - 1)]
    assert number < len(trial.steps) and "missing" not in answers, (answers, trial.nodes)
    return answers


def stamps(trial: Trial, name: str) -> list[list[int]]:
    """Of the images of a step; no other step has one of them."""
    sent = step(trial, name)["sent"]
    assert sent[0] == stamp_of(name) and len(sent) < 1000
    return sent


WITH_BOARD = [name for name in STEPS if name not in LOST]


@pytest.mark.thorough
def test_two_nodes_in_a_real_ros(
    tmp_path: Path,
    picture: NDArray[np.uint8],
    intrinsics: Intrinsics,
    scene: Scene,
    X_SC: Array,
) -> None:
    """One test for all, so that it is played once, on whatever number of processes."""
    if reason := why_not():
        pytest.skip(reason)
    trial = play(tmp_path, picture, intrinsics)
    for name in WITH_BOARD:
        check_poses(trial, name, X_SC)
        check_board_on_tf(trial, name, X_SC)
    check_overlay(trial, Overlay(scene, intrinsics).draw(picture, X_SC), picture)
    check_compressed_overlay(trial)
    check_what_is_wrong_is_said_and_the_nodes_go_on(trial)
    check_signals_ended_the_nodes_cleanly(trial)


def check_poses(trial: Trial, name: str, X_SC: Array) -> None:
    for node, frame in (("first", "board"), ("second", "sheet")):
        answer = step(trial, name)[f"{node}/camera_pose"]
        assert answer["stamp"] in stamps(trial, name) and answer["frame"] == frame
        X_error = inverse(X_SC) @ pose_of(answer)
        assert np.linalg.norm(X_error[:3, 3]) < 2e-4
        assert rotation_angle(X_error[:3, :3]) < np.radians(0.02)


def check_board_on_tf(trial: Trial, name: str, X_SC: Array) -> None:
    """The camera's frame, which the robot knows, is the parent."""
    answer = step(trial, name)["tf/board"]
    assert answer["stamp"] in stamps(trial, name) and answer["frame"] == CAMERA
    X_error = X_SC @ pose_of(answer)  # X_SC @ X_CS
    assert np.linalg.norm(X_error[:3, 3]) < 2e-4
    assert rotation_angle(X_error[:3, :3]) < np.radians(0.02)


def check_overlay(trial: Trial, expected: NDArray[np.uint8], picture: NDArray[np.uint8]) -> None:
    """The same objects at the same places as where the truth has them."""
    answer = step(trial, "bgr8")["first/overlay"]
    assert answer["stamp"] in stamps(trial, "bgr8") and answer["frame"] == CAMERA
    assert answer["encoding"] == "rgb8"
    received = cv2.imread(answer["image"])[..., ::-1].astype(int)
    assert (expected != picture).any(axis=2).mean() > 0.03
    assert (np.abs(received - expected.astype(int)).max(axis=2) > 16).mean() < 0.005


def check_compressed_overlay(trial: Trial) -> None:
    """The two nodes were shown the same picture, and both of these belong to a pose."""
    answers = step(trial, "bgr8")
    answer = answers["second/overlay/compressed"]
    assert "jpeg" in answer["format"] and answer["frame"] == CAMERA
    assert answer["stamp"] == answers["second/camera_pose"]["stamp"]
    assert answers["first/overlay"]["stamp"] == answers["first/camera_pose"]["stamp"]
    plain, jpeg = (
        cv2.imread(answers[key]["image"]).astype(int)
        for key in ("first/overlay", "second/overlay/compressed")
    )
    assert np.abs(plain - jpeg).mean() < 3.0


def check_what_is_wrong_is_said_and_the_nodes_go_on(trial: Trial) -> None:
    for node in ("first", "second"):
        text = step(trial, "size")[f"{node}/status"]["text"]
        assert (
            text == "no pose: the image has 1280 x 960 pixels, but its camera_info says 640 x 480"
        )
    assert step(trial, "empty")["first/status"]["text"].startswith("no pose: no marker")
    for name in LOST:
        assert step(trial, name)["first/overlay"]["frame"] == CAMERA


def check_signals_ended_the_nodes_cleanly(trial: Trial) -> None:
    for ended in trial.nodes.values():
        assert ended.code == 0, ended.log
        assert "Traceback" not in ended.log
        assert "the board is in sight" in ended.log
