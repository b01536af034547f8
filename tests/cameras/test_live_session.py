"""A running session over real videos and images."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    EventLog,
    Frame,
    FrameProcessor,
    FrameReader,
    FrameSource,
    LiveSession,
    ViewActions,
    ViewSettings,
    open_source,
    read_poses,
    silence_opencv,
    source_opening,
)
from burg_drake.core import InvalidInputError, UnknownNameError
from burg_drake.scene import Scene, load_scene
from tests.cameras.live_views import CAMERA, Pictures, camera_at, lines
from tests.cameras.synthetic import board_image
from tests.hang_guard import HANG_GUARD, until


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def session(scene: Scene) -> FrameProcessor:
    return FrameProcessor(scene, CAMERA)


@pytest.fixture(scope="module")
def image(scene: Scene) -> np.ndarray:
    return board_image(scene.board, CAMERA, camera_at(0.3))


@pytest.fixture(scope="module")
def video(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames at 20 a second; in the third and fourth the board is hidden."""
    path = tmp_path_factory.mktemp("video") / "board.avi"
    with silence_opencv():
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240))
    for i in range(6):
        picture = np.zeros((240, 320, 3), np.uint8)
        if i not in (2, 3):
            picture = board_image(scene.board, CAMERA, camera_at(0.28 + 0.005 * i))
        writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()
    return path


