"""`burg-drake doctor`: the options, the table."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from burg_drake import __version__
from burg_drake.apps.options import add_verb


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "doctor",
        run_doctor,
        "show what is installed, what is missing, and how to get it",
        "burg-drake doctor",
        "burg-drake doctor --json",
        "",
        "It changes nothing and does not use the network. Exit code 1 if `evaluate` cannot run.",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run_doctor(arguments: argparse.Namespace) -> int:
    """Prints the table; 1 if something that `evaluate` needs is missing."""
    from burg_drake.apps.doctor.checks import all_checks, summary_lines

    checks = all_checks()
    if arguments.json:
        found = {"burg_drake": __version__, "checks": [asdict(check) for check in checks]}
        print(json.dumps(found, indent=2))
    else:
        width = max(len(check.feature) for check in checks)
        print(f"burg_drake {__version__}\n")
        for check in checks:
            state = "optional" if check.state == "missing" and not check.required else check.state
            print(f"{state:<8}  {check.feature:<{width}}  {check.found}".rstrip())
            if check.remedy:
                print(f"{'':<8}  {'':<{width}}  -> {check.remedy}")
        print("", *summary_lines(checks), sep="\n")
    return 1 if any(check.prevents_evaluation for check in checks) else 0
