"""Closing of open surfaces, as walls of a given thickness or with caps over the openings."""

from __future__ import annotations

from typing import Literal

import manifold3d
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from burg_drake.core import Array
from burg_drake.objects.closed_surfaces import is_closed, split_bodies, unite_bodies
from burg_drake.objects.mesh_repair import (
    MAX_HOLE_WIDTH,
    RepairedMesh,
    boundary_loops,
    rim_edges,
    signed_volume,
)


def vertex_offsets(mesh: trimesh.Trimesh) -> Array:
    """Vertex displacements when every face's plane moves by a unit distance along its normal.

    If more than three different normals meet at a vertex, no displacement suits all faces. The
    least-squares solution is used, weighted by the faces' angles at the vertex.

    Args:
        mesh: wound consistently, vertices merged.

    Returns:
        (V, 3), of length 1 in a plane, sqrt(3) at the corner of a box.
    """
    min_variance_share = 1e-3  # Share of the normals' variance below which a direction is ignored.
    max_move = 3.0  # Multiple of the distance; sharper tips are cut.
    count = len(mesh.vertices)
    corner = mesh.faces.reshape(-1)
    weight = np.asarray(mesh.face_angles).reshape(-1)
    normal = np.repeat(mesh.face_normals, 3, axis=0)
    total = np.column_stack(
        [np.bincount(corner, weight * normal[:, i], minlength=count) for i in range(3)]
    )
    squares = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(i, 3):
            products = weight * normal[:, i] * normal[:, j]
            squares[:, i, j] = squares[:, j, i] = np.bincount(corner, products, minlength=count)
    values, axes = np.linalg.eigh(squares)
    used = values > min_variance_share * values[:, -1:]
    along = np.einsum("vij,vi->vj", axes, total)
    along = np.where(used, along / np.where(used, values, 1.0), 0.0)
    moves = np.einsum("vij,vj->vi", axes, along)
    length = np.linalg.norm(moves, axis=1, keepdims=True)
    return np.asarray(moves * np.minimum(1.0, max_move / np.maximum(length, 1e-12)))


def smooth_offsets(mesh: trimesh.Trimesh) -> Array:
    """Smoothed offsets (V, 3) of unit length. They do not fold a rough surface, but keep the
    distance only approximately."""
    rounds = 20  # Rounds of averaging over neighbours.
    edges = mesh.edges_unique
    normals = vertex_offsets(mesh)
    for _ in range(rounds):
        total = normals.copy()
        for i in range(3):
            for a, b in (edges.T, edges.T[::-1]):
                total[:, i] += np.bincount(a, normals[b, i], minlength=len(total))
        normals = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    return normals


def folded_share(mesh: trimesh.Trimesh, moved: Array) -> float:
    """Share of the area, in [0, 1], that turns over when the vertices move to `moved` (V, 3)."""
    t = moved[mesh.faces]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    over = np.einsum("ij,ij->i", normal, mesh.face_normals) <= 0.0
    areas = mesh.area_faces
    return float(areas[over].sum() / areas.sum())


def default_wall(mesh: trimesh.Trimesh) -> float:
    """Default thickness of the wall that an open surface becomes [m]."""
    usual_thickness = 2e-3  # Metres, about that of crockery or a plastic box.
    max_diagonal_share = 0.02  # Thickness over the mesh's diagonal.
    return min(usual_thickness, max_diagonal_share * float(np.linalg.norm(mesh.extents)))


