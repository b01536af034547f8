"""To how many pixels a calibrated camera is known, and in which parts of the image that fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.cameras.calibration.image_parts import PARTS, part_of
from burg_drake.cameras.calibration.lens_uncertainty import (
    BOUND,
    CalibratedCamera,
    image_grid,
    uncertainty,
)

GRID = (17, 13)
"""Columns and rows of places where it is computed."""
EXCEPTED = 2.0
"""A part that is known so many times worse than the middle is named by itself."""
UNCERTAIN, UNKNOWN = 0.5, 3.0
"""Bounds of the error that deserve a word, and that are too much [pixels]."""
LARGEST = 10.0
"""Larger bounds say no more than that a part is unknown [pixels]."""
FARTHEST = np.radians(85.0)
"""From the axis of a fisheye; what looks further aside is not promised anything."""


@dataclass(frozen=True, eq=False)
class Promise:
    """How far apart the true camera and the calibrated one show the same, at most, in 19 of 20
    cases.

    Attributes:
        parts: that bound by part of the image [pixels]; without parts that look farther than 85
            degrees off the axis all over.
        unknown: share of the image where it is more than 3 pixels.
    """

    parts: dict[str, float]
    unknown: float

    @property
    def except_at(self) -> tuple[str, ...]:
        """Parts that are known much worse than the middle, the worst first."""
        limit = max(UNCERTAIN, EXCEPTED * self.parts["middle"])
        worse = [name for name, bound in self.parts.items() if not bound <= limit]
        return tuple(sorted(worse, key=lambda name: -self.parts[name]))

    @property
    def known_to(self) -> float:
        """The bound in all other parts [pixels]."""
        excepted = self.except_at
        return max(bound for name, bound in self.parts.items() if name not in excepted)

    def bound(self, name: str) -> str:
        """That of a part, as text."""
        bound = self.parts[name]
        return f"{bound:.2g}" if bound < LARGEST else f"more than {LARGEST:g}"

    def __str__(self) -> str:
        text = f"known to {self.known_to:.2f} pixels"
        if not self.except_at:
            return f"{text} over the whole image"
        return f"{text}, but for the {', '.join(f'{n} ({self.bound(n)})' for n in self.except_at)}"


def promise_of(calibrated: CalibratedCamera) -> Promise:
    """What a calibration promises."""
    camera = calibrated.intrinsics
    pixels = image_grid(camera, *GRID)
    pixels = pixels[camera.rays(pixels)[:, 2] > np.cos(FARTHEST)]
    if not len(pixels):  # of views that tell nothing
        return Promise(dict.fromkeys(PARTS, np.inf), 1.0)
    bound = BOUND * uncertainty(calibrated, pixels)
    part = part_of(pixels, (camera.width, camera.height))
    parts = {
        name: float(bound[part == k].max()) for k, name in enumerate(PARTS) if (part == k).any()
    }
    return Promise(parts, float((~(bound <= UNKNOWN)).mean()))
