"""AnyGrasp and GraspNet-baseline as planners of burg_drake.

For AnyGrasp (github.com/graspnet/anygrasp_sdk) copy this file and burg_planner.py into the folder
grasp_detection/, beside gsnet.so and the folder license, and run there::

    python anygrasp_planner.py --port 9000

For GraspNet-baseline (github.com/graspnet/graspnet-baseline) copy them into the root of its
repository, beside demo.py, and replace `run(plan)` in the last line by `run(plan_with_baseline)`.

Facts from these repositories and from github.com/graspnet/graspnetAPI:

- `AnyGrasp.get_grasp(points, colors, lims)` is given points [m] in the camera's frame and colours
  from 0 to 1, both (M, 3) in single precision, and keeps grasps in the box `lims`: smallest and
  largest x, y and z (grasp_detection/demo.py). The network of graspnet-baseline is given 20000
  points (demo.py).
- Both give rows of 17 numbers, a `GraspGroup`: score, width, height, depth, rotation (9, row by
  row), translation (3), object id (graspnetAPI/grasp.py), in the camera's frame.
- The origin of such a pose is a point of the surface. x is the approach, y the closing direction;
  the finger tips are `depth` beyond the origin (`plot_gripper_pro_max` in
  graspnetAPI/utils/utils.py). `width` is the opening with which the hand arrives, not the distance
  of the contacts, and is left out of the answer.
"""

from __future__ import annotations

import functools
import time
from argparse import Namespace
from typing import Any

import numpy as np

try:
    from burg_planner import Observation, run
except ModuleNotFoundError:  # in the repository of burg_drake
    from burg_drake.benchmark.burg_planner import Observation, run

CHECKPOINT = "log/checkpoint_detection.tar"
"""Weights of AnyGrasp, or of GraspNet-baseline."""
MAX_OPENING = 0.1
"""Largest opening of the hand that AnyGrasp can plan for [m]."""
BASELINE_POINTS = 20000
"""Number of points that GraspNet-baseline is given."""


def make_input(observation: Observation) -> tuple[Any, Any, list[float]]:
    """The points of the workspace with their colours, and the box for grasps.

    Returns:
        points: (M, 3) in the camera's frame, float32 [m].
        colors: (M, 3) red, green, blue from 0 to 1, float32; grey if the camera takes no colours.
        limits: smallest and largest x, y and z in the camera's frame of all points [m], or of those
            of the target if there is one; empty if there are no points.
    """
    margin = 0.05  # metres around the objects, so that the table is among the points
    p_C = observation.points()
    p_S = p_C @ observation.X_CS[:3, :3] + np.linalg.inv(observation.X_CS)[:3, 3]
    low, high = observation.bounds
    inside = ((p_S >= low - margin) & (p_S <= high + margin)).all(axis=-1)  # not where depth is NaN
    color = observation.color
    if color is None:
        color = np.full(p_C.shape, 128, np.uint8)
    chosen = inside
    if observation.target is not None and observation.segmentation is not None:
        chosen = inside & (observation.segmentation == observation.target)
    limits: list[float] = []
    if chosen.any():
        corners = [p_C[chosen].min(axis=0), p_C[chosen].max(axis=0)]
        limits = np.stack(corners, axis=1).ravel().tolist()
    colors = color[inside].astype(np.float32) / np.float32(255.0)
    return p_C[inside].astype(np.float32), colors, limits


def make_answer(rows: Any, tip: float) -> dict[str, Any]:
    """The answer to burg_drake.

    Args:
        rows: (N, 17) array of a GraspGroup, in the camera's frame.
        tip: distance from the origin of G to the finger tips [m], `observation.hand["tip"]`.
    """
    rows = np.reshape(np.asarray(rows, dtype=float), (-1, 17))
    depth, rotation, translation = rows[:, 3], rows[:, 4:13].reshape(-1, 3, 3), rows[:, 13:16]
    approach, closing = rotation[:, :, 0], rotation[:, :, 1]
    X_CG = np.tile(np.eye(4), (len(rows), 1, 1))
    X_CG[:, :3, 0] = closing
    X_CG[:, :3, 1] = rotation[:, :, 2]
    X_CG[:, :3, 2] = approach
    # The finger tips are where GraspNet has them, so the pads are somewhat behind.
    X_CG[:, :3, 3] = translation + (depth - tip)[:, None] * approach
    return {"X_CG": X_CG, "score": rows[:, 0]}


