"""Drawings of a scene and of the grasps on its objects, of one scene or of many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    BurgError,
    format_count,
    make_pose,
    rot_z,
    rotation_from_quaternion,
    transform_points,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.report.page_elements import (
    GROUP_CLASSES,
    LIFTED_GROUP,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import Columns, best_rows
from burg_drake.evaluation.run_folder import Run
from burg_drake.evaluation.table_parts import StoredRows
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene
from burg_drake.visualization import (
    OUTCOME_GROUPS,
    FlatView,
    Html,
    SolidMesh,
    best_yaw,
    camera_rotation,
    element,
    fit_view,
    footprint,
    grasp_corners,
    grasp_strokes,
    join,
    object_surface,
    path_data,
    project_to_ground,
    shaded_outline,
    svg_line,
    svg_text,
    upright_rotation,
)


class _Layout:
    """Dimensions of a picture of grasps."""

    panel = 220.0  # Side of a picture [SVG units].
    caption = 22.0  # Height of the line above a picture.
    foot = 16.0  # Height of the scale below a picture.
    ruler = 0.05  # Length of the scale [m].


@dataclass(frozen=True, eq=False)
class DrawnGrasps:
    """Grasps on one instance, to be drawn.

    Attributes:
        ids: (N,) identifiers in the run.
        X_OG: (N, 4, 4) grasps in the object frame.
        width: (N,) distance between the fingers [m].
        groups: (N,) indices into `OUTCOME_GROUPS`.
        counts: number of grasps of each group, drawn or not, by index.
    """

    ids: NDArray[np.str_]
    X_OG: Array
    width: Array
    groups: NDArray[np.int8]
    counts: NDArray[np.int64]


def solid_of(scene: Scene, name: str) -> SolidMesh:
    """An instance's surface in the scene frame."""
    surface = object_surface(scene.library, scene.instance(name).object)
    return SolidMesh(transform_points(scene.X_SO(name), surface.vertices), surface.faces)


def scene_drawing(
    scene: Scene,
    free: Mapping[str, SolidMesh],
    fixed: Mapping[str, SolidMesh],
    notes: Mapping[str, str],
) -> Html:
    """The scene, seen from the near edge of the board, with names.

    Args:
        scene: scene with the board.
        free, fixed: surfaces of the instances by name.
        notes: a short text for each free instance, below its name.
    """
    picture_width = 480.0  # SVG units.
    elevation = float(np.deg2rad(56.0))  # Radians by which the camera looks down.
    max_named = 16  # Above this number of objects, the picture shows no names.
    dx, dy = scene.board.size
    board = np.array([[0, 0, 0], [dx, 0, 0], [dx, dy, 0], [0, dy, 0]], dtype=float)
    R_SC = camera_rotation(elevation)
    everything = np.vstack([board, *(s.vertices for s in (*free.values(), *fixed.values()))])
    view = fit_view(everything, R_SC, picture_width)
    labels = [_label(view, solid, name, notes.get(name, "")) for name, solid in free.items()]
    behind = shaded_outline(list(fixed.values()), view)
    width, height = view.size
    return element(
        "svg",
        element("path", d=path_data(view.project(board)), class_="board"),
        *(element("path", d=d, class_="fixed") for d in behind[:1] if d),
        *(element("path", d=footprint(s, view), class_="ground") for s in free.values()),
        *_shaded_surface(list(free.values()), view),
        *(labels if len(free) <= max_named else []),
        viewBox=f"0 0 {width:g} {height:g}",
        class_="drawing scene",
        role="img",
        aria_label=f"The scene with {len(free)} objects: {', '.join(free)}",
    )


