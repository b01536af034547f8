"""Conversion between formats: object names, success, and files with the grasps of one object."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    MESH_FILE,
    UNTRIED_OUTCOMES,
    Array,
    GraspSet,
    InvalidInputError,
    Outcome,
    UnknownNameError,
    distinct_texts,
    grasp_identifiers,
    list_names,
    make_name,
    provenance_parts,
    suggest_names,
    with_shareable_references,
)
from burg_drake.formats.grasp_format import GraspFormat, Gripper

LABELLED_BY = "labelled_by"
"""Entry of a provenance: engine, protocol and settings of the trials that labelled grasps."""

GRASP_SUCCESS_COLUMN = "object_in_gripper"
"""Column: 1 if the grasp holds its object, 0 if not, NaN if unknown."""

HAND_ALIASES = {"panda": "panda_hand", "franka_panda": "panda_hand"}
"""Names of hands in burg_drake, by their names in other projects."""


def require_single_object(grasps: GraspSet, kind: str) -> str:
    """Name of the only object of the grasps.

    Raises:
        InvalidInputError: there are no grasps, or grasps of several objects.
    """
    names = sorted(set(grasps.object.tolist()))
    if not names:
        raise InvalidInputError(
            f"there are no grasps to write; a file of {kind} needs at least one"
        )
    if len(names) > 1:
        raise InvalidInputError(
            f"the grasps are of {len(names)} objects ({list_names(names)}), but a file of "
            f"{kind} holds those of one; choose one of them, or write a file for each"
        )
    return str(names[0])


def object_name(file: str) -> str:
    """Object name from the path of its mesh or prim, such as `meshes/Mug/1a2b.obj`.

    Meshes of burg_drake's libraries have the same name in a folder for each object: `mug/mesh.obj`.
    """
    *folders, last = file.replace("\\", "/").rstrip("/").split("/")
    if last in (MESH_FILE, "surface.obj") and folders and folders[-1]:
        return folders[-1]
    stem, _, suffix = last.rpartition(".")
    is_mesh = re.fullmatch("obj|stl|ply|off|dae|glb|gltf|usd[acz]?", suffix.lower())
    return stem if stem and is_mesh else last


def object_description(grasps: GraspSet, name: str) -> dict[str, Any]:
    """Description of an object in the grasps: its mesh `file`, `scale` and more; empty if there is
    none."""
    found = _find_description(grasps.provenance, name)
    return {key: value for key, value in found.items() if _is_description(key, value)}


def shareable_description(grasps: GraspSet, name: str, path: Path) -> dict[str, Any]:
    """Object description with the mesh path relative to a file at `path`."""
    description = object_description(grasps, name)
    return dict(with_shareable_references(description, path.absolute().parent))


def _is_description(key: str, value: Any) -> bool:
    """Whether a value is a file name or finite numbers; provenances come from anywhere."""
    if key == "file":
        return isinstance(value, str) and bool(value)
    try:
        return bool(np.isfinite(np.asarray(value, dtype=float)).all())
    except (TypeError, ValueError, OverflowError):
        return False


def _find_description(provenance: Mapping[str, Any], name: str) -> dict[str, Any]:
    files = provenance.get("object_files")
    if isinstance(files, Mapping) and isinstance(files.get(name), Mapping):
        return dict(files[name])
    for part in provenance_parts(provenance):
        if found := _find_description(part, name):
            return found
    return {}


def success_labels(grasps: GraspSet) -> Array:
    """(N,) 1 for success, 0 for failure, NaN if unknown.

    From the column `object_in_gripper`, or else from `outcome`, or else from scores if these are
    all 0 or 1.
    """
    if GRASP_SUCCESS_COLUMN in grasps.columns:
        return grasps.columns[GRASP_SUCCESS_COLUMN].astype(float)
    if "outcome" in grasps.columns:
        outcome = grasps.columns["outcome"]
        lifted = (outcome == Outcome.LIFTED.value).astype(float)
        unknown = (*UNTRIED_OUTCOMES, Outcome.SIMULATION_FAILED.value)
        return np.where(np.isin(outcome, unknown), np.nan, lifted)
    if np.isin(grasps.score[~np.isnan(grasps.score)], (0.0, 1.0)).all():
        return grasps.score.copy()
    return np.full(len(grasps), np.nan)


def check_gripper_name(given: str, gripper: Gripper, where: str) -> tuple[str, ...]:
    """Checks the hand that a file names; returns a note if the name is unknown.

    Raises:
        InvalidInputError: the file names another hand.
    """
    known = HAND_ALIASES.get(given, given)
    if known == gripper.name:
        return ()
    if given in HAND_ALIASES:
        raise InvalidInputError(
            f"{where}: the grasps were made for hand {known!r}, but hand {gripper.name!r}"
            " was given; read them with the hand that they were made for"
        ).about("hand")
    return (f"{where}: the file names a hand {given!r}, which was taken to be {gripper.name!r}.",)


def scale_note(name: str, file: str, scale: float) -> str:
    """Note on the meaning of an object's scale for its grasps."""
    return (
        f"The grasps are in metres, for {name!r} made of {file!r} scaled by {scale:g};"
        " they fit an object of a library only if it was built at that size."
    )


