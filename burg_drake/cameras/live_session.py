"""A live session: read frames in a thread, process the newest one and publish the picture."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

from burg_drake.cameras.frame_processing import (
    FrameProcessor,
    LocatedFrame,
    ViewSettings,
    change_settings,
    check_settings,
    describe_pose,
    time_call,
)
from burg_drake.cameras.frame_source import CameraLost, Frame, FrameSource
from burg_drake.cameras.image_files import encode_jpeg
from burg_drake.cameras.placement.document import PlacementCheck
from burg_drake.core import BurgError, Bytes, InvalidInputError


@dataclass(frozen=True)
class Event:
    """A reported event.

    Attributes:
        number: sequence number.
        text: one line.
        bad: whether it is an error.
    """

    number: int
    text: str
    bad: bool = False


class EventLog:
    """A thread-safe log of events.

    Args:
        on_event: called with each event.
    """

    def __init__(self, on_event: Callable[[Event], None] = lambda event: None) -> None:
        self._on_event = on_event
        self._lock = threading.Lock()
        self._events: deque[Event] = deque(maxlen=50)
        self._count = 0

    def add(self, text: str, *, bad: bool = False) -> None:
        """Adds an event."""
        with self._lock:
            self._count += 1
            event = Event(self._count, text, bad)
            self._events.append(event)
            self._on_event(event)

    def after(self, number: int) -> list[Event]:
        """Events with a higher number, of the last 50, oldest first."""
        with self._lock:
            return [event for event in self._events if event.number > number]


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """A processed frame as the view shows it.

    Attributes:
        number: sequence number; changed settings make a new picture of the same frame.
        located: the frame and its estimate.
        overlay: (H, W, 3) RGB.
        jpeg: the overlay, encoded.
        settings, placement: used for drawing.
        milliseconds: duration of each stage, by name.
    """

    number: int
    located: LocatedFrame
    overlay: Bytes
    jpeg: bytes
    settings: ViewSettings
    placement: PlacementCheck | None
    milliseconds: dict[str, float]


SourceState = Literal["waiting", "running", "lost", "ended"]


class FrameReader:
    """Reads the frames of a source in a thread.

    A live source gives its newest frame: slow readers miss frames, but never get old ones. Files
    give every frame in turn.

    Args:
        source: source of frames; closed with the reader.
        paced: play files at their frame rate, not as fast as frames are taken.
        changed: condition that is notified when a frame arrives or the state changes; to be
            notified when frames may be wanted again.
        events: log of lost and recovered cameras and of unreadable frames.
        wanted: returns whether frames are wanted; none are read if not.
    """

    def __init__(
        self,
        source: FrameSource,
        *,
        paced: bool,
        changed: threading.Condition,
        events: EventLog,
        wanted: Callable[[], bool] = lambda: True,
    ) -> None:
        self.source = source
        self.state: SourceState = "waiting"
        self.fault = ""
        """Reason for the state `lost`."""
        self.failure: BaseException | None = None
        """The error that ended the thread, if one did."""
        self._paced = paced and not source.live
        self._changed, self._events, self._frames_wanted = changed, events, wanted
        self._next: Frame | None = None
        self._last_due: tuple[float, float] | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="frame reader", daemon=True)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def take(self) -> Frame | None:
        """Takes the next frame; None if there is none yet."""
        with self._changed:
            frame, self._next = self._next, None
            self._changed.notify_all()
        return frame

    @property
    def is_empty(self) -> bool:
        """Whether no next frame is available now."""
        return self._next is None

    def close(self) -> None:
        """Ends the thread and closes the source."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()
        if self.source.live:  # only the reader closes a file: OpenCV's capture is not thread-safe
            self.source.close()
        if self._thread.ident is not None:
            self._thread.join()
        self.source.close()

    def _run(self) -> None:
        try:
            while not self._closed.is_set() and self._read_one():
                with self._changed:
                    self._changed.wait_for(lambda: self._closed.is_set() or self._frames_wanted())
        except BaseException as error:  # ends the thread; raised again where frames are awaited
            self.failure = error
        self._set_state("ended")

    def _read_one(self) -> bool:
        """Reads and delivers a frame; returns whether there may be more."""
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
                self._wait_until_due(frame)
            self._deliver_frame(frame)
        return frame is not None

    def _wait_until_due(self, frame: Frame) -> None:
        """Waits until a file's frame is due; a delay postpones all later frames."""
        now = time.monotonic()
        due, before = self._last_due or (now, frame.time)
        # Largest wait between two frames of a file, in seconds.
        due = max(due + min(max(frame.time - before, 0.0), 2.0), now)
        self._last_due = (due, frame.time)
        self._closed.wait(due - now)

    def _deliver_frame(self, frame: Frame) -> None:
        if self.state == "lost":
            self._events.add(f"{self.source.name} is back")
        with self._changed:
            self.state, self.fault = "running", ""
            if not self.source.live:
                self._changed.wait_for(lambda: self._next is None or self._closed.is_set())
            self._next = frame
            self._changed.notify_all()

    def _report_loss(self, fault: str) -> None:
        if self.state != "lost" and not self._closed.is_set():
            self._events.add(fault, bad=True)
        self._set_state("lost", fault)

    def _set_state(self, state: SourceState, fault: str = "") -> None:
        with self._changed:
            self.state, self.fault = state, fault
            self._changed.notify_all()


