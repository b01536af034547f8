"""`burg-drake status`, `report` and `merge`: the state, the report and the parts of runs."""

from __future__ import annotations

import argparse
import json
import sys
import time

from burg_drake import core, evaluation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines


def add_status_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake status`."""
    parser.epilog = options.examples_text(
        "burg-drake status runs/many",
        "burg-drake status runs/many --follow",
        "burg-drake status runs/many --json",
    )
    parser.add_argument("run_folder", metavar="RUN", help="folder of a run, of one scene or many")
    parser.add_argument("--follow", action="store_true", help="repeat until the run is complete")
    parser.add_argument("--json", action="store_true", help="print JSON, one line per update")


def run_status(arguments: argparse.Namespace) -> int:
    """Prints the status; returns 1 if scenes could not be judged."""
    poll_interval = 1.0  # Seconds between reads of a run's state.

    watch = evaluation.RunWatch(arguments.run_folder)
    status = watch.look()
    _print_status(status, arguments.json)
    if not arguments.follow:
        return 1 if status.failed else 0
    shown = status
    while not status.complete:
        time.sleep(poll_interval)
        status = watch.look()
        now = (status.judged, status.done, status.working)
        if now != (shown.judged, shown.done, shown.working):
            shown = status
            _print_status(status, arguments.json, again=not arguments.json)
    return 1 if status.failed else 0


def _print_status(status: evaluation.Status, as_json: bool, *, again: bool = False) -> None:
    if as_json:
        print(json.dumps(status.plain()), flush=True)
        return
    lines = status_lines(status)
    if again and sys.stdout.isatty():
        print(f"\x1b[{len(lines)}F\x1b[J", end="")
    if again and not sys.stdout.isatty():
        lines = lines[:1]
    print("\n".join(lines), flush=True)


def status_lines(status: evaluation.Status) -> list[str]:
    """The status as text; except for failures, always the same number of lines for a run."""
    max_named = 8  # Maximum number of scenes listed by name.

    share = f" ({core.format_percent(status.judged / status.total)})" if status.total else ""
    about = "about " if status.kind == "campaign" and not status.complete else ""
    head = f"{status.judged:,} of {about}{status.total:,} grasps judged{share}"
    if status.rate:
        head += f", {core.format_number(status.rate)}/s"
    if status.left is not None and not status.complete:
        left = int(status.left)
        head += f", {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
    found = [f"{n:,} {o.value}" for o in core.Outcome if (n := status.outcomes[o.value])]
    lines = [head, f"outcomes  {', '.join(found) or '-'}"]
    if status.kind == "campaign":
        now = status.under_way
        more = f", now {', '.join(now[:max_named])}" if now else ""
        more += f" and {len(now) - max_named} others" if len(now) > max_named else ""
        lines.append(f"scenes    {status.done:,} of {status.scenes:,} done{more}")
    lines.append(f"process   {_process_text(status)}")
    if status.shard:
        lines.append(f"shard     {status.shard}")
    if status.failed:
        lines.append(f"failed    {core.list_names(list(status.failed))}")
        lines += [f"  {name}: {why}" for name, why in list(status.failed.items())[:max_named]]
    return lines


def _process_text(status: evaluation.Status) -> str:
    last = ""
    if status.last is not None:
        ago = max(0, int(time.time() - status.last))
        clock = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.last))
        last = f"; last verdict at {clock}, {ago // 3600}:{ago // 60 % 60:02d}:{ago % 60:02d} ago"
    if status.working:
        return f"at work{last}"
    if status.complete:
        return f"none, and nothing is left to do{last}"
    unsampled = "" if status.sampled else "; it was stopped while it sampled grasps"
    return f"none; the same command continues{unsampled}{last}"


def add_report_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake report`."""
    parser.epilog = options.examples_text(
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
    from burg_drake.apps.commands.evaluate import (
        print_campaign,
        print_summary,
        report_campaign_failures,
    )

    run = evaluation.open_results(arguments.run_folder)
    if isinstance(run, evaluation.Campaign):
        evaluation.write_campaign_report(run)
        print_campaign(run)
        return report_campaign_failures(run)
    evaluation.write_report(run)
    print_summary(run)
    if not run.complete:
        print(
            f"{run.rows().count} of {len(run.assigned_ids)} grasps are judged; the same"
            " `evaluate` command continues"
        )
    print(f"report  {run.report_path}")
    return 0


def add_merge_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake merge`."""
    parser.epilog = options.examples_text("burg-drake merge runs/shard* -o runs/whole")
    parser.add_argument("runs", metavar="RUN", nargs="+", help="folder of a run")
    options.add_output(parser, "RUN", "folder of the merged run")


def run_merge(arguments: argparse.Namespace) -> int:
    """Merges runs and prints their tables; returns 1 if grasps could not be simulated."""
    from burg_drake.apps.commands.evaluate import (
        print_campaign,
        print_summary,
        report_campaign_failures,
    )

    merged = evaluation.merge_folders(arguments.runs, arguments.output)
    result = merged.result
    if isinstance(result, evaluation.Campaign):
        print_campaign(result)
        code = report_campaign_failures(result)
    else:
        print_summary(result)
        print(f"table   {result.table_path}")
        print(f"report  {result.report_path}")
        code = 1 if result.failures else 0
    print_note_lines(merged.notes)
    return code
