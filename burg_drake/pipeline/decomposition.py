"""Convex decomposition of an object's surface, with a finer threshold where pieces are coarse."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from burg_drake.core import MeshError
from burg_drake.objects import (
    ConvexPieces,
    Decomposition,
    Fit,
    SurfaceMesh,
    check_given_pieces,
    convex_pieces,
    describe_fit,
    measure_fit,
    relative_deviation,
)
from burg_drake.pipeline.object_source import ObjectSource, piece_meshes

FINER_THRESHOLDS = (0.02, 0.01)
"""Decomposition thresholds to try if the pieces at the default one are coarse."""

MAX_PIECES = 96
"""Finer decompositions with more pieces are not used: contact gets slow."""


@dataclass(frozen=True)
class ObjectPieces:
    """The convex pieces of an object.

    Attributes:
        pieces: convex pieces, rounded as in the files.
        fit: fit of the pieces to the surface; None if the surface is not closed.
        threshold: threshold of the decomposition; None for pieces that came with the object.
        note: note on steps of the decomposition that were not asked for; or empty.
        seconds: CPU time spent in child processes [s].
    """

    pieces: tuple[trimesh.Trimesh, ...]
    fit: Fit | None
    threshold: float | None
    note: str = ""
    seconds: float = 0.0


def cut_into_pieces(source: ObjectSource, mesh: SurfaceMesh) -> ObjectPieces:
    """Makes the convex pieces of a mesh.

    If the pieces are coarse and the source sets no threshold, finer thresholds are tried, each
    within the time limit of one decomposition, and the best result is kept.

    Raises:
        MeshError: the decomposition fails, or given pieces are not convex.
    """
    given = piece_meshes(source)
    if given is not None:
        return _measure_fit(check_given_pieces(given), mesh, None)
    parameters = source.decomposition
    first = best = _cut_at_threshold(mesh, parameters)
    if parameters.threshold != Decomposition().threshold:
        return best
    seconds, tried = first.seconds, 0
    for threshold in FINER_THRESHOLDS:
        if relative_deviation(best.fit, mesh.surface) <= 1.0:
            break
        tried += 1
        with contextlib.suppress(MeshError):  # on timeout the previous result is kept
            finer = _cut_at_threshold(mesh, replace(parameters, threshold=threshold))
            seconds += finer.seconds
            deviations = [relative_deviation(made.fit, mesh.surface) for made in (finer, best)]
            if deviations[0] < deviations[1] and len(finer.pieces) <= MAX_PIECES:
                best = finer
    note = f"more pieces, up to {MAX_PIECES}, do not fit better" if tried else ""
    if best is not first and first.fit is not None and best.fit is not None:
        note = (
            f"cut again with decomposition.threshold {best.threshold:g} instead of"
            f" {first.threshold:g}, as the {len(first.pieces)} pieces did not fit well"
            f" ({describe_fit(first.fit)}): now {len(best.pieces)} pieces"
            f" ({describe_fit(best.fit)})"
        )
    return replace(best, note=note, seconds=seconds)


def _cut_at_threshold(mesh: SurfaceMesh, parameters: Decomposition) -> ObjectPieces:
    pieces = convex_pieces(mesh.surface, mesh.closed, parameters)
    return _measure_fit(pieces, mesh, parameters.threshold)


def _measure_fit(pieces: ConvexPieces, mesh: SurfaceMesh, threshold: float | None) -> ObjectPieces:
    # To 0.1 um, so that files hold exactly the vertices of the computation.
    rounded = tuple(
        trimesh.Trimesh(np.round(p.vertices, 7) + 0.0, p.faces, process=False)
        for p in pieces.meshes
    )
    fit = measure_fit(mesh.surface, rounded, mesh.surface.volume) if mesh.closed else None
    return ObjectPieces(rounded, fit, threshold, seconds=pieces.seconds)
