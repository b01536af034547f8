"""The last sections of a report: command that repeats the run, inputs, settings, versions."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from burg_drake.core import (
    ONE_BY_ONE,
    count_with_noun,
    format_duration,
    load_document,
    option_name,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.journal import JOURNAL_FILE
from burg_drake.evaluation.report.page_elements import ReportSection
from burg_drake.evaluation.run_document import (
    HASH_DIGITS,
    CampaignDocument,
    Input,
    RunDocument,
    devices_of,
    one_by_one_text,
)
from burg_drake.evaluation.run_folder import GRASPS_FILE, RUN_FILE, STATION_FILE, Run
from burg_drake.evaluation.settings import DEFAULT_LIMITS, EvaluationSettings
from burg_drake.evaluation.trial_origin import (
    engine_label,
    limit_settings,
    motion_options,
    read_motion,
    recorded_motion_text,
    without_motion,
)
from burg_drake.station import ENGINES, Engine, StationDocument


def reproduce_command(run: Run) -> str:
    """Command line that repeats a run; given grasps come from the run's copy."""
    document = run.document
    grasps = _sampling_options(document) or ["--grasps", str(run.path / GRASPS_FILE)]
    words = _command_words(document, grasps, run.path / STATION_FILE)
    return shlex.join(["burg-drake", "evaluate", document.scene.path, *words, "-o", str(run.path)])


def reproduce_campaign_command(campaign: Campaign) -> str:
    """Command line that repeats a run over many scenes.

    For given grasps it is the command that began the run, which keeps no single file of them.
    """
    document = campaign.document
    grasps = _sampling_options(document)
    if not grasps:
        return document.command
    begun = (stored.folder / STATION_FILE for stored in campaign.stored_runs)
    station = next((path for path in begun if path.is_file()), None)
    words = [*_command_words(document, grasps, station), "-o", str(campaign.path)]
    scenes = _scene_words([entry.path for entry in document.scenes])
    return f"burg-drake evaluate {scenes} {shlex.join(words)}"


def _command_words(
    document: RunDocument | CampaignDocument, grasps: list[str], station: Path | None
) -> list[str]:
    """The options of a command; `station` is a copy of the station's document."""
    words = ["--station", document.station.path, *_option_words(mode=document.mode), *grasps]
    if document.grasps.only:
        words += ["--only", ",".join(document.grasps.only)]
    return words + _settings_options(document, station)


def _scene_words(paths: Sequence[str]) -> str:
    """Scene paths for a shell, with a wildcard if they are all scenes of a folder."""
    max_paths = 12  # More scenes of one folder are written with a wildcard.
    folders = {Path(path).parent for path in paths}
    if len(paths) > max_paths and len(folders) == 1:
        (folder,) = folders
        if sorted(map(str, folder.glob("*.yaml"))) == sorted(paths):
            return f"{shlex.quote(str(folder))}/*.yaml"
    return shlex.join(paths)


def _sampling_options(document: RunDocument | CampaignDocument) -> list[str]:
    """Options of the sampling; none if grasps were given."""
    grasps = document.grasps
    if grasps.per_object is None:
        return []
    words = _option_words(
        grasps_per_object=grasps.per_object,
        approach_angle_deg=grasps.approach_angle_deg,
        blind=grasps.blind,
    )
    if grasps.until_balanced:
        words += _option_words(
            until_balanced=grasps.until_balanced,
            balanced_among=grasps.balanced_among,
            max_grasps_per_object=grasps.max_per_object,
        )
    return words


def _settings_options(document: RunDocument | CampaignDocument, station: Path | None) -> list[str]:
    """Motion, engine, seed, format of the table and share; `station` is a copy of the document."""
    motion = read_motion(document.trial)
    words: list[str] = []
    if station is not None:
        usual = load_document(station, StationDocument).motion
        if document.mode == "hand" and not document.trial.get("approach"):  # starts at the grasp
            motion = replace(motion, standoff=usual.standoff)
        words += motion_options(motion, usual)
    limits = limit_settings(document.trial)
    usual_limits = vars(DEFAULT_LIMITS[limits["protocol"]])
    unusual = {
        name: value
        for name, value in limits.items()
        if value != usual_limits.get(name, getattr(EvaluationSettings, name))
    }
    words += _option_words(**unusual, engine=document.engine.name, seed=document.seed)
    if document.table != EvaluationSettings.table:
        words += _option_words(table=document.table)
    return words + (_option_words(shard=document.shard) if document.shard else [])


def _option_words(**values: Any) -> list[str]:
    """Options of the fields of `EvaluationSettings` with their values; options without value mean
    true.
    """
    words: list[str] = []
    for name, value in values.items():
        option = option_name(EvaluationSettings, name)
        if isinstance(value, bool):
            words += [option] if value else []
        else:
            words += [option, str(value)]
    return words


MODE_MEANINGS = {
    "hand": "the hand alone executes each grasp in simulation",
    "reach": "the hand alone executes the grasps that the arm can execute",
    "arm": "the whole arm executes the grasps, from the pregrasp on",
}
"""Description of each mode's checks."""


def repeat_section(run: Run) -> ReportSection:
    """Section with the command that repeats the results, and the settings that affect them."""
    document = run.document
    facts = [
        ("scene", _content_text(document.scene)),
        *_common_facts(document),
        ("run", f"{document.hash} (hash of all of the above; column run of the table)"),
    ]
    line = reproduce_command(run)
    return ReportSection("How to repeat it", _repeat_note(document), command=line, facts=facts)


