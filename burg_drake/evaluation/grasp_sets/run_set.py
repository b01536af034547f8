"""A run as a `GraspSet`: its grasps with all that is known of them as columns."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from burg_drake.core import BurgError
from burg_drake.core.documents import load_document
from burg_drake.core.grasps import INPUT_PREFIX, GraspSet
from burg_drake.evaluation.candidates import INSTANCE
from burg_drake.evaluation.grasp_sets.provenance import hand_entry, object_files
from burg_drake.evaluation.records import TEXT
from burg_drake.evaluation.store import SCENE_FILE, STATION_FILE, Run
from burg_drake.station.document import StationDocument, locate_hand

LEFT_OUT = ("id", "object", "width", "score", "X_OG", *"xyz", "qw", "qx", "qy", "qz")
"""Columns of the results that a `GraspSet` has in its own way."""


def run_grasps(run: Run) -> GraspSet:
    """All grasps of a run, in order, judged or not.

    Args:
        run: complete or not.

    Returns:
        The grasps with the column `instance` and those of the results table, see
        `evaluation.records.table`; NaN or empty for grasps that are not judged yet. What came with
        the grasps has its own name, and begins with `INPUT_PREFIX` only where the run has a column
        of that name. The identifier of a grasp is the run's without the instance. The provenance
        names the run, its copies of scene and station, and the hand, and describes the objects.
    """
    candidates, results = run.candidates, run.results
    row = {id: i for i, id in enumerate(candidates.id)}
    judged = np.array([row[id] for id in results["id"].tolist()], dtype=int)
    columns = {}
    for name, values in results.items():
        given = name.startswith(INPUT_PREFIX) and name.removeprefix(INPUT_PREFIX) not in results
        if name in LEFT_OUT or given:
            continue
        text = name in TEXT or values.dtype.kind == "U"
        filled = np.full(len(candidates), "" if text else np.nan, values.dtype if text else float)
        filled[judged] = values
        columns[name] = filled
    columns["instance"] = candidates.instance
    grasps = candidates.grasps
    return dataclasses.replace(
        grasps,
        columns={**grasps.columns, **columns},
        provenance={**grasps.provenance, **run_documents(run)},
    )


def column_called(grasps: GraspSet, name: str) -> str:
    """The column of `run_grasps` that goes by a name of the results table."""
    plain = name.removeprefix(INPUT_PREFIX)
    return plain if name not in grasps.column_names and plain in grasps.column_names else name


def run_documents(run: Run) -> dict[str, Any]:
    """What the provenance of a run's grasps names; without the hand and the objects where those
    are gone or have changed since."""
    folder = run.path.resolve()
    named: dict[str, Any] = {
        "run": str(folder),
        "scene": str(folder / SCENE_FILE),
        "station": str(folder / STATION_FILE),
    }
    with contextlib.suppress(BurgError):
        document = load_document(folder / STATION_FILE, StationDocument)
        hand, _, path = locate_hand(document.hand, folder)
        named["hand"] = hand_entry(hand, path)
    with contextlib.suppress(BurgError):
        scene = run.scene()
        objects = sorted({instance.object for instance in scene.instances.values()})
        named["object_files"] = object_files(scene.library, objects)
    return named


def of_instances(grasps: GraspSet) -> dict[str, GraspSet]:
    """Grasps of a file that names instances, each set with its own provenance."""
    owner = grasps.columns[INSTANCE]
    given = grasps.provenance.get("parts")
    parts = given if isinstance(given, Mapping) else {}
    rest = without_instance(grasps)
    found = {}
    for name in dict.fromkeys(owner.tolist()):
        part = parts.get(name)
        provenance = part if isinstance(part, Mapping) else {}
        found[name] = dataclasses.replace(rest.select(owner == name), provenance=provenance)
    return found


def without_instance(grasps: GraspSet) -> GraspSet:
    """The same grasps without the column that candidates have in their own way."""
    columns = {name: values for name, values in grasps.columns.items() if name != INSTANCE}
    return dataclasses.replace(grasps, columns=columns)
