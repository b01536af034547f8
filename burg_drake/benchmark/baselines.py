"""The built-in planners that see an image alone; `oracle_planner` has the one that knows more."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from burg_drake.benchmark.approach_view import CELL_SIZE, ApproachView, SceneCloud
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.benchmark.depth_grasps import MIN_CLEARANCE, plan_hands, score_hands
from burg_drake.core import Array, Indices, make_pose, perpendicular_axes
from burg_drake.grasping import (
    GraspNetSettings,
    grasp_components,
    pair_angle,
    pair_translation,
)

MAX_GRASPS = 50
"""Largest number of grasps in an answer."""
MIN_SCORE = 0.02
"""Grasps with a smaller score are left out of the answer of `antipodal`."""
TIP_DEPTH = 0.03
"""Depth of the finger tips below the top of an object in `top_down` [m]."""


def antipodal(observation: Observation) -> dict[str, Any]:
    """Plans grasps on the depth image alone, in the manner of GPD; see `depth_grasps`.

    Returns:
        An answer, see `burg_planner`: grasps at least 3 cm or 30 degrees apart.
    """
    steep, tilted = 400, 100  # Points on surfaces at which hands are tried in a view.
    cloud, rng = SceneCloud.of(observation), observation.rng()
    opening, tip = float(observation.hand["opening"][1]), float(observation.hand["tip"])
    graspable = np.flatnonzero(cloud.cluster >= 0)
    if not len(graspable):
        return make_answer(observation)
    # Small surfaces get more than their share of the points.
    weight = np.bincount(cloud.cluster[graspable])[cloud.cluster[graspable]] ** -0.5
    weight /= weight.sum()
    found: list[tuple[Array, Array, Array]] = []
    for R_SV in _approach_frames():
        count = min(steep if R_SV[2, 2] == 1.0 else tilted, len(graspable))
        rows = rng.choice(graspable, count, replace=False, p=weight)
        view = ApproachView.of(cloud, R_SV, observation.bounds)
        hands = plan_hands(view, cloud, rows, opening)
        found.append((hands.poses(R_SV, tip), hands.width, score_hands(hands, opening)))
    X_SG, width, score = (np.concatenate(part) for part in zip(*found, strict=True))
    kept = best_apart(X_SG, score)
    kept = kept[score[kept] > MIN_SCORE]
    return make_answer(observation, X_SG[kept], width[kept], score[kept])


def top_down(observation: Observation) -> dict[str, Any]:
    """Plans one grasp straight down on each cluster of the height map, across its shorter axis.

    Objects that touch are one cluster; clusters too wide for the hand have no grasp.

    Returns:
        An answer, see `burg_planner`, with better scores for narrow clusters that fingers reach
        deep into.
    """
    opening, tip = float(observation.hand["opening"][1]), float(observation.hand["tip"])
    z = np.array([0.0, 0.0, -1.0])
    found = []
    for p_SP in _height_clusters(SceneCloud.of(observation)):
        center = p_SP[:, :2].mean(axis=0)
        across = np.linalg.eigh(np.cov(p_SP[:, :2].T))[1][:, 0]
        low, high = np.percentile((p_SP[:, :2] - center) @ across, [1.0, 99.0])
        width = float(high - low)
        if width >= opening:
            continue
        top = float(np.percentile(p_SP[:, 2], 98.0))
        depth = min(TIP_DEPTH, top - MIN_CLEARANCE)
        x = np.array([*across, 0.0])
        p_SG = np.array([*(center + 0.5 * (low + high) * across), top - depth + tip])
        X_SG = make_pose(np.stack([x, np.cross(z, x), z], axis=1), p_SG)
        found.append((X_SG, width, (1.0 - width / opening) * depth / TIP_DEPTH))
    if not found:
        return make_answer(observation)
    X, widths, scores = (np.array(part) for part in zip(*found, strict=True))
    return make_answer(observation, X, widths, scores)


def _height_clusters(cloud: SceneCloud) -> list[Array]:
    """Connected clusters of a height map seen from above: for each, its cells as points (N, 3)."""
    min_cells = 75  # 3 cm^2
    p_SP = cloud.p_SP[cloud.cluster >= 0]
    if not len(p_SP):
        return []
    border = 3  # Cells around the map, as many as closing needs.
    cell = np.rint(p_SP[:, :2] / CELL_SIZE).astype(np.intp)
    first = cell.min(axis=0) - border
    cell -= first
    height = np.zeros(cell.max(axis=0) + border + 1)
    np.maximum.at(height, tuple(cell.T), p_SP[:, 2])
    joined = ndimage.binary_closing(height > 0.0, np.ones((3, 3)), iterations=2)
    label, count = ndimage.label(joined, np.ones((3, 3)))
    found = []
    for k in range(1, count + 1):
        i, j = np.nonzero((label == k) & (height > 0.0))
        if len(i) >= min_cells:
            xy = CELL_SIZE * (first + np.stack([i, j], axis=1))
            found.append(np.column_stack([xy, height[i, j]]))
    return found


def random_grasps(observation: Observation) -> dict[str, Any]:
    """Random grasps at points above the table, within 60 degrees of straight down.

    Returns:
        An answer, see `burg_planner`.
    """
    max_tilt = np.deg2rad(60.0)
    cloud, rng = SceneCloud.of(observation), observation.rng()
    graspable = np.flatnonzero(cloud.cluster >= 0)
    if not len(graspable):
        return make_answer(observation)
    p_SG = cloud.p_SP[rng.choice(graspable, MAX_GRASPS)]
    cosine = rng.uniform(np.cos(max_tilt), 1.0, MAX_GRASPS)
    azimuth, turn = rng.uniform(0.0, 2.0 * np.pi, (2, MAX_GRASPS))
    sine = np.sqrt(1.0 - cosine**2)
    z = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine], axis=1)
    u, v = perpendicular_axes(z)
    x = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    X_SG = make_pose(np.stack([x, np.cross(z, x), z], axis=2), p_SG)
    return make_answer(observation, X_SG, np.full(MAX_GRASPS, np.nan), rng.uniform(size=MAX_GRASPS))


def make_answer(
    observation: Observation,
    X_SG: Array | None = None,
    width: Array | None = None,
    score: Array | None = None,
) -> dict[str, Any]:
    """An answer with the best of grasps (N, 4, 4) in the scene frame, in any order, with their
    widths (N,) [m] and scores (N,); one without grasps by default."""
    if X_SG is None or width is None or score is None:
        return {"X_CG": np.empty((0, 4, 4)), "width": np.empty(0), "score": np.empty(0)}
    order = np.argsort(-score, kind="stable")[:MAX_GRASPS]
    X_CG = observation.X_CS @ X_SG[order]
    return {"X_CG": X_CG, "width": width[order], "score": score[order]}


def _approach_frames() -> list[Array]:
    """Axes (3, 3) of views, `R_SV`: from straight above, and tilted to all sides."""
    found = [np.eye(3)]
    for tilt_deg, count in ((20.0, 6), (40.0, 8)):
        tilt = np.deg2rad(tilt_deg)
        for azimuth in 2.0 * np.pi * np.arange(count) / count:
            outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            z = np.sin(tilt) * outward + np.cos(tilt) * np.array([0.0, 0.0, 1.0])
            x = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
            found.append(np.stack([x, np.cross(z, x), z], axis=1))
    return found


def best_apart(X_SG: Array, score: Array) -> Indices:
    """Indices of the best grasps that are not near a better one, as in `suppress_near_grasps`."""
    order = np.argsort(-score, kind="stable")[:5000]
    parts = grasp_components(X_SG[order])
    kept: list[int] = []
    left = np.arange(len(order))
    while len(left) and len(kept) < MAX_GRASPS:
        best, left = left[0], left[1:]
        kept.append(int(order[best]))
        one = parts[:, best, None]
        near = pair_translation(parts[:, left], one) < GraspNetSettings.suppression_distance
        near[near] = pair_angle(parts[:, left[near]], one) < GraspNetSettings.suppression_angle
        left = left[~near]
    return np.array(kept, dtype=np.intp)
