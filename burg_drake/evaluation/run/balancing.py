"""Samples further grasps until a run has enough lifted and enough failing ones of each object.

Each round begins when all grasps so far are judged. What it samples follows from the verdicts
alone, not from who judged them or in which order. A later round repeats the sampling with the same
seed and a larger number, so that it begins with the grasps that are there already.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import (
    Candidates,
    SamplingSettings,
    distinct,
    join_candidates,
    sample_on_scene,
)
from burg_drake.evaluation.records import Grasps, RunDocument
from burg_drake.evaluation.results import lifted_and_failed
from burg_drake.evaluation.store import Run
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station

RequestedCounts = dict[str, tuple[int, int]]
"""Numbers of ordinary and of slippery grasps to sample, by object."""


def sample_requested(
    scene: Scene, station: Station, document: RunDocument, before: Run | None = None
) -> Candidates:
    """The grasps that a run's document asks for.

    Args:
        scene: that they are sampled on.
        station: gives hand and arm.
        document: of the run; without `Grasps.asked` every object gets `per_object` ordinary ones.
        before: the run with the grasps that its own document asks for; objects of which no more are
            asked for keep theirs. None: all are sampled.
    """
    grasps = document.grasps
    names = grasps.only or tuple(scene.instances)
    kept = {} if before is None else _kept(scene, before, grasps)
    found: defaultdict[str, list[GraspSet]] = defaultdict(list, kept)
    for slippery in (False, True):
        by_count: defaultdict[int, list[str]] = defaultdict(list)
        for name in (name for name in names if name not in kept):
            by_count[_requested(grasps, scene.instance(name).object)[slippery]].append(name)
        for count, those in sorted(by_count.items()):
            if count:
                settings = SamplingSettings(
                    approach_angle_deg=grasps.approach_angle_deg,
                    blind=grasps.blind,
                    slippery=slippery,
                )
                sampled = sample_on_scene(scene, station, count, document.seed, settings, those)
                for name, part in sampled:
                    found[name].append(part)
    return join_candidates({name: _joined(found[name]) for name in names})


def _kept(scene: Scene, before: Run, grasps: Grasps) -> dict[str, list[GraspSet]]:
    """The grasps of the instances that a run has as many of as are asked for now."""
    there = before.candidates
    provenance = there.grasps.provenance["parts"]
    kept = {}
    for name in provenance:
        object = scene.instance(name).object
        if _requested(grasps, object) == _requested(before.document.grasps, object):
            own = there.grasps.select(there.instance == name)
            kept[name] = [replace(own, provenance=provenance[name])]
    return kept


def next_round(run: Run) -> RunDocument | None:
    """The document of a judged run that asks for more grasps; None if no more are needed.

    None are needed if each object has enough lifted and enough failing grasps, or the maximum of
    grasps. A run that a second engine has judged again gets no further round.
    """
    grasps = run.document.grasps
    if not grasps.until_balanced or any(v.judged_again for v in run.verdicts.values()):
        return None
    counts = lifted_and_failed(run)
    requested: RequestedCounts = {name: _more(grasps, name, counts[name]) for name in counts}
    if all(requested[name] == _requested(grasps, name) for name in requested):
        return None
    return replace(run.document, grasps=replace(grasps, asked=requested))


def _requested(grasps: Grasps, object: str) -> tuple[int, int]:
    return grasps.asked.get(object, (grasps.per_object or 0, 0))


def _more(grasps: Grasps, object: str, counts: tuple[int, int]) -> tuple[int, int]:
    """How many grasps are sampled in the next round: twice as many of what is missing."""
    ordinary, slippery = _requested(grasps, object)
    lifted, failed = (n < grasps.until_balanced for n in counts)
    room = grasps.max_per_object - ordinary - slippery
    more = np.array([ordinary * lifted, (slippery or grasps.per_object or 0) * failed])
    more = np.minimum(more, room // max(1, int((more > 0).sum())))
    return ordinary + int(more[0]), slippery + int(more[1])


def _joined(parts: list[GraspSet]) -> GraspSet:
    """Ordinary grasps, and slippery ones if there are any; provenance is that of the first."""
    if len(parts) == 1:
        return parts[0]
    return replace(distinct(GraspSet.concatenate(parts)), provenance=parts[0].provenance)
