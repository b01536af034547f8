"""GraspNet-1Billion: `.npy` files of N x 17 numbers, as `GraspGroup.save_npy` writes them.

From the sources of github.com/graspnet/graspnetAPI and of networks that are trained on it:

- A row is score, width, height, depth, rotation (9, row by row), translation (3), object id
  (`Grasp` in graspnetAPI/grasp.py), in single precision, in the frame of the camera.
- In the frame of a grasp x is the approach and y the closing direction. The origin is a point of
  the object's surface that the network has chosen; the finger tips are `depth` beyond it along x,
  and the contacts are taken to be at the tips (`plot_gripper_pro_max` in utils/utils.py,
  `collision_detection` in utils/eval_utils.py). `width` is the opening with which the hand
  arrives, not the distance of the contacts: grasps collide whose object reaches into the fingers'
  boxes, which begin at +-width/2. `height` is the fingers' size along z (0.02 m in networks and in
  the evaluation).
- A higher score is better: 1.1 - friction coefficient in labels that the API has loaded
  (docs/source/grasp_format.rst), a confidence from networks. Networks write -1 as object id
  (`pred_decode` of graspnet/graspnet-baseline).

The origin of G lies between the centres of the pads, `Gripper.tip` behind the finger tips. The tips
are placed where the file has them, so G is `depth - tip` beyond the file's origin.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    inverse,
    make_pose,
    npy_shape,
    open_npy,
    write_npy,
)
from burg_drake.formats.grasp_format import (
    PREGRASP_WIDTH_COLUMN,
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
    file_provenance,
)
from burg_drake.formats.pose_files import nearest_rigid

DEFAULT_HEIGHT = 0.02
"""Metres."""
DEFAULT_DEPTH = 0.02
"""Metres; labels and networks have depths of 0.01 to 0.04."""
NO_OBJECT_ID = -1
"""Object number of grasps of unknown objects."""


def graspnet_X_FG(depth: ArrayLike, gripper: Gripper) -> Array:
    """Poses (..., 4, 4) of our grasp frame G in GraspNet's frame F, for depths (...) [m]."""
    # Axes of G in the format's frame F: z, the approach, is x of F; x is y of F.
    rotation = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    beyond = np.asarray(depth, dtype=float) - gripper.tip
    return make_pose(rotation, beyond[..., None] * (1.0, 0.0, 0.0))


def _X_GF_each(grasps: GraspSet, gripper: Gripper) -> Array:
    return inverse(graspnet_X_FG(_column_or_default(grasps, "depth", DEFAULT_DEPTH), gripper))


def _recognise(path: Path) -> bool:
    shape = npy_shape(path)
    return shape is not None and len(shape) == 2 and shape[1] == 17


def _read(path: Path, gripper: Gripper) -> ImportedGrasps:
    with open_npy(path) as stored:
        stored.require_rows(17)
        rows = stored.read("fiu").astype(float)
    score, opening, height, depth = rows[:, :4].T
    ids = rows[:, 16]
    bad = ~np.isfinite(depth) | (np.abs(depth) > 1.0)
    if bad.any():
        i = int(np.argmax(bad))
        raise InvalidInputError(f"{path}: row {i} has depth {depth[i]:g}; depths must be in metres")
    given = make_pose(rows[:, 4:13].reshape(-1, 3, 3), rows[:, 13:16])
    X_CF, notes = nearest_rigid(given, f"{path}: columns 4 to 15")
    grasps = GraspSet.create(
        X_CF @ graspnet_X_FG(depth, gripper),
        object="",
        score=score,
        provenance=file_provenance(GRASPNET_FORMAT, path),
        columns={
            PREGRASP_WIDTH_COLUMN: opening,
            "height": height,
            "depth": depth,
            "object_id": np.where(np.isfinite(ids), ids, NO_OBJECT_ID).astype(np.int64),
        },
    )
    return ImportedGrasps(grasps, GRASPNET_FORMAT.frame, notes)


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    carried = ("score", PREGRASP_WIDTH_COLUMN, "height", "depth", "object_id")
    opening, assumed = _arrival_openings(grasps, gripper)
    notes = (*conversion_losses(grasps, carried, GRASPNET_FORMAT.title), *assumed)
    score = grasps.score
    if np.isnan(score).any():
        notes += (f"{int(np.isnan(score).sum())} grasps without a score got score 0.",)
    depth = _column_or_default(grasps, "depth", DEFAULT_DEPTH)
    X_CF = grasps.X_OG @ inverse(graspnet_X_FG(depth, gripper))
    rows = np.column_stack(
        [
            np.where(np.isnan(score), 0.0, score),
            opening,
            _column_or_default(grasps, "height", DEFAULT_HEIGHT),
            depth,
            X_CF[:, :3, :3].reshape(-1, 9),
            X_CF[:, :3, 3],
            _column_or_default(grasps, "object_id", NO_OBJECT_ID),
        ]
    )
    write_npy(path, rows.astype(np.float32))
    return (*notes, "Numbers are stored in single precision.")


def _arrival_openings(grasps: GraspSet, gripper: Gripper) -> tuple[Array, tuple[str, ...]]:
    """(N,) distance between the pads on arrival [m], and notes about assumed values."""
    arrival_clearance = 0.01  # Assumed metres between each finger and its contact on arrival.
    widest = gripper.opening[1]
    given = _column_or_default(grasps, PREGRASP_WIDTH_COLUMN, np.nan)
    roomy = np.minimum(grasps.width + 2.0 * arrival_clearance, widest)
    of_width = np.isnan(given) & ~np.isnan(roomy)
    unknown = np.isnan(given) & np.isnan(roomy)
    notes: tuple[str, ...] = ()
    if of_width.any():
        notes += (
            "The width in the file is the opening when the hand arrives: "
            f"{int(of_width.sum())} grasps got the distance of their contacts and "
            f"{2e3 * arrival_clearance:g} mm, at most {widest:g} m.",
        )
    if unknown.any():
        count = int(unknown.sum())
        notes += (f"{count} grasps of unknown width got the hand's opening of {widest:g} m.",)
    return np.where(of_width, roomy, np.where(unknown, widest, given)), notes


def _column_or_default(grasps: GraspSet, name: str, default: float) -> Array:
    """A column of numbers, with a default for missing values."""
    values = grasps.columns.get(name)
    if values is None:
        return np.full(len(grasps), default)
    if values.dtype.kind == "U":
        raise InvalidInputError(
            f"column {name!r} holds text, but a file of {GRASPNET_FORMAT.title} can only have"
            " numbers"
        )
    return np.where(np.isfinite(values), values, default).astype(float)


GRASPNET_FORMAT = GraspFormat(
    name="graspnet",
    title="GraspNet-1Billion",
    suffixes=(".npy",),
    frame="camera",
    source="github.com/graspnet/graspnetAPI, graspnetAPI/grasp.py",
    carries=("score", "pregrasp_width", "height", "depth", "object_id"),
    cannot_carry=(
        "ids",
        "width",
        "names of objects",
        "further columns",
        "provenance",
        "double precision",
    ),
    X_GF=lambda gripper: inverse(graspnet_X_FG(DEFAULT_DEPTH, gripper)),
    X_GF_each=_X_GF_each,
    recognises=_recognise,
    read=_read,
    write=_write,
)
"""The format. Its `X_GF` is the one for a depth of 0.02 m."""