def thicken_sheet(sheet: trimesh.Trimesh, thickness: float) -> trimesh.Trimesh | None:
    """Makes an open surface a closed wall, with half the thickness on either side.

    If more than two faces meet at an edge, each sheet ends there with its own rim, and the walls
    overlap.

    Args:
        sheet: open surface [m].
        thickness: thickness of the wall [m].

    Returns:
        The wall, wound outward; None if the surface has only one side (a Moebius strip) or is so
        crumpled that its two sides would intersect.
    """
    max_folded_share = 0.02  # Share of the area that may turn over in creases.
    min_volume_ratio = 0.5  # Volume over area times thickness; below it the wall intersects itself.
    sheet = separate_faces(sheet)
    if not sheet.is_winding_consistent:
        trimesh.repair.fix_winding(sheet)
    if not sheet.is_winding_consistent:
        return None
    for moves in (vertex_offsets, smooth_offsets):
        half = 0.5 * thickness * moves(sheet)
        sides = [sheet.vertices + half, sheet.vertices - half]
        if max(folded_share(sheet, side) for side in sides) > max_folded_share:
            continue
        result = _stitch_rims(sheet, *sides)
        if is_closed(result) and signed_volume(result) > min_volume_ratio * thickness * sheet.area:
            return result
    return None


