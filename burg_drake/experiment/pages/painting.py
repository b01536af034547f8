"""What painters of pictures have in common: they are told what stands where and from where it is
seen, and return colours, and what each pixel shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, inverse, transform_points
from burg_drake.experiment.pages.scene_bodies import PlacedBody

NOTHING = -1
BACKGROUND = (0.953, 0.961, 0.969)


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """From where a picture is seen.

    Attributes:
        X_SC: (4, 4) camera's optical frame in the scene frame.
        intrinsics: of a camera without distortion.
    """

    X_SC: Array
    intrinsics: Intrinsics

    def project(self, p_SQ: Array) -> Array:
        """(..., 2) pixels of points (..., 3) before the camera, in S [m]."""
        return self.intrinsics.project(transform_points(inverse(self.X_SC), p_SQ))


@dataclass(frozen=True, eq=False)
class Painting:
    """A picture.

    Attributes:
        color: (H, W, 3) RGB.
        owner: (H, W) index of the placed body that each pixel shows, `NOTHING` where there is none.
    """

    color: NDArray[np.uint8]
    owner: NDArray[np.int32]

    def shows(self, placed: Sequence[PlacedBody], name: str) -> NDArray[np.bool_]:
        """(H, W) which pixels show the bodies of a name."""
        mine = [i for i, one in enumerate(placed) if one.name == name]
        return np.isin(self.owner, mine)


class Painter(Protocol):
    """Paints pictures of bodies."""

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """A picture of bodies from a viewpoint."""
        ...


def finer(intrinsics: Intrinsics, times: int) -> Intrinsics:
    """The same camera with `times` times as many pixels each way; pixel centres at integers."""
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    return Intrinsics(
        width=times * intrinsics.width,
        height=times * intrinsics.height,
        focal=(times * fx, times * fy),
        center=(times * (cx + 0.5) - 0.5, times * (cy + 0.5) - 0.5),
    )
