"""Open surfaces made closed: as walls, or with flat caps over their openings."""

from __future__ import annotations

from typing import Literal

import manifold3d
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from burg_drake.core import Array
from burg_drake.objects.meshes.cleaning import HOLE, Repaired, boundary_loops, signed_volume
from burg_drake.objects.meshes.solids import is_closed, split_bodies, united
from burg_drake.objects.meshes.walls import default_wall, rims, separated, thickened

Openings = Literal["wall", "close"]

SAME_PLANE = 0.02
"""Rims lie in one plane when their normals' cosine is within this of 1, and their distance below
this share of the width: the two rims of a pipe cut across, which get one cap between them."""

RIM_POINTS = 300
"""Points of a rim that its width is measured with."""


def close_openings(result: Repaired, openings: Openings, thickness: float | None) -> float | None:
    """Closes a repaired surface that is still open.

    Args:
        result: changed in place, with a sentence on what was done; left open where neither way
            gives a sound solid.
        openings: a `wall` centred on the surface, or `close` for flat caps.
        thickness: of the wall [m]; `default_wall` if None.

    Returns:
        Thickness of the wall that it became [m]; None if it became none.
    """
    mesh = result.mesh
    if is_closed(mesh) or not len(mesh.faces):
        return None
    loops = boundary_loops(mesh)
    if not len(rims(mesh)):
        apart = split_bodies(mesh)
        if apart is not None:
            result.mesh = apart
            result.sentences.append("separated bodies that touch along an edge")
        else:
            result.sentences.append(
                "the surface stays open, as more than two faces meet at some edges; the"
                " volume is that of the convex pieces"
            )
        return None
    rest, sheets = _sheets(mesh)
    if len(rest.faces) and np.linalg.norm(sheets.extents) < HOLE * np.linalg.norm(mesh.extents):
        result.mesh = rest
        result.sentences.append(f"dropped {len(sheets.faces)} faces without thickness")
        return None
    width = max(_width(mesh.vertices[loop]) for loop in loops or [rims(mesh).flatten().tolist()])
    opening = f"largest opening {1e3 * width:.3g} mm wide"
    if openings == "close":
        if _close(result, len(loops), opening):
            return None
        why = "flat caps do not close it"
    else:
        thickness = thickness or default_wall(mesh)
        if _thicken(result, rest, sheets, thickness, opening):
            return thickness
        why = f"a wall of {1e3 * thickness:.3g} mm would pass through itself"
        if not mesh.is_winding_consistent:
            why = "it has only one side (a Moebius strip)"
    result.sentences.append(
        f"the surface stays open ({opening}), as {why}; the volume is that of the convex pieces"
    )
    return None


def _thicken(
    result: Repaired, rest: trimesh.Trimesh, sheets: trimesh.Trimesh, thickness: float, opening: str
) -> bool:
    walled = thickened(sheets, thickness)
    if walled is None:
        return False
    parts = [p for p in (rest, walled) if len(p.faces)]
    result.mesh, repairs = united(trimesh.util.concatenate(parts))
    result.sentences += [
        f"made the open surface ({opening}) a wall of {1e3 * thickness:.3g} mm; set the"
        " thickness with wall_thickness, or close it with caps by openings='close'",
        *repairs,
    ]
    return True


def _close(result: Repaired, count: int, opening: str) -> bool:
    capped = _capped(result.mesh, skirt=False)
    if not is_closed(capped):  # a rim that zigzags: an edge of the cap may be one of the surface
        capped = _capped(result.mesh, skirt=True)
    if not is_closed(capped) or signed_volume(capped) == 0.0:
        return False
    if signed_volume(capped) < 0.0:
        capped = trimesh.Trimesh(capped.vertices, capped.faces[:, ::-1], process=False)
        result.inverted = not result.inverted
    result.mesh = capped
    result.sentences.append(
        f"closed {count} openings with flat caps ({opening}); openings='wall' makes the"
        " surface a wall instead"
    )
    return True


