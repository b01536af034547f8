"""What data sets refer to outside of their folder: libraries and stations, and their contents."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from burg_drake.core import InvalidInputError, content_hash
from burg_drake.core.paths import PACKAGE_URI, builtin_names, portable_reference, resolve
from burg_drake.dataset.generating.recipe import DatasetRecipe
from burg_drake.dataset.samples import DatasetDocument
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.station.document import Station, load_station

HASH_DIGITS = 16


def library_content(library: ObjectLibrary) -> str:
    """Hash of what is in a library."""
    return content_hash(library.content)[:HASH_DIGITS]


def portable_recipe(recipe: DatasetRecipe, folder: Path) -> DatasetRecipe:
    """A recipe whose references, to a library of distractors and a run, start from the folder of
    the data set and not from the working directory.

    Args:
        recipe: with a built-in name, or paths from the working directory.
        folder: of the data set.

    Raises:
        UnknownNameError: there is no such library.
    """
    run = portable_reference(Path(recipe.run), folder) if recipe.run else ""
    if recipe.looks is None:
        return replace(recipe, run=run)
    root = load_library(recipe.looks.distractor_library).root
    looks = replace(recipe.looks, distractor_library=portable_reference(root, folder))
    return replace(recipe, run=run, looks=looks)


def placed_library(reference: str, folder: Path) -> str:
    """Where a library is that a data set refers to.

    Raises:
        UnknownNameError: it is not there.
    """
    if reference.startswith(PACKAGE_URI) or reference in builtin_names("models"):
        return str(resolve(reference, "models"))
    return str(resolve(_from(folder, reference)))


def run_folder(recipe: DatasetRecipe, folder: Path) -> Path:
    """The folder of the run that a data set takes grasps from."""
    return _from(folder, recipe.run)


def _from(folder: Path, reference: str) -> Path:
    """A path from the folder of a data set, which may not be there yet."""
    return Path(os.path.normpath(folder.absolute() / reference))


def distractors_content(recipe: DatasetRecipe, folder: Path) -> str:
    """Hash of what is in the library that distractors are from; empty without one."""
    if recipe.looks is None or not recipe.looks.distractors[1]:
        return ""
    root = placed_library(recipe.looks.distractor_library, folder)
    return library_content(load_library(root))


def require_same_contents(
    document: DatasetDocument, recipe: DatasetRecipe, folder: Path
) -> Station:
    """The station of a data set, if its libraries and itself are what they were.

    Raises:
        InvalidInputError: one is another now; the message names it.
        UnknownNameError: one is not there any more.
    """
    library = load_library(resolve(document.library, "models", folder))
    station = load_station(resolve(document.station, "stations", folder))
    for what, then, now in (
        (f"library {library.root}", document.library_content, library_content(library)),
        (f"station {station.path}", document.station_content, station.content[:HASH_DIGITS]),
        (
            "the library of distractors",
            document.distractors_content,
            distractors_content(recipe, folder),
        ),
    ):
        if then != now:
            raise InvalidInputError(
                f"{what} has changed since the data set {folder} was made, so its images cannot be"
                " rendered again"
            )
    return station
