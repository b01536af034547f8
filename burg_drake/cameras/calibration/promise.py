"""To how many pixels a calibrated camera is known, and in which parts of the image that fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.cameras.calibration.image_parts import part_of
from burg_drake.cameras.calibration.lens_uncertainty import (
    BOUND,
    CalibratedCamera,
    image_grid,
    uncertainty,
)
from burg_drake.cameras.optics import LARGEST, PARTS, known_words

GRID = (17, 13)
"""Columns and rows of places where it is computed."""
EXCEPTED = 2.0
"""A part that is known so many times worse than the middle is named by itself."""
UNCERTAIN, UNKNOWN = 0.5, 3.0
"""Bounds of the error that deserve a word, and that are too much [pixels]."""
FARTHEST = np.radians(85.0)
"""From the axis of a fisheye; what looks further aside is not promised anything."""


@dataclass(frozen=True, eq=False)
class Promise:
    """How far apart the true and the calibrated camera show the same, in 19 of 20 cases at most.

    Attributes:
        parts: that bound by part of the image [pixels]; without parts that look farther than 85
            degrees off the axis all over.
        unknown: share of the image where it is more than 3 pixels.
    """

    parts: dict[str, float]
    unknown: float

    @property
    def except_at(self) -> tuple[str, ...]:
        """Parts that nothing is promised of or that are known much worse than the middle, or than
        the best part if the middle is one of those; the worst first."""
        bounds = {name: self.parts.get(name, np.inf) for name in PARTS}
        best = self.parts.get("middle", min(self.parts.values()))
        limit = max(UNCERTAIN, EXCEPTED * best)
        worse = [name for name, bound in bounds.items() if not bound <= limit]
        return tuple(sorted(worse, key=lambda name: -bounds[name]))

    @property
    def known_to(self) -> float:
        """The bound in all other parts [pixels]; infinite if there are none."""
        excepted = self.except_at
        held = [bound for name, bound in self.parts.items() if name not in excepted]
        return max(held, default=np.inf)

    def bound(self, name: str) -> str:
        """That of a part, as text."""
        if name not in self.parts:
            return f"beyond {np.degrees(FARTHEST):.0f} degrees"
        bound = self.parts[name]
        return f"{bound:.2g}" if bound < LARGEST else f"more than {LARGEST:g}"

    def __str__(self) -> str:
        bounds = {name: self.bound(name) for name in self.except_at}
        return f"known {known_words(self.known_to, self.except_at, bounds)}"


def promise_of(calibrated: CalibratedCamera) -> Promise:
    """What a calibration promises."""
    camera = calibrated.intrinsics
    pixels = image_grid(camera, *GRID)
    pixels = pixels[camera.rays(pixels)[:, 2] > np.cos(FARTHEST)]
    if not len(pixels):  # of views that tell nothing
        return Promise(dict.fromkeys(PARTS, np.inf), 1.0)
    bound = np.nan_to_num(BOUND * uncertainty(calibrated, pixels), nan=np.inf)
    part = part_of(pixels, (camera.width, camera.height))
    parts = {
        name: float(bound[part == k].max()) for k, name in enumerate(PARTS) if (part == k).any()
    }
    return Promise(parts, float((~(bound <= UNKNOWN)).mean()))