RATE_WINDOW = 2.0
"""Seconds over which the frame rate is counted."""


@dataclass(frozen=True, kw_only=True)
class FrameCounts:
    """Counts of the processed frames.

    Attributes:
        frames: all frames.
        valid: frames with a pose.
        reason: why the last frame without a pose had none.
    """

    frames: int = 0
    valid: int = 0
    reason: str = ""


class LiveSession:
    """A live view of a source; call `start`, and `close` at the end.

    Args:
        processor: processes and draws frames.
        source: source of frames; closed with the session.
        events: log for changes of camera and pose, not for single frames.
        settings: initial settings.
        paced: play files at their frame rate; else as fast as they can be processed.
        idle_after: time without requested pictures after which a camera's frames are no longer
            read and processed, unless the session is kept awake [s]. The next request gets a new
            picture.

    Attributes:
        picture: the newest picture; None before the first.
        counts: counts of frames so far.
        last_located: the last frame with a pose; before the first such frame, the last frame.

    Raises:
        InvalidInputError: the source has another resolution than the intrinsics.
    """

    def __init__(
        self,
        processor: FrameProcessor,
        source: FrameSource,
        *,
        events: EventLog,
        settings: ViewSettings = ViewSettings(),
        paced: bool = True,
        idle_after: float = math.inf,
    ) -> None:
        processor.intrinsics.require_size(*source.size, source.name)
        self.processor, self.source, self.events = processor, source, events
        self.picture: Picture | None = None
        self.counts = FrameCounts()
        self.last_located: LocatedFrame | None = None
        self._changed = threading.Condition(threading.RLock())
        self.reader = FrameReader(
            source,
            paced=paced,
            changed=self._changed,
            events=events,
            wanted=lambda: not self.is_idle,
        )
        self._idle_after = idle_after if source.live else math.inf
        self._last_request, self._waiter_count = math.inf, 0
        self._awake_reasons: list[Callable[[], bool]] = []
        self._settings = check_settings(processor.scene, settings)
        self._placement: PlacementCheck | None = None
        self._on_frame: list[Callable[[Picture], None]] = []
        self._redraw = self._closed = self._busy = False
        self._frame_limit: int | None = None
        self._failure: BaseException | None = None
        self._frame_times: deque[float] = deque()
        self._reported: tuple[bool, bool] | None = None
        self._pose_state = (0.0, (False, False))
        self._worker = threading.Thread(target=self._run, name="live session", daemon=True)

    def start(self, frames: int | None = None) -> None:
        """Starts processing frames, at most `frames` of them if given."""
        self._frame_limit, self._last_request = frames, time.monotonic()
        self.reader.start()
        self._worker.start()

    def close(self) -> None:
        """Ends both threads and closes the source."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self.reader.close()
        if self._worker.ident is not None:
            self._worker.join()

    def on_frame(self, listener: Callable[[Picture], None]) -> None:
        """Calls `listener` with the first picture of each frame, in the drawing thread."""
        self._on_frame.append(listener)

    def keep_awake(self, reason: Callable[[], bool]) -> None:
        """Keeps the session from idling while `reason()` is true, such as during a recording."""
        self._awake_reasons.append(reason)

    @property
    def is_idle(self) -> bool:
        """Whether the session idles, as no pictures are wanted."""
        timed_out = (
            not self._waiter_count and time.monotonic() - self._last_request > self._idle_after
        )
        return timed_out and not any(reason() for reason in self._awake_reasons)

    def request_pictures(self) -> int:
        """Requests pictures, and wakes the session if it idles.

        Returns:
            The number of the newest picture if it is stale, from before an idle time; else 0.
        """
        with self._changed:
            is_stale = self.picture is not None and self.is_idle and not self._settings.frozen
            number = self.picture.number if self.picture is not None and is_stale else 0
            self._last_request = time.monotonic()
            self._changed.notify_all()
        return number

    @property
    def settings(self) -> ViewSettings:
        """The viewers' settings."""
        return self._settings

    def change(self, /, **settings: Any) -> None:
        """Changes settings by name, see `ViewSettings`.

        Raises:
            InvalidInputError: the setting does not exist, or the value does not fit.
        """
        with self._changed:
            self._settings = change_settings(self.processor.scene, self._settings, settings)
            self._redraw = True
            self._changed.notify_all()

    @property
    def placement(self) -> PlacementCheck | None:
        """The last placement check, shown in the overlay."""
        return self._placement

    @placement.setter
    def placement(self, check: PlacementCheck | None) -> None:
        with self._changed:
            self._placement, self._redraw = check, True
            self._changed.notify_all()

    @property
    def rate(self) -> float:
        """Processed frames per second in the last seconds."""
        now = time.monotonic()
        return sum(now - then <= RATE_WINDOW for then in tuple(self._frame_times)) / RATE_WINDOW

    def next_picture(self, after: int, seconds: float) -> Picture | None:
        """Waits for a picture with a number above `after`; None after a timeout [s].

        An idle session gives the next new picture.
        """
        with self._changed:
            after = max(after, self.request_pictures())
            self._waiter_count += 1
            self._changed.notify_all()
            try:
                self._changed.wait_for(
                    lambda: self._closed or (self.picture and self.picture.number > after), seconds
                )
            finally:
                self._waiter_count -= 1
            picture = self.picture
        return picture if picture is not None and picture.number > after else None

    def newest_picture(self, seconds: float) -> Picture | None:
        """The newest picture; an idle session gives the next one within a timeout [s]."""
        stale = self.request_pictures()
        return self.next_picture(stale, seconds) if stale else self.picture

    def wait(self, *, seconds: float | None = None, to_end: bool = True) -> None:
        """Waits until all frames are processed, or for a timeout.

        Args:
            seconds: timeout; none if None.
            to_end: return at the end of a file, too.

        Raises:
            BaseException: the error that ended a thread of the session.
        """
        end = math.inf if seconds is None else time.monotonic() + seconds
        with self._changed:
            # Polls every 0.5 s: an interrupt in another thread does not wake this one.
            while not self._is_over(to_end) and (left := end - time.monotonic()) > 0:
                self._changed.wait(min(left, 0.5))
        failure = self._failure or self.reader.failure
        if failure is not None:
            raise failure

    @property
    def is_over(self) -> bool:
        """Whether no more frames will be processed, such as after a photograph."""
        return self._is_over(to_end=True)

    def _is_over(self, to_end: bool) -> bool:
        if self._closed or self._failure or self.reader.failure or self._has_reached_limit:
            return True
        ended = self.reader.state == "ended" and self.reader.is_empty and not self._busy
        return to_end and ended

    @property
    def _has_reached_limit(self) -> bool:
        return self._frame_limit is not None and self.counts.frames >= self._frame_limit

    def _run(self) -> None:
        try:
            while not self._closed:
                self._run_once()
        except BaseException as error:  # ends the thread; raised again in `wait`
            self._failure = error
        with self._changed:
            self._changed.notify_all()

    def _run_once(self) -> None:
        """Waits for a frame or a changed setting and processes it."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._redraw or self._wants_frame)
            if self._closed:
                return
            frame = self.reader.take() if self._wants_frame else None
            self._busy, self._redraw = True, False
        try:
            located = self._process(frame) if frame is not None else None
            if located is not None:
                self._publish(located, new=True)
            elif self.picture is not None:
                self._publish(self.picture.located, new=False)
        finally:
            with self._changed:
                self._busy = False
                self._changed.notify_all()

    @property
    def _wants_frame(self) -> bool:
        frozen = self._settings.frozen and self.picture is not None
        return not (self.reader.is_empty or frozen or self._has_reached_limit)

    def _process(self, frame: Frame) -> LocatedFrame | None:
        try:
            located = self.processor.locate(frame, steady=self._settings.steady)
        except BurgError as error:  # an image of a folder may have another size
            self.events.add(f"{error}; left out", bad=True)
            self.counts = replace(self.counts, frames=self.counts.frames + 1, reason=str(error))
            return None
        estimate, counts = located.estimate, self.counts
        self.counts = FrameCounts(
            frames=counts.frames + 1,
            valid=counts.valid + estimate.valid,
            reason=counts.reason if estimate.valid else estimate.reason,
        )
        if estimate.valid or not counts.valid:
            self.last_located = located
        now = time.monotonic()
        self._frame_times.append(now)
        while now - self._frame_times[0] > RATE_WINDOW:
            self._frame_times.popleft()
        self._report_pose(located, now)
        return located

    def picture_of(self, located: LocatedFrame, placement: PlacementCheck | None) -> Picture:
        """Draws a picture with the current settings."""
        settings = self._settings
        overlay, drawing = time_call(lambda: self.processor.draw(located, settings, placement))
        jpeg, encoding = time_call(lambda: encode_jpeg(overlay, 88))
        return Picture(
            number=1 if self.picture is None else self.picture.number + 1,
            located=located,
            overlay=overlay,
            jpeg=jpeg,
            settings=settings,
            placement=placement,
            milliseconds={**located.milliseconds, "overlay": drawing, "jpeg": encoding},
        )

    def _publish(self, located: LocatedFrame, *, new: bool) -> None:
        picture = self.picture_of(located, self._placement)
        with self._changed:
            self.picture = picture
            self._changed.notify_all()
        for listener in self._on_frame if new else ():
            listener(picture)

    def _report_pose(self, located: LocatedFrame, now: float) -> None:
        """Adds an event when a pose appears or disappears for some time."""
        state = (located.estimate.valid, bool(located.estimate.reason))
        if self._pose_state[1] != state:
            self._pose_state = (now, state)
        # Seconds. A pose that appears or disappears for less time is not reported.
        is_stable = now - self._pose_state[0] >= 1.0
        if self._reported is None or (state != self._reported and is_stable):
            self._reported = state
            line = describe_pose(located.estimate, self.processor.scene.board)
            self.events.add(f"{located.frame.name}: {line}", bad=not state[0])
