"""`burg-drake grasps sample` and `score`: antipodal grasps, and their analytic quality."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake import core, evaluation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines, show_progress

if TYPE_CHECKING:
    from burg_drake.station import Station


def add_grasps_sample_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake grasps sample`."""
    parser.epilog = options.examples_text(
        "burg-drake grasps sample tabletop_six -n 1000 -o grasps.h5",
        "burg-drake grasps sample tabletop_six --only mug --from-arm-side -o mug.h5",
        "burg-drake grasps sample household --only mug -n 500 --diverse 4 -o mug.npz",
        "burg-drake grasps sample household --standoffs-mm 0 4 -4 --approaches 6 -o many.h5",
        "",
        "The same seed gives the same grasps; `evaluate` and `reach` sample them, too.",
    )
    parser.add_argument(
        "source", metavar="SCENE|LIB", help="scene file, library folder, or built-in name"
    )
    options.add_sampling_options(parser, 1000)
    options.add_output(
        parser, "OUT", "grasp file to write, such as .h5, or folder for a file per object"
    )
    options.add_format_option(parser)
    options.add_station(parser)
    _add_sampling_settings(parser)
    options.add_quiet(parser)


def _add_sampling_settings(parser: options.Parser) -> None:
    options.add_settings_options(
        parser, evaluation.SamplingSettings, "friction", "approaches", "from_arm_side"
    )
    parser.add_argument(
        "--standoffs-mm",
        metavar="MM",
        type=options.number,
        nargs="+",
        default=[0.0],
        help=(
            "copies of each grasp, shifted back along its approach; negative: forward (default: 0)"
        ),
    )
    parser.add_argument(
        "--weights",
        metavar="OBJECT=FILE.npy",
        type=partial(options.key_and_value, form="OBJECT=FILE.npy, such as mug=rim.npy"),
        action="append",
        default=[],
        help="weight of each mesh face when contacts are sampled; repeatable",
    )
    options.add_settings_options(
        parser, evaluation.SamplingSettings, "margin", "conservative", "diverse"
    )


def run_grasps_sample(arguments: argparse.Namespace) -> int:
    """Samples grasps and writes a file; returns 1 if there are no grasps."""
    from burg_drake.station import load_station, station_gripper

    output = options.grasp_output(arguments.output, arguments.target, frame="object")
    source = options.open_grasp_source(arguments.source)
    output.require_fits(_objects_to_sample(arguments.only, source))
    station = load_station(arguments.station)
    weights: dict[str, core.Array] = {}
    for name, path in arguments.weights:
        with core.open_npy(Path(path)) as stored:
            weights[name] = stored.read("fiu").astype(float)
    settings = options.settings_from(
        arguments,
        evaluation.SamplingSettings,
        approach_angle_deg=arguments.approach_angle,
        standoffs=tuple(1e-3 * distance for distance in arguments.standoffs_mm),
        weights=weights,
        blind=arguments.blind,
    )
    asked = options.grasps_per_object(arguments)
    sampled, seconds = _sample_objects(arguments, source, asked, station, settings)
    grasps = evaluation.sampled_set(
        sampled, source.library, source.scene, station, asked, arguments.seed, settings
    )
    sampling_table(sampled, seconds, asked).show()
    options.print_shortfalls(sampled, asked)
    output.write(grasps, station_gripper(station))
    return 0 if len(grasps) else 1


def _objects_to_sample(only: list[str] | None, source: options.GraspSource) -> list[str]:
    """The objects to sample grasps on; for a scene one entry per instance."""
    if source.scene is None:
        return list(dict.fromkeys(only or source.library.objects))
    return [
        source.scene.instance(name).object
        for name in evaluation.chosen_instances(source.scene, only)
    ]


def _sample_objects(
    arguments: argparse.Namespace,
    source: options.GraspSource,
    n: int,
    station: Station,
    settings: evaluation.SamplingSettings,
) -> tuple[dict[str, core.GraspSet], dict[str, float]]:
    """Grasps and sampling times [s], by instance or object."""
    seed, only = arguments.seed, arguments.only
    if source.scene is None:
        stream = evaluation.sample_library(source.library, station, n, seed, settings, only)
    else:
        stream = evaluation.sample_on_scene(source.scene, station, n, seed, settings, only)
    sampled, seconds = {}, {}
    total = len(_objects_to_sample(only, source))
    with show_progress("sampling", "objects", total, quiet=arguments.quiet) as pace:
        start = time.perf_counter()
        for name, grasps in stream:
            sampled[name], seconds[name] = grasps, time.perf_counter() - start
            pace.step(note=name)
            start = time.perf_counter()
    if not sampled:
        raise core.InvalidInputError(
            f"{arguments.source} has no free objects; nothing to sample on"
        )
    return sampled, seconds


