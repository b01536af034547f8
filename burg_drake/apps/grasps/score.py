"""`burg-drake grasps score`: analytic quality of the grasps of a file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_format,
    add_quiet,
    add_renaming,
    add_verb,
    friction,
    input_file,
    output_of,
)
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "score",
        run_score,
        "score grasps analytically: force closure, epsilon, the weight they can hold",
        "burg-drake grasps score grasps.h5 -o scored.h5",
        "burg-drake grasps score grasps.h5 --scene tabletop_six --by gravity_margin -o scored.h5",
        "burg-drake grasps score theirs.json --library household --rename mug -o ours.h5",
        "burg-drake grasps score grasps.h5 --friction 0.5 --friction mug=0.3",
        "",
        "Adds a column for each metric. Of the grasp as given: force_closure, friction_needed,",
        "antipodal_angle [rad]. Where pads meet faces that lean more than friction holds, the",
        "object slides in the hand until they hold it: slide [m], inf if they never do. Of the",
        "object at rest there: epsilon, volume, load_margin (how many times its weight the grip",
        "withstands, in the worst direction), gravity_margin (along gravity, in a",
        "scene; below 1 the object begins to turn in the hand, which need not be a drop),",
        "patch_area [m2], contact_offset [m]. In a scene also clearance [m], negative where the",
        "open hand overlaps something, nearest, screened (clear, or which collision),",
        "collides_with. Where a pad meets nothing, metrics are nan.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.apps.grasps.source import add_source
    from burg_drake.apps.options import add_file_options, add_file_station
    from burg_drake.grasping.quality import DEFAULT_METRIC

    parser.add_argument(
        "file", metavar="FILE", type=input_file, help="grasp file of any format, or folder of a run"
    )
    add_file_options(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="grasp file to write, or folder for one file an object (default: only print)",
    )
    add_format(parser)
    add_source(parser)
    add_file_station(parser)
    parser.add_argument(
        "--by",
        metavar="METRIC",
        default=DEFAULT_METRIC,
        help="metric that becomes the score, its negative where less is better"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--friction",
        metavar="[OBJECT=]MU",
        type=friction,
        action="append",
        default=[],
        help="coefficient (default: the object's); may be given several times",
    )
    add_renaming(parser)
    add_quiet(parser)


def run_score(arguments: argparse.Namespace) -> int:
    """Scores, prints a table and writes a file."""
    from burg_drake.apps.grasps.source import source_of
    from burg_drake.apps.options import gripper_for, station_for
    from burg_drake.evaluation.grasp_sets import read_input, scored_set
    from burg_drake.formats.common import with_objects_renamed

    output = None
    if arguments.output is not None:
        output = output_of(arguments.output, arguments.target, frame="object")
    station = station_for(arguments, arguments.file)
    gripper = gripper_for(arguments, station)
    imported = read_input(arguments.file, arguments.source, gripper)
    if imported.frame != "object":
        raise InvalidInputError(
            f"{arguments.file} has grasps in the {imported.frame} frame; bring them into those of"
            " the objects with `burg-drake grasps convert`"
        )
    grasps = with_objects_renamed(imported.grasps, dict(arguments.rename))
    source = source_of(arguments, grasps, arguments.file)
    if output is not None:
        output.require_fits(grasps.object.tolist())
    for note in imported.notes:
        print(f"note: {note}")
    scored = scored_set(
        grasps,
        source.library,
        station,
        source.scene,
        friction=dict(arguments.friction),
        by=arguments.by,
        progress=not arguments.quiet,
    )
    _print_tables(scored)
    if output is not None:
        print(f"scored by {arguments.by}")
        output.write(scored, gripper)
    return 0


def _print_tables(grasps: GraspSet) -> None:
    """Quantiles of each metric by object, and what the hand collides with."""
    from collections import Counter

    import numpy as np

    from burg_drake.apps.terminal import QUANTILES, print_numbers
    from burg_drake.grasping.quality import METRICS

    for name in dict.fromkeys(grasps.object.tolist()):
        own = grasps.select(grasps.object == name)
        rows = {}
        for metric in (*METRICS[1:], "clearance"):
            values = own.column(metric) if metric in own.columns else np.empty(0)
            values = values[~np.isnan(values)]
            if len(values):
                shown = np.quantile(values, QUANTILES, method="nearest").tolist()
                figures = {f"{q:.0%}": value for q, value in zip(QUANTILES, shown, strict=True)}
                rows[metric] = (len(values), figures)
        closed = int(own.column("force_closure").sum())
        print_numbers(f"{name}: {len(own):,} grasps, {closed:,} in force closure", rows)
        if "screened" in own.columns:
            counts = Counter(own.column("screened").tolist()).most_common()
            print("screened: " + ", ".join(f"{outcome} {count:,}" for outcome, count in counts))
