"""Surfaces moved along their normals, so that every face's plane moves by the same distance."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.core import Array

RANK = 1e-3
"""Directions in which the normals around a vertex vary by less than this share (of the sum of their
squares) do not move it: on a flat or gently curved surface it moves along the normal."""

MITRE = 3.0
"""A vertex moves at most this many times the distance; sharper tips are cut, as a mitred joint."""

SMOOTHINGS = 20
"""Rounds of averaging over neighbours in `smooth_offsets`."""


def offsets(mesh: trimesh.Trimesh) -> Array:
    """How vertices move when every face's plane moves by a unit distance along its normal.

    Where the faces of a vertex have three normals or more, no move suits all of them; then it is
    the one with the least sum of squared errors, weighted with the faces' angles at the vertex.

    Args:
        mesh: wound consistently, vertices merged.

    Returns:
        (V, 3), of length 1 in a plane, sqrt(3) at the corner of a box.
    """
    count = len(mesh.vertices)
    corner = mesh.faces.reshape(-1)
    weight = np.asarray(mesh.face_angles).reshape(-1)
    normal = np.repeat(mesh.face_normals, 3, axis=0)
    total = np.column_stack(
        [np.bincount(corner, weight * normal[:, i], minlength=count) for i in range(3)]
    )
    squares = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(i, 3):
            products = weight * normal[:, i] * normal[:, j]
            squares[:, i, j] = squares[:, j, i] = np.bincount(corner, products, minlength=count)
    values, axes = np.linalg.eigh(squares)
    used = values > RANK * values[:, -1:]
    along = np.einsum("vij,vi->vj", axes, total)
    along = np.where(used, along / np.where(used, values, 1.0), 0.0)
    moves = np.einsum("vij,vj->vi", axes, along)
    length = np.linalg.norm(moves, axis=1, keepdims=True)
    return np.asarray(moves * np.minimum(1.0, MITRE / np.maximum(length, 1e-12)))


def smooth_offsets(mesh: trimesh.Trimesh) -> Array:
    """Offsets (V, 3) of unit length that vary little from vertex to vertex: they do not fold a
    rough surface, but keep the distance only on the whole."""
    edges = mesh.edges_unique
    normals = offsets(mesh)
    for _ in range(SMOOTHINGS):
        total = normals.copy()
        for i in range(3):
            for a, b in (edges.T, edges.T[::-1]):
                total[:, i] += np.bincount(a, normals[b, i], minlength=len(total))
        normals = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    return normals


def folded(mesh: trimesh.Trimesh, moved: Array) -> float:
    """Share of the area, in [0, 1], that turns over when the vertices go to `moved` (V, 3)."""
    t = moved[mesh.faces]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    over = np.einsum("ij,ij->i", normal, mesh.face_normals) <= 0.0
    areas = mesh.area_faces
    return float(areas[over].sum() / areas.sum())
