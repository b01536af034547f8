"""Prints what engines.py has found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from engine_cases import NOISE, PROBES, Case

from burg_drake.core import Outcome, Stage, wilson_interval
from burg_drake.station import Engine

TUNED = ("household/box", "household/can", "household/bottle", "household/mug", "household/bowl")
"""Objects, or such as these, with which the presets were chosen."""
REFERENCE = "reference"
Find = Callable[[Case, str], dict[str, Any] | None]


def print_report(cases: Sequence[Case], engines: dict[str, Engine], find: Find) -> None:
    """Prints the tables and the disagreements.

    Args:
        cases: all cases.
        engines: by name, the reference among them.
        find: row of a case with an engine, or with what was changed for the reference.
    """
    for label, chosen in GROUPS.items():
        held = [row(find, c, REFERENCE)["held"] for c in cases if chosen(c)]
        print(f"{label}: {sum(held)} of {len(held)} are held by the reference")
    base = float(np.mean([row(find, c, REFERENCE)["cpu"] for c in cases]))
    print(f"\n{'CPU time of a trial':22} {'median':>7} {'mean':>7} {'a second':>9} {'faster':>6}")
    for name in engines:
        print_cost(name, cases, find, base)
    print(f"\n{'agreement with the reference':32} {'':7}  {'95 % interval':>16} {'of':>6}"
          f" {'false lifts':>11} {'false drops':>11}")  # fmt: skip
    for name in engines:
        if name != REFERENCE:
            print_groups(name, name, cases, find)
    executed = [c for c in cases if is_executed(find, c, NOISE)]
    print_groups("moved 0.5 mm, 0.5 deg", NOISE, executed, find)
    for name in engines:
        print_disagreements(name, cases, find)


GROUPS: dict[str, Callable[[Case], bool]] = {
    "all": lambda case: True,
    "held out": lambda case: not is_tuned(case),
    "marginal": lambda case: case.marginal,
}


def print_cost(name: str, cases: Sequence[Case], find: Find, base: float) -> None:
    """CPU time of an engine, and how many times as fast as the reference it is."""
    cpu = [row(find, c, name)["cpu"] for c in cases]
    print(
        f"{name:22} {np.median(cpu):7.3f} {np.mean(cpu):7.3f} {1 / np.mean(cpu):9.1f}"
        f" {base / np.mean(cpu):6.1f}"
    )


def print_groups(title: str, label: str, cases: Sequence[Case], find: Find) -> None:
    """Agreement on all cases and on groups of them."""
    for group, chosen in GROUPS.items():
        print_agreement(f"{title}, {group}", [c for c in cases if chosen(c)], find, label)


def print_agreement(title: str, cases: Sequence[Case], find: Find, label: str) -> None:
    """One line of the table."""
    pairs = [(row(find, c, label)["held"], row(find, c, REFERENCE)["held"]) for c in cases]
    same = sum(a == b for a, b in pairs)
    low, high = wilson_interval(same, len(pairs))
    print(
        f"{title:32} {same / max(1, len(pairs)):7.2%}  {low:6.1%} to {high:6.1%} {len(pairs):6}"
        f" {sum(a and not b for a, b in pairs):11} {sum(b and not a for a, b in pairs):11}"
    )


def print_disagreements(name: str, cases: Sequence[Case], find: Find) -> None:
    """Every grasp on which an engine disagrees, with margins of both and its class."""
    wrong = [c for c in cases if row(find, c, name)["held"] != row(find, c, REFERENCE)["held"]]
    if not wrong:
        return
    unexplained = sum(not flips(find, c) for c in wrong)
    print(f"\n{name} disagrees on {len(wrong)} grasps, {unexplained} of them unexplained")
    print(f"{'grasp':30} {'kind':8} {'class':11} {'reference':>30} | {'engine':>30}  changes")
    for case in wrong:
        changes = flips(find, case)
        print(
            f"{case.id:30} {case.kind:8} {'marginal' if changes else 'UNEXPLAINED':11}"
            f" {margins(row(find, case, REFERENCE))} | {margins(row(find, case, name))}"
            f"  {', '.join(changes)}"
        )


def margins(found: dict[str, Any]) -> str:
    """Outcome, slip, tilt, pad force and lift."""
    return (
        f"{found['outcome']:12} {found['slip'] * 1e3:5.1f} mm {np.rad2deg(found['tilt']):5.1f} deg"
        f" {found['pad_force']:4.1f} N {found['lift'] * 1e3:5.1f} mm"
    )


def flips(find: Find, case: Case) -> list[str]:
    """Small changes with which the reference contradicts itself."""
    held = row(find, case, REFERENCE)["held"]
    return [p for p in PROBES if is_executed(find, case, p) and row(find, case, p)["held"] != held]


def is_executed(find: Find, case: Case, label: str) -> bool:
    """Whether the hand was clear, which a moved one need not be."""
    found = find(case, label)
    return found is not None and Outcome(found["outcome"]).stage is Stage.EXECUTED


def is_tuned(case: Case) -> bool:
    """Whether presets were chosen with this object."""
    return case.id.startswith(tuple(f"{name}/" for name in TUNED))


def row(find: Find, case: Case, label: str) -> dict[str, Any]:
    """A row that is there."""
    found = find(case, label)
    assert found is not None, f"{case.id}: {label} was not executed"
    return found
