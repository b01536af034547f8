"""The grasp wrench space of two soft-finger contacts, for grasps in batch.

A contact with unit normal force can exert the wrenches c + A b, |b| <= 1: c is its normal force,
the columns of A are friction along two tangents and about the normal, within an ellipsoid (Howe
and Cutkosky, "Practical force-motion models for sliding manipulation", IJRR 1996). The wrench
space K is the convex hull of both sets (Ferrari and Canny, "Planning optimal grasps", ICRA 1992,
their L1 case).

Everything is computed on the polar set, K* = {u : w.u <= 1 for every w of K}. Where u is extreme,
both contacts slide, each against a unit vector nu: A_i' u = alpha_i nu_i and c_i.u + alpha_i = 1
with alpha_i >= 0. These are eight equations for eight unknowns, so a pair of unit vectors has at
most one such u, in closed form. With a polytope in place of the unit ball, nu runs through the
normals of its faces, and the pairs with a solution are the facets of the polytope's wrench space.
The other facets contain the whole set of one contact and an edge of the other contact's. No hull
algorithm is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Indices
from burg_drake.grasping.pad_contacts import Contacts


@dataclass(frozen=True, eq=False)
class TriangulatedBall:
    """A triangulated ball, the same after half a turn about x, y or z.

    Attributes:
        vertices: (V, 3).
        faces: (M, 3) vertices of the triangles, seen counter-clockwise from outside.
        normals: (M, 3) outward unit normals.
        distances: (M,) distances of the triangles' planes from the centre.
        edges: (E, 2) vertices of the edges.
        sides: (E, 2) the triangles that meet at each edge.
        neighbors: (M, 3) the triangles next to each triangle.
        volume: enclosed volume.
    """

    vertices: Array
    faces: Indices
    normals: Array
    distances: Array
    edges: Indices
    sides: Indices
    neighbors: Indices
    volume: float


@lru_cache(maxsize=8)
def triangulated_ball(subdivisions: int = 1, of_volume: bool = False) -> TriangulatedBall:
    """An icosahedron whose triangles are repeatedly divided into four.

    Args:
        subdivisions: number of divisions; there are 20 * 4**subdivisions triangles.
        of_volume: whether it has the volume of the unit ball; otherwise it is inscribed in it.
    """
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    scale = (4.0 / 3.0 * np.pi / mesh.volume) ** (1.0 / 3.0) if of_volume else 1.0
    vertices = np.asarray(mesh.vertices) * scale
    corners = vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    distances = (normals * corners[:, 0]).sum(axis=1)
    return TriangulatedBall(
        vertices,
        np.asarray(mesh.faces, np.int64),
        normals,
        distances,
        np.asarray(mesh.face_adjacency_edges, np.int64),
        np.asarray(mesh.face_adjacency, np.int64),
        _neighbors(np.asarray(mesh.face_adjacency, np.int64)),
        float(np.linalg.det(corners).sum() / 6.0),
    )


def _neighbors(sides: Indices) -> Indices:
    """(M, 3) neighbours of each triangle, from pairs of adjacent triangles (E, 2)."""
    both = np.concatenate([sides, sides[:, ::-1]])
    return both[np.argsort(both[:, 0], kind="stable"), 1].reshape(-1, 3)


COLUMN_TRIPLES = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Columns of (c, A) in the minors of three."""
COLUMN_PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
"""Columns of (c, A) in the minors of two."""


