"""All distances of grasps to grasps, pair by pair, for the tests that compare grasps."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from burg_drake.core import Array
from burg_drake.grasping import (
    DISTANCE_LEVER,
    check_lever,
    grasp_components,
    pair_angle,
    pair_translation,
)


@dataclass(frozen=True, eq=False)
class PoseDistances:
    """Distances of pairs of grasps.

    Attributes:
        translation: (...,) between the origins of the grasp frames [m].
        angle: (...,) of the rotation between them, the smaller one of both finger forms, in
            [0, pi] [rad].
        combined: (...,) translation + lever * angle [m].
    """

    translation: Array
    angle: Array
    combined: Array


def pose_distances(
    X_OG: ArrayLike, X_OF: ArrayLike, *, lever: float = DISTANCE_LEVER
) -> PoseDistances:
    """Distances of grasps to grasps, pair by pair.

    Args:
        X_OG: (..., 4, 4) grasp poses.
        X_OF: (..., 4, 4) grasp poses in the same frame; leading shapes broadcast, so that
            `X_OG[:, None]` and `X_OF[None]` give all pairs.
        lever: weight of the angle [m/rad].

    Raises:
        InvalidInputError: the lever is negative or not finite.
    """
    check_lever(lever)
    G, F = grasp_components(X_OG), grasp_components(X_OF)
    translation, angle = pair_translation(G, F), pair_angle(G, F)
    return PoseDistances(translation, angle, translation + lever * angle)
