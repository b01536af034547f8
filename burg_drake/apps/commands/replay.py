"""`burg-drake replay`: simulates one trial again, compares it with the record, and shows it."""

from __future__ import annotations

import argparse
import logging
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

    @property
    def title(self) -> str:
        """Title of a page."""
        return f"{self.inputs.scene.name}: {self.trial.id}"


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
    found = _replay(source, meshcat)
    for line in found.lines:
        print(line)
    if arguments.html is None and found.end_time == 0.0:
        print("nothing moves: the trial ended before its first step", file=sys.stderr)
    present_view(meshcat, arguments, title=source.title, caption=found.lines)
    return 0 if found.as_recorded else 1


def save_replay(run: Path, id: str, page: Path) -> None:
    """Simulates a grasp of a run again, and writes a page that shows it.

    Args:
        run: folder of the run.
        id: id of the grasp.
        page: file to write (.html).
    """
    loaded = evaluation.load_run(run)
    inputs = evaluation.TrialInputs(loaded.scene(), loaded.station())
    source = ReplaySource(loaded.trial(id), _origin(loaded, id), inputs)
    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake sets it when imported
    meshcat = visualization.open_meshcat(None)
    lines = _replay(source, meshcat).lines
    visualization.save_html(meshcat, page, title=source.title, caption=lines)


@dataclass(frozen=True)
class _Replay:
    """What a replay shows.

    Attributes:
        lines: the verdict in words, and how it differs from the record.
        end_time: simulated time at the end of what is shown [s].
        as_recorded: whether the verdict is that of the record, but for rounding.
    """

    lines: list[str]
    end_time: float
    as_recorded: bool


def _replay(source: ReplaySource, meshcat: Any) -> _Replay:
    """Simulates a trial again, recorded in Meshcat."""
    engine = evaluation.replay_engine(source.origin)
    verdict, shown, shown_part = _simulate_trial(source, engine, meshcat)
    lines = [
        *visualization.describe_trial(evaluation.as_result(verdict)),
        *evaluation.arm_figures(verdict),
    ]
    lines += evaluation.motion_figures(source.trial, source.origin)
    if source.origin.engine.parallel:
        lines.append(f"judged again by {engine}")
    recorded = source.trial.verdict
    differences = [] if recorded is None else evaluation.differences(recorded, verdict)
    if recorded is not None:
        lines += evaluation.comparison(differences, source.origin, engine)
    if shown.outcome is not verdict.outcome:
        lines += [f"shown is {shown_part}, to the end:", *visualization.describe_trial(shown)]
    as_recorded = all(difference.rounding for difference in differences)
    if recorded is not None and not engine.repeats_bits(source.origin):
        as_recorded = verdict.outcome is recorded.outcome
    return _Replay(lines, float(shown.margins.end_time), as_recorded)


def _simulate_trial(
    source: ReplaySource, engine: evaluation.ReplayEngine, meshcat: Any
) -> tuple[core.Verdict, simulation.TrialResult, str]:
    """The verdict of the row's engine, the whole trial to show, and a text on what is shown.

    With an engine that ends trials early, the trial is simulated twice: as recorded, and to the end
    for the view. So is a trial of the arm, which is shown from its home posture on, and one that
    is judged in parallel, which is shown as the CPU executes it.
    """
    trial, origin = source.trial, source.origin
    is_whole = engine.engine.whole_trial and not engine.engine.parallel
    if evaluation.decisive_mode(trial, origin) == "hand" and is_whole:
        shown = _show_hand(source, meshcat)
        return evaluation.trial_verdict(shown), shown, "the hand alone"
    if note := evaluation.starting_note(engine.engine, engine.device):
        print_remark(note)
    inputs = source.inputs
    verdict, plan = evaluation.rerun(inputs.scene, inputs.station, trial, origin, engine)
    if plan is not None:
        return verdict, _show_arm(source, plan, meshcat), "the arm from home on"
    shown_part = "the hand alone, on the CPU" if engine.engine.parallel else "the hand alone"
    return verdict, _show_hand(source, meshcat), shown_part


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
    if evaluation.is_campaign(path):
        campaign = evaluation.load_campaign(path)
        raise core.InvalidInputError(
            f"{path} is a run over many scenes; give the folder of one of them, such as"
            f" {campaign.folder(campaign.names[0])}"
        )
    run = evaluation.load_run(path)
    if arguments.grasp is not None:
        id = arguments.grasp
    else:
        id = str(run.results["id"][_choose_row(run.results, path, arguments)])
    trial, origin = run.trial(id), _origin(run, id)
    origin.settings(f"{path / evaluation.RUN_FILE}: trial")
    if arguments.scene is None and arguments.station is None and not arguments.force:
        return ReplaySource(trial, origin, evaluation.TrialInputs(run.scene(), run.station()))
    moved = {"scene": arguments.scene, "station": arguments.station, "force": arguments.force}
    return ReplaySource(
        trial, origin, evaluation.find_inputs(origin, f"{path}, {id},", path, **moved)
    )


def _origin(run: evaluation.Run, id: str) -> evaluation.TrialOrigin:
    """Origin of a grasp's verdict."""
    verdict = run.trial(id).verdict
    return evaluation.origin_of(run.document).judged_by(verdict.judged_again if verdict else "")


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
