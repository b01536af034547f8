"""The palette, and how faces get their colours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

Rgba = tuple[float, float, float, float]
Rule = tuple[Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]], Rgba]
"""A colour, and which faces get it: (F, 3) centroids [m] and (F, 3) outward normals -> (F,)."""

IVORY: Rgba = (0.90, 0.87, 0.79, 1.0)
STEEL: Rgba = (0.72, 0.74, 0.76, 1.0)
CHARCOAL: Rgba = (0.24, 0.24, 0.26, 1.0)
BROWN: Rgba = (0.36, 0.26, 0.18, 1.0)
BLUE: Rgba = (0.33, 0.50, 0.66, 1.0)
SAGE: Rgba = (0.58, 0.68, 0.53, 1.0)
BRICK: Rgba = (0.74, 0.28, 0.22, 1.0)
TEAL: Rgba = (0.22, 0.54, 0.54, 1.0)
OCHRE: Rgba = (0.85, 0.62, 0.31, 1.0)
YELLOW: Rgba = (0.93, 0.78, 0.28, 1.0)
ORANGE: Rgba = (0.86, 0.43, 0.14, 1.0)
PLUM: Rgba = (0.51, 0.30, 0.49, 1.0)
GLASS: Rgba = (0.35, 0.62, 0.50, 1.0)


def as_bytes(rgba: ArrayLike) -> NDArray[np.uint8]:
    """Colours (..., 4) from 0 to 1 as bytes."""
    return np.round(255.0 * np.asarray(rgba)).astype(np.uint8)


def painted(mesh: trimesh.Trimesh, base: Rgba | None, *rules: Rule) -> trimesh.Trimesh:
    """Give every face of a mesh the base colour, or that of the last rule that picks it.

    Args:
        mesh: Mesh whose `visual.face_colors` are set.
        base: Colour of the faces that no rule picks; None keeps what they have.
        rules: Colours of picked faces.

    Returns:
        The same mesh.
    """
    if base is None:
        rows = np.array(mesh.visual.face_colors)
    else:
        rows = np.tile(as_bytes(base), (len(mesh.faces), 1))
    for picks, rgba in rules:
        rows[picks(mesh.triangles_center, mesh.face_normals)] = as_bytes(rgba)
    mesh.visual.face_colors = rows
    return mesh