def with_objects_renamed(grasps: GraspSet, names: Mapping[str, str]) -> GraspSet:
    """Returns the grasps with objects renamed; identifiers change with them.

    Args:
        grasps: the grasps.
        names: new names by old names; an empty old name stands for the only object of the grasps.

    Raises:
        InvalidInputError: a name for all grasps, which are of several objects.
        UnknownNameError: there are no grasps of an object with an old name.
    """
    known = distinct_texts(grasps.object)
    if not names or not known:
        return grasps
    if "" in names and "" not in known:
        if len(known) > 1:
            raise InvalidInputError(
                f"the grasps are of {len(known)} objects ({list_names(sorted(known))}); say"
                f" which of them is {names['']!r}: THEIRS={names['']}"
            )
        names = {next(iter(known)): names[""]}
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"no grasps are of object {name!r}; {suggest_names(name, known)}"
            )
    objects = _rename(grasps.object, {name: names.get(name, name) for name in known})
    if all(old == new for old, new in names.items()):  # needs no copy of the poses
        ids = grasp_identifiers(grasps.object, grasps.X_OG, grasps.width)
        if np.array_equal(ids, grasps.id):
            return replace(grasps, object=objects)
    return GraspSet.create(
        grasps.X_OG,
        object=objects,
        width=grasps.width,
        score=grasps.score,
        provenance=_rename_in_provenance(grasps.provenance, names),
        columns=grasps.columns,
    )


def _rename(objects: NDArray[np.str_], names: Mapping[str, str]) -> NDArray[np.str_]:
    """Objects (N,) by their new names; `names` has a new name for each."""
    longest = max(names.values(), key=len)
    if len({*names.values()}) == 1:
        return np.broadcast_to(np.array(longest), len(objects))
    renamed = np.full(len(objects), longest)
    for old, new in names.items():
        renamed[objects == old] = new
    return renamed


def _rename_in_provenance(provenance: Any, names: Mapping[str, str]) -> Any:
    """A provenance with the objects renamed in its `object_files` and those of its parts."""
    if not isinstance(provenance, Mapping):
        return provenance
    result = dict(provenance)
    files, parts = result.get("object_files"), result.get("parts")
    if isinstance(files, Mapping):
        result["object_files"] = {names.get(key, key): value for key, value in files.items()}
    if isinstance(parts, Mapping):
        result["parts"] = {key: _rename_in_provenance(part, names) for key, part in parts.items()}
    elif isinstance(parts, (list, tuple)):
        result["parts"] = [_rename_in_provenance(part, names) for part in parts]
    return result


def with_success(grasps: GraspSet, above: float) -> GraspSet:
    """Returns the grasps with success for scores above a limit."""
    success = np.where(np.isnan(grasps.score), np.nan, (grasps.score > above).astype(float))
    return grasps.with_columns(**{GRASP_SUCCESS_COLUMN: success})


def write_each_object(
    grasps: GraspSet, folder: Path, format: GraspFormat, gripper: Gripper
) -> dict[Path, tuple[str, ...]]:
    """Writes one grasp file for each object into a folder.

    Returns:
        Notes on the data that each file cannot carry.

    Raises:
        InvalidInputError: files of two objects would share a name; also see `GraspFormat.write`.
    """
    paths: dict[Path, str] = {}
    for name in dict.fromkeys(grasps.object.tolist()):
        path = folder / f"{make_name(name) if name else 'grasps'}{format.suffixes[0]}"
        if path in paths:
            raise InvalidInputError(
                f"grasps of {paths[path]!r} and of {name!r} would both be written to "
                f"{path}; rename one of the objects"
            )
        paths[path] = name
    return {
        path: format.write(grasps.select(grasps.object == name), path, gripper)
        for path, name in paths.items()
    }
