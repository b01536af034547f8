"""Repair of triangle meshes: merging, removal of small fragments, hole filling, winding."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray

MAX_HOLE_WIDTH = 0.15
"""Largest width of a hole that is filled, over the mesh's diagonal."""


@dataclass
class RepairedMesh:
    """A repaired mesh.

    Attributes:
        mesh: the result.
        inverted: whether the whole surface was turned inside out.
        sentences: the changes, one sentence each.
    """

    mesh: trimesh.Trimesh
    inverted: bool = False
    sentences: list[str] = field(default_factory=list)


def repair(raw: trimesh.Trimesh) -> RepairedMesh:
    """Returns a repaired copy of a surface, without texture.

    Args:
        raw: surface in metres with finite vertices.
    """
    mesh = trimesh.Trimesh(np.array(raw.vertices), np.array(raw.faces), process=False)
    result = RepairedMesh(mesh)
    _merge_vertices(result)
    _drop_degenerate(result)
    _drop_small_bodies(result)
    _make_winding_consistent(result)
    _fill_holes(result)
    _orient_outward(result)
    result.mesh.remove_unreferenced_vertices()
    return result


def connected_bodies(mesh: trimesh.Trimesh) -> list[NDArray[np.int64]]:
    """Face indices of each edge-connected body, largest first."""
    edges = mesh.edges_sorted
    order = np.lexsort(edges.T)
    face = mesh.edges_face[order]
    same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
    pairs = np.column_stack([face[:-1][same], face[1:][same]])
    labels = trimesh.graph.connected_component_labels(pairs, node_count=len(mesh.faces))
    split = np.argsort(labels, kind="stable")
    groups = np.split(split, np.cumsum(np.bincount(labels))[:-1])
    return sorted(groups, key=len, reverse=True)


def _merge_vertices(result: RepairedMesh) -> None:
    mesh = result.mesh
    given = mesh.copy()
    mesh.remove_unreferenced_vertices()
    before = len(mesh.vertices)
    if before < len(given.vertices):
        unused = len(given.vertices) - before
        result.sentences.append(f"dropped {unused} vertices that no face uses")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    merged = before - len(mesh.vertices)
    if merged:
        result.sentences.append(f"merged {merged} duplicate vertices")
    if not mesh.is_watertight:
        sewn = mesh.copy()
        digits = int(np.ceil(-np.log10(1e-5 * mesh.scale)))
        sewn.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=digits)
        if sewn.is_watertight:
            result.sentences.append(
                f"merged {len(mesh.vertices) - len(sewn.vertices)} nearly coincident vertices"
            )
            result.mesh = sewn
        else:
            _keep_bodies_apart(result, given)


def _keep_bodies_apart(result: RepairedMesh, given: trimesh.Trimesh) -> None:
    """Merges corners within each body only, if the bodies that the file keeps apart share corners
    and each is closed by itself."""
    labels = trimesh.graph.connected_component_labels(given.edges, len(given.vertices))
    if labels.max() < 1:
        return
    rows = np.column_stack([given.vertices, labels])
    _, first, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    faces = place.reshape(-1)[given.faces]
    apart = trimesh.Trimesh(given.vertices[first], faces, process=False)
    apart.remove_unreferenced_vertices()
    if apart.is_watertight:
        merged = len(np.unique(given.faces)) - len(apart.vertices)
        result.sentences = [s for s in result.sentences if not s.startswith("merged")]
        result.sentences += [f"merged {merged} duplicate vertices"] if merged else []
        result.mesh = apart


