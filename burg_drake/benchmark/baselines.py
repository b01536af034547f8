"""The planners that the benchmark brings along, from random grasps to one that knows the meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from burg_drake.benchmark.approach_view import ApproachView, SceneCloud
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.benchmark.depth_grasps import (
    CLEARANCE,
    PALM_HEIGHT,
    HandFitter,
    Hands,
    propose_hands,
    score_hands,
)
from burg_drake.core import Array, GraspSet, Indices, inverse, make_pose, perpendicular_axes
from burg_drake.evaluation import SamplingSettings, sample_grasps, scored_set
from burg_drake.grasping import GraspNetSettings, HandClearance, pair_angle, pair_translation
from burg_drake.grasping import grasp_components
from burg_drake.motion import ArmReach, ReachSettings
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station, build_station_diagram

MAX_GRASPS = 50
"""Largest number of grasps in an answer."""
TIP_DEPTH = 0.03
"""Depth of the finger tips below the top of an object in `top_down` [m]."""


def antipodal(observation: Observation) -> dict[str, Any]:
    """Plans grasps on the depth image alone, in the manner of GPD; see `depth_grasps`.

    Returns:
        An answer, see `burg_planner`: grasps at least 3 cm or 30 degrees apart, best first.
    """
    samples = {True: 400, False: 100}  # Points on surfaces, straight from above and tilted.
    refined = 150  # Hands of each view that are centred and turned once more.
    cloud, rng = SceneCloud.of(observation), observation.rng()
    opening, tip = float(observation.hand["opening"][1]), float(observation.hand["tip"])
    eligible = np.flatnonzero(cloud.cluster >= 0)
    if not len(eligible):
        return _answer(observation)
    # Small surfaces get more than their share of the points.
    size = np.bincount(cloud.cluster[eligible])[cloud.cluster[eligible]]
    found: list[tuple[Array, Array, Array]] = []
    for k, R_SV in enumerate(_approach_frames()):
        view = ApproachView.of(cloud, R_SV, observation.bounds)
        count = min(samples[k == 0], len(eligible))
        weight = size**-0.5 / (size**-0.5).sum()
        chosen = rng.choice(eligible, count, replace=False, p=weight)
        fitter = HandFitter(view, cloud, opening)
        places = propose_hands(view, cloud.p_SP[chosen] @ R_SV, cloud.cluster[chosen], opening)
        hands = fitter.fit(*places)
        hands = hands[np.argsort(-score_hands(hands, opening), kind="stable")[:refined]]
        hands = Hands.join([hands, fitter.refine(hands)])
        found.append((hands.poses(R_SV, tip), hands.width, score_hands(hands, opening)))
        DEBUG.append(hands)
    X_SG, width, score = (np.concatenate(part) for part in zip(*found, strict=True))
    kept = _best_apart(X_SG, score)
    global LAST
    LAST = Hands.join(DEBUG)[kept]; DEBUG.clear()
    return _answer(observation, X_SG[kept], width[kept], score[kept])
DEBUG=[]


def top_down(observation: Observation) -> dict[str, Any]:
    """Plans one grasp straight down on each connected surface, across its shorter axis.

    Returns:
        An answer, see `burg_planner`; surfaces too wide for the hand have no grasp.
    """
    cloud = SceneCloud.of(observation)
    opening, tip = float(observation.hand["opening"][1]), float(observation.hand["tip"])
    found = []
    for k, p_ST in enumerate(cloud.p_ST):
        points = cloud.p_SP[cloud.cluster == k]
        flat = points[:, :2] - p_ST[:2]
        across = np.linalg.eigh(flat.T @ flat)[1][:, 0]
        low, high = np.percentile(flat @ across, [1.0, 99.0])
        width = float(high - low)
        if width >= opening:
            continue
        top = float(np.percentile(points[:, 2], 98.0))
        depth = min(TIP_DEPTH, PALM_HEIGHT - CLEARANCE, top - CLEARANCE)
        x = np.array([*across, 0.0])
        z = np.array([0.0, 0.0, -1.0])
        middle = p_ST[:2] + 0.5 * (low + high) * across
        p_SG = np.array([*middle, top - depth + tip])
        X_SG = make_pose(np.stack([x, np.cross(z, x), z], axis=1), p_SG)
        found.append((X_SG, width, (1.0 - width / opening) * depth / TIP_DEPTH))
    if not found:
        return _answer(observation)
    X, widths, scores = (np.array(part) for part in zip(*found, strict=True))
    best = np.argsort(-scores, kind="stable")[:MAX_GRASPS]
    return _answer(observation, X[best], widths[best], scores[best])


def random_grasps(observation: Observation) -> dict[str, Any]:
    """Random grasps at points above the table, within 60 degrees of straight down.

    Returns:
        An answer, see `burg_planner`.
    """
    max_tilt = np.deg2rad(60.0)
    cloud, rng = SceneCloud.of(observation), observation.rng()
    eligible = np.flatnonzero(cloud.cluster >= 0)
    if not len(eligible):
        return _answer(observation)
    p_SG = cloud.p_SP[rng.choice(eligible, MAX_GRASPS)]
    cosine = rng.uniform(np.cos(max_tilt), 1.0, MAX_GRASPS)
    azimuth, turn = rng.uniform(0.0, 2.0 * np.pi, (2, MAX_GRASPS))
    sine = np.sqrt(1.0 - cosine**2)
    z = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine], axis=1)
    u, v = perpendicular_axes(z)
    x = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    X_SG = make_pose(np.stack([x, np.cross(z, x), z], axis=2), p_SG)
    return _answer(observation, X_SG, np.full(MAX_GRASPS, np.nan), rng.uniform(size=MAX_GRASPS))


def _answer(
    observation: Observation,
    X_SG: Array | None = None,
    width: Array | None = None,
    score: Array | None = None,
) -> dict[str, Any]:
    """An answer with grasps (N, 4, 4) in the scene frame, their widths (N,) [m] and scores (N,), in
    any order; without grasps by default."""
    if X_SG is None or width is None or score is None:
        return {"X_CG": np.empty((0, 4, 4)), "width": np.empty(0), "score": np.empty(0)}
    order = np.argsort(-score, kind="stable")
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


def _best_apart(X_SG: Array, score: Array) -> Indices:
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


def oracle(observation: Observation, scene: SceneLike, station: StationLike) -> dict[str, Any]:
    """Plans with the objects' meshes and the arm: what no planner can know from an image.

    Grasps are antipodal, the hand is clear, the arm can execute them, and the analytic quality of
    the contacts is high. The best grasp of each object comes first, then the second best of each.

    Args:
        observation: names the target, if any.
        scene: the scene that was observed.
        station: station with hand and arm; without an arm, nothing is asked of its reach.

    Returns:
        An answer, see `burg_planner`.
    """
    scene, station = as_scene(scene), as_station(station)
    names = list(scene.instances)
    if observation.target is not None:
        names = [names[observation.target - 1]]
    if not names:
        return _answer(observation)
    grasps = _clear_grasps(scene, station, names)
    if not len(grasps):
        return _answer(observation)
    quality = _quality(scored_set(grasps, scene.library, station, scene))
    grasps = grasps.with_columns(score=quality)
    ranked: list[tuple[float, int]] = []
    arm = None if station.document.arm is None else ArmReach(
        scene, station, settings=ReachSettings(motion=station.document.motion, exact=False)
    )
    X_SG = _poses_in_scene(scene, grasps)
    X_WG = station.document.X_WS.matrix() @ X_SG
    instance = grasps.column("instance")
    for name in names:
        rows = np.flatnonzero(instance == name)
        rows = rows[np.argsort(-quality[rows], kind="stable")]
        rows = rows[_best_apart(X_SG[rows], quality[rows])[:PER_OBJECT_CHECKED]]
        if arm is not None and len(rows):
            verdicts = arm.check_all([name] * len(rows), X_WG[rows], grasps.width[rows])
            rows = rows[[verdict.outcome is None for verdict in verdicts]]
        # A whole number for the turn of the grasp among those of its object, and a rest for quality.
        ranked += [(-place + quality[row] , int(row)) for place, row in enumerate(rows)]
    ranked.sort(key=lambda one: -one[0])
    chosen = np.array([row for _, row in ranked[:MAX_GRASPS]], dtype=np.intp)
    score = np.array([value for value, _ in ranked[:MAX_GRASPS]])
    return _answer(observation, X_SG[chosen], grasps.width[chosen], score)


PER_OBJECT_CHECKED = 12


def _poses_in_scene(scene: Scene, grasps: GraspSet) -> Array:
    """(N, 4, 4) `X_SG` of grasps on instances."""
    X_SO = np.array([scene.X_SO(name) for name in grasps.column("instance").tolist()])
    return np.asarray(X_SO.reshape(-1, 4, 4) @ grasps.X_OG)


def _clear_grasps(scene: Scene, station: Station, names: list[str]) -> GraspSet:
    """Antipodal grasps at which the open hand is clear; more are tried where few are."""
    tries, wanted, kept = (300, 1500), 20, 60
    clearance = HandClearance(build_station_diagram(scene, station, robot="hand"))
    X_WS = station.document.X_WS.matrix()
    settings = SamplingSettings(blind=True, approach_angle_deg=60.0, approaches=2)
    found: dict[str, GraspSet] = {}
    for seed, n in enumerate(tries):
        few = [name for name in names if name not in found or len(found[name]) < wanted]
        if not few:
            break
        grasps = sample_grasps(scene, station, n, seed=seed, settings=settings, only=few)
        clear = clearance.is_clear(X_WS @ _poses_in_scene(scene, grasps))
        for name in few:
            part = grasps.select(np.flatnonzero(clear & (grasps.column("instance") == name))[:kept])
            found[name] = GraspSet.concatenate([found[name], part]) if name in found else part
    return GraspSet.concatenate([found[name] for name in names])


def _quality(scored: GraspSet) -> Array:
    """(N,) quality of grasps between 0 and 1, of their analytic metrics and clearance."""
    def share(name: str, full: float) -> Array:
        values = np.nan_to_num(scored.column(name).astype(float), nan=0.0, posinf=full, neginf=0.0)
        return np.asarray(np.clip(values / full, 0.0, 1.0))

    offset = np.exp(-0.5 * (scored.column("contact_offset") / 0.03) ** 2)
    quality = share("gravity_margin", 3.0) * share("patch_area", 1e-4) ** 0.5
    quality = (0.1+share("clearance", 0.005)) * quality * (0.3 + 0.7 * np.nan_to_num(offset))
    return np.clip(quality, 0.0, 0.99)
