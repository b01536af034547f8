"""Grasps of the ACRONYM dataset: one HDF5 file for each object and scale.

The layout is that of C. Eppner, A. Mousavian, D. Fox, "ACRONYM: A Large-Scale Grasp Dataset Based
on Simulation", ICRA 2021, as `load_mesh` and `load_grasps` in acronym_tools/acronym.py
(github.com/NVlabs/acronym) read it:

- `grasps/transforms` (N, 4, 4): poses of the gripper in the frame of the scaled mesh [m].
  `grasps/qualities/flex` has the trials of the simulator FleX, each (N,): `object_in_gripper` (1 or
  0) and `object_motion_during_{closing,shaking}_{linear,angular}`.
- `object/file` is the mesh, such as `meshes/Mug/10f6....obj`, `object/scale` the factor that
  `load_mesh` applies to it. `object/mass`, `friction`, `inertia`, `com`, `density`, `volume`
  describe it further.
- `gripper/type` is `panda`, `gripper/configuration` the opening of each finger.
- Labels of other simulators have the JSON attribute `labelled_by` at the root: engine, protocol and
  settings of the trials.
- Files are named after category, mesh and scale: `Mug_10f6..._0.0002682457830986903.h5`.

The gripper frame has its origin at the hand's base, which for the Panda is the frame of its link
`panda_hand`, +z towards the tips and x along the closing direction, the left finger at +x, as
`create_gripper_marker` (fingers at x = +-0.041 m, tips at z = 0.112 m) draws it, and the author of
the dataset confirms the same of its predecessor (github.com/NVlabs/6dof-graspnet, issue 8).

Written files have further columns in `grasps/qualities/burg_drake`, next to `flex`.
"""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    FIXED_COLUMNS,
    NUMBER_KINDS,
    READ_ERRORS,
    Array,
    ArrayShape,
    GraspSet,
    Hdf5File,
    InvalidInputError,
    atomic_write,
    inverse,
    is_hdf5,
    open_hdf5,
    report_read_errors,
)
from burg_drake.formats.grasp_conversion import (
    GRASP_SUCCESS_COLUMN,
    HAND_ALIASES,
    LABELLED_BY,
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

TRANSFORMS = "grasps/transforms"
"""Data set of the poses (N, 4, 4)."""
QUALITIES = "grasps/qualities"
"""Group of the results of trials: `flex` of the simulator, `burg_drake` of further columns."""
ACRONYM_OBJECT_PROPERTIES: dict[str, tuple[ArrayShape, ...]] = {
    **dict.fromkeys(("mass", "friction", "density", "volume"), ((), (1,))),
    "com": ((3,),),
    "inertia": ((3, 3), (9,)),
}
"""Properties of the object in a file, with their array shapes."""


def recognise_acronym(path: Path) -> bool:
    """Whether a file is HDF5 with `grasps/transforms`."""
    try:
        if not is_hdf5(path):
            return False
        with open_hdf5(path) as file:
            return TRANSFORMS in file
    except (OSError, *READ_ERRORS):
        return False


def read_acronym(path: Path, gripper: Gripper) -> ImportedGrasps:
    """Reads the grasps of a file; `score` is `object_in_gripper`.

    Raises:
        InvalidInputError: no such file, or an invalid value; the message says where.
    """
    with report_read_errors(path, "a readable HDF5 file"), open_hdf5(path) as file:
        return _read_tree(path, file, gripper)


def _read_tree(path: Path, file: Hdf5File, gripper: Gripper) -> ImportedGrasps:
    notes: tuple[str, ...] = ()
    X_OF, rounded = nearest_rigid(_read_poses(file), f"{path}: {TRANSFORMS}")
    mesh = _read_text(file, "object/file")
    scale = _read_number(file, "object/scale")
    if scale <= 0.0:
        raise InvalidInputError(f"{path}: object/scale is {scale:g}; it must be above 0")
    name = object_name(mesh)
    description: dict[str, Any] = {"file": mesh, "scale": scale}
    for key, shapes in ACRONYM_OBJECT_PROPERTIES.items():
        if f"object/{key}" in file:
            values = file.array(f"object/{key}").read(NUMBER_KINDS, *shapes).astype(float)
            if np.isfinite(values).all():
                description[key] = values.tolist()
    if "gripper/type" in file:
        notes = check_gripper_name(
            _read_text(file, "gripper/type"), gripper, f"{path}: gripper/type"
        )
    columns = _read_qualities(file, len(X_OF))
    success = columns.pop(GRASP_SUCCESS_COLUMN, None)
    width = columns.pop("width", None)
    score = columns.pop("score", success)
    if success is not None and score is not success:
        columns[GRASP_SUCCESS_COLUMN] = success
    grasps = GraspSet.create(
        X_OF @ inverse(gripper.X_GB),
        object=name,
        width=width,
        score=score,
        columns=columns,
        provenance=file_provenance(
            ACRONYM_FORMAT, path, object_files={name: description}, **_read_labelled_by(file)
        ),
    )
    return ImportedGrasps(grasps, "object", (*notes, *rounded, scale_note(name, mesh, scale)))


def _read_poses(file: Hdf5File) -> NDArray[Any]:
    if TRANSFORMS not in file:
        raise InvalidInputError(f"{file.path}: {TRANSFORMS} is missing; is it an ACRONYM file?")
    stored = file.array(TRANSFORMS)
    stored.require_rows(4, 4)
    return stored.read("fiu")


def _read_qualities(file: Hdf5File, n: int) -> dict[str, NDArray[Any]]:
    """(n,) values by column: results of FleX and of burg_drake by their names, others as
    `SIMULATOR.NAME`."""
    columns: dict[str, NDArray[Any]] = {}
    if QUALITIES not in file:
        return columns
    for simulator in file.names(QUALITIES):
        for name in file.names(f"{QUALITIES}/{simulator}"):
            values = file.array(f"{QUALITIES}/{simulator}/{name}").read(NUMBER_KINDS, (n,))
            plain = simulator in ("flex", "burg_drake") and name not in FIXED_COLUMNS
            plain = plain or (simulator == "burg_drake" and name in ("score", "width"))
            columns[name if plain else f"{simulator}.{name}"] = values.astype(float)
    return columns


def _read_labelled_by(file: Hdf5File) -> dict[str, Any]:
    """The attribute `labelled_by` as an entry of a provenance; empty if there is none to read."""
    try:
        return {LABELLED_BY: json.loads(file.attribute(LABELLED_BY))}
    except (KeyError, TypeError, ValueError):
        return {}


def _read_number(file: Hdf5File, key: str) -> float:
    values = file.array(key).read("fiu", (), (1,))
    if not np.isfinite(values).all():
        raise InvalidInputError(f"{file.path}: {key} is {values.item()}; expected a finite number")
    return float(values.item())


def _read_text(file: Hdf5File, key: str) -> str:
    value = str(file.array(key).read("U", (), (1,)).item())
    if not value:
        raise InvalidInputError(f"{file.path}: {key} is empty; expected a name")
    return value


def write_acronym(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    """Writes the grasps of one object.

    Raises:
        InvalidInputError: grasps of several objects, or the file cannot be written.
    """
    import h5py

    name = require_single_object(grasps, "an ACRONYM file")
    description = shareable_description(grasps, name, path)
    success = success_labels(grasps)
    notes = _notes_on_losses(grasps, name, description, success)
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["object/file"] = str(description.get("file", f"{name}.obj"))
        file["object/scale"] = float(description.get("scale", 1.0))
        for key in ACRONYM_OBJECT_PROPERTIES:
            if key in description:
                file[f"object/{key}"] = np.asarray(description[key], dtype=float)
        foreign = {ours: theirs for theirs, ours in reversed(HAND_ALIASES.items())}
        file["gripper/type"] = foreign.get(gripper.name, gripper.name)
        file["gripper/configuration"] = np.array([gripper.opening[1] / 2.0])
        if LABELLED_BY in grasps.provenance:
            file.attrs[LABELLED_BY] = json.dumps(grasps.provenance[LABELLED_BY])
        packed = {"compression": "gzip", "shuffle": True}
        file.create_dataset(TRANSFORMS, data=grasps.X_OG @ gripper.X_GB, **packed)
        for key, values in _quality_arrays(grasps, success).items():
            file.create_dataset(f"{QUALITIES}/{key}", data=values, **packed)
    atomic_write(path, buffer.getvalue())
    return notes


def _quality_arrays(grasps: GraspSet, success: Array) -> dict[str, NDArray[Any]]:
    """Values by data set below `grasps/qualities`."""
    flags = success if np.isnan(success).any() else success.astype(np.int64)
    result: dict[str, NDArray[Any]] = {f"flex/{GRASP_SUCCESS_COLUMN}": flags}
    if not np.array_equal(grasps.score, success, equal_nan=True):
        result["burg_drake/score"] = grasps.score
    if not np.isnan(grasps.width).all():
        result["burg_drake/width"] = grasps.width
    for name, values in grasps.columns.items():
        if name != GRASP_SUCCESS_COLUMN and values.dtype.kind in "fiub":
            simulator, _, rest = name.partition(".")
            simulated = re.fullmatch(
                "object_motion_during_(closing|shaking)_(angular|linear)", name
            )
            own = f"{'flex' if simulated else 'burg_drake'}/{name}"
            result[f"{simulator}/{rest}" if simulator and rest else own] = values
    return result


def _notes_on_losses(
    grasps: GraspSet, name: str, description: dict[str, Any], success: Array
) -> tuple[str, ...]:
    notes = []
    if "file" not in description:
        notes.append(
            f"object/file is {name + '.obj'!r} and object/scale 1, as it is not known"
            f" which mesh {name!r} was made of."
        )
    if np.isnan(success).any():
        notes.append(
            f"{GRASP_SUCCESS_COLUMN} is NaN for {int(np.isnan(success).sum())} grasps, as it is"
            " not known whether they succeed."
        )
    numbers = [key for key, values in grasps.columns.items() if values.dtype.kind in "fiub"]
    carried = ("object", "width", "score", "outcome", *numbers)
    if LABELLED_BY in grasps.provenance:
        carried += ("engine", "mode", "engine_settings", "trial_settings", "versions")
    return (*notes, *conversion_losses(grasps, carried, ACRONYM_FORMAT.title))


ACRONYM_FORMAT = GraspFormat(
    name="acronym",
    title="ACRONYM",
    suffixes=(".h5", ".hdf5"),
    frame="object",
    source="github.com/NVlabs/acronym, acronym_tools/acronym.py; Eppner et al., ICRA 2021",
    carries=("score as object_in_gripper", "width", "further numbers", "mesh, scale and mass"),
    cannot_carry=("ids", "several objects", "text columns", "provenance, but for labels"),
    X_GF=lambda gripper: gripper.X_GB,
    recognises=recognise_acronym,
    read=read_acronym,
    write=write_acronym,
    one_object=True,
)
"""The format of ACRONYM files."""
