"""Refuses scenes that cannot stand on a station; one that was not refused before is known."""

from __future__ import annotations

from burg_drake.core import Arrays, cached
from burg_drake.scene.document import Scene, require_no_errors
from burg_drake.station.document import Station, world_content


def require_valid_scene(scene: Scene, station: Station) -> None:
    """Refuses a scene whose grasps would be judged in a world other than the document's.

    Raises:
        InvalidInputError: one line with the first error found.
    """

    def check() -> Arrays:
        from burg_drake.station.checks.scene_issues import check_scene  # imports Drake

        require_no_errors(scene, check_scene(scene, station))
        return {}

    cached("sound-scene", world_content(scene, station), check)
