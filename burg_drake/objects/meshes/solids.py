"""Closed surfaces as sets of points: overlapping bodies united, needlessly fine ones made coarser.

The Boolean operations and the decimation are those of the library Manifold (Apache-2.0), whose
results are closed again.
"""

from __future__ import annotations

import manifold3d
import numpy as np
import trimesh
from scipy.spatial import cKDTree

from burg_drake.core import Array
from burg_drake.geometry import triangle_distances
from burg_drake.objects.meshes.cleaning import bodies, encloses, signed_volume
from burg_drake.objects.meshes.quadrics import collapsed

COUNTED_TWICE = 1e-4
"""Bodies are united when their overlap is above this share of their volumes' sum; below it they
touch."""

DECIMATION = (1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3)
"""Tolerances of the decimation, tried in turn on what the one before left, as shares of the mesh's
diagonal: 0.02 to 0.4 mm on a mug. In turn they leave fewer faces nearer to the surface than the
last one at once: a bottle's 262,080 faces, noise 0.1 mm, became 6,288 and 34,594."""

CLEARED = (1e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.2e-4)
"""Tolerances [m] at which Manifold, which is fast, takes most faces away before edges are collapsed
in the order of what it costs."""

COLLAPSED, MOST_COLLAPSED = 20_000, 100_000
"""Faces that are few enough for that, and so many that it would take longer than 20 s."""

FEWEST, RUNG = 20, 0.9
"""Faces of the coarsest surface, and of each over those of the one before."""

BOUNDARIES = 400
"""Most bodies that are looked through for cavities and overlaps."""

USEFUL = 0.5
"""A decimation that leaves more than this share of the faces, and too many, is not worth the
deviation: the surface is as rough as that."""

SAMPLES, CANDIDATES, MEASURED = 50_000, 8, 10_000
"""Of the measurement of a decimation: samples of the result, faces compared a point, and points."""

RESOLVED = 1e-6
"""Deviations below this count as none [m]."""


def is_closed(surface: trimesh.Trimesh) -> bool:
    """Whether a surface is watertight with consistent winding."""
    return bool(len(surface.faces) and surface.is_watertight and surface.is_winding_consistent)


def united(surface: trimesh.Trimesh) -> tuple[trimesh.Trimesh, list[str]]:
    """Overlapping bodies as one, so that their overlap counts once; cavities stay, and bodies that
    lie apart stay as they are, as do those that touch without a face in common.

    Args:
        surface: closed, wound outward, cavities inward.

    Returns:
        The surface, and a sentence if it changed.
    """
    groups = bodies(surface)
    if not 1 < len(groups) <= BOUNDARIES:
        return surface, []
    parts = [surface.submesh([g], append=True, repair=False) for g in groups]
    volumes = [signed_volume(p) for p in parts]
    solid = [i for i, v in enumerate(volumes) if v > 0.0]
    if not _boxes_meet([parts[i] for i in solid]):
        return surface, []
    members = {i: [parts[i]] for i in solid}
    for i, volume in enumerate(volumes):
        hosts = [k for k in solid if volume <= 0.0 and encloses(parts[k], parts[i])]
        if hosts:
            members[min(hosts, key=lambda k: volumes[k])].append(parts[i])
    found = [_manifold(trimesh.util.concatenate(m)) for m in members.values()]
    manifolds = [m for m in found if m is not None]
    if len(manifolds) < len(found):
        return surface, []
    union = manifold3d.Manifold.batch_boolean(manifolds, manifold3d.OpType.Add)
    twice = 1.0 - union.volume() / sum(m.volume() for m in manifolds)
    result = _mesh(union)
    if twice < COUNTED_TWICE:
        glued = not is_closed(_merged(surface)) and is_closed(_merged(result))
        return (result, [f"united {len(solid)} bodies that touch"]) if glued else (surface, [])
    if not is_closed(result):
        return surface, []
    return result, [
        f"united {len(solid)} bodies that overlap (they share {100.0 * twice:.2g} % of"
        " their volume, which now counts once)"
    ]


def split_bodies(surface: trimesh.Trimesh) -> trimesh.Trimesh | None:
    """A surface whose bodies touch along edges, with these edges doubled so that it counts as
    closed; None if it is not that."""
    manifold = _manifold(surface)
    result = None if manifold is None else _mesh(manifold)
    return result if result is not None and is_closed(result) else None


