"""Chooses grasps of runs for trials on the robot, and puts them into an order.

Chance comes from hashes of the seed and of the grasp, never from a position; see
`experiment.planning.selection`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import get_args

import numpy as np

from burg_drake.core import InvalidInputError, content_hash, nearest, quoted
from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.records import software_versions
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.planning.eligible import (
    EligibleGrasps,
    contents,
    gather_runs,
    make_pools,
)
from burg_drake.experiment.planning.selection import Chosen, choose, drawn_scenes
from burg_drake.experiment.trials import (
    Among,
    Balance,
    RealTrial,
    Selection,
    Stratum,
    Success,
    TrialSheet,
    entered,
    journal_path,
    load_trials,
    read_entries,
    save_trials,
    source_of,
)

MARGIN = "margin:"
"""Begins the name of a margin to balance by."""


def plan_trials(
    runs: Run | Campaign | str | Path | Iterable[Run | Campaign | str | Path],
    *,
    per_object: int = 10,
    balance: str = "outcome",
    bins: int = 4,
    among: Among = "executed",
    success: Success = "lifted",
    scenes: int = 0,
    blocks: int = 1,
    seed: int = 0,
    robustness: str | Path | None = None,
    out: str | Path | None = None,
) -> TrialSheet:
    """Chooses grasps for trials on the robot.

    Args:
        runs: one or several, of one scene or of many, or their folders. A grasp that several have
            judged on the same scene and station is tried once.
        per_object: how many grasps of each object of a run, if there are as many.
        balance: what each object's grasps are balanced by, as far as there are enough: `outcome`,
            success and failure in simulation; `stage`, each outcome by itself; `margin:NAME`, bins
            of equal numbers of a margin; `probability`, such bins of the predicted probability of
            success, see `assess_robustness`; `none`.
        bins: their number.
        among: what is chosen from: `executed`, grasps that were tried in simulation, which in mode
            `hand` all are at which the hand is clear; `reachable`, those that the arm can be at;
            `clear`, all those at which the hand is clear, though no arm may come there.
        success: what counts: `lifted`, or `held`, also where another object was moved.
        scenes: how many scenes to draw at random; 0 for all.
        blocks: in how many blocks the trials of a scene come; each scene has one block before any
            has its second one.
        seed: of choice and order.
        robustness: table with probabilities, of the one run; those in the runs' folders if None.
        out: file to write; none if None.

    Returns:
        The sheet. Its notes say where there were too few grasps.

    Raises:
        InvalidInputError: there is no run, or nothing to choose from; a balance that does not
            exist; or the file has entries already.
        UnknownNameError: there is no such margin.
    """
    given = [runs] if isinstance(runs, (Run, Campaign, str, Path)) else list(runs)
    selection = _selection(
        balance,
        per_object=per_object,
        bins=bins,
        among=among,
        success=success,
        scenes=scenes,
        blocks=blocks,
        seed=seed,
    )
    if out is not None:
        require_unused(out)
    gathered = gather_runs(given)
    if robustness is not None and len(gathered) > 1:
        raise InvalidInputError("a table of robustness is of one run; give that run alone")
    pools, notes = make_pools(gathered, among)
    pools = drawn_scenes(pools, selection)
    table = None if robustness is None else Path(robustness)
    strata, chosen, more = choose(pools, selection, table)
    if not chosen:
        raise InvalidInputError(
            f"{', '.join(str(run.path) for run in gathered.values())}: there is no grasp to choose"
            f" among those that are {among}"
        )
    folder = None if out is None else Path(out).absolute().parent
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
            f"{path} has entries for {count} {'trial' if count == 1 else 'trials'};"
            " choose another -o, or move it and its journal away"
        )


def _selection(balance: str, **values: object) -> Selection:
    kinds = [name for name in get_args(Balance) if name != "margin"]
    margin = balance.removeprefix(MARGIN) if balance.startswith(MARGIN) else ""
    if not margin and balance not in kinds:
        known = nearest(balance, [*kinds, f"{MARGIN}NAME"])
        raise InvalidInputError(f"there is no balance {quoted(balance)}; {known}")
    for name, kind in (("among", Among), ("success", Success)):
        if values[name] not in get_args(kind):
            known = nearest(str(values[name]), get_args(kind))
            raise InvalidInputError(f"there is no {name} {quoted(values[name])}; {known}")
    if not (margin or balance == "probability"):
        values["bins"] = 0
    elif values["bins"] == 0:
        raise InvalidInputError("bins is 0; it has to be 1 at least")
    return Selection(balance="margin" if margin else balance, margin=margin, **values)  # type: ignore[arg-type]


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
