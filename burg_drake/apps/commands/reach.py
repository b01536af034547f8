"""`burg-drake reach`: which grasps the arm can execute, and what is in the way of the others."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from burg_drake import core, evaluation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines, print_remark, print_warning, show_progress

if TYPE_CHECKING:
    from burg_drake.scene import Scene
    from burg_drake.station import GraspMotion, Station


def print_reach_tables(
    grasps: core.GraspSet, object_names: Iterable[str], motion: GraspMotion, *, given: bool = False
) -> None:
    """Prints counts by object and by outcome with the obstacles, objects without a clear or
    reachable grasp, and the speed of the computation.

    Args:
        grasps: grasps judged by `reach`.
        object_names: requested objects, some of which may have no grasp.
        motion: motion of the hand.
        given: whether the grasps are the user's own.
    """
    outcomes = [core.Outcome(text) for text in grasps.column("outcome").tolist()]
    by_object: dict[str, Counter[core.Outcome]] = {name: Counter() for name in object_names}
    for name, outcome in zip(grasps.object.tolist(), outcomes, strict=True):
        by_object.setdefault(name, Counter())[outcome] += 1
    total = Counter(outcomes)
    reach_table(by_object, total).show()
    outcome_table(grasps, by_object, total).show()
    ended, blocker = grasps.column("outcome"), grasps.column("blocker")
    notes = evaluation.unclear_notes(grasps.object, ended, blocker, given=given)
    print_note_lines((*notes, *evaluation.unmoved_notes(grasps.object, ended, blocker, motion)))
    clear = sum(n for o, n in total.items() if o.stage is not core.Stage.CLEAR)
    seconds = float(grasps.column("cpu").sum())
    if clear and seconds > 0.0:
        rate = f"{core.format_number(clear / seconds)} clear grasps per CPU second"
        print(f"{rate}; {core.format_number(seconds)} CPU seconds without set-up")


def reach_table(
    by_object: Mapping[str, Counter[core.Outcome]], total: Counter[core.Outcome]
) -> core.TextTable:
    """Table of the number of grasps that the arm can execute, by object."""
    table = core.TextTable("Grasps that the arm can execute").names("object")
    table.numbers("grasps", "clear", "reachable", "of clear")
    rows = {**by_object, "all": total} if len(by_object) != 1 else by_object
    for name, counts in rows.items():
        if name == "all":
            table.gap()
        clear = sum(n for o, n in counts.items() if o.stage is not core.Stage.CLEAR)
        reachable = counts[core.Outcome.REACHABLE]
        share = core.format_percent(reachable / clear) if clear else "-"
        table.row(
            name,
            core.format_count(counts.total()),
            core.format_count(clear),
            core.format_count(reachable),
            share,
        )
    table.caption = (
        "clear: the open hand collides with nothing at the grasp\n"
        "reachable: hand and arm can go there, in and up again without a collision"
    )
    return table


def outcome_table(
    grasps: core.GraspSet,
    by_object: Mapping[str, Counter[core.Outcome]],
    total: Counter[core.Outcome],
) -> core.TextTable:
    """Table of outcomes with the most frequent obstacles, and by object if there is room."""
    max_blockers = 3  # Most frequent bodies listed for each outcome.
    from rich.console import Console

    room = Console().width - 70
    names = [name for name in by_object if len(by_object) > 1]
    names = names if sum(len(name) + 2 for name in names) <= room else []
    table = core.TextTable("Outcomes").texts("outcome")
    table.numbers(*names, "all", "share").texts("mostly in the way")
    order = [core.Outcome.REACHABLE, *core.Outcome]
    for outcome in sorted(total, key=order.index):
        mask = (grasps.column("outcome") == outcome) & (grasps.column("blocker") != "")
        blockers = Counter(grasps.column("blocker")[mask].tolist()).most_common(max_blockers)
        counts = [
            core.format_count(n) if (n := by_object[name][outcome]) else core.NO_VALUE
            for name in names
        ]
        share = core.format_percent(total[outcome] / len(grasps))
        in_the_way = ", ".join(f"{name} ({core.format_count(n)})" for name, n in blockers)
        table.row(outcome.value, *counts, core.format_count(total[outcome]), share, in_the_way)
    failed = [
        outcome
        for outcome in core.Outcome
        if outcome in total and outcome is not core.Outcome.REACHABLE
    ]
    table.caption = "\n".join(f"{outcome}: {outcome.meaning}" for outcome in failed)
    return table


def add_reach_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake reach`."""
    parser.epilog = options.examples_text(
        "burg-drake reach tabletop_six --grasps grasps.h5 -o reach.csv",
        "burg-drake reach my_scene.yaml --grasps theirs.h5 --station panda_shelf -o reach.h5",
        "burg-drake reach tabletop_six --grasps-per-object 50 --plans plans/",
        "burg-drake reach tabletop_six --grasps grasps.h5 --only-reachable -o feasible.h5",
        "burg-drake reach my_scene.yaml --station panda_shelf --retreat-mm 100 --least-lift-mm 20",
        "",
        "A grasp is reachable if the open hand is clear, the arm can follow approach, retreat and"
        " lift, and it finds a path from home. Each yes is checked by Drake. Nothing is"
        " simulated; `evaluate` does that.",
    )
    options.add_scene(parser)
    source_group = parser.add_mutually_exclusive_group()
    options.add_sampling_options(parser, 100, source_group)
    options.add_grasp_file_options(parser, source_group)
    options.add_station(parser)
    options.add_motion_options(parser)
    options.add_output(
        parser,
        "OUT",
        "table (.csv, .parquet), grasp file (.h5, .npz, ...), or folder for a file per"
        " object (default: only print)",
        required=False,
    )
    options.add_format_option(parser)
    parser.add_argument("--only-reachable", action="store_true", help="write only reachable grasps")
    parser.add_argument(
        "--plans",
        metavar="DIR",
        help="write the timed motion of each reachable grasp here, 1.5 MB each",
    )
    parser.add_argument(
        "--plan-format",
        choices=get_args(evaluation.PlanFormat),
        help="format of the motions: JSON like ROS's JointTrajectory, or CSV (default: json)",
    )
    parser.add_argument(
        "--screening",
        action="store_true",
        help="twice as fast, and wrong for one or two grasps in a hundred",
    )
    options.add_workers(parser)
    options.add_retry_failed(parser, "grasps")
    options.add_quiet(parser)


