"""Rejects scenes that are invalid on a station; results are cached by content.

Drake is imported only if the result is not in the cache.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core import Arrays, cached, content_hash, referenced_files
from burg_drake.scene import Scene, require_no_errors
from burg_drake.station.station_document import Station


def world_content(scene: Scene, station: Station) -> str:
    """Hash of scene and station, with all existing files of the scene's objects."""
    library = scene.library
    files: list[list[str | Path]] = []
    for name in sorted({i.object for i in (*scene.instances.values(), *scene.background.values())}):
        entry = library.entry(name)
        own = {file: library.root / file for file in entry.files}
        files += [[file, path] for file, path in own.items() if path.is_file()]
        if own[entry.sdf].is_file():
            named = referenced_files(own[entry.sdf], station.packages)
            files += [[name, path] for path in named if path not in own.values()]
    return content_hash(scene.content, station.content, files)


def require_valid_scene(scene: Scene, station: Station) -> tuple[str, ...]:
    """Rejects a scene with errors, such as overlaps, with which simulation would not match the
    document.

    Returns:
        Warnings, one sentence each, such as about hovering objects.

    Raises:
        InvalidInputError: one line with the first error found.
    """

    def check() -> Arrays:
        from burg_drake.station.scene_check import check_scene  # imports Drake

        issues = check_scene(scene, station)
        require_no_errors(scene, issues)
        warnings = "\n".join(issue.message for issue in issues)
        return {"warnings": np.frombuffer(warnings.encode(), dtype=np.uint8)}

    found = cached("sound-scene", world_content(scene, station), check)["warnings"]
    return tuple(found.tobytes().decode().splitlines())
