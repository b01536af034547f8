"""`burg-drake grasps show`: the grasps of a run or of a file, coloured by what is known of them."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import (
    add_renaming,
    add_verb,
    add_view,
    number,
    positive_int,
)
from burg_drake.apps.grasp_file import (
    add_file_options,
    add_told_station,
    gripper_for,
    station_for,
)
from burg_drake.apps.grasp_source import Source, add_source, source_of
from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.outcome import Outcome

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.core.frames import Array
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.best_grasps import Ranking
    from burg_drake.station.station import Station

DEFAULT_MOST = 20


def add_to(group: Any) -> None:
    """Adds the verb."""
    show = add_verb(
        group,
        "show",
        run_show,
        "show grasps in Meshcat, coloured by outcome, score or any other column",
        "burg-drake grasps show runs/first",
        "burg-drake grasps show runs/first --instance mug --outcome lifted,slipped --all",
        "burg-drake grasps show runs/first --select mug-0123456789ab",
        "burg-drake grasps show runs/first --color slip --range 0 0.005",
        "burg-drake grasps show grasps.h5 --color clearance --html grasps.html",
        "burg-drake grasps show mug.h5 --library household --object mug",
        "",
        "A click on a grasp of a page, or in its list, shows the whole gripper there; in the live",
        "view the slider `grasp` of Meshcat's controls does, best ones of each object first.",
    )
    show.add_argument("file", metavar="RUN|FILE", help="folder of a run, or any grasp file")
    add_file_options(show)
    add_source(show)
    add_told_station(show)
    add_renaming(show)
    _add_choice(show)
    show.add_argument(
        "--color",
        metavar="COLUMN",
        help="what colours stand for: a column of the file, or of the results of a run"
        " (default: outcome, else score, if there is any)",
    )
    show.add_argument(
        "--range",
        metavar=("LO", "HI"),
        nargs=2,
        type=number,
        help="numbers that the colours begin and end with (default: those of the grasps shown,"
        " without outliers)",
    )
    add_view(show)


def _add_choice(show: argparse.ArgumentParser) -> None:
    show.add_argument("--instance", metavar="NAME", help="only grasps of this object of the scene")
    show.add_argument("--object", metavar="NAME", help="only grasps of this object of the library")
    show.add_argument(
        "--outcome",
        metavar="A,B",
        type=_outcomes,
        help="only grasps with these outcomes: " + ", ".join(Outcome),
    )
    count = show.add_mutually_exclusive_group()
    count.add_argument(
        "--most",
        metavar="N",
        type=positive_int,
        default=DEFAULT_MOST,
        help="the best N grasps of each object: of a run those that were lifted, as `replay --best`"
        " ranks them, and then those that came farthest; of a file those with the highest scores,"
        " or without scores evenly taken (default: %(default)s)",
    )
    count.add_argument("--all", action="store_true", help="all grasps")
    show.add_argument("--select", metavar="ID", help="begin with the whole gripper at this grasp")


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
    source: Source
    station: Station
    ranking: Ranking
    title: str


def run_show(arguments: argparse.Namespace) -> int:
    """Shows grasps among the objects that they belong to."""
    from burg_drake.apps.legend_text import print_legend
    from burg_drake.apps.live import open_view, present
    from burg_drake.evaluation.run_grasps import column_called
    from burg_drake.visualization.grasp_legend import color_by
    from burg_drake.visualization.grasp_picker import GraspPicker
    from burg_drake.visualization.grasp_view import draw_grasps
    from burg_drake.visualization.gripper_view import GripperView

    content = _content(arguments)
    chosen, selected, caption = _choose(content, arguments)
    grasps, station = content.grasps.select(chosen), content.station
    color = arguments.color and column_called(grasps, arguments.color)
    groups, legend = color_by(grasps, color, arguments.range)
    width = _widths(grasps, station.hand.opening[1])
    meshcat = open_view(arguments)
    X_WG = _place(content, grasps, width, meshcat)
    draw_grasps(meshcat, X_WG, width, groups)
    gripper = GripperView(meshcat, station.hand, station.hand_model)
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
            gripper, X_WG, width, _holders(grasps), _labels(grasps), groups, selected
        ),
    )
    return 0


def _widths(grasps: GraspSet, widest: float) -> Array:
    """(N,) at which fingers are drawn [m]: at their contacts, else as they arrive, else open."""
    import numpy as np

    from burg_drake.formats.grasp_format import PREGRASP_WIDTH

    arriving = grasps.columns.get(PREGRASP_WIDTH, np.full(len(grasps), np.nan))
    width = np.where(np.isfinite(grasps.width), grasps.width, arriving)
    return np.where(np.isfinite(width), width, widest)


def _content(arguments: argparse.Namespace) -> Content:
    from burg_drake.evaluation.best_grasps import ranked_set
    from burg_drake.evaluation.candidate_files import read_grasps
    from burg_drake.evaluation.grasp_input import read_input
    from burg_drake.formats.conversion import with_objects_renamed
    from burg_drake.scene.scene import load_scene

    path = Path(arguments.file)
    if path.is_dir():
        return _content_of_run(arguments)
    station = station_for(arguments, arguments.file)
    gripper, format = gripper_for(arguments, station), arguments.source
    objects = dict(arguments.rename)
    imported = read_input(path, format, gripper)
    grasps = imported.grasps
    if len(grasps) == 0:
        raise InvalidInputError(f"{path} has no grasps")
    if imported.frame == "object":
        grasps = with_objects_renamed(grasps, objects)
        source = source_of(arguments, grasps, arguments.file)
    elif imported.frame == "world" and arguments.scene is not None:
        scene = load_scene(arguments.scene)
        source = Source(scene.library, scene)
    else:
        raise InvalidInputError(
            f"{path} has grasps in the {imported.frame} frame, not in those of objects; place them"
            " with `burg-drake grasps convert --scene` first"
        )
    if source.scene is not None:
        given = read_grasps(source.scene, path, gripper, format=format, objects=objects)
        told = imported.grasps.provenance
        grasps = dataclasses.replace(_on_instances(given.by_instance), provenance=told)
    return Content(grasps, source, station, ranked_set(grasps), title=path.name)


def _content_of_run(arguments: argparse.Namespace) -> Content:
    from burg_drake.evaluation.best_grasps import ranked_run
    from burg_drake.evaluation.run_grasps import run_grasps
    from burg_drake.evaluation.run_notes import run_notes
    from burg_drake.evaluation.run_store import load_run

    run = load_run(arguments.file)
    for option in ("scene", "library", "station"):
        if getattr(arguments, option) is not None:
            raise InvalidInputError(
                f"--{option} is for grasp files; {run.path} is a run, which has its own"
            )
    for note in run_notes(run):
        print(f"note: {note}")
    scene = run.scene()
    source = Source(scene.library, scene)
    grasps = run_grasps(run)
    title = f"{scene.name}: grasps"
    return Content(grasps, source, run.station(), ranked_run(run, grasps), title=title)


def _on_instances(by_instance: Mapping[str, GraspSet]) -> GraspSet:
    from burg_drake.core.grasps import GraspSet

    return GraspSet.concatenate(
        grasps.with_columns(instance=name) for name, grasps in by_instance.items()
    )


def _choose(content: Content, arguments: argparse.Namespace) -> tuple[list[int], int | None, str]:
    """Indices of the grasps to be drawn, which of these has the gripper, and what people are told
    about the choice."""
    import numpy as np

    from burg_drake.evaluation.best_grasps import best_of_each, index_of

    grasps = content.grasps
    keep = np.ones(len(grasps), dtype=bool)
    for column in ("instance", "object"):
        name = getattr(arguments, column)
        if name is not None:
            known = set(grasps.column(column).tolist())
            if name not in known:
                raise UnknownNameError(
                    f"{arguments.file} has no grasps on {name!r}; {nearest(name, known)}"
                )
            keep &= grasps.column(column) == name
    if arguments.outcome is not None:
        keep &= np.isin(grasps.column("outcome"), [o.value for o in arguments.outcome])
    if not keep.any():
        raise InvalidInputError(f"{arguments.file} has no such grasps; choose other outcomes")
    most = None if arguments.all else arguments.most
    holder = np.array(_holders(grasps))
    chosen = best_of_each(holder, keep, content.ranking, most)
    caption = f"{len(chosen):,} of {len(grasps):,} grasps shown"
    if len(chosen) < keep.sum():
        by = content.ranking.by
        how = f"the best {most} of each object by {by}" if by else f"{most} of each object, evenly"
        caption += f": {how}; --most N or --all shows more"
    selected = None
    if arguments.select is not None:
        index = index_of(grasps, arguments.select, arguments.file)
        if index not in chosen:
            same = [k for k, other in enumerate(chosen) if holder[other] == holder[index]]
            chosen.insert(same[-1] + 1 if same else len(chosen), index)
        selected = chosen.index(index)
    return chosen, selected, caption


def _holders(grasps: GraspSet) -> list[str]:
    """The instance of each grasp, or without a scene the object."""
    return list(grasps.column("instance" if "instance" in grasps.columns else "object").tolist())


def _labels(grasps: GraspSet) -> list[str]:
    """What a list says of each grasp: its score or outcome, and its identifier."""
    from burg_drake.evaluation.best_grasps import shown_ids
    from burg_drake.visualization.grasp_legend import default_column

    column = default_column(grasps)
    values = [""] * len(grasps) if column is None else grasps.column(column).tolist()
    texts = [value if isinstance(value, str) else f"{value:.3g}" for value in values]
    return [f"{text} {id}".strip() for text, id in zip(texts, shown_ids(grasps), strict=True)]


def _place(content: Content, grasps: GraspSet, width: Array, meshcat: Meshcat) -> Array:
    """Shows the objects, in their scene or in rows; returns `X_WG` (N, 4, 4) of their grasps."""
    import numpy as np

    from burg_drake.visualization.grasp_gallery import show_with_grasps
    from burg_drake.visualization.scene_view import aim_camera, show_scene

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


def _outcomes(text: str) -> set[Outcome]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    known = [outcome.value for outcome in Outcome]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        given = unknown[0] if unknown else text
        raise argparse.ArgumentTypeError(f"{given!r} is no outcome; {nearest(given, known)}")
    return {Outcome(name) for name in names}
