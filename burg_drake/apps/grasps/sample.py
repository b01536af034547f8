"""`burg-drake grasps sample`: antipodal grasps on the objects of a scene or library."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_format,
    add_options,
    add_quiet,
    add_sampling,
    add_station,
    add_verb,
    grasps_per_object,
    number,
    output_of,
    print_shortfalls,
    settings_from,
)
from burg_drake.core import InvalidInputError
from burg_drake.core.terminal import TextTable

if TYPE_CHECKING:
    from burg_drake.apps.grasps.source import GraspSource
    from burg_drake.core import Array
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.candidates import SamplingSettings
    from burg_drake.station.document import Station

DEFAULT_GRASPS = 1000


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "sample",
        run_sample,
        "sample antipodal grasps on objects",
        "burg-drake grasps sample tabletop_six -n 1000 -o grasps.h5",
        "burg-drake grasps sample tabletop_six --only mug --from-arm-side -o mug.h5",
        "burg-drake grasps sample household --only mug -n 500 --diverse 4 -o mug.npz",
        "burg-drake grasps sample household --standoffs-mm 0 4 -4 --approaches 6 -o many.h5",
        "",
        "The same seed gives the same grasps; `evaluate` and `reach` sample them, too.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    parser.add_argument(
        "source", metavar="SCENE|LIB", help="scene file, library folder, or built-in name"
    )
    add_sampling(parser, DEFAULT_GRASPS)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help="grasp file to write, such as .h5, or folder for a file per object",
    )
    add_format(parser)
    add_station(parser)
    _add_settings(parser)
    add_quiet(parser)


def _add_settings(parser: Parser) -> None:
    from burg_drake.evaluation.candidates import SamplingSettings

    add_options(parser, SamplingSettings, "friction", "approaches", "from_arm_side")
    parser.add_argument(
        "--standoffs-mm",
        metavar="MM",
        type=number,
        nargs="+",
        default=[0.0],
        help=(
            "copies of each grasp, shifted back along its approach; negative: forward (default: 0)"
        ),
    )
    parser.add_argument(
        "--weights",
        metavar="OBJECT=FILE.npy",
        type=_named_file,
        action="append",
        default=[],
        help="weight of each mesh face when contacts are sampled; repeatable",
    )
    add_options(parser, SamplingSettings, "margin", "conservative", "diverse")


def run_sample(arguments: argparse.Namespace) -> int:
    """Samples and writes a file; 1 if there are no grasps at all."""
    from burg_drake.apps.grasps.source import open_source
    from burg_drake.evaluation.candidates import SamplingSettings
    from burg_drake.evaluation.grasp_sets import sampled_set
    from burg_drake.station.document import load_station
    from burg_drake.station.world import station_gripper

    output = output_of(arguments.output, arguments.target, frame="object")
    source = open_source(arguments.source)
    output.require_fits(_objects(arguments.only, source))
    station = load_station(arguments.station)
    settings = settings_from(
        arguments,
        SamplingSettings,
        approach_angle_deg=arguments.approach_angle,
        standoffs=tuple(1e-3 * distance for distance in arguments.standoffs_mm),
        weights={name: _load_weights(path) for name, path in arguments.weights},
        blind=arguments.blind,
    )
    asked = grasps_per_object(arguments)
    sampled, seconds = _sample(arguments, source, asked, station, settings)
    grasps = sampled_set(
        sampled, source.library, source.scene, station, asked, arguments.seed, settings
    )
    sampled_table(sampled, seconds, asked).show()
    print_shortfalls(sampled, asked)
    output.write(grasps, station_gripper(station))
    return 0 if len(grasps) else 1


def _objects(only: list[str] | None, source: GraspSource) -> list[str]:
    """The objects that are to be sampled on, of a scene one for each instance."""
    from burg_drake.evaluation.candidates import chosen_instances

    if source.scene is None:
        return list(dict.fromkeys(only or source.library.objects))
    return [source.scene.instance(name).object for name in chosen_instances(source.scene, only)]


def _sample(
    arguments: argparse.Namespace,
    source: GraspSource,
    n: int,
    station: Station,
    settings: SamplingSettings,
) -> tuple[dict[str, GraspSet], dict[str, float]]:
    """Grasps, and how long they took [s], by instance or object."""
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.evaluation.candidates import sample_library, sample_on_scene

    seed, only = arguments.seed, arguments.only
    if source.scene is None:
        stream = sample_library(source.library, station, n, seed, settings, only)
    else:
        stream = sample_on_scene(source.scene, station, n, seed, settings, only)
    sampled, seconds = {}, {}
    total = len(_objects(only, source))
    with Reporter(not arguments.quiet) as reporter:
        pace = ProgressMeter(reporter.show, Progress("sampling", total=total, unit="objects"))
        start = time.perf_counter()
        for name, grasps in stream:
            sampled[name], seconds[name] = grasps, time.perf_counter() - start
            pace.step(note=name)
            start = time.perf_counter()
    if not sampled:
        raise InvalidInputError(f"{arguments.source} has no free objects; nothing to sample on")
    return sampled, seconds


def _load_weights(path: str) -> Array:
    from pathlib import Path

    from burg_drake.core.files import open_npy

    with open_npy(Path(path)) as stored:
        return stored.read("fiu").astype(float)


def sampled_table(
    sampled: Mapping[str, GraspSet], seconds: Mapping[str, float], asked: int
) -> TextTable:
    """What sampling came to, by instance or object."""
    from burg_drake.core.terminal import format_count, format_number

    table = TextTable().names("on").numbers("asked", "found", "rays", "tried", "seconds")
    for name, grasps in sampled.items():
        counts = (asked, len(grasps), grasps.provenance["rays"], grasps.provenance["tried"])
        table.row(name, *map(format_count, counts), format_number(seconds[name], 2))
    return table


def _named_file(text: str) -> tuple[str, str]:
    """`OBJECT=FILE`."""
    name, equals, path = text.partition("=")
    if not (name and equals and path):
        raise argparse.ArgumentTypeError(f"{text!r} is not OBJECT=FILE.npy, such as mug=rim.npy")
    return name, path
