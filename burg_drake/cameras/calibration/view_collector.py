"""Takes views of a calibration target from a running camera: sharp, still, and different ones."""

from __future__ import annotations

from dataclasses import dataclass, field

from burg_drake.cameras.calibration.estimation import (
    BLURRED,
    calibrate_views,
    displacement,
)
from burg_drake.cameras.calibration.guidance import wanted_views
from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView, find_target
from burg_drake.cameras.sources import Frame
from burg_drake.core import InvalidInputError

STILL = 0.004
"""The target moved less between two frames, as a share of the image's diagonal: no motion blur,
and no skew by a shutter that reads line by line."""
DIFFERENT = 0.025
"""Corners of two views that are both worth having lie that far apart on average, likewise: a target
that fills half of the image moves its corners that far when it is tilted by 25 degrees."""
FIRST_VIEWS = 5
"""Views by which the camera is known well enough to ask for those that are missing."""


@dataclass(eq=False)
class ViewCollector:
    """Chooses views from frames.

    Attributes:
        target: that the camera sees.
        views: that were taken.
        wanted: what to tell the one who holds the target.
        enough: the views that were taken make a good calibration.
    """

    target: CharucoTarget
    views: list[CharucoView] = field(default_factory=list)
    wanted: str = "show the target"
    enough: bool = False
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
            return False, "blurred: add light, or focus"
        if any(displacement(view, other) < DIFFERENT for other in self.views):
            return False, self.wanted
        self.views.append(view)
        self.wanted, self.enough = self._missing()
        return True, self.wanted

    def _missing(self) -> tuple[str, bool]:
        """What view is wanted next, and whether there are enough."""
        if len(self.views) < FIRST_VIEWS:
            return "show the target from other sides, tilted by 20 to 45 degrees", False
        try:
            calibration = calibrate_views(self.views, self.target)
        except InvalidInputError as error:
            return str(error), False
        wanted = wanted_views(calibration)
        if wanted:
            return wanted[0], False
        return f"enough, the camera is {calibration.promise}", True
