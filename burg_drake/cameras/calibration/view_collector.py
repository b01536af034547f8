"""Takes views of a calibration target from a running camera: sharp, still, and different ones."""

from __future__ import annotations

from dataclasses import dataclass, field

from burg_drake.cameras.calibration.estimation import BLURRED, displacement
from burg_drake.cameras.calibration.quality import coverage, uncovered
from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView, find_target
from burg_drake.cameras.sources import Frame

STILL = 0.004
"""The target moved less between two frames, as a share of the image's diagonal: no motion blur,
and no skew by a shutter that reads line by line."""
DIFFERENT = 0.025
"""Corners of two views that are both worth having lie that far apart on average, likewise: a target
that fills half of the image moves its corners that far when it is tilted by 25 degrees."""


@dataclass(eq=False)
class ViewCollector:
    """Chooses views from frames.

    Attributes:
        target: that the camera sees.
        views: that were taken.
    """

    target: CharucoTarget
    views: list[CharucoView] = field(default_factory=list)
    _before: CharucoView | None = None

    def offer(self, frame: Frame) -> tuple[bool, str]:
        """Looks at a frame, and takes it if it is a good, new view.

        Returns:
            `(taken, word)`: whether it was taken, and what to tell the one who holds the target.
        """
        name = f"view {len(self.views) + 1}"
        view = find_target(frame.image, self.target, name)
        before, self._before = self._before, None if isinstance(view, str) else view
        if isinstance(view, str):
            return False, f"the image {view}"
        if before is None or displacement(view, before) > STILL:
            return False, "hold still"
        if view.blur > BLURRED * view.side:
            return False, "blurred: more light, or focus"
        if any(displacement(view, other) < DIFFERENT for other in self.views):
            return False, self.missing_view(frame.image.shape[1], frame.image.shape[0])
        self.views.append(view)
        return True, self.missing_view(frame.image.shape[1], frame.image.shape[0])

    def missing_view(self, width: int, height: int) -> str:
        """What view is wanted next."""
        empty = uncovered(coverage(self.views, (width, height)))
        if empty:
            return f"bring the target to the {empty[len(self.views) % len(empty)]}"
        return "tilt the target " + ("left", "right", "forward", "back")[len(self.views) % 4]