@dataclass(frozen=True, eq=False)
class WrenchSpace:
    """Wrench spaces of N grasps in force closure.

    Attributes:
        basis: (N, 2, 6, 4) columns c and A of both contacts: force [-], and torque about the centre
            of mass over the characteristic length [-].
        pseudo, null: (N, 2, 6, 4) pseudoinverse and (N, 2, 2, 4) null space. With y the values of
            (c, A)'u of both contacts, u is the sum of `pseudo` y, and the sum of `null` y is zero.
    """

    basis: Array
    pseudo: Array
    null: Array

    @classmethod
    def of(
        cls,
        contacts: Contacts,
        friction: float,
        center_of_mass: Array,
        length: float,
        tangent: Array,
    ) -> WrenchSpace:
        """Wrench spaces of contact patches with unit normal forces.

        Args:
            contacts: contacts of N grasps.
            friction: coefficient.
            center_of_mass: (3,) centre of mass in O [m]; torques are about it.
            length: characteristic length; torques are divided by it [m].
            tangent: (N, 3) direction in O that the tangents of the contacts start from.
        """
        n = contacts.normal
        t1 = tangent[:, None] - (tangent[:, None] * n).sum(-1, keepdims=True) * n
        small = np.linalg.norm(t1, axis=-1, keepdims=True) < 0.1
        other = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=-1)])
        t1 = np.where(small, other, t1)
        t1 /= np.linalg.norm(t1, axis=-1, keepdims=True)
        arm = (contacts.p_OC - center_of_mass) / length
        forces = np.stack([n, friction * t1, friction * np.cross(n, t1)], axis=-1)
        torques = np.cross(arm[..., None], forces, axis=-2)
        basis = np.zeros((*n.shape[:2], 6, 4))
        basis[..., :3, :3], basis[..., 3:, :3] = forces, torques
        basis[..., 3:, 3] = n * (friction * contacts.torsion_radius / length)[..., None]
        return cls.from_basis(basis)

    @classmethod
    def from_basis(cls, basis: Array) -> WrenchSpace:
        """Wrench spaces of c and A (N, 2, 6, 4), which have to span all wrenches."""
        Q, R = np.linalg.qr(basis.transpose(0, 1, 3, 2).reshape(-1, 8, 6), mode="complete")
        pseudo = np.linalg.solve(R[:, :6], Q[:, :, :6].transpose(0, 2, 1))
        null = Q[:, :, 6:].transpose(0, 2, 1)
        shaped = (v.reshape(-1, v.shape[1], 2, 4).transpose(0, 2, 1, 3) for v in (pseudo, null))
        return cls(basis, *(np.ascontiguousarray(v) for v in shaped))

    def __len__(self) -> int:
        return len(self.basis)

    def select(self, index: slice | NDArray[np.bool_] | NDArray[np.int64]) -> WrenchSpace:
        """Selects grasps."""
        return WrenchSpace(self.basis[index], self.pseudo[index], self.null[index])

    def slides(self, direction: Array, distance: Array | float) -> ContactSlides:
        """Contributions to u of each contact when it slides against given vectors.

        Args:
            direction: (M, 3) or (N, 2, M, 3) vectors nu.
            distance: (M,) or scalar, distance of the polytope's plane across nu from the centre; 1
                for the unit ball.
        """
        positive_zero = 1e-300  # A facet in one plane with its neighbours must count exactly once.
        direction = np.broadcast_to(direction, (len(self), 2, *direction.shape[-2:]))
        level = np.broadcast_to(-np.asarray(distance, float), direction.shape[:-1])
        y = np.concatenate([level[..., None], direction], axis=-1)
        u, zero = (y @ m.transpose(0, 1, 3, 2) for m in (self.pseudo, self.null))
        u0, right = self.pseudo[..., 0].sum(axis=1), -self.null[..., 0].sum(axis=1)
        turn = right[:, None, None, 0] * zero[..., 1] - right[:, None, None, 1] * zero[..., 0]
        return ContactSlides(u, zero, np.where(turn == 0.0, positive_zero, turn), u0)

    def rim(self, sliding: int) -> Rim:
        """The extreme u at which one contact does not slide.

        Args:
            sliding: 0 or 1, the contact that slides.
        """
        right = -self.null[..., 0].sum(axis=1)
        zero, pseudo = self.null[:, sliding], self.pseudo[:, sliding]
        turn = right[:, 0, None] * zero[:, 1] - right[:, 1, None] * zero[:, 0]
        size = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            axis, level = turn[:, 1:] / size, turn[:, :1] / size
            radius = np.sqrt(1.0 - level**2)
        t1 = np.cross(axis, np.eye(3)[np.abs(turn[:, 1:]).argmin(axis=1)])
        t1 *= radius / np.linalg.norm(t1, axis=1, keepdims=True)
        y = np.zeros((len(self), 3, 4))
        y[:, 0, 0], y[:, 0, 1:] = -1.0, level * axis
        y[:, 1, 1:], y[:, 2, 1:] = t1, np.cross(axis, t1)
        return Rim(
            self.pseudo[..., 0].sum(axis=1),
            y @ pseudo.transpose(0, 2, 1),
            np.einsum("nki,nci,nc->nk", y, zero, right),
            (right**2).sum(axis=1),
        )


