"""`burg-drake grasps score`: analytic quality of the grasps of a file."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import add_renaming, add_station, add_verb, friction
from burg_drake.core.errors import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet

# Kept in step with grasping.quality, which imports too much for a help text; a test compares them.
DEFAULT_METRIC = "load_margin"
UNITS = {
    "friction_needed": "",
    "antipodal_angle": "deg",
    "epsilon": "",
    "volume": "",
    "load_margin": "weights",
    "gravity_margin": "weights",
    "patch_area": "mm2",
    "contact_offset": "mm",
    "clearance": "mm",
}
"""Metrics of the table, and the units that they are printed in."""

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)


def add_to(group: Any) -> None:
    """Adds the verb."""
    from burg_drake.apps.grasp_source import add_source

    parser = add_verb(
        group,
        "score",
        run_score,
        "measure grasps analytically: force closure, epsilon, what weight they bear",
        "burg-drake grasps score grasps.h5 -o scored.h5",
        "burg-drake grasps score grasps.h5 --scene tabletop_six --by gravity_margin -o scored.h5",
        "burg-drake grasps score theirs.json --library household --rename mug -o ours.h5",
        "burg-drake grasps score grasps.h5 --friction 0.5 --friction mug=0.3",
        "",
        "Adds a column for each metric: force_closure, friction_needed, antipodal_angle [rad],",
        "epsilon, volume, load_margin (the weights that the grip bears in the worst direction),",
        "gravity_margin (along gravity, in a scene), patch_area [m2], contact_offset [m]; and in a",
        "scene clearance [m], negative where the open hand overlaps something, and nearest. Where",
        "a pad meets nothing, the metrics are nan.",
    )
    parser.add_argument("file", metavar="FILE", help="grasp file of any format")
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="grasp file to write (default: only print)"
    )
    add_source(parser)
    add_station(parser)
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


def run_score(arguments: argparse.Namespace) -> int:
    """Scores, prints a table and writes a file."""
    from burg_drake.apps.grasp_source import source_of
    from burg_drake.evaluation.scored_set import scored_set
    from burg_drake.formats.conversion import with_objects_renamed
    from burg_drake.formats.grasp_files import read_grasp_file, write_grasp_file
    from burg_drake.station.gripper import gripper_of
    from burg_drake.station.station import load_station

    station = load_station(arguments.station)
    gripper = gripper_of(station.hand, station.hand_model, station.hand_path)
    imported = read_grasp_file(arguments.file, gripper=gripper)
    if imported.frame != "object":
        raise InvalidInputError(
            f"{arguments.file} has grasps in the {imported.frame} frame; bring them into those of"
            " the objects with `burg-drake grasps convert`"
        )
    grasps = with_objects_renamed(imported.grasps, dict(arguments.rename))
    source = source_of(arguments, grasps, arguments.file)
    scored = scored_set(
        grasps,
        source.library,
        station,
        source.scene,
        friction=dict(arguments.friction),
        by=arguments.by,
    )
    _print_table(scored)
    if arguments.output is not None:
        for note in write_grasp_file(scored, arguments.output, gripper=gripper):
            print(f"burg-drake: note: {note}", file=sys.stderr)
        print(f"wrote {len(scored)} grasps to {arguments.output}, scored by {arguments.by}")
    return 0


def _print_table(grasps: GraspSet) -> None:
    """Quantiles of each metric by object."""
    import numpy as np
    from rich import box
    from rich.console import Console
    from rich.table import Table

    factor = {"deg": np.degrees(1.0), "mm": 1e3, "mm2": 1e6}
    for name in dict.fromkeys(grasps.object.tolist()):
        own = grasps.select(grasps.object == name)
        closed = int(own.column("force_closure").sum())
        title = f"{name}: {len(own):,} grasps, {closed:,} in force closure"
        table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        table.add_column("metric", no_wrap=True)
        for column in ("known", *(f"{q:.0%}" for q in QUANTILES)):
            table.add_column(column, justify="right", no_wrap=True)
        for metric, unit in UNITS.items():
            values = own.column(metric) if metric in own.columns else np.empty(0)
            values = values[~np.isnan(values)] * factor.get(unit, 1.0)
            if len(values):
                shown = np.quantile(values, QUANTILES, method="nearest")
                label = f"{metric} ({unit})" if unit else metric
                table.add_row(label, f"{len(values):,}", *(f"{value:.3g}" for value in shown))
        Console().print(table)
