"""`burg-drake reach`: which grasps the arm can execute, and what hinders it at the others."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from burg_drake.apps.options import (
    Output,
    Parser,
    add_format,
    add_given,
    add_motion,
    add_quiet,
    add_retry_failed,
    add_sampling,
    add_scene,
    add_station,
    add_verb,
    add_workers,
    chosen_motion,
    grasps_per_object,
    how_to_retry,
    output_of,
    print_shortfalls,
    read_given,
    require_file,
    require_sampled,
)
from burg_drake.apps.runs.reach_tables import print_tables
from burg_drake.core import InvalidInputError
from burg_drake.core.files import require_writable

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.store import PlanOutput
    from burg_drake.scene.document import Scene
    from burg_drake.station.document import GraspMotion, Station

DEFAULT_GRASPS = 100
"""Sampled for each object, unless grasps are given."""
FRAME = "x, y, z: the grasp frame's origin in the frame of its object"
TABLES = (".csv", ".parquet")
"""Suffixes of tables, which have a row for each grasp and no provenance."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    add_verb(
        verbs,
        "reach",
        run_reach,
        "find which grasps the arm can reach, and what stops it",
        "burg-drake reach tabletop_six --grasps grasps.h5 -o reach.csv",
        "burg-drake reach my_scene.yaml --grasps theirs.h5 --station panda_shelf -o reach.h5",
        "burg-drake reach tabletop_six --grasps-per-object 50 --plans plans/",
        "burg-drake reach tabletop_six --grasps grasps.h5 --only-reachable -o feasible.h5",
        "burg-drake reach my_scene.yaml --station panda_shelf --retreat-mm 100 --least-lift-mm 20",
        "",
        "A grasp is reachable if the open hand is clear, the arm can follow approach, retreat and"
        " lift, and it finds a path from home. Each yes is checked by Drake. Nothing is"
        " simulated; `evaluate` does that.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.evaluation.store import PlanFormat

    add_scene(parser)
    which = parser.add_mutually_exclusive_group()
    add_sampling(parser, DEFAULT_GRASPS, which)
    add_given(parser, which)
    add_station(parser)
    add_motion(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="table (.csv, .parquet), grasp file (.h5, .npz, ...), or folder for a file per"
        " object (default: only print)",
    )
    add_format(parser)
    parser.add_argument("--only-reachable", action="store_true", help="write only reachable grasps")
    parser.add_argument(
        "--plans",
        metavar="DIR",
        help="write the timed motion of each reachable grasp here, 1.5 MB each",
    )
    parser.add_argument(
        "--plan-format",
        choices=get_args(PlanFormat),
        help="format of the motions: JSON like ROS's JointTrajectory, or CSV (default: json)",
    )
    parser.add_argument(
        "--screening",
        action="store_true",
        help="twice as fast, and wrong for one or two grasps in a hundred",
    )
    add_workers(parser)
    add_retry_failed(parser, "grasps")
    add_quiet(parser)


def run_reach(arguments: argparse.Namespace) -> int:
    """Asks, prints tables and writes what is wanted; 1 if that failed for some grasps."""
    from burg_drake.evaluation import reach
    from burg_drake.evaluation.grasp_sets import mistake_notes
    from burg_drake.motion.workspace import require_usable_arm
    from burg_drake.scene.document import load_scene
    from burg_drake.station.checks import require_valid_scene
    from burg_drake.station.document import load_station

    _require_sound(arguments)
    output = _output(arguments)
    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    warnings = require_valid_scene(scene, station)
    motion = chosen_motion(arguments, station)
    grasps = _grasps(arguments, scene, station)
    hints = mistake_notes(grasps, station, scene) if arguments.grasps is not None else ()
    if isinstance(output, Output):
        output.require_fits([name for part in grasps.values() for name in part.object.tolist()])
    for warning in (*warnings, *require_usable_arm(scene, station)):
        print(f"burg-drake: warning: {warning}", file=sys.stderr)
    judged = reach(
        scene,
        station,
        grasps,
        motion=motion,
        exact=not arguments.screening,
        plans=_plans(arguments),
        workers=arguments.workers,
        progress=not arguments.quiet,
    )
    _print_answers(judged, scene, motion, arguments)
    for hint in hints:
        print(f"note: {hint}")
    reachable = _reachable(judged)
    if arguments.plans is not None:
        print(f"{(reachable & ~_unplanned(judged)).sum()} plans are in {arguments.plans}")
    if output is not None:
        _write(judged.select(reachable) if arguments.only_reachable else judged, output, station)
    return _report_failures(judged, arguments)


def _require_sound(arguments: argparse.Namespace) -> None:
    """Refuses options without those that they belong to, and a folder that cannot be written to.

    Raises:
        InvalidInputError: names the option or the folder.
    """
    require_file(arguments)
    require_sampled(arguments)
    if arguments.plan_format and not arguments.plans:
        raise InvalidInputError("--plan-format is for plan files; add --plans DIR")
    if arguments.retry_failed and not arguments.plans:
        raise InvalidInputError("--retry-failed is for plan files; add --plans DIR")
    if arguments.only_reachable and arguments.output is None:
        raise InvalidInputError("--only-reachable is for the output file; add -o OUT")
    if arguments.plans:
        require_writable(Path(arguments.plans) / "plan")
        arguments.after_interrupt = "; run the same command to continue"


