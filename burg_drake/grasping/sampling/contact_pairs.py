"""Pairs of opposing contacts that two frictional fingers can squeeze, by rays through a surface.

A point is drawn on the surface, and a line through the material within the friction cone about the
inward normal. Where the line leaves the material again, within the friction cone of that face, the
two points are an antipodal pair (Nguyen, "Constructing force-closure grasps", IJRR 1988).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices, perpendicular
from burg_drake.geometry import Surface

FINGER_CLEARANCE = 0.001
"""Room that each open finger keeps to its contact [m], so that the open hand can be placed."""

MIN_WIDTH = 1e-4
"""Contacts closer than this are the two sides of a surface without thickness [m]."""

CHUNK = 8192
"""Lines drawn at a time. Constant, so that the first n grasps of a seed do not depend on n."""

BLOCK = 1024
"""Rays cast at a time; for few grasps the rest of a chunk is never cast. Divides `CHUNK`."""

TOO_LONG, SLANTED, NO_ROOM = "too long", "slanted", "no room"
"""Why lines give no pairs: they leave the material nowhere within the hand's opening; a normal is
outside of the friction cone about the line; the object is in the way of a finger."""


@dataclass(frozen=True, eq=False)
class ContactPairs:
    """N pairs of opposing contacts.

    Attributes:
        p_OC1, p_OC2: (N, 3) contact points [m]; the closing direction is from C1 to C2, and its
            component of largest magnitude is positive.
        friction_needed: (N,) tangent of the larger of the two angles between the closing line and
            the surface normals: the smallest friction coefficient that holds the pair.
        left_out: how many lines gave no pair, or pairs did not count, and why.
    """

    p_OC1: Array
    p_OC2: Array
    friction_needed: Array
    left_out: Counter[str] = field(default_factory=Counter)


def draw_pairs(
    surface: Surface, rng: np.random.Generator, friction: float, opening: tuple[float, float]
) -> Iterator[ContactPairs]:
    """The pairs of `CHUNK` random lines, `BLOCK` lines at a time.

    First contacts have the density of `Surface.draw`, lines are uniform in the solid angle of the
    friction cone about the inward normal, and every pair of a line counts that fingers can close
    on: a line into the side of a mug leaves the material on the inside of the near wall and again
    on the outside of the far wall.

    Args:
        surface: where to sample.
        rng: random numbers; all that the lines take is drawn before the first pairs are given.
        friction: coefficient; the cone's half angle is its arctangent.
        opening: smallest and largest distance between the fingers [m].
    """
    p, face = surface.draw(CHUNK, rng)
    line = _directions_in_cone(-surface.normals[face], np.arctan(friction), rng)
    for start in range(0, CHUNK, BLOCK):
        block = slice(start, start + BLOCK)
        yield _pairs_along(surface, p[block], face[block], line[block], friction, opening)


def _pairs_along(
    surface: Surface,
    p1: Array,
    face1: Indices,
    line: Array,
    friction: float,
    opening: tuple[float, float],
) -> ContactPairs:
    """The pairs on lines (N, 3) into the material from points (N, 3) on faces (N,)."""
    widest = opening[1] - 2.0 * FINGER_CLEARANCE
    ray, face2, width = surface.rays.all_hits(p1, line, widest)
    left_out = Counter({TOO_LONG: len(p1) - len(np.unique(ray))})
    p1, face1, line = p1[ray], face1[ray], line[ray]
    cosine = np.minimum(_dot(-surface.normals[face1], line), _dot(surface.normals[face2], line))
    held = cosine >= 1.0 / np.hypot(1.0, friction)
    held &= (width >= max(opening[0], MIN_WIDTH)) & (width <= widest)
    left_out[SLANTED] = int((~held).sum())
    p1, line, width, cosine = p1[held], line[held], width[held], cosine[held]
    p2 = p1 + width[:, None] * line
    travel = 0.5 * (opening[1] - width)
    free = _finger_path_free(surface, p1, -line, travel)
    free &= _finger_path_free(surface, p2, line, travel)
    left_out[NO_ROOM] = int((~free).sum())
    p1, p2, line, cosine = p1[free], p2[free], line[free], np.minimum(cosine[free], 1.0)
    largest = np.abs(line).argmax(axis=1)[:, None]
    turned = np.take_along_axis(line, largest, axis=1) < 0.0
    return ContactPairs(
        np.where(turned, p2, p1),
        np.where(turned, p1, p2),
        np.sqrt(1.0 - cosine**2) / cosine,
        left_out,
    )


def _finger_path_free(
    surface: Surface, p_OC: Array, outward: Array, travel: Array
) -> NDArray[np.bool_]:
    """(N,) whether fingers reach the contacts (N, 3) from `travel` (N,) [m] away along `outward`.

    What the ray meets first decides: a face within the finger's travel is in the way, and a face
    seen from behind, at any distance, means that the contact lies inside of material (solids that
    overlap or touch, a surface that is doubled with both windings).
    """
    face, distance = surface.rays.first_hits(p_OC, outward)
    from_behind = _dot(surface.normals[face], outward) > 0.0
    return (face < 0) | ((distance > travel) & ~from_behind)


def _dot(a: Array, b: Array) -> Array:
    """(N,) inner products of the rows of (N, 3) arrays."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _directions_in_cone(axis: Array, half_angle: float, rng: np.random.Generator) -> Array:
    """(N, 3) unit vectors, uniform on the spherical caps about unit vectors `axis` (N, 3)."""
    cosine = 1.0 - rng.random((len(axis), 1)) * (1.0 - np.cos(half_angle))
    azimuth = rng.uniform(0.0, 2.0 * np.pi, (len(axis), 1))
    u, v = perpendicular(axis)
    sine = np.sqrt(1.0 - cosine**2)
    directions: Array = cosine * axis + sine * (np.cos(azimuth) * u + np.sin(azimuth) * v)
    return directions
