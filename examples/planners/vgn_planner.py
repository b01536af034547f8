"""VGN, GIGA and other methods on a volume of distances as planners of burg_drake.

Copy this file and burg_planner.py into the root of github.com/ethz-asl/vgn, or of
github.com/UT-Austin-RPL/GIGA with `MODEL` and `MODEL_TYPE` below changed, and run there::

    python vgn_planner.py --port 9000

Facts from these repositories:

- The input is a truncated signed distance function in 40^3 voxels of a cube of 0.3 m, with the
  table 0.05 m above its lower side and objects in the middle (`ClutterRemovalSim` in
  src/vgn/simulation.py). `get_grid` of `TSDFVolume` (src/vgn/perception.py) gives it as
  (1, 40, 40, 40): 0.5 on a surface, up to 0.99 in front of it and down to 0.01 behind it, at 0.98
  of the truncation distance of 4 voxels; 0 everywhere else.
- `TSDFVolume` integrates depth up to 2 m with Open3D's UniformTSDFVolume: the distance from the
  centre of a voxel to the measured point of its pixel, along the ray.
- `VGN(path)(state)` of src/vgn/detection.py, and `VGNImplicit` of GIGA, return grasps, scores and
  the time. A grasp has `pose`, from the cube's lower corner, and `width`, the distance of the
  fingers when they hold [m]. z is the approach, y the closing direction, and the finger tips are
  0.05 m beyond the origin; burg_drake calls this frame vgn.
- VGN was trained with 1 to 6 images of a scene (scripts/generate_data.py), GIGA with one (its
  README.md, `--single-view`).
"""

from __future__ import annotations

import functools
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Iterable, Sequence  # noqa: UP035  # Python 3.8

import numpy as np

try:
    from burg_planner import Observation, run
except ModuleNotFoundError:  # in the repository of burg_drake
    from burg_drake.benchmark.burg_planner import Observation, run

MODEL = "data/models/vgn_conv.pth"
"""Weights; for GIGA such as data/models/giga_pile.pt."""
MODEL_TYPE = "vgn"
"""`vgn` for VGN's repository; `giga` or `giga_aff` for GIGA's."""
SIZE = 0.3
"""Side of the cube [m]."""
RESOLUTION = 40
"""Number of voxels along a side."""
TABLE_HEIGHT = 0.05
"""Height of the table above the lower side of the cube [m]."""
MIN_OVERLAP = 0.1
"""Smallest overlap of neighbouring cubes [m]: the methods find no grasps near a side."""


class Volume:
    """A volume of distances with the interface of `TSDFVolume`."""

    def __init__(self, grid: Any, size: float = SIZE) -> None:
        """Keeps a grid (1, n, n, n) of a cube with sides of `size` [m]."""
        self.grid, self.size, self.resolution = grid, size, grid.shape[-1]
        self.voxel_size = size / self.resolution

    def get_grid(self) -> Any:
        """(1, n, n, n) values from 0 to 1, float32."""
        return self.grid


def cube_corners(observation: Observation, size: float = SIZE) -> Any:
    """Lower corners (M, 3) in the scene frame of cubes that cover the board [m].

    With a target there is one cube, with the visible points of the target in its middle; none if no
    point is visible.
    """
    (low_x, low_y, _), (high_x, high_y, _) = observation.bounds
    if observation.target is not None and observation.segmentation is not None:
        seen = (observation.segmentation == observation.target) & (observation.depth > 0.0)
        if not seen.any():
            return np.empty((0, 3))
        X_SC = np.linalg.inv(observation.X_CS)
        p_S = observation.points()[seen] @ X_SC[:3, :3].T + X_SC[:3, 3]
        middle = (p_S.min(axis=0) + p_S.max(axis=0)) / 2.0
        return np.array([[middle[0] - size / 2.0, middle[1] - size / 2.0, -TABLE_HEIGHT]])

    def cover(low: float, high: float) -> Any:
        count = max(1, int(np.ceil((high - low - MIN_OVERLAP) / (size - MIN_OVERLAP))))
        if count == 1:
            return np.array([(low + high - size) / 2.0])
        return np.linspace(low, high - size, count)

    return np.array(
        [[x, y, -TABLE_HEIGHT] for x in cover(low_x, high_x) for y in cover(low_y, high_y)]
    )


