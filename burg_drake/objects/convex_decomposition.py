"""Convex decomposition: the convex pieces that represent an object in contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from burg_drake.core import Array, MeshError
from burg_drake.geometry import convex_hull, reduced_hull, thickness
from burg_drake.objects.coacd_process import DecompositionFailed, run_coacd
from burg_drake.objects.library import Decomposition

COACD_SEARCH = {"mcts_nodes": 10, "mcts_iterations": 60, "mcts_max_depth": 2, "resolution": 1000}
"""CoACD's search: a third of the default time, with pieces that fit as well."""

COACD_REMESHING: dict[str, str | int] = {"preprocess_mode": "on", "preprocess_resolution": 30}
"""Remeshing of open surfaces to closed walls 1/30 of the object thick, and on failure."""


@dataclass(frozen=True)
class ConvexPieces:
    """Convex pieces.

    Attributes:
        meshes: meshes of the pieces, at least one, with outward winding.
        seconds: CPU time spent in child processes [s].
    """

    meshes: tuple[trimesh.Trimesh, ...]
    seconds: float = 0.0


def convex_pieces(
    surface: trimesh.Trimesh, closed: bool, parameters: Decomposition = Decomposition()
) -> ConvexPieces:
    """Convex pieces of a surface.

    Args:
        surface: surface in metres, wound outward.
        closed: whether the surface is watertight, so that its volume can be trusted.
        parameters: parameters of the decomposition.

    Raises:
        MeshError: nothing solid is left, or CoACD fails.
    """
    max_convex_ratio = 1.02  # Hull volume over volume, up to which a mesh counts as convex.
    if closed and surface.convex_hull.volume <= max_convex_ratio * surface.volume:
        return ConvexPieces((_reduce_hull(surface.vertices, parameters),))
    parts, seconds = _run_decomposition(surface, closed, parameters)
    solid = [p for p in parts if thickness(p) >= parameters.min_thickness]
    if not solid:
        raise MeshError("convex decomposition found no solid piece; is the mesh a thin sheet?")
    joined = join_parts(solid, parameters.join)
    return ConvexPieces(tuple(_reduce_hull(p, parameters) for p in joined), seconds)


def check_given_pieces(pieces: Sequence[trimesh.Trimesh]) -> ConvexPieces:
    """Checks convex pieces that come with an object, and returns them unchanged.

    Raises:
        MeshError: a piece is not closed, not convex, or wound inward.
    """
    if not pieces:
        raise MeshError("pieces is empty; give at least one convex piece, or None")
    for i, piece in enumerate(pieces):
        if not np.isfinite(piece.vertices).all():
            raise MeshError(f"piece {i} has NaN or infinite vertices")
        if not (piece.is_watertight and piece.is_winding_consistent and piece.volume > 0.0):
            raise MeshError(f"piece {i} is not a closed surface with outward winding")
        ratio = piece.convex_hull.volume / piece.volume
        if ratio > 1.001:
            raise MeshError(f"piece {i} is not convex: its hull has {ratio:.3f} times its volume")
    return ConvexPieces(tuple(pieces))


def join_parts(parts: Sequence[Array], budget: float) -> list[Array]:
    """Joins convex parts, cheapest pair first, while the added volume is within a budget.

    Args:
        parts: vertices (Ni, 3) of each part [m].
        budget: total added volume allowed, as a share of the parts' volume.

    Returns:
        Vertices of the remaining hulls.
    """
    max_gap = 1e-3  # Metres between the bounding boxes of pieces that may be joined.
    hulls = [convex_hull(p) for p in parts]
    points = {i: h.points[h.vertices] for i, h in enumerate(hulls)}
    volume = {i: float(h.volume) for i, h in enumerate(hulls)}
    left = budget * sum(volume.values())

    def hull_growth(i: int, j: int) -> float:
        a, b = points[i], points[j]
        gap = np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0))
        if gap.max() > max_gap:
            return np.inf
        return float(convex_hull(np.vstack([a, b])).volume) - volume[i] - volume[j]

    cost = {(i, j): hull_growth(i, j) for i in points for j in points if i < j}
    while cost:
        (i, j), added_volume = min(cost.items(), key=lambda item: (item[1], item[0]))
        if added_volume > left:
            break
        left -= max(added_volume, 0.0)
        new = max(points) + 1
        hull = convex_hull(np.vstack([points.pop(i), points.pop(j)]))
        del volume[i], volume[j]
        cost = {pair: c for pair, c in cost.items() if i not in pair and j not in pair}
        points[new], volume[new] = hull.points[hull.vertices], float(hull.volume)
        cost.update({(k, new): hull_growth(k, new) for k in points if k != new})
    return list(points.values())


def _reduce_hull(points: Array, parameters: Decomposition) -> trimesh.Trimesh:
    return reduced_hull(points, parameters.max_vertices, parameters.tolerance)


def _run_decomposition(
    surface: trimesh.Trimesh, closed: bool, parameters: Decomposition
) -> tuple[list[Array], float]:
    vertices = np.asarray(surface.vertices, dtype=float)
    faces = np.asarray(surface.faces)
    reason = ""
    attempts: list[dict[str, str | int]] = [{}, COACD_REMESHING] if closed else [COACD_REMESHING]
    for attempt in attempts:
        options = {
            "threshold": parameters.threshold,
            "seed": parameters.seed,
            **COACD_SEARCH,
            **attempt,
        }
        try:
            parts, seconds = run_coacd(vertices, faces, options, parameters.timeout)
        except DecompositionFailed as error:
            reason = str(error)
            continue
        if parts:
            return parts, seconds
        reason = "it found no pieces"
    raise MeshError(
        f"convex decomposition failed: {reason}; repair or simplify the mesh, raise"
        f" decomposition.threshold above {parameters.threshold:g}, or give convex pieces"
        " of your own (pieces in an objects.yaml)"
    )
