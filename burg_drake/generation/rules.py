"""Rules that a sampled scene can be asked to fulfil, beyond standing there."""

from __future__ import annotations

from burg_drake.cameras.projection import visible_from
from burg_drake.core import InvalidInputError, UnknownNameError, nearest
from burg_drake.evaluation.stages import clear_grasp_counts, within_reach
from burg_drake.scene.document import Scene, SceneRecipe
from burg_drake.station.document import Station

OUT_OF_REACH = "an object is out of the arm's reach"
FEW_GRASPS = "an object has too few clear grasps"
HIDDEN = "the camera does not see half of an object"

LEAST_SEEN = 0.5
"""Share of an object's silhouette that a camera has to see."""
LEAST_SAMPLED, SPARE = 50, 2
"""Grasps that are sampled for each object, at least, and for each that has to be clear."""


def require_rules(recipe: SceneRecipe, station: Station) -> None:
    """Refuses rules that cannot be asked on a station.

    Raises:
        UnknownNameError: the station has no such camera.
        InvalidInputError: it has no arm, whose reach is asked for.
    """
    cameras = station.document.cameras
    if recipe.visible_from and recipe.visible_from not in cameras:
        raise UnknownNameError(
            f"station {station.name!r} has no camera {recipe.visible_from!r};"
            f" {nearest(recipe.visible_from, cameras)}"
        )
    if recipe.within_reach and station.document.arm is None:
        raise InvalidInputError(
            f"within_reach needs an arm, but station {station.name!r} has none; choose another"
            " station"
        )


def broken_rule(scene: Scene, station: Station, recipe: SceneRecipe) -> str:
    """The first of a recipe's rules that a scene breaks, as a reason to refuse it; "" if none.

    Raises:
        BurgError: the arm collides in its home posture, for example; see
            `evaluation.stages.scene_acceptance`.
    """
    if recipe.visible_from:
        seen = visible_from(scene, station, recipe.visible_from)
        if min(seen.values(), default=0.0) < LEAST_SEEN:
            return HIDDEN
    if recipe.clear_grasps:
        sampled = max(LEAST_SAMPLED, SPARE * recipe.clear_grasps)
        clear = clear_grasp_counts(scene, station, grasps_per_object=sampled)
        if min(clear.values(), default=0) < recipe.clear_grasps:
            return FEW_GRASPS
    if recipe.within_reach and within_reach(scene, station):
        return OUT_OF_REACH
    return ""
