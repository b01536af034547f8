"""`burg-drake evaluate`: grasps of one scene or of many, simulated and judged."""

from __future__ import annotations

import argparse
import shlex
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core, evaluation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines, print_remark, print_warning

if TYPE_CHECKING:
    from burg_drake.scene import Scene
    from burg_drake.station import Engine, GraspMotion, Station


SECOND_OPINION_COLUMNS = ("judged_again", "outcome_before", "outcome", "confidence")
"""Columns that `second_opinion_line` reads."""


def add_rejudge_contested(parser: options.Parser) -> None:
    """Adds --rejudge."""
    parser.add_argument(
        "--rejudge",
        choices=("contested",),
        help="afterwards, evaluate contested grasps again with the preset of --engine",
    )


def first_engine(arguments: argparse.Namespace, folder: str, mode: core.Mode) -> Engine | str:
    """The engine that judges all grasps; with --rejudge that of the run in the folder, or the
    standard one for a new run.

    Raises:
        InvalidInputError: a shard is requested; see `require_second_engine` for this and other
            errors.
    """
    from burg_drake.station import DEFAULT_ENGINE, ENGINES

    chosen: str = arguments.engine
    if arguments.rejudge is None:
        return chosen
    refuse_rejudging_shaken(arguments)
    exists = evaluation.is_campaign(folder) or (Path(folder) / evaluation.RUN_FILE).exists()
    engine = evaluation.open_results(folder).document.engine if exists else ENGINES[DEFAULT_ENGINE]
    if arguments.shard is not None:
        raise core.InvalidInputError(
            "--rejudge settles a whole run; merge the shards first (burg-drake merge), or leave"
            " --shard out"
        )
    evaluation.require_second_engine(chosen, engine, mode)
    return engine


def refuse_rejudging_shaken(arguments: argparse.Namespace) -> None:
    """Refuses --rejudge for objects that are shaken.

    Raises:
        InvalidInputError: it is given with --protocol shake.
    """
    if arguments.rejudge is not None and arguments.protocol == "shake":
        raise core.InvalidInputError(
            "--rejudge contested has no effect with --protocol shake: the verdicts of shaken"
            " objects have no confidence, so that none is contested; leave it out"
        )


def settling_options(run: evaluation.Run) -> str:
    """The options with which the command of a run settles its contested verdicts."""
    finer = "mujoco" if run.document.engine.name == "reference" else "reference"
    return f"--rejudge contested --engine {finer}"


def second_opinion_line(columns: evaluation.Columns) -> str:
    """Text on how many verdicts another engine has decided, and how many of them changed.

    Args:
        columns: `SECOND_OPINION_COLUMNS` of a run.
    """
    import numpy as np

    engine, before, outcome, confidence = (columns[name] for name in SECOND_OPINION_COLUMNS)
    rejudged = np.flatnonzero(engine != "")
    if not len(rejudged):
        known = np.isfinite(confidence).any()
        return "no verdict is contested" if known else "no verdict has a confidence to go by"
    engines = ", ".join(sorted(set(engine[rejudged].tolist())))
    changed = Counter(
        f"{was} to {now}"
        for was, now in zip(before[rejudged].tolist(), outcome[rejudged].tolist(), strict=True)
        if was != now
    )
    settled = core.count_with_noun(len(rejudged), "contested grasp")
    text = f"settled {settled} by {engines}; changed {changed.total()}"
    details = ", ".join(f"{n} from {what}" for what, n in changed.most_common())
    text += f" ({details})" if details else ""
    still_contested = int((confidence[rejudged] < core.CONTESTED_CONFIDENCE).sum())
    return f"{text}; close for it, too: {still_contested}" if still_contested else text


def print_campaign(campaign: evaluation.Campaign) -> None:
    """Prints the tables of a run over many scenes, and the paths of its files."""
    from rich.console import Console

    summary = evaluation.summarize(campaign)
    Console().print(evaluation.summary_view(summary), crop=False)
    _scene_table(summary).show()
    if campaign.document.shard:
        print(f"shard   {campaign.document.shard}; merge all of them with burg-drake merge")
    scenes = f"{campaign.path}/scenes/NAME"
    if any(
        campaign.folder(name).joinpath(evaluation.REPORT_FILE).exists() for name in campaign.names
    ):
        print(f"runs    {scenes}, each with a table and a report")
    else:
        print(f"runs    {scenes}, each with a table; burg-drake report {scenes} makes a report")
    print(f"tables  {campaign.path / evaluation.PARTS_FOLDER} (Parquet, all scenes)")
    if campaign.report_path.exists():
        print(f"report  {campaign.report_path}")


