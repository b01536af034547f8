"""`burg-drake grasps show`: the grasps of a run or of a file, coloured by what is known of them."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.grasps.shown_grasps import add_choice, choose, holders
from burg_drake.apps.grasps.source import GraspSource, add_source, source_of
from burg_drake.apps.options import (
    add_file_options,
    add_file_station,
    add_renaming,
    add_verb,
    add_view,
    gripper_for,
    input_file,
    number,
    station_for,
)
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.core import Array
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.results import RankedGrasps
    from burg_drake.station.document import Station


def add_to(group: Any) -> None:
    """Adds the verb."""
    show = add_verb(
        group,
        "show",
        run_show,
        "show grasps in 3D, coloured by outcome or score",
        "burg-drake grasps show runs/first",
        "burg-drake grasps show runs/first --only mug --outcome lifted,slipped --all",
        "burg-drake grasps show runs/first --select mug-0123456789ab",
        "burg-drake grasps show runs/first --color slip --range 0 0.005",
        "burg-drake grasps show grasps.h5 --color clearance --html grasps.html",
        "burg-drake grasps show mug.h5 --library household --only mug",
        "",
        "A click on a grasp, or on its line in the list, shows the whole gripper there. In the"
        " live view the slider `grasp` does.",
    )
    show.add_argument(
        "file", metavar="RUN|FILE", type=input_file, help="folder of a run, or any grasp file"
    )
    add_file_options(show)
    add_source(show)
    add_file_station(show)
    add_renaming(show)
    add_choice(show)
    show.add_argument(
        "--color",
        metavar="COLUMN",
        help="column to colour by (default: outcome, else score)",
    )
    show.add_argument(
        "--range",
        metavar=("LO", "HI"),
        nargs=2,
        type=number,
        help="ends of the colour scale (default: of the grasps shown, without outliers)",
    )
    add_view(show)


@dataclasses.dataclass(frozen=True, eq=False)
class Content:
    """What there is to show.

    Attributes:
        grasps: all of them; with the column `instance` where there is a scene.
        source: where their objects are.
        station: for the hand, and where the scene is.
        ranking: of the grasps.
        title: of the page.
    """

    grasps: GraspSet
    source: GraspSource
    station: Station
    ranking: RankedGrasps
    title: str


def run_show(arguments: argparse.Namespace) -> int:
    """Shows grasps among the objects that they belong to."""
    from burg_drake.apps.terminal import open_view, present, print_legend
    from burg_drake.evaluation.grasp_sets import column_called
    from burg_drake.visualization.grasps import GraspPicker, color_by, default_column, draw_grasps
    from burg_drake.visualization.meshcat import GripperView

    content = _content(arguments)
    column = arguments.color and column_called(content.grasps, arguments.color)
    column = column or default_column(content.grasps)
    chosen, selected, caption = choose(content.grasps, content.ranking, column, arguments)
    grasps, station = content.grasps.select(chosen), content.station
    groups, legend = color_by(grasps, column, arguments.range)
    width = _widths(grasps, station.hand.opening[1])
    meshcat = open_view(arguments)
    X_WG = _place(content, grasps, width, meshcat)
    draw_grasps(meshcat, X_WG, width, groups)
    gripper = GripperView(meshcat, station.hand, station.hand_model, station.packages)
    if selected is not None:
        gripper.put(X_WG[selected], width[selected])
    print_legend(legend)
    if len(grasps) < len(content.grasps):
        print(caption)
    present(
        meshcat,
        arguments,
        title=content.title,
        caption=[caption],
        legend=legend,
        controls=GraspPicker(
            gripper,
            X_WG,
            width,
            holders(grasps),
            *_labels(grasps, column, content.ranking.by),
            groups,
            selected,
        ),
    )
    return 0


def _widths(grasps: GraspSet, widest: float) -> Array:
    """(N,) at which fingers are drawn [m]: at their contacts, else as they arrive, else open."""
    import numpy as np

    from burg_drake.formats.common import PREGRASP_WIDTH

    arriving = grasps.columns.get(PREGRASP_WIDTH, np.full(len(grasps), np.nan))
    width = np.where(np.isfinite(grasps.width), grasps.width, arriving)
    return np.where(np.isfinite(width), width, widest)


def _content(arguments: argparse.Namespace) -> Content:
    from burg_drake.evaluation.grasp_sets import FileReading, read_grasps, read_input
    from burg_drake.evaluation.results import ranked_set
    from burg_drake.formats.common import with_objects_renamed
    from burg_drake.scene.document import load_scene

    path = Path(arguments.file)
    if path.is_dir():
        return _content_of_run(arguments)
    station = station_for(arguments, arguments.file)
    gripper, format = gripper_for(arguments, station), arguments.source
    objects = dict(arguments.rename)
    imported = read_input(path, format, gripper, arguments.correction)
    grasps = imported.grasps
    if len(grasps) == 0:
        raise InvalidInputError(f"{path} has no grasps")
    if imported.frame == "object":
        grasps = with_objects_renamed(grasps, objects)
        source = source_of(arguments, grasps, arguments.file)
    elif imported.frame == "world" and arguments.scene is not None:
        scene = load_scene(arguments.scene)
        source = GraspSource(scene.library, scene)
    else:
        raise InvalidInputError(
            f"{path} has grasps in the {imported.frame} frame, not in those of objects; place them"
            " with `burg-drake grasps convert --scene` first"
        )
    if source.scene is not None:
        given = read_grasps(
            source.scene,
            path,
            gripper,
            format=FileReading(format, arguments.correction),
            objects=objects,
        )
        provenance = imported.grasps.provenance
        grasps = dataclasses.replace(_on_instances(given.by_instance), provenance=provenance)
    _print_mistakes(grasps, source, station)
    return Content(grasps, source, station, ranked_set(grasps), title=path.name)


def _print_mistakes(grasps: GraspSet, source: GraspSource, station: Station) -> None:
    """Says which usual mistake grasps from elsewhere show."""
    from burg_drake.evaluation.grasp_sets import mistake_notes

    named = grasps.object if source.scene is None else grasps.column("instance")
    by_name = {name: grasps.select(named == name) for name in dict.fromkeys(named.tolist())}
    for note in mistake_notes(
        by_name, station, source.scene or source.library, format_option="--from"
    ):
        print(f"note: {note}")


def _content_of_run(arguments: argparse.Namespace) -> Content:
    from burg_drake.evaluation.grasp_sets import run_grasps
    from burg_drake.evaluation.results import ranked_run, run_notes
    from burg_drake.evaluation.store import load_run

    run = load_run(arguments.file)
    for option in ("scene", "library", "station"):
        if getattr(arguments, option) is not None:
            raise InvalidInputError(
                f"--{option} is for grasp files; {run.path} is a run, which has its own"
            )
    for note in run_notes(run):
        print(f"note: {note}")
    scene = run.scene()
    source = GraspSource(scene.library, scene)
    grasps = run_grasps(run)
    title = f"{scene.name}: grasps"
    return Content(grasps, source, run.station(), ranked_run(run, grasps), title=title)


def _on_instances(by_instance: Mapping[str, GraspSet]) -> GraspSet:
    from burg_drake.core.grasps import GraspSet

    return GraspSet.concatenate(
        grasps.with_columns(instance=name) for name, grasps in by_instance.items()
    )


def _labels(grasps: GraspSet, column: str | None, by: str) -> tuple[list[str], str]:
    """What a list says of each grasp, its colour's meaning and its identifier, and the title."""
    import numpy as np

    from burg_drake.evaluation.results import shown_ids
    from burg_drake.visualization.grasps import with_unit

    ids = shown_ids(grasps)
    if column is None:
        return ids, "identifier"
    values = grasps.column(column)
    if values.dtype.kind == "f":
        texts = ["-" if value != value else f"{value:.3g}" for value in values.tolist()]
    else:
        truths = values.dtype.kind == "b"
        texts = [str(v) for v in (np.where(values, "yes", "no") if truths else values).tolist()]
    title = f"{with_unit(column)} and identifier"
    if len(set(holders(grasps))) > 1:
        title += ", object by object"
    if values.dtype.kind in "fiu":
        title += ", highest first"
    elif by:
        title += ", best first"
    return [f"{text} {id}".strip() for text, id in zip(texts, ids, strict=True)], title


def _place(content: Content, grasps: GraspSet, width: Array, meshcat: Meshcat) -> Array:
    """Shows the objects, in their scene or in rows; returns `X_WG` (N, 4, 4) of their grasps."""
    import numpy as np

    from burg_drake.visualization.gallery import show_with_grasps
    from burg_drake.visualization.scenes import aim_camera, show_scene

    scene, station = content.source.scene, content.station
    if scene is None:
        return show_with_grasps(content.source.library, grasps, width, meshcat)
    X_WS = station.document.X_WS.matrix()
    X_SO = {name: scene.X_SO(name) for name in set(grasps.column("instance").tolist())}
    show_scene(scene, station, meshcat, robot="none")
    X_WG = X_WS @ np.stack([X_SO[n] for n in grasps.column("instance").tolist()]) @ grasps.X_OG
    ends = np.vstack([X_WG[:, :3, 3], station.hand.X_AH(X_WG)[:, :3, 3]])
    aim_camera(scene, station, meshcat, robot="none", also=ends)
    return X_WG
