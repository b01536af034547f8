"""`burg-drake ar`: output, results and exit codes of scripts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.apps import build_parser, main, sigterm_as_interrupt
from burg_drake.apps.commands import ar
from burg_drake.cameras import (
    EventLog,
    FrameProcessor,
    Intrinsics,
    LiveSession,
    ViewActions,
    load_snapshot,
    read_poses,
    save_intrinsics,
    silence_opencv,
)
from burg_drake.scene import load_scene
from tests.apps.ar_views import CAMERA, Camera, photo
from tests.hang_guard import HANG_GUARD

TWO = """\
version: 1
name: two
library: household
instances:
  - {object: box, X_SO: {translation: [0.47, 0.12, 0.0], rpy_deg: [0, 0, 75]}}
  - {object: bowl, X_SO: {translation: [0.2, 0.25, 0.0]}}
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a photo of the board, one without it, a video and intrinsics."""
    folder = tmp_path_factory.mktemp("ar")
    save_intrinsics(CAMERA, folder / "camera.yaml")
    cv2.imwrite(str(folder / "photo.png"), photo()[..., ::-1])
    cv2.imwrite(str(folder / "floor.png"), np.full((240, 320, 3), 90, np.uint8))
    path, codec = str(folder / "video.avi"), cv2.VideoWriter.fourcc(*"MJPG")
    with silence_opencv():
        video = cv2.VideoWriter(path, codec, 20.0, (320, 240))
    for _ in range(4):
        video.write(np.ascontiguousarray(photo()[..., ::-1]))
    video.release()
    return folder


def run(files: Path, *arguments: str) -> int:
    return main(["ar", "tabletop_six", "--intrinsics", str(files / "camera.yaml"), *arguments])


def test_script_with_a_photo(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shot = tmp_path / "shot"
    picture = str(files / "photo.png")
    assert run(files, "--camera", picture, "--no-browser", "--snapshot", str(shot)) == 0
    out = capsys.readouterr().out
    assert "photo.png: 54 of 54 markers, camera within" in out
    # What was saved can be looked at again, and says the same.
    again = ["ar", "tabletop_six", "--camera", str(shot / "image.png"), "--no-browser"]
    again += ["--intrinsics", str(shot / "intrinsics.yaml"), "--snapshot", str(tmp_path / "again")]
    assert main(again) == 0
    first, second = (load_snapshot(folder).document.board for folder in (shot, tmp_path / "again"))
    assert first.X_SC == second.X_SC and first.markers == second.markers
    assert run(files, "--camera", picture, "--no-browser", "--snapshot", str(shot)) == 2
    assert "exists already; choose another name" in capsys.readouterr().err


def test_script_with_a_video(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    video, take = str(files / "video.avi"), tmp_path / "take.mp4"
    code = run(files, "--camera", video, "--no-browser", "--record", str(take), "--plain")
    captured = capsys.readouterr()
    assert code == 0 and "4 of 4 frames gave a pose" in captured.out
    assert f"recorded {take}, 0.2 s" in captured.err
    assert {path.name for path in tmp_path.iterdir()} == {
        "take.mp4",
        "take_plain.mp4",
        "take.csv",
        "take.recording.yaml",
    }


def test_script_without_a_pose(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor = str(files / "floor.png")
    assert run(files, "--camera", floor, "--no-browser", "--check") == 1
    err = capsys.readouterr().err
    assert "burg-drake: no frame gave a pose: " in err and "marker" in err


@pytest.mark.thorough
def test_view_serves_for_a_while(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = run(files, "--camera", str(files / "photo.png"), "--seconds", "0.5")
    out = capsys.readouterr().out
    assert code == 0 and "tabletop_six over " in out and "open http://127.0.0.1:7" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--camera", "{}/none.mp4"], "does not exist"),
        (["--camera", "{}/photo.png", "--record", "a.gif"], "must end in .mp4 or .avi"),
        (["--camera", "{}/photo.png", "--snapshot", "{}"], "exists already; choose another name"),
        (["--camera", "99"], "camera 99 does not open"),
    ],
)
def test_bad_input(
    files: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    code = run(files, "--no-browser", *(word.format(files) for word in arguments))
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert code == 2 and message in err


def test_intrinsics_are_needed_and_must_fit(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = str(files / "photo.png")
    assert main(["ar", "tabletop_six", "--camera", picture, "--no-browser"]) == 2
    assert "needs --intrinsics FILE" in capsys.readouterr().err
    other = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
    save_intrinsics(other, tmp_path / "k.yaml")
    code = main(
        ["ar", "tabletop_six", "--camera", picture, "--intrinsics", str(tmp_path / "k.yaml")]
    )
    assert code == 2
    assert "320 x 240 pixels, but the intrinsics are for 640 x 480" in capsys.readouterr().err


@pytest.mark.thorough
def test_the_end_finishes_the_recording(files: Path, tmp_path: Path) -> None:
    take = tmp_path / "take.mp4"
    command = [sys.executable, "-m", "burg_drake.apps.cli", "ar", "tabletop_six"]
    command += ["--camera", str(files / "video.avi"), "--intrinsics", str(files / "camera.yaml")]
    process = subprocess.Popen(
        [*command, "--record", str(take)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "54 of 54" in line:
            break
    process.send_signal(signal.SIGTERM)
    _, rest = process.communicate(timeout=HANG_GUARD)
    assert process.returncode == 0, rest
    assert "Traceback" not in rest and f"recorded {take}" in rest
    assert cv2.VideoCapture(str(take)).read()[0]
    assert len(read_poses(take.with_suffix(".csv")).times) >= 1


def test_sigterm_is_as_ctrl_c(files: Path) -> None:
    """All later steps are the same, so that the test above needs only one of them."""
    before = signal.getsignal(signal.SIGTERM)
    with sigterm_as_interrupt():
        for each in (signal.SIGTERM, signal.SIGINT):
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(each)
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_recording_replaces_nothing(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, take = tmp_path / "my_scene.yaml", tmp_path / "my_scene.mp4"
    scene.write_text(TWO)
    command = ["ar", str(scene), "--intrinsics", str(files / "camera.yaml"), "--no-browser"]
    command += ["--camera", str(files / "photo.png"), "--record", str(take)]
    assert main(command) == 0
    assert scene.read_text() == TWO
    video = take.read_bytes()
    capsys.readouterr()
    assert main(command) == 2
    told = capsys.readouterr().err
    assert (
        told == f"burg-drake: error: {take} exists already; choose another name for the recording\n"
    )
    assert take.read_bytes() == video


@pytest.mark.thorough
def test_the_end_waits_for_a_placement_check(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(TWO)
    session = FrameProcessor(load_scene(tmp_path / "two.yaml"), CAMERA)
    live = LiveSession(session, Camera(photo()), events=EventLog())
    actions = ViewActions(live, tmp_path)
    live.on_frame(lambda picture: actions.start_check())
    arguments = build_parser().parse_args(["ar", "two", "--no-browser", "--frames", "1"])
    assert ar._run_live_view(arguments, live, actions) == 0
    assert not actions.checking and live.placement is not None


def test_simulated_camera_from_end_to_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All objects stand as in the scene, so that all errors are zero."""
    (tmp_path / "two.yaml").write_text(TWO)
    command = [
        "ar",
        str(tmp_path / "two.yaml"),
        "--camera",
        "sim:panda_tabletop/board",
        "--no-browser",
    ]
    command += ["--frames", "1", "--check", "--snapshot", str(tmp_path / "s")]
    code = main(command)
    out = capsys.readouterr().out
    assert code == 0
    snapshot = load_snapshot(tmp_path / "s")
    assert snapshot.depth is not None and snapshot.document.placement is not None
    placed = snapshot.document.placement.instances.values()
    assert [p.status for p in placed] == ["measured", "measured"]
    assert max(np.hypot(*p.displacement) for p in placed if p.displacement) < 1e-3
    assert out.count("; placed") == 2
