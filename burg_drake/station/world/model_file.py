"""Adds models of SDF and URDF files to a plant, with the packages that they name.

Drake's parser reads SDFormat's own description again for each file that it opens, which takes 25 ms
(drake 1.51), but only once for texts. So files are handed over as texts.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from html import escape
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from burg_drake.core import InvalidInputError
from burg_drake.core.files import DOCUMENT, read_bytes
from burg_drake.core.paths import (
    BURG_DRAKE,
    DRAKE_MODELS,
    NO_PACKAGES,
    Packages,
    data_root,
    named_files,
    named_packages,
)
from burg_drake.station.world.model_numbers import require_sound_numbers

PATH = re.compile(r"<uri>\s*((?![A-Za-z]+:)[^<]*?)\s*</uri>")
"""A file that is named by its path, from the folder of the model on if it is not absolute."""
HYDROELASTIC = re.compile(r"<drake:(?:rigid|compliant)_hydroelastic\s*/>")
COLLISION = re.compile(r"<collision\b.*?</collision>", re.DOTALL)


def add_models(
    parser: Parser,
    path: Path,
    packages: Packages = NO_PACKAGES,
    *,
    edit: Callable[[str], str] | None = None,
) -> list[ModelInstanceIndex]:
    """As `parser.AddModels(path)`, sooner, and with the packages that `core.paths.packages` finds.

    Args:
        parser: from now on it knows the packages that this model names, in place of others of the
            same names, and no model that would be fetched from the network.
        path: SDF or URDF file.
        packages: what a station says of packages.
        edit: of an SDF's text, such as `without_hydroelastic`.

    Raises:
        InvalidInputError: it cannot be read, is too large, or has a mass, an inertia or another
            number that no body has.
        UnknownNameError: it names a package that is nowhere.
        RuntimeError, ValueError: those of `AddModels`.
    """
    set_packages(parser, named_packages(path, packages))
    try:
        text = read_bytes(path, DOCUMENT.size).decode()
    except UnicodeDecodeError:
        text = ""
    require_sound_numbers(path)
    if "<include" in text:
        for file in named_files(path, packages):
            if file.suffix in (".sdf", ".urdf"):
                require_sound_numbers(file)
    if path.suffix != ".sdf" or not text or "<include" in text:
        return list(parser.AddModels(path))
    if edit is not None:
        text = edit(text)
    folder = Path(escape(str(path.parent.resolve()), quote=False))
    whole = PATH.sub(lambda found: f"<uri>file://{folder / found[1]}</uri>", text)
    try:
        return list(parser.AddModelsFromString(whole, "sdf"))
    except (RuntimeError, ValueError) as error:
        raise type(error)(str(error).replace("<literal-string>.sdf", str(path))) from error


def without_hydroelastic(text: str) -> str:
    """A model (SDF) for point queries alone: Drake makes no meshes for hydroelastic contact then,
    which it would copy into each context; a collision checker is there in two thirds of the time.
    """
    return HYDROELASTIC.sub("", text)


def without_collisions(text: str) -> str:
    """A model (SDF) that nothing touches."""
    return COLLISION.sub("", text)


def set_packages(parser: Parser, found: Mapping[str, Path]) -> None:
    """Lets a parser know packages by their folders, and that of the installed data; it forgets
    Drake's own models, which it would fetch from the network."""
    known = parser.package_map()
    for name in {DRAKE_MODELS, *found}:
        if known.Contains(name):
            known.Remove(name)
    for name, folder in {**found, BURG_DRAKE: data_root()}.items():
        known.Add(name, folder)


def require_loose(plant: MultibodyPlant, model: ModelInstanceIndex, path: Path) -> None:
    """Refuses a model that a joint of its own connects to the world, as in URDFs with a link
    `world`.

    Args:
        plant: not finalized.
        model: of one file.
        path: the file.

    Raises:
        InvalidInputError: it is; the message names joint and link.
    """
    for joint in map(plant.get_joint, plant.GetJointIndices(model)):
        if joint.parent_body().index() == plant.world_body().index():
            raise InvalidInputError(
                f"{path}: joint {joint.name()!r} fixes {joint.child_body().name()!r} to"
                " the world; remove it, as the station says where the robot stands"
            )


@contextmanager
def buffered_remarks() -> Iterator[list[logging.LogRecord]]:
    """Keeps back what Drake logs, such as its doubts about a model.

    Yields:
        What is kept back, and grows meanwhile; hand on with `logging.getLogger("drake").handle`.
    """
    logger, buffered = logging.getLogger("drake"), list[logging.LogRecord]()

    def hold(record: logging.LogRecord) -> bool:
        buffered.append(record)
        return False

    logger.addFilter(hold)
    try:
        yield buffered
    finally:
        logger.removeFilter(hold)


def file_uri(path: Path) -> str:
    """The URI of a file as Drake reads it: it does not decode `%20`."""
    return f"file://{path.resolve()}"