def run_reach(arguments: argparse.Namespace) -> int:
    """Judges grasps, prints tables and writes outputs; returns 1 if some could not be judged."""
    from burg_drake.motion import require_usable_arm
    from burg_drake.scene import load_scene
    from burg_drake.station import load_station, require_valid_scene

    _require_consistent_options(arguments)
    output = _reach_output(arguments)
    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    warnings = require_valid_scene(scene, station)
    motion = options.motion_from_options(arguments, station)
    grasps = _load_or_sample_grasps(arguments, scene, station)
    hints = evaluation.mistake_notes(grasps, station, scene) if arguments.grasps is not None else ()
    if isinstance(output, options.GraspOutput):
        output.require_fits([name for part in grasps.values() for name in part.object.tolist()])
    for warning in (*warnings, *require_usable_arm(scene, station)):
        print_warning(warning)
    plans = None
    if arguments.plans is not None:
        plans = evaluation.PlanOutput(
            arguments.plans, arguments.plan_format or "json", arguments.retry_failed
        )
    judged = evaluation.reach(
        scene,
        station,
        grasps,
        motion=motion,
        exact=not arguments.screening,
        plans=plans,
        workers=arguments.workers,
        progress=not arguments.quiet,
    )
    _print_results(judged, scene, motion, arguments)
    print_note_lines(hints)
    reachable = _reachable_mask(judged)
    if arguments.plans is not None:
        print(f"{(reachable & ~_unplanned_mask(judged)).sum()} plans are in {arguments.plans}")
    if output is not None:
        _write_grasps(
            judged.select(reachable) if arguments.only_reachable else judged, output, station
        )
    return _report_failures(judged, arguments)


def _require_consistent_options(arguments: argparse.Namespace) -> None:
    """Refuses options whose required other option is missing, and a read-only folder.

    Raises:
        InvalidInputError: names the option or the folder.
    """
    options.require_grasp_file(arguments)
    options.refuse_sampling_options_with_file(arguments)
    if arguments.plan_format and not arguments.plans:
        raise core.InvalidInputError("--plan-format is for plan files; add --plans DIR")
    if arguments.retry_failed and not arguments.plans:
        raise core.InvalidInputError("--retry-failed is for plan files; add --plans DIR")
    if arguments.only_reachable and arguments.output is None:
        raise core.InvalidInputError("--only-reachable is for the output file; add -o OUT")
    if arguments.plans:
        core.require_writable(Path(arguments.plans) / "plan")
        arguments.after_interrupt = "; run the same command to continue"


