"""A running session over real videos and images, and what viewers can have made of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.cameras import sources_device
from burg_drake.cameras.event_log import EventLog
from burg_drake.cameras.frame_reader import FrameReader
from burg_drake.cameras.frame_source import Frame, FrameSource
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.live_session import LiveSession
from burg_drake.cameras.opencv_log import quiet
from burg_drake.cameras.recorded_poses import read_poses
from burg_drake.cameras.recording import Recording
from burg_drake.cameras.session import (
    Session,
    ViewSettings,
)
from burg_drake.cameras.snapshot import load_snapshot
from burg_drake.cameras.sources import open_source
from burg_drake.cameras.synthetic import board_image
from burg_drake.cameras.view_actions import ViewActions
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.frames import make_pose
from burg_drake.scene.scene import Scene, load_scene

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
TIMEOUT = 30.0


def camera_at(x: float) -> np.ndarray:
    """Straight above the board."""
    return make_pose(np.diag([1.0, -1.0, -1.0]), (x, 0.21, 0.6))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def session(scene: Scene) -> Session:
    return Session(scene, CAMERA)


@pytest.fixture(scope="module")
def image(scene: Scene) -> np.ndarray:
    return board_image(scene.board, CAMERA, camera_at(0.3))


@pytest.fixture(scope="module")
def video(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames at 20 a second; in the third and fourth the board is hidden."""
    path = tmp_path_factory.mktemp("video") / "board.avi"
    with quiet():
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240))
    for i in range(6):
        picture = np.zeros((240, 320, 3), np.uint8)
        if i not in (2, 3):
            picture = board_image(scene.board, CAMERA, camera_at(0.28 + 0.005 * i))
        writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()
    return path


