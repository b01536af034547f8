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
    """Something that happened.

    Attributes:
        number: counts events.
        text: one line.
        bad: something went wrong.
    """

    number: int
    text: str
    bad: bool = False


class EventLog:
    """Events, from any thread.

    Args:
        on_event: called with each as it happens.
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
    """What the view shows.

    Attributes:
        number: counts pictures; changed settings make a new one of the same frame.
        located: the frame and its estimate.
        overlay: (H, W, 3) RGB.
        jpeg: the overlay, encoded.
        settings, placement: that it was drawn with.
        milliseconds: what stages took, by name.
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
    """The next frame of a source.

    Of a live source that is the newest: who is slow misses frames, and never sees old ones. Of
    files it is every one, in turn.

    Args:
        source: is closed with the reader.
        paced: play files as fast as they were taken, not as fast as frames are asked for.
        changed: notified when a frame has come or the state has changed; notify it when frames
            may be wanted again.
        events: are told when the camera is lost, is back, or a frame cannot be read.
        wanted: whether anybody wants frames; as long as nobody does, none is read.
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
        """What is wrong while the state is `lost`."""
        self.failure: BaseException | None = None
        """What ended the thread, if that was no end of the source."""
        self._paced = paced and not source.live
        self._changed, self._events, self._wanted = changed, events, wanted
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

    @property
    def is_empty(self) -> bool:
        """There is no next frame now."""
        return self._next is None

    def close(self) -> None:
        """Ends the thread and closes the source."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()
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
        self._set_state("ended")

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
            self._deliver_frame(frame)
        return frame is not None

    def _keep_time(self, frame: Frame) -> None:
        """Waits until a file's frame is due; after a delay the rest comes later, not faster."""
        now = time.monotonic()
        due, before = self._shown or (now, frame.time)
        # Seconds between two frames of a file, whatever their times say.
        due = max(due + min(max(frame.time - before, 0.0), 2.0), now)
        self._shown = (due, frame.time)
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
    """Of the frames that were looked at.

    Attributes:
        frames: all.
        valid: those that gave a pose.
        reason: why the last one without did not.
    """

    frames: int = 0
    valid: int = 0
    reason: str = ""


