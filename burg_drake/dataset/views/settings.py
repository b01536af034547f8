"""What views of a scene are drawn: a part of documents that say how a data set is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from burg_drake.core import FieldError
from burg_drake.core.documents import Pose, Ranges, require_ranges, require_rising

SPHERE, WRIST = "sphere", "wrist"
"""Cameras that no station has: around the scene, and on the hand."""
FARTHEST = 100.0
"""Of a camera from what it looks at [m]."""


Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class ViewpointSettings:
    """How views of a scene are drawn.

    A view looks at a point near the mean of the objects' centres.

    Attributes:
        cameras: cameras, each with the same probability: `sphere` (around the scene), `wrist` (on
            the hand), or names of cameras of the station.
        distance: smallest and largest distance of the camera from the point it looks at [m].
        elevation_deg: smallest and largest angle of the camera above the board [degrees].
        azimuth_deg: smallest and largest angle of the camera about the vertical, from the board's x
            axis, counter-clockwise from above [degrees].
        aim: largest distance of the point looked at from the scene's middle [m].
        roll_deg: smallest and largest angle about the optical axis [degrees]; at 0 rows of the
            image are level.
        position_jitter: largest distance of the station's cameras from their places [m].
        angle_jitter_deg: largest turn of the station's cameras about a random axis [degrees].
        X_HC: pose of the wrist camera in the hand's frame; beside the hand, looking along the
            fingers, if null.
        in_view: smallest share of the objects whose centres a view has to show, 0 to 1. One is
            always shown.
        draws: number of drafts of a view until it is given up.

    Raises:
        FieldError: a value is out of its range, a range falls, or there is no camera.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "aim": (0.0, FARTHEST),
        "position_jitter": (0.0, FARTHEST),
        "angle_jitter_deg": (0.0, 180.0),
        "in_view": (0.0, 1.0),
        "draws": (1, 100_000),
        "distance": (1e-3, FARTHEST),
        "elevation_deg": (-90.0, 90.0),
        "azimuth_deg": (-360.0, 360.0),
        "roll_deg": (-360.0, 360.0),
    }

    cameras: tuple[str, ...] = (SPHERE,)
    distance: Range = (0.5, 1.0)
    elevation_deg: Range = (25.0, 75.0)
    azimuth_deg: Range = (-180.0, 180.0)
    aim: float = 0.08
    roll_deg: Range = (-10.0, 10.0)
    position_jitter: float = 0.0
    angle_jitter_deg: float = 0.0
    X_HC: Pose | None = None
    in_view: float = 0.0
    draws: int = 200

    def __post_init__(self) -> None:
        if not self.cameras:
            raise FieldError(
                f"cameras is empty; give {SPHERE!r}, {WRIST!r} or cameras of the station",
                "cameras",
            )
        require_ranges(self)
        for name in self.RANGES:
            if isinstance(pair := getattr(self, name), tuple):
                require_rising(pair, name)
