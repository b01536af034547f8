"""`burg-drake status`: how far a run is, while another process works on it, or afterwards."""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_verb

if TYPE_CHECKING:
    from burg_drake.evaluation.results import Status

POLL_INTERVAL = 1.0
"""Between two reads of a run's state [s]."""
MAX_SCENES_NAMED = 8
"""Scenes under way that are named."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "status",
        run_status,
        "print the progress of a run",
        "burg-drake status runs/many",
        "burg-drake status runs/many --follow",
        "burg-drake status runs/many --json",
    )
    parser.add_argument("run_folder", metavar="RUN", help="folder of a run, of one scene or many")
    parser.add_argument(
        "--follow",
        action="store_true",
        help="repeat until the run is complete",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, one line per update")


def run_status(arguments: argparse.Namespace) -> int:
    """Prints the status; 1 if scenes could not be judged."""
    from burg_drake.evaluation.results import Watch

    watch = Watch(arguments.run_folder)
    status = watch.look()
    _show(status, arguments.json)
    if not arguments.follow:
        return 1 if status.failed else 0
    shown = status
    while not status.complete:
        time.sleep(POLL_INTERVAL)
        status = watch.look()
        if (status.judged, status.done, status.working) != (
            shown.judged,
            shown.done,
            shown.working,
        ):
            shown = status
            _show(status, arguments.json, again=not arguments.json)
    return 1 if status.failed else 0


def _show(status: Status, as_json: bool, *, again: bool = False) -> None:
    if as_json:
        print(json.dumps(status.plain()), flush=True)
        return
    lines = status_lines(status)
    if again and sys.stdout.isatty():
        print(f"\x1b[{len(lines)}F\x1b[J", end="")
    if again and not sys.stdout.isatty():
        lines = lines[:1]
    print("\n".join(lines), flush=True)


def status_lines(status: Status) -> list[str]:
    """The status for people; always as many lines for the same run, but for its failures."""
    from burg_drake.core import listing
    from burg_drake.core.grasps import Outcome
    from burg_drake.core.terminal import format_number, format_percent

    share = f" ({format_percent(status.judged / status.total)})" if status.total else ""
    about = "about " if status.kind == "campaign" and not status.complete else ""
    head = f"{status.judged:,} of {about}{status.total:,} grasps judged{share}"
    if status.rate:
        head += f", {format_number(status.rate)}/s"
    if status.left is not None and not status.complete:
        left = int(status.left)
        head += f", {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
    found = [f"{n:,} {o.value}" for o in Outcome if (n := status.outcomes[o.value])]
    lines = [head, f"outcomes  {', '.join(found) or '-'}"]
    if status.kind == "campaign":
        now = status.under_way
        more = f", now {', '.join(now[:MAX_SCENES_NAMED])}" if now else ""
        more += f" and {len(now) - MAX_SCENES_NAMED} others" if len(now) > MAX_SCENES_NAMED else ""
        lines.append(f"scenes    {status.done:,} of {status.scenes:,} done{more}")
    lines.append(f"process   {_process(status)}")
    if status.shard:
        lines.append(f"shard     {status.shard}")
    if status.failed:
        lines.append(f"failed    {listing(list(status.failed))}")
        lines += [
            f"  {name}: {why}" for name, why in list(status.failed.items())[:MAX_SCENES_NAMED]
        ]
    return lines


def _process(status: Status) -> str:
    last = ""
    if status.last is not None:
        ago = max(0, int(time.time() - status.last))
        clock = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.last))
        last = f"; last verdict at {clock}, {ago // 3600}:{ago // 60 % 60:02d}:{ago % 60:02d} ago"
    if status.working:
        return f"at work{last}"
    if status.complete:
        return f"none, and nothing is left to do{last}"
    return f"none; the same command continues{last}"