class LiveSession:
    """A running session; `start` it, and `close` it.

    Args:
        processor: what looks at frames and draws.
        source: of the frames; closed with this.
        events: are told what happens to camera and pose, never once a frame.
        settings: to begin with.
        paced: play files as fast as they were taken; else as fast as they can be looked at.
        idle_after: frames of a camera are neither read nor looked at when nobody has asked for a
            picture, or kept it `awake`, for so long [s]. Whoever asks gets a new one.

    Attributes:
        picture: the newest; None before the first.
        counts: of frames so far.
        last_located: the last frame that gave a pose; before one did, the last frame.

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
        self._asked, self._waiting = math.inf, 0
        self._awake: list[Callable[[], bool]] = []
        self._settings = check_settings(processor.scene, settings)
        self._placement: PlacementCheck | None = None
        self._on_frame: list[Callable[[Picture], None]] = []
        self._redraw = self._closed = self._busy = False
        self._limit: int | None = None
        self._failure: BaseException | None = None
        self._moments: deque[float] = deque()
        self._reported: tuple[bool, bool] | None = None
        self._same_since = (0.0, (False, False))
        self._worker = threading.Thread(target=self._run, name="live session", daemon=True)

    def start(self, frames: int | None = None) -> None:
        """Begins to look at frames, no more than `frames` of them if given."""
        self._limit, self._asked = frames, time.monotonic()
        self.reader.start()
        self._worker.start()

    def close(self) -> None:
        """Ends both threads, and the source."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self.reader.close()
        if self._worker.ident is not None:
            self._worker.join()

    def on_frame(self, listener: Callable[[Picture], None]) -> None:
        """Calls `listener` with the first picture of each frame, in the thread that draws."""
        self._on_frame.append(listener)

    def keep_awake(self, reason: Callable[[], bool]) -> None:
        """Does not idle as long as `reason` says so, such as while something is recorded."""
        self._awake.append(reason)

    @property
    def is_idle(self) -> bool:
        """Nobody wants pictures."""
        unasked = not self._waiting and time.monotonic() - self._asked > self._idle_after
        return unasked and not any(reason() for reason in self._awake)

    def request_pictures(self) -> int:
        """Somebody wants pictures from now on; wakes the session where it idles.

        Returns:
            The number of the newest picture, if it is from before an idle time, and stale; else 0.
        """
        with self._changed:
            waits = self.picture is not None and self.is_idle and not self._settings.frozen
            stale = self.picture.number if self.picture is not None and waits else 0
            self._asked = time.monotonic()
            self._changed.notify_all()
        return stale

    @property
    def settings(self) -> ViewSettings:
        """What viewers chose."""
        return self._settings

    def change(self, /, **settings: Any) -> None:
        """Changes settings by name, see `ViewSettings`.

        Raises:
            InvalidInputError: no such setting, or not such a value.
        """
        with self._changed:
            self._settings = change_settings(self.processor.scene, self._settings, settings)
            self._redraw = True
            self._changed.notify_all()

    @property
    def placement(self) -> PlacementCheck | None:
        """How the objects stand, as it was measured last; shown in the overlay."""
        return self._placement

    @placement.setter
    def placement(self, check: PlacementCheck | None) -> None:
        with self._changed:
            self._placement, self._redraw = check, True
            self._changed.notify_all()

    @property
    def rate(self) -> float:
        """Frames a second that were looked at, of late."""
        now = time.monotonic()
        return sum(now - moment <= RATE_WINDOW for moment in tuple(self._moments)) / RATE_WINDOW

    def next_picture(self, after: int, seconds: float) -> Picture | None:
        """The newest picture, as soon as its number is above `after`; None if that takes longer.

        Of a session that idles it is the next one.
        """
        with self._changed:
            after = max(after, self.request_pictures())
            self._waiting += 1
            self._changed.notify_all()
            try:
                self._changed.wait_for(
                    lambda: self._closed or (self.picture and self.picture.number > after), seconds
                )
            finally:
                self._waiting -= 1
            picture = self.picture
        return picture if picture is not None and picture.number > after else None

    def newest_picture(self, seconds: float) -> Picture | None:
        """The newest picture; of a session that idles, the next one within a time [s]."""
        stale = self.request_pictures()
        return self.next_picture(stale, seconds) if stale else self.picture

    def wait(self, *, seconds: float | None = None, to_end: bool = True) -> None:
        """Until all frames were looked at, or so much time has gone by.

        Args:
            seconds: any time if None.
            to_end: a file that has ended is an end.

        Raises:
            BaseException: what ended a thread of the session.
        """
        end = math.inf if seconds is None else time.monotonic() + seconds
        with self._changed:
            # In pieces: an interrupt may have come in another thread, which does not wake this one.
            while not self._is_over(to_end) and (left := end - time.monotonic()) > 0:
                # Seconds between checks for the end of the session.
                self._changed.wait(min(left, 0.5))
        failure = self._failure or self.reader.failure
        if failure is not None:
            raise failure

    @property
    def is_over(self) -> bool:
        """No frame will be looked at any more, such as after that of a photograph."""
        return self._is_over(to_end=True)

    def _is_over(self, to_end: bool) -> bool:
        if self._closed or self._failure or self.reader.failure or self._has_all_frames:
            return True
        ended = self.reader.state == "ended" and self.reader.is_empty and not self._busy
        return to_end and ended

    @property
    def _has_all_frames(self) -> bool:
        return self._limit is not None and self.counts.frames >= self._limit

    def _run(self) -> None:
        try:
            while not self._closed:
                self._run_once()
        except BaseException as error:  # ends the thread; who waits for it raises it
            self._failure = error
        with self._changed:
            self._changed.notify_all()

    def _run_once(self) -> None:
        """Waits for something to do, and does it."""
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
        return not (self.reader.is_empty or frozen or self._has_all_frames)

    def _process(self, frame: Frame) -> LocatedFrame | None:
        try:
            located = self.processor.locate(frame, steady=self._settings.steady)
        except BurgError as error:  # one image of a folder may have another size
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
        self._moments.append(now)
        while now - self._moments[0] > RATE_WINDOW:
            self._moments.popleft()
        self._report_pose(located, now)
        return located

    def picture_of(self, located: LocatedFrame, placement: PlacementCheck | None) -> Picture:
        """Draws a picture with the settings as they are."""
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
        """An event when the pose comes or goes, and stays so for a while."""
        state = (located.estimate.valid, bool(located.estimate.reason))
        if self._same_since[1] != state:
            self._same_since = (now, state)
        # Seconds. A pose that appears or disappears for less time is not reported.
        lasting = now - self._same_since[0] >= 1.0
        if self._reported is None or (state != self._reported and lasting):
            self._reported = state
            line = describe_pose(located.estimate, self.processor.scene.board)
            self.events.add(f"{located.frame.name}: {line}", bad=not state[0])
