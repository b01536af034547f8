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
"""From one look to the next [s]."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """What one look at the board gave.

    Attributes:
        picture: the top view; None if there is none.
        reason: why there is none, or what is doubtful about it; "" if all is well.
    """

    picture: BoardPicture | None
    reason: str


def board_views(
    source: FrameSource,
    rectifier: BoardRectifier,
    *,
    period: float = PERIOD,
    stop: threading.Event | None = None,
) -> Iterator[BoardView]:
    """Looks at the board, again and again.

    Args:
        source: of a live camera the newest frame is taken each time; of files each one in turn.
            The caller closes it.
        rectifier: makes the views.
        period: time from one look to the next, at least [s]; of files nothing is waited for.
        stop: ends the looks, also while one is waited for.

    Yields:
        A look a frame, also where the frame does not show the board, cannot be read or the camera
        is away: then `reason` says so, and the next look may find it again.
    """
    stop = stop or threading.Event()
    while not stop.is_set():
        started = time.monotonic()
        try:
            frame = source.read()
            if frame is None:
                return
            picture = rectifier.picture(frame.image)
            yield BoardView(picture, picture.note)
        except (CameraLost, InvalidInputError) as error:
            yield BoardView(None, str(error))
        if source.live:
            stop.wait(max(0.0, period - (time.monotonic() - started)))
