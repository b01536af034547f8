"""Reads grasps from a file of any project or the folder of a run, with their hand."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    INPUT_PREFIX,
    BurgError,
    GraspSet,
    InvalidInputError,
    Outcome,
    UnknownNameError,
    is_resolved,
    load_document,
    provenance_parts,
    software_versions,
    suggest_names,
)
from burg_drake.evaluation.candidates import INSTANCE_COLUMN, without_instance
from burg_drake.evaluation.grasp_sets.pose_mistakes import check_corrections, correct_grasps
from burg_drake.evaluation.results_table import TEXT_COLUMNS
from burg_drake.evaluation.run_folder import SCENE_FILE, STATION_FILE, Run, load_run
from burg_drake.evaluation.table_file import is_table
from burg_drake.evaluation.trial_origin import effective_numbers, protocol_of
from burg_drake.formats import (
    GRASP_FORMATS,
    GRASP_SUCCESS_COLUMN,
    LABELLED_BY,
    PANDA_GRIPPER,
    Gripper,
    ImportedGrasps,
    format_of,
    read_grasp_file,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Scene
from burg_drake.station import Hand, Station, StationDocument, locate_hand
from burg_drake.visualization import OUTCOME_GROUPS, outcome_group


def set_documents(
    library: ObjectLibrary, scene: Scene | None, station: Station, objects: Iterable[str]
) -> dict[str, Any]:
    """Documents, their content, and versions of the software, as JSON values.

    Args:
        library: library with the objects.
        scene: scene of the objects, named in place of the library.
        station: station with the hand.
        objects: names of the objects with grasps.
    """
    kind, document = ("library", library.root) if scene is None else ("scene", scene.path)
    return {
        kind: str(document.resolve()),
        "station": str(station.path.resolve()),
        "hand": hand_entry(station.hand, station.hand_path),
        "content": {
            **({} if scene is None else {"scene": scene.content}),
            "station": station.content,
            "objects": {name: library.entry(name).build for name in objects},
        },
        "versions": software_versions(),
    }


def hand_entry(hand: Hand, document: Path | None) -> dict[str, str]:
    """The entry of a hand in a provenance."""
    return {"name": hand.name, **({"document": str(document.resolve())} if document else {})}


def object_files(library: ObjectLibrary, objects: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Mesh and physics of objects, with the keys of `formats.grasp_conversion`."""
    entries = {name: library.entry(name) for name in objects}
    return {
        name: {
            "file": str(library.path(entry.surface or entry.mesh).resolve()),
            "scale": 1.0,
            "mass": entry.mass,
            "com": list(entry.mass_properties.center_of_mass),
            "friction": entry.friction,
        }
        for name, entry in entries.items()
    }


def run_grasps(run: Run) -> GraspSet:
    """All grasps of a run, in order, judged or not.

    Args:
        run: complete or not.

    Returns:
        The grasps with the column `instance` and the columns of the results table, see
        `evaluation.results_table`; NaN or empty for grasps that are not judged yet. Columns of
        given grasps keep their names, prefixed with `INPUT_PREFIX` if the run has a column of that
        name, or if they are labels. The identifier of a grasp is the run's without the instance.
        The provenance names the run, its copies of scene and station, the hand, and what labelled
        the grasps, and describes the objects.
    """
    # Columns of the results that are attributes of a grasp set.
    own_columns = ("id", "object", "width", "score", "X_OG", *"xyz", "qw", "qx", "qy", "qz")
    candidates, results = run.candidates, run.results
    row = {id: i for i, id in enumerate(candidates.id)}
    judged = np.array([row[id] for id in results["id"].tolist()], dtype=int)
    columns = {}
    for name, values in results.items():
        given = name.startswith(INPUT_PREFIX) and name.removeprefix(INPUT_PREFIX) not in results
        if name in own_columns or given:
            continue
        text = name in TEXT_COLUMNS or values.dtype.kind == "U"
        filled = np.full(len(candidates), "" if text else np.nan, values.dtype if text else float)
        filled[judged] = values
        columns[name] = filled
    columns["instance"] = candidates.instance
    grasps, given_columns = candidates.grasps, dict(candidates.grasps.columns)
    if GRASP_SUCCESS_COLUMN in given_columns:  # the label is the outcome of the run
        given_columns[f"{INPUT_PREFIX}{GRASP_SUCCESS_COLUMN}"] = given_columns.pop(
            GRASP_SUCCESS_COLUMN
        )
    engines = sorted(set(results["engine"].tolist())) or [run.document.engine.name]
    labelled_by = {
        "engine": ", ".join(engines),
        "protocol": protocol_of(run.document.trial),
        "mode": run.document.mode,
        "trial": effective_numbers(run.document.trial),
        "versions": run.document.versions,
    }
    return dataclasses.replace(
        grasps,
        columns={**given_columns, **columns},
        provenance={**grasps.provenance, **run_documents(run), LABELLED_BY: labelled_by},
    )


