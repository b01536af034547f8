"""`burg-drake report`: what a run found, as tables and as a page, complete or not."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.options import add_verb


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "report",
        run_report,
        "print what a run found so far; write its report again",
        "burg-drake report runs/first",
        "burg-drake report runs/many",
        "burg-drake report runs/many/scenes/kitchen_3",
    )
    parser.add_argument(
        "run_folder",
        metavar="RUN",
        help="folder of a run, or RUN/scenes/NAME for one scene of many",
    )


def run_report(arguments: argparse.Namespace) -> int:
    """Prints the tables of a run, of one scene or of many, and writes its report."""
    from burg_drake.apps.runs.campaign import campaign_exit_code, print_campaign
    from burg_drake.apps.runs.evaluate import print_summary
    from burg_drake.evaluation.report import write_campaign_report, write_report
    from burg_drake.evaluation.store import Campaign, open_results

    run = open_results(arguments.run_folder)
    if isinstance(run, Campaign):
        write_campaign_report(run)
        print_campaign(run)
        return campaign_exit_code(run)
    write_report(run)
    print_summary(run)
    if not run.complete:
        print(
            f"{len(run.verdicts)} of {len(run.mine)} grasps are judged; the same"
            " `evaluate` command continues"
        )
    print(f"report  {run.report_path}")
    return 0
