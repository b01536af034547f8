"""The planner that knows the meshes, the arm and the physics: a bound for planners."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from burg_drake.benchmark.baselines import best_apart, make_answer
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.core import Array, Booleans, GraspSet, Outcome, Stage
from burg_drake.evaluation import (
    INSTANCE_COLUMN,
    Candidate,
    SamplingSettings,
    build_judge,
    judge_grasp,
    mode_for,
    sample_grasps,
    scored_set,
)
from burg_drake.grasping import HandClearance, jaws_of
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import (
    DEFAULT_ENGINE,
    Station,
    StationLike,
    as_engine,
    as_station,
    build_station_diagram,
)


class _Sampling(NamedTuple):
    """How grasps are sampled on each object.

    Attributes:
        counts: numbers of grasps; a further one for objects of which few grasps are clear.
        approach_angle_deg: largest angle of the approach from straight down [degrees].
        kept: largest number of clear grasps that are scored.
    """

    counts: tuple[int, ...]
    approach_angle_deg: float
    kept: int


SAMPLING_PASSES = (_Sampling((300, 1000), 60.0, 60), _Sampling((6000,), 90.0, 300))
"""The second one for scenes in which the first finds too few grasps."""
WANTED_GRASPS = 10
"""Grasps that lift their object after which no more are tried."""


def oracle(observation: Observation, scene: SceneLike, station: StationLike) -> dict[str, Any]:
    """Plans with the objects' meshes, the arm and the simulation, which no planner can know from an
    image.

    Grasps are antipodal, and tried in simulation as `evaluate` judges them by default, until ten
    have lifted their object. Grasps that were not tried follow. It is no bound if the benchmark
    judges otherwise: in another mode, with another engine, or with other friction.

    Args:
        observation: names the target, if any.
        scene: the scene that was observed.
        station: station with the hand; without an arm, reach is not checked.

    Returns:
        An answer, see `burg_planner`.
    """
    scene, station = as_scene(scene), as_station(station)
    names = list(scene.instances)
    if observation.target is not None:
        names = [names[observation.target - 1]]
    lifted, width = np.empty((0, 4, 4)), np.empty(0)
    untried: list[tuple[Array, Array]] = []
    for sampling in SAMPLING_PASSES:
        if not names or len(lifted) >= WANTED_GRASPS:
            break
        grasps = _clear_grasps(scene, station, names, sampling)
        if not len(grasps):
            continue
        grasps = scored_set(grasps, scene.library, station, scene)
        X_SG = _poses_in_scene(scene, grasps)
        rows, rest = _try_grasps(scene, station, grasps, X_SG, lifted)
        lifted, width = np.concatenate([lifted, X_SG[rows]]), np.append(width, grasps.width[rows])
        untried.append((X_SG[rest], grasps.width[rest]))
    X = np.concatenate([lifted, *(poses for poses, _ in untried)])
    width = np.concatenate([width, *(widths for _, widths in untried)])
    return make_answer(observation, X, width, -np.arange(float(len(X))))


def _try_grasps(
    scene: Scene, station: Station, grasps: GraspSet, X_SG: Array, lifted: Array
) -> tuple[list[int], list[int]]:
    """Tries grasps, as the benchmark judges them, until enough have lifted their object.

    The best grasps of each object that are apart come first, then others; none near one that has
    lifted. The object whose grasps succeed most often is tried next.

    Args:
        scene, station: where they are tried.
        grasps: (N,) scored grasps.
        X_SG: (N, 4, 4) their poses in the scene.
        lifted: (K, 4, 4) poses of other grasps that have lifted their object.

    Returns:
        Rows of the grasps that lifted, and of others, apart from them, that were not tried.
    """
    max_executed, max_tried = 30, 100
    judge = build_judge(
        scene, station, engine=as_engine(DEFAULT_ENGINE), mode=mode_for(station, None)
    )
    quality, firm = _quality(grasps)
    owner = grasps.column(INSTANCE_COLUMN)
    names = np.unique(owner).tolist()
    is_open = np.ones(len(grasps), dtype=bool)
    found: list[int] = []

    def open_rows(name: str) -> list[int]:
        """Rows that were not tried and are apart, the best first; those that do not bear the
        object's weight come last."""
        rows = np.flatnonzero(is_open & (owner == name))
        known = np.concatenate([lifted, X_SG[found]])
        ahead = np.full(len(known), np.inf)
        kept = best_apart(
            np.concatenate([known, X_SG[rows]]), np.concatenate([ahead, quality[rows]])
        )
        rows = rows[kept[kept >= len(known)] - len(known)]
        return [int(row) for row in rows[np.argsort(~firm[rows], kind="stable")]]

    left = {name: open_rows(name) for name in names}
    successes, tried, executed = dict.fromkeys(names, 0), dict.fromkeys(names, 0), 0
    while (
        len(lifted) + len(found) < WANTED_GRASPS
        and executed < max_executed
        and sum(tried.values()) < max_tried
    ):
        if not any(left.values()):
            left = {name: open_rows(name) for name in names}
        open_names = [name for name in names if left[name]]
        if not open_names:
            break
        best = max(open_names, key=lambda name: (successes[name] + 1) / (tried[name] + 1))
        row = left[best].pop(0)
        is_open[row] = False
        verdict = judge_grasp(judge, _candidate(grasps, row))
        executed += verdict.stage is Stage.EXECUTED
        tried[best] += 1
        if verdict.outcome is Outcome.LIFTED:
            successes[best] += 1
            found.append(row)
    return found, list(itertools.chain(*left.values()))


