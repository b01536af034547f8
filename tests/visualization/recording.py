"""A Meshcat that remembers what it was told."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.visualization import open_meshcat


class RecordingMeshcat:
    """A real Meshcat, and what was sent to it.

    Attributes:
        meshcat: the real one.
        transforms: `X_PathParent` (4, 4) by path, as last set.
        triangles: vertices (3, V) and faces (3, F) by path.
        properties: values by path and property.
    """

    def __init__(self) -> None:
        self.meshcat: Meshcat = open_meshcat()
        self.transforms: dict[str, np.ndarray] = {}
        self.triangles: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.properties: dict[tuple[str, str], Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self.meshcat, name)

    def SetTransform(self, path: str, X: Any) -> None:
        self.transforms[path] = X.GetAsMatrix4()
        self.meshcat.SetTransform(path, X)

    def SetTriangleMesh(self, path: str, vertices: Any, faces: Any, *rest: Any) -> None:
        self.triangles[path] = (vertices, faces)
        self.meshcat.SetTriangleMesh(path, vertices, faces, *rest)

    def SetProperty(self, path: str, property: str, value: Any) -> None:
        self.properties[path, property] = value
        self.meshcat.SetProperty(path, property, value)

    def X_WP(self, path: str) -> np.ndarray:
        """Pose (4, 4) of a path in the world: all transforms on the way to it."""
        X = np.eye(4)
        parts = path.strip("/").split("/")
        for k in range(1, len(parts) + 1):
            X = X @ self.transforms.get("/" + "/".join(parts[:k]), np.eye(4))
        return X
