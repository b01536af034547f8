"""Grasps as oriented rectangles in the image, for methods that see grasps in a plane.

As in the Cornell data set (Jiang, Moseson and Saxena, "Efficient grasping from RGBD images", ICRA
2011) and GraspNet-1Billion (Fang et al., CVPR 2020): two sides of a rectangle stand for the jaws,
the other two are the opening. Only grasps whose approach is nearly along the optical axis look like
that; graspnetAPI takes those whose approach has an inner product with it above 0.99
(`GraspGroup.to_rect_grasp_group`), and so does the default here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.cameras.optics import NEAR, Intrinsics
from burg_drake.core import Array, Booleans, Indices, InvalidInputError
from burg_drake.dataset.labels.clouds import field_of_view
from burg_drake.dataset.labels.labelled_grasps import LabelledGrasps

MOST_ANGLE = float(np.arccos(0.99))
"""Largest angle between approach and optical axis [rad], graspnetAPI's: 8.1 degrees."""
JAW = 0.02
"""Size of the jaws along y of G, as in GraspNet-1Billion [m]. The Panda hand's pads have 0.0175."""


@dataclass(frozen=True, eq=False)
class GraspRectangles:
    """K rectangles.

    Attributes:
        grasp: (K,) rows of the grasps that they stand for.
        center: (K, 2) u, v of the origin of G [pixels].
        angle: (K,) of the closing direction, from the axis u towards v, in (-pi/2, pi/2] [rad]: a
            grasp and the same with fingers swapped are one.
        opening: (K,) extent along the closing direction [pixels].
        height: (K,) extent across it, of the jaws [pixels].
        depth: (K,) of the origin of G along the optical axis [m].
    """

    grasp: Indices
    center: Array
    angle: Array
    opening: Array
    height: Array
    depth: Array

    def __len__(self) -> int:
        return len(self.grasp)

    @property
    def corners(self) -> Array:
        """(K, 4, 2) u, v of the corners, one after the other; the first and the third side lie
        along the closing direction [pixels]."""
        along = np.stack([np.cos(self.angle), np.sin(self.angle)], axis=-1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
        a, b = 0.5 * self.opening[:, None] * along, 0.5 * self.height[:, None] * across
        corners: Array = self.center[:, None] + np.stack([-a - b, a - b, a + b, b - a], axis=1)
        return corners


def grasp_rectangles(
    grasps: LabelledGrasps,
    intrinsics: Intrinsics,
    *,
    opening: float | None = None,
    jaw: float = JAW,
    most_angle: float = MOST_ANGLE,
) -> GraspRectangles:
    """The rectangles of those grasps that look like one.

    Opening and angle are those of the line between the images of the two pads' centres, the height
    is the distance between the images of the middles of the jaws' ends. With square pixels and an
    approach along the optical axis, the rectangle is the image of the pads; else it deviates by
    terms of the angle, and of the ratio of the focal lengths.

    Args:
        grasps: in the camera's frame.
        intrinsics: of the camera; lens distortion is that of its images.
        opening: distance between the pads [m]; each grasp's own width if None.
        jaw: size of the jaws along y of G [m].
        most_angle: largest angle between approach and optical axis [rad].

    Returns:
        Rectangles of the grasps within the angle whose centre is in the image; `grasp` says which.

    Raises:
        InvalidInputError: a length or the angle is not above 0, the angle is not below a right one,
            or no opening is given and the width of a grasp in view is not known.
    """
    for name, value in (("opening", opening), ("jaw", jaw), ("most_angle", most_angle)):
        if value is not None and not 0.0 < value < np.inf:
            raise InvalidInputError(f"{name} of rectangles is {value:g}; give more than 0")
    if most_angle >= np.pi / 2:
        raise InvalidInputError(
            f"most_angle of rectangles is {most_angle:g} rad; give less than pi / 2"
        )
    chosen = np.flatnonzero(_in_view(grasps.X_CG, intrinsics, most_angle))
    X_CG = grasps.X_CG[chosen]
    width = grasps.width[chosen] if opening is None else np.full(len(chosen), opening)
    if np.isnan(width).any():
        first = int(chosen[np.isnan(width)][0])
        raise InvalidInputError(
            f"the width of grasp {first} is unknown; give the opening of its rectangle"
        )
    p, closing, across = X_CG[:, :3, 3], X_CG[:, :3, 0], X_CG[:, :3, 1]
    along = _span(intrinsics, p, 0.5 * width[:, None] * closing)
    return GraspRectangles(
        grasp=chosen,
        center=intrinsics.project(p),
        angle=_half_turn(np.arctan2(along[:, 1], along[:, 0])),
        opening=np.linalg.norm(along, axis=1),
        height=np.linalg.norm(_span(intrinsics, p, 0.5 * jaw * across), axis=1),
        depth=p[:, 2].copy(),
    )


def _in_view(X_CG: Array, intrinsics: Intrinsics, most_angle: float) -> Booleans:
    """(N,) whether the approach is within the angle, and the origin of G in the image."""
    p = X_CG[:, :3, 3]
    chosen: Booleans = (X_CG[:, 2, 2] >= np.cos(most_angle)) & (p[:, 2] >= NEAR)
    if not intrinsics.is_pinhole:  # far outside, a lens model leads back into the image
        chosen &= field_of_view(intrinsics).sees(p)
    pixel = intrinsics.project(p[chosen])
    size = np.array((intrinsics.width, intrinsics.height))
    chosen[chosen] = ((pixel >= -0.5) & (pixel < size - 0.5)).all(axis=1)
    return chosen


def _span(intrinsics: Intrinsics, p_CQ: Array, half: Array) -> Array:
    """(K, 2) from the images of points moved back by some vectors to those of points moved on."""
    span: Array = intrinsics.project(p_CQ + half) - intrinsics.project(p_CQ - half)
    return span


def _half_turn(angle: Array) -> Array:
    """Directions of lines, in (-pi/2, pi/2]."""
    turned: Array = np.pi / 2 - (np.pi / 2 - angle) % np.pi
    return turned
