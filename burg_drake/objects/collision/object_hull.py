"""Corners of the convex hulls of objects, which are read once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from burg_drake.core import Array
from burg_drake.geometry import convex_hull
from burg_drake.objects.collision.primitive import primitive_mesh
from burg_drake.objects.library import ObjectEntry, ObjectLibrary

KEPT = 1000
"""Objects whose corners are kept, those that were read last; each takes some kilobytes."""

_READ: dict[tuple[tuple[Path, int], ...], Array] = {}
"""Corners by the files with the times of their last change."""


def support_corners(library: ObjectLibrary, entry: ObjectEntry) -> Array:
    """(N, 3) corners of the hull with which an object rests on a plane, in O [m]: of its primitive,
    else of its pieces. Its stable poses, its feet and its fall in simulation go by it.

    Raises:
        UnknownNameError: a file of the library is missing.
        MeshError: one is damaged.
    """
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    return _corners(library, entry.pieces)


def hull_corners(library: ObjectLibrary, entry: ObjectEntry) -> Array:
    """(N, 3) corners of the hull of all that touches others of an object, in O [m].

    Raises:
        UnknownNameError: a file of the library is missing.
        MeshError: one is damaged.
    """
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    own = [entry.contact.mesh] if entry.contact.mesh else []
    return _corners(library, [*entry.pieces, *own])


def _corners(library: ObjectLibrary, files: Sequence[str]) -> Array:
    key = tuple((path, path.stat().st_mtime_ns) for path in map(library.path, files))
    if key not in _READ:
        points = np.vstack([library.mesh(file).vertices for file in files])
        _READ[key] = points[convex_hull(points).vertices]
    corners = _READ[key]
    while len(_READ) > KEPT:
        del _READ[next(iter(_READ))]
    return corners
