"""Lower bounds of the open hand's signed distance from the bodies of a scene: boxes and spheres.

A bound is a signed distance of shapes that contain the real ones: where it is positive the shapes
are at least that far apart, where it is negative they are at most that deep in each other.

Elementwise arithmetic throughout: a bound does not depend on the batch that a grasp is in.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import Array, Indices
from burg_drake.geometry.body import Body, HandParts
from burg_drake.geometry.poses import Poses, rotate

Pairs = tuple[Indices, ...]
"""Grasps, parts of the hand and bodies, (K,) each."""


class SceneBoxes:
    """Spheres about the parts of a hand, and boxes around bodies and around their pieces.

    Args:
        hand: convex parts of the open hand.
        bodies: at least one.

    Attributes:
        X_BW: (B,) poses of the world in the bodies.
    """

    def __init__(self, hand: HandParts, bodies: Sequence[Body]) -> None:
        self._X_GH = hand.X_HG.inverse()
        self._hand_half, self._radius = hand.half, hand.radius
        inverses = [body.X_WB.inverse() for body in bodies]
        self.X_BW = Poses(np.array([X.R for X in inverses]), np.array([X.p for X in inverses]))
        self._low = np.array([body.low for body in bodies])
        self._high = np.array([body.high for body in bodies])
        self._size = np.array([body.size for body in bodies])
        self._start = np.cumsum(self._size) - self._size
        self._center = np.concatenate([body.center for body in bodies]).T.copy()
        self._half = np.concatenate([body.half for body in bodies]).T.copy()

    def around_bodies(self, X_WG: Poses) -> Array:
        """Bounds (N, H, B) [m] for N grasps, H parts of the hand and B bodies: of the sphere about
        the part and the box around the body."""
        p_WH = (X_WG[:, None] @ self._X_GH[None]).p
        p_B = self.X_BW.apply(p_WH[:, :, None])
        gaps = np.maximum(self._low - p_B, p_B - self._high)
        return _signed(gaps[..., 0], gaps[..., 1], gaps[..., 2]) - self._radius[:, None]

    def around_pieces(self, X_WG: Poses, pairs: Pairs) -> tuple[Indices, Indices, Array]:
        """Bounds for all pieces of the bodies: of boxes along the axes of the bodies.

        Args:
            X_WG: (N,) grasps.
            pairs: K grasps, parts and bodies.

        Returns:
            Places (T,) of the pairs, indices (T,) of the pieces of all bodies, and bounds (T,) [m].
        """
        grasp, part, body = pairs
        X_BH = self.X_BW[body] @ X_WG[grasp] @ self._X_GH[part]
        reach = rotate(np.abs(X_BH.R), self._hand_half[part])
        count = self._size[body]
        pair = np.repeat(np.arange(len(grasp)), count)
        first = self._start[body] - (np.cumsum(count) - count)
        piece = np.arange(len(pair)) + np.repeat(first, count)
        x, y, z = (
            np.abs(np.repeat(X_BH.p[:, k], count) - self._center[k, piece])
            - np.repeat(reach[:, k], count)
            - self._half[k, piece]
            for k in range(3)
        )
        return pair, piece, _signed(x, y, z)

    def along_parts(self, X_WG: Poses, pairs: Pairs, piece: Indices) -> Array:
        """Bounds (K,) for one piece each [m]: of boxes along the axes of the parts."""
        grasp, part, body = pairs
        X_HB = (self.X_BW[body] @ X_WG[grasp] @ self._X_GH[part]).inverse()
        p_H = X_HB.apply(self._center[:, piece].T)
        reach = rotate(np.abs(X_HB.R), self._half[:, piece].T)
        x, y, z = (np.abs(p_H) - reach - self._hand_half[part]).T
        return _signed(x, y, z)


def _signed(x: Array, y: Array, z: Array) -> Array:
    """Signed distance of two boxes with common axes from the gaps along these: negative is how deep
    they overlap."""
    far = np.maximum(x, 0.0), np.maximum(y, 0.0), np.maximum(z, 0.0)
    distance = np.sqrt(far[0] * far[0] + far[1] * far[1] + far[2] * far[2])
    return np.asarray(distance + np.minimum(np.maximum(np.maximum(x, y), z), 0.0))
