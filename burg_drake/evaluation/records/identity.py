"""What two calls of `evaluate` must have in common to work on the same run, and how they differ, in
words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from burg_drake.core import InvalidInputError, content_hash, listing
from burg_drake.core.grasps import Mode
from burg_drake.evaluation.records.limit_numbers import (
    APPROACH,
    limits_text,
    measure_text,
    without_limits,
)
from burg_drake.evaluation.records.motion_numbers import motion_in, motion_text, without_motion
from burg_drake.evaluation.records.origin import engine_label
from burg_drake.evaluation.records.run_document import HASH_DIGITS, Grasps, Input, RunDocument
from burg_drake.station.document import Engine

SETTINGS_TOPIC = "settings of engine, trial and arm"
"""A topic of `identity`."""
THERE_AND_HERE = ("there", "here")
"""Names of the two sides of a comparison: a folder, and what is asked for now."""


class RunRequestFields(Protocol):
    """What a call asks about each scene; documents of runs say it, see `RunDocument`."""

    @property
    def station(self) -> Input: ...
    @property
    def grasps(self) -> Grasps: ...
    @property
    def engine(self) -> Engine: ...
    @property
    def trial(self) -> dict[str, float]: ...
    @property
    def mode(self) -> Mode: ...
    @property
    def arm(self) -> dict[str, float]: ...
    @property
    def seed(self) -> int: ...
    @property
    def versions(self) -> dict[str, str]: ...


def identity(document: RunDocument) -> dict[str, str]:
    """What two calls must have in common to work on the same run, in words, by topic."""
    return {
        "scene": f"content {document.scene.content[:HASH_DIGITS]}",
        **request_identity(document),
    }


def request_identity(document: RunRequestFields) -> dict[str, str]:
    """The same of all scenes that it is asked about, in words, by topic."""
    grasps, engine = document.grasps, document.engine
    others = [without_limits(without_motion(values)) for values in (document.trial, document.arm)]
    settings = content_hash(vars(engine), *others)[:HASH_DIGITS]
    sampled = grasps.origin == "sampled"
    angle = {"approach angle": f"{grasps.approach_angle_deg} degrees"} if sampled else {}
    simulated = "simulated" if document.trial.get(APPROACH) else "not simulated"
    return {
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "engine": engine_label(engine),
        SETTINGS_TOPIC: settings,
        "motion": motion_text(motion_in(document.trial)),
        "limit in the hand": limits_text(document.trial),
        "motion of others": measure_text(document.trial),
        **({} if document.mode == "arm" else {"approach of the hand": simulated}),
        "mode": document.mode,
        "grasps": (
            _sampled(grasps)
            if sampled
            else f"given, content {grasps.content[:HASH_DIGITS]}{_where(grasps)}"
        ),
        **angle,
        "seed": str(document.seed),
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
        **{name: document.versions.get(name, "not recorded") for name in engine.packages},
    }


def _sampled(grasps: Grasps) -> str:
    how = "sampled blind" if grasps.blind else "clear of the scene"
    balance = (
        f", more until each object has {grasps.until_balanced} lifted and"
        f" {grasps.until_balanced} failing ones (counted: {grasps.balanced_among}; at most"
        f" {grasps.max_per_object} grasps)"
        if grasps.until_balanced
        else ""
    )
    return f"{grasps.per_object} an object, {how}{_where(grasps)}{balance}"


def _where(grasps: Grasps) -> str:
    return f", on {', '.join(grasps.only)}" if grasps.only else ""


def run_hash(document: RunDocument) -> str:
    """Short hash of what decides about a run's results: `identity` and the candidates."""
    return content_hash(identity(document), document.grasps.content)[:HASH_DIGITS]


def run_differences(there: RunDocument, here: RunDocument) -> list[str]:
    """How two runs differ in what must be the same in one run, in words."""
    return differences(
        identity(there),
        identity(here),
        {
            "scene": [_scene_difference(there, here)],
            **_words(there, here, THERE_AND_HERE),
        },
    )


def request_differences(
    there: RunRequestFields, here: RunRequestFields, sides: Sequence[str] = THERE_AND_HERE
) -> list[str]:
    """The same of what is asked, whatever the scene.

    Args:
        there, here: documents of runs.
        sides: what the two are called.
    """
    first, second = request_identity(there), request_identity(here)
    return differences(first, second, _words(there, here, sides), sides)


