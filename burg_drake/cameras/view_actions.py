"""Actions on a live session: snapshots, recordings and placement checks."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from burg_drake.cameras.frame_processing import FrameProcessor
from burg_drake.cameras.live_session import LiveSession, Picture
from burg_drake.cameras.placement.document import PlacementCheck
from burg_drake.cameras.recording import Recording, RecordingFiles
from burg_drake.cameras.snapshot import (
    Snapshot,
    describe_scene,
    describe_snapshot,
    next_free_path,
    save_snapshot,
)
from burg_drake.core import BurgError, InvalidInputError, count_with_noun

FIRST_PICTURE_TIMEOUT = 5.0  # Seconds to wait for the first picture of an idle session.


class ViewActions:
    """Actions on a live session; all methods are thread-safe.

    Args:
        live: the session.
        folder: default folder of snapshots and recordings.
        plain: whether to record the pictures without overlay, too.
    """

    def __init__(self, live: LiveSession, folder: str | Path = ".", *, plain: bool = False) -> None:
        self.live, self.folder = live, Path(folder)
        self.recording: Recording | None = None
        """The recording in progress; None if there is none."""
        self.checking = False
        """Whether a placement check is running."""
        self._plain = plain
        self._lock = threading.RLock()
        self._check: threading.Thread | None = None
        live.on_frame(self._record)
        live.keep_awake(lambda: self.recording is not None)

    @property
    def processor(self) -> FrameProcessor:
        """Processor of the session's frames."""
        return self.live.processor

    def snapshot(self, folder: str | Path | None = None, picture: Picture | None = None) -> Path:
        """Saves a snapshot of a picture.

        Args:
            folder: new folder to make; `SCENE_snapshot_001` and so on if not given.
            picture: the newest if not given.

        Raises:
            InvalidInputError: there is no picture yet, or the folder cannot be written.
        """
        picture = picture or self.live.newest_picture(FIRST_PICTURE_TIMEOUT)
        if picture is None:
            raise InvalidInputError("there is no picture yet")
        located = picture.located
        document = describe_snapshot(
            self.processor.scene,
            self.processor.intrinsics,
            located.estimate,
            source=located.frame.name,
            taken=_now(),
            time=located.frame.time,
            X_SC_drawn=located.X_SC,
            placement=picture.placement,
        )
        frame = located.frame
        snapshot = Snapshot(
            document=document, image=frame.image, overlay=picture.overlay, depth=frame.depth
        )
        with self._lock:  # concurrent calls must not choose the same number
            place = Path(folder) if folder is not None else self._free_path("snapshot")
            save_snapshot(snapshot, place)
        self.live.events.add(f"snapshot {place}")
        return place

    def start_recording(self, path: str | Path | None = None) -> Path:
        """Starts to record all frames.

        Args:
            path: of the video; `SCENE_recording_001.mp4` and so on if not given.

        Raises:
            InvalidInputError: it cannot be written, files of that name exist, a recording is
                already running, or there are no more frames.
        """
        with self._lock:
            if self.recording is not None:
                raise InvalidInputError(f"{self.recording.path} is being recorded; stop that first")
            if self.live.is_over:
                raise InvalidInputError(
                    f"{self.live.source.name} has no more frames to record; take a snapshot to"
                    " keep the picture that is shown"
                )
            if path is None:
                path = self._free_path(
                    "recording",
                    ".mp4",
                    taken=lambda path: RecordingFiles(path, self._plain).existing() is not None,
                )
            rate = self.live.source.fps or 30.0  # Frames per second.
            self.recording = Recording(
                path,
                self.processor.intrinsics,
                describe_scene(self.processor.scene),
                source=self.live.source.name,
                started=_now(),
                # Some files state 90000 frames per second, which no codec takes.
                frames_per_second=min(max(rate, 1.0), 240.0),
                plain=self._plain,
            )
            self.live.request_pictures()
            self.live.events.add(f"recording {path}")
            return self.recording.path

    def stop_recording(self) -> Path | None:
        """Finishes the recording and returns the video; None if there was none, or it was empty.

        Raises:
            InvalidInputError: it could not be written completely.
        """
        with self._lock:
            recording, self.recording = self.recording, None
            if recording is None:
                return None
            path = recording.close()
        if path is None:
            frozen = " while the picture was frozen" if self.live.settings.frozen else ""
            self.live.events.add(
                f"{recording.path}: nothing was recorded, because no new frame arrived{frozen}",
                bad=True,
            )
        else:
            seconds = recording.frames / recording.frames_per_second
            self.live.events.add(f"recorded {path}, {seconds:.1f} s")
        return path

    def start_check(self) -> None:
        """Starts a placement check of the newest picture in its own thread.

        Raises:
            InvalidInputError: there is no picture with a pose, or a check is running.
        """
        picture = self.live.newest_picture(FIRST_PICTURE_TIMEOUT)
        if picture is None or not picture.located.estimate.valid:
            raise InvalidInputError("a placement check needs a picture in which the board is found")
        with self._lock:
            if self.checking:
                raise InvalidInputError("a placement check is already running")
            self.checking = True
            self._check = threading.Thread(
                target=self._measure, args=(picture,), name="placement check", daemon=True
            )
            self._check.start()

    def wait_for_check(self, seconds: float | None = None) -> None:
        """Waits until the running placement check, if any, is done."""
        if self._check is not None:
            self._check.join(seconds)

    def _measure(self, picture: Picture) -> None:
        try:
            check = self.processor.check(picture.located)
        except BurgError as error:
            self.live.events.add(f"placement check: {error}", bad=True)
        else:
            self.live.placement = check
            self.live.events.add(f"placement: {placement_summary(check)}")
        finally:
            self.checking = False

    def _record(self, picture: Picture) -> None:
        with self._lock:
            if self.recording is None:
                return
            located = picture.located
            try:
                self.recording.add(
                    picture.overlay, located.estimate, located.frame.time, located.frame.image
                )
            except Exception as error:  # the view goes on after any error
                self.live.events.add(f"recording ended: {error}", bad=True)
                self._finish_on_close()

    def _finish_on_close(self) -> None:
        """Finishes a recording that cannot go on, and reports its path as an event."""
        try:
            self.stop_recording()
        except Exception as error:
            self.live.events.add(str(error), bad=True)

    def _free_path(
        self, what: str, suffix: str = "", *, taken: Callable[[Path], bool] = Path.exists
    ) -> Path:
        return next_free_path(
            self.folder, f"{self.processor.scene.name}_{what}", suffix, taken=taken
        )


def placement_summary(check: PlacementCheck) -> str:
    """Numbers of measured, uncertain and unseen objects as text; or why none was measured."""
    if not check.instances:
        return check.reason
    counts = Counter(placed.status for placed in check.instances.values())
    words = [f"{counts['measured']} of {len(check.instances)} objects measured"]
    words += [f"{counts['uncertain']} uncertain"] if counts["uncertain"] else []
    words += [f"{counts['not_seen']} not seen"] if counts["not_seen"] else []
    if check.extra:
        words.append(count_with_noun(len(check.extra), "extra object"))
    return ", ".join(words) + (f"; {check.reason}" if check.reason else "")


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")
