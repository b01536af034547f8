"""Planners that answer by rule, for runs of benchmarks."""

from __future__ import annotations

from typing import Any

import numpy as np

from burg_drake.benchmark import Observation


def grasp_in_scene(x: float, y: float, z: float) -> Any:
    """A grasp straight down that closes along x of the scene."""
    X_SG = np.diag([1.0, -1.0, -1.0, 1.0])
    X_SG[:3, 3] = x, y, z
    return X_SG


def plan_cans(observation: Observation) -> dict[str, Any]:
    """Straight down over each blob of the depth image above the table; the highest first."""
    X_SC = np.linalg.inv(observation.X_CS)
    points = observation.points().reshape(-1, 3)
    points = points[np.isfinite(points[:, 0])] @ X_SC[:3, :3].T + X_SC[:3, 3]
    inside = (points > observation.bounds[0] + [0, 0, 0.02]).all(axis=1)
    points = points[inside & (points < observation.bounds[1]).all(axis=1)]
    found = []
    while len(points):
        top = points[points[:, 2].argmax()]
        near = np.linalg.norm(points[:, :2] - top[:2], axis=1) < 0.09
        blob = points[near]
        if len(blob) > 50:
            middle = (blob[:, :2].max(axis=0) + blob[:, :2].min(axis=0)) / 2.0
            found.append(grasp_in_scene(*middle, blob[:, 2].max() - 0.02))
        points = points[~near]
    poses = np.array(found).reshape(-1, 4, 4)
    return {"X_SG": poses, "score": -np.arange(len(poses), dtype=float)}


def plan_in_the_air(observation: Observation) -> dict[str, Any]:
    """A grasp high above the board."""
    return {"X_SG": grasp_in_scene(0.3, 0.2, 0.35)[None]}


def plan_nothing(observation: Observation) -> dict[str, Any]:
    """Fails."""
    raise KeyError("weights")


def plan_on_large_boards(observation: Observation) -> dict[str, Any]:
    """Fails where it sees a board smaller than A2, else as `plan_cans`."""
    return plan_nothing(observation) if observation.bounds[1][0] < 0.5 else plan_cans(observation)