def _print_answers(
    judged: GraspSet, scene: Scene, motion: GraspMotion, arguments: argparse.Namespace
) -> None:
    """The tables, and what one has to know to read them."""
    from burg_drake.evaluation.candidates import chosen_instances
    from burg_drake.evaluation.records import motion_text
    from burg_drake.evaluation.results import missing_grasps_note, short_lifts
    from burg_drake.station.document import GraspMotion

    names = [scene.instance(n).object for n in chosen_instances(scene, arguments.only)]
    given = arguments.grasps is not None
    print_tables(judged.select(_answered(judged)), names, motion, given=given)
    if given and (note := missing_grasps_note(names, judged.object.tolist())):
        print(f"note: {note}")
    if motion != GraspMotion():
        print(f"motion: {motion_text(motion)}")
    lifts = short_lifts(judged.column("lift_height"), motion.lift_height)
    if lifts is not None:
        print(lifts)


def _answered(judged: GraspSet) -> Any:
    """(N,) bool, which grasps could be judged."""
    return judged.column("outcome") != ""


def _reachable(judged: GraspSet) -> Any:
    """(N,) bool, which grasps the arm can execute."""
    from burg_drake.core.grasps import Outcome

    return judged.column("outcome") == Outcome.REACHABLE


def _unplanned(judged: GraspSet) -> Any:
    """(N,) bool, which of those have no plan though one was wanted."""
    return _reachable(judged) & (judged.column("reason") != "")


def _report_failures(judged: GraspSet, arguments: argparse.Namespace) -> int:
    """Says of which grasps the computation has failed; 1 if there are any."""
    answered, unplanned = _answered(judged), _unplanned(judged)
    failed = judged.select(~answered)
    retry = f"; {how_to_retry(0, len(failed))}" if arguments.plans else ""
    _print_failures(failed, "could not be judged", len(judged), retry)
    _print_failures(judged.select(unplanned), "have no plan", int(_reachable(judged).sum()))
    return 0 if answered.all() and not unplanned.any() else 1


def _plans(arguments: argparse.Namespace) -> PlanOutput | None:
    """Where plans go, if they are wanted."""
    from burg_drake.evaluation.store import PlanOutput

    if arguments.plans is None:
        return None
    return PlanOutput(arguments.plans, arguments.plan_format or "json", arguments.retry_failed)


def _print_failures(failed: GraspSet, what: str, total: int, retry: str = "") -> None:
    """A line about grasps whose computation has failed, if there are any."""
    if len(failed):
        reason = failed.column("reason")[0].removeprefix("no plan: ")
        id = f"{failed.column('instance')[0]}-{failed.id[0]}"
        print(
            f"burg-drake: {len(failed)} of {total} grasps {what}, such as {id}: {reason}{retry}",
            file=sys.stderr,
        )


def _grasps(
    arguments: argparse.Namespace, scene: Scene, station: Station
) -> Mapping[str, GraspSet]:
    """The grasps of the file, or sampled ones, by instance."""
    from burg_drake.evaluation.candidates import on_chosen

    if arguments.grasps is not None:
        given = read_given(arguments, scene, station)
        for note in given.notes:
            print(f"note: {note}")
        return on_chosen(scene, given.by_instance, arguments.only)
    return sampled_grasps(arguments, scene, station)


def sampled_grasps(
    arguments: argparse.Namespace, scene: Scene, station: Station
) -> dict[str, GraspSet]:
    """Grasps by instance as the options ask for them; says what is missing."""
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.evaluation.candidates import SamplingSettings, chosen_instances, sample_on_scene

    settings = SamplingSettings(approach_angle_deg=arguments.approach_angle, blind=arguments.blind)
    count, seed = grasps_per_object(arguments), arguments.seed
    sampled = {}
    total = len(chosen_instances(scene, arguments.only))
    with Reporter(not arguments.quiet) as reporter:
        pace = ProgressMeter(reporter.show, Progress("sampling", total=total, unit="objects"))
        for name, grasps in sample_on_scene(scene, station, count, seed, settings, arguments.only):
            sampled[name] = grasps
            pace.step(note=name)
    print_shortfalls(sampled, count)
    return sampled


def _output(arguments: argparse.Namespace) -> Path | Output | None:
    """Where to write: a table, a grasp file, or nowhere; a place that cannot be written to is
    refused before any work."""
    if arguments.output is None:
        return None
    path = Path(arguments.output)
    if arguments.target is None and path.suffix in TABLES and not path.is_dir():
        from burg_drake.evaluation.records import require_table

        require_table(path)
        return path
    return output_of(arguments.output, arguments.target, frame="object")


def _write(grasps: GraspSet, output: Path | Output, station: Station) -> None:
    from burg_drake.core.paths import with_shareable_references
    from burg_drake.evaluation import reach_columns
    from burg_drake.evaluation.records import write_table
    from burg_drake.station.world import station_gripper

    if isinstance(output, Output):
        output.write(grasps, station_gripper(station))
        return
    provenance = with_shareable_references(grasps.provenance, output.absolute().parent)
    write_table(output, reach_columns(grasps), provenance)
    print(f"wrote {len(grasps)} grasps to {output}; {FRAME}")
