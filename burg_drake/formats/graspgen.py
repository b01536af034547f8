"""Grasps of GraspGen's data sets: JSON, one file for each object.

The layout is the one of docs/GRASP_DATASET_FORMAT.md in github.com/NVlabs/GraspGen, as
grasp_gen/dataset/dataset_utils.py reads it; the released data set has it too, in shards of tar
files. A. Murali et al., "GraspGen: A Diffusion-based Framework for 6-DOF Grasping with On-Generator
Training", ICRA 2026.

- `object.file` is the mesh, or an identifier of Objaverse; `object.scale` the factor by which the
  mesh is scaled. `grasps.transforms` (N, 4, 4) are poses of the gripper's base in the frame of the
  scaled mesh [m]; `grasps.object_in_gripper` (N,) says which of them hold the object, as truth
  values or 0 and 1.
- scripts/record_grasp.py writes the same without `object`.
- scripts/graspgen/datagen.py of github.com/NVlabs/GraspDataGen adds `gripper`: name, file, width,
  depth, and `transform_offset_from_asset_to_graspgen_convention` as [[x, y, z], [x, y, z, w]] or as
  16 numbers. `load_object_grasp_data` multiplies each transform by that offset from the right; so
  does this reader.

The poses that result have +z towards the tips and x along the closing direction
(docs/GRIPPER_DESCRIPTION.md). For `franka_panda` the offset is the identity and the mesh
grasp_gen/assets/panda_gripper/hand.stl has the origin of the Panda's link `panda_hand` (its top
at z = 0.066 m) with the fingers along x (config/grippers/franka_panda.yaml and .py).
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import (
    Array,
    FileLimits,
    GraspSet,
    InvalidInputError,
    atomic_write,
    inverse,
    load_json,
    make_pose,
    quote_value,
    rotation_from_quaternion,
)
from burg_drake.formats.grasp_conversion import (
    GRASP_SUCCESS_COLUMN,
    check_gripper_name,
    object_name,
    require_single_object,
    scale_note,
    shareable_description,
    success_labels,
)
from burg_drake.formats.grasp_format import (
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
    file_provenance,
)
from burg_drake.formats.pose_files import nearest_rigid

_GRASPS_KEY = re.compile(rb'"grasps"\s*:\s*\{')  # The key `grasps` with a mapping, in JSON.


def recognise_graspgen(path: Path) -> bool:
    """Whether a file is JSON with `grasps` as a mapping."""
    try:
        with open(path, "rb") as stream:
            head = stream.read(1 << 16)
    except OSError:
        return False
    return head.lstrip().startswith(b"{") and _GRASPS_KEY.search(head) is not None


def read_graspgen(path: Path, gripper: Gripper) -> ImportedGrasps:
    """Reads the grasps of a file; `score` is `object_in_gripper`.

    Raises:
        InvalidInputError: no such file, or an invalid value; the message says where.
    """
    document = load_json(path, FileLimits.grasp_file)
    if not isinstance(document, dict):
        raise InvalidInputError(
            f"{path}: the file holds a {type(document).__name__} instead of a mapping"
        )
    grasps = _require_mapping(path, document, "grasps")
    given = grasps.get("transforms")
    if not isinstance(given, list):
        raise InvalidInputError(f"{path}: grasps.transforms is missing or not a list of matrices")
    where = f"{path}: grasps.transforms"
    X_OF, rounded = nearest_rigid(given if given else np.empty((0, 4, 4)), where)
    score = _read_success(path, grasps, len(X_OF))
    notes, offset = _gripper_offset(path, document, gripper)
    name, description, scale_notes = _read_object(path, document)
    if score is None:
        notes += (f"The file has no {GRASP_SUCCESS_COLUMN}, hence no scores.",)
    set_ = GraspSet.create(
        X_OF @ offset @ inverse(gripper.X_GB),
        object=name,
        score=score,
        provenance=file_provenance(GRASPGEN_FORMAT, path, object_files={name: description}),
    )
    further = sorted(set(grasps) - {"transforms", GRASP_SUCCESS_COLUMN})
    ignored_notes = (f"Ignored: grasps.{', grasps.'.join(further)}.",) if further else ()
    return ImportedGrasps(set_, "object", (*notes, *rounded, *scale_notes, *ignored_notes))


def _require_mapping(path: Path, document: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(document.get(key), dict):
        raise InvalidInputError(
            f"{path}: {key} is missing or not a mapping; is it a GraspGen file?"
        )
    value: dict[str, Any] = document[key]
    return value


def _read_success(path: Path, grasps: dict[str, Any], n: int) -> Array | None:
    """(N,) success, 1 or 0; None if the file does not have it."""
    if GRASP_SUCCESS_COLUMN not in grasps:
        return None
    where = f"{path}: grasps.{GRASP_SUCCESS_COLUMN}"
    given = grasps[GRASP_SUCCESS_COLUMN]
    if not isinstance(given, list) or len(given) != n:
        shown = f"{len(given)} values" if isinstance(given, list) else quote_value(given)
        raise InvalidInputError(f"{where} has {shown}; expected {n}, one for each grasp")
    for i, value in enumerate(given):
        if not isinstance(value, (bool, int, float)) or value not in (0, 1):
            raise InvalidInputError(
                f"{where}[{i}] is {quote_value(value)}; expected true, false, 0 or 1"
            )
    return np.array(given, dtype=float)


def _read_object(
    path: Path, document: dict[str, Any]
) -> tuple[str, dict[str, Any], tuple[str, ...]]:
    """The object's name, its description in the file, and a note about its scale."""
    if "object" not in document:
        note = f"The file names no object; the object is called {path.stem!r}, like the file."
        return path.stem, {}, (note,)
    object = _require_mapping(path, document, "object")
    file, scale = object.get("file"), object.get("scale")
    if not isinstance(file, str) or not file:
        raise InvalidInputError(
            f"{path}: object.file is {quote_value(file)}; expected the name of a mesh"
        )
    is_number = isinstance(scale, (int, float)) and not isinstance(scale, bool)
    if scale is None or not is_number or not 0.0 < scale < np.inf:
        raise InvalidInputError(
            f"{path}: object.scale is {quote_value(scale)}; expected a number above 0"
        )
    name = object_name(file)
    return name, {"file": file, "scale": float(scale)}, (scale_note(name, file, scale),)


