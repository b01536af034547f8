"""Which ROS is chosen, and what is said where there is none."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

from burg_drake.apps import cli
from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.ros import distribution, node_implementations


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Neither rospy nor rclpy can be imported; the folder takes the place of Debian's packages."""
    for name in distribution.CLIENT_LIBRARIES.values():
        monkeypatch.delitem(sys.modules, name, raising=False)
    own = [folder for folder in sys.path if "dist-packages" not in folder and "ros" not in folder]
    monkeypatch.setattr(sys, "path", own)
    monkeypatch.setattr(distribution, "SYSTEM_PACKAGES", tmp_path)
    return tmp_path


def package(folder: Path, name: str, content: str = "") -> None:
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text(content)


@pytest.mark.parametrize(
    ("wanted", "text"),
    [
        (1, "No module named 'rospy'. For ROS 1 source .* apt-get install python3-rospy"),
        (2, "No module named 'rclpy'. For ROS 2 source /opt/ros/jazzy/setup.bash"),
        (None, "No module named 'rospy'; No module named 'rclpy'. For ROS 1 .*; for ROS 2 "),
    ],
)
def test_none(nowhere: Path, wanted: int | None, text: str) -> None:
    with pytest.raises(MissingDependencyError, match=text):
        distribution.choose_distribution(wanted, {})


def test_the_command_says_what_to_install(
    nowhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["ros", "tabletop_six"]) == 2
    assert "apt-get install python3-rospy" in capsys.readouterr().err


def test_debians_packages_come_last_on_the_path(nowhere: Path) -> None:
    package(nowhere, "rospy")
    package(nowhere, "numpy")
    assert distribution.choose_distribution(None, {}) == 1
    assert sys.path[-1] == str(nowhere)


def test_sourced_set_up_decides(nowhere: Path) -> None:
    package(nowhere, "rospy")
    package(nowhere, "rclpy")
    assert distribution.choose_distribution(None, {"ROS_VERSION": "2"}) == 2
    assert distribution.choose_distribution(None, {"ROS_VERSION": "1"}) == 1
    assert distribution.choose_distribution(1, {"ROS_VERSION": "2"}) == 1


def test_rclpy_of_another_python(nowhere: Path) -> None:
    package(nowhere, "rclpy", "import rclpy._rclpy_pybind11")
    with pytest.raises(MissingDependencyError, match=r"_rclpy_pybind11.*for the same Python"):
        distribution.choose_distribution(2, {})


def test_no_master() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        uri = f"http://127.0.0.1:{free.getsockname()[1]}"
        with pytest.raises(
            InvalidInputError, match=rf"no ROS master at {uri} \(.*refused\); start"
        ):
            node_implementations.require_master(uri)


def test_what_is_no_master(monkeypatch: pytest.MonkeyPatch) -> None:
    """Something listens, and never answers."""
    monkeypatch.setattr(node_implementations, "MASTER_TIMEOUT", 0.1)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(InvalidInputError, match="timed out"):
            node_implementations.require_master(f"http://127.0.0.1:{silent.getsockname()[1]}")


@pytest.mark.parametrize("uri", ["", "master:11311", "http://"])
def test_address_that_is_none(uri: str) -> None:
    with pytest.raises(InvalidInputError, match="no ROS master at"):
        node_implementations.require_master(uri)
