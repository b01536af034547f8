"""Which views of the target would make a calibration better, the most wanted first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.cameras.calibration.estimation import CalibratedView, Calibration
from burg_drake.cameras.calibration.image_parts import coverage, unseen_parts
from burg_drake.cameras.calibration.promise import UNCERTAIN, Promise
from burg_drake.core import transform_points

TILTED = np.radians(15.0)
"""Views that are tilted less hardly tell the focal length from the distance."""
TILTED_VIEWS = 2
"""To each side."""
SIDES = {"left": (0, 1.0), "right": (0, -1.0), "up": (1, 1.0), "down": (1, -1.0)}
"""Where a tilted target faces: the coordinate of its z axis, which points away from the camera, and
its sign."""
SIDEWARD = 0.5
"""Of what a target is tilted by, the share that has to be toward a side."""
NEARER = 1.3
"""The farthest view ought to be that many times as far as the nearest, at least."""
LARGE = 45.0
"""Side of a square from which on the nearest view is near [pixels]."""
FEW_VIEWS = 10


def wanted_views(calibration: Calibration) -> tuple[str, ...]:
    """What to do with the target, in a few words each; none if there are views enough."""
    camera, promise = calibration.intrinsics, calibration.promise
    bound = promise.parts
    counts = coverage([used.view for used in calibration.views], (camera.width, camera.height))
    unseen = unseen_parts(counts)
    worst_first = sorted(bound, key=lambda name: -bound[name])
    hidden = [name for name in worst_first if name in unseen]
    poor = [name for name in worst_first if not (name in unseen or bound[name] <= UNCERTAIN)]
    lines = []
    if hidden:
        lines.append(f"move the target into and across the {_listed(hidden, promise)}")
    lines += _tilts(calibration.views)
    lines += _distances(calibration)
    if poor:
        lines.append(f"show more of the target at the {_listed(poor, promise)}")
    count = len(calibration.views)
    if not lines and count < FEW_VIEWS:
        lines = [f"take more views from all sides; {count} are too few"]
    return tuple(lines)


def _listed(names: Sequence[str], promise: Promise) -> str:
    """Parts of the image and what is known of them; the first is the worst."""
    first, *others = names
    text = f"{first} of the image, where the error may be {promise.bound(first)} pixels"
    return ", ".join([text, *(f"then the {name} ({promise.bound(name)})" for name in others)])


def _tilts(views: Sequence[CalibratedView]) -> list[str]:
    """The sides to which the target was hardly tilted."""
    toward = np.array([used.X_CT[:2, 2] for used in views if used.tilt > TILTED]).reshape(-1, 2)
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-9)
    missing = [
        side
        for side, (axis, sign) in SIDES.items()
        if (sign * toward[:, axis] > SIDEWARD).sum() < TILTED_VIEWS
    ]
    if not missing:
        return []
    return [f"tilt the target by 20 to 45 degrees, so that it faces {', then '.join(missing)}"]


def _distances(calibration: Calibration) -> list[str]:
    """Whether the target was always as far away."""
    views, middle = calibration.views, np.array([*calibration.target.size, 0.0]) / 2.0
    places = transform_points(np.array([used.X_CT for used in views]), middle[None])
    distance = np.linalg.norm(places, axis=-1)
    if distance.max() > NEARER * distance.min():
        return []
    near = max(used.view.side for used in views) >= LARGE
    return ["take some views from farther away" if near else "take some views from nearer"]