def decimated(surface: trimesh.Trimesh, max_faces: int) -> tuple[trimesh.Trimesh, list[str]]:
    """The surface with at most `max_faces` faces if that can be had within the last tolerance of
    `DECIMATION`, and otherwise with as few as that gives.

    Args:
        surface: closed, wound outward.
        max_faces: surfaces with no more faces than this stay as they are.

    Returns:
        The surface, and a sentence if it changed.
    """
    if len(surface.faces) <= max_faces:
        return surface, []
    diagonal = float(np.linalg.norm(surface.extents))
    manifold, best = _manifold(surface), surface
    for tolerance in DECIMATION:
        if manifold is None:
            break
        manifold = manifold.simplify(tolerance * diagonal)
        merged = _merged(_mesh(manifold))
        if not is_closed(merged) or signed_volume(merged) <= 0.0:
            break
        best = merged
        if len(best.faces) <= max_faces:
            break
    if len(best.faces) > max(max_faces, USEFUL * len(surface.faces)):
        return surface, [
            (f"kept all {len(surface.faces)} faces, as the surface is too rough to reduce")
        ]
    step = max(1, len(surface.vertices) // MEASURED)
    away = one_sided_hausdorff(surface.vertices[::step], best)
    return best, [
        f"reduced from {len(surface.faces)} to {len(best.faces)} faces, at most "
        f"{1e3 * max(away, RESOLVED):.2g} mm off"
    ]


def coarser_surfaces(surface: trimesh.Trimesh, most_distance: float) -> list[trimesh.Trimesh]:
    """The surface itself, and ever coarser ones, each made of the one before.

    Args:
        surface: closed, wound outward.
        most_distance: about how far the coarsest are from it, in the mean [m].

    Returns:
        Closed surfaces, finest first, each with about `RUNG` times the faces of the one before.
    """
    found, manifold = [surface], _manifold(surface)
    for tolerance in CLEARED:
        if manifold is None or len(found[-1].faces) <= COLLAPSED:
            break
        manifold = manifold.simplify(tolerance)
        _append_closed(found, _merged(_mesh(manifold)))
    finest = found[-1]
    if len(finest.faces) > MOST_COLLAPSED:
        return found
    rungs = collapsed(np.asarray(finest.vertices), finest.faces, most_distance, FEWEST, RUNG)
    for vertices, faces in rungs:
        _append_closed(found, trimesh.Trimesh(vertices, faces, process=False))
    return found


def _append_closed(found: list[trimesh.Trimesh], mesh: trimesh.Trimesh) -> None:
    if is_closed(mesh) and signed_volume(mesh) > 0.0:
        found.append(mesh)


def one_sided_hausdorff(points: Array, surface: trimesh.Trimesh) -> float:
    """Largest distance of points (N, 3) from a surface [m], exact above `RESOLVED`.

    The distance to the faces of the nearest samples is an upper bound. The points are measured
    against all faces that are nearer than that, in the order of the bound, until it is below what
    was found.
    """
    triangles, middles = np.asarray(surface.triangles), surface.triangles_center
    samples, face = trimesh.sample.sample_surface(surface, SAMPLES, seed=0)
    face = np.concatenate([face, np.arange(len(triangles))])
    _, near = cKDTree(np.vstack([samples, middles])).query(points, min(CANDIDATES, len(face)))
    bound = triangle_distances(points[:, None], triangles[face[near]]).min(axis=1)
    radius = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
    largest = 0.0
    for i in np.argsort(-bound):
        if bound[i] <= max(largest, RESOLVED):
            break
        possible = np.linalg.norm(middles - points[i], axis=1) - radius <= bound[i]
        exact = triangle_distances(points[i][None], triangles[possible])
        largest = max(largest, float(exact.min()))
    return largest


def _boxes_meet(parts: list[trimesh.Trimesh]) -> bool:
    low, high = (np.array([p.bounds[i] for p in parts]) for i in (0, 1))
    for i in range(len(parts) - 1):
        if ((low[i] <= high[i + 1 :]) & (high[i] >= low[i + 1 :])).all(axis=1).any():
            return True
    return False


def _manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold | None:
    """None if the mesh is not closed in Manifold's eyes."""
    # Copies, as Manifold refuses arrays that cannot be written to, such as its own results.
    vertices = np.array(mesh.vertices, dtype=float, order="C")
    faces = np.array(mesh.faces, dtype=np.uint64, order="C")
    manifold = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces))
    sound = manifold.status() == manifold3d.Error.NoError and not manifold.is_empty()
    return manifold if sound else None


def _merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    merged.merge_vertices()
    return merged


def _mesh(manifold: manifold3d.Manifold) -> trimesh.Trimesh:
    mesh = manifold.to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    return trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], faces, process=False)
