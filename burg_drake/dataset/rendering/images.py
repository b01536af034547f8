"""What a camera sees of a scene: images of the same size and the same pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Bytes, Single
from burg_drake.scene.document import Scene

SURROUNDINGS = 0
"""Label of what is no object of the scene: table, board, obstacles, robot, distractors, sky."""


@dataclass(frozen=True, eq=False)
class Images:
    """Images of one view; those that were not asked for are None.

    Labels and normals are those of the nearest surface, whether its depth is in the depth range of
    the view or not: a pixel can have both and no depth.

    Attributes:
        color: (H, W, 3) red, green, blue.
        depth: (H, W) distance along the optical axis [m]; 0 where nothing is in the depth range.
        labels: (H, W) number of the instance that the pixel's centre shows: 1 for the first free
            one of the scene, free ones before background; `SURROUNDINGS` for everything else.
        normals: (H, W, 3) unit normals of the surfaces' faces in the camera frame, towards the
            camera; 0 where nothing is.
    """

    color: Bytes | None = None
    depth: Single | None = None
    labels: NDArray[np.uint16] | None = None
    normals: Single | None = None


def instance_numbers(scene: Scene) -> dict[str, int]:
    """Numbers of instances in label images by name: from 1, free ones before background."""
    names = (*scene.instances, *scene.background)
    return {name: number for number, name in enumerate(names, SURROUNDINGS + 1)}
