"""Steps between reading grasps in one format and writing them in another."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import InvalidInputError, UnknownNameError, listing, nearest
from burg_drake.core.grasps import GraspSet
from burg_drake.core.paths import name_from
from burg_drake.formats.common.grasp_format import GraspFormat, Gripper
from burg_drake.formats.common.one_object import SUCCESS_COLUMN


def with_objects_renamed(grasps: GraspSet, names: Mapping[str, str]) -> GraspSet:
    """The same grasps with some of their objects called otherwise; identifiers change with them.

    Args:
        grasps: the grasps.
        names: new names by old ones; the one by the empty text is for all grasps, if they are of
            one object.

    Raises:
        InvalidInputError: one name is given for grasps of several objects.
        UnknownNameError: there are no grasps of an object of an old name.
    """
    known = set(grasps.object.tolist())
    if not names or not known:
        return grasps
    if "" in names and "" not in known:
        if len(known) > 1:
            raise InvalidInputError(
                f"the grasps are of {len(known)} objects ({listing(sorted(known))}); say"
                f" which of them is {names['']!r}: THEIRS={names['']}"
            )
        names = {next(iter(known)): names[""]}
    for name in names:
        if name not in known:
            raise UnknownNameError(f"no grasps are of object {name!r}; {nearest(name, known)}")
    return GraspSet.create(
        grasps.X_OG,
        object=np.array([names.get(name, name) for name in grasps.object.tolist()], dtype=str),
        width=grasps.width,
        score=grasps.score,
        provenance=_renamed(grasps.provenance, names),
        columns=grasps.columns,
    )


def _renamed(provenance: Any, names: Mapping[str, str]) -> Any:
    """A provenance whose `object_files`, and those of its parts, go by the new names."""
    if not isinstance(provenance, Mapping):
        return provenance
    result = dict(provenance)
    files, parts = result.get("object_files"), result.get("parts")
    if isinstance(files, Mapping):
        result["object_files"] = {names.get(key, key): value for key, value in files.items()}
    if isinstance(parts, Mapping):
        result["parts"] = {key: _renamed(part, names) for key, part in parts.items()}
    elif isinstance(parts, (list, tuple)):
        result["parts"] = [_renamed(part, names) for part in parts]
    return result


def with_success(grasps: GraspSet, above: float) -> GraspSet:
    """The same grasps, of which those succeed whose score is above a limit."""
    success = np.where(np.isnan(grasps.score), np.nan, (grasps.score > above).astype(float))
    return grasps.with_columns(**{SUCCESS_COLUMN: success})


def write_each_object(
    grasps: GraspSet, folder: Path, format: GraspFormat, gripper: Gripper
) -> dict[Path, tuple[str, ...]]:
    """Writes a file for each object into a folder.

    Returns:
        What each file cannot carry.

    Raises:
        InvalidInputError: files of two objects would share a name, or see `GraspFormat.write`.
    """
    paths: dict[Path, str] = {}
    for name in dict.fromkeys(grasps.object.tolist()):
        path = folder / f"{name_from(name) if name else 'grasps'}{format.suffixes[0]}"
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