def make_input(
    observation: Observation, corner: Any, size: float = SIZE, resolution: int = RESOLUTION
) -> Volume:
    """The volume of distances of a cube, from the depth image.

    Args:
        observation: its depth is used.
        corner: (3,) lower corner of the cube in the scene frame [m]; its sides are parallel to
            those of the scene frame.
        size: side of the cube [m].
        resolution: number of voxels along a side.
    """
    truncation = 4.0 * size / resolution
    max_depth, max_value = 2.0, 0.98  # of `TSDFVolume` [m] and of Open3D
    centers = (np.arange(resolution) + 0.5) * (size / resolution)
    p_S = np.stack(np.meshgrid(centers, centers, centers, indexing="ij"), axis=-1) + corner
    p_C = p_S @ observation.X_CS[:3, :3].T + observation.X_CS[:3, 3]
    K, depth = observation.K, observation.depth
    z = np.where(p_C[..., 2] > 0.0, p_C[..., 2], np.nan)
    u = np.floor(p_C[..., 0] / z * K[0, 0] + K[0, 2] + 0.5)
    v = np.floor(p_C[..., 1] / z * K[1, 1] + K[1, 2] + 0.5)
    inside = (u >= 0.0) & (u < depth.shape[1]) & (v >= 0.0) & (v < depth.shape[0])
    u, v = np.where(inside, u, 0.0).astype(int), np.where(inside, v, 0.0).astype(int)
    measured = np.where(inside, depth[v, u], 0.0)
    ray = np.hypot(np.hypot((u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]), 1.0)
    value = np.minimum((measured - z) * ray / truncation, 1.0)
    known = (measured > 0.0) & (measured < max_depth) & (value >= -max_value) & (value < max_value)
    return Volume(np.where(known, (value + 1.0) / 2.0, 0.0).astype(np.float32)[None], size)


def make_answer(parts: Iterable[tuple[Any, Sequence[Any], Any]]) -> dict[str, Any]:
    """The answer to burg_drake.

    Args:
        parts: lower corner of a cube (3,) in the scene frame [m], and the N grasps of the method in
            it, with their scores (N,).
    """
    X_SF, width, score = [], [], []
    for corner, grasps, scores in parts:
        for grasp, value in zip(grasps, scores):  # noqa: B905  # Python 3.8
            X = np.array(grasp.pose.as_matrix(), dtype=float)
            X[:3, 3] += corner
            X_SF.append(X)
            width.append(float(grasp.width))
            score.append(float(value))
    return {
        "X_SG": np.reshape(X_SF, (-1, 4, 4)),
        "width": np.array(width),
        "score": np.array(score),
        "frame": "vgn",
    }


@functools.lru_cache
def load_method() -> Any:
    """The method with its weights: a function of a state that returns grasps, scores and time."""
    if MODEL_TYPE == "vgn":
        from vgn.detection import VGN

        return VGN(Path(MODEL))
    from vgn.detection_implicit import VGNImplicit

    return VGNImplicit(
        Path(MODEL), MODEL_TYPE, best=True, qual_th=0.9, out_th=0.1, resolution=RESOLUTION
    )


def plan(observation: Observation) -> dict[str, Any]:
    """Grasps in cubes that cover the board, or in the one around the target."""
    method = load_method()
    begun = time.perf_counter()
    parts = []
    for corner in cube_corners(observation):
        state = SimpleNamespace(tsdf=make_input(observation, corner), pc=None)
        grasps, scores, _ = method(state)
        parts.append((corner, grasps, scores))
    return {**make_answer(parts), "time": time.perf_counter() - begun}


if __name__ == "__main__":
    run(plan)
