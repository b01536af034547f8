"""The camera above the board: live view of the scene under trial, and check of object placement."""

from __future__ import annotations

import math
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from burg_drake.cameras import (
    EventLog,
    FrameProcessor,
    FrameSource,
    Intrinsics,
    LiveSession,
    LocatedFrame,
    OverlayStyle,
    Picture,
    Placement,
    PlacementCheck,
    describe_pose,
    write_image,
)
from burg_drake.core import BurgError, InvalidInputError, one_line
from burg_drake.experiment.lab.lab_book import LabBook
from burg_drake.experiment.trials.trial_book import current_time
from burg_drake.experiment.trials.trial_photos import save_photo_and_placement, summarize_placements
from burg_drake.scene import Scene

OpenSource = Callable[[Scene], FrameSource]


@dataclass(frozen=True, eq=False)
class _View:
    """Live view of one scene; every view has its own epoch."""

    epoch: int
    scene: Scene
    live: LiveSession


class LabCamera:
    """Watches the board; every method may be called from any thread.

    Args:
        lab: the trials.
        open_source: opens the camera over a scene.
        intrinsics: intrinsics of the camera.
        print_scale: printed size of the boards relative to the documents', along x and y.
    """

    def __init__(
        self,
        lab: LabBook,
        open_source: OpenSource,
        intrinsics: Intrinsics,
        *,
        print_scale: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        self._lab, self._open, self._intrinsics = lab, open_source, intrinsics
        self._print_scale = print_scale
        self._lock = threading.RLock()
        self._view: _View | None = None
        self._epoch = 0
        self._check_thread: threading.Thread | None = None
        self._last_report: dict[str, Any] | None = None
        self._check_request: tuple[int, bool] | None = None
        self._drawing = threading.Lock()
        self._shown_number = self._drawn_number = 0

    def watch(self, number: int) -> None:
        """Switches the view to the scene of a trial, and hides the offsets of other trials.

        Raises:
            BurgError: there is no such trial, or the camera cannot be opened.
        """
        scene = self._lab.runs.of(self._lab.runs.sheet.trial(number)).scene
        with self._lock:
            with self._drawing:
                self._shown_number = number
                if self._view is not None and self._drawn_number not in (0, number):
                    self._view.live.placement, self._drawn_number = None, 0
            if self._view is not None and self._view.scene.content == scene.content:
                return
            self.close()
            source = self._open(scene)
            try:
                processor = FrameProcessor(scene, self._intrinsics, print_scale=self._print_scale)
                events = EventLog(lambda event: None)
                live = LiveSession(processor, source, events=events, idle_after=5.0)
            except BaseException:
                source.close()
                raise
            self._epoch += 1
            self._view, self._drawn_number = _View(self._epoch, scene, live), 0
            live.start()

    def close(self) -> None:
        """Ends the live view."""
        with self._lock:
            view, self._view = self._view, None
            if view is not None:
                view.live.close()
            self.wait_for_check()  # OpenCV must not be running when Python ends

    def next_picture(self, epoch: int, after: int, seconds: float) -> tuple[int, Picture] | None:
        """Waits for a picture newer than the one of this epoch and number."""
        view = self._view
        if view is None:
            time.sleep(min(seconds, 0.2))
            return None
        picture = view.live.next_picture(after if epoch == view.epoch else 0, seconds)
        return None if picture is None else (view.epoch, picture)

    @property
    def is_checking(self) -> bool:
        """Whether a placement check is running."""
        return self._check_thread is not None and self._check_thread.is_alive()

    def check(self, number: int, *, keep: bool) -> None:
        """Starts a thread that measures the object poses in the newest picture.

        Args:
            number: number of the trial.
            keep: whether to save photo and placement for the trial after the check. A trial with an
                outcome stays unchanged. A trial that gets its outcome during the check still gets
                both, as the photo is older.

        Raises:
            BurgError: there is no picture with a pose, or a check is running.
        """
        self.watch(number)
        with self._lock:
            if self.is_checking:
                raise InvalidInputError("a placement check is already running")
            view = self._view
            assert view is not None
            stale = view.live.request_pictures()
            picture = view.live.picture if not stale else None
            picture = picture or view.live.next_picture(stale, seconds=5.0)
            if picture is None or not picture.located.estimate.valid:
                raise InvalidInputError(
                    "the board is not seen in the picture; move the camera or the light,"
                    " then check again"
                )
            refusal = self._why_not_kept(number) if keep else ""
            self._check_request = (number, keep and not refusal)
            self._check_thread = threading.Thread(
                target=self._run_check,
                args=(view, number, picture.located, keep, refusal),
                name="placement check",
                daemon=True,
            )
            self._check_thread.start()

    def wait_for_check(self) -> None:
        """Waits for the running placement check, if any."""
        if self._check_thread is not None:
            self._check_thread.join()

    def status(self) -> dict[str, Any]:
        """Status for the page, shown beside the picture."""
        view = self._view
        if view is None:
            return {"scene": "", "line": "", "checking": False, "check": None, "drawn": 0}
        picture, reader = view.live.picture, view.live.reader
        fault = reader.fault if reader.state == "lost" else ""
        line = describe_pose(picture.located.estimate, view.scene.board) if picture else "waiting"
        return {
            "scene": view.scene.name,
            "fault": fault,
            "valid": picture is not None and picture.located.estimate.valid,
            "line": line,
            "checking": self.is_checking,
            "measuring": self._running_check(),
            "drawn": self._drawn_number,
            "check": self._last_report,
        }

    def _running_check(self) -> dict[str, Any] | None:
        """Trial of the running check, and whether its result is kept; None without a check."""
        request = self._check_request
        if request is None or not self.is_checking:
            return None
        return {"number": request[0], "keep": request[1]}

    def _why_not_kept(self, number: int) -> str:
        """Reason why a photo of a trial taken now is not kept; empty if it is kept."""
        try:
            self._lab.require_open(number)
        except BurgError as error:
            return str(error)
        return ""

    def _show_offsets(self, view: _View, number: int, check: PlacementCheck) -> None:
        """Draws the offsets of a trial if the trial is shown."""
        with self._drawing:
            if self._shown_number == number:
                view.live.placement, self._drawn_number = check, number

    def _run_check(
        self, view: _View, number: int, located: LocatedFrame, keep: bool, refusal: str
    ) -> None:
        begun = time.monotonic()
        report: dict[str, Any] = {"number": number, "kept": False, "problem": "", "objects": {}}
        try:
            check = view.live.processor.check(located)
            self._show_offsets(view, number, check)
            report["objects"] = {n: _offset_row(p) for n, p in check.instances.items()}
            report["problem"] = check.reason or refusal
            if keep and not report["problem"]:
                self._save(number, located, check)
                report["kept"] = True
        except BurgError as error:
            report["problem"] = str(error)
        except Exception as error:  # a thread that ends would leave an older answer on the page
            report["problem"] = f"the check failed: {one_line(error)}"
            traceback.print_exc()
        report["seconds"] = time.monotonic() - begun
        report["time"] = current_time()
        self._last_report = report

    def _save(self, number: int, located: LocatedFrame, check: PlacementCheck) -> None:
        """Writes the photo, then the entry that names it."""
        path = self._lab.runs.path
        with tempfile.TemporaryDirectory() as folder:
            photo = Path(folder) / "photo.png"
            write_image(photo, located.frame.image)
            name = save_photo_and_placement(path, number, photo=photo, check=check)
        self._lab.record_photo(number, name, summarize_placements(check))


def _offset_row(placed: Placement) -> dict[str, Any]:
    """Offset of an object for the page, and whether it is within the overlay's tolerance."""
    style = OverlayStyle()
    offset = None if placed.displacement is None else math.hypot(*placed.displacement)
    turn = placed.angle
    within = (
        offset is not None
        and offset <= style.tolerance
        and abs(turn or 0.0) <= style.angle_tolerance
    )
    return {
        "status": placed.status,
        "reason": placed.reason,
        "within": within,
        "mm": None if offset is None else round(1e3 * offset, 2),
        "deg": None if turn is None else round(math.degrees(turn), 2) + 0.0,
    }
