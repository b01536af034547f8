"""Compares two runs, or a run and a call, by the inputs and settings that determine results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from burg_drake.core import InvalidInputError, content_hash, list_names
from burg_drake.evaluation.run_document import (
    HASH_DIGITS,
    AnyRunDocument,
    CampaignDocument,
    Grasps,
    Input,
    OneRunDocument,
    RunDocument,
)
from burg_drake.evaluation.trial_origin import (
    engine_label,
    limits_text,
    measure_text,
    other_numbers,
    protocol_of,
    recorded_motion_text,
)

SETTINGS_TOPIC = "settings of engine, trial and arm"
"""A topic of `run_identity`."""
COMPARED_RUN_NAMES = ("there", "here")
"""Words for two runs in messages: the one in a folder, and the requested one."""


def run_identity(document: AnyRunDocument) -> dict[str, str]:
    """Properties that two calls must share to work on the same run, as texts by topic."""
    if isinstance(document, CampaignDocument):
        return {"scenes": f"{len(document.scenes)} scenes", **request_identity(document)}
    scene = f"content {document.scene.content[:HASH_DIGITS]}"
    return {"scene": scene, **request_identity(document)}


def request_identity(document: AnyRunDocument) -> dict[str, str]:
    """Properties of `run_identity` that do not depend on the scene, as texts by topic."""
    grasps, engine = document.grasps, document.engine
    others = map(other_numbers, (document.trial, document.arm))
    settings = content_hash(vars(engine), *others)[:HASH_DIGITS]
    sampled = grasps.origin == "sampled"
    angle = {"approach angle": f"{grasps.approach_angle_deg} degrees"} if sampled else {}
    given = f"given, content {grasps.content[:HASH_DIGITS]}{_only_words(grasps)}"
    simulated = "simulated" if document.trial.get("approach") else "not simulated"
    return {
        "protocol": protocol_of(document.trial),
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "engine": engine_label(engine),
        SETTINGS_TOPIC: settings,
        "motion": recorded_motion_text(document.trial),
        "limit in the hand": limits_text(document.trial),
        "motion of others": measure_text(document.trial),
        **({} if document.mode == "arm" else {"approach of the hand": simulated}),
        "mode": document.mode,
        "grasps": _sampling_words(grasps) if sampled else given,
        **angle,
        "seed": str(document.seed),
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
        **{name: document.versions.get(name, "not recorded") for name in engine.packages},
    }


def _sampling_words(grasps: Grasps) -> str:
    how = "sampled blind" if grasps.blind else "clear of the scene"
    balance = (
        f", more until each object has {grasps.until_balanced} lifted and"
        f" {grasps.until_balanced} failing ones (counted: {grasps.balanced_among}; at most"
        f" {grasps.max_per_object} grasps)"
        if grasps.until_balanced
        else ""
    )
    return f"{grasps.per_object} an object, {how}{_only_words(grasps)}{balance}"


def _only_words(grasps: Grasps) -> str:
    return f", on {', '.join(grasps.only)}" if grasps.only else ""


def run_hash(document: AnyRunDocument) -> str:
    """Short hash of `run_identity` and of the candidates of one scene or the contents of many."""
    if isinstance(document, CampaignDocument):
        content: object = [(entry.name, entry.content) for entry in document.scenes]
    else:
        content = document.grasps.content
    return content_hash(run_identity(document), content)[:HASH_DIGITS]


def run_differences(there: OneRunDocument, here: OneRunDocument) -> list[str]:
    """Differences in `run_identity` between two runs, in words."""
    if isinstance(there, CampaignDocument) and isinstance(here, CampaignDocument):
        return request_differences(there, here) + _scenes_differences(there, here)
    assert isinstance(there, RunDocument) and isinstance(here, RunDocument)
    words = {
        "scene": [_scene_difference(there, here)],
        **_difference_words(there, here, COMPARED_RUN_NAMES),
    }
    return identity_differences(run_identity(there), run_identity(here), words)


def _scenes_differences(there: CampaignDocument, here: CampaignDocument) -> list[str]:
    old = {entry.name: entry.content for entry in there.scenes}
    new = {entry.name: entry.content for entry in here.scenes}
    found = []
    if lost := [name for name in old if name not in new]:
        found.append(f"only there {list_names(lost)}")
    if more := [name for name in new if name not in old]:
        found.append(f"only here {list_names(more)}")
    if other := [name for name in old if name in new and old[name] != new[name]]:
        found.append(f"changed {list_names(other)}")
    if not found and list(old) != list(new):
        found.append("in another order")
    return [f"scenes: {'; '.join(found)}"] if found else []


def request_differences(
    there: AnyRunDocument, here: AnyRunDocument, sides: Sequence[str] = COMPARED_RUN_NAMES
) -> list[str]:
    """Differences in `request_identity` between two runs, in words.

    Args:
        there, here: documents of the runs.
        sides: words for the two runs.
    """
    first, second = request_identity(there), request_identity(here)
    return identity_differences(first, second, _difference_words(there, here, sides), sides)


def identity_differences(
    there: Mapping[str, str],
    here: Mapping[str, str],
    words: Mapping[str, Sequence[str]],
    sides: Sequence[str] = COMPARED_RUN_NAMES,
) -> list[str]:
    """Differences between two identities in their common topics, in words.

    Args:
        there, here: texts by topic.
        words: differences to report for topics whose texts are hashes.
        sides: words for the two runs.
    """
    topics = [k for k in there if k in here and there[k] != here[k]]
    if "engine" in topics or "mode" in topics:  # then the settings differ as well
        topics = [k for k in topics if k != SETTINGS_TOPIC]
    found: list[str] = []
    for topic in topics:
        found += words.get(topic) or [_topic_difference(topic, there[topic], here[topic], sides)]
    return found


def input_difference(
    topic: str,
    there: Input,
    here: Input,
    sides: Sequence[str] = COMPARED_RUN_NAMES,
    behind: str = "models",
) -> str:
    """Difference between two documents with different contents, in words.

    Args:
        topic: kind of document.
        there, here: the documents.
        sides: words for the two runs.
        behind: kind of files that the document uses and its content includes.
    """
    if there.path != here.path:
        return _topic_difference(topic, there.path, here.path, sides)
    return f"{topic} {here.path} has changed, or {behind} that it uses have"


def setting_differences(
    there: Mapping[str, object],
    here: Mapping[str, object],
    sides: Sequence[str] = COMPARED_RUN_NAMES,
) -> list[str]:
    """Settings that differ, in words with both values."""
    names = [k for k in {**there, **here} if there.get(k) != here.get(k)]
    texts = [[str(side.get(k, "not recorded")) for k in names] for side in (there, here)]
    return [_topic_difference(k, a, b, sides) for k, a, b in zip(names, *texts, strict=True)]


def _difference_words(
    there: AnyRunDocument, here: AnyRunDocument, sides: Sequence[str]
) -> dict[str, list[str]]:
    """Differences by topic, for the topics of `request_identity` whose texts are hashes."""
    return {
        "station": [input_difference("station", there.station, here.station, sides)],
        SETTINGS_TOPIC: setting_differences(_all_settings(there), _all_settings(here), sides),
        "grasps": grasp_differences(there.grasps, here.grasps, sides),
    }


def _scene_difference(there: RunDocument, here: RunDocument) -> str:
    old, new = there.library.objects, here.library.objects
    built = [name for name in new if name in old and old[name] != new[name]]
    if built and there.scene.path == here.scene.path:
        return f"scene {here.scene.path} has objects that were built again: {list_names(built)}"
    return input_difference("scene", there.scene, here.scene, behind="objects")


def grasp_differences(
    there: Grasps, here: Grasps, sides: Sequence[str] = COMPARED_RUN_NAMES
) -> list[str]:
    """Differences between the grasps of two runs, in words."""
    found = []
    if there.correction != here.correction:
        first, second = (",".join(g.correction) or "none" for g in (there, here))
        found = [_topic_difference("correction", first, second, sides)]
    first, second = (_origin_words(grasps) for grasps in (there, here))
    if first != second:
        found.append(_topic_difference("grasps", first, second, sides))
    given = "given " if there.origin == "given" else ""
    return found or [f"the {given}grasps are others"]


def _origin_words(grasps: Grasps) -> str:
    if grasps.origin == "sampled":
        return _sampling_words(grasps)
    count = f"{grasps.count} given" if grasps.count else "given"
    return f"{count} for {list_names(grasps.only)} alone" if grasps.only else count


def _all_settings(document: AnyRunDocument) -> dict[str, object]:
    """Settings of engine, trial and arm by name, without settings with a topic of their own."""
    return vars(document.engine) | other_numbers(document.trial) | other_numbers(document.arm)


def _topic_difference(topic: str, there: str, here: str, sides: Sequence[str]) -> str:
    verb = "are" if topic == "grasps" else "is"
    return f"{topic} {verb} {there} {sides[0]}, {here} {sides[1]}"


def require_same_run(folder: Path, there: OneRunDocument, here: OneRunDocument) -> None:
    """Refuses to continue a run with other settings or inputs, or another shard of it.

    Args:
        folder: folder of the run.
        there, here: documents of the run in the folder and of the requested one.

    Raises:
        InvalidInputError: they differ; the message names every difference, or both shards.
    """
    if differences := run_differences(there, here):
        raise InvalidInputError(
            f"{folder} already holds another run ({'; '.join(differences)}); choose"
            " another folder, or delete it"
        ).about("out")
    if there.shard != here.shard:
        held = f"shard {there.shard} of this run" if there.shard else "all of this run"
        asked = f"shard {here.shard}" if here.shard else "no shard"
        raise InvalidInputError(
            f"{folder} holds {held}, but {asked} is given; choose another folder. Shards"
            " are merged by burg-drake merge"
        ).about("out")
