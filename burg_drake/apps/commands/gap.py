"""`burg-drake gap`: where grasps are lost between a hand alone and a robot in a real scene."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from functools import partial
from pathlib import Path

from burg_drake import core, evaluation, experiment
from burg_drake.apps import options
from burg_drake.apps.terminal import print_remark


def add_gap_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake gap`."""
    from burg_drake.station import DEFAULT_ENGINE

    parser.epilog = options.examples_text(
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
        help=f"folder of a run, scene file, or built-in scene: {options.scene_names()}",
    )
    options.add_output(parser, "GAP", "folder to write")
    options.add_station(
        parser, f"with a scene: station (default: {options.DEFAULT_STATION})", default=None
    )
    parser.add_argument(
        "--mode",
        choices=core.MODES,
        help="last step before objects are displaced (default: arm, or hand without an arm)",
    )
    _add_placement_noise_options(parser)
    source_group = parser.add_mutually_exclusive_group()
    options.add_sampling_options(parser, 20, source_group)
    options.add_grasp_file_options(parser, source_group)
    options.add_settings_options(
        parser, evaluation.EvaluationSettings, "engine", unset=True, shown_default=DEFAULT_ENGINE
    )
    workers_group = parser.add_mutually_exclusive_group()
    options.add_workers(workers_group)
    options.add_cluster(workers_group)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options.add_motion_options(parser)
    options.add_quiet(parser)


def _add_placement_noise_options(parser: options.Parser) -> None:
    group = parser.add_argument_group("displaced objects")
    options.add_settings_options(group, experiment.PlacementNoise)
    options.add_settings_options(group, experiment.GapSettings, "samples")
    group.add_argument(
        "--trials", metavar="FILE", help="trials file, to compare each step with the robot"
    )


def run_gap(arguments: argparse.Namespace) -> int:
    """Judges grasps step by step and reports; returns 1 if some could not be simulated."""
    sheet = None if arguments.trials is None else experiment.load_trials(arguments.trials)
    is_run = (Path(arguments.source) / evaluation.RUN_FILE).is_file()
    if evaluation.is_campaign(arguments.source):
        raise core.InvalidInputError(
            f"{arguments.source} is a run over many scenes; give the run of one of them, such as"
            f" {evaluation.load_runs(arguments.source)[0].path}"
        )
    run = evaluation.load_run(arguments.source) if is_run else None
    if sheet is not None and run is not None:
        # refuses unsuitable grasps before any work
        experiment.trials_of_run(sheet, arguments.trials, run)
    with options.cluster_from_options(arguments) as cluster:
        measured = _measure_gap(arguments, run, sheet, cluster)
    success = "lifted" if sheet is None else sheet.selection.success
    tried = (
        [] if sheet is None else experiment.trials_of_run(sheet, arguments.trials, measured.first)
    )
    agreement = (
        experiment.agreement_by_step(measured, sheet, tried, success) if sheet and tried else ()
    )
    changes = experiment.gap_changes(measured, success)
    experiment.write_gap_report(measured, success, agreement, arguments.command_line)
    text = json.dumps(experiment.gap_json(measured, changes, agreement, success), indent=1) + "\n"
    core.atomic_write(measured.path / "gap.json", text)
    if arguments.json:
        sys.stdout.write(text)
    else:
        for sentence in experiment.step_sentences(measured, changes, success):
            print(sentence)
        print()
        experiment.steps_view(measured, changes).show()
        if agreement:
            experiment.reality_table(agreement).text_table().show()
        elif sheet is not None:
            print(f"{arguments.trials} has no trials of these grasps in this scene")
        print(f"report  {measured.path / experiment.GAP_REPORT_FILE}")
    return _report_failed_trials(measured)


def _measure_gap(
    arguments: argparse.Namespace,
    run: evaluation.Run | None,
    sheet: experiment.TrialSheet | None,
    cluster: evaluation.Executor | None,
) -> experiment.GapSteps:
    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    noise = options.settings_from(arguments, experiment.PlacementNoise, seed=arguments.seed)
    tried = () if sheet is None else tuple(dict.fromkeys(t.grasp for t in sheet.trials))
    measure_gap = partial(
        experiment.measure_gap,
        out=arguments.output,
        settings=options.settings_from(
            arguments, experiment.GapSettings, last=arguments.mode, noise=noise
        ),
        tried=tried,
        executor=cluster or evaluation.LocalExecutor(arguments.workers or core.default_workers()),
        progress=not arguments.quiet,
    )
    options.require_grasp_file(arguments)
    if run is not None:
        _refuse_scene_options(arguments, run)
        return measure_gap(run)
    options.refuse_sampling_options_with_file(arguments)
    scene = load_scene(arguments.source)
    station = load_station(arguments.station or options.DEFAULT_STATION)
    given = None
    if arguments.grasps is not None:
        given = options.read_grasps_from_options(arguments, scene, station)
        for note in given.notes:
            print(f"note: {note}", file=sys.stderr)
    return measure_gap(
        scene,
        station=station,
        grasps=given.by_instance if given else None,
        evaluation=options.settings_from(
            arguments,
            evaluation.EvaluationSettings,
            grasps_per_object=options.grasps_per_object(arguments),
            only=arguments.only,
            motion=options.motion_from_options(arguments, station),
            mode=None,  # each step has its own
        ),
    )


def _refuse_scene_options(arguments: argparse.Namespace, run: evaluation.Run) -> None:
    """Refuses options whose values come from the run.

    Raises:
        InvalidInputError: such an option is given; the message names it.
    """
    sampling_options = ("grasps_per_object", "blind", "only", "approach_angle")
    names = ("station", *sampling_options, "engine", "grasps")
    given = [arguments.flags[n] for n in names if getattr(arguments, n) not in (None, False)]
    given += map(options.motion_option, options.motion_fields_from_options(arguments))
    if given:
        raise core.InvalidInputError(
            f"{given[0]} is for scenes; {run.path} is a run, which has its own grasps, station,"
            " engine and motion: leave it out"
        )


def _report_failed_trials(measured: experiment.GapSteps) -> int:
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
