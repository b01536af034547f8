"""What formats share that hold the grasps of one object in one file, under its mesh's name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import Array, InvalidInputError, listing
from burg_drake.core.grasps import UNTRIED, GraspSet, Outcome, parts_of
from burg_drake.core.paths import MESH_FILE, SURFACE_FILE, with_shareable_references
from burg_drake.formats.common.grasp_format import Gripper

SUCCESS_COLUMN = "object_in_gripper"
"""1 where the grasp holds its object, 0 where it does not, NaN if unknown."""

HANDS = {"panda": "panda_hand", "franka_panda": "panda_hand"}
"""Our hands by the names that other projects give them."""

MESH_SUFFIXES = ("obj", "stl", "ply", "off", "dae", "glb", "gltf", "usd", "usda", "usdc", "usdz")


def only_object(grasps: GraspSet, kind: str) -> str:
    """The object that all grasps are of.

    Raises:
        InvalidInputError: there are none, or of several objects.
    """
    names = sorted(set(grasps.object.tolist()))
    if not names:
        raise InvalidInputError(
            f"there are no grasps to write; a file of {kind} needs at least one"
        )
    if len(names) > 1:
        raise InvalidInputError(
            f"the grasps are of {len(names)} objects ({listing(names)}), but a file of "
            f"{kind} holds those of one; choose one of them, or write a file for each"
        )
    name: str = names[0]
    return name


def object_name(file: str) -> str:
    """What an object is called whose mesh or prim has this path, such as `meshes/Mug/1a2b.obj`.

    Meshes of our libraries are called alike and lie in a folder an object: `mug/mesh.obj`.
    """
    *folders, last = file.replace("\\", "/").rstrip("/").split("/")
    if last in (MESH_FILE, SURFACE_FILE) and folders and folders[-1]:
        return folders[-1]
    stem, _, suffix = last.rpartition(".")
    return stem if stem and suffix.lower() in MESH_SUFFIXES else last


def description_of(grasps: GraspSet, name: str) -> dict[str, Any]:
    """What is told of an object: its mesh `file`, its `scale` and more; empty if nothing is."""
    found = _find(grasps.provenance, name) or {}
    return {key: value for key, value in found.items() if _is_description(key, value)}


def shareable_description(grasps: GraspSet, name: str, path: Path) -> dict[str, Any]:
    """The same, with the mesh as a file at `path` refers to it."""
    described: dict[str, Any] = with_shareable_references(
        description_of(grasps, name), path.absolute().parent
    )
    return described


def _is_description(key: str, value: Any) -> bool:
    """Whether it is a name of a file, or else finite numbers; provenances come from anywhere."""
    if key == "file":
        return isinstance(value, str) and bool(value)
    try:
        return bool(np.isfinite(np.asarray(value, dtype=float)).all())
    except (TypeError, ValueError, OverflowError):
        return False


def _find(provenance: Mapping[str, Any], name: str) -> dict[str, Any] | None:
    files = provenance.get("object_files")
    if isinstance(files, Mapping) and isinstance(files.get(name), Mapping):
        return dict(files[name])
    for part in parts_of(provenance):
        if found := _find(part, name):
            return found
    return None


def success_of(grasps: GraspSet) -> Array:
    """(N,) 1 for success, 0 for failure, NaN if unknown.

    From the column `object_in_gripper`, or else from `outcome`, or else from scores if they are
    nothing but 0 and 1.
    """
    if SUCCESS_COLUMN in grasps.columns:
        return grasps.columns[SUCCESS_COLUMN].astype(float)
    if "outcome" in grasps.columns:
        outcome = grasps.columns["outcome"]
        lifted = (outcome == Outcome.LIFTED.value).astype(float)
        return np.where(np.isin(outcome, UNTRIED), np.nan, lifted)
    if np.isin(grasps.score[~np.isnan(grasps.score)], (0.0, 1.0)).all():
        return grasps.score.copy()
    return np.full(len(grasps), np.nan)


def check_hand(given: str, gripper: Gripper, where: str) -> tuple[str, ...]:
    """Compares what a file says of its hand; a note if the name tells nothing.

    Raises:
        InvalidInputError: the name is that of another hand.
    """
    known = HANDS.get(given, given)
    if known == gripper.name:
        return ()
    if given in HANDS:
        raise InvalidInputError(
            f"{where}: the grasps were made for hand {known!r}, but hand {gripper.name!r}"
            " was given; read them with the hand that they were made for"
        ).about("hand")
    return (f"{where}: the file names a hand {given!r}, which was taken to be {gripper.name!r}.",)


def scale_note(name: str, file: str, scale: float) -> str:
    """What the scale of an object means for its grasps."""
    return (
        f"The grasps are in metres, for {name!r} made of {file!r} scaled by {scale:g};"
        " they fit an object of a library only if it was built at that size."
    )
