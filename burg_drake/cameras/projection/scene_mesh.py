"""The surfaces of a scene's objects at their places, as one mesh in S that cameras look at."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from burg_drake.cameras.projection.mesh_outline import MeshOutline
from burg_drake.core import Array, Indices, UnknownNameError, nearest, transform_points
from burg_drake.geometry import RayCaster
from burg_drake.scene.document import Scene

TriangleArrays = tuple[Array, Indices]


class SceneMesh:
    """What of a scene can be seen.

    Attributes:
        names: instances, free ones first, in the scene's order; their index is their number.
        outline: all surfaces as one mesh; its frame is S.
        owner: (F,) number of the instance that each of its faces belongs to.
        boxes: (N, 2, 3) corners of each instance's bounding box along the axes of S [m].
    """

    def __init__(self, placed: dict[str, TriangleArrays]) -> None:
        """Joins surfaces.

        Args:
            placed: by instance, vertices (V, 3) in S [m] and faces (F, 3).
        """
        self._placed = placed
        self.names = tuple(placed)
        vertices = [np.empty((0, 3)), *(v for v, _ in placed.values())]
        starts = np.cumsum([len(v) for v in vertices])
        faces = [f + start for (_, f), start in zip(placed.values(), starts, strict=False)]
        owner = np.repeat(np.arange(len(faces)), [len(f) for f in faces])
        joined = np.concatenate([np.empty((0, 3), np.int64), *faces])
        self.outline = MeshOutline(np.concatenate(vertices), joined)
        self.owner: Indices = owner[self.outline.kept]
        corners = [[v.min(axis=0), v.max(axis=0)] for v in vertices[1:]]
        self.boxes: Array = np.array(corners).reshape(-1, 2, 3)

    def of(self, names: tuple[str, ...] | None) -> SceneMesh:
        """Some of the instances alone; all if None.

        Raises:
            UnknownNameError: there is no such instance.
        """
        if names is None:
            return self
        for name in names:
            if name not in self._placed:
                raise UnknownNameError(
                    f"instance {name!r} does not exist; {nearest(name, self.names)}"
                )
        return SceneMesh({name: self._placed[name] for name in names})

    def vertices(self, name: str) -> Array:
        """(V, 3) of an instance, in S [m]."""
        return self._placed[name][0]

    @cached_property
    def rays(self) -> RayCaster:
        """Casts rays at the surfaces, in S."""
        return RayCaster(self.outline.vertices, self.outline.faces)


def build_scene_mesh(scene: Scene) -> SceneMesh:
    """The surfaces of all instances of a scene, background included, at their places.

    Raises:
        UnknownNameError: a mesh file of the library is missing.
    """
    placed = {}
    for name in (*scene.instances, *scene.background):
        surface = scene.library.surface(scene.instance(name).object)
        faces = np.asarray(surface.faces, dtype=np.int64)
        placed[name] = transform_points(scene.X_SO(name), surface.vertices), faces
    return SceneMesh(placed)
