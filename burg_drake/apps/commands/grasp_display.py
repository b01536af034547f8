"""`burg-drake grasps show`: grasps of a run or a file in 3D, coloured by outcome or by a column."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake import core, evaluation, visualization
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.station import Station


def add_choice_options(show: options.Parser) -> None:
    """Adds options that choose grasps."""
    options.add_only(show, "grasps")
    show.add_argument(
        "--outcome",
        metavar="A,B",
        type=lambda text: options.known_names(text, [o.value for o in core.Outcome], "an outcome"),
        help="only grasps with these outcomes, such as lifted,slipped,no_ik",
    )
    count = show.add_mutually_exclusive_group()
    count.add_argument(
        "--most",
        metavar="N",
        type=options.positive_int,
        default=20,
        help="show the best N grasps of each object (default: %(default)s)",
    )
    count.add_argument("--all", action="store_true", help="show all grasps")
    show.add_argument("--select", metavar="ID", help="show the gripper at this grasp first")


def choose_grasps(
    grasps: core.GraspSet,
    ranking: evaluation.RankedGrasps,
    column: str | None,
    arguments: argparse.Namespace,
) -> tuple[list[int], int | None, str]:
    """Indices of the grasps to draw, the index among these of the grasp with the gripper, and a
    caption. The grasps of an object are sorted by falling numbers in `column`; if it has no
    numbers, by rank."""
    import numpy as np

    instances = grasps.columns.get("instance")
    keep = evaluation.rows_of_names(arguments.only, arguments.file, grasps.object, instances)
    if arguments.outcome is not None:
        keep &= np.isin(grasps.column("outcome"), arguments.outcome)
    if not keep.any():
        raise core.InvalidInputError(f"{arguments.file} has no such grasps; choose other outcomes")
    most = None if arguments.all else arguments.most
    names = np.array(object_or_instance_names(grasps))
    chosen = evaluation.best_of_each(names, keep, ranking, most)
    caption = f"{len(chosen):,} of {len(grasps):,} grasps shown"
    if len(chosen) < keep.sum():
        by = ranking.by
        how = f"the best {most} of each object by {by}" if by else f"{most} of each object, evenly"
        caption += f": {how}; --most N or --all shows more"
    index = None
    if arguments.select is not None:
        index = evaluation.grasp_index(grasps, arguments.select, arguments.file)
        if index not in chosen:
            same = [k for k, other in enumerate(chosen) if names[other] == names[index]]
            chosen.insert(same[-1] + 1 if same else len(chosen), index)
    values = None if column is None else grasps.column(column)
    if values is not None and values.dtype.kind in "fiu":
        objects = list(dict.fromkeys(names[chosen].tolist()))
        chosen.sort(key=lambda k: (objects.index(names[k]), *_descending_order(float(values[k]))))
    return chosen, None if index is None else chosen.index(index), caption


def _descending_order(value: float) -> tuple[bool, float]:
    """Sort key for descending numbers, with NaN last."""
    return value != value, 0.0 if value != value else -value


def object_or_instance_names(grasps: core.GraspSet) -> list[str]:
    """The instance of each grasp, or its object if there is no scene."""
    return list(grasps.column("instance" if "instance" in grasps.columns else "object").tolist())


def add_grasps_show_options(show: options.Parser) -> None:
    """Adds the options of `burg-drake grasps show`."""
    show.epilog = options.examples_text(
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
        "file",
        metavar="RUN|FILE",
        type=options.input_file,
        help="folder of a run, or any grasp file",
    )
    options.add_reading_options(show)
    options.add_source_options(show)
    options.add_file_station(show)
    options.add_renaming(show)
    add_choice_options(show)
    show.add_argument(
        "--color", metavar="COLUMN", help="column to colour by (default: outcome, else score)"
    )
    show.add_argument(
        "--range",
        metavar=("LO", "HI"),
        nargs=2,
        type=options.number,
        help="ends of the colour scale (default: of the grasps shown, without outliers)",
    )
    options.add_view_options(show)


@dataclasses.dataclass(frozen=True, eq=False)
class DisplayedGrasps:
    """The content of the view.

    Attributes:
        grasps: all grasps; with the column `instance` if there is a scene.
        source: objects of the grasps.
        station: station of the hand and the scene.
        ranking: ranking of the grasps.
        title: title of the page.
    """

    grasps: core.GraspSet
    source: options.GraspSource
    station: Station
    ranking: evaluation.RankedGrasps
    title: str


def run_grasps_show(arguments: argparse.Namespace) -> int:
    """Shows grasps on their objects."""
    from burg_drake.apps.terminal import open_view, present_view, print_legend

    content = _load_content(arguments)
    column = arguments.color and evaluation.result_column(content.grasps, arguments.color)
    column = column or visualization.default_color_column(content.grasps)
    chosen, selected, caption = choose_grasps(content.grasps, content.ranking, column, arguments)
    grasps, station = content.grasps.select(chosen), content.station
    groups, legend = visualization.color_grasps_by(grasps, column, arguments.range)
    width = _finger_widths(grasps, station.hand.opening[1])
    meshcat = open_view(arguments)
    X_WG = _show_objects(content, grasps, width, meshcat)
    visualization.draw_grasps(meshcat, X_WG, width, groups)
    gripper = visualization.GripperView(meshcat, station.hand, station.hand_model, station.packages)
    if selected is not None:
        gripper.place(X_WG[selected], width[selected])
    print_legend(legend)
    if len(grasps) < len(content.grasps):
        print(caption)
    present_view(
        meshcat,
        arguments,
        title=content.title,
        caption=[caption],
        legend=legend,
        controls=visualization.GraspPicker(
            gripper,
            X_WG,
            width,
            object_or_instance_names(grasps),
            *_list_labels(grasps, column, content.ranking.by),
            groups,
            selected,
        ),
    )
    return 0


def _finger_widths(grasps: core.GraspSet, opening: float) -> core.Array:
    """(N,) widths of the drawn hands [m]: at contact if known, else of the pregrasp, else open."""
    import numpy as np

    from burg_drake.formats import PREGRASP_WIDTH_COLUMN

    pregrasp_width = grasps.columns.get(PREGRASP_WIDTH_COLUMN, np.full(len(grasps), np.nan))
    width = np.where(np.isfinite(grasps.width), grasps.width, pregrasp_width)
    return np.where(np.isfinite(width), width, opening)


def _load_content(arguments: argparse.Namespace) -> DisplayedGrasps:
    from burg_drake.formats import with_objects_renamed
    from burg_drake.scene import load_scene

    path = Path(arguments.file)
    if path.is_dir():
        return _load_run_content(arguments)
    station = options.station_from_options(arguments, arguments.file)
    gripper, format = options.gripper_from_options(arguments, station), arguments.source
    objects = dict(arguments.rename)
    imported = evaluation.read_input(path, format, gripper, arguments.correction)
    grasps = imported.grasps
    if len(grasps) == 0:
        raise core.InvalidInputError(f"{path} has no grasps")
    if imported.frame == "object":
        grasps = with_objects_renamed(grasps, objects)
        source = options.load_grasp_source(arguments, grasps, arguments.file)
    elif imported.frame == "world" and arguments.scene is not None:
        scene = load_scene(arguments.scene)
        source = options.GraspSource(scene.library, scene)
    else:
        raise core.InvalidInputError(
            f"{path} has grasps in the {imported.frame} frame, not in those of objects; place them"
            " with `burg-drake grasps convert --scene` first"
        )
    if source.scene is not None:
        given = evaluation.read_grasps(
            source.scene,
            path,
            gripper,
            format=evaluation.FileReading(format, arguments.correction),
            objects=objects,
        )
        provenance = imported.grasps.provenance
        placed = core.GraspSet.concatenate(
            one.with_columns(instance=name) for name, one in given.by_instance.items()
        )
        grasps = dataclasses.replace(placed, provenance=provenance)
    _print_mistakes(grasps, source, station)
    return DisplayedGrasps(
        grasps, source, station, evaluation.rank_by_score(grasps), title=path.name
    )


def _print_mistakes(grasps: core.GraspSet, source: options.GraspSource, station: Station) -> None:
    """Prints which common mistake imported grasps show."""
    names = grasps.object if source.scene is None else grasps.column("instance")
    by_name = {name: grasps.select(names == name) for name in dict.fromkeys(names.tolist())}
    for note in evaluation.mistake_notes(
        by_name, station, source.scene or source.library, format_option="--from"
    ):
        print(f"note: {note}")


def _load_run_content(arguments: argparse.Namespace) -> DisplayedGrasps:
    run = evaluation.load_run(arguments.file)
    for option in ("scene", "library", "station"):
        if getattr(arguments, option) is not None:
            raise core.InvalidInputError(
                f"--{option} is for grasp files; {run.path} is a run, which has its own"
            )
    print_note_lines(evaluation.run_notes(run))
    scene = run.scene()
    source = options.GraspSource(scene.library, scene)
    grasps = evaluation.run_grasps(run)
    title = f"{scene.name}: grasps"
    return DisplayedGrasps(
        grasps, source, run.station(), evaluation.rank_run_grasps(run, grasps), title=title
    )


def _list_labels(grasps: core.GraspSet, column: str | None, by: str) -> tuple[list[str], str]:
    """Labels of the grasps in the list (meaning of the colour and identifier), and its title."""
    import numpy as np

    ids = evaluation.shown_ids(grasps)
    if column is None:
        return ids, "identifier"
    values = grasps.column(column)
    if values.dtype.kind == "f":
        texts = ["-" if value != value else f"{value:.3g}" for value in values.tolist()]
    else:
        truths = values.dtype.kind == "b"
        texts = [str(v) for v in (np.where(values, "yes", "no") if truths else values).tolist()]
    title = f"{visualization.column_title(column)} and identifier"
    if len(set(object_or_instance_names(grasps))) > 1:
        title += ", object by object"
    if values.dtype.kind in "fiu":
        title += ", highest first"
    elif by:
        title += ", best first"
    return [f"{text} {id}".strip() for text, id in zip(texts, ids, strict=True)], title


def _show_objects(
    content: DisplayedGrasps, grasps: core.GraspSet, width: core.Array, meshcat: Meshcat
) -> core.Array:
    """Shows the objects, in their scene or in rows; returns `X_WG` (N, 4, 4) of their grasps."""
    import numpy as np

    scene, station = content.source.scene, content.station
    if scene is None:
        return visualization.show_objects_for_grasps(content.source.library, grasps, width, meshcat)
    X_WS = station.document.X_WS.matrix()
    X_SO = {name: scene.X_SO(name) for name in set(grasps.column("instance").tolist())}
    visualization.show_scene(scene, station, meshcat, robot="none")
    X_WG = X_WS @ np.stack([X_SO[n] for n in grasps.column("instance").tolist()]) @ grasps.X_OG
    ends = np.vstack([X_WG[:, :3, 3], station.hand.X_AH(X_WG)[:, :3, 3]])
    visualization.aim_camera(scene, station, meshcat, robot="none", also=ends)
    return X_WG
