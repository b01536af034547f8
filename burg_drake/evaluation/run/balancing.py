"""Goes on sampling where a run is to have some lifted grasps of each object and some that fail.

A run grows in rounds, each of which begins when all grasps so far are judged: what is sampled next
follows from verdicts alone, never from who judged them or in which order. Grasps of a later round
are those of a longer sampling with the same seed, whose first ones are there already.
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

Asked = dict[str, tuple[int, int]]
"""How many ordinary and how many slippery grasps are sampled, by object."""


def sample_asked(scene: Scene, station: Station, document: RunDocument) -> Candidates:
    """The grasps that a run's document asks for.

    Args:
        scene: that they are sampled on.
        station: gives hand and arm.
        document: of the run; without `Grasps.asked` every object gets `per_object` ordinary ones.
    """
    grasps = document.grasps
    names = grasps.only or tuple(scene.instances)
    found: defaultdict[str, list[GraspSet]] = defaultdict(list)
    for slippery in (False, True):
        by_count: defaultdict[int, list[str]] = defaultdict(list)
        for name in names:
            by_count[_asked(grasps, scene.instance(name).object)[slippery]].append(name)
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


def grow(run: Run) -> RunDocument | None:
    """The document of a judged run that asks for more grasps; None if no more are needed.

    None are if each object has as many grasps of both kinds as are wanted, or no more are to be
    sampled. A run that a second engine has judged again does not grow any more.
    """
    grasps = run.document.grasps
    if not grasps.until_balanced or any(v.judged_again for v in run.verdicts.values()):
        return None
    asked = {name: _more(grasps, name, counts) for name, counts in lifted_and_failed(run).items()}
    if all(asked[name] == _asked(grasps, name) for name in asked):
        return None
    return replace(run.document, grasps=replace(grasps, asked=asked))


def _asked(grasps: Grasps, object: str) -> tuple[int, int]:
    return grasps.asked.get(object, (grasps.per_object or 0, 0))


def _more(grasps: Grasps, object: str, counts: tuple[int, int]) -> tuple[int, int]:
    """How many grasps are sampled in the next round: twice as many of what is missing."""
    ordinary, slippery = _asked(grasps, object)
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