def sampling_table(
    sampled: Mapping[str, core.GraspSet], seconds: Mapping[str, float], asked: int
) -> core.TextTable:
    """Table of sampling results by instance or object."""
    table = core.TextTable().names("on").numbers("asked", "found", "rays", "tried", "seconds")
    for name, grasps in sampled.items():
        counts = (asked, len(grasps), grasps.provenance["rays"], grasps.provenance["tried"])
        table.row(name, *map(core.format_count, counts), core.format_number(seconds[name], 2))
    return table


SCORE_COLUMNS_HELP = """\
Adds these columns, which are nan where a pad meets nothing:
  of the grasp  force_closure, friction_needed, antipodal_angle [rad],
                slide [m] until the pads hold the object (inf: never)
  of the grip   epsilon, volume, patch_area [m2], contact_offset [m],
                load_margin (load in weights of the object, worst direction),
                gravity_margin (the same along gravity, in a scene)
  of the scene  clearance [m] (negative: overlap), nearest, screened,
                collides_with"""
"""Help text about the columns that scoring adds."""


def add_grasps_score_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake grasps score`."""
    from burg_drake.grasping import DEFAULT_METRIC

    parser.epilog = options.examples_text(
        "burg-drake grasps score grasps.h5 -o scored.h5",
        "burg-drake grasps score grasps.h5 --scene tabletop_six --by gravity_margin -o scored.h5",
        "burg-drake grasps score theirs.json --library household --rename mug -o ours.h5",
        "burg-drake grasps score grasps.h5 --friction 0.5 --friction mug=0.3",
        "",
        SCORE_COLUMNS_HELP,
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        type=options.input_file,
        help="grasp file of any format, or folder of a run",
    )
    options.add_reading_options(parser)
    options.add_output(
        parser, "OUT", "grasp file to write, or folder (default: only print)", required=False
    )
    options.add_format_option(parser)
    options.add_source_options(parser)
    options.add_file_station(parser)
    parser.add_argument(
        "--by",
        metavar="METRIC",
        default=DEFAULT_METRIC,
        help="metric to use as score; its negative where less is better (default: %(default)s)",
    )
    parser.add_argument(
        "--friction",
        metavar="[OBJECT=]MU",
        type=options.friction,
        action="append",
        default=[],
        help="friction coefficient (default: the object's); repeatable",
    )
    options.add_renaming(parser)
    options.add_quiet(parser)


def run_grasps_score(arguments: argparse.Namespace) -> int:
    """Scores grasps, prints tables and writes a file."""
    from burg_drake.formats import with_objects_renamed

    output = None
    if arguments.output is not None:
        output = options.grasp_output(arguments.output, arguments.target, frame="object")
    station = options.station_from_options(arguments, arguments.file)
    gripper = options.gripper_from_options(arguments, station)
    imported = evaluation.read_input(arguments.file, arguments.source, gripper)
    if imported.frame != "object":
        raise core.InvalidInputError(
            f"{arguments.file} has grasps in the {imported.frame} frame; bring them into those of"
            " the objects with `burg-drake grasps convert`"
        )
    grasps = with_objects_renamed(imported.grasps, dict(arguments.rename))
    source = options.load_grasp_source(arguments, grasps, arguments.file)
    if output is not None:
        output.require_fits(grasps.object.tolist())
    print_note_lines(imported.notes)
    scored = evaluation.scored_set(
        grasps,
        source.library,
        station,
        source.scene,
        friction=dict(arguments.friction),
        by=arguments.by,
        progress=not arguments.quiet,
    )
    _print_score_tables(scored)
    if output is not None:
        print(f"scored by {arguments.by}")
        output.write(scored, gripper)
    return 0


def _print_score_tables(grasps: core.GraspSet) -> None:
    """Prints quantiles of each metric by object, and the bodies that the hand collides with."""
    import numpy as np

    from burg_drake.apps.commands.grasp_tables import TABLE_QUANTILES, print_numbers
    from burg_drake.grasping import METRICS

    for name in dict.fromkeys(grasps.object.tolist()):
        own = grasps.select(grasps.object == name)
        rows = {}
        for metric in (*METRICS[1:], "clearance"):
            values = own.column(metric) if metric in own.columns else np.empty(0)
            values = values[~np.isnan(values)]
            if len(values):
                shown = np.quantile(values, TABLE_QUANTILES, method="nearest").tolist()
                figures = {
                    f"{q:.0%}": value for q, value in zip(TABLE_QUANTILES, shown, strict=True)
                }
                rows[metric] = (len(values), figures)
        closed = int(own.column("force_closure").sum())
        print_numbers(f"{name}: {len(own):,} grasps, {closed:,} in force closure", rows)
        if "screened" in own.columns:
            counts = Counter(own.column("screened").tolist()).most_common()
            print("screened: " + ", ".join(f"{outcome} {count:,}" for outcome, count in counts))
