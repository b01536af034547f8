"""Guide the user to a good calibration: select views, name missing ones, rate the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from burg_drake.cameras.calibration.charuco_target import CharucoTarget, CharucoView, find_target
from burg_drake.cameras.calibration.estimation import (
    MAX_VIEW_BLUR,
    CalibratedView,
    Calibration,
    calibrate_views,
    corner_displacement,
)
from burg_drake.cameras.calibration.lens_uncertainty import (
    MAX_KNOWN_ERROR_PX,
    NOTABLE_ERROR_PX,
    CalibrationAccuracy,
    corner_coverage,
    unseen_parts,
)
from burg_drake.cameras.frame_source import Frame
from burg_drake.cameras.intrinsics import excludes_most_parts
from burg_drake.core import InvalidInputError, transform_points

TILT_DIRECTIONS = {"left": (0, 1.0), "right": (0, -1.0), "up": (1, 1.0), "down": (1, -1.0)}
"""Axis and sign of the target's z axis in the camera frame when it faces a side."""
MIN_GOOD_VIEWS = 10  # Least number of views of a good calibration.


def wanted_views(calibration: Calibration) -> tuple[str, ...]:
    """Instructions for moving the target, in a few words each; none if there are enough views."""
    camera, accuracy = calibration.intrinsics, calibration.accuracy
    bound = accuracy.parts
    views = [used.view for used in calibration.views]
    unseen = unseen_parts(corner_coverage(views, (camera.width, camera.height)))
    worst_first = sorted(bound, key=lambda name: -bound[name])
    hidden = [name for name in worst_first if name in unseen]
    poor = [name for name in worst_first if not (name in unseen or bound[name] <= NOTABLE_ERROR_PX)]
    lines = []
    if hidden:
        lines.append(f"move the target into and across the {_list_parts(hidden, accuracy)}")
    lines += _missing_tilts(calibration.views)
    lines += _missing_distances(calibration)
    if poor:
        lines.append(f"show more of the target at the {_list_parts(poor, accuracy)}")
    count = len(calibration.views)
    if not lines and count < MIN_GOOD_VIEWS:
        lines = [f"take more views from all sides; {count} are too few"]
    return tuple(lines)


def _list_parts(names: Sequence[str], accuracy: CalibrationAccuracy) -> str:
    """Text that lists image parts with their error bounds, the worst first."""
    first, *others = names
    text = f"{first} of the image, where the error may be {accuracy.bound(first)} pixels"
    return ", ".join([text, *(f"then the {name} ({accuracy.bound(name)})" for name in others)])


def _missing_tilts(views: Sequence[CalibratedView]) -> list[str]:
    """Instructions for tilts of the target that are missing among the views."""
    # Views tilted by less than 15 degrees hardly separate focal length from distance.
    tilted = [used.X_CT[:2, 2] for used in views if used.tilt > np.radians(15.0)]
    toward = np.array(tilted).reshape(-1, 2)
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-9)
    missing = [
        side
        for side, (axis, sign) in TILT_DIRECTIONS.items()
        if (sign * toward[:, axis] > 0.5).sum() < 2  # views with half of their tilt to that side
    ]
    if not missing:
        return []
    return [f"tilt the target by 20 to 45 degrees, so that it faces {', then '.join(missing)}"]


def _missing_distances(calibration: Calibration) -> list[str]:
    """Instruction for another distance if all views show the target at about the same one."""
    views, middle = calibration.views, np.array([*calibration.target.size, 0.0]) / 2.0
    places = transform_points(np.array([used.X_CT for used in views]), middle[None])
    distance = np.linalg.norm(places, axis=-1)
    if distance.max() > 1.3 * distance.min():  # Farthest view over nearest view, at least.
        return []
    # Pixels. The nearest view is near if its squares are larger.
    near = max(used.view.side for used in views) >= 45.0
    return ["take some views from farther away" if near else "take some views from nearer"]


def calibration_advice(calibration: Calibration) -> list[str]:
    """Advice to improve a calibration, a sentence each; empty if it is good."""
    views, accuracy = calibration.views, calibration.accuracy
    lines = list(wanted_views(calibration))
    if len(views) < MIN_GOOD_VIEWS:
        lines.insert(0, f"{len(views)} views are too few; take 15 to 30")
    if calibration.rms > 1.0:  # Pixels. Sharp images of a flat target give 0.05 to 0.3.
        lines.append(
            f"the reprojection error of {calibration.rms:.2f} pixels is large: is the target flat,"
            " do its squares and markers have the given sizes, and was the focus fixed?"
        )
    if not accuracy.error_bound <= NOTABLE_ERROR_PX or excludes_most_parts(accuracy.excepted_parts):
        lines.append(f"the camera is {accuracy}")
    return lines


def is_useless(calibration: Calibration) -> bool:
    """Whether the calibration is too inaccurate to be used."""
    accuracy = calibration.accuracy
    bounds = accuracy.parts.values()
    parts = sum(not bound <= MAX_KNOWN_ERROR_PX for bound in bounds) / len(bounds)
    # Fraction of the image, or of its parts.
    known = accuracy.error_bound <= MAX_KNOWN_ERROR_PX and max(accuracy.unknown, parts) < 0.5
    return not known or calibration.rms > MAX_KNOWN_ERROR_PX


@dataclass(eq=False)
class ViewCollector:
    """Selects views for a calibration from frames.

    Attributes:
        target: target in front of the camera.
        views: selected views.
        wanted: instruction for the person who holds the target.
        enough: whether the selected views suffice for a good calibration.
    """

    target: CharucoTarget
    views: list[CharucoView] = field(default_factory=list)
    wanted: str = "show the target"
    enough: bool = False
    _previous_view: CharucoView | None = None

    def add_frame(self, frame: Frame) -> tuple[bool, str]:
        """Adds a frame if it is a good, new view.

        Returns:
            `(taken, word)`: whether the frame was added, and an instruction for the person who
            holds the target.
        """
        name = f"view {len(self.views) + 1}"
        view = find_target(frame.image, self.target, name)
        before, self._previous_view = self._previous_view, None if isinstance(view, str) else view
        if isinstance(view, str):
            return False, f"the image {view}"
        # Fraction of the diagonal between two frames; avoids blur and rolling shutter.
        if before is None or corner_displacement(view, before) > 0.004:
            return False, "hold still"
        if view.blur > MAX_VIEW_BLUR * view.side:
            return False, "blurred: add light, or focus"
        # Fraction of the diagonal; a tilt by 25 degrees moves corners as far.
        if any(corner_displacement(view, other) < 0.025 for other in self.views):
            return False, self.wanted
        self.views.append(view)
        self.wanted, self.enough = self._missing()
        return True, self.wanted

    def _missing(self) -> tuple[str, bool]:
        """Instruction for the next view, and whether there are enough views."""
        if len(self.views) < 5:  # Number of views from which missing ones can be named.
            return "show the target from other sides, tilted by 20 to 45 degrees", False
        try:
            calibration = calibrate_views(self.views, self.target)
        except InvalidInputError as error:
            return str(error), False
        wanted = wanted_views(calibration)
        if wanted:
            return wanted[0], False
        return f"enough, the camera is {calibration.accuracy}", True
