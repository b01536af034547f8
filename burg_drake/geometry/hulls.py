"""Convex hulls: robust against nearly flat facets, and with few vertices where that is enough."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array

if TYPE_CHECKING:
    import trimesh

QHULL_OPTIONS = ("Qt", "Qt Q12", "QJ Pp")
"""What Qhull is asked in turn: plain; allowing wide facets; joggling the input by some 1e-13."""

SMALL = 16
"""Hulls with at most this many vertices are not reduced."""

ROUND = 4
"""Vertices added between two computations of the hull."""


def convex_hull(points: Array) -> ConvexHull:
    """Convex hull of points (N, 3).

    Raises:
        scipy.spatial.QhullError: the points lie in a plane.
    """
    for options in QHULL_OPTIONS[:-1]:
        try:
            return ConvexHull(points, qhull_options=options)
        except QhullError as error:
            if "QH6154" in str(error) or "QH6214" in str(error):  # flat, or fewer than 4 points
                raise
    return ConvexHull(points, qhull_options=QHULL_OPTIONS[-1])


def hull_mesh(points: Array) -> trimesh.Trimesh:
    """Hull with outward winding, vertices in the order of `points`; QhullError if flat."""
    import trimesh

    hull = convex_hull(points)
    faces = hull.simplices.copy()
    triangle = points[faces]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    inward = (normal * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    used = np.unique(faces)
    place = np.zeros(len(points), dtype=int)
    place[used] = np.arange(len(used))
    return trimesh.Trimesh(points[used], place[faces], process=False)


def reduced_hull(points: Array, max_vertices: int = 64, tolerance: float = 2e-4) -> trimesh.Trimesh:
    """Convex hull with few vertices, inside the full hull.

    The points farthest outside are added until all are within the tolerance, or the most vertices
    are reached.

    Args:
        points: (N, 3) [m].
        max_vertices: most vertices of the result.
        tolerance: distance from the full hull that is good enough [m].

    Raises:
        scipy.spatial.QhullError: the points lie in a plane.
    """
    candidates = points[np.sort(convex_hull(points).vertices)]
    if len(candidates) <= min(SMALL, max_vertices):
        return hull_mesh(candidates)
    directions = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
    )
    chosen = np.unique((candidates @ directions.T).argmax(axis=0)).tolist()
    while len(chosen) < max_vertices:
        equations = convex_hull(candidates[chosen]).equations
        above = candidates @ equations[:, :3].T + equations[:, 3]
        facet = above.argmax(axis=1)
        outside = above[np.arange(len(candidates)), facet]
        farthest = [i for i in np.argsort(-outside, kind="stable") if outside[i] > tolerance]
        if not farthest:
            break
        # one vertex a facet, as each brings down the distances of its neighbours
        _, first = np.unique(facet[farthest], return_index=True)
        new = [int(farthest[i]) for i in np.sort(first)[:ROUND]]
        chosen += new[: max_vertices - len(chosen)]
    return hull_mesh(candidates[sorted(chosen)])


def thickness(points: Array) -> float:
    """Smallest width of points (N, 3) across a face of their hull [m]; 0 if they lie in a plane."""
    try:
        equations = convex_hull(points).equations
    except QhullError:
        return 0.0
    return float(-(points @ equations[:, :3].T + equations[:, 3]).min(axis=0).max())
