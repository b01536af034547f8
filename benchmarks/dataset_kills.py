"""Kills of all processes at random moments: is any sample of a data set lost, doubled or other?

    python benchmarks/dataset_kills.py [--samples N] [--kills N] [--views N] [--workers N]

Makes a data set undisturbed, and once more while every process of the command, the driver and its
workers, is killed by SIGKILL after a random time; the same command is run again until it is done.
Then it compares: keys, number of samples, every byte of shards, scenes and index, and that nothing
half written is left. Images are small and looks plain, so that many samples take little time; what
a kill can hurt is the same. A command that comes through before all kills are done is compared,
and its folder begun anew.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from burg_drake.dataset import load_dataset

SIZE = (64, 48)
RECIPE = f"version: 1\nsensor: d435\nsize: [{SIZE[0]}, {SIZE[1]}]\nlooks: null\n"
SCENES = ("tabletop_six", "tabletop_close")
PROGRAM = "from burg_drake.apps.cli import main; raise SystemExit(main())"
SLOWEST = 6 * 3600.0
"""An attempt that takes longer has hung [s]."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=10_000, help="(default: %(default)s)")
    parser.add_argument("--kills", type=int, default=10, help="(default: %(default)s)")
    parser.add_argument("--views", type=int, default=50, help="of a scene (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the times of kills")
    asked = parser.parse_args()
    if asked.samples % asked.views:
        parser.error(f"--samples {asked.samples} is not a multiple of --views {asked.views}")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "recipe.yaml").write_text(RECIPE)
        print(
            f"{asked.samples} samples, {asked.views} of a scene, {SIZE[0]} x {SIZE[1]} pixels,"
            f" plain looks, {asked.workers} workers",
            flush=True,
        )
        start = time.monotonic()
        process, first = begun(asked, place, "whole"), 0.0
        while process.poll() is None and not first:
            time.sleep(0.1)
            first = (time.monotonic() - start) * any(place.glob("whole/shards/[0-9]*.tar"))
        if finished(process) != 0:
            raise SystemExit("the undisturbed command failed")
        usual = time.monotonic() - start
        print(
            f"undisturbed: {usual:.0f} s, the first scene after {first:.0f} s; content"
            f" {content(place / 'whole')[:16]}",
            flush=True,
        )
        kill_and_continue(asked, place, first + (usual - first) / max(asked.kills, 1))


def kill_and_continue(asked: argparse.Namespace, place: Path, mean: float) -> None:
    """Makes the data set with kills, each so long after a start, on average [s]."""
    rng, kills, attempts = random.Random(asked.seed), 0, 0
    killed = place / "killed" / "whole"  # of the same name, which is in the index
    while True:
        process = begun(asked, place, "killed/whole")
        attempts += 1
        if kills < asked.kills:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(rng.uniform(0.0, 2.0) * mean)
            if process.poll() is None:
                kill_all(process)
                kills += 1
                there = len(list(killed.glob("shards/[0-9]*.tar")))
                print(f"  kill {kills}: {there} scenes are there", flush=True)
                continue
        if (code := finished(process)) != 0:
            raise SystemExit(f"attempt {attempts} ended with {code}")
        compare(asked, place / "whole", killed)
        if kills >= asked.kills:
            print(f"{kills} kills, {attempts} attempts: no difference")
            return
        shutil.rmtree(killed)


def begun(asked: argparse.Namespace, place: Path, name: str) -> subprocess.Popen[bytes]:
    """Starts the command as the leader of a group of processes."""
    names = [SCENES[k % 2] for k in range(asked.samples // asked.views)]
    (place / name).parent.mkdir(exist_ok=True)
    command = ["dataset", "generate", "--scenes", *names, "--views", str(asked.views)]
    how = ["--recipe", str(place / "recipe.yaml"), "--workers", str(asked.workers), "--quiet"]
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *command, *how, "-o", str(place / name)],
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )


def finished(process: subprocess.Popen[bytes]) -> int:
    """Its exit code."""
    try:
        return process.wait(SLOWEST)
    finally:
        process.kill()


def kill_all(process: subprocess.Popen[bytes]) -> None:
    """Kills the command's group, and those of its workers, each of which leads one."""
    workers = []
    for path in Path(f"/proc/{process.pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            workers += [int(pid) for pid in path.read_text().split()]
    for group in (process.pid, *workers):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(group, signal.SIGKILL)
    process.wait()


def compare(asked: argparse.Namespace, whole: Path, killed: Path) -> None:
    """Ends the program if anything differs."""
    keys = load_dataset(killed).keys
    wanted = [
        f"{scene:06d}_{view:03d}"
        for scene in range(asked.samples // asked.views)
        for view in range(asked.views)
    ]
    if list(keys) != wanted:
        lost, doubled = sorted({*wanted} - {*keys}), len(keys) - len({*keys})
        raise SystemExit(f"lost: {lost}; doubled: {doubled}; {len(keys)} samples")
    hidden = [str(path) for path in killed.rglob(".*")]
    sums = content(whole), content(killed)
    if hidden or sums[0] != sums[1]:
        raise SystemExit(f"contents {sums}; left behind: {hidden}")
    print(f"  {len(keys)} samples, none lost, none doubled; content {sums[1][:16]} is the same")


def content(folder: Path) -> str:
    """Hash of all shards, scenes and the index, with their names."""
    digest = hashlib.sha256()
    for path in sorted([*folder.glob("s*/*"), folder / "index.json"]):
        digest.update(f"{path.relative_to(folder)} {path.stat().st_size}\n".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


if __name__ == "__main__":
    main()