@dataclass(frozen=True, eq=False)
class ContactSlides:
    """Contributions of M slides of each contact to u = u0 + alpha_1 u_1 + alpha_2 u_2.

    Attributes:
        u: (N, 2, M, 6) u_1 and u_2.
        zero: (N, 2, M, 2) with alpha_1 zero_1 + alpha_2 zero_2 = right.
        turn: (N, 2, M) cross products of right and zero.
        u0: (N, 6) the part without alpha.
    """

    u: Array
    zero: Array
    turn: Array
    u0: Array

    def pairs(self, guard: float = 0.0) -> tuple[Array, Array, NDArray[np.bool_]]:
        """alpha_1 and alpha_2 of all pairs, (N, M, M), and whether the pairs are extreme.

        Args:
            guard: relative determinant below which pairs are left out. They have no u, or a whole
                line of them, whose ends belong to other pairs.
        """
        one, two = self.zero[:, 0], self.zero[:, 1]
        cross = one[:, :, None, 0] * two[:, None, :, 1]
        cross -= one[:, :, None, 1] * two[:, None, :, 0]
        if guard:
            a, b = (np.abs(v[..., 0]) + np.abs(v[..., 1]) for v in (one, two))
            cross[np.abs(cross) < guard * a[:, :, None] * b[:, None]] = np.nan
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.reciprocal(cross, out=cross)
            alpha = self.turn[:, 1][:, None, :] * inverse
            beta = -self.turn[:, 0][:, :, None] * inverse
        return alpha, beta, (alpha > 0.0) & (beta > 0.0) & np.isfinite(inverse)

    def edges(self, sides: NDArray[np.int64]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """`pairs` for one contact that does not slide, and the other sliding against an edge.

        Args:
            sides: (E, 2) the two slides next to each edge.

        Returns:
            Factors of the two slides (N, 2, E); index 1 is the contact that slides.
        """
        one, two = self.zero[:, :, sides[:, 0]], self.zero[:, :, sides[:, 1]]
        cross = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / cross
            alpha = self.turn[:, :, sides[:, 1]] * inverse
            beta = -self.turn[:, :, sides[:, 0]] * inverse
        return alpha, beta, (alpha > 0.0) & (beta > 0.0) & np.isfinite(inverse)


@dataclass(frozen=True, eq=False)
class Rim:
    """Extreme u with A_1' u = 0: the other contact slides against the vectors of a circle, where
    the unit sphere meets a plane.

    Attributes:
        start: (N, 6) u without sliding.
        slide: (N, 3, 6) coefficients of 1, cosine and sine of the angle on the circle in the part
            of u that alpha multiplies; NaN without a circle.
        along: (N, 3) coefficients in the divisor of alpha = size / divisor.
        size: (N,) dividend of alpha.
    """

    start: Array
    slide: Array
    along: Array
    size: Array

    def u(self, angle: Array) -> Array:
        """(N, K, 6) u at angles (N, K); NaN where there is none."""
        turns = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            alpha = self.size[:, None] / np.einsum("nkt,nt->nk", turns, self.along)
        alpha = np.where(alpha > 0.0, alpha, np.nan)
        return np.asarray(self.start[:, None] + alpha[..., None] * (turns @ self.slide))


def hull_volume(space: WrenchSpace, polytope: TriangulatedBall) -> Array:
    """(N,) exact volumes of the wrench spaces with a polytope in place of the unit ball.

    Each facet is a simplex. The determinant of its corners is bilinear in the minors of the two
    contacts' corners (Cauchy and Binet), so that 28 determinants of 6 x 6 suffice for all facets.
    """
    chunk_size = 16  # Grasps evaluated together. Their pairs fit into a processor's cache.
    parts = [
        _hull_volume(space.select(slice(i, i + chunk_size)), polytope)
        for i in range(0, len(space), chunk_size)
    ]
    return np.concatenate([np.empty(0), *parts])


def _hull_volume(space: WrenchSpace, polytope: TriangulatedBall) -> Array:
    triangle, edge = _minors(polytope)
    slides = space.slides(polytope.normals, polytope.distances)
    _, _, extreme = slides.pairs()
    both = np.abs(triangle @ _three_by_one_determinants(space) @ triangle.T)
    total = np.where(extreme, both, 0.0).reshape(len(space), both[0].size).sum(axis=1)
    _, _, extreme = slides.edges(polytope.sides)
    for still in (0, 1):
        whole = np.abs((_two_by_two_determinants(space, still)[:, None] @ edge.T)[:, 0])
        part = np.where(extreme[:, 1 - still], whole, 0.0).sum(axis=1)
        total += 6.0 * polytope.volume * part
    return np.asarray(total / 720.0)


def _minors(polytope: TriangulatedBall) -> tuple[Array, Array]:
    """Minors of the corners with a row of ones on top: (M, 4) of triangles, (E, 6) of edges."""

    def columns(index: NDArray[np.int64]) -> Array:
        corners = polytope.vertices[index].transpose(0, 2, 1)
        return np.concatenate([np.ones((len(index), 1, index.shape[1])), corners], axis=1)

    triangles, edges = columns(polytope.faces), columns(polytope.edges)
    return (
        np.stack([np.linalg.det(triangles[:, rows]) for rows in COLUMN_TRIPLES], axis=-1),
        np.stack([np.linalg.det(edges[:, rows]) for rows in COLUMN_PAIRS], axis=-1),
    )


def _three_by_one_determinants(space: WrenchSpace) -> Array:
    """(N, 4, 4) determinants of three columns of the first contact beside three of the second."""
    one, two = space.basis[:, 0][:, :, COLUMN_TRIPLES], space.basis[:, 1][:, :, COLUMN_TRIPLES]
    shape = (len(space), 6, 4, 4, 3)
    one = np.broadcast_to(one[:, :, :, None], shape)
    two = np.broadcast_to(two[:, :, None], shape)
    return np.asarray(np.linalg.det(np.concatenate([one, two], axis=-1).transpose(0, 2, 3, 1, 4)))


def _two_by_two_determinants(space: WrenchSpace, still: int) -> Array:
    """(N, 6) determinants of all columns of one contact beside two columns of the other one."""
    one, two = space.basis[:, still], space.basis[:, 1 - still][:, :, COLUMN_PAIRS]
    one = np.broadcast_to(one[:, :, None], (len(space), 6, len(COLUMN_PAIRS), 4))
    return np.asarray(np.linalg.det(np.concatenate([one, two], axis=-1).transpose(0, 2, 1, 3)))
