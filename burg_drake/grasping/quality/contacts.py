"""Where the pads of a parallel hand meet an object, for grasps in batch.

Each pad moves along its side of the closing axis until it touches; it is a Winkler foundation
(Johnson, "Contact Mechanics", 1985, section 4.3): independent springs over a flat face, pressed in
against the rigid object until they carry the hand's force. The object turns a little between the
pads until their pressures face each other, which `indentation` works out; nothing else moves here
(`sliding` has what comes next), and the pads' other faces and the rest of the hand do not enter.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, Indices, make_pose
from burg_drake.geometry import Surface
from burg_drake.grasping.quality.jaws import PANDA_JAWS, Jaws
from burg_drake.grasping.quality.pad_indentation import indentation

SPRINGS, LATTICE = 55, 34
"""Springs of a pad, in a Fibonacci lattice: no two of them share a row or a column of the pad, so
that an edge or a thin rim along either direction meets evenly spaced springs."""

CHUNK = 1024
"""Grasps looked at in one go; it bounds the memory."""

FAR = 1e3
"""Stands for the distance to nothing [m]."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The patches of N grasps, that of the pad on the side of +x of G first.

    Attributes:
        touching: (N,) whether both pads touch, one against the other; all others are NaN where not.
        p_OC: (N, 2, 3) centres of pressure on the object's surface [m].
        normal: (N, 2, 3) mean inward normals in the object frame, weighted by pressure; unit.
        area: (N, 2) of the patches, as the pad's face sees them [m^2].
        torsion_radius: (N, 2) mean distance from the centre of pressure, weighted by pressure [m]:
            the torque that turns the patch in place is this times normal force times friction.
        indentation: (N, 2) of the pads where they are pressed in farthest [m].
    """

    touching: NDArray[np.bool_]
    p_OC: Array
    normal: Array
    area: Array
    torsion_radius: Array
    indentation: Array

    def select(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> Contacts:
        """Some of the grasps."""
        return Contacts(*(getattr(self, field.name)[index] for field in fields(self)))

    @property
    def radius(self) -> Array:
        """(N, 2) radii of circles as large as the patches [m]."""
        return np.asarray(np.sqrt(self.area / np.pi))


def grasp_contacts(surface: Surface, X_OG: Array, jaws: Jaws = PANDA_JAWS) -> Contacts:
    """Closes the jaws on an object.

    G need not lie midway between the contacts. Surfaces that a pad would meet from behind are not
    seen, as where the open pad stands inside of the object.

    Args:
        surface: of the object, in its frame O.
        X_OG: (N, 4, 4) grasps.
        jaws: the hand.
    """
    parts = [
        _contacts(surface, np.asarray(X_OG[i : i + CHUNK], float), jaws)
        for i in range(0, max(len(X_OG), 1), CHUNK)
    ]
    names = [field.name for field in fields(Contacts)]
    return Contacts(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def friction_needed(contacts: Contacts) -> Array:
    """(N,) tangent of the larger angle between inward normals and the line through both contacts.

    Less friction does not hold. Infinite from 90 degrees, NaN where not both pads touch.
    """
    angle = largest_angle(contacts.normal, contacts.p_OC[:, 1] - contacts.p_OC[:, 0])
    return np.asarray(np.where(angle < 0.5 * np.pi, np.tan(angle), np.inf) + 0.0 * angle)


def antipodal_angle(contacts: Contacts, X_OG: Array) -> Array:
    """(N,) larger of the angles between the closing directions of grasps (N, 4, 4), before the
    object turns, and the inward normals [rad]; NaN where not both pads touch."""
    return largest_angle(contacts.normal, -X_OG[:, :3, 0])


def are_antipodal(contacts: Contacts, X_OG: Array, friction: float) -> NDArray[np.bool_]:
    """(N,) whether both pads of grasps (N, 4, 4) touch, and the closing direction and the line
    through the contacts lie in the friction cones of both."""
    in_cones = antipodal_angle(contacts, X_OG) <= np.arctan(friction)
    return np.asarray(in_cones & (friction_needed(contacts) <= friction))


def largest_angle(normal: Array, line: Array) -> Array:
    """(N,) larger of the angles between normals (N, 2, 3) and the line (N, 3) that leads from the
    first contact to the second, turned round for the second [rad]."""
    towards = np.stack([line, -line], axis=1)
    sine = np.linalg.norm(np.cross(normal, towards), axis=-1)
    return np.asarray(np.arctan2(sine, (normal * towards).sum(axis=-1)).max(axis=1))


def _contacts(surface: Surface, X_OG: Array, jaws: Jaws) -> Contacts:
    first = _Touch.of(surface, X_OG, jaws)
    touch = _Touch.of(surface, _turned(X_OG, first), jaws)
    p_GC, weight, where = touch.p_GC, touch.weight, touch.touching
    normal = -(weight[..., None] * surface.normals[touch.face]).sum(axis=2)
    lever = touch.yz[None] - p_GC[:, :, None, 1:]
    # a spring stands for its cell, whose points are sqrt(cell / 2 pi) from it in the mean square
    square = (lever**2).sum(axis=-1) + touch.cell / (2.0 * np.pi)
    found = (
        _rotate(touch.X_OG, p_GC) + touch.X_OG[:, None, :3, 3],
        normal / np.linalg.norm(normal, axis=-1, keepdims=True),
        (touch.pressed > 0.0).sum(axis=2) * touch.cell,
        _mean(weight, np.sqrt(square)),
        touch.pressed.max(axis=2),
    )
    return Contacts(where, *(_spread(values, where) for values in found))


@dataclass(frozen=True, eq=False)
class _Touch:
    """What M of N grasps touch, as they are.

    Attributes:
        touching: (N,) which ones.
        X_OG: (M, 4, 4).
        yz: (2, K, 2) springs on the pads' faces [m].
        cell: area that a spring stands for [m^2].
        face: (M, 2, K) faces that they meet.
        pressed: (M, 2, K) their indentations [m].
        weight: (M, 2, K) their shares of a pad's force.
        p_GC: (M, 2, 3) centres of pressure [m].
        slope: (M, 2) how the object turns: along x for each metre along y and z.
    """

    touching: NDArray[np.bool_]
    X_OG: Array
    yz: Array
    cell: float
    face: Indices
    pressed: Array
    weight: Array
    p_GC: Array
    slope: Array

    @classmethod
    def of(cls, surface: Surface, X_OG: Array, jaws: Jaws) -> _Touch:
        yz, cell = _springs(jaws)
        face, distance = _cast(surface, X_OG, yz, jaws)
        first = distance.min(axis=2)
        touching = np.isfinite(first).all(axis=1)
        width = jaws.opening[1] - first.sum(axis=1)
        touching &= width > max(jaws.opening[0], surface.rays.offset)
        face, distance, first = face[touching], distance[touching], first[touching]
        met = face >= 0
        gap = np.where(met, distance, FAR) - first[:, :, None]
        pressed, slope = indentation(gap, yz, jaws.force / (jaws.foundation * cell))
        weight = pressed / pressed.sum(axis=2, keepdims=True)
        x = (0.5 * jaws.opening[1] - np.where(met, distance, 0.0)) * np.array([[1.0], [-1.0]])
        p_GC = np.stack([_mean(weight, v) for v in (x, yz[..., 0], yz[..., 1])], axis=-1)
        return cls(touching, X_OG[touching], yz, cell, face, pressed, weight, p_GC, slope)


def _turned(X_OG: Array, touch: _Touch) -> Array:
    """The grasps (N, 4, 4) when the object has turned about the middle between the contacts."""
    zero = np.zeros(len(touch.slope))
    turn = np.stack([zero, -touch.slope[:, 1], touch.slope[:, 0]], axis=-1)
    X_GT = make_pose(Rotation.from_rotvec(turn).as_matrix())
    middle = touch.p_GC.mean(axis=1)
    X_GT[:, :3, 3] = middle - _rotate(X_GT, middle[:, None])[:, 0]
    turned = X_OG.copy()
    turned[touch.touching] = sum(touch.X_OG[:, :, k, None] * X_GT[:, None, k] for k in range(4))
    return turned


def _spread(values: Array, where: NDArray[np.bool_]) -> Array:
    """Values (M, ...) of the M grasps where it is true among all (N, ...), NaN at the others."""
    full = np.full((len(where), *values.shape[1:]), np.nan)
    full[where] = values
    return full


def _springs(jaws: Jaws) -> tuple[Array, float]:
    """Places of the springs (2, K, 2) along y and z of G [m], those of the second pad turned half a
    turn about z against those of the first, and the area that a spring stands for [m^2]."""
    i = np.arange(SPRINGS)
    share = np.stack([i + 0.5, i * LATTICE % SPRINGS + 0.5], axis=-1) / SPRINGS
    low, high = np.array([jaws.y, jaws.z]).T
    first = low + share * (high - low)
    turned = np.stack([-first[:, 0], first[:, 1]], axis=-1)
    return np.stack([first, turned]), jaws.pad_area / SPRINGS


def _cast(surface: Surface, X_OG: Array, yz: Array, jaws: Jaws) -> tuple[Indices, Array]:
    """What the springs meet (N, 2, K): faces, -1 for none, and their distance from the open pad."""
    half = 0.5 * jaws.opening[1]
    x = np.broadcast_to(np.array([[half], [-half]])[:, :, None], (*yz.shape[:2], 1))
    p_GS = np.concatenate([x, yz], axis=-1).reshape(-1, 3)
    p_OS = _rotate(X_OG, p_GS) + X_OG[:, None, :3, 3]
    closing = X_OG[:, None, None, :3, 0] * np.array([-1.0, 1.0])[:, None, None]
    direction = np.broadcast_to(closing, (len(X_OG), *yz.shape[:2], 3)).reshape(-1, 3)
    face, distance = surface.rays.first_hits(p_OS.reshape(-1, 3), direction, jaws.opening[1])
    from_behind = np.einsum("ij,ij->i", surface.normals[face], direction) >= 0.0
    face = np.where(from_behind, -1, face)
    distance = np.where(face >= 0, distance, np.inf)
    shape = (len(X_OG), *yz.shape[:2])
    return face.reshape(shape), distance.reshape(shape)


def _mean(weight: Array, values: Array) -> Array:
    """(N, 2) means of values (..., 2, K) with weights (N, 2, K)."""
    return np.asarray(np.multiply(weight, values, order="C").sum(axis=-1))


def _rotate(X_OG: Array, p_G: Array) -> Array:
    """Vectors (K, 3) or (N, K, 3) of G in O, (N, K, 3); the same bits alone and in any batch."""
    R = X_OG[:, None, :3, :3]
    x, y, z = (p_G[..., k, None] for k in range(3))
    return np.asarray(R[..., 0] * x + R[..., 1] * y + R[..., 2] * z)