def separate_faces(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Duplicates vertices so that at most two faces meet at an edge and one fan of faces at a
    vertex."""
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


def _stitch_rims(sheet: trimesh.Trimesh, upper: Array, lower: Array) -> trimesh.Trimesh:
    count = len(sheet.vertices)
    a, b = rim_edges(sheet).T
    side = np.vstack(
        [np.column_stack([b, a, a + count]), np.column_stack([b, a + count, b + count])]
    )
    faces = np.vstack([sheet.faces, sheet.faces[:, ::-1] + count, side])
    return trimesh.Trimesh(np.vstack([upper, lower]), faces, process=False)


Openings = Literal["wall", "close"]


def close_openings(
    result: RepairedMesh, openings: Openings, thickness: float | None
) -> float | None:
    """Closes a repaired surface that is still open.

    Args:
        result: changed in place, with a sentence on the change; stays open if neither way gives a
            sound solid.
        openings: a `wall` centred on the surface, or `close` for flat caps.
        thickness: thickness of the wall [m]; `default_wall` if None.

    Returns:
        Thickness of the wall [m]; None if the surface did not become one.
    """
    mesh = result.mesh
    if is_closed(mesh) or not len(mesh.faces):
        return None
    loops = boundary_loops(mesh)
    if not len(rim_edges(mesh)):
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
    rest, sheets = _split_open_sheets(mesh)
    if len(rest.faces) and np.linalg.norm(sheets.extents) < MAX_HOLE_WIDTH * np.linalg.norm(
        mesh.extents
    ):
        result.mesh = rest
        result.sentences.append(f"dropped {len(sheets.faces)} faces without thickness")
        return None
    width = max(
        _rim_width(mesh.vertices[loop]) for loop in loops or [rim_edges(mesh).flatten().tolist()]
    )
    opening = f"largest opening {1e3 * width:.3g} mm wide"
    if openings == "close":
        if _close_with_caps(result, len(loops), opening):
            return None
        why = "flat caps do not close it"
    else:
        thickness = thickness or default_wall(mesh)
        if _thicken_sheets(result, rest, sheets, thickness, opening):
            return thickness
        why = f"a wall of {1e3 * thickness:.3g} mm would pass through itself"
        if not mesh.is_winding_consistent:
            why = "it has only one side (a Moebius strip)"
    result.sentences.append(
        f"the surface stays open ({opening}), as {why}; the volume is that of the convex pieces"
    )
    return None


def _thicken_sheets(
    result: RepairedMesh,
    rest: trimesh.Trimesh,
    sheets: trimesh.Trimesh,
    thickness: float,
    opening: str,
) -> bool:
    walled = thicken_sheet(sheets, thickness)
    if walled is None:
        return False
    parts = [p for p in (rest, walled) if len(p.faces)]
    result.mesh, repairs = unite_bodies(trimesh.util.concatenate(parts))
    result.sentences += [
        f"made the open surface ({opening}) a wall of {1e3 * thickness:.3g} mm; set the"
        " thickness with wall_thickness, or close it with caps by openings='close'",
        *repairs,
    ]
    return True


def _close_with_caps(result: RepairedMesh, count: int, opening: str) -> bool:
    capped = _cap_openings(result.mesh, skirt=False)
    if not is_closed(capped):  # the cap of a zigzag rim may reuse an edge of the surface
        capped = _cap_openings(result.mesh, skirt=True)
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


def _split_open_sheets(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Splits a surface into its closed part, which may be empty, and its open sheets, attached or
    separate."""
    patch = trimesh.graph.connected_component_labels(mesh.face_adjacency, len(mesh.faces))
    _, edge, count = np.unique(mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
    free = (count[edge.reshape(-1)] == 1).reshape(-1, 3).any(axis=1)
    open_ = np.isin(patch, patch[free])
    rest = _submesh(mesh, ~open_)
    if not is_closed(rest):
        open_[:] = True
        rest = _submesh(mesh, ~open_)
    return rest, _submesh(mesh, open_)


def _submesh(mesh: trimesh.Trimesh, keep: NDArray[np.bool_]) -> trimesh.Trimesh:
    part = trimesh.Trimesh(mesh.vertices, mesh.faces[keep], process=False)
    part.remove_unreferenced_vertices()
    return part


def _rim_width(points: Array) -> float:
    """Largest distance between points (N, 3) of a rim [m]."""
    max_points = 300  # Points of a rim that are compared.
    return float(pdist(points[:: 1 + len(points) // max_points]).max())


def _group_by_plane(mesh: trimesh.Trimesh, loops: list[list[int]]) -> list[list[list[int]]]:
    """Groups the rims of one body that lie in one plane."""
    plane_tolerance = 0.02  # Cosine below 1, and distance over width, within one plane.
    body = trimesh.graph.connected_component_labels(mesh.edges_unique, len(mesh.vertices))
    groups: list[list[list[int]]] = []
    for loop in loops:
        points = mesh.vertices[loop]
        centre, normal = points.mean(axis=0), _polygon_normal(points)
        for group in groups:
            other = mesh.vertices[group[0]]
            gap = abs(float((other.mean(axis=0) - centre) @ normal))
            flat = abs(float(_polygon_normal(other) @ normal)) > 1.0 - plane_tolerance
            if (
                body[group[0][0]] == body[loop[0]]
                and flat
                and gap < plane_tolerance * _rim_width(points)
            ):
                group.append(loop)
                break
        else:
            groups.append([loop])
    return groups


def _polygon_normal(points: Array) -> Array:
    """Unit normal of a closed polygon (N, 3), from its area vector."""
    p = points - points.mean(axis=0)
    area = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
    return np.asarray(area / max(float(np.linalg.norm(area)), 1e-300))


def _cap_openings(mesh: trimesh.Trimesh, skirt: bool) -> trimesh.Trimesh:
    """A surface with caps over its openings. The caps end at the rims or, with `skirt`, at a
    straight skirt from each rim to the plane through its outermost point."""
    mesh = separate_faces(mesh)
    vertices, faces = [np.asarray(mesh.vertices)], [np.asarray(mesh.faces)]
    count = len(mesh.vertices)
    for group in _group_by_plane(mesh, boundary_loops(mesh)):
        rings = [np.array(loop[::-1]) for loop in group]
        widest = max(rings, key=lambda ring: _rim_width(mesh.vertices[ring]))
        normal = _polygon_normal(mesh.vertices[widest])
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
        flat = [mesh.vertices[ring] @ _plane_axes(normal) for ring in rings]
        corners = np.asarray(manifold3d.triangulate(flat), dtype=np.int64).reshape(-1, 3)
        faces.append(np.concatenate(feet or rings)[corners])
    return trimesh.Trimesh(np.vstack(vertices), np.vstack(faces), process=False)


def _plane_axes(normal: Array) -> Array:
    """(3, 2) axes perpendicular to a unit normal, right-handed with it."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.column_stack([across, np.cross(normal, across)])
