"""Refuses scenes that cannot stand on a station; one that was not refused before is known."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Arrays, cached
from burg_drake.scene.document import Scene, require_no_errors
from burg_drake.station.document import Station, world_content


def require_valid_scene(scene: Scene, station: Station) -> tuple[str, ...]:
    """Refuses a scene whose grasps would be judged in a world other than the document's.

    Returns:
        Warnings, such as of objects that hover, a sentence each.

    Raises:
        InvalidInputError: one line with the first error found.
    """

    def check() -> Arrays:
        from burg_drake.station.checks.scene_issues import check_scene  # imports Drake

        issues = check_scene(scene, station)
        require_no_errors(scene, issues)
        warnings = "\n".join(issue.message for issue in issues)
        return {"warnings": np.frombuffer(warnings.encode(), dtype=np.uint8)}

    found = cached("sound-scene", world_content(scene, station), check)["warnings"]
    return tuple(found.tobytes().decode().splitlines())
