"""The planner that knows the meshes, the arm and the physics: a bound for planners."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from burg_drake.benchmark.baselines import best_apart, make_answer
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.core import Array, Booleans, GraspSet, Indices, Outcome, Stage
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
    lifted: list[tuple[Array, Array]] = []
    untried: list[tuple[Array, Array]] = []
    for sampling in SAMPLING_PASSES:
        wanted = WANTED_GRASPS - sum(len(X_SG) for X_SG, _ in lifted)
        if not names or wanted <= 0:
            break
        grasps = _clear_grasps(scene, station, names, sampling)
        if not len(grasps):
            continue
        grasps = scored_set(grasps, scene.library, station, scene)
        X_SG = _poses_in_scene(scene, grasps)
        order = _best_of_each(grasps, X_SG, names)
        for rows, found in zip(
            _try_grasps(scene, station, grasps, order, wanted), (lifted, untried), strict=True
        ):
            found.append((X_SG[rows], grasps.width[rows]))
    if not lifted and not untried:
        return make_answer(observation)
    X, width = (np.concatenate(part) for part in zip(*lifted, *untried, strict=True))
    return make_answer(observation, X, width, -np.arange(float(len(X))))


def _best_of_each(grasps: GraspSet, X_SG: Array, names: list[str]) -> list[list[int]]:
    """For each object, rows of its grasps that are apart, the best first; those that do not bear
    its weight come last."""
    quality, firm = _quality(grasps)
    owner = grasps.column(INSTANCE_COLUMN)
    found = []
    for name in names:
        rows = np.flatnonzero(owner == name)
        rows = rows[best_apart(X_SG[rows], quality[rows])]
        found.append(rows[np.argsort(~firm[rows], kind="stable")].tolist())
    return found


def _try_grasps(
    scene: Scene, station: Station, grasps: GraspSet, rows: list[list[int]], wanted: int
) -> tuple[Indices, Indices]:
    """Rows of grasps that lift their object, as the benchmark judges, until `wanted` have done so;
    and rows that were not tried. The object whose grasps succeed most often is tried next."""
    max_executed = 30
    judge = build_judge(
        scene, station, engine=as_engine(DEFAULT_ENGINE), mode=mode_for(station, None)
    )
    lifted: list[int] = []
    left, successes, tried = [list(own) for own in rows], [0] * len(rows), [0] * len(rows)
    executed = 0
    while any(left) and len(lifted) < wanted and executed < max_executed:
        open_objects = [k for k, own in enumerate(left) if own]
        best = max(open_objects, key=lambda k: (successes[k] + 1) / (tried[k] + 1))
        row = left[best].pop(0)
        verdict = judge_grasp(judge, _candidate(grasps, row))
        executed += verdict.stage is Stage.EXECUTED
        tried[best] += 1
        if verdict.outcome is Outcome.LIFTED:
            successes[best] += 1
            lifted.append(row)
    untried = list(itertools.chain(*left))
    return np.array(lifted, dtype=np.intp), np.array(untried, dtype=np.intp)


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