def _print_results(
    judged: core.GraspSet, scene: Scene, motion: GraspMotion, arguments: argparse.Namespace
) -> None:
    """Prints the tables with notes."""
    from burg_drake.station import GraspMotion

    names = [scene.instance(n).object for n in evaluation.chosen_instances(scene, arguments.only)]
    given = arguments.grasps is not None
    print_reach_tables(judged.select(_judged_mask(judged)), names, motion, given=given)
    outcomes = judged.select(_judged_mask(judged)).column("outcome")
    if remedy := evaluation.motion_remedy(outcomes.tolist(), motion):
        print_note_lines([remedy.text, options.describe_motion_remedy(remedy)])
    if given and (note := evaluation.missing_grasps_note(names, judged.object.tolist())):
        print(f"note: {note}")
    if motion != GraspMotion():
        print(f"motion: {evaluation.motion_text(motion)}")
    lifts = evaluation.count_short_lifts(judged.column("lift_height"), motion.lift_height)
    if lifts is not None:
        print(lifts)


def _judged_mask(judged: core.GraspSet) -> Any:
    """(N,) bool, grasps that could be judged."""
    return judged.column("outcome") != ""


def _reachable_mask(judged: core.GraspSet) -> Any:
    """(N,) bool, grasps that the arm can execute."""
    return judged.column("outcome") == core.Outcome.REACHABLE


def _unplanned_mask(judged: core.GraspSet) -> Any:
    """(N,) bool, reachable grasps without a plan although one was requested."""
    return _reachable_mask(judged) & (judged.column("reason") != "")


def _report_failures(judged: core.GraspSet, arguments: argparse.Namespace) -> int:
    """Prints the grasps whose computation has failed; returns 1 if there are any."""
    was_judged, unplanned = _judged_mask(judged), _unplanned_mask(judged)
    failed = judged.select(~was_judged)
    retry = f"; {options.retry_advice(0, len(failed))}" if arguments.plans else ""
    _print_failures(failed, "could not be judged", len(judged), retry)
    _print_failures(judged.select(unplanned), "have no plan", int(_reachable_mask(judged).sum()))
    return 0 if was_judged.all() and not unplanned.any() else 1


def _print_failures(failed: core.GraspSet, what: str, total: int, retry: str = "") -> None:
    """Prints a line about grasps whose computation has failed, if there are any."""
    if len(failed):
        reason = failed.column("reason")[0].removeprefix("no plan: ")
        id = f"{failed.column('instance')[0]}-{failed.id[0]}"
        print_remark(f"{len(failed)} of {total} grasps {what}, such as {id}: {reason}{retry}")


def _load_or_sample_grasps(
    arguments: argparse.Namespace, scene: Scene, station: Station
) -> Mapping[str, core.GraspSet]:
    """The grasps of the file, or sampled ones, by instance."""
    if arguments.grasps is not None:
        given = options.read_grasps_from_options(arguments, scene, station)
        print_note_lines(given.notes)
        return evaluation.select_instances(scene, given.by_instance, arguments.only)
    return sampled_grasps(arguments, scene, station)


def sampled_grasps(
    arguments: argparse.Namespace, scene: Scene, station: Station
) -> dict[str, core.GraspSet]:
    """Sampled grasps by instance, as requested by options; prints shortfalls."""
    settings = evaluation.SamplingSettings(
        approach_angle_deg=arguments.approach_angle, blind=arguments.blind
    )
    count, seed = options.grasps_per_object(arguments), arguments.seed
    sampled = {}
    total = len(evaluation.chosen_instances(scene, arguments.only))
    with show_progress("sampling", "objects", total, quiet=arguments.quiet) as pace:
        for name, grasps in evaluation.sample_on_scene(
            scene, station, count, seed, settings, arguments.only
        ):
            sampled[name] = grasps
            pace.step(note=name)
    options.print_shortfalls(sampled, count)
    return sampled


def _reach_output(arguments: argparse.Namespace) -> Path | options.GraspOutput | None:
    """The output: the path of a table, a grasp file, or None; refuses an unwritable path before any
    work."""
    table_suffixes = (".csv", ".parquet")  # Tables have one row per grasp and no provenance.
    if arguments.output is None:
        return None
    path = Path(arguments.output)
    if arguments.target is None and path.suffix in table_suffixes and not path.is_dir():
        evaluation.require_table(path)
        return path
    return options.grasp_output(arguments.output, arguments.target, frame="object")


def _write_grasps(
    grasps: core.GraspSet, output: Path | options.GraspOutput, station: Station
) -> None:
    frame_text = "x, y, z: the grasp frame's origin in the frame of its object"
    from burg_drake.station import station_gripper

    if isinstance(output, options.GraspOutput):
        output.write(grasps, station_gripper(station))
        return
    provenance = core.with_shareable_references(grasps.provenance, output.absolute().parent)
    evaluation.write_table(output, evaluation.reach_columns(grasps), provenance)
    print(f"wrote {len(grasps)} grasps to {output}; {frame_text}")