def provenance_section(run: Run) -> ReportSection:
    """Section with all inputs and their hashes, settings, versions, sessions and files."""
    document = run.document
    files = (
        f"{run.table_path.name} (the table), {RUN_FILE} (this section in full),"
        f" {GRASPS_FILE} (poses), {JOURNAL_FILE} (the record)"
    )
    facts = [*_input_facts(document), *_setting_facts(document), *_session_facts(document)]
    facts.append(("files", files))
    text = "All inputs, the sessions in which the grasps were judged, and the files of the folder."
    return ReportSection("All settings and versions", text, facts=facts)


def repeat_campaign_section(campaign: Campaign) -> ReportSection:
    """Section with the command that began a run over many scenes, and the settings behind it."""
    document = campaign.document
    scenes = [entry.path for entry in document.scenes]
    text = (
        "The results depend on the inputs, the seed and the versions below. They do not"
        " depend on the number of workers, machines or shards, or the order of their"
        " work."
    )
    facts = [
        ("scenes", f"{len(scenes)}, their contents in campaign.yaml"),
        *_common_facts(document),
        ("run", f"{document.hash} (hash of all of that)"),
    ]
    line = reproduce_campaign_command(campaign)
    return ReportSection("How to repeat it", text, command=line, facts=facts)


def campaign_provenance_section(campaign: Campaign) -> ReportSection:
    """Section with all settings, versions and workers of a run over many scenes."""
    document = campaign.document
    facts = [
        (f"library {Path(folder).name}", f"{folder}, content {content[:HASH_DIGITS]}")
        for folder, content in document.libraries.items()
    ]
    facts += [*_setting_facts(document), *_session_facts(document)]
    text = "All inputs except the scenes, and the sessions in which the grasps were judged."
    return ReportSection("All settings and versions", text, facts=facts)


def _common_facts(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    """The most important settings."""
    # Software whose versions are listed first, beside the engine's.
    packages = ("burg_drake", "drake", "python")
    approach = "; its approach is simulated" if document.trial.get("approach") else ""
    names = (*packages, *document.engine.packages)
    devices = [*devices_of(document), one_by_one_text(document.stretches)]
    device = "; ".join(text for text in devices if text)
    return [
        ("station", _content_text(document.station)),
        ("mode", f"{document.mode}: {MODE_MEANINGS[document.mode]}{approach}"),
        ("motion", recorded_motion_text(document.trial)),
        ("engine", engine_label(document.engine)),
        ("seed", str(document.seed)),
        ("versions", ", ".join(f"{n} {document.versions.get(n, '?')}" for n in names)),
        *([("device", device)] if device else []),
    ]


def _content_text(given: Input) -> str:
    return f"{given.path}, content {given.content[:HASH_DIGITS]}"


def _repeat_note(document: RunDocument) -> str:
    preset = document.engine in ENGINES.values()
    by_hand = "" if preset else " The engine is not a preset; pass it to `evaluate` in Python."
    return (
        "The results depend on the inputs, the seed and the versions below, and not on"
        " the number of workers or the order of their work. In a complete folder the"
        f" command returns at once; give another -o to judge again.{by_hand} In the table"
        " of results x, y, z and qw to qz are the pose of the grasp frame G in the"
        " object frame O; the file next to it describes every column."
    )


def _input_facts(document: RunDocument) -> list[tuple[str, str]]:
    library = document.library
    grasps = document.grasps
    return [
        ("scene", _content_text(document.scene)),
        ("station", _content_text(document.station)),
        ("object library", f"{library.name} ({library.path})"),
        *(
            (f"object {name}", f"build {build[:HASH_DIGITS]}")
            for name, build in library.objects.items()
        ),
        ("grasps", f"{grasps.count} {grasps.origin}, content {grasps.content[:HASH_DIGITS]}"),
    ]


def _setting_facts(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    engine = document.engine
    return [
        ("engine", f"{engine_label(engine)}: {_engine_text(engine)}"),
        ("motion", recorded_motion_text(document.trial)),
        ("trial", _settings_list(without_motion(document.trial))),
        ("mode", document.mode),
        ("arm", _settings_list(without_motion(document.arm)) if document.arm else "not asked"),
        ("seed", str(document.seed)),
        ("run", f"{document.hash} (all of the above; column run of the table)"),
        *document.versions.items(),
    ]


def _engine_text(engine: Engine) -> str:
    """All settings of an engine, by name."""
    texts = []
    for name, value in vars(engine).items():
        text = str(value).replace("_", " ")
        if isinstance(value, bool):
            text = "yes" if value else "no"
        elif isinstance(value, float):
            text = format_duration(value)
        if name != "name":
            texts.append(f"{name.replace('_', ' ')} {text}")
    return ", ".join(texts)


def _settings_list(settings: dict[str, float]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in settings.items())


def _session_facts(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    lines = []
    for session in document.stretches:
        judged = "interrupted" if session.judged is None else f"{session.judged} grasps"
        took = "" if session.seconds is None else f" in {format_duration(session.seconds)}"
        text = f"{session.started}: {judged}{took}, {count_with_noun(session.workers, 'worker')}"
        devices = [name for name in session.executed if name != ONE_BY_ONE] or [session.device]
        text += f", on {'; '.join(devices)}" if any(devices) else ""
        if one_by_one := one_by_one_text([session]):
            text += f"; {one_by_one}"
        lines.append(("judged", text))
    return [*lines, ("command", document.command)]
