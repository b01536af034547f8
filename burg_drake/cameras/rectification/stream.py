"""Top views of the board from a source of frames, one every so often: a live backdrop."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

from burg_drake.cameras.rectification.top_view import BoardPicture, BoardRectifier
from burg_drake.cameras.sources import CameraLost, FrameSource
from burg_drake.core import InvalidInputError

PERIOD = 1.0
"""From one observation to the next [s]."""


@dataclass(frozen=True, eq=False)
class BoardObservation:
    """What one frame shows of the board.

    Attributes:
        picture: the top view; None if there is none.
        reason: why there is none, or what is doubtful about it; "" if all is well.
    """

    picture: BoardPicture | None
    reason: str


def board_observations(
    source: FrameSource,
    rectifier: BoardRectifier,
    *,
    period: float = PERIOD,
    stop: threading.Event | None = None,
) -> Iterator[BoardObservation]:
    """Observes the board, again and again.

    Args:
        source: of a live camera the newest frame is taken each time; of files each one in turn.
            The caller closes it.
        rectifier: makes the views.
        period: least time from one observation to the next [s]; files are read without pauses.
        stop: ends the observations, also while one is waited for.

    Yields:
        An observation a frame, also where the frame does not show the board, cannot be read or the
        camera is away: then `reason` says so, and the next observation may find it again.
    """
    stop = stop or threading.Event()
    while not stop.is_set():
        started = time.monotonic()
        try:
            frame = source.read()
            if frame is None:
                return
            picture = rectifier.picture(frame.image)
            yield BoardObservation(picture, picture.note)
        except (CameraLost, InvalidInputError) as error:
            yield BoardObservation(None, str(error))
        if source.live:
            stop.wait(max(0.0, period - (time.monotonic() - started)))
