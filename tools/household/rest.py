"""Lays an object on the ground as it would come to rest."""

from __future__ import annotations

import numpy as np
import trimesh

from .solids import hull, moved

MOST_TILT = np.radians(25.0)  # between the orientation given and the one found [rad]

Body = tuple[trimesh.Trimesh, tuple[trimesh.Trimesh, ...]]


def laid_down(mesh: trimesh.Trimesh, pieces: tuple[trimesh.Trimesh, ...]) -> Body:
    """Turn an object to the nearby orientation in which it rests on its convex pieces.

    Of the facets of the pieces' common hull that face down, the object rests on the one that is
    nearest to the centre of mass.

    Args:
        mesh: Surface [m], roughly as it lies.
        pieces: Its convex pieces.

    Returns:
        Mesh and pieces; the lowest point of the pieces is at z = 0, and the middle of the mesh's
        footprint at x = y = 0.
    """
    around = hull(np.vstack([piece.vertices for piece in pieces]))
    normals = around.face_normals
    height = np.einsum("ij,ij->i", around.triangles[:, 0] - mesh.center_mass, normals)
    height[normals[:, 2] > -np.cos(MOST_TILT)] = np.inf
    down = normals[np.argmin(height)]
    X = trimesh.geometry.align_vectors(down, (0.0, 0.0, -1.0))
    turn = np.arctan2(X[1, 0], X[0, 0])
    X = trimesh.transformations.rotation_matrix(-turn, (0, 0, 1)) @ X
    low = min(moved(piece, X).bounds[0, 2] for piece in pieces)
    middle = moved(mesh, X).bounds.mean(axis=0)
    X = trimesh.transformations.translation_matrix((-middle[0], -middle[1], -low)) @ X
    return moved(mesh, X), tuple(moved(piece, X) for piece in pieces)
