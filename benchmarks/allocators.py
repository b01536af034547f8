"""CPU time and memory of grasp trials with the memory allocators that this machine has.

    python benchmarks/allocators.py [LIBRARY ...] [--rounds N] [--trials N]

Runs `trials.py` (tabletop_six, standard engine) in fresh processes, with the C library's malloc
and with each library preloaded, by turns in both directions. Libraries are those that workers would
be started with, and those given. Ratios are of means over all rounds: of a trial, and of the whole
process with imports and building. Outcomes have to be the same.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

from burg_drake.core import AllocatorSettings, installed_allocators

TRIALS = Path(__file__).with_name("trials.py")
OURS = "C library"


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("libraries", nargs="*", type=Path, metavar="LIBRARY")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--trials", type=int, default=6, help="executed for each object")
    arguments = parser.parse_args()
    names = [OURS, *map(str, [*installed_allocators(), *arguments.libraries])]
    figures: dict[str, list[tuple[float, ...]]] = {name: [] for name in names}
    outcomes = set()
    for k in range(arguments.rounds):
        for name in names[:: 1 if k % 2 == 0 else -1]:
            found, ended = measured(name, arguments.trials)
            figures[name].append(found)
            outcomes.add(ended)
    print(f"{'trial':>7}{'process':>9}{'MiB':>6}  allocator")
    base = np.mean(figures[OURS], axis=0)
    for name in names:
        trial, process, memory = np.mean(figures[name], axis=0)
        print(f"{base[0] / trial:7.3f}{base[1] / process:9.3f}{memory:6.0f}  {name}")
    print(f"outcomes: {'the same' if len(outcomes) == 1 else outcomes}")


def measured(name: str, trials: int) -> tuple[tuple[float, float, float], str]:
    """CPU time of a trial and of all [s], and peak memory [MiB]; the outcomes."""
    environment = {
        key: value for key, value in os.environ.items() if key != AllocatorSettings.preload_variable
    }
    if name != OURS:
        environment[AllocatorSettings.preload_variable] = name
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    printed = subprocess.run(
        [sys.executable, TRIALS, "--engine", "standard", "--trials", str(trials)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    row = re.search(r"^all +\d+ +\S+ +(\S+) .*?(\{.*\})$", printed, re.MULTILINE)
    memory = re.search(r"peak memory (\d+)", printed)
    assert row is not None and memory is not None, printed
    return (float(row[1]), seconds, float(memory[1])), row[2]


if __name__ == "__main__":
    main()
