"""Chooses grasps of runs for trials on the robot, and puts them into an order.

Chance comes from hashes of the seed and of the grasp, never from a position; see
`experiment.planning.selection`.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, content_hash, software_versions
from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.planning.eligible import (
    EligibleGrasps,
    contents,
    gather_runs,
    make_pools,
)
from burg_drake.experiment.planning.selection import Chosen, choose, drawn_scenes
from burg_drake.experiment.planning.settings import SelectionSettings
from burg_drake.experiment.trials import (
    RealTrial,
    Selection,
    Stratum,
    TrialSheet,
    entered,
    journal_path,
    load_trials,
    read_entries,
    save_trials,
    source_of,
)


def plan_trials(
    runs: Run | Campaign | str | Path | Iterable[Run | Campaign | str | Path],
    *,
    settings: SelectionSettings | None = None,
    robustness: str | Path | None = None,
    out: str | Path | None = None,
) -> TrialSheet:
    """Chooses grasps for trials on the robot.

    Example::

        few = burg.trials.SelectionSettings(per_object=4)
        sheet = burg.trials.plan_trials("runs/first", settings=few, out="trials.yaml")

    Args:
        runs: one or several, of one scene or of many, or their folders. A grasp that several have
            judged on the same scene and station is tried once.
        settings: how many of which grasps, and in which order; as usual if None.
        robustness: table with probabilities, of the one run; those in the runs' folders if None.
        out: file to write; none if None.

    Returns:
        The sheet. Its notes say where there were too few grasps.

    Raises:
        InvalidInputError: there is no run, or nothing to choose from; or the file has entries
            already.
        UnknownNameError: there is no such margin.
    """
    given = [runs] if isinstance(runs, (Run, Campaign, str, Path)) else list(runs)
    selection = (settings or SelectionSettings()).selection()
    if out is not None:
        require_unused(out)
    gathered = gather_runs(given)
    if robustness is not None and len(gathered) > 1:
        raise InvalidInputError("a table of robustness belongs to one run; give that run alone")
    pools, notes = make_pools(gathered, selection.among)
    pools = drawn_scenes(pools, selection)
    table = None if robustness is None else Path(robustness)
    strata, chosen, more = choose(pools, selection, table)
    if not chosen:
        raise InvalidInputError(
            f"{', '.join(str(run.path) for run in gathered.values())}: there is no grasp to choose"
            f" among those that are {selection.among}"
        )
    folder = None if out is None else Path(os.path.realpath(out)).parent
    used = {pool.key: pool.run for pool, _, _ in chosen}
    sheet = TrialSheet(
        created=datetime.now().astimezone().isoformat(timespec="seconds"),
        runs={key: source_of(used[key], folder) for key in sorted(used)},
        selection=selection,
        strata=strata,
        trials=_trials(_ordered(chosen, selection), strata),
        notes=tuple(notes + more),
        versions=software_versions(),
    )
    if out is not None:
        save_trials(sheet, out)
    return sheet


def require_unused(path: str | Path) -> None:
    """Refuses to write over trials that have entries, in the file or in its journal.

    Raises:
        InvalidInputError: it has, or is something else.
    """
    path = Path(path)
    recorded = read_entries(journal_path(path))
    if not path.exists() and not recorded:
        return
    trials = load_trials(path).trials if path.exists() else ()
    filled = sum(bool(entered(trial)) for trial in trials)
    if filled or recorded:
        count = max(filled, len({entry.number for entry in recorded}))
        raise InvalidInputError(
            f"{path} already has entries for {count} "
            f"{'trial' if count == 1 else 'trials'}; choose another file, or move it and"
            " its journal away"
        ).about("out")


def _ordered(chosen: Chosen, selection: Selection) -> list[tuple[int, EligibleGrasps, int, str]]:
    """With the number of the block in front: blocks of a scene in a random order, and grasps in a
    random order in each."""
    seed = selection.seed
    by_scene: defaultdict[str, list[tuple[str, EligibleGrasps, int, str]]] = defaultdict(list)
    for pool, k, key in chosen:
        id = str(pool.cells("id")[k])
        rank = content_hash(seed, "order", pool.scene, pool.run.document.hash, id)
        by_scene[pool.scene].append((rank, pool, k, key))
    blocks = []
    for scene, members in by_scene.items():
        members.sort(key=lambda member: member[0])
        for turn, part in enumerate(np.array_split(np.arange(len(members)), selection.blocks)):
            if len(part):
                place = (turn, content_hash(seed, "block", scene, turn))
                blocks.append((place, [members[i] for i in part.tolist()]))
    blocks.sort(key=lambda block: block[0])
    return [
        (number, pool, k, key)
        for number, (_, members) in enumerate(blocks, 1)
        for _, pool, k, key in members
    ]


def _trials(
    ordered: Sequence[tuple[int, EligibleGrasps, int, str]], strata: Mapping[str, Stratum]
) -> tuple[RealTrial, ...]:
    pools = {pool.key: pool for _, pool, _, _ in ordered}
    hashes = {
        key: contents(pool.run, {str(pool.cells("id")[k]) for _, p, k, _ in ordered if p is pool})
        for key, pool in pools.items()
    }
    cells = {
        key: {name: pool.cells(name) for name in ("id", "instance", "object", "outcome")}
        for key, pool in pools.items()
    }
    trials = []
    for number, (block, pool, k, stratum) in enumerate(ordered, 1):
        id, instance, held, outcome = (str(values[k]) for values in cells[pool.key].values())
        trials.append(
            RealTrial(
                number=number,
                block=block,
                run=pool.key,
                grasp=id,
                content=hashes[pool.key][id],
                instance=instance,
                object=held,
                simulated=Outcome(outcome),
                stratum=stratum,
            )
        )
    return tuple(trials)
