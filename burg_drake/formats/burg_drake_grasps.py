"""Our own files of grasps, as one format among the others; see `core.grasp_storage`."""

from __future__ import annotations

import zipfile
from pathlib import Path

from burg_drake.core.damaged import DAMAGED
from burg_drake.core.frames import Array, make_pose
from burg_drake.core.grasp_storage import FORMAT as MARK
from burg_drake.core.grasp_storage import HDF5_SIGNATURE
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.grasp_format import GraspFormat, Gripper, Imported


def _X_GF(gripper: Gripper) -> Array:
    return make_pose()


def _recognises(path: Path) -> bool:
    try:
        with open(path, "rb") as stream:
            start = stream.read(len(HDF5_SIGNATURE))
        if start == HDF5_SIGNATURE:
            import h5py

            with h5py.File(path, "r") as file:
                return bool(file.attrs.get("format") == MARK)
        with zipfile.ZipFile(path) as archive:
            return {"header.npy", "X_OG.npy"} <= set(archive.namelist())
    except (OSError, *DAMAGED):
        return False


def _read(path: Path, gripper: Gripper) -> Imported:
    return Imported(GraspSet.load(path), "object")


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    grasps.save(path)
    return ()


FORMAT = GraspFormat(
    name="burg_drake",
    title="burg_drake",
    suffixes=(".h5", ".npz", ".hdf5"),
    frame="object",
    source="core/grasp_storage.py of this project",
    carries=("everything",),
    cannot_carry=(),
    X_GF=_X_GF,
    recognises=_recognises,
    read=_read,
    write=_write,
)
"""The format; see the module."""
