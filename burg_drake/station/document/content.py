"""What a scene on a station follows from, down to the bytes of the files that Drake reads.

`Scene.content` knows objects by how they were built, so that a run can be recognised wherever its
library was copied to. Who keeps what follows from the files also has to see that one of them was
edited, damaged or removed since.
"""

from __future__ import annotations

from pathlib import Path

from burg_drake.core import content_hash
from burg_drake.core.paths import named_files
from burg_drake.scene.document import Scene
from burg_drake.station.document.station_document import Station


def world_content(scene: Scene, station: Station) -> str:
    """Hash of scene and station with all files of the scene's objects that are there."""
    library = scene.library
    files: list[list[str | Path]] = []
    for name in sorted({i.object for i in (*scene.instances.values(), *scene.background.values())}):
        entry = library.entry(name)
        own = {file: library.root / file for file in entry.files}
        files += [[file, path] for file, path in own.items() if path.is_file()]
        if own[entry.sdf].is_file():
            named = named_files(own[entry.sdf], station.packages)
            files += [[name, path] for path in named if path not in own.values()]
    return content_hash(scene.content, station.content, files)