def report_campaign_failures(campaign: evaluation.Campaign) -> int:
    """Prints which scenes and grasps could not be judged; returns the exit code."""
    states = campaign.states.values()
    failed, interrupted = sum(s.failed for s in states), sum(s.interrupted for s in states)
    for name, why in campaign.failed.items():
        print_remark(f"scene {name} could not be judged: {why}")
    if failed:
        where = core.list_names([s.scene for s in states if s.failed])
        print_remark(
            f"{failed} grasps could not be simulated (scenes {where});"
            f" {options.retry_advice(interrupted, failed)}"
        )
    return 1 if failed or campaign.failed else 0


def _scene_table(summary: evaluation.Summary) -> Any:
    """Table of the scenes with the smallest share of lifted among executed grasps."""
    max_rows = 20  # Maximum number of scenes in the table.

    def share(group: Any) -> float:
        return group.lifted / group.executed if group.executed else -1.0

    groups = sorted(summary.scenes, key=share)[:max_rows]
    more = len(summary.scenes) - len(groups)
    title = f"Scenes, the {max_rows} with the least success" if more else "Scenes"
    table = core.TextTable(title).names("scene")
    table.numbers(*summary.steps, "success")
    for group in groups:
        success = core.format_percent(share(group)) if group.executed else "-"
        table.row(
            group.name, *(core.format_count(group.funnel[name]) for name in summary.steps), success
        )
    if more:
        table.caption = f"{more:,} more scenes are in the columns of the store"
    return table


def _grasps_from_file(
    arguments: argparse.Namespace, station: Station
) -> evaluation.GraspsLike | None:
    """The grasps of the file: one set for all scenes if they are in object frames."""
    from burg_drake.apps.options.grasp_files import POSE_FRAMES, gripper_from_options
    from burg_drake.formats import read_poses, with_objects_renamed

    if arguments.grasps is None:
        return None
    imported = evaluation.read_input(
        arguments.grasps,
        arguments.grasps_format,
        gripper_from_options(arguments, station),
        arguments.correction,
    )
    print_note_lines(imported.notes)
    frame = POSE_FRAMES.get(arguments.grasps_frame) or imported.frame
    if frame != "object":
        poses = arguments.camera_pose
        placing = [read_poses(poses) if poses else None, sorted(arguments.object_ids.items())]
        content = core.content_hash(Path(arguments.grasps), arguments.correction, frame, *placing)
        return _SceneGraspFile(arguments, station, content, arguments.correction)
    return with_objects_renamed(imported.grasps, dict(arguments.grasps_object))


@dataclass(frozen=True)
class _SceneGraspFile:
    """Grasps of a file in the frame of a scene or camera, selected for each scene by the column
    `scene_id`.

    Attributes:
        arguments: parsed arguments of the command.
        station: station with the hand.
        content: hash of the grasps and of the poses that place them.
        correction: applied when reading.
    """

    arguments: argparse.Namespace
    station: Station
    content: str
    correction: tuple[str, ...]

    def __call__(self, scene: Scene) -> Mapping[str, core.GraspSet]:
        chosen = argparse.Namespace(**{**vars(self.arguments), "run": None})
        chosen.scene_id = scene.name
        try:
            return options.read_grasps_from_options(chosen, scene, self.station).by_instance
        except core.UnknownNameError:
            return {}
        except evaluation.NoSceneIdsError as error:
            raise core.InvalidInputError(
                f"{self.arguments.grasps} has grasps in the frame of a scene or camera, without"
                " saying which; evaluate that scene alone"
            ) from error


RUNS_FOLDER = "runs"  # Default parent folder of runs.