def differences(
    there: Mapping[str, str],
    here: Mapping[str, str],
    words: Mapping[str, Sequence[str]],
    sides: Sequence[str] = THERE_AND_HERE,
) -> list[str]:
    """Topics that two identities have in common and differ in, in words.

    Args:
        there, here: texts by topic.
        words: differences by topic, of topics whose texts are hashes.
        sides: what the two are called.
    """
    topics = [k for k in there if k in here and there[k] != here[k]]
    if "engine" in topics or "mode" in topics:  # settings differ too, which says nothing more
        topics = [k for k in topics if k != SETTINGS_TOPIC]
    found: list[str] = []
    for topic in topics:
        found += words.get(topic) or [_difference(topic, there[topic], here[topic], sides)]
    return found


def input_difference(
    topic: str,
    there: Input,
    here: Input,
    sides: Sequence[str] = THERE_AND_HERE,
    behind: str = "models",
) -> str:
    """How two documents with different contents differ, in words.

    Args:
        topic: what they are.
        there, here: the documents.
        sides: what the two are called.
        behind: which files beside the document make its content.
    """
    if there.path != here.path:
        return _difference(topic, there.path, here.path, sides)
    return f"{topic} {here.path} has changed, or {behind} that it uses have"


def setting_differences(
    there: Mapping[str, object], here: Mapping[str, object], sides: Sequence[str] = THERE_AND_HERE
) -> list[str]:
    """Settings that differ by name, with both values."""
    names = [k for k in {**there, **here} if there.get(k) != here.get(k)]
    values = [(k, there.get(k, "not recorded"), here.get(k, "not recorded")) for k in names]
    return [_difference(name, str(first), str(second), sides) for name, first, second in values]


def _words(
    there: RunRequestFields, here: RunRequestFields, sides: Sequence[str]
) -> dict[str, list[str]]:
    """Differences by topic, of topics whose texts in `request_identity` have hashes."""
    return {
        "station": [input_difference("station", there.station, here.station, sides)],
        SETTINGS_TOPIC: setting_differences(_settings(there), _settings(here), sides),
        "grasps": grasp_differences(there.grasps, here.grasps, sides),
    }


def _scene_difference(there: RunDocument, here: RunDocument) -> str:
    old, new = there.library.objects, here.library.objects
    built = [name for name in new if name in old and old[name] != new[name]]
    if built and there.scene.path == here.scene.path:
        return f"scene {here.scene.path} has objects that were built again: {listing(built)}"
    return input_difference("scene", there.scene, here.scene, behind="objects")


def grasp_differences(
    there: Grasps, here: Grasps, sides: Sequence[str] = THERE_AND_HERE
) -> list[str]:
    """How the grasps of two runs differ, in words."""
    found = []
    if there.correction != here.correction:
        first, second = (",".join(g.correction) or "none" for g in (there, here))
        found = [_difference("correction", first, second, sides)]
    first, second = (_described(grasps) for grasps in (there, here))
    if first != second:
        found.append(_difference("grasps", first, second, sides))
    given = "given " if there.origin == "given" else ""
    return found or [f"the {given}grasps are others"]


def _described(grasps: Grasps) -> str:
    if grasps.origin == "sampled":
        return _sampled(grasps)
    count = f"{grasps.count} given" if grasps.count else "given"
    return f"{count} for {listing(grasps.only)} alone" if grasps.only else count


def _settings(document: RunRequestFields) -> dict[str, object]:
    """Settings of engine, trial and arm by name, without those that are topics of their own."""
    found = dict(vars(document.engine))
    for values in (document.trial, document.arm):
        found |= without_limits(without_motion(values))
    return found


def _difference(topic: str, there: str, here: str, sides: Sequence[str]) -> str:
    verb = "are" if topic == "grasps" else "is"
    return f"{topic} {verb} {there} {sides[0]}, {here} {sides[1]}"


def require_same_run(folder: Path, there: RunDocument, here: RunDocument) -> None:
    """Refuses to go on with a run that is not the one asked for.

    Raises:
        InvalidInputError: names every difference.
    """
    require_no_differences(folder, run_differences(there, here), there.shard, here.shard)


def require_no_differences(folder: Path, differences: Sequence[str], there: str, here: str) -> None:
    """Refuses to go on with another run, or with another shard of the same one.

    Args:
        folder: holds the run.
        differences: how the runs differ, in words.
        there, here: shards of the run in the folder and of the one asked for.

    Raises:
        InvalidInputError: names every difference, or both shards.
    """
    if differences:
        raise InvalidInputError(
            f"{folder} already holds another run ({'; '.join(differences)}); choose"
            " another folder, or delete it"
        ).about("out")
    if there != here:
        held = f"shard {there} of this run" if there else "all of this run"
        asked = f"shard {here}" if here else "no shard"
        raise InvalidInputError(
            f"{folder} holds {held}, but {asked} is given; choose another folder. Shards"
            " are merged by burg-drake merge"
        ).about("out")
