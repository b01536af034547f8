"""The command lines that make runs again."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from burg_drake.core import option_of
from burg_drake.core.documents import load_document
from burg_drake.evaluation.records import (
    CampaignDocument,
    EvaluationSettings,
    RunDocument,
    limit_settings,
    motion_in,
    motion_options,
)
from burg_drake.evaluation.store import GRASPS_FILE, STATION_FILE, Campaign, Run
from burg_drake.station.document import StationDocument

FEW = 12
"""More scenes of one folder are written as all of its files, where they are."""


def reproduce_command(run: Run) -> str:
    """The command line that makes this run; for given grasps their file is among the run's."""
    document = run.document
    words = ["burg-drake", "evaluate", document.scene.path, "--station", document.station.path]
    words += _words(mode=document.mode)
    if document.grasps.per_object is None:
        words += ["--grasps", str(run.path / GRASPS_FILE)]
    else:
        words += _sampling(document)
    if document.grasps.only:
        words += ["--only", ",".join(document.grasps.only)]
    words += _settings(document, run.path / STATION_FILE)
    return shlex.join([*words, "-o", str(run.path)])


def reproduce_campaign_command(campaign: Campaign) -> str:
    """The command line that makes this run over many scenes; for given grasps, which it does not
    keep in one file, the one that began it."""
    document = campaign.document
    if document.grasps.per_object is None:
        return document.command
    words = ["--station", document.station.path, *_words(mode=document.mode)]
    words += _sampling(document)
    if document.grasps.only:
        words += ["--only", ",".join(document.grasps.only)]
    begun = (place.folder / STATION_FILE for place in campaign.places)
    words += _settings(document, next((path for path in begun if path.is_file()), None))
    scenes = _scenes([entry.path for entry in document.scenes])
    return f"burg-drake evaluate {scenes} {shlex.join([*words, '-o', str(campaign.path)])}"


def _scenes(paths: Sequence[str]) -> str:
    """Scenes as a shell has them; those of one folder with a star if it holds no others."""
    folders = {Path(path).parent for path in paths}
    if len(paths) > FEW and len(folders) == 1:
        (folder,) = folders
        if sorted(map(str, folder.glob("*.yaml"))) == sorted(paths):
            return f"{shlex.quote(str(folder))}/*.yaml"
    return shlex.join(paths)


def _sampling(document: RunDocument | CampaignDocument) -> list[str]:
    grasps = document.grasps
    words = _words(
        grasps_per_object=grasps.per_object,
        approach_angle_deg=grasps.approach_angle_deg,
        blind=grasps.blind,
    )
    if grasps.until_balanced:
        words += _words(
            until_balanced=grasps.until_balanced,
            balanced_among=grasps.balanced_among,
            max_grasps_per_object=grasps.max_per_object,
        )
    return words


def _settings(document: RunDocument | CampaignDocument, station: Path | None) -> list[str]:
    """Motion, engine, seed, format of the table and share; `station` is a copy of the document."""
    motion = motion_in(document.trial)
    words: list[str] = []
    if station is not None:
        usual = load_document(station, StationDocument).motion
        if document.mode == "hand" and not document.trial.get("approach"):  # begins at the grasp
            motion = replace(motion, standoff=usual.standoff)
        words += motion_options(motion, usual)
    words += _unusual(limit_settings(document.trial))
    words += _words(engine=document.engine.name, seed=document.seed)
    if document.table != EvaluationSettings.table:
        words += _words(table=document.table)
    return words + (_words(shard=document.shard) if document.shard else [])


def _unusual(asked: dict[str, Any]) -> list[str]:
    """The options of fields of `EvaluationSettings` whose values are not the usual ones."""
    unusual = {k: v for k, v in asked.items() if v != getattr(EvaluationSettings, k)}
    return _words(**unusual)


def _words(**values: Any) -> list[str]:
    """The options of fields of `EvaluationSettings` with their values; those that take none stand
    for true."""
    words: list[str] = []
    for name, value in values.items():
        option = option_of(EvaluationSettings, name)
        if isinstance(value, bool):
            words += [option] if value else []
        else:
            words += [option, str(value)]
    return words