def _drop_degenerate(result: RepairedMesh) -> None:
    """Drops faces without three different corners and duplicate faces. If the surface is closed
    without the duplicates (a fin without thickness), no copy of them is kept."""
    mesh = result.mesh
    f = mesh.faces
    proper = (f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])
    mesh.update_faces(proper)
    if not proper.all():
        result.sentences.append(f"dropped {int((~proper).sum())} degenerate faces")
    key = np.sort(mesh.faces, axis=1)
    _, group, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    if (count == 1).all():
        return
    _, first = np.unique(group, return_index=True)
    keep = np.zeros(len(group), dtype=bool)
    keep[first] = True
    doubtful = first[count > 1]
    _, edge = np.unique(mesh.edges_sorted, axis=0, return_inverse=True)
    edge = edge.reshape(-1, 3)
    while len(doubtful):
        uses = np.bincount(edge[keep].reshape(-1), minlength=int(edge.max()) + 1)[edge[doubtful]]
        fin = (uses > 2).any(axis=1) | (uses == 1).all(axis=1)
        keep[doubtful[fin]] = False
        doubtful = doubtful[~fin] if fin.any() else doubtful[:0]
    mesh.update_faces(keep)
    result.sentences.append(f"dropped {int((~keep).sum())} duplicate faces")


def _drop_small_bodies(result: RepairedMesh) -> None:
    max_diagonal_share = 0.02  # Diagonal of a fragment over that of the whole mesh.
    mesh = result.mesh
    groups = connected_bodies(mesh)
    if len(groups) < 2:
        return
    diagonal = np.linalg.norm(mesh.extents)
    specks = [
        g
        for g in groups[1:]
        if np.linalg.norm(np.ptp(mesh.vertices[mesh.faces[g]].reshape(-1, 3), axis=0))
        < max_diagonal_share * diagonal
    ]
    if specks:
        keep = np.ones(len(mesh.faces), dtype=bool)
        keep[np.concatenate(specks)] = False
        mesh.update_faces(keep)
        result.sentences.append(
            f"dropped {len(specks)} tiny separate parts ({int((~keep).sum())} faces)"
        )


def _fill_holes(result: RepairedMesh) -> None:
    mesh = result.mesh
    loops = boundary_loops(mesh)
    if not loops:
        return
    limit = MAX_HOLE_WIDTH * np.linalg.norm(mesh.extents)
    faces, filled = [], 0
    vertices = [mesh.vertices]
    count = len(mesh.vertices)
    for loop in loops:
        points = mesh.vertices[loop]
        if np.linalg.norm(np.ptp(points, axis=0)) > limit:
            continue
        filled += 1
        if len(loop) == 3:
            faces.append(np.array([loop[::-1]]))
            continue
        hub = np.full(len(loop), count)
        vertices.append(points.mean(axis=0)[None])
        count += 1
        faces.append(np.column_stack([np.roll(loop, -1), loop, hub]))
    if filled:
        result.mesh = trimesh.Trimesh(
            np.vstack(vertices), np.vstack([mesh.faces, *faces]), process=False
        )
        result.sentences.append(f"filled {filled} small holes")


def rim_edges(mesh: trimesh.Trimesh) -> NDArray[np.int64]:
    """Edges (E, 2) that belong to only one face, in the direction of that face."""
    _, inverse, count = np.unique(
        mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
    )
    return np.asarray(mesh.edges[count[inverse.reshape(-1)] == 1])


def boundary_loops(mesh: trimesh.Trimesh) -> list[list[int]]:
    """Closed loops of boundary edges as vertex indices, in the direction of their faces."""
    following: dict[int, list[int]] = {}
    for a, b in rim_edges(mesh).tolist():
        following.setdefault(a, []).append(b)
    loops = []
    for start in sorted(following):
        while following.get(start):
            loop, at = [start], following[start].pop()
            while at != start and following.get(at):
                loop.append(at)
                at = following[at].pop()
            if at == start and len(loop) >= 3:
                loops.append(loop)
    return loops


def _make_winding_consistent(result: RepairedMesh) -> None:
    mesh = result.mesh
    if mesh.is_winding_consistent:
        return
    before = mesh.faces.copy()
    trimesh.repair.fix_winding(mesh)
    turned = int((mesh.faces != before).any(axis=1).sum())
    if turned:
        result.sentences.append(f"turned {turned} faces to a consistent winding")


