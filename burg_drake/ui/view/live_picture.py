"""Pictures of the board by a live camera, one after another, as fast as somebody looks at them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from burg_drake.core import BurgError

if TYPE_CHECKING:
    from burg_drake.cameras.rectification import BoardPicture
    from burg_drake.scene.document import Board

PICTURE_INTERVAL = 0.5
"""Between two pictures [s]; each is some hundred kilobytes for every page."""

CAMERA_RELEASE_TIMEOUT = 10.0
"""For a camera that is closed to be free for others [s]."""


class LivePicture:
    """Looks at a board in a thread of its own until it is closed.

    Args:
        camera: as of `cameras.sources.open_source`.
        board: that it sees.
        show: gets each picture, or one line that says why there is none.
        after: another one that is closed, and may have the camera yet; it is waited for.

    Attributes:
        camera, board: as given.
    """

    def __init__(
        self,
        camera: str,
        board: Board,
        show: Callable[[BoardPicture | str], None],
        after: LivePicture | None = None,
    ) -> None:
        self.camera, self.board = camera, board
        self._show = show
        self._over = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(after,), name="live-picture", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Ends it; the camera is free for others soon afterwards."""
        self._over.set()

    def wait(self, timeout: float) -> None:
        """Waits for the last picture of a source that has an end [s]."""
        self._thread.join(timeout)

    def _run(self, after: LivePicture | None) -> None:
        from burg_drake.cameras.rectification import BoardRectifier
        from burg_drake.cameras.sources import open_source

        if after is not None:
            after.wait(CAMERA_RELEASE_TIMEOUT)
        try:
            rectifier = BoardRectifier(self.board)
            with open_source(self.camera) as source:
                while not self._over.is_set():
                    try:
                        frame = source.read()
                        if frame is None:
                            return
                        self._report(rectifier.picture(frame.image))
                    except BurgError as error:  # the board is hidden, or the camera unplugged
                        self._report(str(error))
                    self._over.wait(PICTURE_INTERVAL)
        except BurgError as error:
            self._report(str(error))

    def _report(self, what: BoardPicture | str) -> None:
        if not self._over.is_set():
            self._show(what)
