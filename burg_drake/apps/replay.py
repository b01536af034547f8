"""`burg-drake replay`: the recording of one trial of a run."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import add_verb, add_view
from burg_drake.core.errors import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation.judge import Verdict
    from burg_drake.evaluation.run_store import Run


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "replay",
        run_replay,
        "show the trial of one grasp of a run in Meshcat",
        "burg-drake replay runs/first --best",
        "burg-drake replay runs/first --grasp mug-0123456789",
        "burg-drake replay runs/first --best --html replay.html",
    )
    parser.add_argument("run_folder", metavar="RUN", help="folder of a run")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--grasp", metavar="ID", help="id of a grasp, from the table of results")
    which.add_argument(
        "--best", action="store_true", help="the lifted grasp that slipped and disturbed least"
    )
    add_view(parser)


def run_replay(arguments: argparse.Namespace) -> int:
    """Executes a grasp once more, recorded."""
    from burg_drake.apps.live import open_view, present
    from burg_drake.evaluation.run_store import load_run
    from burg_drake.simulation.hand_trial import TrialSettings
    from burg_drake.visualization.replay import describe, record_trial

    run = load_run(arguments.run_folder)
    id = _best(run) if arguments.best else arguments.grasp
    candidate = run.candidate(id)
    scene, station = run.scene(), run.station()
    meshcat = open_view(arguments)
    result = record_trial(
        scene,
        station,
        candidate.instance,
        candidate.X_OG,
        meshcat,
        engine=run.document.engine,
        settings=TrialSettings(**run.document.trial),
    )
    lines = describe(result)
    verdict = run.verdicts.get(id)
    if verdict is not None and verdict.outcome is not result.outcome:
        lines.insert(0, _other_verdict(run, verdict))
    for line in lines:
        print(line)
    if arguments.html is None and result.margins.end_time == 0.0:
        print("nothing moves: the trial ended at its start", file=sys.stderr)
    present(meshcat, arguments, title=f"{scene.name}: {id}", caption=lines)
    return 0


def _other_verdict(run: Run, verdict: Verdict) -> str:
    """Introduces a trial that ends unlike the run's, with what may be the cause."""
    from burg_drake.core.outcome import Stage
    from burg_drake.evaluation.run_document import software_versions

    there, here = run.document.versions, software_versions()
    changed = [
        f"{name} {there[name]}, now {here[name]}"
        for name in there
        if name in here and there[name] != here[name]
    ]
    versions = f" (with {'; '.join(changed)})" if changed else ""
    trial = "the hand alone" if verdict.stage is Stage.REACHABLE else "this time"
    return f"the run's verdict: {verdict.outcome}{versions}; {trial}:"


def _best(run: Run) -> str:
    best = run.best()
    if not best:
        raise InvalidInputError(
            f"{run.path}: no grasp was lifted; choose one with --grasp ID"
            f" (ids are in {run.table_path.name})"
        )
    return best[0]
