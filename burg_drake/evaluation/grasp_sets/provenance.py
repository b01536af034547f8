"""Which documents a set of grasps was made with, as its provenance tells it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from burg_drake.evaluation.records import software_versions
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Scene
from burg_drake.station.document import Hand, Station


def set_documents(
    library: ObjectLibrary, scene: Scene | None, station: Station, objects: Iterable[str]
) -> dict[str, Any]:
    """Documents, the content that they had, and versions of the software, as JSON values.

    Args:
        library: has the objects.
        scene: where they stand; then it is named, else the library.
        station: whose hand it is.
        objects: names of those that there are grasps of.
    """
    kind, document = ("library", library.root) if scene is None else ("scene", scene.path)
    return {
        kind: str(document.resolve()),
        "station": str(station.path.resolve()),
        "hand": hand_entry(station.hand, station.hand_path),
        "content": {
            **({} if scene is None else {"scene": scene.content}),
            "station": station.content,
            "objects": {name: library.entry(name).build for name in objects},
        },
        "versions": software_versions(),
    }


def hand_entry(hand: Hand, document: Path | None) -> dict[str, str]:
    """How a provenance names the hand that grasps are for."""
    return {"name": hand.name, **({"document": str(document.resolve())} if document else {})}


def object_files(library: ObjectLibrary, objects: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Mesh and physics of objects, under the names that `formats.common.one_object` knows."""
    return {name: _described(library, name) for name in objects}


def _described(library: ObjectLibrary, object: str) -> dict[str, Any]:
    entry = library.entry(object)
    return {
        "file": str(library.path(entry.surface or entry.mesh).resolve()),
        "scale": 1.0,
        "mass": entry.mass,
        "com": list(entry.mass_properties.center_of_mass),
        "friction": entry.friction,
    }
