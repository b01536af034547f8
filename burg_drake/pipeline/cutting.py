"""Cuts an object's surface into convex pieces, and finer where these turn out coarse."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from burg_drake.core import MeshError
from burg_drake.objects.collision import (
    Pieces,
    convex_pieces,
    describe_fit,
    deviation,
    given_pieces,
    measure_fit,
)
from burg_drake.objects.library import Decomposition, Fit
from burg_drake.objects.meshes import SurfaceMesh
from burg_drake.pipeline.source import ObjectSource, piece_meshes

PIECE_DECIMALS = 7
"""Vertices of pieces are rounded to 0.1 um, so that files hold exactly what was computed with."""

FINER = (0.02, 0.01)
"""Thresholds that are tried where the pieces at the default one are coarse."""

MOST_PIECES = 96
"""Finer cuts with more pieces are not taken: each costs time wherever the object is touched."""


@dataclass(frozen=True)
class Cut:
    """The convex pieces of an object.

    Attributes:
        pieces: rounded as they are written.
        fit: how well they stand for the surface; None if it is not closed.
        threshold: that they were cut with; None for pieces that came with the object.
        note: on what was done beyond what was asked for; or empty.
        seconds: CPU time spent in child processes [s].
    """

    pieces: tuple[trimesh.Trimesh, ...]
    fit: Fit | None
    threshold: float | None
    note: str = ""
    seconds: float = 0.0


def cut(source: ObjectSource, mesh: SurfaceMesh) -> Cut:
    """The convex pieces of a mesh.

    Where they are coarse and no threshold was asked for, finer ones are tried, each within the
    time that one cut may take, and the best is kept.

    Raises:
        MeshError: it cannot be cut, or given pieces are not convex.
    """
    given = piece_meshes(source)
    if given is not None:
        return _measured(given_pieces(given), mesh, None)
    parameters = source.decomposition
    first = best = _at(mesh, parameters)
    if parameters.threshold != Decomposition().threshold:
        return best
    seconds, tried = first.seconds, 0
    for threshold in FINER:
        if deviation(best.fit, mesh.surface) <= 1.0:
            break
        tried += 1
        with contextlib.suppress(MeshError):  # it took too long: what there is, is kept
            finer = _at(mesh, replace(parameters, threshold=threshold))
            seconds += finer.seconds
            better = deviation(finer.fit, mesh.surface) < deviation(best.fit, mesh.surface)
            if better and len(finer.pieces) <= MOST_PIECES:
                best = finer
    note = f"more pieces, up to {MOST_PIECES}, do not fit better" if tried else ""
    if best is not first and first.fit is not None and best.fit is not None:
        note = (
            f"cut again with decomposition.threshold {best.threshold:g} instead of "
            f"{first.threshold:g}, as the {len(first.pieces)} pieces did not fit well ("
            f"{describe_fit(first.fit)}): now {len(best.pieces)} pieces ("
            f"{describe_fit(best.fit)})"
        )
    return replace(best, note=note, seconds=seconds)


def _at(mesh: SurfaceMesh, parameters: Decomposition) -> Cut:
    pieces = convex_pieces(mesh.surface, mesh.closed, parameters)
    return _measured(pieces, mesh, parameters.threshold)


def _measured(pieces: Pieces, mesh: SurfaceMesh, threshold: float | None) -> Cut:
    rounded = tuple(
        trimesh.Trimesh(np.round(p.vertices, PIECE_DECIMALS) + 0.0, p.faces, process=False)
        for p in pieces.meshes
    )
    fit = measure_fit(mesh.surface, rounded, mesh.surface.volume) if mesh.closed else None
    return Cut(rounded, fit, threshold, seconds=pieces.seconds)
