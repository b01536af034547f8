"""Pictures of the objects of a run over many scenes, with their grasps of all scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import BurgError, make_pose, transform_points
from burg_drake.core.terminal import format_count
from burg_drake.evaluation.report.elements import (
    LIFTED,
    DrawnGrasps,
    Html,
    element,
    grasp_drawing,
    group_legend,
    present,
    section,
)
from burg_drake.evaluation.report.sections.pictures import (
    GRASPS,
    INSTANCES,
    WIDTH,
    drawn_rows,
    poses,
)
from burg_drake.evaluation.store import Campaign, StoredRows
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.visualization.meshcat import upright
from burg_drake.visualization.pictures import SolidMesh, surface_of
from burg_drake.visualization.style import GROUPS

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def object_pictures(
    campaign: Campaign, stored: StoredRows, groups: NDArray[np.int8]
) -> Html | None:
    """The objects with most grasps, each with its grasps of all scenes; nothing where there are
    none, or no meshes any more.

    Args:
        campaign: the run.
        stored: its rows, with poses, widths and ids.
        groups: (N,) of each row, see `outcome_groups`.
    """
    codes, names = stored.codes("object")
    libraries = _libraries(campaign)
    known = [k for k, name in enumerate(names) if _holder(libraries, name) is not None]
    numbers = np.bincount(codes, minlength=len(names))
    ranked = sorted((k for k in known if numbers[k]), key=lambda k: (-numbers[k], names[k]))
    if not ranked:
        return None
    figures, drawn, shown = [], 0, ranked[:INSTANCES]
    for k in shown:
        rows = np.flatnonzero(codes == k)
        chosen = rows[drawn_rows(groups[rows], GRASPS // len(shown))]
        library = _holder(libraries, names[k])
        if library is not None:
            figures.append(_figure(library, names[k], stored, groups, rows, chosen))
            drawn += len(chosen)
    text = "Each object with its grasps from all scenes: on the left those that lifted it, on the"
    text += " right all others. Each fork shows the two fingers; its stem points toward the arm."
    total = int(numbers[shown].sum())
    if drawn < total:
        text += (
            f" Shown are {format_count(drawn)} of {format_count(total)} grasps, from all outcomes."
        )
    if len(shown) < len(ranked):
        text += f" The {len(shown)} of {len(ranked)} objects with the most grasps are shown."
    legend = group_legend(present(groups))
    return section("The grasps", text, legend, element("div", *figures, class_="pictures"))


def _libraries(campaign: Campaign) -> list[ObjectLibrary]:
    """Those that are where they were, and as they were."""
    found = []
    for folder in campaign.document.libraries:
        try:
            found.append(load_library(folder, Path(campaign.path)))
        except BurgError:
            continue
    return found


def _holder(libraries: list[ObjectLibrary], name: str) -> ObjectLibrary | None:
    return next((library for library in libraries if name in library.objects), None)


def _figure(
    library: ObjectLibrary,
    name: str,
    stored: StoredRows,
    groups: NDArray[np.int8],
    rows: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> Html:
    part = stored.table.take(chosen)
    columns = {key: part.column(key).to_numpy(zero_copy_only=False) for key in (*POSE, "width")}
    width = columns["width"].astype(float)
    counts = np.bincount(groups[rows], minlength=len(GROUPS))
    grasps = DrawnGrasps(
        ids=np.array(part.column("id").to_pylist(), dtype=np.str_),
        X_OG=poses(columns, np.arange(len(chosen))),
        width=np.where(np.isfinite(width), width, WIDTH),
        groups=groups[chosen],
        counts={k: int(n) for k, n in enumerate(counts)},
    )
    X_SO = make_pose(upright(library.entry(name)))
    surface = surface_of(library, name)
    solid = SolidMesh(transform_points(X_SO, surface.vertices), surface.faces)
    lifted = f" {format_count(int(counts[LIFTED]))} of {format_count(len(rows))} lifted"
    caption = element("figcaption", element("b", name), lifted)
    return element("figure", caption, grasp_drawing(name, solid, X_SO, grasps))