def result_column(grasps: GraspSet, name: str) -> str:
    """The column of `run_grasps` for a column name of the results table."""
    plain = name.removeprefix(INPUT_PREFIX)
    return plain if name not in grasps.column_names and plain in grasps.column_names else name


def run_documents(run: Run) -> dict[str, Any]:
    """Documents for the provenance of a run's grasps; without hand and objects if their files are
    gone or have changed.
    """
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


def split_by_instance(grasps: GraspSet) -> dict[str, GraspSet]:
    """Splits grasps of a file by instance, each set with its own provenance."""
    owner = grasps.columns[INSTANCE_COLUMN]
    given = grasps.provenance.get("parts")
    parts = given if isinstance(given, Mapping) else {}
    rest = without_instance(grasps)
    names, begins = np.unique(owner, return_index=True)
    found = {}
    for name in names[np.argsort(begins)].tolist():
        part = parts.get(name)
        provenance = part if isinstance(part, Mapping) else {}
        rows = np.flatnonzero(owner == name)
        together = len(rows) == rows[-1] + 1 - rows[0]
        own = rest.select(slice(rows[0], rows[-1] + 1) if together else rows)
        found[name] = dataclasses.replace(own, provenance=provenance)
    return found


OWN_FORMAT = "burg_drake"
"""Format in which sets name their hand."""


def read_input(
    path: str | Path,
    format: str | None = None,
    gripper: Gripper | None = None,
    correction: Iterable[str] = (),
) -> ImportedGrasps:
    """Reads grasps.

    Args:
        path: a file of any format in `formats.grasp_files`, or the folder of a run, whose grasps
            come with their outcomes, see `run_grasps`.
        format: format of the file; None to detect it by content.
        gripper: hand that grasps are taken for; the Panda's if None, without a note if the file
            names another hand.
        correction: corrections of mistakes in the file, see `pose_mistakes`.

    Returns:
        The grasps; their provenance names the hand.

    Raises:
        InvalidInputError: the file cannot be read, or is the table of a run.
        UnknownNameError: the format or correction does not exist.
    """
    path, hand_taken = Path(path), gripper or PANDA_GRIPPER
    correction = check_corrections(correction)
    if path.is_dir():
        imported = ImportedGrasps(run_grasps(load_run(path)), "object")
    elif is_table(path):
        raise InvalidInputError(
            f"{path} is the table of a run; give the run's folder, which has its grasps and"
            " their outcomes"
        )
    else:
        imported = read_grasp_file(path, format, hand_taken)
    imported = correct_grasps(imported, hand_taken, correction)
    hand = hand_of(imported.grasps)
    if hand is None:
        if path.is_dir() or (format or format_name(path)) == OWN_FORMAT:
            return imported
        provenance = {**imported.grasps.provenance, "hand": {"name": hand_taken.name}}
        grasps = dataclasses.replace(imported.grasps, provenance=provenance)
        return dataclasses.replace(imported, grasps=grasps)
    if gripper is None or hand["name"] == gripper.name:
        return imported
    note = (
        f"The grasps were made for hand {hand['name']!r}; they are judged as those of hand "
        f"{gripper.name!r}."
    )
    return dataclasses.replace(imported, notes=(*imported.notes, note))


def format_name(path: str | Path) -> str:
    """Name of a file's format by its content; a run's grasps have our own format."""
    return OWN_FORMAT if Path(path).is_dir() else format_of(path).name


def hand_of(grasps: GraspSet) -> dict[str, str] | None:
    """The hand of a set: its name and, if known, the path of its document."""
    hands = _named_hands(grasps.provenance)
    return hands[0] if len({hand["name"] for hand in hands}) == 1 else None


def _named_hands(provenance: Mapping[str, Any]) -> list[dict[str, str]]:
    """The hand named in a provenance, or else the hands of its parts."""
    hand = provenance.get("hand")
    if isinstance(hand, Mapping) and isinstance(hand.get("name"), str):
        return [{key: value for key, value in hand.items() if isinstance(value, str)}]
    return [hand for part in provenance_parts(provenance) for hand in _named_hands(part)]


