"""The node's main loop: process the latest image, publish, and log the status."""

from __future__ import annotations

import time
from collections.abc import Mapping

from burg_drake.ros.board_node import BoardNode, Sighting
from burg_drake.ros.ros_node import RosNode


class StatusLogIntervals:
    """Intervals of log messages in seconds; see `StatusLog`."""

    no_image = 5.0  # Seconds without images until a hint is logged.
    no_pose = 0.5  # Seconds without a pose until the reason is logged.
    repeat = 5.0  # Seconds between two logged reasons, at least.
    rate = 30.0  # Seconds between two logged frame rates.


class StatusLog:
    """Selects the lines of the log."""

    def __init__(self, now: float) -> None:
        """
        Args:
            now: time on any clock [s].
        """
        self._last_image = now
        self._warned = False
        self._reason: str | None = None
        self._reason_since = now
        self._reported: str | None = None
        self._reported_at = now - StatusLogIntervals.repeat
        self._since = now
        self._images = self._poses = 0

    def record_image(self, sighting: Sighting, now: float) -> tuple[str, bool] | None:
        """Processes an image's sighting; returns a line and whether it is a warning, or None."""
        self._last_image, self._warned = now, False
        if not self._images:
            self._since = now
        self._images += 1
        self._poses += sighting.estimate.valid
        reason = "" if sighting.estimate.valid else sighting.estimate.reason
        if reason != self._reason:
            self._reason, self._reason_since = reason, now
        if reason == self._reported:
            return None
        if not reason:
            self._reported = reason
            return f"the board is in sight: {sighting.status}", False
        if (
            now - self._reason_since < StatusLogIntervals.no_pose
            or now - self._reported_at < StatusLogIntervals.repeat
        ):
            return None
        self._reported, self._reported_at = reason, now
        return sighting.status, True

    def record_no_image(self, publishers: Mapping[str, int], now: float) -> str | None:
        """Processes a timeout without an image; returns a warning, once."""
        if self._warned or now - self._last_image < StatusLogIntervals.no_image:
            return None
        self._warned = True
        silent = [topic for topic, count in publishers.items() if not count]
        if silent:
            return f"nothing publishes {' and '.join(silent)}; is the camera running? Still waiting"
        return f"{next(iter(publishers))} has a publisher, but no images arrive; still waiting"

    def rate(self, now: float, *, last: bool = False) -> str | None:
        """Line on the processed images per second, and the share with a pose.

        None without images, and within `StatusLogIntervals.rate` of the previous line unless `last`
        is set.
        """
        elapsed = now - self._since
        if not self._images or elapsed <= 0.0 or not (last or elapsed >= StatusLogIntervals.rate):
            return None
        line = (
            f"{self._images / elapsed:.1f} images a second,"
            f" {100.0 * self._poses / self._images:.0f} % with a pose"
        )
        self._since, self._images, self._poses = now, 0, 0
        return line


def run_node(link: RosNode, node: BoardNode) -> None:
    """Processes images until ROS or Ctrl-C ends the node. Of the images that arrive during the work
    on one, only the latest is kept.
    """
    status_log = StatusLog(time.monotonic())
    try:
        while link.running():
            image = link.next_image(0.5)  # Seconds; Ctrl-C may have to wait as long.
            if image is None:
                hint = status_log.record_no_image(link.publishers(), time.monotonic())
                if hint:
                    link.log(hint, warning=True)
                continue
            sighting = node.locate(image, link.camera_info)
            link.publications.publish(sighting, node.draw)
            entry = status_log.record_image(sighting, time.monotonic())
            if entry:
                link.log(entry[0], warning=entry[1])
            rate = status_log.rate(time.monotonic())
            if rate:
                link.log(rate)
    finally:
        rate = status_log.rate(time.monotonic(), last=True)
        if rate:
            link.log(rate)