def _candidate(grasps: GraspSet, row: int) -> Candidate:
    name = str(grasps.column(INSTANCE_COLUMN)[row])
    width = float(grasps.width[row])
    return Candidate(f"{name}-{grasps.id[row]}", name, grasps.X_OG[row], width=width)


def _poses_in_scene(scene: Scene, grasps: GraspSet) -> Array:
    """(N, 4, 4) `X_SG` of grasps on instances."""
    names = grasps.column(INSTANCE_COLUMN).tolist()
    X_SO = {name: scene.X_SO(name) for name in set(names)}
    return np.asarray(np.array([X_SO[name] for name in names]).reshape(-1, 4, 4) @ grasps.X_OG)


def _clear_grasps(
    scene: Scene, station: Station, names: list[str], sampling: _Sampling
) -> GraspSet:
    """Antipodal grasps at which the open hand is clear; more are sampled where few are clear."""
    few = 20
    # Flat objects are clear of the table only where the tips of the fingers hold them.
    tip = jaws_of(station.hand, station.hand_model, station.packages).z[1]
    clearance = HandClearance(build_station_diagram(scene, station, robot="hand"))
    X_WS = station.document.X_WS.matrix()
    settings = SamplingSettings(
        blind=True,
        approach_angle_deg=sampling.approach_angle_deg,
        approaches=2,
        standoffs=(0.0, 0.45 * tip, 0.9 * tip),
    )
    parts: list[GraspSet] = []
    for n in sampling.counts:
        if not names:
            break
        grasps = sample_grasps(scene, station, n, seed=n, settings=settings, only=names)
        clear = clearance.is_clear(X_WS @ _poses_in_scene(scene, grasps))
        owner = grasps.column(INSTANCE_COLUMN)
        found = {name: np.flatnonzero(clear & (owner == name))[: sampling.kept] for name in names}
        parts += [grasps.select(rows) for rows in found.values()]
        names = [name for name in names if len(found[name]) < few]
    return GraspSet.concatenate(parts)


def _quality(scored: GraspSet) -> tuple[Array, Booleans]:
    """(N,) quality of grasps between 0 and 1 by analytic metrics and clearance, and (N,) whether
    the pads hold the object as it is, without slip or turn."""

    def share(name: str, full: float) -> Array:
        """(N,) a metric in units of its value that is good enough, at most 1."""
        values = np.nan_to_num(scored.column(name).astype(float), posinf=full)
        return np.asarray(np.clip(values / full, 0.0, 1.0))

    margin = np.nan_to_num(scored.column("gravity_margin"))
    firm = (margin > 1.2) & (scored.column("slide") == 0.0)
    clearance = 0.2 + 0.8 * share("clearance", 0.005)
    return share("gravity_margin", 3.0) * share("patch_area", 1e-4) ** 0.5 * clearance, firm
