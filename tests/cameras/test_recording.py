"""Recordings, read back with OpenCV."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    BoardEstimate,
    CheckedScene,
    Intrinsics,
    Recording,
    RecordingDocument,
    read_poses,
    silence_opencv,
)
from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    load_document,
    make_pose,
    rotation_from_rpy,
)

CAMERA = Intrinsics(width=64, height=48, focal=(60.0, 60.0), center=(31.5, 23.5))
SCENE = CheckedScene(name="two", content="abc")
X_SC = make_pose(rotation_from_rpy((2.8, 0.1, 0.7)), (0.3, -0.2, 0.6))
SEEN = BoardEstimate(X_SC=X_SC, valid=True, reprojection_error=0.07, ids=(3, 4, 17))


def plate(level: int) -> np.ndarray:
    """A picture whose red says which one it is; green and blue tell if channels are swapped."""
    return np.full((48, 64, 3), (level, 20, 200), dtype=np.uint8)


def levels(path: Path) -> list[int]:
    """Red of every frame of a video."""
    with silence_opencv():
        capture, found = cv2.VideoCapture(str(path)), []
    while (frame := capture.read())[0]:
        assert frame[1].shape == (48, 64, 3)
        blue, green, red = frame[1].mean(axis=(0, 1))
        assert abs(green - 20) < 12 and abs(blue - 200) < 12
        found.append(round(red / 10) * 10)
    return found


@pytest.mark.parametrize("suffix", [".mp4", ".avi"])
def test_pictures_stand_as_long_as_they_did(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"take{suffix}"
    recording = Recording(
        path, CAMERA, SCENE, source="camera 0", frames_per_second=10.0, plain=True
    )
    for time, level in ((7.0, 50), (7.1, 100), (7.5, 150), (7.6, 200)):
        recording.add(plate(level), SEEN, time, plate(level + 10))
    assert not path.exists()
    assert recording.close() == path
    assert levels(path) == [50, 100, 100, 100, 100, 150, 200]
    assert levels(tmp_path / f"take_plain{suffix}") == [60, 110, 110, 110, 110, 160, 210]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [f"take{suffix}", f"take_plain{suffix}", "take.csv", "take.recording.yaml"]
    )
    document = load_document(tmp_path / "take.recording.yaml", RecordingDocument)
    assert document.video == path.name and document.plain == f"take_plain{suffix}"
    assert document.intrinsics == CAMERA and document.scene == SCENE


def test_poses(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.mp4", CAMERA, SCENE, frames_per_second=10.0)
    recording.add(plate(50), SEEN, 0.0, plate(50))
    recording.add(plate(50), BoardEstimate(reason='no "board", here'), 0.3, plate(50))
    recording.add(plate(50), SEEN, 0.4, plate(50))
    recording.close()
    poses = read_poses(tmp_path / "a.csv")
    assert poses.frames.tolist() == [0, 3, 4]
    assert np.allclose(poses.times, [0.0, 0.3, 0.4])
    assert np.allclose(poses.X_SC[[0, 2]], X_SC, atol=1e-8)
    assert np.isnan(poses.X_SC[1]).all()


def test_faster_than_the_video_loses_nothing(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.avi", CAMERA, SCENE, frames_per_second=10.0)
    for i in range(6):
        recording.add(plate(40 * i), SEEN, 0.01 * i, plate(0))
    recording.close()
    assert levels(tmp_path / "a.avi") == [0, 40, 80, 120, 160, 200]


def test_a_long_pause_is_cut(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.avi", CAMERA, SCENE, frames_per_second=10.0)
    recording.add(plate(50), SEEN, 0.0, plate(0))
    recording.add(plate(100), SEEN, 3600.0, plate(0))
    recording.close()
    assert levels(tmp_path / "a.avi") == [50] * 20 + [100]


def test_nothing_recorded_leaves_nothing(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.mp4", CAMERA, SCENE, plain=True)
    assert recording.close() is None
    assert recording.close() is None
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_video_is_reported(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.avi", CAMERA, SCENE)
    for i in range(5):
        recording.add(plate(50), SEEN, 0.1 * i, plate(0))
    (tmp_path / ".a.partial.avi").unlink()  # as a full disk would, in the end
    with pytest.raises(InvalidInputError, match=r"has 0 of the 13 recorded frames"):
        recording.close()
    assert not (tmp_path / "a.avi").exists() and not (tmp_path / "a.csv").exists()


def test_bad_places(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"a\.webm: .* must end in \.mp4 or \.avi"):
        Recording(tmp_path / "a.webm", CAMERA, SCENE)
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="choose a writable place"):
        Recording(tmp_path / "file" / "a.mp4", CAMERA, SCENE)
    (tmp_path / "b.csv").write_text("a,b\n1,2\n")
    with pytest.raises(DocumentError, match=r"b\.csv is not the table of a recording"):
        read_poses(tmp_path / "b.csv")


def record(path: Path, **options: Any) -> Path | None:
    recording = Recording(path, CAMERA, SCENE, **options)
    recording.add(plate(50), SEEN, 0.0, plate(0))
    return recording.close()


def test_a_scene_of_the_same_name_stays(tmp_path: Path) -> None:
    scene = tmp_path / "my_scene.yaml"
    scene.write_text("name: mine")
    assert record(tmp_path / "my_scene.mp4") == tmp_path / "my_scene.mp4"
    assert scene.read_text() == "name: mine"


@pytest.mark.parametrize(
    "name",
    ["a.mp4", "a_plain.mp4", "a.csv", "a.recording.yaml", ".a.partial.mp4", ".a.partial.csv"],
)
def test_no_file_is_replaced(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(InvalidInputError, match="exists already; choose another name") as raised:
        record(tmp_path / "a.mp4", plain=True)
    assert str(raised.value).startswith(str(tmp_path / name))
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_a_file_that_is_made_meanwhile_stays(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "a.avi", CAMERA, SCENE)
    recording.add(plate(50), SEEN, 0.0, plate(0))
    (tmp_path / "a.csv").write_text("mine")
    with pytest.raises(InvalidInputError, match=r"a\.csv .*\.a\.partial\.avi"):
        recording.close()
    assert (tmp_path / "a.csv").read_text() == "mine" and not (tmp_path / "a.avi").exists()
    assert levels(tmp_path / ".a.partial.avi") == [50]


def test_what_cannot_be_begun_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"64 x 48 pixels at 90000 frames per second"):
        record(tmp_path / "a.mp4", frames_per_second=90000.0)
    assert list(tmp_path.iterdir()) == []


QUIET = """\
import sys
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.image_files import silence_opencv
from burg_drake.cameras.placement.document import CheckedScene
from burg_drake.cameras.recording import Recording
from burg_drake.cameras.source_opening import open_source
from burg_drake.core.errors import InvalidInputError

camera = Intrinsics(width=64, height=48, focal=(60.0, 60.0), center=(31.5, 23.5))
scene = CheckedScene(name="two", content="abc")
for begin in (
    lambda: Recording(sys.argv[1] + "/a.mp4", camera, scene, frames_per_second=90000.0),
    lambda: open_source("http://127.0.0.1:9/none.mjpg"),
):
    try:
        begin()
    except InvalidInputError as error:
        print(error)
"""


def test_nothing_but_errors_of_ours_is_said(tmp_path: Path) -> None:
    """In a process that records before it opens a camera: FFmpeg decides at its first use how much
    it writes to the terminal."""
    command = [sys.executable, "-c", QUIET, str(tmp_path)]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("OPENCV_")}
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ended.stderr == ""
    first, second = ended.stdout.splitlines()
    assert "OpenCV cannot encode" in first and "does not open" in second
