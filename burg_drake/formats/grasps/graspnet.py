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

Our G lies between the pads' centres, `Gripper.tip` behind the finger tips. Tips are put where the
file has them, so G is `depth - tip` beyond the file's origin.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, InvalidInputError, inverse, make_pose
from burg_drake.core.files import npy_shape, open_npy, write_npy
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.common import (
    PREGRASP_WIDTH,
    GraspFormat,
    Gripper,
    ImportedGrasps,
    conversion_losses,
    nearest_rigid,
)

NUMBERS = 17
"""In a row."""
SCORE, WIDTH, HEIGHT, DEPTH, OBJECT = 0, 1, 2, 3, 16
ROTATION, TRANSLATION = slice(4, 13), slice(13, 16)
DEFAULT_HEIGHT = 0.02
DEFAULT_DEPTH = 0.02
"""Of grasps that come without [m]; labels and networks have depths of 0.01 to 0.04."""
NO_OBJECT = -1
"""Object id of grasps that come without."""
ARRIVAL_CLEARANCE = 0.01
"""Room between each finger and its contact on arrival, of grasps that come without an opening [m].
Ours, as much as their fingers are thick: enough for contacts that are not the outermost points."""

R_FG = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Our grasp frame in theirs: z, the approach, is their x, and x, the closing direction, their y."""


def X_FG(depth: ArrayLike, gripper: Gripper) -> Array:
    """Our grasp frame (..., 4, 4) in theirs, for depths (...) [m]."""
    beyond = np.asarray(depth, dtype=float) - gripper.tip
    return make_pose(R_FG, beyond[..., None] * (1.0, 0.0, 0.0))


def _X_GF(gripper: Gripper) -> Array:
    return inverse(X_FG(DEFAULT_DEPTH, gripper))


def _X_GF_each(grasps: GraspSet, gripper: Gripper) -> Array:
    return inverse(X_FG(_numbers(grasps, "depth", DEFAULT_DEPTH), gripper))


def _recognises(path: Path) -> bool:
    shape = npy_shape(path)
    return shape is not None and len(shape) == 2 and shape[1] == NUMBERS


def _read(path: Path, gripper: Gripper) -> ImportedGrasps:
    with open_npy(path) as stored:
        stored.rows(NUMBERS)
        rows = stored.read("fiu").astype(float)
    bad = ~np.isfinite(rows[:, DEPTH]) | (np.abs(rows[:, DEPTH]) > 1.0)
    if bad.any():
        i = int(np.argmax(bad))
        raise InvalidInputError(
            f"{path}: row {i} has depth {rows[i, DEPTH]:g}; depths must be in metres"
        )
    given = make_pose(rows[:, ROTATION].reshape(-1, 3, 3), rows[:, TRANSLATION])
    X_CF, notes = nearest_rigid(given, f"{path}: columns 4 to 15")
    ids = rows[:, OBJECT]
    grasps = GraspSet.create(
        X_CF @ X_FG(rows[:, DEPTH], gripper),
        object="",
        score=rows[:, SCORE],
        provenance={"format": FORMAT.name, "file": str(path.absolute())},
        columns={
            PREGRASP_WIDTH: rows[:, WIDTH],
            "height": rows[:, HEIGHT],
            "depth": rows[:, DEPTH],
            "object_id": np.where(np.isfinite(ids), ids, NO_OBJECT).astype(np.int64),
        },
    )
    return ImportedGrasps(grasps, FORMAT.frame, notes)


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    n = len(grasps)
    carried = ("score", PREGRASP_WIDTH, "height", "depth", "object_id")
    opening, assumed = _openings(grasps, gripper)
    notes = (
        *conversion_losses(grasps, carried, FORMAT.title),
        *assumed,
    )
    score = grasps.score
    if np.isnan(score).any():
        notes += (f"{int(np.isnan(score).sum())} grasps without a score got score 0.",)
    depth = _numbers(grasps, "depth", DEFAULT_DEPTH)
    X_CF = grasps.X_OG @ inverse(X_FG(depth, gripper))
    rows = np.empty((n, NUMBERS))
    rows[:, SCORE] = np.where(np.isnan(score), 0.0, score)
    rows[:, WIDTH] = opening
    rows[:, HEIGHT] = _numbers(grasps, "height", DEFAULT_HEIGHT)
    rows[:, DEPTH] = depth
    rows[:, ROTATION] = X_CF[:, :3, :3].reshape(n, 9)
    rows[:, TRANSLATION] = X_CF[:, :3, 3]
    rows[:, OBJECT] = _numbers(grasps, "object_id", NO_OBJECT)
    write_npy(path, rows.astype(np.float32))
    return (*notes, "Numbers are stored in single precision.")


def _openings(grasps: GraspSet, gripper: Gripper) -> tuple[Array, tuple[str, ...]]:
    """(N,) distance of the pads on arrival [m], and notes about those that had to be assumed."""
    widest = gripper.opening[1]
    given = _numbers(grasps, PREGRASP_WIDTH, np.nan)
    roomy = np.minimum(grasps.width + 2.0 * ARRIVAL_CLEARANCE, widest)
    of_width = np.isnan(given) & ~np.isnan(roomy)
    unknown = np.isnan(given) & np.isnan(roomy)
    notes: tuple[str, ...] = ()
    if of_width.any():
        notes += (
            "The width in the file is the opening when the hand arrives: "
            f"{int(of_width.sum())} grasps got the distance of their contacts and "
            f"{2e3 * ARRIVAL_CLEARANCE:g} mm, at most {widest:g} m.",
        )
    if unknown.any():
        count = int(unknown.sum())
        notes += (f"{count} grasps of unknown width got the hand's opening of {widest:g} m.",)
    return np.where(of_width, roomy, np.where(unknown, widest, given)), notes


def _numbers(grasps: GraspSet, name: str, default: float) -> Array:
    """A column of numbers, with a default where there are none."""
    values = grasps.columns.get(name)
    if values is None:
        return np.full(len(grasps), default)
    if values.dtype.kind == "U":
        raise InvalidInputError(
            f"column {name!r} holds text, but a file of {FORMAT.title} can only have numbers"
        )
    return np.where(np.isfinite(values), values, default).astype(float)


FORMAT = GraspFormat(
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
    X_GF=_X_GF,
    X_GF_each=_X_GF_each,
    recognises=_recognises,
    read=_read,
    write=_write,
)
"""The format; see the module. `X_GF` is that of a depth of 0.02 m."""
