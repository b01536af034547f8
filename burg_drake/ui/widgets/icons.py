"""Icons of viser's, as SVG; viser itself opens its archive of thousands anew for each."""

from __future__ import annotations

import zipfile
from functools import cache
from importlib.resources import files


@cache
def icon_svg(name: str) -> str:
    """The icon that viser calls `name`, as an element of HTML.

    Args:
        name: one of `viser.Icon`.
    """
    with _archive().open(f"{name}.svg") as file:
        return file.read().decode()


@cache
def _archive() -> zipfile.ZipFile:
    return zipfile.ZipFile(str(files("viser") / "_icons" / "tabler-icons.zip"))
