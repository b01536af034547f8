"""A local cluster of Dask: does it cost little, and do kills at random moments change anything?

    python benchmarks/cluster.py [--kills N] [--grasps N] [--workers N] [--mode MODE] [--only PART]

`rows`: judges a small set with one, two and N processes of this machine and on a cluster of N
workers, and compares the rows but for CPU times. `kills`: judges it on a cluster while the driver,
a worker or the scheduler is killed by SIGKILL after a random time; the same command continues, on a
new cluster where that is needed, until all kills are done; then it compares again. `overhead`:
trials that sleep for the time of real ones, so that a busy machine does not blur it: the time on N
workers against what the trials take, for the cluster and for the local pool.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "evaluation"))
from known_judge import Make, TimedJudge

from burg_drake.evaluation import Candidate, Executor, Job, LocalExecutor, connect_cluster

SLOWEST = 1800.0
"""An attempt that takes longer has hung [s]."""
VICTIMS = ("driver", "scheduler", "worker")
TRIAL = 0.25
"""Time of a trial of `overhead` [s]."""
PROGRAM = "from burg_drake.apps.cli import main; raise SystemExit(main())"


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--grasps", type=int, default=4, help="an object (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=4)
    parser.add_argument("--mode", default="hand")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=("rows", "kills", "overhead"))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if arguments.only in (None, "overhead"):
            overhead(arguments.workers)
        if arguments.only in (None, "rows", "kills"):
            finish(start(arguments, place / "one", "--workers", "1"))
        if arguments.only in (None, "rows"):
            rows(arguments, place)
        if arguments.only in (None, "kills"):
            kills(arguments, place)


def rows(arguments: argparse.Namespace, place: Path) -> None:
    """Compares rows."""
    where = f"local:{arguments.workers}"
    for name, *how in (
        ("two", "--workers", "2"),
        ("many", "--workers", str(arguments.workers)),
        ("cluster", "--cluster", where),
    ):
        began = time.monotonic()
        finish(start(arguments, place / name, *how))
        print(f"{' '.join(how)}: {time.monotonic() - began:.1f} s", flush=True)
        compare(place / "one", place / name)


def kills(arguments: argparse.Namespace, place: Path) -> None:
    """Kills processes."""
    rng, killed = random.Random(arguments.seed), Counter[str]()
    how = ("--cluster", f"local:{arguments.workers}")
    out = place / "killed"
    began = time.monotonic()
    finish(start(arguments, place / "undisturbed", *how))
    usual = time.monotonic() - began
    codes = Counter[int]()
    while True:
        driver = start(arguments, out, *how)
        while killed.total() < arguments.kills:
            try:
                driver.wait(rng.uniform(0.1, 0.7) * usual)
                break
            except subprocess.TimeoutExpired:
                victim = rng.choice(VICTIMS)
                nodes = children(driver.pid)
                if victim == "driver":
                    driver.kill()
                elif len(nodes) < 2:
                    continue
                else:
                    # the scheduler is started first
                    pid = nodes[0] if victim == "scheduler" else rng.choice(nodes[1:])
                    os.kill(pid, signal.SIGKILL)
                killed[victim] += 1
                print(f"killed the {victim}", flush=True)
        code = finish(driver)
        codes[code] += 1
        if code == 0:
            compare(place / "one", out)
            if killed.total() >= arguments.kills:
                break
            shutil.rmtree(out)  # it came through: begin anew, and go on killing
    print(f"killed {dict(killed)}; drivers ended with {dict(codes)}: no difference", flush=True)


def start(arguments: argparse.Namespace, out: Path, *how: str) -> subprocess.Popen[bytes]:
    """Starts `evaluate`."""
    verb = ["evaluate", "tabletop_six", "--grasps-per-object", str(arguments.grasps)]
    options = ["-o", str(out), "--mode", arguments.mode, "--quiet", *how]
    command = [sys.executable, "-c", PROGRAM, *verb, *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def finish(process: subprocess.Popen[bytes]) -> int:
    """Waits for the end."""
    try:
        return process.wait(SLOWEST)
    finally:
        process.kill()


def children(pid: int) -> list[int]:
    """Processes that a process has started and that are alive, the first ones first."""
    try:
        texts = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:
        return []
    return sorted(int(child) for text in texts for child in text.split())


def compare(one: Path, other: Path) -> None:
    """Ends the benchmark where rows differ but for CPU times."""
    tables = [table(folder) for folder in (one, other)]
    if tables[0] != tables[1]:
        differing = [id for id in tables[0] if tables[0][id] != tables[1].get(id)]
        raise SystemExit(f"{other.name}: rows differ: {differing}")
    print(f"{other.name}: the same {len(tables[0])} rows", flush=True)


def table(folder: Path) -> dict[str, Any]:
    """Rows by id, without CPU times."""
    with (folder / "results.csv").open(newline="") as file:
        return {
            row["id"]: {name: cell for name, cell in row.items() if not name.startswith("cpu_")}
            for row in csv.DictReader(file)
        }


def overhead(workers: int) -> None:
    """Measures what is lost between trials."""
    with connect_cluster(f"local:{workers}") as cluster:
        for name, executor in (("cluster", cluster), ("local pool", LocalExecutor(workers))):
            lost(name, executor, workers)


def lost(name: str, executor: Executor, workers: int) -> None:
    """Prints how long the workers were idle."""
    grasps = [Candidate(f"cube-{k:05d}", "cube", np.eye(4)) for k in range(160 * workers)]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "trials"
        job = Job("sleep", Make(TimedJudge(pause=TRIAL, trials=log)), grasps)
        for _ in executor.judge([job]):
            pass
        trials = [tuple(map(float, line.split())) for line in log.read_text().splitlines()]
    busy = sum(end - begin for _, begin, end in trials)
    by_process = [[t for t in trials if t[0] == process] for process in {t[0] for t in trials}]
    spans = [max(end for *_, end in own) - min(own)[1] for own in by_process]
    whole = max(end for *_, end in trials) - min(begin for _, begin, _ in trials)
    print(
        f"{name}, {workers} workers, {len(grasps)} grasps, {len(trials)} trials of {TRIAL} s:"
        f" {100 * (sum(spans) / busy - 1):.1f} % idle between trials,"
        f" {100 * (whole * workers / busy - 1):.1f} % from the first begin to the last end",
        flush=True,
    )


if __name__ == "__main__":
    main()
