"""`burg-drake gap`: where grasps are lost between a hand alone and a robot in a real scene."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.arguments import (
    DEFAULT_STATION,
    Parser,
    add_cluster,
    add_output,
    add_quiet,
    add_station,
    add_workers,
    cluster_from_options,
    examples_text,
    scene_names,
)
from burg_drake.apps.options.evaluated_grasps import (
    add_grasp_file_options,
    add_motion_options,
    add_sampling_options,
    grasps_per_object,
    motion_fields_from_options,
    motion_from_options,
    motion_option,
    read_grasps_from_options,
    refuse_sampling_options_with_file,
    require_grasp_file,
)
from burg_drake.apps.options.settings_options import add_settings_options, settings_from
from burg_drake.apps.terminal import print_remark
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation import Executor, Run
    from burg_drake.experiment import GapSteps, TrialSheet


def add_gap_options(parser: Parser) -> None:
    """Adds the options of `burg-drake gap`."""
    from burg_drake.core import MODES
    from burg_drake.evaluation import EvaluationSettings
    from burg_drake.station import DEFAULT_ENGINE

    parser.epilog = examples_text(
        "burg-drake gap tabletop_six -o gap",
        "burg-drake gap runs/first -o gap",
        "burg-drake gap tabletop_six -n 50 --placement-sd-mm 5 --samples 10 -o gap",
        "burg-drake gap runs/first --trials trials.yaml -o gap",
        "burg-drake gap tabletop_six --mode reach --samples 0 -o gap",
        "",
        "Evaluates the same grasps with the hand alone, with the arm's reach, with the whole"
        " arm, and with displaced objects, and counts what each step loses. The same command"
        " continues where an interrupted one stopped.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
    parser.add_argument(
        "source",
        metavar="SCENE|RUN",
        help=f"folder of a run, scene file, or built-in scene: {scene_names()}",
    )
    add_output(parser, "GAP", "folder to write")
    add_station(parser, f"with a scene: station (default: {DEFAULT_STATION})", default=None)
    parser.add_argument(
        "--mode",
        choices=MODES,
        help="last step before objects are displaced (default: arm, or hand without an arm)",
    )
    _add_placement_noise_options(parser)
    which = parser.add_mutually_exclusive_group()
    add_sampling_options(parser, 20, which)
    add_grasp_file_options(parser, which)
    add_settings_options(
        parser, EvaluationSettings, "engine", unset=True, shown_default=DEFAULT_ENGINE
    )
    who = parser.add_mutually_exclusive_group()
    add_workers(who)
    add_cluster(who)
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_motion_options(parser)
    add_quiet(parser)


def _add_placement_noise_options(parser: Parser) -> None:
    from burg_drake.experiment import GapSettings, PlacementNoise

    group = parser.add_argument_group("displaced objects")
    add_settings_options(group, PlacementNoise)
    add_settings_options(group, GapSettings, "samples")
    group.add_argument(
        "--trials", metavar="FILE", help="trials file, to compare each step with the robot"
    )


def run_gap(arguments: argparse.Namespace) -> int:
    """Judges step by step and reports; 1 if some grasps could not be simulated."""
    from burg_drake.core import atomic_write
    from burg_drake.evaluation import RUN_FILE, is_campaign, load_run, load_runs
    from burg_drake.experiment import (
        GAP_REPORT_FILE,
        agreement_by_step,
        gap_changes,
        gap_json,
        load_trials,
        reality_view,
        step_sentences,
        steps_view,
        tried_grasps,
        write_gap_report,
    )

    sheet = None if arguments.trials is None else load_trials(arguments.trials)
    of_run = (Path(arguments.source) / RUN_FILE).is_file()
    if is_campaign(arguments.source):
        raise InvalidInputError(
            f"{arguments.source} is a run over many scenes; give the run of one of them, such as"
            f" {load_runs(arguments.source)[0].path}"
        )
    run = load_run(arguments.source) if of_run else None
    if sheet is not None and run is not None:
        tried_grasps(sheet, arguments.trials, run)  # refuses other grasps before any work
    with cluster_from_options(arguments) as cluster:
        measured = _measure_gap(arguments, run, sheet, cluster)
    success = "lifted" if sheet is None else sheet.selection.success
    tried = [] if sheet is None else tried_grasps(sheet, arguments.trials, measured.first)
    agreement = agreement_by_step(measured, sheet, tried, success) if sheet and tried else ()
    found = gap_changes(measured, success)
    line = shlex.join(["burg-drake", *sys.argv[1:]])
    write_gap_report(measured, success, agreement, line)
    text = json.dumps(gap_json(measured, found, agreement, success), indent=1) + "\n"
    atomic_write(measured.path / "gap.json", text)
    if arguments.json:
        sys.stdout.write(text)
    else:
        for sentence in step_sentences(measured, found, success):
            print(sentence)
        print()
        steps_view(measured, found).show()
        if agreement:
            reality_view(agreement).show()
        elif sheet is not None:
            print(f"{arguments.trials} has no trials of these grasps in this scene")
        print(f"report  {measured.path / GAP_REPORT_FILE}")
    return _report_failed_trials(measured)


def _measure_gap(
    arguments: argparse.Namespace,
    run: Run | None,
    sheet: TrialSheet | None,
    cluster: Executor | None,
) -> GapSteps:
    from burg_drake.core import default_workers
    from burg_drake.evaluation import EvaluationSettings, LocalExecutor
    from burg_drake.experiment import GapSettings, PlacementNoise, measure_gap
    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    noise = settings_from(arguments, PlacementNoise, seed=arguments.seed)
    tried = () if sheet is None else tuple(dict.fromkeys(t.grasp for t in sheet.trials))
    options: dict[str, Any] = {
        "settings": settings_from(arguments, GapSettings, last=arguments.mode, noise=noise),
        "tried": tried,
        "executor": cluster or LocalExecutor(arguments.workers or default_workers()),
        "progress": not arguments.quiet,
    }
    require_grasp_file(arguments)
    if run is not None:
        _refuse_scene_options(arguments, run)
        return measure_gap(run, arguments.output, **options)
    refuse_sampling_options_with_file(arguments)
    scene = load_scene(arguments.source)
    station = load_station(arguments.station or DEFAULT_STATION)
    given = (
        None if arguments.grasps is None else read_grasps_from_options(arguments, scene, station)
    )
    for note in given.notes if given else ():
        print(f"note: {note}", file=sys.stderr)
    return measure_gap(
        scene,
        arguments.output,
        station=station,
        grasps=given.by_instance if given else None,
        evaluation=settings_from(
            arguments,
            EvaluationSettings,
            grasps_per_object=grasps_per_object(arguments),
            only=arguments.only,
            motion=motion_from_options(arguments, station),
            mode=None,  # that of a step
        ),
        **options,
    )


def _refuse_scene_options(arguments: argparse.Namespace, run: Run) -> None:
    """Refuses options that the run answers itself.

    Raises:
        InvalidInputError: names the option.
    """
    # A run has its own values of these.
    scene_options = (
        "station",
        "grasps_per_object",
        "blind",
        "only",
        "approach_angle",
        "engine",
        "grasps",
    )
    given = [n for n in scene_options if getattr(arguments, n) not in (None, False)]
    options = [f"--{name.replace('_', '-')}" for name in given]
    for option in (*options, *map(motion_option, motion_fields_from_options(arguments))):
        raise InvalidInputError(
            f"{option} is for scenes; {run.path} is a run, which has its own grasps, station,"
            " engine and motion: leave it out"
        )


def _report_failed_trials(measured: GapSteps) -> int:
    runs = [run for step in measured.steps for run in step.runs] + list(measured.tried)
    failed = [(run, id) for run in runs for id in run.failures]
    if not failed:
        return 0
    run, id = failed[0]
    again = shlex.join(["burg-drake", "replay", str(run.path), "--grasp", id])
    print_remark(
        f"{len(failed)} trials could not be simulated, such as {id} in {run.path}"
        f" ({again} tries it again)"
    )
    return 1
