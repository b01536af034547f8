"""Solids of revolution about z, and what is made of them by bending and stretching."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from .arrays import Array
from .blocks import graded
from .solid import Solid

Curve = Callable[[Array], tuple[Array, Array]]
"""Radius and height at parameters from 0 to 1."""

FINE = 4000
MESH_ANGLE = np.deg2rad(4.0)
"""Of a facet of the mesh along an arc of a profile."""
AROUND = 96
"""Facets of the mesh around the axis; a multiple of 6, for hexagons."""


def line(start: tuple[float, float], end: tuple[float, float]) -> Curve:
    """A straight piece of a profile, between points (radius, height)."""

    def at(t: Array) -> tuple[Array, Array]:
        return start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1])

    return at


def arc(center: tuple[float, float], radius: float, start: float, end: float) -> Curve:
    """A round piece of a profile; angles [deg] from the direction of the radius towards +z."""

    def at(t: Array) -> tuple[Array, Array]:
        angle = np.deg2rad(start + t * (end - start))
        return np.abs(center[0] + radius * np.cos(angle)), center[1] + radius * np.sin(angle)

    return at


def polyline(*points: tuple[float, float]) -> list[Curve]:
    """Straight pieces through points (radius, height)."""
    return [line(a, b) for a, b in pairwise(points)]


def lathe(profile: Sequence[Curve], spacing: float) -> Solid:
    """The solid whose surface a profile sweeps.

    Args:
        profile: pieces one after the other, with the solid on the left (radius to the right, height
            upwards), from the axis to the axis or round.
        spacing: of samples [m].
    """
    points, normals, areas = [], [], []
    for curve in profile:
        r, z, n_r, n_z, lengths = _cells(curve, spacing)
        for row in zip(r, z, n_r, n_z, lengths, strict=True):
            ring = _ring(*row, spacing)
            points.append(ring[0])
            normals.append(ring[1])
            areas.append(ring[2])
    mesh = _mesh(profile)
    return Solid(
        np.concatenate(points), np.concatenate(normals), np.concatenate(areas), spacing, (mesh,)
    )


def _cells(curve: Curve, spacing: float) -> tuple[Array, Array, Array, Array, Array]:
    """Middles of the cells of a piece, outward normals and lengths."""
    t = np.linspace(0.0, 1.0, FINE)
    r, z = curve(t)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(r), np.diff(z)))))
    edges = graded(along[-1], spacing)
    middles = np.interp((edges[1:] + edges[:-1]) / 2.0, along, t)
    r, z = curve(middles)
    (r0, z0), (r1, z1) = curve(middles - 1e-6), curve(middles + 1e-6)
    length = np.hypot(r1 - r0, z1 - z0)
    return r, z, (z1 - z0) / length, -(r1 - r0) / length, np.diff(edges)


def _ring(
    r: float, z: float, n_r: float, n_z: float, length: float, spacing: float
) -> tuple[Array, Array, Array]:
    """Samples around the axis; their number is a multiple of 12, for hexagons and halves."""
    count = max(12, 12 * round(2.0 * np.pi * r / spacing / 12.0))
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    cos, sin = np.cos(angle), np.sin(angle)
    points = np.stack((r * cos, r * sin, np.full(count, z)), axis=1)
    normals = np.stack((n_r * cos, n_r * sin, np.full(count, n_z)), axis=1)
    return points, normals, np.full(count, 2.0 * np.pi * r * length / count)


def _mesh(profile: Sequence[Curve]) -> tuple[Array, Array]:
    """Closed mesh; where the profile meets the axis, a fan ends in one vertex."""
    rows: list[tuple[float, float]] = []
    for curve in profile:
        fine = curve(np.linspace(0.0, 1.0, FINE))
        turning = np.unwrap(np.arctan2(np.diff(fine[1]), np.diff(fine[0])))
        count = max(1, int(np.ceil(np.abs(np.diff(turning)).sum() / MESH_ANGLE)))
        length = np.hypot(np.diff(fine[0]), np.diff(fine[1])).sum()
        count = max(count, int(np.ceil(length / 0.01)))
        r, z = curve(np.linspace(0.0, 1.0, count + 1))
        rows += list(zip(r[:-1].tolist(), z[:-1].tolist(), strict=True))
    last = [float(v[0]) for v in profile[-1](np.array([1.0]))]
    closed = np.hypot(last[0] - rows[0][0], last[1] - rows[0][1]) < 1e-9 and last[0] > 1e-9
    if not closed:
        rows.append((last[0], last[1]))
    return _revolve(rows, closed)


def _revolve(rows: Sequence[tuple[float, float]], closed: bool) -> tuple[Array, Array]:
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    vertices: list[Array] = []
    rings: list[Array] = []
    count = 0
    for r, z in rows:
        if r < 1e-9:
            vertices.append(np.array([[0.0, 0.0, z]]))
            rings.append(np.full(AROUND, count))
            count += 1
        else:
            vertices.append(
                np.stack((r * np.cos(angle), r * np.sin(angle), np.full(AROUND, z)), axis=1)
            )
            rings.append(count + np.arange(AROUND))
            count += AROUND
    faces = []
    following = rings[1:] + ([rings[0]] if closed else [])
    for low, high in zip(rings, following, strict=False):
        low_next, high_next = np.roll(low, -1), np.roll(high, -1)
        faces.append(np.stack((low, low_next, high_next), axis=1))
        faces.append(np.stack((low, high_next, high), axis=1))
    triangles = np.concatenate(faces)
    distinct = (
        (triangles[:, 0] != triangles[:, 1])
        & (triangles[:, 1] != triangles[:, 2])
        & (triangles[:, 2] != triangles[:, 0])
    )
    return np.concatenate(vertices), triangles[distinct]


def bent(solid: Solid, radius: float, length: float) -> Solid:
    """A rod along z, from 0 to a length, bent to an arc in the plane of x and z.

    Args:
        solid: the rod; what is beyond its ends goes straight on.
        radius: of the bent middle line, about a point on the side of +x [m].
        length: of the rod [m].
    """

    def mapping(points: Array) -> Array:
        x, y, z = points.T
        along = np.clip(z, 0.0, length)
        angle, beyond = along / radius, z - along
        out = radius - x
        new_x = radius - out * np.cos(angle) + beyond * np.sin(angle)
        new_z = out * np.sin(angle) + beyond * np.cos(angle)
        return np.stack((new_x, y, new_z), axis=1)

    return solid.mapped(mapping)


def stretched(solid: Solid, factors: tuple[float, float, float]) -> Solid:
    """Stretched along the axes."""
    return solid.mapped(lambda points: points * np.array(factors))


def hexagonal(solid: Solid, inner: float, outer: float) -> Solid:
    """What is round at radius `outer` becomes a hexagon of that inscribed radius, what is round at
    `inner` stays."""

    def mapping(points: Array) -> Array:
        x, y, z = points.T
        r, angle = np.hypot(x, y), np.arctan2(y, x)
        sector = (angle + np.pi) % (np.pi / 3.0) - np.pi / 6.0
        share = np.clip((r - inner) / (outer - inner), 0.0, None)
        grown = r * (1.0 + share * (1.0 / np.cos(sector) - 1.0))
        return np.stack((grown * np.cos(angle), grown * np.sin(angle), z), axis=1)

    return solid.mapped(mapping)
