"""`burg-drake replay`: simulates one trial again, compares it with the record, and shows it."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core, evaluation, simulation, visualization
from burg_drake.apps import options
from burg_drake.apps.terminal import print_remark

if TYPE_CHECKING:
    from burg_drake.motion import Plan


@dataclass(frozen=True)
class ReplaySource:
    """The recorded trial to replay, with its origin and inputs."""

    trial: evaluation.RecordedTrial
    origin: evaluation.TrialOrigin
    inputs: evaluation.TrialInputs


def add_replay_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake replay`."""
    parser.epilog = options.examples_text(
        "burg-drake replay runs/first --best",
        "burg-drake replay runs/first --grasp mug-0123456789 --html replay.html",
        "burg-drake replay results.csv --row 17",
        "burg-drake replay one_row.csv --scene runs/first/scene.yaml",
        "",
        "One row with its header is enough. The new result is compared with the recorded one.",
    )
    parser.add_argument(
        "results", metavar="RESULTS", help="folder of a run, or table of results (.csv, .parquet)"
    )
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument("--grasp", metavar="ID", help="id of the grasp")
    choice.add_argument(
        "--row", metavar="N", type=options.positive_int, help="row of the table, from 1"
    )
    choice.add_argument(
        "--best",
        action="store_true",
        help="the lifted grasp with the most room around the open hand",
    )
    options.add_only(parser, "with --best, the best grasp")
    parser.add_argument("--scene", metavar="FILE", help="scene file, if it has moved")
    parser.add_argument("--station", metavar="FILE", help="station file, if it has moved")
    parser.add_argument(
        "--force", action="store_true", help="replay even if scene or station have changed"
    )
    options.add_view_options(parser)


def run_replay(arguments: argparse.Namespace) -> int:
    """Simulates a trial again and shows it; returns 1 if the verdict differs from the record."""
    from burg_drake.apps.terminal import open_view, present_view

    if arguments.only and not arguments.best:
        raise core.InvalidInputError("--only is for --best; add it")
    path = Path(arguments.results)
    is_table = path.suffix in (".csv", ".parquet") and not path.is_dir()
    if path.is_file() and not is_table:
        raise core.InvalidInputError(
            f"{path} is neither the folder of a run nor a table of results (.csv, .parquet)"
        )
    source = _source_from_table(path, arguments) if is_table else _source_from_run(path, arguments)
    for note in source.inputs.notes:
        print_remark(note)
    meshcat = open_view(arguments)
    verdict, shown, shown_part = _simulate_trial(source, meshcat)
    lines = [
        *visualization.describe_trial(evaluation.as_result(verdict)),
        *evaluation.arm_figures(verdict),
    ]
    lines += evaluation.motion_figures(source.trial, source.origin)
    recorded = source.trial.verdict
    differences = [] if recorded is None else evaluation.differences(recorded, verdict)
    lines += [] if recorded is None else evaluation.comparison(differences, source.origin)
    if shown.outcome is not verdict.outcome:
        lines += [f"shown is {shown_part}, to the end:", *visualization.describe_trial(shown)]
    for line in lines:
        print(line)
    if arguments.html is None and shown.margins.end_time == 0.0:
        print("nothing moves: the trial ended before its first step", file=sys.stderr)
    title = f"{source.inputs.scene.name}: {source.trial.id}"
    present_view(meshcat, arguments, title=title, caption=lines)
    return 0 if all(difference.rounding for difference in differences) else 1


def _simulate_trial(
    source: ReplaySource, meshcat: Any
) -> tuple[core.Verdict, simulation.TrialResult, str]:
    """The verdict of the row's engine, the whole trial to show, and a text on what is shown.

    With an engine that ends trials early, the trial is simulated twice: as recorded, and to the end
    for the view. So is a trial of the arm, which is shown from its home posture on.
    """
    trial, origin = source.trial, source.origin
    if evaluation.decisive_mode(trial, origin) == "hand" and origin.engine.whole_trial:
        shown = _show_hand(source, meshcat)
        return evaluation.trial_verdict(shown), shown, "the hand alone"
    verdict, plan = evaluation.rerun(source.inputs.scene, source.inputs.station, trial, origin)
    if plan is not None:
        return verdict, _show_arm(source, plan, meshcat), "the arm from home on"
    return verdict, _show_hand(source, meshcat), "the hand alone"


