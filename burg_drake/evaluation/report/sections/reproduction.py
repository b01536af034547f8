"""The report's last sections: how to get the same results again, and what made them."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core.terminal import format_duration
from burg_drake.evaluation.records import (
    HASH_DIGITS,
    CampaignDocument,
    RunDocument,
    engine_label,
    motion_in,
    motion_text,
    without_motion,
)
from burg_drake.evaluation.report.elements import (
    Html,
    command,
    element,
    folded,
    join,
    section,
)
from burg_drake.evaluation.report.sections.commands import (
    reproduce_campaign_command,
    reproduce_command,
)
from burg_drake.evaluation.store import GRASPS_FILE, JOURNAL_FILE, RUN_FILE, Campaign, Run
from burg_drake.station.document import ENGINES, Engine

ASKED = {
    "hand": "the hand alone executes each grasp in simulation",
    "reach": "the hand alone executes the grasps that the arm can execute",
    "arm": "the whole arm executes the grasps, from the pregrasp on",
}
"""What a mode asks of each grasp."""
DECIDING = ("burg_drake", "drake", "python")
"""Software whose version people ask for first, beside that of the engine."""


def repeat_section(run: Run) -> Html:
    """The command that makes the same results again, and the settings that decide about them."""
    document = run.document
    facts = [
        ("scene", f"{document.scene.path}, content {document.scene.content[:HASH_DIGITS]}"),
        *_common(document),
        ("run", f"{document.hash} (hash of all of the above; column run of the table)"),
    ]
    return section(
        "How to repeat it", _text(document), command(reproduce_command(run)), _list(facts)
    )


def provenance(run: Run) -> Html:
    """All inputs with their hashes, settings, versions, sessions and files."""
    facts = [*_inputs(run.document), *_settings(run.document), *_sessions(run.document)]
    files = (
        f"{run.table_path.name} (the table), {RUN_FILE} (this section in full),"
        f" {GRASPS_FILE} (poses), {JOURNAL_FILE} (the record)"
    )
    text = "All inputs, the sessions in which the grasps were judged, and the files of the folder."
    return folded("All settings and versions", text, _list([*facts, ("files", files)]))


def repeat_campaign(campaign: Campaign) -> Html:
    """The command that began a run over many scenes, and the settings that decide about it."""
    document = campaign.document
    scenes = [entry.path for entry in document.scenes]
    text = (
        "The results depend on the inputs, the seed and the versions below. They do not"
        " depend on the number of workers, machines or shards, or the order of their"
        " work."
    )
    facts = [
        ("scenes", f"{len(scenes)}, their contents in campaign.yaml"),
        *_common(document),
        ("run", f"{document.hash} (hash of all of that)"),
    ]
    return section(
        "How to repeat it", text, command(reproduce_campaign_command(campaign)), _list(facts)
    )


def campaign_facts(campaign: Campaign) -> Html:
    """All settings, versions, and who worked on a run over many scenes."""
    document = campaign.document
    facts = [
        *(
            (f"library {Path(folder).name}", f"{folder}, content {content[:HASH_DIGITS]}")
            for folder, content in document.libraries.items()
        ),
        *_settings(document),
        *_sessions(document),
    ]
    text = "All inputs except the scenes, and the sessions in which the grasps were judged."
    return folded("All settings and versions", text, _list(facts))


def _common(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    """Settings that people ask for first."""
    approach = "; its approach is simulated" if document.trial.get("approach") else ""
    names = (*DECIDING, *document.engine.packages)
    return [
        ("station", f"{document.station.path}, content {document.station.content[:HASH_DIGITS]}"),
        ("mode", f"{document.mode}: {ASKED[document.mode]}{approach}"),
        ("motion", motion_text(motion_in(document.trial))),
        ("engine", engine_label(document.engine)),
        ("seed", str(document.seed)),
        ("versions", ", ".join(f"{n} {document.versions.get(n, '?')}" for n in names)),
    ]


def _list(facts: list[tuple[str, str]]) -> Html:
    pairs = (join(element("dt", name), element("dd", fact)) for name, fact in facts)
    return element("dl", *pairs, class_="facts")


def _text(document: RunDocument) -> str:
    preset = document.engine in ENGINES.values()
    by_hand = "" if preset else " The engine is not a preset; pass it to `evaluate` in Python."
    return (
        "The results depend on the inputs, the seed and the versions below, and not on"
        " the number of workers or the order of their work. In a complete folder the"
        f" command returns at once; give another -o to judge again.{by_hand} In the table"
        " of results x, y, z and qw to qz are the pose of the grasp frame G in the"
        " object frame O; the file next to it describes every column."
    )


def _inputs(document: RunDocument) -> list[tuple[str, str]]:
    library = document.library
    grasps = document.grasps
    return [
        ("scene", f"{document.scene.path}, content {document.scene.content[:HASH_DIGITS]}"),
        ("station", f"{document.station.path}, content {document.station.content[:HASH_DIGITS]}"),
        ("object library", f"{library.name} ({library.path})"),
        *(
            (f"object {name}", f"build {build[:HASH_DIGITS]}")
            for name, build in library.objects.items()
        ),
        ("grasps", f"{grasps.count} {grasps.origin}, content {grasps.content[:HASH_DIGITS]}"),
    ]


def _settings(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    engine = document.engine
    return [
        ("engine", f"{engine_label(engine)}: {_engine_text(engine)}"),
        ("motion", motion_text(motion_in(document.trial))),
        ("trial", _listed(without_motion(document.trial))),
        ("mode", document.mode),
        ("arm", _listed(without_motion(document.arm)) if document.arm else "not asked"),
        ("seed", str(document.seed)),
        ("run", f"{document.hash} (all of the above; column run of the table)"),
        *document.versions.items(),
    ]


def _engine_text(engine: Engine) -> str:
    """All settings of an engine, by name."""
    settings = {name: value for name, value in vars(engine).items() if name != "name"}
    return ", ".join(
        f"{name.replace('_', ' ')} {_engine_value(value)}" for name, value in settings.items()
    )


def _engine_value(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return format_duration(value) if isinstance(value, float) else str(value).replace("_", " ")


def _listed(settings: dict[str, float]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in settings.items())


def _sessions(document: RunDocument | CampaignDocument) -> list[tuple[str, str]]:
    lines = []
    for session in document.stretches:
        judged = "interrupted" if session.judged is None else f"{session.judged} grasps"
        took = "" if session.seconds is None else f" in {format_duration(session.seconds)}"
        plural = "" if session.workers == 1 else "s"
        text = f"{session.started}: {judged}{took}, {session.workers} worker{plural}"
        lines.append(("judged", text))
    return [*lines, ("command", document.command)]