def _gripper_offset(
    path: Path, document: dict[str, Any], gripper: Gripper
) -> tuple[tuple[str, ...], Array]:
    """Notes about the gripper, and the (4, 4) offset by which transforms are multiplied."""
    key = "transform_offset_from_asset_to_graspgen_convention"
    if "gripper" not in document:
        return (), np.eye(4)
    given = _require_mapping(path, document, "gripper")
    notes: tuple[str, ...] = ()
    if isinstance(given.get("name"), str):
        notes = check_gripper_name(given["name"], gripper, f"{path}: gripper.name")
    where = f"{path}: gripper.{key}"
    offset = given.get(key, np.eye(4).reshape(-1).tolist())
    try:
        if len(offset) == 2:
            p, xyzw = (np.array(part, dtype=float) for part in offset)
            w = np.linalg.norm(xyzw)
            if p.shape == (3,) and xyzw.shape == (4,) and np.isfinite(p).all() and 0.0 < w < np.inf:
                return notes, make_pose(rotation_from_quaternion(np.roll(xyzw, 1)), p)
        else:
            poses, _ = nearest_rigid(np.array(offset, dtype=float).reshape(1, 4, 4), where)
            return notes, poses[0]
    except (TypeError, ValueError):
        pass
    raise InvalidInputError(f"{where} is {quote_value(offset)}; expected [[x, y, z], [x, y, z, w]]")


def write_graspgen(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    """Writes the grasps of one object.

    Raises:
        InvalidInputError: grasps of several objects, success known for some grasps only, or the
            file cannot be written.
    """
    name = require_single_object(grasps, "a GraspGen file")
    description = shareable_description(grasps, name, path)
    success = success_labels(grasps)
    unknown = int(np.isnan(success).sum())
    if 0 < unknown < len(grasps):
        raise InvalidInputError(
            f"for {unknown} of {len(grasps)} grasps it is not known whether they succeed;"
            " GraspGen needs that for all grasps or for none: select those for which it"
            " is known"
        )
    file, scale = str(description.get("file", f"{name}.obj")), float(description.get("scale", 1.0))
    content: dict[str, Any] = {"transforms": (grasps.X_OG @ gripper.X_GB).tolist()}
    notes = []
    if "file" not in description:
        notes.append(
            f"object.file is {file!r} and object.scale 1, as it is not known which mesh "
            f"{name!r} was made of."
        )
    if unknown:
        notes.append(
            f"The file has no {GRASP_SUCCESS_COLUMN}, as it is not known which grasps succeed."
        )
    else:
        content[GRASP_SUCCESS_COLUMN] = (success > 0.5).tolist()
    document = {"object": {"file": file, "scale": scale}, "grasps": content}
    atomic_write(path, json.dumps(document))
    carried = ["object", GRASP_SUCCESS_COLUMN, "outcome"]
    carried += ["score"] if np.array_equal(grasps.score, success, equal_nan=True) else []
    return (*notes, *conversion_losses(grasps, carried, GRASPGEN_FORMAT.title))


GRASPGEN_FORMAT = GraspFormat(
    name="graspgen",
    title="GraspGen data set",
    suffixes=(".json",),
    frame="object",
    source="github.com/NVlabs/GraspGen, docs/GRASP_DATASET_FORMAT.md",
    carries=("score as object_in_gripper", "mesh and scale"),
    cannot_carry=(
        "ids",
        "several objects",
        "scores other than 0 and 1",
        "width",
        "further columns",
    ),
    X_GF=lambda gripper: gripper.X_GB,
    recognises=recognise_graspgen,
    read=read_graspgen,
    write=write_graspgen,
    one_object=True,
)
"""The format of GraspGen's data sets."""