def add_evaluate_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake evaluate`."""
    parser.epilog = options.examples_text(
        "burg-drake evaluate tabletop_six --grasps-per-object 100 -o runs/first",
        "burg-drake evaluate my_scene.yaml --station my_station.yaml -o runs/mine",
        "burg-drake evaluate tabletop_six --only mug,bowl -n 500 -o runs/two",
        "burg-drake evaluate tabletop_six --until-balanced 10 -o runs/lab",
        "burg-drake evaluate tabletop_six -n 20 --mode arm -o runs/arm",
        "burg-drake evaluate my_scene.yaml --grasps Mug_3f2a_0.01.h5 --grasps-object mug",
        "burg-drake evaluate tabletop_six -n 100000 --mode hand --engine mujoco-gpu -o runs/many",
        "burg-drake evaluate tabletop_six -n 1000 --cluster tls://head.example.org:8786",
        "burg-drake evaluate my_scene.yaml --grasps network.npy --camera-pose camera.yaml",
        "burg-drake evaluate scenes/ -n 100 --shard 2/8 -o runs/shard2",
        "burg-drake evaluate tabletop_six -o runs/first --rejudge contested --engine reference",
        "",
        "The same command continues where an interrupted one stopped.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
    parser.add_argument(
        "scenes",
        metavar="SCENE",
        nargs="+",
        help=f"scene file, folder of scenes, or built-in: {options.scene_names()}",
    )
    options.add_station(parser)
    options.add_output(
        parser,
        "RUN",
        f"folder of the run (default: {RUNS_FOLDER}/SCENE; required for several scenes)",
        required=False,
    )
    source_group = parser.add_mutually_exclusive_group()
    options.add_sampling_options(parser, 100, source_group)
    options.add_grasp_file_options(parser, source_group)
    options.add_settings_options(
        parser,
        evaluation.EvaluationSettings,
        *("until_balanced", "balanced_among", "max_grasps_per_object"),
    )
    options.add_settings_options(parser, evaluation.EvaluationSettings, "engine", "device")
    add_rejudge_contested(parser)
    workers_group = parser.add_mutually_exclusive_group()
    options.add_workers(workers_group)
    options.add_cluster(workers_group)
    options.add_settings_options(parser, evaluation.EvaluationSettings, "table", "mode", "shard")
    options.add_settings_options(
        parser, evaluation.EvaluationSettings, "tilt_limit_deg", "slip_limit_mm", unset=True
    )
    options.add_settings_options(parser, evaluation.EvaluationSettings, "approach", "protocol")
    options.add_motion_options(parser)
    options.add_retry_failed(parser, "grasps")
    parser.add_argument(
        "--scene-reports",
        action=argparse.BooleanOptionalAction,
        help="also write a report for each of several scenes (default: for up to 100)",
    )
    options.add_quiet(parser)


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Evaluates grasps; returns 1 if scenes or grasps could not be judged."""
    from burg_drake.scene import load_scene, scene_references
    from burg_drake.station import load_station

    options.require_grasp_file(arguments)
    options.refuse_sampling_options_with_file(arguments)
    references = scene_references(arguments.scenes)
    several = len(references) > 1 or Path(arguments.scenes[0]).is_dir()
    if several and arguments.output is None:
        raise core.InvalidInputError(
            f"{len(references)} scenes are given; name a folder for the run with -o RUN"
        )
    scene = None if several else load_scene(references[0])
    if scene is not None:
        _require_one_to_shake(arguments, scene)
    station = load_station(arguments.station)
    mode = evaluation.mode_for(station, arguments.mode)
    options.refuse_standoff_without_arm(arguments, mode)
    motion = options.motion_from_options(arguments, station)
    if scene is None:
        folder, grasps = arguments.output, _grasps_from_file(arguments, station)
    else:
        folder = arguments.output or f"{RUNS_FOLDER}/{scene.name}"
        grasps = _grasps_of_scene(arguments, scene, station, mode)
    settings = options.settings_from(
        arguments,
        evaluation.EvaluationSettings,
        grasps_per_object=options.grasps_per_object(arguments),
        only=arguments.only,
        mode=mode,
        motion=motion,
        scene_reports=arguments.scene_reports,
        engine=first_engine(arguments, folder, mode),
    )
    found = _evaluate(arguments, scene or list(references), station, folder, settings, grasps)
    rejudged = arguments.rejudge is not None
    if isinstance(found, evaluation.Run):
        _print_run(found, motion, rejudged=rejudged)
        return 1 if found.failures else 0
    print_campaign(found)
    if rejudged:
        print(second_opinion_line(found.columns(SECOND_OPINION_COLUMNS)))
    _print_motion(motion)
    return report_campaign_failures(found)


def _require_one_to_shake(arguments: argparse.Namespace, scene: Scene) -> None:
    """Refuses to shake several objects, and names the command for them.

    Raises:
        InvalidInputError: there are several, and --protocol is shake.
    """
    count = len(scene.instances) + len(scene.background)
    if arguments.protocol == "shake" and count > 1:
        raise core.InvalidInputError(
            f"scene {scene.name!r} has {count} objects, but with --protocol shake the hand holds"
            " one that is alone; `burg-drake grasps label LIBRARY --protocol shake` shakes the"
            " objects of a library, each by itself"
        )


def _grasps_of_scene(
    arguments: argparse.Namespace, scene: Scene, station: Station, mode: core.Mode
) -> Mapping[str, core.GraspSet] | None:
    """The grasps of the file on the instances of one scene; prints the issues of the scene."""
    from burg_drake.motion import require_usable_arm
    from burg_drake.station import require_valid_scene

    given = None
    if arguments.grasps is not None:
        given = options.read_grasps_from_options(arguments, scene, station)
        print_note_lines(given.notes)
    warnings = require_valid_scene(scene, station)
    if mode != "hand":
        warnings += require_usable_arm(scene, station)
    if arguments.protocol == "shake":
        warnings = ()  # they are about objects that do not stand, but nothing falls
    for warning in warnings:
        print_warning(warning)
    return given.by_instance if given else None


def _evaluate(
    arguments: argparse.Namespace,
    scenes: Scene | list[str],
    station: Station,
    folder: str,
    settings: evaluation.EvaluationSettings,
    grasps: evaluation.GraspsLike | None,
) -> evaluation.Run | evaluation.Campaign:
    """Evaluates on this machine or a cluster; judges contested grasps again with --rejudge."""
    with options.cluster_from_options(arguments) as executor:
        found = evaluation.evaluate(
            scenes,
            station,
            folder,
            settings=settings,
            grasps=grasps,
            executor=executor,
            workers=arguments.workers,
            retry_failed=arguments.retry_failed,
            progress=not arguments.quiet,
        )
        if arguments.rejudge is None:
            return found
        return evaluation.judge_again(
            found,
            engine=arguments.engine,
            executor=executor,
            workers=arguments.workers,
            progress=not arguments.quiet,
        )


def _print_run(run: evaluation.Run, motion: GraspMotion, *, rejudged: bool) -> None:
    """Prints the tables of a run, the paths of its files, and failures."""
    print_summary(run)
    if remedy := evaluation.remedy_of_run(run):
        print_note_lines([options.describe_motion_remedy(remedy)])
    if run.document.shard:
        print(f"shard   {run.document.shard}; merge all of them with burg-drake merge")
    _print_motion(motion)
    if rejudged or run.index.judged_again.any():
        print(second_opinion_line(run.columns(SECOND_OPINION_COLUMNS)))
    if contested := run.contested:
        print(
            f"contested: {core.list_names(contested)}; judge them again by the same command with"
            f" {settling_options(run)}"
        )
    print(f"table   {run.table_path}")
    print(f"report  {run.report_path}")
    if best := run.best(each=True):
        print("best    " + "\n        ".join(best))
        replay = shlex.join(["burg-drake", "replay", str(run.path), "--grasp"])
        show = shlex.join(["burg-drake", "grasps", "show", str(run.path), "--outcome", "lifted"])
        print(
            "best: of each object the lifted grasp with the most room around the open hand; see"
            f" one by\n    {replay} ID\nthe table has all lifted grasps; see them by\n"
            f"    {show} --all"
        )
    if run.failures:
        print_remark(
            f"{len(run.failures)} of {len(run.candidates)} grasps could not be"
            f" simulated, such as {run.failures[0]}; reasons are in {run.table_path};"
            f" {options.retry_advice(len(run.interrupted), len(run.failures))}"
        )


def _print_motion(motion: GraspMotion) -> None:
    """Prints the motion of the hand, unless it is the default."""
    from burg_drake.station import GraspMotion

    if motion != GraspMotion():
        print(f"motion  {evaluation.motion_text(motion)}")


def print_summary(run: evaluation.Run) -> None:
    """Prints the tables of a run."""
    from rich.console import Console

    Console().print(evaluation.summary_view(evaluation.summarize(run)), crop=False)
