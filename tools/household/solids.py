"""Closed solids from rings of points, their convex pieces, and the union of several bodies.

A ring is a closed loop of points; rings one after another are skinned to a tube whose ends are
closed by a fan. A lathe shape is a tube of circles, a hollow vessel one whose rings run up the
outside and down the inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import trimesh
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import ArrayLike

from .colours import Rgba, as_bytes
from .curves import Array, angles, equal_area_factor


def circles(profile: ArrayLike, segments: int) -> Array:
    """Turn a profile (K, 2) of radius and height [m] into rings (K, segments, 3) about z."""
    line = np.asarray(profile, dtype=float)
    return ellipses(line[:, [0, 0, 1]], segments)


def ellipses(profile: ArrayLike, segments: int, first: float = 0.0) -> Array:
    """Turn (K, 3) rows of half axes along x and y and height [m] into rings (K, segments, 3).

    Args:
        profile: the rows.
        segments: points of a ring.
        first: where its first point is, in segments from the x axis.
    """
    line = np.asarray(profile, dtype=float)
    t = angles(segments) + first * 2.0 * np.pi / segments
    x = line[:, :1] * np.cos(t)
    y = line[:, 1:2] * np.sin(t)
    z = np.broadcast_to(line[:, 2:3], x.shape)
    return np.stack([x, y, z], axis=2)


def rings_along(path: ArrayLike, normal: ArrayLike, sections: ArrayLike, closed: bool) -> Array:
    """Place plane sections across a plane path.

    Args:
        path: (M, 3) points [m] of a curve in a plane.
        normal: (3,) unit normal of that plane.
        sections: (N, 2) or (M, N, 2) section points [m]: first coordinate across the path within
            its plane (to the left when `normal` points to the viewer), second along `normal`.
        closed: The path returns to its first point (which is not repeated).

    Returns:
        (M, N, 3) rings [m].
    """
    p = np.asarray(path, dtype=float)
    n = np.asarray(normal, dtype=float)
    ahead, behind = np.roll(p, -1, axis=0), np.roll(p, 1, axis=0)
    tangent = ahead - behind if closed else np.gradient(p, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(n, tangent)
    s = np.asarray(sections, dtype=float)
    s = np.broadcast_to(s, (len(p), *s.shape[-2:]))
    return p[:, None] + s[..., :1] * across[:, None] + s[..., 1:] * n


def tube(rings: ArrayLike, closed: bool = False) -> trimesh.Trimesh:
    """Skin rings to a closed surface.

    Args:
        rings: (M, N, 3) rings [m]; a ring may shrink to a point.
        closed: The last ring joins the first one; otherwise both ends get a fan about their mean.

    Returns:
        A watertight mesh with outward winding.
    """
    r = np.asarray(rings, dtype=float)
    m, n = r.shape[:2]
    index = np.arange(m * n).reshape(m, n)
    if closed:
        index = np.vstack([index, index[:1]])
    a, b = index[:-1], index[1:]
    a2, b2 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = [np.stack([a, a2, b2], axis=2), np.stack([a, b2, b], axis=2)]
    vertices = r.reshape(-1, 3)
    if not closed:
        vertices = np.vstack([vertices, r[0].mean(axis=0), r[-1].mean(axis=0)])
        first, last = index[0], index[-1]
        hub = np.full(n, m * n)
        faces.append(np.stack([hub, np.roll(first, -1), first], axis=1))
        faces.append(np.stack([hub + 1, last, np.roll(last, -1)], axis=1))
    mesh = trimesh.Trimesh(vertices, np.concatenate([f.reshape(-1, 3) for f in faces]))
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.remove_unreferenced_vertices()
    if mesh.volume < 0.0:
        mesh.invert()
    return mesh


def hull(points: ArrayLike) -> trimesh.Trimesh:
    """Convex hull of points (..., 3) [m]."""
    return trimesh.convex.convex_hull(np.asarray(points, dtype=float).reshape(-1, 3))


def widened(section: ArrayLike) -> Array:
    """A coarse section (..., N, 2) [m] scaled about its origin to the area of the round one.

    Convex pieces have few corners; made like this they err to both sides of the true surface
    instead of lying inside it everywhere.
    """
    points = np.asarray(section, dtype=float)
    return points * equal_area_factor(points.shape[-2])


def hulls(rings: ArrayLike, cuts: Sequence[int]) -> tuple[trimesh.Trimesh, ...]:
    """Convex pieces of a tube: piece k is the hull of rings cuts[k] to cuts[k + 1] inclusive."""
    r = np.asarray(rings, dtype=float)
    return tuple(hull(r[i : j + 1]) for i, j in pairwise(cuts))


def sectors(cell: ArrayLike, count: int, arcs: int = 2) -> tuple[trimesh.Trimesh, ...]:
    """Convex pieces of a solid of revolution about z whose half section is a convex cell.

    Args:
        cell: (K, 2) radius and height [m] of the corners of the cell.
        count: Number of sectors of the full turn.
        arcs: Straight segments per sector on the convex side.
    """
    rings = circles(cell, count * arcs)
    rings = np.concatenate([rings, rings[:, :1]], axis=1)
    return tuple(hull(rings[:, k * arcs : (k + 1) * arcs + 1]) for k in range(count))


def union(*bodies: tuple[trimesh.Trimesh, Rgba]) -> trimesh.Trimesh:
    """Union of closed bodies, each with a colour that its faces keep.

    Raises:
        ValueError: A body is not a closed manifold.
    """
    solids, colours = [], {}
    for body, rgba in bodies:
        raw = Mesh64(np.array(body.vertices), np.array(body.faces, dtype=np.uint64))
        solid = Manifold(raw).as_original()
        if solid.status() != Error.NoError:
            raise ValueError(f"body is not a closed manifold: {solid.status()}")
        solids.append(solid)
        colours[solid.original_id()] = rgba
    raw = Manifold.batch_boolean(solids, OpType.Add).to_mesh64()
    mesh = trimesh.Trimesh(raw.vert_properties, raw.tri_verts.astype(np.int64), process=False)
    runs = np.diff(raw.run_index) // 3
    rows = np.repeat([colours[i] for i in raw.run_original_id], runs, axis=0)
    mesh.visual.face_colors = as_bytes(rows)
    return canonical(mesh)


def canonical(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same surface with vertices and faces sorted, so that equal shapes are equal bytes."""
    order = np.lexsort(mesh.vertices.T[::-1])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    faces = rank[mesh.faces]
    start = np.argmin(faces, axis=1)
    faces = np.take_along_axis(faces, (start[:, None] + np.arange(3)) % 3, axis=1)
    sort = np.lexsort(faces.T[::-1])
    out = trimesh.Trimesh(mesh.vertices[order], faces[sort], process=False)
    if mesh.visual.kind == "face":
        out.visual.face_colors = mesh.visual.face_colors[sort]
    return out


def moved(mesh: trimesh.Trimesh, X: ArrayLike) -> trimesh.Trimesh:
    """A copy of the mesh under the (4, 4) transform `X`; winding stays outward for mirrors."""
    return mesh.copy().apply_transform(np.asarray(X, dtype=float))
