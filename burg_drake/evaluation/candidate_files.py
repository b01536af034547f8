"""Reads the grasps that a run judges from files."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from burg_drake.core.errors import UnknownNameError, nearest
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import INSTANCE, Candidates
from burg_drake.scene.scene import Scene


def read_grasps(scene: Scene, path: str | Path) -> dict[str, GraspSet]:
    """Reads a grasp file for `given_candidates`.

    Args:
        scene: the scene.
        path: grasps.npz of a run, whose grasps stay on their instances; or any other file of a
            `GraspSet`, whose grasps go to every instance of their object.

    Raises:
        InvalidInputError: the file is something else.
        UnknownNameError: grasps of an object or on an instance that the scene does not have.
    """
    grasps = GraspSet.load(path)
    if INSTANCE in grasps.columns:
        return _of_run(Candidates.load(Path(path)))
    objects = {name: scene.instance(name).object for name in scene.instances}
    unknown = sorted(set(grasps.object.tolist()) - set(objects.values()))
    if unknown:
        raise UnknownNameError(
            f"{path} has grasps of object {unknown[0]!r}, which is not in scene {scene.name!r};"
            f" {nearest(unknown[0], set(objects.values()))}"
        )
    members = {name: grasps.object == object for name, object in objects.items()}
    return {name: grasps.select(mask) for name, mask in members.items() if mask.any()}


def _of_run(candidates: Candidates) -> dict[str, GraspSet]:
    """The grasps by instance, each set with its own provenance."""
    parts = candidates.grasps.provenance.get("parts", {})
    sets = {}
    for name in dict.fromkeys(candidates.instance.tolist()):
        chosen = candidates.grasps.select(candidates.instance == name)
        sets[name] = dataclasses.replace(chosen, provenance=parts.get(name, {}))
    return sets
