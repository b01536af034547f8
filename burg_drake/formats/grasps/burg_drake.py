"""Our own files of grasps, as one format among the others; see `core.grasps.storage`."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core import Array, make_pose
from burg_drake.core.files import READ_ERRORS, is_hdf5, open_hdf5, open_npz
from burg_drake.core.grasps import FORMAT as MARK, GraspSet
from burg_drake.formats.common import GraspFormat, Gripper, ImportedGrasps


def _X_GF(gripper: Gripper) -> Array:
    return make_pose()


def _recognises(path: Path) -> bool:
    try:
        if is_hdf5(path):
            with open_hdf5(path) as tree:
                return bool(tree.attribute("format") == MARK)
        with open_npz(path) as file:
            return {"header", "X_OG"} <= set(file.names)
    except (OSError, *READ_ERRORS):
        return False


def _read(path: Path, gripper: Gripper) -> ImportedGrasps:
    return ImportedGrasps(GraspSet.load(path), "object")


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    grasps.save(path)
    return ()


FORMAT = GraspFormat(
    name="burg_drake",
    title="burg_drake",
    suffixes=(".h5", ".npz", ".hdf5"),
    frame="object",
    source="core/grasps/storage.py of this project",
    carries=("everything",),
    cannot_carry=(),
    X_GF=_X_GF,
    recognises=_recognises,
    read=_read,
    write=_write,
)
"""The format; see the module."""