def _orient_outward(result: RepairedMesh) -> None:
    mesh = result.mesh
    groups = connected_bodies(mesh) if len(mesh.faces) else []
    flips = _inverted_bodies(mesh, groups)
    if not any(flips):
        return
    faces = mesh.faces.copy()
    for group, flip in zip(groups, flips, strict=True):
        if flip:
            faces[group] = faces[group][:, ::-1]
    result.inverted = all(flips)
    result.mesh = trimesh.Trimesh(mesh.vertices, faces, process=False)
    what = "the surface" if result.inverted else f"{sum(flips)} of {len(groups)} bodies"
    result.sentences.append(f"turned {what} inside out so that normals point outward")


def _inverted_bodies(mesh: trimesh.Trimesh, groups: list[NDArray[np.int64]]) -> list[bool]:
    """Bodies to flip: those with negative volume that are not cavities of another body, and the
    bodies inside these."""
    rounding_share = 1e-9  # Volume over bounding box that is rounding error.
    parts = [mesh.submesh([g], append=True, repair=False) for g in groups]
    volumes = [signed_volume(p) for p in parts]
    size = [float(np.prod(np.maximum(p.extents, 1e-12))) for p in parts]
    flips = [False] * len(parts)
    for i in sorted(range(len(parts)), key=lambda k: -size[k]):
        hosts = [
            k
            for k in range(len(parts))
            if size[k] > size[i] and len(parts) <= 64 and encloses(parts[k], parts[i])
        ]
        flips[i] = (
            flips[min(hosts, key=lambda k: size[k])]
            if hosts
            else volumes[i] < -rounding_share * size[i]
        )
    return flips


def signed_volume(mesh: trimesh.Trimesh) -> float:
    """Volume by the divergence theorem about the mesh's centre [m^3]; negative if inside out."""
    t = mesh.triangles - mesh.bounds.mean(axis=0)
    return float(np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2])) / 6.0)


def encloses(outer: trimesh.Trimesh, inner: trimesh.Trimesh) -> bool:
    """Whether a body lies inside another one, judged by its bounding box and one of its points."""
    low, high = outer.bounds
    if not outer.is_watertight or (inner.bounds[0] < low).any() or (inner.bounds[1] > high).any():
        return False
    return bool(outer.contains(inner.triangles_center[:1])[0])


MAX_SELF_OVERLAP = 0.003
"""Share of the volume that a sound surface may enclose twice, in creases of scans."""


def self_overlap(surface: trimesh.Trimesh, seed: int = 0) -> float:
    """Share of the volume inside a surface whose winding number is not 1, estimated from the
    lengths of random lines, uniform in position and direction.

    Args:
        surface: closed surface, wound outward.
        seed: seed of the random lines.
    """
    ray_count = 1000  # Random rays through the surface.
    rng = np.random.default_rng(seed)
    through, _ = trimesh.sample.sample_surface(surface, ray_count, seed=seed)
    direction = rng.normal(size=(ray_count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    start = through - 1.5 * np.linalg.norm(surface.extents) * direction
    points, ray, face = surface.ray.intersects_location(start, direction, multiple_hits=True)
    depth = np.einsum("ij,ij->i", points - start[ray], direction[ray])
    entering = -np.einsum("ij,ij->i", surface.face_normals[face], direction[ray])
    # lines are drawn by their intersections with the surface, and more often at flat angles
    density = np.bincount(ray, 1.0 / np.maximum(np.abs(entering), 1e-9), minlength=ray_count)
    order = np.lexsort([depth, ray])
    ray, depth, entering = ray[order], depth[order], np.sign(entering[order])
    # A line that does not enter as often as it leaves has met an edge.
    sound = np.bincount(ray, entering, minlength=ray_count)[ray] == 0.0
    ray, depth, entering = ray[sound], depth[sound], entering[sound]
    inside = np.cumsum(entering)[:-1]
    step = np.where(ray[1:] == ray[:-1], np.diff(depth) / density[ray[1:]], 0.0)
    wrong = step[(inside > 1.5) | (inside < -0.5)].sum()
    return float(wrong / max(step[np.abs(inside) > 0.5].sum(), 1e-300))
