"""Grasps to work on: a file of any project, or the folder of a run; and the hand they are for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import GraspSet, parts_of
from burg_drake.core.paths import is_resolved
from burg_drake.evaluation.grasp_sets.pose_mistakes import check_corrections, corrected
from burg_drake.evaluation.grasp_sets.run_set import run_documents, run_grasps
from burg_drake.evaluation.records import is_table
from burg_drake.evaluation.store import load_run
from burg_drake.formats import FORMATS, format_of, read_grasp_file
from burg_drake.formats.common import PANDA, Gripper, ImportedGrasps

OURS = "burg_drake"
"""The format in which sets name their hand."""


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
        format: of the file; None to tell by the content.
        gripper: the hand that grasps are taken for; the Panda's if None, without a note where
            they name another one.
        correction: mistakes of the file that are made up for, see `pose_mistakes`.

    Returns:
        The grasps; their provenance names the hand.

    Raises:
        InvalidInputError: the file cannot be read, or is the table of a run.
        UnknownNameError: there is no such format or correction.
    """
    path = Path(path)
    correction = check_corrections(correction)
    if path.is_dir():
        imported = ImportedGrasps(run_grasps(load_run(path)), "object")
    elif is_table(path):
        raise InvalidInputError(
            f"{path} is the table of a run; give the run's folder, which has its grasps and"
            " their outcomes"
        )
    else:
        imported = read_grasp_file(path, format, gripper or PANDA)
    imported = corrected(imported, gripper or PANDA, correction)
    hand = hand_of(imported.grasps)
    if hand is None:
        if path.is_dir() or (format or format_name(path)) == OURS:
            return imported
        provenance = {**imported.grasps.provenance, "hand": {"name": (gripper or PANDA).name}}
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
    """Name of the format that a file's content is of; a run's grasps are in ours."""
    return OURS if Path(path).is_dir() else format_of(path).name


def hand_of(grasps: GraspSet) -> dict[str, str] | None:
    """The hand that a set is for: its name and, where it is known, the path of its document."""
    hands = _hands(grasps.provenance)
    return hands[0] if len({hand["name"] for hand in hands}) == 1 else None


def _hands(provenance: Mapping[str, Any]) -> list[dict[str, str]]:
    """The hand that a provenance names, or else those of its parts."""
    hand = provenance.get("hand")
    if isinstance(hand, Mapping) and isinstance(hand.get("name"), str):
        return [{key: value for key, value in hand.items() if isinstance(value, str)}]
    return [hand for part in parts_of(provenance) for hand in _hands(part)]


def hand_reference(path: str | Path) -> str | None:
    """Document or built-in name of the hand that a run, or a file of ours, is for; None if neither
    tells it."""
    path = Path(path)
    hand: dict[str, str] | None
    if path.is_dir():
        hand = run_documents(load_run(path)).get("hand")
    else:
        grasps = _ours(path)
        hand = None if grasps is None else hand_of(grasps)
    if hand is None:
        return None
    document = hand.get("document")
    there = document is not None and is_resolved(document) and Path(document).is_file()
    return document if there else hand["name"]


def station_reference(path: str | Path) -> str | None:
    """Document of the station of a run, or of the one that a file of ours was sampled for; None if
    neither tells it."""
    path = Path(path)
    if path.is_dir():
        return str(run_documents(load_run(path))["station"])
    grasps = _ours(path)
    station = None if grasps is None else grasps.provenance.get("station")
    return station if isinstance(station, str) else None


def _ours(path: Path) -> GraspSet | None:
    """The grasps of a file of ours."""
    is_ours = path.is_file() and FORMATS[OURS].recognises(path)
    return GraspSet.load(path) if is_ours else None
