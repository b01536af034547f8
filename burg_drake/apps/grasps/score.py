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


COLUMNS_TEXT = """\
Adds these columns, which are nan where a pad meets nothing:
  of the grasp  force_closure, friction_needed, antipodal_angle [rad],
                slide [m] until the pads hold the object (inf: never)
  of the grip   epsilon, volume, patch_area [m2], contact_offset [m],
                load_margin (load in weights of the object, worst direction),
                gravity_margin (the same along gravity, in a scene)
  of the scene  clearance [m] (negative: overlap), nearest, screened,
                collides_with"""


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "score",
        run_score,
        "score grasps by formulas: force closure, epsilon, load",
        "burg-drake grasps score grasps.h5 -o scored.h5",
        "burg-drake grasps score grasps.h5 --scene tabletop_six --by gravity_margin -o scored.h5",
        "burg-drake grasps score theirs.json --library household --rename mug -o ours.h5",
        "burg-drake grasps score grasps.h5 --friction 0.5 --friction mug=0.3",
        "",
        COLUMNS_TEXT,
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
        help="grasp file to write, or folder (default: only print)",
    )
    add_format(parser)
    add_source(parser)
    add_file_station(parser)
    parser.add_argument(
        "--by",
        metavar="METRIC",
        default=DEFAULT_METRIC,
        help="metric to use as score; its negative where less is better (default: %(default)s)",
    )
    parser.add_argument(
        "--friction",
        metavar="[OBJECT=]MU",
        type=friction,
        action="append",
        default=[],
        help="friction coefficient (default: the object's); repeatable",
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
