"""Draws grasps of each object: so many of each stratum, by chance that follows from the grasps.

The same grasps are drawn whatever the order of the runs, and of more grasps an object those of
fewer are a part.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, content_hash
from burg_drake.core.grasps import Outcome
from burg_drake.experiment.planning.eligible import EligibleGrasps
from burg_drake.experiment.planning.selection_shortfalls import (
    Shortfall,
    shortfall,
    shortfall_notes,
)
from burg_drake.experiment.planning.strata import (
    FAILURE,
    SUCCESS,
    allocate,
    even_shares,
    labels_of,
    robustness_of,
)
from burg_drake.experiment.trials import Selection, Stratum, succeeded

Chosen = list[tuple[EligibleGrasps, int, str]]
"""Grasps with the key of their stratum; a number is a place in the pool."""
RARE_CLASS_SHARE = 0.1
"""Share of the trials below which there are almost none of a class."""


def drawn_scenes(pools: list[EligibleGrasps], selection: Selection) -> list[EligibleGrasps]:
    """The pools of as many scenes as are wanted."""
    found = sorted({p.scene for p in pools}, key=lambda s: content_hash(selection.seed, "scene", s))
    if selection.scenes > len(found):
        raise InvalidInputError(
            f"{selection.scenes} scenes were asked for, but only {len(found)} have such grasps"
        )
    return [p for p in pools if not selection.scenes or p.scene in found[: selection.scenes]]


def choose(
    pools: Sequence[EligibleGrasps], selection: Selection, table: Path | None
) -> tuple[dict[str, Stratum], Chosen, list[str]]:
    """Strata, the grasps chosen, and notes about what is missing."""
    strata: dict[str, Stratum] = {}
    chosen: Chosen = []
    short: list[Shortfall] = []
    unknown = 0
    for pool in pools:
        labels = labels_of(pool, selection, lambda run: robustness_of(run, table))
        objects = pool.cells("object")
        unknown += int((labels == "").sum())
        for held in np.unique(objects).tolist():
            members: defaultdict[str, list[int]] = defaultdict(list)
            for k in np.flatnonzero((objects == held) & (labels != "")).tolist():
                members[str(labels[k])].append(k)
            if selection.balance == "outcome":
                members[SUCCESS], members[FAILURE]  # also without any
            if not members:
                short.append(Shortfall(pool.key, held, "no grasp to choose from"))
                continue
            found = _strata(pool, held, members, selection)
            strata |= found
            short += shortfall(list(found.values()), selection.per_object)
            for key, stratum in found.items():
                ranked = _ranked(pool, members[stratum.label], selection.seed)
                chosen += [(pool, k, key) for k in ranked[: stratum.selected]]
    notes = [f"{unknown} grasps have no {_balanced(selection)} and are left out"] if unknown else []
    return strata, chosen, notes + shortfall_notes(short) + _rare_class(chosen, selection)


def _rare_class(chosen: Chosen, selection: Selection) -> list[str]:
    """A sentence if nearly all chosen grasps succeed, or nearly all fail."""
    pools = {pool.key: pool for pool, _, _ in chosen}
    outcomes = {key: pool.cells("outcome") for key, pool in pools.items()}
    found = [Outcome(str(outcomes[pool.key][k])) for pool, k, _ in chosen]
    good = [succeeded(outcome, selection.success) for outcome in found]
    for name, count in (("failures", good.count(False)), ("successes", good.count(True))):
        if good and count < RARE_CLASS_SHARE * len(good):
            return [
                f"only {count} of {len(good)} are {name} in simulation, so the trials"
                f" hardly tell how well {name} are predicted; evaluate with"
                " until_balanced=10 to get more"
            ]
    return []


def _strata(
    pool: EligibleGrasps, held: str, members: Mapping[str, Sequence[int]], selection: Selection
) -> dict[str, Stratum]:
    """Strata of one object, with how many of each are chosen."""
    seed = selection.seed
    first = sorted(members, key=lambda name: content_hash(seed, "more", pool.scene, held, name))
    asked = even_shares(first, selection.per_object)
    taken = allocate({k: len(v) for k, v in members.items()}, selection.per_object, first)
    return {
        f"{pool.key}/{held}/{label}": Stratum(
            run=pool.key,
            object=held,
            label=label,
            population=len(members[label]),
            selected=taken[label],
            wanted=asked[label],
        )
        for label in sorted(members)
    }


def _balanced(selection: Selection) -> str:
    return selection.margin or "probability"


def _ranked(pool: EligibleGrasps, members: Sequence[int], seed: int) -> list[int]:
    """Places in a random order that follows from the grasps themselves."""
    ids = pool.cells("id")
    world = pool.scene
    return sorted(members, key=lambda k: content_hash(seed, "grasp", world, str(ids[k])))
