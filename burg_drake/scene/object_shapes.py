"""Footprints, hulls and convex pieces of objects, read once per library."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.geometry import convex_hull
from burg_drake.objects import ObjectLibrary, Primitive, primitive_mesh
from burg_drake.scene.convex_sweep import ConvexShapes
from burg_drake.scene.polygons import Footprint, convex_polygon, rotate_polygon, simplify_polygon
from burg_drake.scene.scene_validation import read_library_vertices


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of an object on its support plane, with the centre of mass above the origin.

    Attributes:
        corners: (N + M, 2) corners of the convex hull, and of a polygon around it with fewer
            corners [m].
        count: number N of corners of the hull.
        height: height of the object's highest point [m].
    """

    corners: Array
    count: int
    height: float

    @cached_property
    def hull(self) -> Footprint:
        """Convex hull of the outline."""
        return Footprint(self.corners[: self.count])

    @cached_property
    def coarse(self) -> Footprint:
        """A polygon around the hull with fewer corners."""
        return Footprint(self.corners[self.count :])

    def rotated(self, yaw: float) -> Outline:
        """The outline turned by a yaw [rad] about the origin."""
        return Outline(rotate_polygon(self.corners, yaw), self.count, self.height)

    def moved(self, offset: Array) -> Outline:
        """The outline moved by an offset (2,) [m]."""
        return Outline(self.corners + offset, self.count, self.height)


@dataclass(frozen=True, eq=False)
class ObjectShape:
    """The shapes of one object, in its frame O.

    Attributes:
        library: library of the object.
        name: name in the library.
        corners: (N, 3) corners of the convex hull of its visual mesh and contact geometry [m].
    """

    library: ObjectLibrary
    name: str
    corners: Array

    _poses: dict[int, Array] = field(default_factory=dict)
    _outlines: dict[int, Outline] = field(default_factory=dict)

    def X_SO(self, pose: int) -> Array:
        """(4, 4) pose in a stable pose, with the centre of mass above the board's corner."""
        if pose not in self._poses:
            self._poses[pose] = self.library.entry(self.name).X_SO(pose)
        return self._poses[pose]

    def outline(self, pose: int) -> Outline:
        """The outline in a stable pose."""
        outline_tolerance = 2e-4  # Metres that an outline may exceed the true one.
        coarse_tolerance = 1.5e-3  # Metres, of the coarse outline.
        if pose not in self._outlines:
            corners = transform_points(self.X_SO(pose), self.corners)
            hull = simplify_polygon(convex_polygon(corners[:, :2]), outline_tolerance)
            both = np.concatenate([hull, simplify_polygon(hull, coarse_tolerance)])
            self._outlines[pose] = Outline(both, len(hull), float(corners[:, 2].max()))
        return self._outlines[pose]

    @property
    def shadows(self) -> tuple[Array, ...]:
        """Outline hulls (N, 2) of all stable poses [m]."""
        count = len(self.library.entry(self.name).stable_poses)
        return tuple(self.outline(pose).hull.corners for pose in range(count))

    @cached_property
    def pieces(self) -> ConvexShapes:
        """Convex shapes of the object's contact geometry."""
        entry = self.library.entry(self.name)
        if entry.contact.primitive is not None:
            return _primitive_shape(entry.contact.primitive)
        points = _contact_points(self.library, self.name)
        return ConvexShapes.of(points, [np.zeros((3, 3))] * len(points))

    @cached_property
    def hull(self) -> ConvexShapes:
        """Convex hull of the object."""
        return ConvexShapes.of([self.corners], [np.zeros((3, 3))])


class ObjectShapes:
    """Shapes of a library's objects, each read on first use."""

    def __init__(self, library: ObjectLibrary) -> None:
        self.library = library
        self._shapes: dict[str, ObjectShape] = {}

    def __getitem__(self, name: str) -> ObjectShape:
        """The shape of an object.

        Raises:
            UnknownNameError: there is no such object, or one of its files is missing.
            MeshError: one of its files is damaged.
            InvalidInputError: the object has no mass, or no stable pose.
        """
        if name not in self._shapes:
            self._shapes[name] = _read_object_shape(self.library, name)
        return self._shapes[name]


def _read_object_shape(library: ObjectLibrary, name: str) -> ObjectShape:
    entry = library.entry(name)
    if entry.is_fixed or not entry.stable_poses:
        why = "no mass" if entry.is_fixed else "no stable pose"
        raise InvalidInputError(
            f"object {name!r} of library {library.root} has {why}; leave it out"
        )
    points = np.vstack(
        [
            read_library_vertices(library, entry.surface or entry.mesh),
            *_contact_points(library, name),
        ]
    )
    return ObjectShape(library, name, points[np.sort(convex_hull(points).vertices)])


def _contact_points(library: ObjectLibrary, name: str) -> list[Array]:
    """Points (N, 3) of each convex contact piece, or of the whole surface."""
    entry = library.entry(name)
    if entry.contact.primitive is not None:
        return [np.asarray(primitive_mesh(entry.contact.primitive).vertices)]
    return [read_library_vertices(library, piece) for piece in entry.pieces] or [
        read_library_vertices(library, entry.surface or entry.mesh)
    ]


def _primitive_shape(primitive: Primitive) -> ConvexShapes:
    """Convex shape of a primitive, with its round surface."""
    size, spread = primitive.size, np.zeros((3, 3))
    if primitive.shape == "box":
        points = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size
    elif primitive.shape == "cylinder":
        points = np.array([(0.0, 0.0, -0.5), (0.0, 0.0, 0.5)]) * size[1]
        spread = np.diag([size[0], size[0], 0.0])
    else:
        points, spread = np.zeros((1, 3)), np.eye(3) * size[0]
    return ConvexShapes.of([points], [spread]).moved(primitive.X_OP.matrix())
