"""Grasps have to be where their objects are: finds other units, and names that were mixed up."""

from __future__ import annotations

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import GraspSet
from burg_drake.objects.library import ObjectLibrary

FARTHEST = 0.25
"""Distance of G from an object's bounding box that the nearest of its grasps may have [m]. G is
between the pads; no parallel hand that we know of opens that far."""


def require_near(
    grasps: GraspSet, library: ObjectLibrary, source: str, *, is_file: bool = True
) -> None:
    """Refuses grasps of an object that are all far from it.

    Args:
        grasps: in the frames of their objects; objects that the library lacks do not matter.
        library: has the objects.
        source: where the grasps are from, for the message.
        is_file: whether that is a file, of which a user can say what its names mean.

    Raises:
        InvalidInputError: the nearest grasp of an object is more than `FARTHEST` from it.
    """
    for name in sorted(set(grasps.object.tolist()) & set(library.objects)):
        entry = library.entry(name)
        p_OG = grasps.X_OG[grasps.object == name, :3, 3]
        outside = np.maximum(0.0, np.maximum(entry.lower - p_OG, p_OG - np.array(entry.upper)))
        nearest = np.linalg.norm(outside, axis=-1).min()
        if nearest > FARTHEST:
            raise InvalidInputError(
                f"{source}: the nearest grasp of object {name!r} is {nearest:.3g} m away"
                " from it; are lengths in metres, is it the right object, and is the"
                " frame of the grasps right?"
            ).about("objects", "frame")
