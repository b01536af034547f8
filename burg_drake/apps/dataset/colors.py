"""What the verbs do where Drake's renderer lacks system libraries: all but colours, and say so."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from burg_drake.dataset.generating import DatasetRecipe


def warn_without_colors(consequence: str) -> bool:
    """Whether colours cannot be rendered here; a line on stderr then says what to install.

    Args:
        consequence: begins the line, such as `the data set has no colours`.
    """
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    if missing:
        line = f"burg-drake: warning: {consequence}: {describe_missing(missing)}"
        print(line, file=sys.stderr)
    return bool(missing)


def with_possible_colors(recipe: DatasetRecipe, folder: Path) -> DatasetRecipe:
    """A recipe without colours where they cannot be rendered, which a line on stderr says.

    Args:
        recipe: as asked for.
        folder: of the data set, which may be there.

    Raises:
        MissingDependencyError: the folder has samples with colours, and cannot be continued here.
        DocumentError: its document is damaged, or of another version.
    """
    from dataclasses import replace

    from burg_drake.core import MissingDependencyError
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    if not recipe.colors or recipe.renderer != "drake" or not missing:
        return recipe
    if _has_colors(folder):
        raise MissingDependencyError(
            f"the samples of {folder} have colours, and so must new ones:"
            f" {describe_missing(missing)}"
        )
    dark = ", and its sensor depth no holes at dark surfaces" if recipe.sensor else ""
    warn_without_colors(f"the data set has no colours{dark}")
    return replace(recipe, colors=False)


def _has_colors(folder: Path) -> bool:
    """Whether a folder holds a data set that is generated with colours."""
    from burg_drake.dataset.samples import FILE, load_dataset_document

    if not (folder / FILE).exists():
        return False
    return bool((load_dataset_document(folder / FILE).recipe or {}).get("colors"))
