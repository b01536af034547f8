"""Open surfaces as walls: the surface moved both ways along its normals, and stitched at its rims.

The wall is centred on the given surface: an open surface has no inside, so that no side of it is
preferred, and its volume is area times thickness, nearly so where it is bent.
"""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from burg_drake.core import Array
from burg_drake.objects.meshes.cleaning import signed_volume
from burg_drake.objects.meshes.offset import folded, offsets, smooth_offsets
from burg_drake.objects.meshes.solids import is_closed

DEFAULT_WALL = 2e-3
"""Thickness of a wall where none is given [m], about that of crockery, a folded towel's layers or a
plastic box; more than the tolerances of contact simulation."""

WALL_SHARE = 0.02
"""The default is never above this share of the mesh's diagonal."""

FOLDED = 0.02
"""Share of the area that may turn over on either side of the wall, in creases."""

SHRUNK = 0.5
"""The wall's volume is at least this share of area times thickness, or it passes through itself."""


def default_wall(mesh: trimesh.Trimesh) -> float:
    """Thickness of the wall that an open surface becomes where none is given [m]."""
    return min(DEFAULT_WALL, WALL_SHARE * float(np.linalg.norm(mesh.extents)))


def thickened(sheet: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh | None:
    """A closed wall, half its thickness on either side of an open surface.

    Where more than two faces meet at an edge, each sheet ends there with a rim of its own, and the
    walls overlap.

    Args:
        sheet: open surface [m].
        thickness: of the wall [m].

    Returns:
        The wall, wound outward; None if the surface has only one side (a Moebius strip), or is so
        crumpled that its two sides pass through each other.
    """
    sheet = separated(sheet)
    if not sheet.is_winding_consistent:
        trimesh.repair.fix_winding(sheet)
    if not sheet.is_winding_consistent:
        return None
    for moves in (offsets, smooth_offsets):
        half = 0.5 * thickness * moves(sheet)
        sides = [sheet.vertices + half, sheet.vertices - half]
        if max(folded(sheet, side) for side in sides) > FOLDED:
            continue
        result = _stitched(sheet, *sides)
        if is_closed(result) and signed_volume(result) > SHRUNK * thickness * sheet.area:
            return result
    return None


def separated(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A copy in which no more than two faces meet at an edge and one fan of faces at a vertex:
    where there are more, vertices are doubled."""
    faces = mesh.faces
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    start = corners.reshape(-1)
    end = np.roll(corners, -1, axis=1).reshape(-1)
    ends = np.sort(np.column_stack([faces.reshape(-1)[start], faces.reshape(-1)[end]]), axis=1)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    order = np.argsort(edge, kind="stable")
    first, second = order[count[edge[order]] == 2].reshape(-1, 2).T
    pairs = []
    for a in (start, end):
        for b in (start, end):
            same = faces.reshape(-1)[a[first]] == faces.reshape(-1)[b[second]]
            pairs.append(np.column_stack([a[first][same], b[second][same]]))
    a, b = np.vstack(pairs).T
    graph = coo_matrix((np.ones(len(a), dtype=bool), (a, b)), shape=(len(start),) * 2)
    _, label = connected_components(graph, directed=False)
    _, representative = np.unique(label, return_index=True)
    vertices = mesh.vertices[faces.reshape(-1)[representative]]
    return trimesh.Trimesh(vertices, label.reshape(-1, 3), process=False)


def rims(mesh: trimesh.Trimesh) -> NDArray[np.int64]:
    """Edges (E, 2) of only one face, in its direction."""
    _, inverse, count = np.unique(
        mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(mesh.edges[count[inverse.reshape(-1)] == 1])


def _stitched(sheet: trimesh.Trimesh, upper: Array, lower: Array) -> trimesh.Trimesh:
    count = len(sheet.vertices)
    a, b = rims(sheet).T
    side = np.vstack(
        [np.column_stack([b, a, a + count]), np.column_stack([b, a + count, b + count])]
    )
    faces = np.vstack([sheet.faces, sheet.faces[:, ::-1] + count, side])
    return trimesh.Trimesh(np.vstack([upper, lower]), faces, process=False)
