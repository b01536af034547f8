"""Where the objects of a grasp file are: in a scene, or in an object library."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser
from burg_drake.core import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.paths import is_resolved

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.scene.document import Scene


@dataclass(frozen=True, eq=False)
class GraspSource:
    """Objects that grasps refer to.

    Attributes:
        library: has every object.
        scene: where they stand, if that is known.
    """

    library: ObjectLibrary
    scene: Scene | None = None

    def reference(self) -> dict[str, str]:
        """How the provenance of grasps names it; `source_of` finds it again."""
        if self.scene is not None:
            return {"scene": str(self.scene.path)}
        return {"library": str(self.library.root)}


def open_source(reference: str) -> GraspSource:
    """Opens the argument SCENE|LIB.

    Args:
        reference: a scene file or a library folder, or the name of a built-in one.

    Raises:
        UnknownNameError: there is neither.
        DocumentError: its document does not fit the schema.
    """
    from burg_drake.core.paths import builtin_names, expanded
    from burg_drake.objects.library import LIBRARY_FILE, load_library
    from burg_drake.scene.document import load_scene

    scenes, libraries = builtin_names("scenes"), builtin_names("models")
    path = expanded(reference)
    is_library = path.is_dir() or path.name == LIBRARY_FILE or reference in libraries
    if not is_library and reference not in scenes and not path.exists():
        raise UnknownNameError(
            f"{reference} is neither a scene nor an object library;"
            f" {nearest(reference, [*scenes, *libraries])}"
        )
    if is_library:
        return GraspSource(load_library(reference))
    scene = load_scene(reference)
    return GraspSource(scene.library, scene)


def add_source(parser: Parser) -> None:
    """The options --scene and --library."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--scene",
        metavar="SCENE",
        help="scene of the grasps (default: what the file names)",
    )
    which.add_argument(
        "--library", metavar="LIB", help="library of the grasps (default: what the file names)"
    )


def source_of(arguments: argparse.Namespace, grasps: GraspSet, path: str) -> GraspSource:
    """The objects of a grasp file.

    Args:
        arguments: with the options of `add_source`.
        grasps: the grasps; their provenance is asked where no option is given.
        path: of the file, for messages.

    Raises:
        InvalidInputError: neither option is given and the file names nothing, or the grasps are
            far from their objects.
        UnknownNameError: what is named is not there, or lacks an object of the grasps.
    """
    from burg_drake.evaluation.grasp_sets import require_near

    named = [arguments.scene, arguments.library]
    named += [grasps.provenance.get(key) for key in ("scene", "library")]
    reference = next((name for name in named if name), None)
    if reference is None:
        raise InvalidInputError(
            f"{path} does not say where its objects are; give --scene or --library"
        )
    try:
        from_file = reference not in (arguments.scene, arguments.library)
        if from_file and not is_resolved(str(reference), "scenes", "models"):
            raise UnknownNameError(str(reference))
        source = open_source(str(reference))
    except UnknownNameError as error:
        if reference in (arguments.scene, arguments.library):
            raise
        raise UnknownNameError(
            f"{path} says that its objects are in {reference}, which is not there; give --scene or"
            " --library"
        ) from error
    for name in sorted(set(grasps.object.tolist())):
        if name not in source.library.objects:
            raise UnknownNameError(
                f"{path} has grasps of object {name!r}, which is not in library"
                f" {source.library.root}; {nearest(name, source.library.objects)}"
            )
    require_near(grasps, source.library, path)
    return source
