"""Grasps of BURG-Toolkit: `.npy` files of poses (n, 4, 4), or of a `GraspSet`'s rows (n, 14).

From the sources of github.com/mrudorfer/burg-toolkit and of a project that keeps grasps in files,
github.com/mrudorfer/jogramop-framework:

- BURG-Toolkit has no grasp file of its own. What is kept is `numpy.save` of `GraspSet.poses`
  (create_graspset.py of jogramop-framework), (n, 4, 4) in single precision, or of the internal
  array, whose rows are translation (3), rotation (9, row by row), score, width
  (`Grasp.ARRAY_LEN = 14` in burg_toolkit/grasp.py), all 0 where nothing was set.
- x is the closing direction, and z points to where the hand comes from, against the approach
  (`construct_grasp_set` in sampling.py; `TwoFingerGripperVisualisation` in gripper/base.py).
- The origin is midway between the contacts (sampling.py), so it is our G; grasps of the sugar box
  in scenarios/031 of jogramop-framework have its faces at equal distances on both sides.
- Hands are loaded with an offset of their own: the Franka Hand with its base 0.115 m from there
  (gripper/franka.py), 0.0116 m further back than ours, so that its finger tips end 2.6 mm before
  the contacts. `ACRONYMSceneReader` in io.py takes 0.103 m.
- Poses are in the frame of the scene, whose origin is the corner of the ground area, when sampled
  on an `ObjectInstance`, as current versions do; in that of the mesh when sampled on one alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core import (
    GraspSet,
    InvalidInputError,
    make_pose,
    npy_shape,
    open_npy,
    require_grasp_count,
    write_npy,
)
from burg_drake.formats.grasp_format import (
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
    file_provenance,
)
from burg_drake.formats.pose_files import nearest_rigid

_X_GF = make_pose(np.diag([1.0, -1.0, -1.0]))
"""Half a turn about the closing direction; it is its own inverse."""


def _is_grasp_shape(shape: tuple[int, ...]) -> bool:
    return (len(shape) == 3 and shape[1:] == (4, 4)) or (len(shape) == 2 and shape[1] == 14)


def _recognise(path: Path) -> bool:
    shape = npy_shape(path)
    return shape is not None and _is_grasp_shape(shape)


def _read(path: Path, gripper: Gripper) -> ImportedGrasps:
    with open_npy(path) as stored:
        if not _is_grasp_shape(stored.shape):
            raise InvalidInputError(
                f"{path} has shape {stored.shape}; grasps of BURG-Toolkit have (n, 4, 4) or (n, 14)"
            )
        require_grasp_count(str(path), stored.shape[0])
        values = stored.read("fiu").astype(float)
    width = score = None
    where = str(path)
    if values.ndim == 2:
        # BURG-Toolkit leaves scores and widths that it has not set at 0.
        score, width = (v if v.any() else None for v in (values[:, 12], values[:, 13]))
        values = make_pose(values[:, 3:12].reshape(-1, 3, 3), values[:, :3])
        where = f"{path}: columns 0 to 11"
    X_SF, notes = nearest_rigid(values, where)
    provenance = file_provenance(BURG_TOOLKIT_FORMAT, path)
    grasps = GraspSet.create(
        X_SF @ _X_GF, object="", width=width, score=score, provenance=provenance
    )
    return ImportedGrasps(grasps, BURG_TOOLKIT_FORMAT.frame, notes)


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    write_npy(path, grasps.X_OG @ _X_GF)
    return conversion_losses(grasps, (), BURG_TOOLKIT_FORMAT.title)


BURG_TOOLKIT_FORMAT = GraspFormat(
    name="burg",
    title="BURG-Toolkit",
    suffixes=(".npy",),
    frame="world",
    source="github.com/mrudorfer/burg-toolkit, burg_toolkit/grasp.py",
    carries=(),
    cannot_carry=("ids", "width", "score", "names of objects", "further columns", "provenance"),
    X_GF=lambda gripper: _X_GF,
    recognises=_recognise,
    read=_read,
    write=_write,
)
"""The format. Rows of the internal array are read, not written."""
