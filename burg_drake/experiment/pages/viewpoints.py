"""From where a grasp, or a whole scene, is seen best.

The board lies before the viewer as before the operator: its near edge is y = 0, and what is not
seen from the front is seen from a side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, make_pose, transform_points
from burg_drake.experiment.pages.painting import Viewpoint
from burg_drake.geometry import RayCaster
from burg_drake.visualization.meshcat import fit_camera, looking

HALF_VIEW, NARROW = 0.24, 0.06
"""Tangents of half the vertical angle of view: little perspective, and hardly any from above."""
FILL = 0.86
"""Share of a picture that is filled."""
AZIMUTHS = np.deg2rad(np.array([0.0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180]))
"""Of cameras about the vertical; 0 is in front of the board, positive to the right [rad]."""
ELEVATIONS = np.deg2rad(np.array([28.0, 48.0]))
"""By which cameras look down [rad]."""
FINGERS, ACROSS, FRONT = 0.7, 0.5, 0.25
"""What counts beside seeing the target: seeing the fingers, both of them beside each other, and to
look from the front."""
SAMPLES = 80
"""Points of the target that are looked for."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A grasp to be looked at, in S [m].

    Attributes:
        X_SG: (4, 4) the grasp.
        width: distance between the pads.
        target: (N, 3) points on the target's surface.
        hand: (N, 3) points around the hand.
    """

    X_SG: Array
    width: float
    target: Array
    hand: Array


def pinhole(size: tuple[int, int], half_view: float = HALF_VIEW) -> Intrinsics:
    """A camera by its image size and the tangent of half its vertical angle of view."""
    width, height = size
    focal = height / 2.0 / half_view
    center = ((width - 1) / 2.0, (height - 1) / 2.0)
    return Intrinsics(width=width, height=height, focal=(focal, focal), center=center)


def direction(azimuth: float, elevation: float) -> Array:
    """(3,) where a camera looks, in S."""
    level = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.cos(elevation) * level - np.array([0.0, 0.0, np.sin(elevation)])


def grasp_viewpoint(
    subject: Subject, scene: RayCaster, hand: RayCaster, X_HS: Array, size: tuple[int, int]
) -> Viewpoint:
    """The viewpoint from which a grasp shows most.

    Args:
        subject: the grasp.
        scene: all that stands on the board, in S.
        hand: the hand, in a frame of its own.
        X_HS: (4, 4) S in that frame.
        size: width and height of the picture [pixel].
    """
    candidates = [(a, e) for e in ELEVATIONS for a in AZIMUTHS]
    chosen = max(candidates, key=lambda c: _score(subject, scene, hand, X_HS, *c))
    return fitted(np.vstack([subject.target, subject.hand]), direction(*chosen), size)


def fitted(points: Array, forward: Array, size: tuple[int, int]) -> Viewpoint:
    """The nearest viewpoint in a direction that has all points (N, 3) in view."""
    return _nearest(points, looking(forward), size, HALF_VIEW)


def above(points: Array, size: tuple[int, int]) -> Viewpoint:
    """From straight above; the board's far edge is at the top of the picture."""
    return _nearest(points, np.diag([1.0, -1.0, -1.0]), size, NARROW)


def _nearest(points: Array, R_SC: Array, size: tuple[int, int], half_view: float) -> Viewpoint:
    half = FILL * half_view * np.array([size[0] / size[1], 1.0])
    return Viewpoint(make_pose(R_SC, fit_camera(points, R_SC, half)), pinhole(size, half_view))


def _score(
    subject: Subject,
    scene: RayCaster,
    hand: RayCaster,
    X_HS: Array,
    azimuth: float,
    elevation: float,
) -> float:
    forward = direction(azimuth, elevation)
    step = max(1, len(subject.target) // SAMPLES)
    target, fingers = subject.target[::step], _fingers(subject)
    seen = _free(scene, target, -forward)
    in_hand = transform_points(X_HS, target)
    seen &= _free(hand, in_hand, -(X_HS[:3, :3] @ forward))
    across = np.linalg.norm(np.cross(subject.X_SG[:3, 0], forward))
    return float(
        seen.mean()
        + FINGERS * _free(scene, fingers, -forward).mean()
        + ACROSS * across
        + FRONT * (1.0 + np.cos(azimuth)) / 2.0
    )


def _fingers(subject: Subject) -> Array:
    """(N, 3) points of both fingers."""
    half = subject.width / 2.0 + 0.005
    along = -np.linspace(0.0, 0.04, 6)
    points = np.array([[side * half, 0.0, z] for side in (-1.0, 1.0) for z in along])
    return transform_points(subject.X_SG, points)


def _free(rays: RayCaster, points: Array, direction: Array) -> np.ndarray:
    """(N,) whether nothing is in the way from points in a direction; little starts off them."""
    face, _ = rays.first_hits(points + 1e-3 * direction, np.tile(direction, (len(points), 1)))
    return np.asarray(face < 0)
