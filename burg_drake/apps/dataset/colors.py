"""What the verbs do where Drake's renderer lacks system libraries: all but colours, and say so."""

from __future__ import annotations

import sys
from pathlib import Path


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


def require_renderer_for(folder: Path) -> None:
    """Refuses to go on with a data set that has colours where they cannot be rendered.

    Raises:
        MissingDependencyError: it cannot be gone on with here.
        DocumentError: its document is damaged, or of another version.
    """
    from burg_drake.core import MissingDependencyError
    from burg_drake.dataset.samples import FILE, load_dataset_document
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    if not missing or not (folder / FILE).exists():
        return
    recipe = load_dataset_document(folder / FILE).recipe or {}
    if recipe.get("colors"):
        raise MissingDependencyError(
            f"{folder} has samples with colours, and is continued with colours alone:"
            f" {describe_missing(missing)}"
        )
