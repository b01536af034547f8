"""The live session: what it makes of frames, and that it goes on whatever happens."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import sources_device
from burg_drake.cameras.board_estimate import BoardEstimate
from burg_drake.cameras.event_log import EventLog
from burg_drake.cameras.frame_reader import FrameReader
from burg_drake.cameras.frame_source import Frame, FrameSource
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.live_session import LiveSession
from burg_drake.cameras.recording import read_poses
from burg_drake.cameras.session import (
    Session,
    ViewSettings,
    checked_settings,
    placing_order,
    pose_line,
    position_sd,
)
from burg_drake.cameras.snapshot import load_snapshot
from burg_drake.cameras.sources import open_source
from burg_drake.cameras.synthetic import board_image
from burg_drake.cameras.view_actions import ViewActions
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.frames import make_pose
from burg_drake.core.schema import Pose
from burg_drake.scene.scene import Board, Scene, load_scene

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


# --- One frame


def test_looks_and_draws(session: Session, image: np.ndarray) -> None:
    sight = session.look(Frame(image, None, 0.0, "a"))
    assert sight.estimate.valid
    assert np.linalg.norm(sight.estimate.X_SC[:3, 3] - camera_at(0.3)[:3, 3]) < 1e-3
    drawn = session.draw(sight, ViewSettings())
    assert drawn.shape == image.shape and (drawn != image).any(axis=-1).mean() > 0.05
    alone = session.draw(sight, ViewSettings(guide="mug"))
    changed = (alone != image).any(axis=-1)
    assert 0 < changed.sum() < 0.5 * (drawn != image).any(axis=-1).sum()
    mug = session.scene.X_SO("mug")[:3, 3]
    p_C = np.linalg.inv(camera_at(0.3)) @ [*mug, 1.0]
    u, v = CAMERA.project(p_C[:3])
    rows, columns = np.nonzero(changed)
    assert rows.min() - 5 < v < rows.max() + 5 and columns.min() - 5 < u < columns.max() + 5


def test_steady(session: Session, scene: Scene, image: np.ndarray) -> None:
    """With noise, the poses of a camera at rest that are drawn at differ less than the estimates;
    that of a moved camera follows within two frames."""
    rng = np.random.default_rng(0)

    def noisy(picture: np.ndarray) -> Frame:
        levels = picture + rng.normal(0.0, 12.0, picture.shape)
        return Frame(np.clip(levels, 0, 255).astype(np.uint8), None, 0.0, "a")

    sights = [session.look(noisy(image), steady=True) for _ in range(20)]
    drawn = np.array([s.X_SC[:3, 3] for s in sights[5:]]).std(axis=0)
    estimated = np.array([s.estimate.X_SC[:3, 3] for s in sights[5:]]).std(axis=0)
    assert np.linalg.norm(drawn) < 0.6 * np.linalg.norm(estimated)
    elsewhere = board_image(scene.board, CAMERA, camera_at(0.33))
    moved = [session.look(noisy(elsewhere), steady=True) for _ in range(2)][-1]
    assert np.array_equal(moved.X_SC, moved.estimate.X_SC)
    assert session.look(noisy(image)).X_SC[0, 3] == pytest.approx(0.3, abs=2e-3)


def test_without_a_board_the_picture_says_so(session: Session) -> None:
    empty = np.full((240, 320, 3), 90, dtype=np.uint8)
    sight = session.look(Frame(empty, None, 0.0, "a"))
    assert not sight.estimate.valid
    drawn = session.draw(sight, ViewSettings())
    assert 0 < (drawn != empty).any(axis=-1).sum() < 0.3 * empty[..., 0].size


def test_print_scale(scene: Scene) -> None:
    """A board printed at 97 %, and told so, is seen where it is."""
    picture = board_image(scene.board, CAMERA, camera_at(0.3), scale=(0.97, 0.97))
    told = Session(scene, CAMERA, print_scale=(0.97, 0.97))
    estimate = told.look(Frame(picture, None, 0.0, "a")).estimate
    assert np.linalg.norm(estimate.X_SC[:3, 3] - camera_at(0.3)[:3, 3]) < 1e-3


def test_words(scene: Scene) -> None:
    assert pose_line(BoardEstimate(reason="no marker"), scene.board) == "no marker"
    spread = np.diag([1.0, 1.0, 1.0, 1e-10, 4e-10, 9e-10])
    seen = BoardEstimate(X_SC=np.eye(4), valid=True, covariance=spread, ids=tuple(range(7)))
    assert position_sd(seen) == pytest.approx(3e-5)
    assert pose_line(seen, Board()) == "7 of 54 markers, camera within 0.03 mm"
    doubtful = replace(seen, reason="printed at 99 %")
    assert pose_line(doubtful, Board()).endswith("; printed at 99 %")


def test_settings_are_checked(scene: Scene) -> None:
    with pytest.raises(InvalidInputError, match=r"opacity 1\.5 is not a number from 0 to 1"):
        checked_settings(scene, ViewSettings(opacity=1.5))
    with pytest.raises(UnknownNameError, match="did you mean 'mug'"):
        checked_settings(scene, ViewSettings(guide="mugg"))


def test_placing_order(scene: Scene) -> None:
    order = placing_order(scene)
    assert sorted(order) == sorted(scene.instances)
    rows = [scene.X_SO(name)[1, 3] > 0.21 for name in order]
    assert rows == [True] * 3 + [False] * 3, "the far row comes first"
    first = scene.document.instances[0]
    above = replace(first, name="on_top", X_SO=Pose((0.3, 0.4, 0.2)))
    stacked = replace(scene.document, instances=(above, *scene.document.instances))
    assert placing_order(Scene(stacked, scene.library, scene.path))[-1] == "on_top"


# --- A running session


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
