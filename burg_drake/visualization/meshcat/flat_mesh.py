"""Triangles in Meshcat whose colour is that of a legend, whatever light falls on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, Rgba

from burg_drake.core import Array
from burg_drake.visualization.style import linear_light, palette


def draw_flat(
    meshcat: Meshcat, path: str, vertices: Array, faces: NDArray[np.int32], rgba: palette.Rgba
) -> None:
    """Draws triangles in one colour, without shading and shadow.

    The material is black but for its own glow, and three.js' tone curve, which would brighten it,
    is off: the pixels have the colour as it was given.

    Args:
        meshcat: where to draw.
        path: in its tree.
        vertices: (3, V) [m].
        faces: (3, F) triangles, seen from both sides.
        rgba: colour (sRGB) and opacity.
    """
    meshcat.SetTriangleMesh(path, vertices, faces, Rgba(0.0, 0.0, 0.0, rgba[3]))
    object_path = f"{path}/<object>"
    for channel, value in zip("rgb", linear_light(rgba[:3]).tolist(), strict=True):
        meshcat.SetProperty(object_path, f"material.emissive.{channel}", value)
        meshcat.SetProperty(object_path, f"material.specular.{channel}", 0.0)
    meshcat.SetProperty(object_path, "material.toneMapped", False)
    meshcat.SetProperty(object_path, "castShadow", False)
