"""Solids as drawings: their outline, and a few even tones for how the light falls on them.

A drawing in tones is a few kilobytes of SVG, sharp on paper, takes its colours from the page (so
that it has a dark mode), needs no renderer and is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.objects.library import ObjectLibrary
from burg_drake.visualization.pictures.flat_view import FlatView, path_data

TONES = 6
"""Even tones from the darkest, 0, to the lightest."""
LIGHT = np.array([-0.45, -0.75, -0.48])
"""Where the light comes from, in the camera frame: above, to the left, in front."""
DETAIL = 3
"""Pixels a SVG unit, in which contours are found."""
SMOOTHING = 9
"""Width of the filter that mends jagged borders of tones [pixel]; odd."""
TOLERANCE = 0.9
"""By which a contour may be simplified [pixel]."""
SURFACES = 64
"""So many objects' surfaces are kept for the next scene."""
LEAST_AREA = 24.0
"""Smaller contours are left out [pixel]."""
SUBPIXEL = 4
"""Bits behind the point of OpenCV's pixels."""


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """A triangle mesh in the world.

    Attributes:
        vertices: (N, 3) [m].
        faces: (M, 3) indices of vertices.
    """

    vertices: Array
    faces: NDArray[np.int64]


def shaded_outline(solids: Sequence[SolidMesh], view: FlatView) -> list[str]:
    """Draws solids, the nearer ones before the others.

    Returns:
        The `d` of a path for each tone, darkest first, to be drawn one over the other with the fill
        rule `evenodd`; the first is the outline of everything. Empty where there is no such tone.
    """
    levels = _levels(solids, view)
    return [_contours(_smoothed(levels > tone)) for tone in range(TONES)]


def surface_of(library: ObjectLibrary, name: str) -> SolidMesh:
    """The surface of an object in its own frame; read once a process, as long as it is the same.

    Raises:
        UnknownNameError: no such object, or its mesh file is missing.
        MeshError: the mesh file is damaged.
    """
    key = str(library.root.resolve()), name, library.content[name]
    if key not in _SURFACES:
        while len(_SURFACES) >= SURFACES:
            del _SURFACES[next(iter(_SURFACES))]
        mesh = library.surface(name)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        _SURFACES[key] = SolidMesh(np.asarray(mesh.vertices), faces)
    return _SURFACES[key]


_SURFACES: dict[tuple[str, str, str], SolidMesh] = {}


def footprint(solid: SolidMesh, view: FlatView) -> str:
    """The `d` of what a solid covers of the plane that it stands on."""
    hull = cv2.convexHull(view.places(grounded(solid)).astype(np.float32))
    return path_data(hull[:, 0, :])


def grounded(solid: SolidMesh) -> Array:
    """(N, 3) its vertices, moved straight down onto the plane that it stands on [m]."""
    ground = solid.vertices.copy()
    ground[:, 2] = solid.vertices[:, 2].min()
    return ground


def _levels(solids: Sequence[SolidMesh], view: FlatView) -> NDArray[np.uint8]:
    """(H, W) 1 and more for the tones from the darkest on, 0 where nothing is."""
    width, height = (int(np.ceil(side * DETAIL)) for side in view.size)
    image = np.zeros((height, width), dtype=np.uint8)
    corners = [s.vertices[s.faces] for s in solids if len(s.faces)]
    if not corners:
        return image
    triangles = np.concatenate(corners)
    depth = view.depths(triangles).mean(axis=1)
    tones = _tones(triangles, view)
    pixels = np.round(view.places(triangles) * DETAIL * 2**SUBPIXEL).astype(np.int32)
    for k in np.argsort(-depth, kind="stable").tolist():
        cv2.fillConvexPoly(image, pixels[k], int(tones[k]) + 1, shift=SUBPIXEL)
    return image


def _smoothed(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where more than half of the neighbours are set; counting is quicker than `medianBlur`."""
    size = SMOOTHING, SMOOTHING
    count = cv2.boxFilter(
        mask.astype(np.uint8), -1, size, normalize=False, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(count > SMOOTHING**2 // 2)


def _tones(triangles: Array, view: FlatView) -> NDArray[np.int64]:
    """Tone (M,) of triangles (M, 3, 3); whichever side faces the camera is lit."""
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1]) @ view.R_WC
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals *= -np.sign(normals[:, 2:] + 1e-12)
    light = normals @ (LIGHT / np.linalg.norm(LIGHT))
    share = np.clip(0.5 + 0.5 * light, 0.0, 1.0)
    return np.minimum((share * TONES).astype(np.int64), TONES - 1)


def _contours(mask: NDArray[np.bool_]) -> str:
    found, _ = cv2.findContours(
        mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=(0, 0)
    )
    paths = []
    for contour in found:
        if cv2.contourArea(contour) >= LEAST_AREA:
            corners = cv2.approxPolyDP(contour, TOLERANCE, True)[:, 0, :]
            paths.append(path_data((corners + 0.5) / DETAIL))
    return "".join(paths)
