"""`burg-drake evaluate`: the main job, from a scene to judged grasps."""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_cluster,
    add_given,
    add_motion,
    add_options,
    add_quiet,
    add_retry_failed,
    add_sampling,
    add_station,
    add_verb,
    add_workers,
    chosen_cluster,
    chosen_motion,
    how_to_retry,
    read_given,
    require_file,
    require_sampled,
    require_standoff_of_arm,
    scene_names,
)
from burg_drake.apps.runs.campaign import evaluate_many
from burg_drake.apps.runs.second_opinion import (
    SETTLED_COLUMNS,
    add_rejudge_contested,
    first_engine,
    settle,
    settled_line,
)
from burg_drake.apps.runs.settings import requested_settings
from burg_drake.core import listing

if TYPE_CHECKING:
    from burg_drake.evaluation.store import Run
    from burg_drake.station.document import GraspMotion

DEFAULT_OUTPUT = "runs"
DEFAULT_GRASPS = 100
"""Sampled for each object, unless grasps are given."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "evaluate",
        run_evaluate,
        "evaluate grasps: clear hand, reach of the arm, lift",
        "burg-drake evaluate tabletop_six --grasps-per-object 100 -o runs/first",
        "burg-drake evaluate my_scene.yaml --station my_station.yaml -o runs/mine",
        "burg-drake evaluate tabletop_six --only mug,bowl -n 500 -o runs/two",
        "burg-drake evaluate tabletop_six --until-balanced 10 -o runs/lab",
        "burg-drake evaluate tabletop_six -n 20 --mode arm -o runs/arm",
        "burg-drake evaluate my_scene.yaml --grasps Mug_3f2a_0.01.h5 --grasps-object mug",
        "burg-drake evaluate tabletop_six -n 1000 --cluster tls://head.example.org:8786",
        "burg-drake evaluate my_scene.yaml --grasps network.npy --camera-pose camera.yaml",
        "burg-drake evaluate scenes/ -n 100 --shard 2/8 -o runs/shard2",
        "burg-drake evaluate tabletop_six -o runs/first --rejudge contested --engine reference",
        "",
        "The same command continues where an interrupted one stopped.",
        options=add_options_to,
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")


def add_options_to(parser: Parser) -> None:
    """Adds what the verb takes."""
    from burg_drake.evaluation.records import EvaluationSettings

    parser.add_argument(
        "scenes",
        metavar="SCENE",
        nargs="+",
        help=f"scene file, folder of scenes, or built-in: {scene_names()}",
    )
    add_station(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="RUN",
        help=f"folder of the run (default: {DEFAULT_OUTPUT}/SCENE; required for several scenes)",
    )
    which = parser.add_mutually_exclusive_group()
    add_sampling(parser, DEFAULT_GRASPS, which)
    add_given(parser, which)
    add_options(
        parser,
        EvaluationSettings,
        *("until_balanced", "balanced_among", "max_grasps_per_object"),
    )
    add_options(parser, EvaluationSettings, "engine")
    add_rejudge_contested(parser)
    who = parser.add_mutually_exclusive_group()
    add_workers(who)
    add_cluster(who)
    add_options(parser, EvaluationSettings, "table", "mode", "shard")
    add_options(parser, EvaluationSettings, "tilt_limit_deg", "slip_limit_mm", "approach")
    add_motion(parser)
    add_retry_failed(parser, "grasps")
    parser.add_argument(
        "--scene-reports",
        action=argparse.BooleanOptionalAction,
        help="also write a report for each of several scenes (default: for up to 100)",
    )
    add_quiet(parser)


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Evaluates; 1 if some grasps could not be simulated."""
    from burg_drake.scene.document import scene_references

    require_file(arguments)
    require_sampled(arguments)
    references = scene_references(arguments.scenes)
    if len(references) > 1 or Path(arguments.scenes[0]).is_dir():
        with chosen_cluster(arguments) as executor:
            return evaluate_many(arguments, references, executor=executor)
    return _evaluate_one(arguments, references[0])


def _evaluate_one(arguments: argparse.Namespace, reference: str) -> int:
    """Evaluates one scene."""
    from burg_drake.evaluation import evaluate
    from burg_drake.evaluation.stages import mode_for
    from burg_drake.motion.workspace import require_usable_arm
    from burg_drake.scene.document import load_scene
    from burg_drake.station.checks import require_valid_scene
    from burg_drake.station.document import load_station

    scene = load_scene(reference)
    station = load_station(arguments.station)
    mode = mode_for(station, arguments.mode)
    require_standoff_of_arm(arguments, mode)
    motion = chosen_motion(arguments, station)
    given = None if arguments.grasps is None else read_given(arguments, scene, station)
    for note in given.notes if given else ():
        print(f"note: {note}")
    warnings = require_valid_scene(scene, station)
    if mode != "hand":
        warnings += require_usable_arm(scene, station)
    for warning in warnings:
        print(f"burg-drake: warning: {warning}", file=sys.stderr)
    folder = arguments.output or f"{DEFAULT_OUTPUT}/{scene.name}"
    settings = requested_settings(arguments, mode, motion)
    settings = replace(settings, engine=first_engine(arguments, folder, mode))
    with chosen_cluster(arguments) as executor:
        run = evaluate(
            scene,
            station,
            folder,
            settings=settings,
            grasps=given.by_instance if given else None,
            executor=executor,
            workers=arguments.workers,
            retry_failed=arguments.retry_failed,
            progress=not arguments.quiet,
        )
        run = settle(run, arguments, executor)
    _print_run(run, motion, rejudged=arguments.rejudge is not None)
    return 1 if run.failures else 0


def _print_run(run: Run, motion: GraspMotion, *, rejudged: bool) -> None:
    """The tables of a run, where its files are, and what has failed."""
    from burg_drake.evaluation.records import motion_text
    from burg_drake.station.document import GraspMotion

    print_summary(run)
    if run.document.shard:
        print(f"shard   {run.document.shard}; merge all of them with burg-drake merge")
    if motion != GraspMotion():
        print(f"motion  {motion_text(motion)}")
    if rejudged or any(verdict.judged_again for verdict in run.verdicts.values()):
        print(settled_line({name: run.results[name] for name in SETTLED_COLUMNS}))
    if contested := run.contested:
        finer = "mujoco" if run.document.engine.name == "reference" else "reference"
        print(
            f"contested: {listing(contested)}; judge them again by the same command with"
            f" --rejudge contested --engine {finer}"
        )
    print(f"table   {run.table_path}")
    print(f"report  {run.report_path}")
    if best := run.best(each=True):
        print("best    " + "\n        ".join(best))
        print(_where_lifted(str(run.path)))
    if run.failures:
        print(
            f"burg-drake: {len(run.failures)} of {len(run.candidates)} grasps could not be"
            f" simulated, such as {run.failures[0]}; reasons are in {run.table_path};"
            f" {how_to_retry(len(run.interrupted), len(run.failures))}",
            file=sys.stderr,
        )


def _where_lifted(folder: str) -> str:
    """How to look at the best grasps, and at all that lifted."""
    replay = shlex.join(["burg-drake", "replay", folder, "--grasp"])
    show = shlex.join(["burg-drake", "grasps", "show", folder, "--outcome", "lifted"])
    return (
        "best: of each object the lifted grasp with the most room around the open hand; see one by"
        f"\n    {replay} ID\nthe table has all lifted grasps; see them by\n    {show} --all"
    )


def print_summary(run: Run) -> None:
    """Prints the tables of a run."""
    from rich.console import Console

    from burg_drake.evaluation.results import summarize, summary_view

    Console().print(summary_view(summarize(run)), crop=False)