@pytest.fixture
def live(session: FrameProcessor) -> Iterator[Callable[..., LiveSession]]:
    """Makes sessions, which are closed in the end."""
    made: list[LiveSession] = []

    def make(source: FrameSource, **options: object) -> LiveSession:
        options.setdefault("events", EventLog())
        made.append(LiveSession(session, source, **options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_every_frame_of_a_video_is_looked_at(
    live: Callable[..., LiveSession], video: Path, tmp_path: Path
) -> None:
    running = live(open_source(video), paced=False)
    actions = ViewActions(running, tmp_path)
    actions.start_recording(tmp_path / "take.avi")
    with pytest.raises(InvalidInputError, match="is being recorded; stop that first"):
        actions.start_recording()
    running.start()
    running.wait(seconds=HANG_GUARD)
    assert running.counts.frames == 6 and running.counts.valid == 4
    assert actions.stop_recording() == tmp_path / "take.avi"
    assert actions.stop_recording() is None
    poses = read_poses(tmp_path / "take.csv")
    assert poses.frames.tolist() == list(range(6))
    assert np.allclose(poses.times, np.arange(6) / 20.0)
    there = [0, 1, 4, 5]
    assert np.isnan(poses.X_SC[[2, 3]]).all()
    assert np.allclose(poses.X_SC[there, 0, 3], 0.28 + 0.005 * np.array(there), atol=2e-3)


def test_a_camera_that_nobody_looks_at_is_left_alone(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    """No frame is read until somebody asks, who gets one that was taken since."""

    class Camera(Pictures):
        def read(self) -> Frame | None:
            time.sleep(0.002)
            return super().read()

    source = Camera(*[image] * 10_000, live=True)
    running = live(source, idle_after=0.0)
    actions = ViewActions(running, tmp_path)
    running.start()
    until(lambda: running.picture is not None and running.reader.is_empty)

    def given_at_rest() -> int:
        until(lambda: running.is_idle and not running._busy)
        before = source.given
        time.sleep(0.05)
        assert source.given <= before + 1  # one may have been on its way
        return source.given

    given_at_rest()
    old = running.picture
    assert old is not None
    seen = running.next_picture(0, HANG_GUARD)
    assert seen is not None and seen.number > old.number
    given_at_rest()
    newest = running.picture
    actions.snapshot()
    assert running.picture is not newest
    at_rest = given_at_rest()
    actions.start_recording()
    until(lambda: source.given > at_rest + 5)  # all frames are looked at
    actions.stop_recording()
    given_at_rest()


def test_so_many_frames(live: Callable[..., LiveSession], video: Path) -> None:
    running = live(open_source(video), paced=False)
    running.start(frames=2)
    running.wait(seconds=HANG_GUARD)
    assert running.counts.frames == 2


def test_settings_draw_the_same_frame_again(
    live: Callable[..., LiveSession], image: np.ndarray
) -> None:
    running = live(Pictures(image))
    running.start()
    first = running.next_picture(0, HANG_GUARD)
    assert first is not None
    running.change(opacity=0.0, names=False)
    second = running.next_picture(first.number, HANG_GUARD)
    assert second is not None and second.located is first.located
    assert (second.overlay != first.overlay).any()
    assert running.counts.frames == 1
    with pytest.raises(UnknownNameError):
        running.change(guide="nothing")
    with pytest.raises(InvalidInputError, match="setting 'colour' does not exist; known: foot"):
        running.change(colour="red")
    with pytest.raises(InvalidInputError, match="opacity"):
        running.change(opacity="much")


def test_frozen(live: Callable[..., LiveSession], image: np.ndarray) -> None:
    source = Pictures(*[image] * 12)
    running = live(source, settings=ViewSettings(frozen=True), paced=False)
    running.start()
    assert running.next_picture(0, HANG_GUARD) is not None  # there must be one to freeze
    running.change(opacity=0.1)
    assert running.next_picture(1, HANG_GUARD) is not None
    assert running.counts.frames == 1 and source.given <= 3
    running.change(frozen=False)
    running.wait(seconds=HANG_GUARD)
    assert running.counts.frames == 12


def test_a_live_source_gives_its_newest_frame(image: np.ndarray) -> None:
    reader = FrameReader(
        Pictures(*[image] * 9, live=True),
        paced=True,
        changed=threading.Condition(),
        events=EventLog(),
    )
    reader.start()
    until(lambda: reader.state == "ended")
    newest = reader.take()
    assert newest is not None and newest.name == "picture 9"
    assert reader.take() is None
    reader.close()


def test_one_image_of_another_size_is_left_out(
    live: Callable[..., LiveSession], image: np.ndarray
) -> None:
    log = EventLog()
    running = live(Pictures(image, image[:-2], image), events=log, paced=False)
    running.start()
    running.wait(seconds=HANG_GUARD)
    assert running.counts.frames == 3 and running.counts.valid == 2
    (told,) = [line for line in lines(log) if "left out" in line]
    assert told.startswith("picture 2 has 320 x 238 pixels, but the intrinsics are for 320 x 240")


def test_another_resolution_is_refused(session: FrameProcessor, video: Path) -> None:
    other = FrameProcessor(session.scene, replace(CAMERA, width=640))
    source = open_source(video)
    with pytest.raises(InvalidInputError, match=r"320 x 240.*640"):
        LiveSession(other, source, events=EventLog())
    source.close()


def test_a_lost_camera_is_told_once_and_comes_back(
    live: Callable[..., LiveSession], video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """OpenCV reads the video as it reads a camera; at its end the camera is gone for a while."""
    monkeypatch.setattr(source_opening, "FRAME_TIMEOUT", 0.05)
    monkeypatch.setattr(source_opening, "MIN_REOPEN_INTERVAL", 0.05)
    gone = [True]

    def plug_in() -> cv2.VideoCapture | None:
        return None if gone[0] else cv2.VideoCapture(str(video))

    gone[0] = False
    source = source_opening.DeviceSource("camera 7", plug_in)
    gone[0] = True
    log = EventLog()
    running = live(source, events=log)
    running.start()
    until(lambda: running.reader.state == "lost")
    assert "camera 7" in running.reader.fault
    until(lambda: running.picture)
    before = running.picture
    assert before is not None
    running.change(opacity=0.2)  # the view goes on with its last picture
    assert running.next_picture(before.number, HANG_GUARD) is not None
    time.sleep(0.3)  # some more vain attempts
    assert len([line for line in lines(log) if "waiting for it" in line]) == 1
    gone[0] = False
    until(lambda: "camera 7 is back" in lines(log))
    after = running.counts.frames
    until(lambda: running.counts.frames > after)


def test_what_ends_a_thread_is_raised(live: Callable[..., LiveSession], image: np.ndarray) -> None:
    class Broken(Pictures):
        def read(self) -> Frame | None:
            raise ZeroDivisionError("in the driver")

    running = live(Broken(image))
    running.start()
    with pytest.raises(ZeroDivisionError, match="in the driver"):
        running.wait(seconds=HANG_GUARD)
