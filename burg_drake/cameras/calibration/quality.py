"""How far a calibration can be trusted, and what would be better, in sentences."""

from __future__ import annotations

from burg_drake.cameras.calibration.estimation import Calibration
from burg_drake.cameras.calibration.guidance import FEW_VIEWS, wanted_views
from burg_drake.cameras.calibration.promise import UNCERTAIN, UNKNOWN
from burg_drake.cameras.optics import is_local

LARGE_RMS = 1.0
"""Sharp images of a flat target give 0.05 to 0.3 [pixels]."""
UNKNOWN_SHARE = 0.5
"""Of the image, or of its parts; a camera of which less is known is of little use."""


def advice(calibration: Calibration) -> list[str]:
    """What would make a calibration better, a sentence each; empty if it is good."""
    views, promise = calibration.views, calibration.promise
    lines = list(wanted_views(calibration))
    if len(views) < FEW_VIEWS:
        lines.insert(0, f"{len(views)} views are too few; take 15 to 30")
    if calibration.rms > LARGE_RMS:
        lines.append(
            f"the reprojection error of {calibration.rms:.2f} pixels is large: is the target flat,"
            " do its squares and markers have the given sizes, and was the focus fixed?"
        )
    if not promise.known_to <= UNCERTAIN or is_local(promise.except_at):
        lines.append(f"the camera is {promise}")
    return lines


def is_useless(calibration: Calibration) -> bool:
    """Images that this camera model is used for would be misread by pixels."""
    promise = calibration.promise
    bounds = promise.parts.values()
    parts = sum(not bound <= UNKNOWN for bound in bounds) / len(bounds)
    known = promise.known_to <= UNKNOWN and max(promise.unknown, parts) < UNKNOWN_SHARE
    return not known or calibration.rms > UNKNOWN
