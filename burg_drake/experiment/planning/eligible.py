"""The grasps of runs that trials on the robot can be chosen from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, listing
from burg_drake.core.grasps import MODES, STAGES_AMONG, Among, Outcome
from burg_drake.core.paths import name_from
from burg_drake.evaluation.store import Campaign, Run, load_runs
from burg_drake.experiment.trials import grasp_content

SHORTEST = 4
"""Digits of a hash in a key, at least."""


@dataclass(frozen=True, eq=False)
class EligibleGrasps:
    """Grasps of one run to choose from.

    Attributes:
        key: of the run.
        run: the run.
        rows: (N,) their rows in its results.
    """

    key: str
    run: Run
    rows: NDArray[np.int64]

    @property
    def scene(self) -> str:
        """Content hash of the scene."""
        return self.run.document.scene.content

    def cells(self, name: str) -> NDArray[Any]:
        """(N,) cells of a column of the results."""
        return np.asarray(self.run.results[name][self.rows])


def gather_runs(given: Iterable[Run | Campaign | str | Path]) -> dict[str, Run]:
    """Runs by short keys that do not depend on their order; each run once.

    Args:
        given: runs, of one scene or of many, or their folders.

    Raises:
        InvalidInputError: there is no run, nothing is judged yet, or a run is given in two copies.
    """
    runs: dict[str, Run] = {}
    places = []
    for one in given:
        for run in _runs(one):
            places.append(str(run.path))
            if not run.document.hash or not len(run.results["id"]):
                continue
            same = runs.setdefault(run.document.hash, run)
            if same.path.resolve() != run.path.resolve():
                raise InvalidInputError(
                    f"{same.path} and {run.path} are the same run; give one of them, or"
                    " merge them if they are shards"
                )
    if not runs:
        raise InvalidInputError(f"{listing(places) or 'no run is given'}: no grasp is judged yet")
    by_scene: defaultdict[str, list[Run]] = defaultdict(list)
    for hash in sorted(runs):
        by_scene[name_from(runs[hash].document.scene.name)].append(runs[hash])
    return {
        key: run
        for name in sorted(by_scene)
        for key, run in zip(_keys(name, by_scene[name]), by_scene[name], strict=True)
    }


def make_pools(runs: dict[str, Run], among: Among) -> tuple[list[EligibleGrasps], list[str]]:
    """What there is to choose from in each run, and what people should know about it.

    A grasp that several runs have judged on the same scene and station is one; it belongs to the
    run that asked most of it: mode `arm` before `reach` before `hand`.

    Raises:
        InvalidInputError: reachable grasps are wanted of a run that asked no arm.
    """
    notes: list[str] = []
    pools = []
    owned: defaultdict[tuple[str, str], set[str]] = defaultdict(set)
    order = sorted(runs, key=lambda k: (-MODES.index(runs[k].document.mode), runs[k].document.hash))
    shared = _shared(runs)
    for key in order:
        run = runs[key]
        pool = _pool(key, run, among, notes)
        world = (run.document.scene.content, run.document.station.content)
        if world in shared:
            own = contents(run)
            twice = np.isin(pool.cells("id"), [id for id, c in own.items() if c in owned[world]])
            owned[world].update(own.values())
            if twice.any():
                notes.append(
                    f"{twice.sum()} grasps of run {key} are also in another run of the"
                    " same scene; each is tried once and counts there"
                )
                pool = replace(pool, rows=pool.rows[~twice])
        pools.append(pool)
    return sorted((p for p in pools if len(p.rows)), key=lambda p: p.key), notes


def contents(run: Run, only: Collection[str] | None = None) -> dict[str, str]:
    """Content of the grasps of a run, or of some of them, by id."""
    grasps = run.candidates.grasps
    cells = zip(run.candidates.id, run.candidates.instance, grasps.X_OG, grasps.width, strict=True)
    return {
        id: grasp_content(str(name), X_OG, float(width))
        for id, name, X_OG, width in cells
        if only is None or id in only
    }


def _runs(one: Run | Campaign | str | Path) -> Sequence[Run]:
    if isinstance(one, Run):
        return [one]
    return one.runs if isinstance(one, Campaign) else load_runs(one)


def _pool(key: str, run: Run, among: Among, notes: list[str]) -> EligibleGrasps:
    if among == "reachable" and run.document.mode == "hand":
        raise InvalidInputError(
            f"{run.path} was judged in mode hand, which does not check what the arm can"
            " reach; choose among all, clear or executed grasps"
        )
    results = run.results
    failed = results["outcome"] == Outcome.SIMULATION_FAILED.value
    passed = np.isin(results["stage"], [stage.value for stage in STAGES_AMONG[among]])
    if failed.any():
        notes.append(f"{failed.sum()} grasps of run {key} could not be simulated and are left out")
    count, judged = run.document.grasps.count, len(results["id"])
    if judged < count:
        notes.append(f"run {key} is not complete: {judged} of {count} grasps are judged")
    return EligibleGrasps(key, run, np.flatnonzero(passed & ~failed))


def _shared(runs: dict[str, Run]) -> set[tuple[str, str]]:
    """Scenes and stations that several runs are about."""
    worlds = [(r.document.scene.content, r.document.station.content) for r in runs.values()]
    return {world for world in worlds if worlds.count(world) > 1}


def _keys(name: str, runs: Sequence[Run]) -> list[str]:
    """Keys for runs on scenes of the same name."""
    if len(runs) == 1:
        return [name]
    modes = [run.document.mode for run in runs]
    if len(set(modes)) == len(modes):
        return [f"{name}-{mode}" for mode in modes]
    hashes = [run.document.hash for run in runs]
    digits = SHORTEST
    while len({hash[:digits] for hash in hashes}) < len(hashes):
        digits += 1
    return [f"{name}-{hash[:digits]}" for hash in hashes]
