"""What the log is told, and when."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras import BoardEstimate
from burg_drake.ros import Sighting, StatusLog, StatusLogIntervals

SEEN = BoardEstimate(X_SC=np.eye(4), valid=True, reprojection_error=0.123, ids=tuple(range(52)))
FOUND, LOST, BLURRED = (
    Sighting(stamp=None, camera_frame="eye", estimate=estimate)
    for estimate in (
        SEEN,
        BoardEstimate(reason="no marker in sight"),
        BoardEstimate(reason="too blurred"),
    )
)


def logged_lines(log: StatusLog, *sightings: tuple[float, Sighting]) -> list[str]:
    lines = [log.record_image(sighting, now) for now, sighting in sightings]
    return [line[0] for line in lines if line]


def test_a_change_is_told_once() -> None:
    sightings = [(0.1 * i, FOUND) for i in range(5)] + [(1.0 + 0.1 * i, LOST) for i in range(99)]
    assert logged_lines(StatusLog(0.0), *sightings) == [
        "the board is in sight: 52 markers, 0.12 px",
        "no pose: no marker in sight",
    ]


def test_warnings_are_marked() -> None:
    log = StatusLog(0.0)
    assert log.record_image(LOST, 0.0) is None
    entry = log.record_image(LOST, StatusLogIntervals.no_pose)
    assert entry is not None and entry[1]
    entry = log.record_image(FOUND, 1.0)
    assert entry is not None and not entry[1]


def test_a_moment_is_not_told() -> None:
    sightings = [
        (0.0, FOUND),
        (1.0, LOST),
        (1.0 + 0.9 * StatusLogIntervals.no_pose, LOST),
        (1.6, FOUND),
    ]
    assert logged_lines(StatusLog(0.0), *sightings) == [
        "the board is in sight: 52 markers, 0.12 px"
    ]


def test_reasons_that_alternate_do_not_flood_the_log() -> None:
    sightings = [(t, LOST if int(t) % 2 else BLURRED) for t in np.arange(0.0, 60.0, 0.25)]
    assert 2 <= len(logged_lines(StatusLog(0.0), *sightings)) <= 60.0 / StatusLogIntervals.repeat


def test_silence_is_told_once_and_again_after_images() -> None:
    log = StatusLog(0.0)
    topics = {"/camera/image_raw": 0, "/camera/camera_info": 0}
    assert log.record_no_image(topics, 0.9 * StatusLogIntervals.no_image) is None
    assert log.record_no_image(topics, 1.1 * StatusLogIntervals.no_image) == (
        "nothing publishes /camera/image_raw and /camera/camera_info; is the camera running?"
        " Still waiting"
    )
    assert log.record_no_image(topics, 9.0 * StatusLogIntervals.no_image) is None
    log.record_image(FOUND, 10.0 * StatusLogIntervals.no_image)
    assert log.record_no_image({"/image": 1}, 10.5 * StatusLogIntervals.no_image) is None
    assert log.record_no_image({"/image": 1}, 11.5 * StatusLogIntervals.no_image) == (
        "/image has a publisher, but no images arrive; still waiting"
    )


def test_rate() -> None:
    log = StatusLog(0.0)
    for number in range(60):
        log.record_image(FOUND if number % 4 else LOST, 0.5 * number)
    assert log.rate(0.9 * StatusLogIntervals.rate) is None
    assert log.rate(StatusLogIntervals.rate) == "2.0 images a second, 75 % with a pose"
    assert log.rate(StatusLogIntervals.rate + 1.0) is None


def test_the_last_rate_counts_from_the_first_image() -> None:
    log = StatusLog(0.0)
    assert log.rate(9.0, last=True) is None
    for number in range(10):
        log.record_image(FOUND, 9.0 + 0.1 * number)
    assert log.rate(10.0, last=True) == "10.0 images a second, 100 % with a pose"
