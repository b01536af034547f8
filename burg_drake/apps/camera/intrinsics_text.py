"""Intrinsics of a camera in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics


def print_intrinsics(intrinsics: Intrinsics) -> None:
    """Prints a camera's figures."""
    import numpy as np

    from burg_drake.cameras.optics import known_words

    k = intrinsics
    title = f"{k.camera}: " if k.camera else ""
    print(f"{title}{k.width} x {k.height} pixels")
    print(f"focal length     fx {k.focal[0]:.2f}, fy {k.focal[1]:.2f} pixels")
    print(
        f"principal point  cx {k.center[0]:.2f}, cy {k.center[1]:.2f} (pixel centres at integers)"
    )
    across, down, diagonal = (math.degrees(angle) for angle in field_of_view(k))
    print(f"field of view    {across:.1f} x {down:.1f} degrees, diagonal {diagonal:.1f}")
    if k.is_fisheye:
        print("lens model       fisheye")
    if k.is_pinhole:
        print("distortion       none")
    else:
        print("distortion       " + ", ".join(f"{value:.5g}" for value in k.distortion))
        corners = np.array([(u, v) for v in (0, k.height - 1) for u in (0, k.width - 1)], float)
        if k.is_fisheye:
            figures = np.degrees(np.arccos(k.rays(corners)[:, 2]))
            words = "corners look", "degrees off the axis"
        else:
            figures = np.linalg.norm(corners - k.undistort(corners), axis=1)
            words = "moves corners by", "pixels"
        names = ("upper left", "upper right", "lower left", "lower right")
        of_corners = (f"{name} {figure:.1f}" for name, figure in zip(names, figures, strict=True))
        print(f"{words[0]:17}{', '.join(of_corners)} {words[1]}")
    if k.residual is not None:
        print(f"residual         {k.residual:.3f} pixels")
    if k.known_to is not None:
        print(f"known            {known_words(k.known_to, k.except_at)}")


def field_of_view(intrinsics: Intrinsics) -> tuple[float, float, float]:
    """Angle between what opposite edges see, across and down, and opposite corners [rad]."""
    import numpy as np

    k = intrinsics
    w, h = k.width - 0.5, k.height - 0.5
    cx, cy = k.center
    ends = [((-0.5, cy), (w, cy)), ((cx, -0.5), (cx, h)), ((-0.5, -0.5), (w, h))]
    rays = k.rays(np.array(ends, dtype=float))
    between = np.arccos(np.clip((rays[:, 0] * rays[:, 1]).sum(axis=-1), -1.0, 1.0))
    # Of a fisheye it may be more than half a turn.
    beyond = np.arccos(rays[..., 2]).sum(axis=1) > np.pi
    angles = np.where(beyond, 2.0 * np.pi - between, between).tolist()
    return angles[0], angles[1], angles[2]
