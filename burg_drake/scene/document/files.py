"""The scene files that references stand for: files, folders of scenes, and patterns."""

from __future__ import annotations

import glob
from collections.abc import Iterable
from pathlib import Path

from burg_drake.core import InvalidInputError

SAMPLED = "scene_*.yaml"
"""Names of scenes that were sampled into a folder."""
NO_SCENE = ("recipe.yaml", "library.yaml", "run.yaml", "campaign.yaml", "station.yaml")
"""Documents that may lie beside scenes."""


def scene_references(references: Iterable[str]) -> list[str]:
    """References of scenes, each of them one scene.

    Args:
        references: of scenes as `load_scene` takes them; a folder stands for the scenes in it, and
            a pattern, which a shell has not replaced, for the files that fit it.

    Returns:
        References in the order given, those of a folder or pattern sorted.

    Raises:
        InvalidInputError: a folder has no scenes, or no file fits a pattern.
    """
    found: list[str] = []
    for reference in references:
        path = Path(reference)
        if path.is_dir():
            found += map(str, _in_folder(path))
        elif any(sign in reference for sign in "*?[") and not path.exists():
            files = sorted(glob.glob(reference))
            if not files:
                raise InvalidInputError(f"no file matches {reference}; give scene files")
            found += files
        else:
            found.append(reference)
    return found


def _in_folder(folder: Path) -> list[Path]:
    sampled = sorted(folder.glob(SAMPLED), key=lambda path: (len(path.name), path.name))
    others = [path for path in sorted(folder.glob("*.yaml")) if path.name not in NO_SCENE]
    if not (sampled or others):
        raise InvalidInputError(f"folder {folder} has no scenes (*.yaml); give scene files")
    return sampled or others
