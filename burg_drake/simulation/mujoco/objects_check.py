"""Whether MuJoCo can have the objects of a scene: it collides primitives and convex meshes."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects.library import ObjectEntry, ObjectLibrary
from burg_drake.scene.document import Scene

FEWEST_POINTS = 4
FLAT = 1e-7
"""A piece that is thinner than this share of its largest extent has no volume."""


def check_objects(scene: Scene) -> None:
    """Refuses what has no convex pieces to collide.

    Raises:
        InvalidInputError: an object has neither a primitive nor pieces, or a flat one.
    """
    checked = set()
    for instance in {**scene.instances, **scene.background}.values():
        if instance.object not in checked:
            checked.add(instance.object)
            _check_object(scene.library, instance.object)


def _check_object(library: ObjectLibrary, name: str) -> None:
    entry: ObjectEntry = library.entry(name)
    if entry.contact.kind == "primitive" and entry.contact.primitive is not None:
        return
    if not entry.pieces:
        raise InvalidInputError(
            f"object {name!r} has no convex pieces, which engine mujoco needs; build it again"
            " without a contact geometry of its own, or evaluate with an engine of Drake"
        )
    for piece in entry.pieces:
        path = library.path(piece)
        try:
            points = np.asarray(trimesh.load_mesh(path, process=False).vertices, dtype=float)
        except Exception as error:  # the reader raises whatever it stumbles over
            raise library.damaged(path) from error
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if len(points) < FEWEST_POINTS or extents[-1] <= FLAT * extents[0]:
            raise InvalidInputError(
                f"object {name!r}: convex piece {path.name} has no volume ({len(points)} points),"
                " which engine mujoco needs; build the object again"
            )