def _show_hand(source: ReplaySource, meshcat: Any) -> simulation.TrialResult:
    """The whole trial of the hand alone, recorded."""
    trial = source.trial
    return visualization.record_trial(
        simulation.hand_trial_of(
            source.inputs.scene, source.inputs.station, **_shared_trial_options(source, meshcat)
        ),
        trial.instance,
        trial.X_OG,
        meshcat,
        friction=trial.friction,
        mass=trial.mass,
        lift=trial.lift,
    )


def _show_arm(source: ReplaySource, plan: Plan, meshcat: Any) -> simulation.TrialResult:
    """The whole trial of the arm from its home posture on, recorded."""
    trial, inputs = source.trial, source.inputs
    return visualization.record_arm_trial(
        simulation.ArmTrial(
            inputs.scene, inputs.station, transfer=True, **_shared_trial_options(source, meshcat)
        ),
        trial.instance,
        trial.X_OG,
        plan,
        meshcat,
        friction=trial.friction,
        mass=trial.mass,
    )


def _shared_trial_options(source: ReplaySource, meshcat: Any) -> dict[str, Any]:
    """Options of both kinds of trials: as recorded, but shown and to the end."""
    engine = replace(source.origin.engine, whole_trial=True)
    return {"engine": engine, "settings": source.origin.settings(), "meshcat": meshcat}


def _source_from_run(path: Path, arguments: argparse.Namespace) -> ReplaySource:
    run = evaluation.load_run(path)
    if arguments.grasp is not None:
        id = arguments.grasp
    else:
        id = str(run.results["id"][_choose_row(run.results, path, arguments)])
    trial = run.trial(id)
    judge = "" if trial.verdict is None else trial.verdict.judged_again
    origin = evaluation.origin_of(run.document).judged_by(judge)
    origin.settings(f"{path / evaluation.RUN_FILE}: trial")
    if arguments.scene is None and arguments.station is None and not arguments.force:
        return ReplaySource(trial, origin, evaluation.TrialInputs(run.scene(), run.station()))
    moved = {"scene": arguments.scene, "station": arguments.station, "force": arguments.force}
    return ReplaySource(
        trial, origin, evaluation.find_inputs(origin, f"{path}, {id},", path, **moved)
    )


def _source_from_table(path: Path, arguments: argparse.Namespace) -> ReplaySource:
    columns = evaluation.read_table(path)
    if "id" not in columns:
        raise core.InvalidInputError(f"{path} is not a results table (it has no column id)")
    index = _choose_row(columns, path, arguments)
    where, row = f"{path}, row {index + 1}", evaluation.table_row(columns, index)
    trial, origin = evaluation.read_trial(row, where), evaluation.read_origin(row, where)
    moved = {"scene": arguments.scene, "station": arguments.station, "force": arguments.force}
    return ReplaySource(trial, origin, evaluation.find_inputs(origin, where, path.parent, **moved))


def _choose_row(columns: evaluation.Columns, path: Path, arguments: argparse.Namespace) -> int:
    """Index of the requested row."""
    ids = columns["id"].tolist()
    if not ids:
        raise core.InvalidInputError(f"{path} has no rows")
    if arguments.row is not None:
        if arguments.row > len(ids):
            raise core.InvalidInputError(f"{path} has no row {arguments.row}; it has {len(ids)}")
        return int(arguments.row) - 1
    if arguments.grasp is not None:
        rows = evaluation.rows_of(columns, arguments.grasp, str(path))
        if len(rows) > 1:
            raise core.InvalidInputError(
                f"{path} has {len(rows)} rows of {arguments.grasp}, the first is row"
                f" {rows[0] + 1}; choose one with --row"
            )
        return rows[0]
    if arguments.best:
        best = evaluation.best_rows(columns, only=arguments.only)
        if not best:
            raise core.InvalidInputError(
                f"{path}: no grasp was lifted; choose one with --grasp ID or --row N"
            )
        return best[0]
    if len(ids) != 1:
        raise core.InvalidInputError(
            f"{path} has {len(ids)} rows; give --grasp ID, --row N or --best"
        )
    return 0
