"""Grasps of a sample as `.npz`, whose bytes follow from its arrays alone.

`numpy.savez` keeps the time of writing in the archive; here all members have the same.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, check_pose
from burg_drake.core.files import NpzFile, reporting_read_errors
from burg_drake.dataset.labels import LabelledGrasps

TIME = (1980, 1, 1, 0, 0, 0)
"""The first that ZIP has."""
UNIX = 3
"""The system that ZIP names as the writer's."""
PERMISSIONS = 0o644 << 16
LEVEL = 1
"""Of compression: outcomes shrink to little at any, poses at none."""
MARGIN = "margin."
"""Begins the names of arrays of margins."""
KIND = "a .npz file of grasps"


def encode_grasps(grasps: LabelledGrasps) -> bytes:
    """The file of grasps."""
    arrays: dict[str, NDArray[Any]] = {
        "X_CG": np.asarray(grasps.X_CG, dtype="<f8"),
        "width": np.asarray(grasps.width, dtype="<f8"),
        "number": np.asarray(grasps.number, dtype="<u2"),
        "outcome": np.array(grasps.outcome.tolist(), dtype="<U"),  # no wider than it has to be
    }
    for name in sorted(grasps.margins):
        arrays[MARGIN + name] = np.asarray(grasps.margins[name], dtype="<f8")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in arrays.items():
            info = zipfile.ZipInfo(f"{name}.npy", TIME)
            info.create_system, info.external_attr = UNIX, PERMISSIONS
            content = io.BytesIO()
            np.lib.format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(info, content.getvalue(), zipfile.ZIP_DEFLATED, LEVEL)
    return buffer.getvalue()


def decode_grasps(data: bytes, where: str) -> LabelledGrasps:
    """The grasps of a file.

    Args:
        data: of the file.
        where: shard and member, for messages.

    Raises:
        InvalidInputError: it is damaged, or holds something else.
    """
    with reporting_read_errors(where, KIND), zipfile.ZipFile(io.BytesIO(data)) as archive:
        file = NpzFile(Path(where), archive)
        poses = file.array("X_CG")
        n = poses.rows(4, 4)
        grasps = LabelledGrasps(
            X_CG=check_pose(poses.read("f"), "X_CG"),
            width=file.array("width").read("f", (n,)).astype(float),
            number=file.array("number").read("fiu", (n,)).astype(np.uint16),
            outcome=file.array("outcome").read("U", (n,)),
            margins={
                name.removeprefix(MARGIN): file.array(name).read("f", (n,)).astype(float)
                for name in file.names
                if name.startswith(MARGIN)
            },
        )
    return grasps


def require_fitting(grasps: LabelledGrasps, instances: int, where: str) -> None:
    """Refuses grasps whose arrays have different lengths, or that grasp nothing of the sample.

    Raises:
        InvalidInputError: they do.
    """
    if grasps.X_CG.shape != (len(grasps), 4, 4):
        raise InvalidInputError(
            f"{where}: X_CG of grasps has shape {grasps.X_CG.shape}; expected (N, 4, 4)"
        )
    columns: dict[str, NDArray[Any]] = {
        "width": grasps.width,
        "number": grasps.number,
        "outcome": grasps.outcome,
    }
    for name, column in (columns | dict(grasps.margins)).items():
        if column.shape != (len(grasps),):
            raise InvalidInputError(
                f"{where}: {name} of grasps has shape {column.shape}; expected one value for each"
                f" of the {len(grasps)} grasps"
            )
    if len(grasps) and not 1 <= grasps.number.min() <= grasps.number.max() <= instances:
        raise InvalidInputError(
            f"{where}: grasps are of instances {grasps.number.min()} to {grasps.number.max()}; the"
            f" sample has instances 1 to {instances}"
        )
