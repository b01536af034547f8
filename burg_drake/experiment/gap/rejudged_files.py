"""What re-judging leaves in its folder beside the journal: scenes, a table and figures.

rejudged.csv      one row a trial: planned, as measured, real; a row can be replayed
rejudged.json     the figures
scenes/NNN.yaml   the scene of trial NNN as it was measured
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.files import atomic_write
from burg_drake.core.paths import portable_reference
from burg_drake.evaluation.records import (
    HASH_DIGITS,
    Columns,
    RecordedTrial,
    trial_columns,
    write_table,
)
from burg_drake.experiment.gap.rejudged_trials import CAUSES, Rejudged, Rejudging
from burg_drake.scene.document import save_scene

TABLE_FILE = "rejudged.csv"
JSON_FILE = "rejudged.json"
SCENES = "scenes"


def scene_file(trial: Rejudged, folder: Path) -> Path:
    """Where the scene of a trial is written."""
    return folder / SCENES / f"{trial.number:03d}.yaml"


def write_rejudging(found: Rejudging) -> None:
    """Writes scenes, table and figures.

    Raises:
        InvalidInputError: a file cannot be written.
    """
    for trial in found.trials:
        if trial.scene is not None:
            path = scene_file(trial, found.path)
            library = portable_reference(trial.scene.library.root, path.parent)
            path.parent.mkdir(exist_ok=True)
            save_scene(replace(trial.scene.document, library=library), path)
    rows = [row for trial in found.trials if (row := _row(trial, found)) is not None]
    if rows:
        write_table(found.path / TABLE_FILE, joined(rows))
    atomic_write(found.path / JSON_FILE, json.dumps(rejudging_json(found), indent=1) + "\n")


def _row(trial: Rejudged, found: Rejudging) -> Columns | None:
    """The table of one trial; nothing of one that no judge has seen."""
    if trial.scene is None or trial.candidate is None or trial.verdict is None:
        return None
    origin = replace(
        trial.origin,
        scene=str(scene_file(trial, found.path)),
        scene_content=trial.scene.content[:HASH_DIGITS],
        run="",
    )
    one = RecordedTrial(
        id=trial.grasp,
        instance=trial.instance,
        object=trial.object,
        X_OG=trial.candidate.X_OG,
        width=trial.candidate.width,
        verdict=trial.verdict,
    )
    joints = len(trial.verdict.q_grasp)
    columns = trial_columns([one], origin, instances=list(trial.scene.instances), joints=joints)
    values = {
        "trial": trial.number,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "cause": trial.cause(found.success) or "",
        "notes": "; ".join(trial.notes),
    }
    return {name: np.array([value]) for name, value in values.items()} | columns


def joined(tables: list[Columns]) -> Columns:
    """Tables one below the other; what one of them lacks is NaN or empty there."""
    names = dict.fromkeys(name for table in tables for name in table)
    kinds = {n: next(t[n].dtype.kind for t in tables if n in t) for n in names}

    def part(table: Columns, name: str) -> Any:
        if name in table:
            return table[name]
        return np.full(len(table["id"]), "" if kinds[name] == "U" else np.nan)

    return {name: np.concatenate([part(table, name) for table in tables]) for name in names}


def rejudging_json(found: Rejudging) -> dict[str, Any]:
    """The figures as JSON values."""
    count = len(found.predictable)
    return {
        "success": found.success,
        "judged": len(found.judged),
        "unpredictable": found.causes["unpredictable"],
        "agree": {
            name: _share(*found.agreement(measured=measured), count)
            for name, measured in (("planned", False), ("measured", True))
        },
        "precision": {
            name: {
                which: dict(zip(("count", "of"), shares, strict=True))
                for which, every in (("all", True), ("predictable", False))
                for shares in [found.precision(measured=measured, every=every)]
            }
            for name, measured in (("planned", False), ("measured", True))
        },
        "causes": {cause: found.causes[cause] for cause in CAUSES},
        "explained": dict(zip(("count", "of", "low", "high"), found.explained, strict=True)),
        "mcnemar_p": found.paired.p_value,
        "table": [
            {"planned": p, "measured": m, "real": r, "count": n}
            for (p, m, r), n in sorted(found.table.items())
        ],
        "trials": [_trial_json(trial, found) for trial in found.trials],
        "skipped": {str(number): why for number, why in found.skipped.items()},
    }


def _share(count: int, low: float, high: float, whole: int) -> dict[str, float]:
    return {"count": count, "of": whole, "low": low, "high": high}


def _trial_json(trial: Rejudged, found: Rejudging) -> dict[str, Any]:
    return {
        "number": trial.number,
        "run": trial.run,
        "grasp": trial.grasp,
        "object": trial.object,
        "real": trial.real.value,
        "planned": trial.planned.value,
        "measured": None if trial.outcome is None else trial.outcome.value,
        "cause": trial.cause(found.success),
        "why_not": trial.why_not,
        "notes": list(trial.notes),
    }