def _sheets(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """A surface as its closed part, which may be empty, and the open sheets that hang on it or lie
    apart."""
    patch = trimesh.graph.connected_component_labels(mesh.face_adjacency, len(mesh.faces))
    _, edge, count = np.unique(mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
    free = (count[edge.reshape(-1)] == 1).reshape(-1, 3).any(axis=1)
    open_ = np.isin(patch, patch[free])
    rest = _part(mesh, ~open_)
    if not is_closed(rest):
        open_[:] = True
        rest = _part(mesh, ~open_)
    return rest, _part(mesh, open_)


def _part(mesh: trimesh.Trimesh, keep: NDArray[np.bool_]) -> trimesh.Trimesh:
    part = trimesh.Trimesh(mesh.vertices, mesh.faces[keep], process=False)
    part.remove_unreferenced_vertices()
    return part


def _width(points: Array) -> float:
    """Largest distance between points (N, 3) of a rim [m]."""
    return float(pdist(points[:: 1 + len(points) // RIM_POINTS]).max())


def _by_plane(mesh: trimesh.Trimesh, loops: list[list[int]]) -> list[list[list[int]]]:
    """Rims of one body that lie in one plane, together."""
    body = trimesh.graph.connected_component_labels(mesh.edges_unique, len(mesh.vertices))
    groups: list[list[list[int]]] = []
    for loop in loops:
        points = mesh.vertices[loop]
        centre, normal = points.mean(axis=0), _normal(points)
        for group in groups:
            other = mesh.vertices[group[0]]
            gap = abs(float((other.mean(axis=0) - centre) @ normal))
            flat = abs(float(_normal(other) @ normal)) > 1.0 - SAME_PLANE
            if body[group[0][0]] == body[loop[0]] and flat and gap < SAME_PLANE * _width(points):
                group.append(loop)
                break
        else:
            groups.append([loop])
    return groups


def _normal(points: Array) -> Array:
    """Unit normal of a closed polygon (N, 3) by its area vector."""
    p = points - points.mean(axis=0)
    area = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
    return np.asarray(area / max(float(np.linalg.norm(area)), 1e-300))


def _capped(mesh: trimesh.Trimesh, skirt: bool) -> trimesh.Trimesh:
    """A surface with caps over its openings, to the rims themselves or to the foot of a skirt that
    goes from each rim straight to the plane through its outermost point."""
    mesh = separated(mesh)
    vertices, faces = [np.asarray(mesh.vertices)], [np.asarray(mesh.faces)]
    count = len(mesh.vertices)
    for group in _by_plane(mesh, boundary_loops(mesh)):
        rings = [np.array(loop[::-1]) for loop in group]
        widest = max(rings, key=lambda ring: _width(mesh.vertices[ring]))
        normal = _normal(mesh.vertices[widest])
        height = max(float((mesh.vertices[ring] @ normal).max()) for ring in rings)
        feet = []
        for ring in rings if skirt else ():
            points = mesh.vertices[ring]
            vertices.append(points + (height - points @ normal)[:, None] * normal)
            foot = np.arange(count, count + len(ring))
            count += len(ring)
            ahead, foot_ahead = np.roll(ring, -1), np.roll(foot, -1)
            faces.append(np.column_stack([ring, ahead, foot_ahead]))
            faces.append(np.column_stack([ring, foot_ahead, foot]))
            feet.append(foot)
        flat = [mesh.vertices[ring] @ _plane(normal) for ring in rings]
        corners = np.asarray(manifold3d.triangulate(flat), dtype=np.int64).reshape(-1, 3)
        faces.append(np.concatenate(feet or rings)[corners])
    return trimesh.Trimesh(np.vstack(vertices), np.vstack(faces), process=False)


def _plane(normal: Array) -> Array:
    """(3, 2) axes across a unit normal, which they form a right-handed frame with."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.column_stack([across, np.cross(normal, across)])