@pytest.fixture
def live(session: Session) -> Iterator[Callable[..., LiveSession]]:
    """Makes sessions, which are closed in the end."""
    made: list[LiveSession] = []

    def make(source: FrameSource, **options: object) -> LiveSession:
        options.setdefault("events", EventLog())
        made.append(LiveSession(session, source, **options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for each in made:
        each.close()


def until(condition: Callable[[], object]) -> None:
    """Waits for other threads; a test that waits in vain fails."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def lines(log: EventLog) -> list[str]:
    return [event.text for event in log.after(0)]


class Pictures(FrameSource):
    """Any frames, as fast as they are taken."""

    def __init__(self, *images: np.ndarray, live: bool = False) -> None:
        self.name, self.live, self.size, self.images = "pictures", live, (320, 240), list(images)
        self.given = 0

    def read(self) -> Frame | None:
        if self.given == len(self.images):
            return None
        self.given += 1
        return Frame(self.images[self.given - 1], None, 1.0 * self.given, f"picture {self.given}")

    def close(self) -> None:
        self.given = len(self.images)


def test_every_frame_of_a_video_is_looked_at(
    live: Callable[..., LiveSession], video: Path, tmp_path: Path
) -> None:
    running = live(open_source(video), paced=False)
    actions = ViewActions(running, tmp_path)
    actions.start_recording(tmp_path / "take.avi")
    with pytest.raises(InvalidInputError, match="is being recorded; stop that first"):
        actions.start_recording()
    running.start()
    running.wait(seconds=TIMEOUT)
    assert running.counts.frames == 6 and running.counts.valid == 4
    assert actions.stop_recording() == tmp_path / "take.avi"
    assert actions.stop_recording() is None
    poses = read_poses(tmp_path / "take.csv")
    assert poses.frames.tolist() == list(range(6))
    assert np.allclose(poses.times, np.arange(6) / 20.0)
    there = [0, 1, 4, 5]
    assert np.isnan(poses.X_SC[[2, 3]]).all()
    assert np.allclose(poses.X_SC[there, 0, 3], 0.28 + 0.005 * np.array(there), atol=2e-3)


def test_so_many_frames(live: Callable[..., LiveSession], video: Path) -> None:
    running = live(open_source(video), paced=False)
    running.start(frames=2)
    running.wait(seconds=TIMEOUT)
    assert running.counts.frames == 2


def test_settings_draw_the_same_frame_again(
    live: Callable[..., LiveSession], image: np.ndarray
) -> None:
    running = live(Pictures(image))
    running.start()
    first = running.next_picture(0, TIMEOUT)
    assert first is not None
    running.change(opacity=0.0, names=False)
    second = running.next_picture(first.number, TIMEOUT)
    assert second is not None and second.sight is first.sight
    assert (second.overlay != first.overlay).any()
    assert running.counts.frames == 1
    with pytest.raises(UnknownNameError):
        running.change(guide="nothing")
    with pytest.raises(InvalidInputError, match="no setting 'colour'; known: footprints"):
        running.change(colour="red")
    with pytest.raises(InvalidInputError, match="opacity"):
        running.change(opacity="much")


def test_frozen(live: Callable[..., LiveSession], image: np.ndarray) -> None:
    source = Pictures(*[image] * 12)
    running = live(source, settings=ViewSettings(frozen=True), paced=False)
    running.start()
    assert running.next_picture(0, TIMEOUT) is not None  # there must be one to freeze
    running.change(opacity=0.1)
    assert running.next_picture(1, TIMEOUT) is not None
    assert running.counts.frames == 1 and source.given <= 3
    running.change(frozen=False)
    running.wait(seconds=TIMEOUT)
    assert running.counts.frames == 12


def test_a_live_source_gives_its_newest_frame(image: np.ndarray) -> None:
    reader = FrameReader(
        Pictures(*[image] * 9, live=True), paced=True, on_change=lambda: None, events=EventLog()
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
    running.wait(seconds=TIMEOUT)
    assert running.counts.frames == 3 and running.counts.valid == 2
    (told,) = [line for line in lines(log) if "left out" in line]
    assert told.startswith("picture 2 has 320 x 238 pixels, the intrinsics are of 320 x 240")


def test_another_resolution_is_refused(session: Session, video: Path) -> None:
    other = Session(session.scene, replace(CAMERA, width=640))
    source = open_source(video)
    with pytest.raises(InvalidInputError, match="320 x 240 pixels, the intrinsics are of 640"):
        LiveSession(other, source, events=EventLog())
    source.close()


def test_a_lost_camera_is_told_once_and_comes_back(
    live: Callable[..., LiveSession], video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """OpenCV reads the video as it reads a camera; at its end the camera is gone for a while."""
    monkeypatch.setattr(sources_device, "PATIENCE", 0.05)
    monkeypatch.setattr(sources_device, "FIRST_WAIT", 0.05)
    gone = [True]

    def plug_in() -> cv2.VideoCapture | None:
        return None if gone[0] else cv2.VideoCapture(str(video))

    gone[0] = False
    source = sources_device.DeviceSource("camera 7", plug_in)
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
    assert running.next_picture(before.number, TIMEOUT) is not None
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
        running.wait(seconds=TIMEOUT)


# --- Actions


def test_snapshot_of_the_picture(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    running = live(Pictures(image))
    actions = ViewActions(running, tmp_path)
    with pytest.raises(InvalidInputError, match="there is no picture yet"):
        actions.snapshot()
    with pytest.raises(InvalidInputError, match="needs a picture that shows where the board is"):
        actions.start_check()
    running.start()
    picture = running.next_picture(0, TIMEOUT)
    assert picture is not None
    places = [actions.snapshot(), actions.snapshot()]
    assert [p.name for p in places] == ["tabletop_six_snapshot_001", "tabletop_six_snapshot_002"]
    taken = load_snapshot(places[0])
    assert np.array_equal(taken.image, image)
    assert np.array_equal(taken.overlay, picture.overlay)
    assert taken.document.source == "picture 1"


def test_check_of_an_empty_board(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    """No object stands where it should; the check says so, and the view shows it."""
    running = live(Pictures(image))
    actions = ViewActions(running, tmp_path)
    running.start()
    picture = running.next_picture(0, TIMEOUT)
    assert picture is not None and picture.placement is None
    actions.start_check()
    actions.wait_for_check(TIMEOUT)
    assert not actions.checking
    shown = running.next_picture(picture.number, TIMEOUT)
    assert shown is not None and shown.placement is running.placement is not None
    assert set(shown.placement.instances) == set(running.session.scene.instances)
    assert {placed.status for placed in shown.placement.instances.values()} <= {
        "not_seen",
        "uncertain",
    }


@pytest.mark.parametrize(("told", "written"), [(90000.0, 240.0), (0.01, 1.0), (None, 30.0)])
def test_rates_of_recordings(
    live: Callable[..., LiveSession],
    image: np.ndarray,
    tmp_path: Path,
    told: float | None,
    written: float,
) -> None:
    source = Pictures(image)
    source.fps = told
    actions = ViewActions(live(source), tmp_path)
    actions.start_recording()
    assert actions.recording is not None and actions.recording.frames_per_second == written
    assert actions.stop_recording() is None and list(tmp_path.iterdir()) == []


def test_recordings_get_names_that_are_free(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    (tmp_path / "tabletop_six_recording_001.csv").write_text("mine")
    actions = ViewActions(live(Pictures(image)), tmp_path)
    assert actions.start_recording().name == "tabletop_six_recording_002.mp4"
    actions.stop_recording()


def test_a_recording_that_fails_is_finished_and_the_view_goes_on(
    live: Callable[..., LiveSession],
    image: np.ndarray,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = EventLog()
    running = live(Pictures(*[image] * 5), events=log, paced=False)
    actions = ViewActions(running, tmp_path)
    add = Recording.add

    def fail_in_the_end(recording: Recording, *picture: Any) -> None:
        if recording.pictures == 2:
            raise OSError(28, "No space left on device")
        add(recording, *picture)

    monkeypatch.setattr(Recording, "add", fail_in_the_end)
    take = actions.start_recording(tmp_path / "take.avi")
    running.start()
    running.wait(seconds=TIMEOUT)
    assert running.counts.frames == 5 and actions.recording is None
    ended, saved = lines(log)[-2:]
    assert ended == "recording ended: [Errno 28] No space left on device"
    assert saved.startswith(f"recorded {take}, ")
    assert len(read_poses(tmp_path / "take.csv").times) == 2
    assert not list(tmp_path.glob(".*"))
