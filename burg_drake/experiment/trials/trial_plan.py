"""Plans trials on the robot: chooses grasps of runs and puts them into an order.

Random numbers come from hashes of the seed and of the grasp, never from its position in a file; see
`grasp_selection`.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    Among,
    InvalidInputError,
    Outcome,
    content_hash,
    quote_value,
    setting,
    software_versions,
    suggest_names,
)
from burg_drake.evaluation import Campaign, Run, require_lifts
from burg_drake.experiment.trials.grasp_selection import (
    Chosen,
    EligibleGrasps,
    draw_scenes,
    gather_runs,
    list_eligible_grasps,
    select_grasps,
    take_grasps,
)
from burg_drake.experiment.trials.source_runs import grasp_contents, make_source_run
from burg_drake.experiment.trials.trial_book import (
    current_time,
    entered_values,
    journal_path,
    read_entries,
)
from burg_drake.experiment.trials.trial_sheet import (
    Balance,
    RealTrial,
    Selection,
    Stratum,
    Success,
    TrialSheet,
    load_trials,
    save_trials,
)

MARGIN_BALANCE_PREFIX = "margin:"
"""Start of a `balance` that names a margin."""


@dataclass(frozen=True, kw_only=True)
class SelectionSettings:
    """Which grasps of each object are chosen, and in which order they are tried.

    Attributes:
        per_object: number of grasps wanted of each object of a run.
        balance: quantity whose values are to be equally frequent among the chosen grasps of an
            object: `outcome`, success or failure in simulation; `stage`, deciding stage and
            outcome; `margin:NAME`, bins of a margin with equally many grasps; `probability`, bins
            of the predicted probability of success, see `assess_robustness`; `none`.
        bins: number of bins for a margin or the probability.
        among: grasps to choose from: `all`; those with the hand `clear`; those that the arm can
            reach (`reachable`); those tried in simulation (`executed`). In mode `hand`, all clear
            grasps are tried.
        success: which outcomes count as success. `lifted`: only lifted. `held`: also grasps that
            held the object but turned it, or moved another one.
        scenes: number of scenes to draw at random; 0 for all.
        blocks: number of blocks that the trials of a scene are divided into; the first blocks of
            all scenes come before any second block.
        seed: random seed of choice and order.

    Raises:
        InvalidInputError: a balance that does not exist, or a number that is too small.
    """

    per_object: int = setting(10, ("grasps of each object of a run"), low=1)
    balance: str = setting(
        "outcome",
        "balance grasps by: outcome, stage, margin:NAME, probability (of `robustness`) or none",
        metavar="BY",
    )
    bins: int = setting(4, ("bins for a margin or probability"), low=1)
    among: Among = setting(
        "executed",
        "choose among these: all, clear hand, reachable, or simulated grasps (default: executed)",
        choices=get_args(Among),
    )
    success: Success = setting(
        "lifted",
        "what counts as success; held includes turned objects and moved neighbours",
        choices=get_args(Success),
    )
    scenes: int = setting(0, "choose N scenes at random (default: all)", low=1)
    blocks: int = setting(1, "set up each scene this many times", low=1)
    seed: int = setting(0, "random seed of choice and order", high=MAX_DOCUMENT_SEED)

    def __post_init__(self) -> None:
        kinds = [name for name in get_args(Balance) if name != "margin"]
        if not self._margin_name and self.balance not in kinds:
            known = suggest_names(self.balance, [*kinds, f"{MARGIN_BALANCE_PREFIX}NAME"])
            raise InvalidInputError(f"there is no balance {quote_value(self.balance)}; {known}")
        for name, kind in (("among", Among), ("success", Success)):
            value = getattr(self, name)
            if value not in get_args(kind):
                known = suggest_names(str(value), get_args(kind))
                raise InvalidInputError(f"there is no {name} {quote_value(value)}; {known}")
        if self._has_bins and self.bins == 0:
            raise InvalidInputError("bins is 0; it has to be 1 at least")
        self.selection()

    def selection(self) -> Selection:
        """The settings as stored in trials files."""
        balance = {
            "balance": "margin" if self._margin_name else self.balance,
            "margin": self._margin_name,
            "bins": self.bins if self._has_bins else 0,
        }
        return Selection(**(asdict(self) | balance))

    @property
    def _margin_name(self) -> str:
        """Name of the margin to balance by; empty for another balance."""
        return (
            self.balance.removeprefix(MARGIN_BALANCE_PREFIX)
            if self.balance.startswith(MARGIN_BALANCE_PREFIX)
            else ""
        )

    @property
    def _has_bins(self) -> bool:
        return bool(self._margin_name) or self.balance == "probability"


def plan_trials(
    runs: Run | Campaign | str | Path | Iterable[Run | Campaign | str | Path],
    *,
    settings: SelectionSettings | None = None,
    robustness: str | Path | None = None,
    grasps: Mapping[Path, Collection[str]] | None = None,
    out: str | Path | None = None,
) -> TrialSheet:
    """Chooses grasps for trials on the robot.

    Example::

        few = burg.trials.SelectionSettings(per_object=4)
        sheet = burg.trials.plan_trials("runs/first", settings=few, out="trials.yaml")

    Args:
        runs: one or several runs, of one scene or of many, or their folders. A grasp that several
            runs have judged on the same scene and station is tried once.
        settings: number, choice and order of the grasps; the defaults if None.
        robustness: table with probabilities, for a single run; tables in the folders of the runs
            if None.
        grasps: ids of grasps by the folder of their run; all of these that are eligible are tried,
            whatever the settings say of their number and balance.
        out: trials file to write; none if None.

    Returns:
        The trials. `notes` names the objects with too few grasps.

    Raises:
        InvalidInputError: there is no run or no eligible grasp; or the file has entries already.
        UnknownNameError: the margin does not exist.
    """
    given = [runs] if isinstance(runs, (Run, Campaign, str, Path)) else list(runs)
    selection = (settings or SelectionSettings()).selection()
    if out is not None:
        require_unused(out)
    gathered = gather_runs(given)
    if robustness is not None and len(gathered) > 1:
        raise InvalidInputError("a table of robustness belongs to one run; give that run alone")
    for run in gathered.values():
        require_lifts(run.document.trial, run.path, "a robot tries")
    pools, notes = list_eligible_grasps(gathered, selection.among)
    pools = draw_scenes(pools, selection)
    table = None if robustness is None else Path(robustness)
    if grasps is None:
        strata, chosen, more = select_grasps(pools, selection, table)
    else:
        strata, chosen = take_grasps(pools, grasps)
        more = []
    if not chosen:
        raise InvalidInputError(
            f"{', '.join(str(run.path) for run in gathered.values())}: there is no grasp to choose"
            f" among those that are {selection.among}"
        )
    folder = None if out is None else Path(os.path.realpath(out)).parent
    used = {pool.key: pool.run for pool, _, _ in chosen}
    sheet = TrialSheet(
        created=current_time(),
        runs={key: make_source_run(used[key], folder) for key in sorted(used)},
        selection=selection,
        strata=strata,
        trials=_make_trials(_shuffle_trials(chosen, selection), strata),
        notes=tuple(notes + more),
        versions=software_versions(),
    )
    if out is not None:
        save_trials(sheet, out)
    return sheet


def require_unused(path: str | Path) -> None:
    """Refuses to overwrite a trials file if it or its journal has entries.

    Raises:
        InvalidInputError: there are entries, or the file is no trials file.
    """
    path = Path(path)
    recorded = read_entries(journal_path(path))
    if not path.exists() and not recorded:
        return
    trials = load_trials(path).trials if path.exists() else ()
    filled = sum(bool(entered_values(trial)) for trial in trials)
    if filled or recorded:
        count = max(filled, len({entry.number for entry in recorded}))
        raise InvalidInputError(
            f"{path} already has entries for {count} "
            f"{'trial' if count == 1 else 'trials'}; choose another file, or move it and"
            " its journal away"
        ).about("out")


def _shuffle_trials(
    chosen: Chosen, selection: Selection
) -> list[tuple[int, EligibleGrasps, int, str]]:
    """Divides the grasps of each scene at random into blocks, and puts the blocks into a random
    order; returns the grasps with their block numbers.
    """
    seed = selection.seed
    by_scene: defaultdict[str, list[tuple[str, EligibleGrasps, int, str]]] = defaultdict(list)
    for pool, k, key in chosen:
        id = str(pool.cells("id")[k])
        rank = content_hash(seed, "order", pool.scene, pool.run.document.hash, id)
        by_scene[pool.scene].append((rank, pool, k, key))
    blocks = []
    for scene, members in by_scene.items():
        members.sort(key=lambda member: member[0])
        for k, part in enumerate(np.array_split(np.arange(len(members)), selection.blocks)):
            if len(part):
                block_rank = (k, content_hash(seed, "block", scene, k))
                blocks.append((block_rank, [members[i] for i in part.tolist()]))
    blocks.sort(key=lambda block: block[0])
    return [
        (number, pool, k, key)
        for number, (_, members) in enumerate(blocks, 1)
        for _, pool, k, key in members
    ]


def _make_trials(
    ordered: Sequence[tuple[int, EligibleGrasps, int, str]], strata: Mapping[str, Stratum]
) -> tuple[RealTrial, ...]:
    pools = {pool.key: pool for _, pool, _, _ in ordered}
    tried = {str(pool.cells("id")[k]) for _, pool, k, _ in ordered}
    hashes = {key: grasp_contents(pool.run, tried) for key, pool in pools.items()}
    columns = {
        key: {name: pool.cells(name) for name in ("id", "instance", "object", "outcome")}
        for key, pool in pools.items()
    }
    trials = []
    for number, (block, pool, k, stratum) in enumerate(ordered, 1):
        row = {name: str(values[k]) for name, values in columns[pool.key].items()}
        trials.append(
            RealTrial(
                number=number,
                block=block,
                run=pool.key,
                grasp=row["id"],
                content=hashes[pool.key][row["id"]],
                instance=row["instance"],
                object=row["object"],
                simulated=Outcome(row["outcome"]),
                stratum=stratum,
            )
        )
    return tuple(trials)