def hand_reference(path: str | Path) -> str | None:
    """Document or built-in name of the hand of a run or of a file in our own format; None if
    unknown.
    """
    path = Path(path)
    hand: dict[str, str] | None
    if path.is_dir():
        hand = run_documents(load_run(path)).get("hand")
    else:
        grasps = _read_own_format(path)
        hand = None if grasps is None else hand_of(grasps)
    if hand is None:
        return None
    document = hand.get("document")
    there = document is not None and is_resolved(document) and Path(document).is_file()
    return document if there else hand["name"]


def station_reference(path: str | Path) -> str | None:
    """Document of the station of a run, or of the station that a file in our own format was sampled
    for; None if unknown.
    """
    path = Path(path)
    if path.is_dir():
        return str(run_documents(load_run(path))["station"])
    grasps = _read_own_format(path)
    station = None if grasps is None else grasps.provenance.get("station")
    return station if isinstance(station, str) else None


def _read_own_format(path: Path) -> GraspSet | None:
    """Reads a file in our own format."""
    is_ours = path.is_file() and GRASP_FORMATS[OWN_FORMAT].recognises(path)
    return GraspSet.load(path) if is_ours else None


@dataclass(frozen=True, eq=False)
class RankedGrasps:
    """Ranking of grasps, best first.

    Attributes:
        order: (N,) indices of the grasps.
        by: displayed criterion of the ranking; empty if there is none.
    """

    order: NDArray[np.int64]
    by: str


def rank_run_grasps(run: Run, grasps: GraspSet) -> RankedGrasps:
    """Ranks grasps of a run: lifted ones as in `Run.best`, then all others by outcome group.

    The groups have the order of the legends: held, lost, not executed.

    Args:
        run: the run.
        grasps: the run's grasps as a set.
    """
    row = {id: i for i, id in enumerate(run.candidates.id)}
    best = [row[id] for id in run.best(len(row))]
    outcomes = grasps.column("outcome").tolist()
    groups = [outcome_group(Outcome(text) if text else None) for text in outcomes]
    ranks = [
        OUTCOME_GROUPS.index(group) if group in OUTCOME_GROUPS else len(OUTCOME_GROUPS)
        for group in groups
    ]
    rest = np.argsort(ranks, kind="stable")
    order = np.concatenate([np.array(best, dtype=np.int64), rest[~np.isin(rest, best)]])
    return RankedGrasps(order, "outcome, lifted ones by the room around the hand")


def rank_by_score(grasps: GraspSet) -> RankedGrasps:
    """Ranks grasps of a set by score; unknown scores come last."""
    if not np.isfinite(grasps.score).any():
        return RankedGrasps(np.arange(len(grasps)), "")
    order = np.argsort(-np.where(np.isfinite(grasps.score), grasps.score, -np.inf), kind="stable")
    quality = grasps.provenance.get("quality")
    by = quality.get("by") if isinstance(quality, dict) else None
    return RankedGrasps(order, f"score ({by})" if by else "score")


def best_of_each(
    owner: NDArray[np.str_], among: NDArray[np.bool_], ranking: RankedGrasps, most: int | None
) -> list[int]:
    """The best grasps of each object, best first; evenly spaced ones if there is no ranking.

    Args:
        owner: (N,) object or instance of each grasp.
        among: (N,) which grasps to choose from.
        ranking: ranking of all N grasps.
        most: maximum number for each object; all if None.

    Returns:
        Indices of the grasps, object by object in the order of the set.
    """
    chosen: list[int] = []
    for name in dict.fromkeys(owner[among].tolist()):
        members = ranking.order[(among & (owner == name))[ranking.order]]
        count = len(members) if most is None else min(len(members), most)
        picked = range(count) if ranking.by else (k * len(members) // count for k in range(count))
        chosen += [int(members[k]) for k in picked]
    return chosen


def grasp_index(grasps: GraspSet, id: str, where: str) -> int:
    """Index of a grasp by its identifier, with or without the instance as prefix.

    Raises:
        UnknownNameError: no grasp, or grasps of several instances, have this identifier.
    """
    names = shown_ids(grasps)
    if id in names:
        return names.index(id)
    same = [k for k, own in enumerate(grasps.id.tolist()) if own == id]
    if len(same) == 1:
        return same[0]
    known = [names[k] for k in same] or names
    raise UnknownNameError(f"{where} has no grasp {id!r}; {suggest_names(id, known)}")


def shown_ids(grasps: GraspSet) -> list[str]:
    """Identifiers as in tables of results, with the instance as prefix if there is one."""
    if "instance" not in grasps.columns:
        return [str(id) for id in grasps.id]
    instances = grasps.column("instance").tolist()
    return [f"{name}-{id}" for name, id in zip(instances, grasps.id.tolist(), strict=True)]
