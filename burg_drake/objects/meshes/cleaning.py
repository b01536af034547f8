"""Repairs of a triangle surface: merged, cleaned of specks, closed and wound outward."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray

SPECK = 0.02
"""A body is a speck when its bounding box's diagonal is below this share of the whole mesh's."""

HOLE = 0.15
"""A hole is small, and closed, when it is no wider than this share of the mesh's diagonal."""


NO_VOLUME = 1e-9
"""Share of its bounding box below which what a surface encloses is rounding error."""


@dataclass
class Repaired:
    """A repaired mesh.

    Attributes:
        mesh: the result.
        inverted: whether the whole surface was turned inside out.
        sentences: what was changed.
    """

    mesh: trimesh.Trimesh
    inverted: bool = False
    sentences: list[str] = field(default_factory=list)


def repair(raw: trimesh.Trimesh) -> Repaired:
    """A clean copy of a surface, without texture.

    Args:
        raw: surface in metres with finite vertices.
    """
    mesh = trimesh.Trimesh(np.array(raw.vertices), np.array(raw.faces), process=False)
    result = Repaired(mesh)
    _merge(result)
    _drop_degenerate(result)
    _drop_specks(result)
    _make_consistent(result)
    _fill_holes(result)
    _turn_outward(result)
    result.mesh.remove_unreferenced_vertices()
    return result


def bodies(mesh: trimesh.Trimesh) -> list[NDArray[np.int64]]:
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


def _merge(result: Repaired) -> None:
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


def _keep_bodies_apart(result: Repaired, given: trimesh.Trimesh) -> None:
    """Where bodies that the file keeps apart have corners in common, merging glues them together;
    if each is closed by itself, its corners are merged with one another only."""
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


def _drop_degenerate(result: Repaired) -> None:
    """Drops faces without three corners, and of faces with the same corners all but one; or all,
    where the surface already is closed without them (a fin without thickness)."""
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


def _drop_specks(result: Repaired) -> None:
    mesh = result.mesh
    groups = bodies(mesh)
    if len(groups) < 2:
        return
    diagonal = np.linalg.norm(mesh.extents)
    specks = [
        g
        for g in groups[1:]
        if np.linalg.norm(np.ptp(mesh.vertices[mesh.faces[g]].reshape(-1, 3), axis=0))
        < SPECK * diagonal
    ]
    if specks:
        keep = np.ones(len(mesh.faces), dtype=bool)
        keep[np.concatenate(specks)] = False
        mesh.update_faces(keep)
        result.sentences.append(
            f"dropped {len(specks)} tiny separate parts ({int((~keep).sum())} faces)"
        )


def _fill_holes(result: Repaired) -> None:
    mesh = result.mesh
    loops = boundary_loops(mesh)
    if not loops:
        return
    limit = HOLE * np.linalg.norm(mesh.extents)
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


def boundary_loops(mesh: trimesh.Trimesh) -> list[list[int]]:
    """Closed loops of boundary edges as vertex indices, in the direction of their faces."""
    edges = mesh.edges
    _, inverse, count = np.unique(
        mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True
    )
    following: dict[int, list[int]] = {}
    for a, b in edges[count[inverse.reshape(-1)] == 1].tolist():
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


def _make_consistent(result: Repaired) -> None:
    mesh = result.mesh
    if mesh.is_winding_consistent:
        return
    before = mesh.faces.copy()
    trimesh.repair.fix_winding(mesh)
    turned = int((mesh.faces != before).any(axis=1).sum())
    if turned:
        result.sentences.append(f"turned {turned} faces to a consistent winding")


def _turn_outward(result: Repaired) -> None:
    mesh = result.mesh
    groups = bodies(mesh) if len(mesh.faces) else []
    flips = _inside_out(mesh, groups)
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


def _inside_out(mesh: trimesh.Trimesh, groups: list[NDArray[np.int64]]) -> list[bool]:
    """Which bodies to flip: those with negative volume that are no cavity of another body, and
    what lies inside those."""
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
            flips[min(hosts, key=lambda k: size[k])] if hosts else volumes[i] < -NO_VOLUME * size[i]
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
