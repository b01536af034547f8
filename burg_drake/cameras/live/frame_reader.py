"""Reads a source in a thread of its own and keeps the frame that is to be looked at next."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Literal

from burg_drake.cameras.live.event_log import EventLog
from burg_drake.cameras.sources import CameraLost, Frame, FrameSource
from burg_drake.core import InvalidInputError

SourceState = Literal["waiting", "running", "lost", "ended"]
LONGEST_STEP = 2.0
"""Between two frames of a file that is played, whatever their times say [s]."""


class FrameReader:
    """The next frame of a source.

    Of a live source that is the newest: who is slow misses frames, and never sees old ones. Of
    files it is every one, in turn.

    Args:
        source: is closed with the reader.
        paced: play files as fast as they were taken, not as fast as frames are asked for.
        on_change: called, in the reader's thread, when a frame has come or the state has changed.
        events: are told when the camera is lost, is back, or a frame cannot be read.
        wanted: whether anybody wants frames; as long as nobody does, none is read, until `wake`.
    """

    def __init__(
        self,
        source: FrameSource,
        *,
        paced: bool,
        on_change: Callable[[], None],
        events: EventLog,
        wanted: Callable[[], bool] = lambda: True,
    ) -> None:
        self.source = source
        self.state: SourceState = "waiting"
        self.fault = ""
        """What is wrong while the state is `lost`."""
        self.failure: BaseException | None = None
        """What ended the thread, if that was no end of the source."""
        self._paced = paced and not source.live
        self._on_change, self._events, self._wanted = on_change, events, wanted
        self._changed = threading.Condition()
        self._next: Frame | None = None
        self._shown: tuple[float, float] | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="frame reader", daemon=True)

    def start(self) -> None:
        """Begins to read."""
        self._thread.start()

    def take(self) -> Frame | None:
        """The next frame, once; None if there is none yet."""
        with self._changed:
            frame, self._next = self._next, None
            self._changed.notify_all()
        return frame

    def wake(self) -> None:
        """Tells that frames may be wanted again; the next one is read now."""
        with self._changed:
            self._changed.notify_all()

    @property
    def is_empty(self) -> bool:
        """There is no next frame now."""
        return self._next is None

    def close(self) -> None:
        """Ends the thread and closes the source."""
        self._closed.set()
        self.wake()
        if self.source.live:  # a file is closed by its reader only: OpenCV's must not be disturbed
            self.source.close()
        if self._thread.ident is not None:
            self._thread.join()
        self.source.close()

    def _run(self) -> None:
        try:
            while not self._closed.is_set() and self._read_one():
                with self._changed:
                    self._changed.wait_for(lambda: self._closed.is_set() or self._wanted())
        except BaseException as error:  # ends the thread; who waits for frames raises it
            self.failure = error
        self.state = "ended"
        self._on_change()

    def _read_one(self) -> bool:
        """Hands over a frame; whether there may be more."""
        try:
            frame = self.source.read()
        except CameraLost as error:
            self._report_loss(str(error))
            return True
        except InvalidInputError as error:
            self._events.add(str(error), bad=True)
            return True
        if frame is not None:
            if self._paced:
                self._keep_time(frame)
            self._hand_over(frame)
        return frame is not None

    def _keep_time(self, frame: Frame) -> None:
        """Waits until a file's frame is due; after a delay the rest comes later, not faster."""
        now = time.monotonic()
        due, before = self._shown or (now, frame.time)
        due = max(due + min(max(frame.time - before, 0.0), LONGEST_STEP), now)
        self._shown = (due, frame.time)
        self._closed.wait(due - now)

    def _hand_over(self, frame: Frame) -> None:
        if self.state == "lost":
            self._events.add(f"{self.source.name} is back")
        self.state, self.fault = "running", ""
        with self._changed:
            if not self.source.live:
                self._changed.wait_for(lambda: self._next is None or self._closed.is_set())
            self._next = frame
        self._on_change()

    def _report_loss(self, fault: str) -> None:
        if self.state != "lost" and not self._closed.is_set():
            self._events.add(fault, bad=True)
        self.state, self.fault = "lost", fault
        self._on_change()
