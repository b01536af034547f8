"""The report's pictures: the scene as it was judged, and the grasps on its objects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, BurgError, rotation_from_quaternion
from burg_drake.core.terminal import format_count
from burg_drake.evaluation.records import Columns, best_rows
from burg_drake.evaluation.report.elements import (
    LIFTED,
    DrawnGrasps,
    Html,
    element,
    grasp_drawing,
    group_legend,
    present,
    scene_drawing,
    section,
    solid_of,
)
from burg_drake.evaluation.store import Run
from burg_drake.scene.document import Scene
from burg_drake.visualization.pictures import SolidMesh
from burg_drake.visualization.style import GROUPS

INSTANCES = 12
"""So many instances have a picture of their grasps, in the order of the scene."""
GRASPS = 1500
"""So many grasps are drawn in all pictures together."""
WIDTH = 0.05
"""Of the fork of a grasp whose width is not known [m]."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """What the pictures of a run are made from.

    Attributes:
        scene: as it was judged.
        columns: the results.
        groups: (N,) of each row, see `outcome_groups`.
    """

    scene: Scene
    columns: Columns
    groups: NDArray[np.int8]

    @cached_property
    def solids(self) -> dict[str, SolidMesh]:
        """Surfaces of the free instances in the scene frame."""
        return {name: solid_of(self.scene, name) for name in self.scene.instances}

    @cached_property
    def fixed(self) -> dict[str, SolidMesh]:
        """Surfaces of the fixed instances in the scene frame."""
        return {name: solid_of(self.scene, name) for name in self.scene.background}


def pictures_of(run: Run, groups: NDArray[np.int8]) -> Pictures | None:
    """What to draw; nothing if the files that the run was judged with are gone or have changed."""
    try:
        pictures = Pictures(run.scene(), run.results, groups)
        _ = pictures.solids, pictures.fixed
    except BurgError:
        return None
    return pictures


def scene_picture(pictures: Pictures | None) -> Html | None:
    """The scene with how many grasps lifted each object."""
    if pictures is None:
        return None
    instances, lifted = pictures.columns["instance"], pictures.groups == LIFTED
    notes = {}
    for name in pictures.scene.instances:
        mine = instances == name
        notes[name] = f"{int((mine & lifted).sum())} of {int(mine.sum())}" if mine.any() else ""
    drawing = scene_drawing(pictures.scene, pictures.solids, pictures.fixed, notes)
    text = (
        "The scene, seen from the near edge of the board, with the number of grasps that"
        " lifted each object."
    )
    return element("figure", drawing, element("figcaption", text))


def grasp_section(pictures: Pictures | None) -> Html | None:
    """Each instance with its grasps; nothing where there are none, or no meshes any more."""
    if pictures is None:
        return None
    instances = pictures.columns["instance"]
    with_grasps = [name for name in pictures.scene.instances if (instances == name).any()]
    shown = with_grasps[:INSTANCES]
    if not shown:
        return None
    figures, drawn = [], 0
    for name in shown:
        rows = np.flatnonzero(instances == name)
        chosen = rows[drawn_rows(pictures.groups[rows], GRASPS // len(shown))]
        figures.append(_figure(pictures, name, rows, chosen))
        drawn += len(chosen)
    total = int(np.isin(instances, shown).sum())
    text = "Each object as it stands in the scene: on the left with the grasps that lifted it, on"
    text += (
        " the right with all others. Each fork shows the two fingers; its stem points toward"
        " the arm. Point at"
    )
    text += " a grasp to see its id."
    if drawn < total:
        text += (
            f" Shown are {format_count(drawn)} of {format_count(total)} grasps, from all outcomes."
        )
    if len(shown) < len(with_grasps):
        text += f" The first {len(shown)} of {len(with_grasps)} objects are shown."
    return section(
        "The grasps",
        text,
        group_legend(present(pictures.groups)),
        element("div", *figures, class_="pictures"),
    )


def drawn_rows(groups: NDArray[np.int8], most: int) -> NDArray[np.int64]:
    """Which grasps (N,) to draw: all, or about `most` of them in the shares of their groups, with
    at least one of each group."""
    if len(groups) <= most:
        return np.arange(len(groups))
    order = np.argsort(groups, kind="stable")
    even = order[np.linspace(0, len(order) - 1, most).round().astype(np.int64)]
    first = [int(np.flatnonzero(groups == k)[0]) for k in np.unique(groups)]
    return np.union1d(even, np.array(first, dtype=np.int64))


def _figure(
    pictures: Pictures, name: str, rows: NDArray[np.int64], chosen: NDArray[np.int64]
) -> Html:
    columns, groups = pictures.columns, pictures.groups
    counts = np.bincount(groups[rows][groups[rows] >= 0], minlength=len(GROUPS))
    width = columns["width"][chosen]
    grasps = DrawnGrasps(
        ids=columns["id"][chosen],
        X_OG=poses(columns, chosen),
        width=np.where(np.isfinite(width), width, WIDTH),
        groups=groups[chosen],
        counts={k: int(n) for k, n in enumerate(counts)},
    )
    drawing = grasp_drawing(name, pictures.solids[name], pictures.scene.X_SO(name), grasps)
    best = best_rows({key: values[rows] for key, values in columns.items() if key in RANKED})
    caption = [
        element("b", name),
        f" {format_count(int(counts[LIFTED]))} of {format_count(len(rows))} lifted",
    ]
    if best:
        id = str(columns["id"][rows[best[0]]])
        caption += [", best: ", element("code", id, class_="copy")]
    return element("figure", element("figcaption", *caption), drawing)


RANKED = (
    *("id", "instance", "object", "outcome", "clearance", "slip", "tilt", "others_moved"),
    *("patch_area", "score", "confidence", "judged_again"),
)
"""Columns that `best_rows` asks for."""


def poses(columns: Columns, rows: NDArray[np.int64]) -> Array:
    """`X_OG` (M, 4, 4) of some rows of a table."""
    X_OG = np.tile(np.eye(4), (len(rows), 1, 1))
    if len(rows):
        wxyz = np.column_stack([columns[name][rows] for name in ("qw", "qx", "qy", "qz")])
        X_OG[:, :3, :3] = rotation_from_quaternion(wxyz)
        X_OG[:, :3, 3] = np.column_stack([columns[name][rows] for name in "xyz"])
    return X_OG
