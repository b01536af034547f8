"""The table of a recording: where the camera was in each picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.pose import BoardEstimate
from burg_drake.core import (
    Array,
    DocumentError,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion as from_quaternion,
)
from burg_drake.core.files import read_rows

COLUMNS = (
    *("frame", "time", "valid", "x", "y", "z", "qw", "qx", "qy", "qz"),
    *("reprojection_error", "markers", "reason"),
)


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """The table of a recording.

    Attributes:
        frames: (N,) the frame of the video that first shows it.
        times: (N,) of the pictures [s].
        X_SC: (N, 4, 4) camera in the scene frame; NaN where there was no pose.
    """

    frames: NDArray[np.int64]
    times: Array
    X_SC: Array


def table_row(frame: int, time: float, estimate: BoardEstimate) -> list[Any]:
    """A row of `COLUMNS`.

    Args:
        frame: of the video.
        time: of the picture [s].
        estimate: of the camera's pose.
    """
    error = estimate.reprojection_error
    return [
        frame,
        f"{time:.6f}",
        int(estimate.valid),
        *_pose_columns(estimate),
        f"{error:.6g}" if np.isfinite(error) else "",
        len(estimate.ids),
        estimate.reason,
    ]


def read_poses(path: str | Path) -> RecordedPoses:
    """Reads the table of a recording.

    Raises:
        DocumentError: the file is missing, or is none.
    """
    path = Path(path)
    try:
        (_, header), *lines = read_rows(path)
        rows = [dict(zip(header, cells, strict=True)) for _, cells in lines]
        poses = [_pose(row) for row in rows]
        numbers = [(int(row["frame"]), float(row["time"])) for row in rows]
    except DocumentError:
        raise
    except (KeyError, ValueError) as error:
        raise DocumentError(
            f"{path} is not the table of a recording; expected the columns {', '.join(COLUMNS)}"
        ) from error
    return RecordedPoses(
        np.array([frame for frame, _ in numbers], dtype=np.int64),
        np.array([time for _, time in numbers], dtype=float),
        np.array(poses, dtype=float).reshape(-1, 4, 4),
    )


def _pose_columns(estimate: BoardEstimate) -> list[str]:
    if not estimate.valid:
        return [""] * 7
    X_SC = estimate.X_SC
    values = (*X_SC[:3, 3], *quaternion_from_rotation(X_SC[:3, :3]))
    return [f"{value:.9g}" for value in values]


def _pose(row: dict[str, Any]) -> Array:
    if row["valid"] != "1":
        return np.full((4, 4), np.nan)
    p, q = ([float(row[name]) for name in names] for names in (COLUMNS[3:6], COLUMNS[6:10]))
    return make_pose(from_quaternion(q), p)
