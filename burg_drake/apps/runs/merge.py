"""`burg-drake merge`: one run of shards, or of copies that were interrupted."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.options import add_verb


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "merge",
        run_merge,
        "join the shards of a run",
        "burg-drake merge runs/shard* -o runs/whole",
    )
    parser.add_argument("runs", metavar="RUN", nargs="+", help="folder of a run")
    parser.add_argument(
        "-o", "--output", metavar="RUN", required=True, help="folder of the merged run"
    )


def run_merge(arguments: argparse.Namespace) -> int:
    """Merges runs and prints what is in them; 1 if grasps could not be simulated."""
    from burg_drake.apps.runs.campaign import campaign_exit_code, print_campaign
    from burg_drake.apps.runs.evaluate import print_summary
    from burg_drake.evaluation.merge import merge_folders
    from burg_drake.evaluation.store import Campaign

    merged = merge_folders(arguments.runs, arguments.output)
    result = merged.result
    if isinstance(result, Campaign):
        print_campaign(result)
        code = campaign_exit_code(result)
    else:
        print_summary(result)
        print(f"table   {result.table_path}")
        print(f"report  {result.report_path}")
        code = 1 if result.failures else 0
    for note in merged.notes:
        print(f"note: {note}")
    return code