def grasp_drawing(name: str, solid: SolidMesh, X_SO: Array, grasps: DrawnGrasps) -> Html:
    """An instance as it stands in the scene, twice: with the grasps that lifted it, and with all
    others in the colours of their outcomes. Every grasp is one path.

    Args:
        name: name of the instance.
        solid: surface of the instance in the scene frame.
        X_SO: (4, 4) pose of the instance in the scene frame.
        grasps: grasps to draw.
    """
    elevation = float(np.deg2rad(30.0))  # Radians by which the camera looks down.
    R_WC = camera_rotation(elevation)
    X_WS = make_pose(rot_z(best_yaw(solid.vertices - solid.vertices.mean(axis=0), R_WC)))
    turned = SolidMesh(transform_points(X_WS, solid.vertices), solid.faces)
    corners = grasp_corners(X_WS @ X_SO @ grasps.X_OG, grasps.width)
    everything = np.vstack([turned.vertices, project_to_ground(turned), corners.reshape(-1, 3)])
    view = fit_view(everything, R_WC, _Layout.panel, _Layout.panel)
    behind = join(
        element("path", d=footprint(turned, view), class_="ground"),
        *_shaded_surface([turned], view),
    )
    lifted = grasps.groups == LIFTED_GROUP
    successes = int(grasps.counts[LIFTED_GROUP])
    failures = int(grasps.counts.sum()) - successes
    panels = []
    for left, mask, text, count in (
        (0.0, lifted, "lifted", successes),
        (_Layout.panel, ~lifted, "not lifted", failures),
    ):
        caption = f"{text}: {format_count(count) if count else 'none'}"
        drawn = [behind, *_grasp_paths(grasps, mask, corners, view), _ruler(view)]
        panel = (
            svg_text(caption, _Layout.panel / 2, 15, "panel"),
            element("g", *drawn, transform=f"translate(0 {_Layout.caption:g})"),
        )
        panels.append(element("g", *panel, transform=f"translate({left:g} 0)"))
    return element(
        "svg",
        *panels,
        viewBox=f"0 0 {2 * _Layout.panel:g} {_Layout.caption + _Layout.panel + _Layout.foot:g}",
        class_="drawing grasps",
        role="img",
        aria_label=f"Grasps on {name}: {successes} lifted it, {failures} did not",
    )


def _grasp_paths(
    grasps: DrawnGrasps, mask: NDArray[np.bool_], corners: Array, view: FlatView
) -> list[Html]:
    """One SVG group for each outcome group, the best on top; in each, nearer grasps on top."""
    found = []
    depth = view.depths(corners[:, 0])
    for k in sorted(set(grasps.groups[mask].tolist()), reverse=True):
        members = np.flatnonzero(mask & (grasps.groups == k))
        members = members[np.argsort(-depth[members], kind="stable")]
        paths = [
            element("path", element("title", f"{grasps.ids[i]}"), d=d)
            for i, d in zip(members.tolist(), grasp_strokes(corners[members], view), strict=True)
        ]
        found.append(element("g", *paths, class_=f"grasp {GROUP_CLASSES[OUTCOME_GROUPS[k].name]}"))
    return found


def _shaded_surface(solids: Sequence[SolidMesh], view: FlatView) -> list[Html]:
    paths = shaded_outline(solids, view)
    return [element("path", d=d, class_=f"tone t{k}") for k, d in enumerate(paths) if d]


def _ruler(view: FlatView) -> Html:
    length = _Layout.ruler * view.scale
    x, y = _Layout.panel - 8 - length, _Layout.panel + _Layout.foot - 3
    text = f"{100 * _Layout.ruler:g} cm"
    return element(
        "g",
        svg_line(x, y, x + length, y),
        svg_text(text, x + length / 2, y - 4),
        class_="ruler",
    )


def _label(view: FlatView, solid: SolidMesh, name: str, note: str) -> Html:
    places = view.project(solid.vertices)
    x, y = (places.min(axis=0) + places.max(axis=0)) / 2.0
    lines = [element("tspan", name, x=f"{x:.1f}", class_="name")]
    if note:
        lines.append(element("tspan", note, x=f"{x:.1f}", dy="1.15em"))
    return element("text", *lines, x=f"{x:.1f}", y=f"{y:.1f}", class_="label")


MAX_PICTURED_INSTANCES = 12
"""Number of instances with a picture of their grasps."""
MAX_DRAWN_GRASPS = 1500
"""Number of grasps that are drawn in all pictures together."""
DEFAULT_DRAWN_WIDTH = 0.05
"""Metres between the fingers of a grasp whose width is not known."""
DRAWN_COLUMNS = ("id", "x", "y", "z", "qw", "qx", "qy", "qz", "width")
"""Columns that `_drawn_grasps` needs."""


