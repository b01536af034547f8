"""How far convex bodies can be moved until they touch others: exact, along a straight way.

Seen along the way, the faces of one body that look ahead and those of the other one that look back
are two surfaces over a plane. Their distance along the way is piecewise linear and convex over what
the two silhouettes have in common, and so is least where a corner of either lies over the other
body, or where two edges cross. All of these are looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.frames import Array, transform_points
from burg_drake.objects.hulls import convex_hull

PARALLEL = 1e-12
"""Sine of the angle below which two lines or a line and a plane do not cross."""
ON_EDGE = 1e-9
"""How far beside a silhouette a corner still counts as over it [m]: rounding."""


@dataclass(frozen=True, eq=False)
class ConvexBody:
    """A convex body, from its corners.

    Attributes:
        vertices: (V, 3) corners [m].
        normals: (F, 3) outward unit normals of its triangles.
        offsets: (F,) of their planes: `normal . p = offset` [m].
        edges: (E, 2) corners at the ends of each edge.
    """

    vertices: Array
    normals: Array
    offsets: Array
    edges: NDArray[np.intp]

    @classmethod
    def from_points(cls, points: Array) -> ConvexBody:
        """The convex hull of points (N, 3) [m].

        Raises:
            scipy.spatial.QhullError: they lie in a plane.
        """
        hull = convex_hull(points)
        place = np.zeros(len(points), dtype=np.intp)
        place[hull.vertices] = np.arange(len(hull.vertices))
        ends = np.concatenate([hull.simplices[:, k] for k in ([1, 2], [0, 2], [0, 1])])
        once = np.tile(np.arange(len(hull.simplices)), 3) < hull.neighbors.T.reshape(-1)
        return cls(
            points[hull.vertices],
            hull.equations[:, :3],
            -hull.equations[:, 3],
            place[ends[once]],
        )

    def moved(self, X_AB: Array) -> ConvexBody:
        """The body given in B, expressed in A: `X_AB` is (4, 4)."""
        normals = self.normals @ X_AB[:3, :3].T
        offsets = self.offsets + normals @ X_AB[:3, 3]
        vertices = transform_points(X_AB, self.vertices)
        return ConvexBody(vertices, normals, offsets, self.edges)


def travel(
    moving: Sequence[ConvexBody],
    still: Sequence[ConvexBody],
    direction: Array,
    limit: float = np.inf,
) -> float:
    """How far bodies can be moved together until one of them touches one that stays.

    Args:
        moving: bodies that go; none of them overlaps one of `still`.
        still: bodies that stay.
        direction: (3,) unit vector.
        limit: [m].

    Returns:
        The way [m], at most `limit`, and 0 if they touch already.
    """
    basis = _basis(direction)
    ahead = [_seen(body, basis) for body in moving]
    back = [_seen(body, basis) for body in still]
    pairs = []
    for a in ahead:
        for b in back:
            apart = np.maximum(a.lower[:2] - b.upper[:2], b.lower[:2] - a.upper[:2]).max()
            least = b.lower[2] - a.upper[2]
            if apart < 0.0 and least < limit and b.upper[2] > a.lower[2]:
                pairs.append((least, a, b))
    found = limit
    for least, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if least >= found:
            break
        gap = _gap(a, b)
        if gap > 0.0 or gap >= _gap(b, a):  # else the one that stays is behind
            found = min(found, gap)
    return max(0.0, float(found))


@dataclass(frozen=True, eq=False)
class _Seen:
    """A body as it is seen along the way: two coordinates across, the third one along it.

    Attributes:
        vertices: (V, 3) corners.
        normals, offsets: of its triangles.
        starts, ends: (E, 3) of its edges.
        lower, upper: (3,) of its bounding box.
    """

    vertices: Array
    normals: Array
    offsets: Array
    starts: Array
    ends: Array
    lower: Array
    upper: Array


def _basis(direction: Array) -> Array:
    """(3, 3) rows: two directions across, and the direction."""
    across = np.eye(3)[np.abs(direction).argmin()]
    u = np.cross(direction, across)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(direction, u), direction])


def _seen(body: ConvexBody, basis: Array) -> _Seen:
    vertices, normals = body.vertices @ basis.T, body.normals @ basis.T
    starts, ends = vertices[body.edges[:, 0]], vertices[body.edges[:, 1]]
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return _Seen(vertices, normals, body.offsets, starts, ends, lower, upper)


def _gap(a: _Seen, b: _Seen) -> float:
    """Least distance along the way from the upper side of a to the lower side of b; inf if they
    pass each other."""
    found = np.inf
    first, _ = _through(b, _over(a.vertices, b))
    if len(first[0]):
        found = min(found, float((first[0] - first[1]).min()))
    _, last = _through(a, _over(b.vertices, a))
    if len(last[0]):
        found = min(found, float((last[1] - last[0]).min()))
    return min(found, _crossing(a, b))


def _over(points: Array, body: _Seen) -> Array:
    """Those of points (N, 3) that lie over the body's bounding box."""
    within = (points[:, :2] > body.lower[:2]) & (points[:, :2] < body.upper[:2])
    return np.asarray(points[within.all(axis=1)])


def _through(body: _Seen, points: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Where lines along the way through points (N, 3) enter and leave a body.

    Returns:
        Heights at which they enter it and heights of their points, then the same of where they
        leave; of lines that meet the body alone.
    """
    slope = body.normals[:, 2]
    rest = body.offsets - points[:, :2] @ body.normals[:, :2].T  # (N, F)
    beside = np.abs(slope) <= PARALLEL
    hit = (rest[:, beside] >= -ON_EDGE).all(axis=1)
    enter = (rest[:, slope < -PARALLEL] / slope[slope < -PARALLEL]).max(axis=1)
    leave = (rest[:, slope > PARALLEL] / slope[slope > PARALLEL]).min(axis=1)
    hit &= enter <= leave + ON_EDGE
    z = points[hit, 2]
    return (enter[hit], z), (leave[hit], z)


def _crossing(a: _Seen, b: _Seen) -> float:
    """Least distance along the way where edges cross, seen along it."""
    lower = np.maximum(a.lower, b.lower)[:2]
    upper = np.minimum(a.upper, b.upper)[:2]
    p, q = _near(a, lower, upper)
    r, s = _near(b, lower, upper)
    along, other = (q - p)[:, None], (s - r)[None]
    between = r[None] - p[:, None]
    area = along[..., 0] * other[..., 1] - along[..., 1] * other[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (between[..., 0] * other[..., 1] - between[..., 1] * other[..., 0]) / area
        u = (between[..., 0] * along[..., 1] - between[..., 1] * along[..., 0]) / area
        cross = (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
        gap = between[..., 2] + u * other[..., 2] - t * along[..., 2]
    return float(np.min(gap[cross], initial=np.inf))


def _near(body: _Seen, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Ends of the edges whose bounding boxes meet a rectangle across the way."""
    low, high = np.minimum(body.starts, body.ends), np.maximum(body.starts, body.ends)
    near = ((low[:, :2] <= upper) & (high[:, :2] >= lower)).all(axis=1)
    return body.starts[near], body.ends[near]
