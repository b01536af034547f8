"""Prints what contact_oracle.py has found."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from oracle.cases import Case
from oracle.strangers import KIND_OF

from burg_drake.core import wilson_interval

ORACLE = "oracle"
CONFIDENCES = (0.0, 0.6, 0.8, 0.9, 0.95, 1.01)
"""Ends of the bins."""
Rows = Mapping[tuple[str, str], dict[str, Any]]


@dataclass(frozen=True)
class Probes:
    """What else the oracle judged.

    Attributes:
        friction: small changes of friction; of hard cases none are needed.
        worlds: other tables and pads, for the grasps on which an engine disagrees.
    """

    friction: Sequence[str]
    worlds: Sequence[str]


def print_report(cases: Sequence[Case], engines: Sequence[str], probes: Probes, rows: Rows) -> None:
    """Prints the tables and the disagreements.

    Args:
        cases: all cases.
        engines: names.
        probes: what else the oracle judged.
        rows: by case and label.
    """
    usable = [c for c in cases if is_usable(c, engines, rows)]
    marginal = [c for c in usable if changes(c, probes.friction, rows)]
    settled = [c for c in usable if c not in marginal]
    lifted = sum(rows[c.id, ORACLE]["lifted"] for c in settled)
    print(f"{len(settled)} grasps, {lifted} of them lifted by the oracle")
    left = [c for c in cases if c not in usable]
    if left:
        print(f"{len(left)} more are left out, as more than the pads touches: {names(left)}")
    print_times(usable, (ORACLE, *engines), rows)
    groups = {
        "all": settled,
        "tuned": [c for c in settled if not c.held_out],
        "held out": [c for c in settled if c.held_out],
        "hard": [c for c in settled if c.is_hard],
        "ordinary": [c for c in settled if not c.is_hard],
        "marginal": marginal,
    }
    print(f"\n{'agreement with the oracle':40} {'':7}  {'95 % interval':>16} {'of':>6}"
          f" {'false lifts':>11} {'false drops':>11}")  # fmt: skip
    for engine in engines:
        for group, chosen in groups.items():
            if chosen and (len(chosen) < len(settled) or group == "all"):
                print_agreement(f"{engine}, {group}", engine, chosen, rows)
    print_confidence(settled, engines, rows)
    print_objects(settled, engines, rows)
    for engine in engines:
        print_disagreements(engine, settled, probes, rows)


def is_usable(case: Case, engines: Sequence[str], rows: Rows) -> bool:
    """Whether only pads touch, and the engine's open hand is clear as well."""
    return all(rows[case.id, label]["executed"] for label in (ORACLE, *engines))


def changes(case: Case, labels: Sequence[str], rows: Rows) -> list[str]:
    """With which of these the oracle contradicts itself."""
    return [label for label in labels if differs(case, label, rows)]


def differs(case: Case, label: str, rows: Rows) -> bool:
    """Whether the verdict is not the oracle's."""
    return bool(rows[case.id, label]["lifted"] != rows[case.id, ORACLE]["lifted"])


def print_times(cases: Sequence[Case], labels: Sequence[str], rows: Rows) -> None:
    """CPU time of a trial."""
    print(f"\n{'CPU time of a trial [s]':40} {'median':>7} {'mean':>7}")
    for label in labels:
        cpu = [rows[c.id, label]["cpu"] for c in cases]
        print(f"{label:40} {np.median(cpu):7.2f} {np.mean(cpu):7.2f}")


def print_agreement(title: str, engine: str, cases: Sequence[Case], rows: Rows) -> None:
    """One line of the table."""
    wrong = [c for c in cases if differs(c, engine, rows)]
    lifts = sum(rows[c.id, engine]["lifted"] for c in wrong)
    same = len(cases) - len(wrong)
    low, high = wilson_interval(same, len(cases))
    print(
        f"{title:40} {same / len(cases):7.2%}  {low:6.1%} to {high:6.1%} {len(cases):6}"
        f" {lifts:11} {len(wrong) - lifts:11}"
    )


def print_confidence(cases: Sequence[Case], engines: Sequence[str], rows: Rows) -> None:
    """How often the oracle confirms verdicts, by the confidence that they come with."""
    print(f"\n{'confirmed, by confidence':40} {'':7}  {'95 % interval':>16} {'of':>6}")
    for engine in engines:
        known = [c for c in cases if rows[c.id, engine].get("confidence") is not None]
        for low, high in itertools.pairwise(CONFIDENCES):
            within = [c for c in known if low <= rows[c.id, engine]["confidence"] < high]
            same = sum(not differs(c, engine, rows) for c in within)
            if within:
                a, b = wilson_interval(same, len(within))
                print(
                    f"{f'{engine}, {low:.2f} to {min(high, 1.0):.2f}':40} {same / len(within):7.2%}"
                    f"  {a:6.1%} to {b:6.1%} {len(within):6}"
                )


def print_objects(cases: Sequence[Case], engines: Sequence[str], rows: Rows) -> None:
    """How many of the verdicts are wrong, by object, or by kind of object where that is known:
    lifts that are none + drops that are none."""
    print(f"\n{'false lifts + false drops':18} {'of':>4}" + "".join(f"{e:>19}" for e in engines))
    groups = {c.id: KIND_OF.get(c.object, c.object) for c in cases}
    for name in dict.fromkeys(groups.values()):
        own = [c for c in cases if groups[c.id] == name]
        cells = []
        for engine in engines:
            wrong = [c for c in own if differs(c, engine, rows)]
            lifts = sum(rows[c.id, engine]["lifted"] for c in wrong)
            cells.append(f"{lifts} + {len(wrong) - lifts}" if wrong else "-")
        label = f"{name} (held out)" if all(c.held_out for c in own) else name
        print(f"{label:22} {len(own):4}" + "".join(f"{cell:>19}" for cell in cells))


def print_disagreements(engine: str, cases: Sequence[Case], probes: Probes, rows: Rows) -> None:
    """Every grasp on which an engine disagrees, with the margins of both, and on what it hinges."""
    wrong = [c for c in cases if differs(c, engine, rows)]
    if not wrong:
        return
    print(f"\n{engine} disagrees on {len(wrong)} grasps")
    print(f"{'grasp':22} {'friction':>8} {'mass':>8} {'oracle':>34} | {engine:>34}")
    for case in wrong:
        hinges = ", ".join(changes(case, probes.worlds, rows))
        print(f"{line(case, rows)} | {outcome(rows[case.id, engine])}  {hinges}")


def line(case: Case, rows: Rows) -> str:
    """A case and the oracle's verdict."""
    return f"{case.id:22} {case.friction:8.4f} {case.mass:5.3f} kg {outcome(rows[case.id, ORACLE])}"


def outcome(row: dict[str, Any]) -> str:
    """Outcome, slip and tilt."""
    return f"{row['outcome']:>16} {1e3 * row['slip']:6.2f} mm {np.rad2deg(row['tilt']):5.1f} deg"


def names(cases: Sequence[Case]) -> str:
    """Their ids."""
    return ", ".join(c.id for c in cases)