def scene_as_judged(run: Run) -> Scene | None:
    """The scene of a run; None if files of scene or library are gone or have changed."""
    try:
        scene = run.scene()
        for name in (*scene.instances, *scene.background):
            solid_of(scene, name)
    except BurgError:
        return None
    return scene


def scene_picture(scene: Scene, columns: ResultRows, groups: NDArray[np.int8]) -> Html:
    """The scene with the number of grasps that lifted each object.

    Args:
        scene: scene as it was judged.
        columns: the results.
        groups: (N,) outcome group of each row, see `group_indices`.
    """
    instances, lifted = columns.codes("instance"), groups == LIFTED_GROUP
    notes = {}
    for name in scene.instances:
        mine = instances.equal(name)
        notes[name] = f"{int((mine & lifted).sum())} of {int(mine.sum())}" if mine.any() else ""
    free, fixed = (
        {name: solid_of(scene, name) for name in names}
        for names in (scene.instances, scene.background)
    )
    return scene_drawing(scene, free, fixed, notes)


@dataclass(frozen=True)
class GraspFigure:
    """A drawing of the grasps on an object.

    Attributes:
        name: name of the object, or of its instance in the scene.
        drawing: drawing of object and grasps.
        shown: the grasps that are drawn.
        best: id of the best grasp; empty if there is none.
    """

    name: str
    drawing: Html
    shown: DrawnGrasps
    best: str = ""

    @property
    def lifted(self) -> int:
        """Number of grasps that lifted the object, drawn or not."""
        return int(self.shown.counts[LIFTED_GROUP])

    @property
    def grasps(self) -> int:
        """Number of all grasps on the object, drawn or not."""
        return int(self.shown.counts.sum())


@dataclass(frozen=True)
class GraspFigures:
    """Drawings of objects with their grasps.

    Attributes:
        figures: a drawing for each object.
        text: description of the drawings.
    """

    figures: Sequence[GraspFigure]
    text: str


