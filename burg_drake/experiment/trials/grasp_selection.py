"""Choice of grasps for trials: eligible grasps, strata, random selection, and notes on shortfalls.

The random order follows from hashes of the seed and of each grasp. So the selection does not
depend on the order of the runs, and a smaller selection is a part of a larger one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    DECIDED_STAGES,
    MODES,
    Among,
    InvalidInputError,
    MarginNames,
    Outcome,
    content_hash,
    format_number,
    list_names,
    make_name,
    quote_value,
    suggest_names,
)
from burg_drake.evaluation import (
    ROBUSTNESS_FILES,
    Campaign,
    Run,
    find_robustness_table,
    lifted_shares,
    load_runs,
)
from burg_drake.experiment.trials.source_runs import grasp_contents
from burg_drake.experiment.trials.trial_sheet import Selection, Stratum, is_success


@dataclass(frozen=True, eq=False)
class EligibleGrasps:
    """Grasps of one run to choose from.

    Attributes:
        key: key of the run.
        run: the run.
        rows: (N,) rows of the grasps in its results.
    """

    key: str
    run: Run
    rows: NDArray[np.int64]

    @property
    def scene(self) -> str:
        """Content hash of the scene."""
        return self.run.document.scene.content

    def cells(self, name: str) -> NDArray[Any]:
        """(N,) values of a column of the results."""
        return np.asarray(self.run.results[name][self.rows])


def gather_runs(given: Iterable[Run | Campaign | str | Path]) -> dict[str, Run]:
    """Opens runs, each once, and gives them short keys that do not depend on their order.

    Args:
        given: runs, of one scene or of many, or their folders.

    Raises:
        InvalidInputError: there is no run, a run has no verdicts yet, or is given in two copies.
    """
    runs: dict[str, Run] = {}
    places = []
    for source in given:
        for run in _open_runs(source):
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
        raise InvalidInputError(
            f"{list_names(places) or 'no run is given'}: no grasp is judged yet"
        )
    by_scene: defaultdict[str, list[Run]] = defaultdict(list)
    for hash in sorted(runs):
        by_scene[make_name(runs[hash].document.scene.name)].append(runs[hash])
    return {
        key: run
        for name in sorted(by_scene)
        for key, run in zip(_scene_keys(name, by_scene[name]), by_scene[name], strict=True)
    }


def list_eligible_grasps(
    runs: dict[str, Run], among: Among
) -> tuple[list[EligibleGrasps], list[str]]:
    """Eligible grasps of each run, and notes about them.

    A grasp that several runs have judged on the same scene and station is listed once, for the run
    that checks most: mode `arm` before `reach` before `hand`.

    Raises:
        InvalidInputError: reachable grasps are wanted of a run without an arm.
    """
    notes: list[str] = []
    pools = []
    listed: defaultdict[tuple[str, str], set[str]] = defaultdict(set)
    order = sorted(runs, key=lambda k: (-MODES.index(runs[k].document.mode), runs[k].document.hash))
    shared = _shared_scenes_and_stations(runs)
    for key in order:
        run = runs[key]
        pool = _make_pool(key, run, among, notes)
        place = (run.document.scene.content, run.document.station.content)
        if place in shared:
            contents = grasp_contents(run)
            repeated_ids = [id for id, content in contents.items() if content in listed[place]]
            repeated = np.isin(pool.cells("id"), repeated_ids)
            listed[place].update(contents.values())
            if repeated.any():
                notes.append(
                    f"{repeated.sum()} grasps of run {key} are also in another run of the"
                    " same scene; each is tried once and counts there"
                )
                pool = replace(pool, rows=pool.rows[~repeated])
        pools.append(pool)
    return sorted((p for p in pools if len(p.rows)), key=lambda p: p.key), notes


def _open_runs(source: Run | Campaign | str | Path) -> Sequence[Run]:
    if isinstance(source, Run):
        return [source]
    return source.runs if isinstance(source, Campaign) else load_runs(source)


def _make_pool(key: str, run: Run, among: Among, notes: list[str]) -> EligibleGrasps:
    if among == "reachable" and run.document.mode == "hand":
        raise InvalidInputError(
            f"{run.path} was judged in mode hand, which does not check what the arm can"
            " reach; choose among all, clear or executed grasps"
        )
    results = run.results
    failed = results["outcome"] == Outcome.SIMULATION_FAILED.value
    eligible = np.isin(results["stage"], [stage.value for stage in DECIDED_STAGES[among]])
    if failed.any():
        notes.append(f"{failed.sum()} grasps of run {key} could not be simulated and are left out")
    count, judged = run.document.grasps.count, len(results["id"])
    if judged < count:
        notes.append(f"run {key} is not complete: {judged} of {count} grasps are judged")
    return EligibleGrasps(key, run, np.flatnonzero(eligible & ~failed))


def _shared_scenes_and_stations(runs: dict[str, Run]) -> set[tuple[str, str]]:
    """Pairs of scene and station that several runs have in common."""
    places = [(r.document.scene.content, r.document.station.content) for r in runs.values()]
    return {place for place in places if places.count(place) > 1}


def _scene_keys(name: str, runs: Sequence[Run]) -> list[str]:
    """Keys for runs on scenes of the same name."""
    if len(runs) == 1:
        return [name]
    modes = [run.document.mode for run in runs]
    if len(set(modes)) == len(modes):
        return [f"{name}-{mode}" for mode in modes]
    hashes = [run.document.hash for run in runs]
    digits = 4
    while len({hash[:digits] for hash in hashes}) < len(hashes):
        digits += 1
    return [f"{name}-{hash[:digits]}" for hash in hashes]


def stratum_labels(
    pool: EligibleGrasps, selection: Selection, table: Path | None
) -> NDArray[np.str_]:
    """(N,) label of each grasp's stratum among the strata of its object; empty without a stratum.

    Args:
        pool: the grasps.
        selection: settings with the balance.
        table: table of robustness for the balance `probability`; see `robustness_by_grasp`.

    Raises:
        InvalidInputError: the run lacks the margin, or has no valid table of robustness.
    """
    if selection.balance == "none":
        return np.full(len(pool.rows), "all")
    outcomes = pool.cells("outcome").tolist()
    if selection.balance == "outcome":
        good = [is_success(Outcome(outcome), selection.success) for outcome in outcomes]
        return np.where(good, "success", "failure")
    if selection.balance == "stage":
        pairs = zip(pool.cells("stage").tolist(), outcomes, strict=True)
        return np.array([f"{stage}/{outcome}" for stage, outcome in pairs], dtype=np.str_)
    if selection.balance == "margin":
        values, name = _margin_values(pool, selection.margin), selection.margin
    else:
        shares = robustness_by_grasp(pool.run, table)
        values = np.array([shares.get(id, np.nan) for id in pool.cells("id").tolist()])
        name = "probability"
    objects = pool.cells("object")
    labels = np.full(len(values), "", dtype=object)
    for object_name in np.unique(objects):
        rows = objects == object_name
        labels[rows] = _quantile_labels(values[rows], name, selection.bins)
    return labels.astype(np.str_)


def robustness_by_grasp(run: Run, table: Path | None) -> dict[str, float]:
    """Share of a grasp's perturbed repeats that were lifted, by grasp id.

    Args:
        run: the run.
        table: table written by `robustness`; the one in the run's folder if None.

    Raises:
        InvalidInputError: the table is missing, lacks these shares, or belongs to another run.
    """
    found = find_robustness_table(run.path) if table is None else table
    if found is None:
        raise InvalidInputError(
            f"{run.path / ROBUSTNESS_FILES[0]} does not exist; run `burg-drake robustness "
            f"{run.path}`, which predicts how often grasps are lifted"
        )
    shares = lifted_shares(found, {run.document.hash}, run.candidates.id)
    return {id: share for (hash, id), share in shares.items() if hash == run.document.hash}


def allocate_to_strata(
    populations: Mapping[str, int], wanted: int, first: Sequence[str]
) -> dict[str, int]:
    """Divides a number of grasps among strata, as evenly as their populations allow. The numbers
    sum to `wanted` if there are enough grasps.

    Args:
        populations: number of grasps by stratum.
        wanted: total number.
        first: strata in the order in which they receive the remainder.
    """
    chosen = dict.fromkeys(populations, 0)
    left = min(wanted, sum(populations.values()))
    while left:
        for label in first:
            if left and chosen[label] < populations[label]:
                chosen[label] += 1
                left -= 1
    return chosen


def _margin_values(pool: EligibleGrasps, name: str) -> NDArray[np.float64]:
    if name not in pool.run.results or name not in MarginNames.all:
        known = [margin for margin in MarginNames.all if margin in pool.run.results]
        raise InvalidInputError(
            f"{pool.run.path} has no margin {quote_value(name)}; {suggest_names(name, known)}"
        )
    return pool.cells(name).astype(float)


def _quantile_labels(values: NDArray[np.float64], name: str, bins: int) -> NDArray[np.str_]:
    """Labels of bins with about equally many grasps; equal values share a bin, and values that are
    not finite have an empty label.
    """
    known = np.isfinite(values)
    labels = np.full(len(values), "", dtype=object)
    if known.any():
        edges = np.unique(np.quantile(values[known], np.linspace(0.0, 1.0, bins + 1)))
        bins_of_values = np.searchsorted(edges[1:-1], values, side="right")
        for k in np.unique(bins_of_values[known]):
            rows = known & (bins_of_values == k)
            bounds = values[rows].min(), values[rows].max()
            low, high = (format_number(float(bound), 4) for bound in bounds)
            text = low if low == high else f"{low} to {high}"
            labels[rows] = f"{name} {text} ({k + 1} of {max(len(edges) - 1, 1)})"
    return labels


MAX_SHORTFALL_ITEMS = 20
"""Maximum number of notes on shortfalls, and of objects in a note; the rest is counted."""


@dataclass(frozen=True)
class Shortfall:
    """Missing grasps of an object of a run.

    Attributes:
        run, object: key of the run, and name of the object in the library.
        kind: kind of shortfall; objects with the same kind share a note.
        counts: available and wanted number, such as `3 of 5`.
        description: text of the note, with the counts, if all its objects have the same counts;
            `kind` if empty.
    """

    run: str
    object: str
    kind: str
    counts: str = ""
    description: str = ""


def find_shortfall(strata: Sequence[Stratum], wanted: int) -> list[Shortfall]:
    """Shortfall of one object that has too few grasps in a stratum or overall; empty if it has
    enough.

    Args:
        strata: strata of the object.
        wanted: total number of grasps.
    """
    missing = [s for s in strata if s.selected < s.wanted]
    if not missing:
        return []
    total, first = sum(stratum.selected for stratum in strata), strata[0]
    labels = " and ".join(s.label for s in missing)
    counts = ", ".join(f"{s.selected} of {s.wanted}" for s in missing)
    description = ", ".join(f"{s.selected} of {s.wanted} with {s.label}" for s in missing)
    if total == wanted:
        rest = "; others make up for it"
        kind = f"too few with {labels}{rest}"
        return [Shortfall(first.run, first.object, kind, counts, description + rest)]
    rest = f"; {total} of {wanted} in all"
    kind = f"too few with {labels}, and in all"
    return [Shortfall(first.run, first.object, kind, counts + rest, description + rest)]


def shortfall_notes(shortfalls: Iterable[Shortfall]) -> list[str]:
    """A note for each kind of shortfall with its objects, and counts by object if they differ."""
    kinds: defaultdict[str, list[Shortfall]] = defaultdict(list)
    for shortfall in shortfalls:
        kinds[shortfall.kind].append(shortfall)
    lines = [_shortfall_line(kind, members) for kind, members in kinds.items()]
    more = len(lines) - MAX_SHORTFALL_ITEMS
    if more > 0:
        lines[MAX_SHORTFALL_ITEMS:] = [f"and {more} more such shortfalls"]
    return lines


def _shortfall_line(kind: str, members: Sequence[Shortfall]) -> str:
    same_counts = len({one.description for one in members}) == 1
    by_run: defaultdict[str, list[str]] = defaultdict(list)
    for one in members[:MAX_SHORTFALL_ITEMS]:
        by_run[one.run].append(one.object if same_counts else f"{one.object} ({one.counts})")
    where = "; ".join(f"{', '.join(objects)} of run {run}" for run, objects in by_run.items())
    more = len(members) - MAX_SHORTFALL_ITEMS
    where += f" and {more} others" if more > 0 else ""
    return f"{where}: {members[0].description or kind}" if same_counts else f"{where}: {kind}"


Chosen = list[tuple[EligibleGrasps, int, str]]
"""Chosen grasps: the pool, the index in the pool, and the key of the stratum."""


def draw_scenes(pools: list[EligibleGrasps], selection: Selection) -> list[EligibleGrasps]:
    """Draws the wanted number of scenes; returns their pools."""
    found = sorted({p.scene for p in pools}, key=lambda s: content_hash(selection.seed, "scene", s))
    if selection.scenes > len(found):
        raise InvalidInputError(
            f"{selection.scenes} scenes were asked for, but only {len(found)} have such grasps"
        )
    return [p for p in pools if not selection.scenes or p.scene in found[: selection.scenes]]


def select_grasps(
    pools: Sequence[EligibleGrasps], selection: Selection, table: Path | None
) -> tuple[dict[str, Stratum], Chosen, list[str]]:
    """Selects grasps; returns strata, chosen grasps, and notes about shortfalls."""
    strata: dict[str, Stratum] = {}
    chosen: Chosen = []
    short: list[Shortfall] = []
    unknown = 0
    for pool in pools:
        labels = stratum_labels(pool, selection, table)
        objects = pool.cells("object")
        unknown += int((labels == "").sum())
        for object_name in np.unique(objects).tolist():
            members: defaultdict[str, list[int]] = defaultdict(list)
            for k in np.flatnonzero((objects == object_name) & (labels != "")).tolist():
                members[str(labels[k])].append(k)
            if selection.balance == "outcome":
                members["success"], members["failure"]  # create both, even if empty
            if not members:
                short.append(Shortfall(pool.key, object_name, "no grasp to choose from"))
                continue
            found = _make_strata(pool, object_name, members, selection)
            strata |= found
            short += find_shortfall(list(found.values()), selection.per_object)
            for key, stratum in found.items():
                ranked = _random_order(pool, members[stratum.label], selection.seed)
                chosen += [(pool, k, key) for k in ranked[: stratum.selected]]
    notes = (
        [f"{unknown} grasps have no {selection.margin or 'probability'} and are left out"]
        if unknown
        else []
    )
    return strata, chosen, notes + shortfall_notes(short) + _rare_class_note(chosen, selection)


def take_grasps(
    pools: Sequence[EligibleGrasps], grasps: Mapping[Path, Collection[str]]
) -> tuple[dict[str, Stratum], Chosen]:
    """Takes all grasps with given ids, by the folder of their run; returns strata and grasps."""
    strata: dict[str, Stratum] = {}
    chosen: Chosen = []
    for pool in pools:
        objects = pool.cells("object")
        wanted = np.isin(pool.cells("id"), [*grasps.get(pool.run.path, ())])
        for object_name in np.unique(objects[wanted]).tolist():
            rows = np.flatnonzero(wanted & (objects == object_name)).tolist()
            key = f"{pool.key}/{object_name}/given"
            strata[key] = Stratum(
                run=pool.key,
                object=object_name,
                label="given",
                population=len(rows),
                selected=len(rows),
                wanted=len(rows),
            )
            chosen += [(pool, k, key) for k in rows]
    return strata, chosen


def _rare_class_note(chosen: Chosen, selection: Selection) -> list[str]:
    """A sentence if nearly all chosen grasps succeed, or nearly all fail."""
    rare_share = 0.1  # Share of successes or failures below which a note is added.
    pools = {pool.key: pool for pool, _, _ in chosen}
    outcomes = {key: pool.cells("outcome") for key, pool in pools.items()}
    found = [Outcome(str(outcomes[pool.key][k])) for pool, k, _ in chosen]
    good = [is_success(outcome, selection.success) for outcome in found]
    for name, count in (("failures", good.count(False)), ("successes", good.count(True))):
        if good and count < rare_share * len(good):
            return [
                f"only {count} of {len(good)} are {name} in simulation, so the trials"
                f" hardly tell how well {name} are predicted; evaluate with"
                " until_balanced=10 to get more"
            ]
    return []


def _make_strata(
    pool: EligibleGrasps,
    object_name: str,
    members: Mapping[str, Sequence[int]],
    selection: Selection,
) -> dict[str, Stratum]:
    """Strata of one object, with the number of chosen grasps."""
    first = sorted(
        members,
        key=lambda label: content_hash(selection.seed, "more", pool.scene, object_name, label),
    )
    share, remainder = divmod(selection.per_object, len(first))
    wanted = {label: share + (k < remainder) for k, label in enumerate(first)}
    populations = {label: len(indices) for label, indices in members.items()}
    selected = allocate_to_strata(populations, selection.per_object, first)
    return {
        f"{pool.key}/{object_name}/{label}": Stratum(
            run=pool.key,
            object=object_name,
            label=label,
            population=populations[label],
            selected=selected[label],
            wanted=wanted[label],
        )
        for label in sorted(members)
    }


def _random_order(pool: EligibleGrasps, members: Sequence[int], seed: int) -> list[int]:
    """Shuffles indices in a random order that follows from the grasps themselves."""
    ids = pool.cells("id")
    return sorted(members, key=lambda k: content_hash(seed, "grasp", pool.scene, str(ids[k])))
