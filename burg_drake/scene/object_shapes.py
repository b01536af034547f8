"""The shapes by which objects are told apart where scenes are laid out, read once a library."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, transform_points
from burg_drake.objects.hulls import convex_hull, reduced_hull
from burg_drake.objects.library import ObjectLibrary
from burg_drake.objects.primitive import primitive_mesh
from burg_drake.scene.convex_travel import ConvexBody
from burg_drake.scene.polygons import convex_polygon, without_short_sides
from burg_drake.scene.validate import read_vertices

ROUNDED = 2e-4
"""How far shadows, which have few corners for speed, reach beyond a side of the true ones [m]."""
COARSE_CORNERS = 64
"""Of a coarse hull."""


@dataclass(frozen=True, eq=False)
class ObjectShape:
    """The shapes of one object, in its frame O.

    Attributes:
        library: where it is from.
        name: in the library.
        corners: (N, 3) corners of the convex hull of all that is seen of it or touches others [m].
    """

    library: ObjectLibrary
    name: str
    corners: Array

    @cached_property
    def shadows(self) -> tuple[Array, ...]:
        """Polygons (M, 2), one a stable pose: what it covers of the plane that it rests on, the
        centre of mass above the origin [m]."""
        poses = self.library.entry(self.name).stable_poses
        return tuple(
            without_short_sides(
                convex_polygon(transform_points(pose.X_SO.matrix(), self.corners)[:, :2]), ROUNDED
            )
            for pose in poses
        )

    @cached_property
    def heights(self) -> tuple[float, ...]:
        """How high it is in each stable pose [m]."""
        poses = self.library.entry(self.name).stable_poses
        return tuple(
            float(transform_points(pose.X_SO.matrix(), self.corners)[:, 2].max()) for pose in poses
        )

    @cached_property
    def pieces(self) -> tuple[ConvexBody, ...]:
        """What of it touches others, as convex pieces."""
        return tuple(map(ConvexBody.from_points, _contact_points(self.library, self.name)))

    @cached_property
    def coarse(self) -> ConvexBody:
        """Its hull with few corners, which lies inside of the hull."""
        return ConvexBody.from_points(
            np.asarray(reduced_hull(self.corners, COARSE_CORNERS).vertices)
        )


class ObjectShapes:
    """Shapes of a library's objects, each read when it is first asked for."""

    def __init__(self, library: ObjectLibrary) -> None:
        self.library = library
        self._shapes: dict[str, ObjectShape] = {}

    def __getitem__(self, name: str) -> ObjectShape:
        """The shape of an object.

        Raises:
            UnknownNameError: there is no such object, or a file of it is missing.
            MeshError: a file of it is damaged.
            InvalidInputError: it has no mass, or no stable pose.
        """
        if name not in self._shapes:
            self._shapes[name] = _read(self.library, name)
        return self._shapes[name]


def _read(library: ObjectLibrary, name: str) -> ObjectShape:
    entry = library.entry(name)
    if entry.is_fixed or not entry.stable_poses:
        why = "no mass" if entry.is_fixed else "no stable pose"
        raise InvalidInputError(
            f"object {name!r} of library {library.root} has {why}; leave it out"
        )
    points = np.vstack(
        [_vertices(library, entry.surface or entry.mesh), *_contact_points(library, name)]
    )
    return ObjectShape(library, name, points[np.sort(convex_hull(points).vertices)])


def _contact_points(library: ObjectLibrary, name: str) -> list[Array]:
    """Points (N, 3) of each convex piece that touches others, or of the whole surface."""
    entry = library.entry(name)
    primitive = entry.contact.primitive
    if primitive is not None and primitive.shape != "sphere":
        return [np.asarray(primitive_mesh(primitive).vertices)]
    return [_vertices(library, piece) for piece in entry.pieces] or [
        _vertices(library, entry.surface or entry.mesh)
    ]


def _vertices(library: ObjectLibrary, file: str) -> Array:
    path = library.path(file)
    try:
        return read_vertices(path)
    except (OSError, ValueError) as error:
        raise library.damaged(path) from error