def instance_figures(
    scene: Scene, columns: ResultRows, groups: NDArray[np.int8]
) -> GraspFigures | None:
    """Each instance with its grasps; None if there are no grasps. For the arguments see
    `scene_picture`."""
    # Columns that `best_rows` needs.
    ranking_columns = (
        *("id", "instance", "object", "outcome", "clearance", "slip", "tilt", "others_moved"),
        *("patch_area", "score", "confidence", "judged_again"),
    )
    instances = columns.codes("instance")
    rows_of = {name: np.flatnonzero(instances.equal(name)) for name in scene.instances}
    with_grasps = [name for name, rows in rows_of.items() if len(rows)]
    shown = with_grasps[:MAX_PICTURED_INSTANCES]
    figures = []
    for name in shown:
        rows = rows_of[name]
        lifted = rows[groups[rows] == LIFTED_GROUP]
        ranking = columns.columns([key for key in ranking_columns if key in columns], lifted)
        best = columns.cells("id", lifted[best_rows(ranking)]).tolist()
        chosen = rows[drawn_rows(groups[rows], MAX_DRAWN_GRASPS // len(shown))]
        drawn = columns.columns(DRAWN_COLUMNS, chosen)
        grasps = _drawn_grasps(drawn, groups[chosen], groups[rows])
        drawing = grasp_drawing(name, solid_of(scene, name), scene.X_SO(name), grasps)
        figures.append(GraspFigure(name, drawing, grasps, *best))
    text = (
        "Each object as it stands in the scene: on the left with the grasps that lifted it, on"
        " the right with all others. Each fork shows the two fingers; its stem points toward"
        " the arm. Point at a grasp to see its id."
    )
    text += _shown_text(figures)
    if len(shown) < len(with_grasps):
        text += f" The first {len(shown)} of {len(with_grasps)} objects are shown."
    return GraspFigures(figures, text) if figures else None


def _shown_text(figures: Sequence[GraspFigure]) -> str:
    """Sentence with the number of drawn grasps; empty if all are drawn."""
    drawn = sum(len(figure.shown.ids) for figure in figures)
    total = sum(figure.grasps for figure in figures)
    if drawn == total:
        return ""
    return f" Shown are {format_count(drawn)} of {format_count(total)} grasps, from all outcomes."


def drawn_rows(groups: NDArray[np.int8], most: int) -> NDArray[np.int64]:
    """Selects grasps (N,) to draw: all, or about `most` in proportion to their groups, with at
    least one of each group.
    """
    if len(groups) <= most:
        return np.arange(len(groups))
    order = np.argsort(groups, kind="stable")
    even = order[np.linspace(0, len(order) - 1, most).round().astype(np.int64)]
    first = [int(np.flatnonzero(groups == k)[0]) for k in np.unique(groups)]
    return np.union1d(even, np.array(first, dtype=np.int64))


def _drawn_grasps(
    columns: Columns, groups: NDArray[np.int8], all_groups: NDArray[np.int8]
) -> DrawnGrasps:
    """Grasps of the rows of a table with `DRAWN_COLUMNS`.

    Args:
        columns: the table.
        groups: (N,) outcome groups of the rows.
        all_groups: (M,) outcome groups of all grasps on the object.
    """
    X_OG = np.tile(np.eye(4), (len(groups), 1, 1))
    if len(groups):
        wxyz = np.column_stack([columns[name] for name in ("qw", "qx", "qy", "qz")])
        X_OG[:, :3, :3] = rotation_from_quaternion(wxyz)
        X_OG[:, :3, 3] = np.column_stack([columns[name] for name in "xyz"])
    width = columns["width"].astype(float)
    return DrawnGrasps(
        ids=columns["id"],
        X_OG=X_OG,
        width=np.where(np.isfinite(width), width, DEFAULT_DRAWN_WIDTH),
        groups=groups,
        counts=np.bincount(all_groups, minlength=len(OUTCOME_GROUPS)),
    )


def object_pictures(
    campaign: Campaign, stored: StoredRows, groups: NDArray[np.int8]
) -> GraspFigures | None:
    """Drawings of the objects with most grasps, each with its grasps of all scenes; None without
    grasps or meshes.

    Args:
        campaign: the run.
        stored: rows of the run, with poses, widths and ids.
        groups: (N,) outcome group of each row, see `group_indices`.
    """
    codes, names = stored.codes("object")
    library_of: dict[str, ObjectLibrary] = {}
    for library in reversed(_unchanged_libraries(campaign)):
        library_of |= dict.fromkeys(library.objects, library)
    numbers = np.bincount(codes, minlength=len(names))
    known = [k for k, name in enumerate(names) if name in library_of and numbers[k]]
    ranked = sorted(known, key=lambda k: (-numbers[k], names[k]))
    if not ranked:
        return None
    figures, shown = [], ranked[:MAX_PICTURED_INSTANCES]
    for k in shown:
        rows = np.flatnonzero(codes == k)
        chosen = rows[drawn_rows(groups[rows], MAX_DRAWN_GRASPS // len(shown))]
        part = stored.table.take(chosen)
        columns = {n: part.column(n).to_numpy(zero_copy_only=False) for n in DRAWN_COLUMNS}
        columns["id"] = columns["id"].astype(np.str_)
        grasps = _drawn_grasps(columns, groups[chosen], groups[rows])
        library = library_of[names[k]]
        X_SO = make_pose(upright_rotation(library.entry(names[k])))
        surface = object_surface(library, names[k])
        solid = SolidMesh(transform_points(X_SO, surface.vertices), surface.faces)
        drawing = grasp_drawing(names[k], solid, X_SO, grasps)
        figures.append(GraspFigure(names[k], drawing, grasps))
    text = (
        "Each object with its grasps from all scenes: on the left those that lifted it, on the"
        " right all others. Each fork shows the two fingers; its stem points toward the arm."
    )
    text += _shown_text(figures)
    if len(shown) < len(ranked):
        text += f" The {len(shown)} of {len(ranked)} objects with the most grasps are shown."
    return GraspFigures(figures, text)


def _unchanged_libraries(campaign: Campaign) -> list[ObjectLibrary]:
    """The libraries whose files are unchanged."""
    found = []
    for folder in campaign.document.libraries:
        try:
            found.append(load_library(folder, Path(campaign.path)))
        except BurgError:
            continue
    return found
