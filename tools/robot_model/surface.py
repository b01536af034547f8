"""Parts of a look from fields and exact solids: cuts, decals, simplification, normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold, Mesh64

from tools.robot_model.fields import Field, Vector, gradient, inset
from tools.robot_model.obj import Part
from tools.robot_model.surface_nets import surface_net

CREASE = np.cos(np.deg2rad(35.0))
"""Faces that differ more than this from the smooth normal keep an edge."""
ON_SURFACE = 3.0e-4
"""Vertices this close to a field's surface take its gradient as normal [m]."""

TOLERANCE = 3.5e-4
"""Allowed deviation of simplified surfaces [m]."""
SLIVER = 7.0e-4
"""Triangles lower than this have no normal worth the name [m]."""

Plane = tuple[Vector, float]


@dataclass(frozen=True)
class Piece:
    """One material of a solid.

    Attributes:
        material: name of the material.
        keep: planes (normal, offset [m]); what lies on the side of the normal stays.
        remove: solids to take away.
        within: solids to stay inside of.
        depth: how far below the surface of the solid it lies [m]: 1 mm makes a seam, a negative
            value a decal.
    """

    material: str
    keep: Sequence[Plane] = ()
    remove: Sequence[Manifold] = ()
    within: Sequence[Manifold] = ()
    depth: float = 0.0


def pieces(
    field: Field,
    bounds: tuple[Sequence[float], Sequence[float]],
    cell: float,
    plan: Sequence[Piece],
    tolerance: float = TOLERANCE,
) -> list[Part]:
    """Parts of one solid: each of its own material, cut out, and perhaps a little inset.

    Args:
        field: the solid.
        bounds: corners of a box that holds it [m].
        cell: edge length of the sampling grid [m].
        plan: the pieces.
        tolerance: allowed deviation of the simplified surfaces [m].
    """
    parts = []
    for piece in plan:
        surface = inset(field, piece.depth)
        vertices, faces = surface_net(surface, *bounds, cell)
        body = Manifold(Mesh64(vertices, faces.astype(np.uint64)))
        for normal, offset in piece.keep:
            body = body.trim_by_plane(normal, offset)
        for tool in piece.remove:
            body = body - tool
        for tool in piece.within:
            body = body ^ tool
        parts += _dark_cuts(part(body, piece.material, surface, tolerance), piece.keep)
    return parts


def part(
    body: Manifold, material: str, field: Field | None = None, tolerance: float = TOLERANCE
) -> Part:
    """Simplifies a solid and gives it normals.

    Args:
        body: closed mesh.
        material: name of the material.
        field: gives the normals where the surface follows it; elsewhere, and without one, they are
            averages over the neighbouring faces by area, which keeps flat faces flat.
        tolerance: allowed deviation of the simplified surface [m].
    """
    mesh = body.simplify(tolerance).to_mesh64()
    vertices = np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts).astype(int)
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    keep = area > 1e-12
    faces, cross, flat = faces[keep], cross[keep], cross[keep] / area[keep, None]
    normals = _averaged(faces, cross, flat, len(vertices))
    if field is not None:
        slope = gradient(field, vertices)
        slope /= np.linalg.norm(slope, axis=1, keepdims=True) + 1e-12
        near = np.abs(field(vertices)) < ON_SURFACE
        edges = corners[keep] - np.roll(corners[keep], 1, axis=1)
        sliver = area[keep] < SLIVER * np.linalg.norm(edges, axis=2).max(axis=1)
        aligned = np.einsum("fcd,fd->fc", slope[faces], flat) > CREASE
        follows = near[faces] & (aligned | sliver[:, None])
        normals[follows] = slope[faces][follows]
    return _indexed(material, vertices[faces].reshape(-1, 3), normals.reshape(-1, 3))


def turned(parts: Sequence[Part], rotation: np.ndarray, translation: Sequence[float]) -> list[Part]:
    """The parts after a rotation (3, 3) and a translation (3,) [m]."""
    return [
        Part(
            p.material,
            p.vertices @ rotation.T + np.asarray(translation, float),
            p.normals @ rotation.T,
            p.faces,
        )
        for p in parts
    ]


def _dark_cuts(whole: Part, planes: Sequence[Plane]) -> list[Part]:
    """The part, and apart from it in dark its faces on the planes: what one sees in a seam."""
    cut = np.zeros(len(whole.faces), dtype=bool)
    for normal, offset in planes:
        height = whole.vertices @ np.asarray(normal, float) - offset
        cut |= (np.abs(height) < 2.0e-5)[whole.faces].all(axis=1)
    halves = [(whole.material, ~cut), ("dark", cut)]
    return [_selected(whole, material, mask) for material, mask in halves if mask.any()]


def _selected(whole: Part, material: str, mask: np.ndarray) -> Part:
    used, index = np.unique(whole.faces[mask], return_inverse=True)
    return Part(material, whole.vertices[used], whole.normals[used], index.reshape(-1, 3))


def _averaged(faces: np.ndarray, cross: np.ndarray, flat: np.ndarray, count: int) -> np.ndarray:
    """Corner normals (F, 3, 3): area-weighted over the faces around, up to the crease angle."""
    around: list[list[int]] = [[] for _ in range(count)]
    for face, corners in enumerate(faces.tolist()):
        for vertex in corners:
            around[vertex].append(face)
    normals = np.empty((len(faces), 3, 3))
    for face, corners in enumerate(faces.tolist()):
        for corner, vertex in enumerate(corners):
            ring = np.array(around[vertex])
            ring = ring[flat[ring] @ flat[face] > CREASE]
            total = cross[ring].sum(axis=0)
            normals[face, corner] = total / np.linalg.norm(total)
    return normals


def _indexed(material: str, points: np.ndarray, normals: np.ndarray) -> Part:
    """Merges equal corners (position to 0.01 mm, normal to 0.001)."""
    key = np.hstack([np.round(points, 5), np.round(normals, 3)]) + 0.0
    unique, index = np.unique(key, axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Part(material, unique[:, :3], unique[:, 3:], faces[distinct])