@functools.lru_cache
def load_anygrasp(max_opening: float) -> Any:
    """AnyGrasp with its weights, for hands that open to `max_opening` [m]."""
    from gsnet import AnyGrasp

    model = AnyGrasp(
        Namespace(
            checkpoint_path=CHECKPOINT,
            max_gripper_width=min(max_opening, MAX_OPENING),
            gripper_height=0.03,
            top_down_grasp=False,
            debug=False,
        )
    )
    model.load_net()
    return model


def plan(observation: Observation) -> dict[str, Any]:
    """Grasps of AnyGrasp."""
    model = load_anygrasp(observation.hand["opening"][1])
    begun = time.perf_counter()
    points, colors, limits = make_input(observation)
    if not limits:
        return make_answer([], 0.0)
    group, _ = model.get_grasp(
        points,
        colors,
        lims=limits,
        apply_object_mask=True,
        dense_grasp=False,
        collision_detection=True,
    )
    rows = [] if group is None else group.grasp_group_array
    answer = make_answer(rows, observation.hand["tip"])
    return {**answer, "time": time.perf_counter() - begun}


def sample_points(points: Any, count: int, rng: np.random.Generator) -> Any:
    """(count, 3) points, drawn without repetition if there are enough (M, 3)."""
    if len(points) >= count:
        return points[rng.choice(len(points), count, replace=False)]
    more = rng.choice(len(points), count - len(points), replace=True)
    return np.concatenate([points, points[more]])


def select_within(rows: Any, limits: list[float]) -> Any:
    """The rows (N, 17) with their origin in a box; for `limits` see `make_input`."""
    low, high = np.reshape(limits, (3, 2)).T
    return rows[((rows[:, 13:16] >= low) & (rows[:, 13:16] <= high)).all(axis=1)]


@functools.lru_cache
def load_baseline() -> Any:
    """The network of GraspNet-baseline with its weights, as demo.py builds it."""
    import sys
    from pathlib import Path

    import torch

    sys.path += [str(Path(__file__).parent / name) for name in ("models", "dataset", "utils")]
    from graspnet import GraspNet

    network = GraspNet(
        input_feature_dim=0,
        num_view=300,
        num_angle=12,
        num_depth=4,
        cylinder_radius=0.05,
        hmin=-0.02,
        hmax_list=[0.01, 0.02, 0.03, 0.04],
        is_training=False,
    )
    device = "cuda:0" if torch.cuda.is_available() else "cpu"
    network.load_state_dict(torch.load(CHECKPOINT, map_location=device)["model_state_dict"])
    return network.to(device).eval()


def plan_with_baseline(observation: Observation) -> dict[str, Any]:
    """Grasps of GraspNet-baseline, without those at which its check finds the hand in the cloud."""
    network = load_baseline()
    begun = time.perf_counter()
    points, _, limits = make_input(observation)
    if not limits:
        return make_answer([], 0.0)
    import torch
    from collision_detector import ModelFreeCollisionDetector
    from graspnet import pred_decode
    from graspnetAPI import GraspGroup

    sampled = sample_points(points, BASELINE_POINTS, observation.rng())
    with torch.no_grad():
        cloud = torch.from_numpy(sampled[None]).to(next(network.parameters()).device)
        rows = pred_decode(network({"point_clouds": cloud}))[0].detach().cpu().numpy()
    detector = ModelFreeCollisionDetector(points, voxel_size=0.01)
    collides = detector.detect(GraspGroup(rows), approach_dist=0.05, collision_thresh=0.01)
    answer = make_answer(select_within(rows[~collides], limits), observation.hand["tip"])
    return {**answer, "time": time.perf_counter() - begun}


if __name__ == "__main__":
    run(plan)
