"""Whether a board was printed, glued and laid down as its document says, and photographed at rest.

One image shows if a sheet is longer along one axis than it should be, or not flat. That all of it
is larger or smaller looks like another distance; a depth image, or a camera whose place is known,
tells.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.pose.disturbance import Disturbance
from burg_drake.cameras.pose.edge_projection import NEAREST
from burg_drake.core import Array

ASPECT = 0.003, 0.05
"""Unequal scale that is worth telling, as printers feed paper within about that, and from which on
it is no print of this board [-]."""
MARKER_SIZE = 0.01, 0.015
"""Size of markers against their distances that is worth telling, and from which on it may be
another board [-]."""
BLOOM = 0.5
"""Shift of the outline of a marker that light may make beyond that of its other edges [pixels];
0.2 in pictures that are overexposed twice."""
ROWS = 0.5
"""What the camera does between the first and the last row that is worth telling [pixels]."""
MAX_ROW_MOTION, MAX_PAGE_SHIFT, MOST_HEIGHT = 10.0, 5e-3, 8e-3
"""Motion while rows are exposed [pixels], shift of a page and height of a bulge [m] beyond which no
pose is given. In pictures of the room with 6 pixels, pages glued 2 mm aside along both axes and an
edge that curls up by 6 mm, less is found and the covariance holds."""
BESIDE, HEIGHT = 2e-4, 5e-4
"""Shifts of pages, and heights of a sheet, that are worth telling [m]."""
LEAST_DEVIATION = 0.01
"""Uniform scale that is not worth telling; depth cameras err by as much [-]."""
FEWEST_DEPTHS = 12
"""Corners with depth that a scale is measured by, at least."""


def wrong_print(found: Disturbance, side: float) -> float:
    """Size of the markers against their distances if no light makes that, so that it is another
    board; 1 otherwise.

    Args:
        found: in the image.
        side: of a marker in the image [pixels].
    """
    other = abs(found.size) > MARKER_SIZE[1] and abs(found.size) * side / 2.0 > BLOOM
    return 1.0 + found.size if other else 1.0


def implausible(found: Disturbance) -> str:
    """Why no print of a board looks like that; empty if one may."""
    if abs(found.aspect) > ASPECT[1]:
        return (
            f"another board, or wrong intrinsics: it is {1.0 + found.aspect:.2f} times as long"
            " along y as along x"
        )
    if (
        found.rows > MAX_ROW_MOTION
        or found.in_plane > MAX_PAGE_SHIFT
        or found.out_of_plane > MOST_HEIGHT
    ):
        return (
            "markers are not where a flat board at rest has them: check the intrinsics and the"
            " light, and that the board is one sheet"
        )
    return ""


def print_doubt(found: Disturbance) -> str:
    """What is doubtful about a print, how it lies, or the camera's motion; empty if all is well."""
    if abs(found.aspect) > ASPECT[0]:
        return (
            f"the board is printed {1.0 + found.aspect:.3f} times as long along y as along x:"
            " measure its rulers and print it again with the measured lengths, or check the"
            " intrinsics"
        )
    if abs(found.size) > MARKER_SIZE[0]:
        return (
            f"the scale is uncertain: markers look {1.0 + found.size:.3f} times as large, relative"
            " to their spacing: too much light, or another board?"
        )
    if found.rows > ROWS:
        return (
            f"the camera moved by {found.rows:.1f} pixels during its rolling shutter: hold it"
            " still, or add light"
        )
    if found.in_plane > BESIDE:
        return (
            f"markers are up to {1e3 * found.in_plane:.1f} mm from their positions in the plane:"
            " check the intrinsics, and that pages are glued exactly"
        )
    if found.out_of_plane > HEIGHT:
        return (
            f"the sheet is up to {1e3 * found.out_of_plane:.1f} mm out of its plane: check the"
            " intrinsics, and that it lies flat"
        )
    return ""


def scale_by_depth(
    p_SQ: Array, intrinsics: Intrinsics, X_SC: Array, depth: NDArray[np.floating[Any]]
) -> float:
    """Size of the printed board against the document, by a depth image; NaN if it shows too little.

    Args:
        p_SQ: (..., 3) points of the board that are in sight [m].
        intrinsics: of the depth image too.
        X_SC: (4, 4) pose that the image gives with the document's size.
        depth: (H, W) distance along the optical axis [m]; 0, NaN or infinite where unknown.
    """
    p_C = (p_SQ.reshape(-1, 3) - X_SC[:3, 3]) @ X_SC[:3, :3]
    p_C = p_C[p_C[:, 2] > NEAREST]
    columns, rows = np.rint(intrinsics.project(p_C)).astype(np.intp).reshape(-1, 2).T
    inside = (columns >= 0) & (columns < depth.shape[1]) & (rows >= 0) & (rows < depth.shape[0])
    measured = np.asarray(depth, dtype=float)[rows[inside], columns[inside]]
    ratio = measured / p_C[inside, 2]
    ratio = ratio[np.isfinite(ratio) & (measured > 0.0)]
    return float(np.median(ratio)) if len(ratio) >= FEWEST_DEPTHS else float("nan")


def scale_by_height(X_SC: Array, X_SC_known: Array) -> float:
    """Size of the printed board against the document, by the known height of the camera over it."""
    return float(X_SC_known[2, 3] / X_SC[2, 3])
