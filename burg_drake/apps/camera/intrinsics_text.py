"""Intrinsics of a camera in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics


def print_intrinsics(intrinsics: Intrinsics) -> None:
    """Prints a camera's figures."""
    import numpy as np

    k = intrinsics
    title = f"{k.camera}: " if k.camera else ""
    print(f"{title}{k.width} x {k.height} pixels")
    print(f"focal length     fx {k.focal[0]:.2f}, fy {k.focal[1]:.2f} pixels")
    print(
        f"principal point  cx {k.center[0]:.2f}, cy {k.center[1]:.2f} (pixel centres at integers)"
    )
    across, down, diagonal = (math.degrees(angle) for angle in field_of_view(k))
    print(f"field of view    {across:.1f} x {down:.1f} degrees, diagonal {diagonal:.1f}")
    if k.is_pinhole:
        print("distortion       none")
    else:
        print("distortion       " + ", ".join(f"{value:.5g}" for value in k.distortion))
        corners = np.array([(u, v) for v in (0, k.height - 1) for u in (0, k.width - 1)], float)
        moved = np.linalg.norm(corners - k.undistort(corners), axis=1)
        names = ("upper left", "upper right", "lower left", "lower right")
        of_corners = (f"{name} {m:.1f}" for name, m in zip(names, moved, strict=True))
        print(f"moves corners by {', '.join(of_corners)} pixels")
    if k.residual is not None:
        print(f"residual         {k.residual:.3f} pixels")


def field_of_view(intrinsics: Intrinsics) -> tuple[float, float, float]:
    """Angle between what opposite edges see, across and down, and opposite corners [rad]."""
    import numpy as np

    k = intrinsics
    w, h = k.width - 0.5, k.height - 0.5
    cx, cy = k.center
    ends = [((-0.5, cy), (w, cy)), ((cx, -0.5), (cx, h)), ((-0.5, -0.5), (w, h))]
    straight = (k.undistort(np.array(ends, dtype=float)) - k.center) / k.focal
    rays = np.concatenate([straight, np.ones((3, 2, 1))], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    angles = np.arccos((rays[:, 0] * rays[:, 1]).sum(axis=-1)).tolist()
    return angles[0], angles[1], angles[2]
