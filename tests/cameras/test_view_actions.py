"""What viewers of a running session can have made of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.cameras import (
    CheckedImage,
    CheckedScene,
    EventLog,
    FrameProcessor,
    FrameSource,
    LiveSession,
    Placement,
    PlacementCheck,
    Recording,
    ViewActions,
    load_snapshot,
    placement_summary,
    read_poses,
)
from burg_drake.core import InvalidInputError, Pose
from burg_drake.scene import Scene, load_scene
from tests.cameras.live_views import CAMERA, Pictures, camera_at, lines
from tests.cameras.synthetic import board_image
from tests.hang_guard import HANG_GUARD


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def session(scene: Scene) -> FrameProcessor:
    return FrameProcessor(scene, CAMERA)


@pytest.fixture(scope="module")
def image(scene: Scene) -> np.ndarray:
    return board_image(scene.board, CAMERA, camera_at(0.3))


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


def test_snapshot_of_the_picture(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    running = live(Pictures(image))
    actions = ViewActions(running, tmp_path)
    with pytest.raises(InvalidInputError, match="there is no picture yet"):
        actions.snapshot()
    with pytest.raises(InvalidInputError, match="needs a picture in which the board is found"):
        actions.start_check()
    running.start()
    picture = running.next_picture(0, HANG_GUARD)
    assert picture is not None
    places = [actions.snapshot(), actions.snapshot()]
    assert [p.name for p in places] == ["tabletop_six_snapshot_001", "tabletop_six_snapshot_002"]
    taken = load_snapshot(places[0])
    assert np.array_equal(taken.image, image)
    assert np.array_equal(taken.overlay, picture.overlay)
    assert taken.document.source == "picture 1" and taken.document.X_SC_drawn is None
    elsewhere = replace(picture, located=replace(picture.located, X_SC=camera_at(0.31)))
    steady = load_snapshot(actions.snapshot(picture=elsewhere)).document
    assert steady.X_SC_drawn is not None and steady.board == taken.document.board
    assert np.allclose(steady.X_SC_drawn.matrix(), camera_at(0.31))


def test_check_of_an_empty_board(scene: Scene, image: np.ndarray, tmp_path: Path) -> None:
    """No object stands where it should; the check says so, and the view shows it."""
    two = replace(scene.document, instances=scene.document.instances[:2])
    session = FrameProcessor(Scene(two, scene.library, scene.path), CAMERA)
    running = LiveSession(session, Pictures(image), events=EventLog())
    actions = ViewActions(running, tmp_path)
    running.start()
    picture = running.next_picture(0, HANG_GUARD)
    assert picture is not None and picture.placement is None
    actions.start_check()
    actions.wait_for_check(HANG_GUARD)
    assert not actions.checking
    shown = running.next_picture(picture.number, HANG_GUARD)
    assert shown is not None and shown.placement is running.placement is not None
    assert set(shown.placement.instances) == set(running.processor.scene.instances)
    assert {placed.status for placed in shown.placement.instances.values()} <= {
        "not_seen",
        "uncertain",
    }
    running.close()


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
    running.wait(seconds=HANG_GUARD)
    assert running.counts.frames == 5 and actions.recording is None
    ended, saved = lines(log)[-2:]
    assert ended == "recording ended: [Errno 28] No space left on device"
    assert saved.startswith(f"recorded {take}, ")
    assert len(read_poses(tmp_path / "take.csv").times) == 2
    assert not list(tmp_path.glob(".*"))


def test_a_still_photo_is_recorded_from_the_start_or_not_at_all(
    live: Callable[..., LiveSession], image: np.ndarray, tmp_path: Path
) -> None:
    """Once its only frame has been looked at nothing comes that a video could have."""
    log = EventLog()
    running = live(Pictures(image), events=log)
    actions = ViewActions(running, tmp_path)
    take = actions.start_recording(tmp_path / "take.avi")
    running.start()
    running.wait(seconds=HANG_GUARD)
    assert actions.stop_recording() == take
    assert len(read_poses(take.with_suffix(".csv")).times) == 1
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match="pictures has no more frames to recor"):
        actions.start_recording()
    assert actions.recording is None and sorted(tmp_path.iterdir()) == before


def test_the_words_for_a_check_count_what_was_measured_alone() -> None:
    def check(*statuses: str, reason: str = "") -> PlacementCheck:
        return PlacementCheck(
            scene=CheckedScene(name="six", path="six.yaml", content="0"),
            method="silhouette",
            image=CheckedImage(content=""),
            intrinsics=CAMERA,
            reason=reason,
            instances={
                f"{k}": Placement(object="box", status=status, target=Pose())  # type: ignore[arg-type]
                for k, status in enumerate(statuses)
            },
        )

    assert placement_summary(check("measured", "measured")) == "2 of 2 objects measured"
    said = placement_summary(check("uncertain", "measured", "not_seen", "uncertain"))
    assert said == "1 of 4 objects measured, 2 uncertain, 1 not seen"
    assert placement_summary(check(reason="no marker in sight")) == "no marker in sight"
