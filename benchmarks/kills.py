"""Kills of the driver and of workers at random moments: does the same table result?

    python benchmarks/kills.py [--kills N] [--verb evaluate|reach] [--mode MODE] [--grasps N]

Judges a small set undisturbed, and once more while processes are killed by SIGKILL: the driver or
one of its workers, after a random time; a driver that has died is started again. Then it compares:
rows but for CPU times, or, of `reach`, the files of the plans byte by byte, and that nothing half
written is left. A kill that comes too late counts as none.
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
from pathlib import Path

SLOWEST = 600.0
"""An attempt that takes longer has hung [s]."""
Content = dict[str, object]


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--verb", choices=("evaluate", "reach"), default="evaluate")
    parser.add_argument("--grasps", type=int, default=4, help="an object (default: %(default)s)")
    parser.add_argument("--mode", default="hand", help="of evaluate (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        start = time.monotonic()
        _wait(_start(arguments, place / "undisturbed"))
        usual = time.monotonic() - start
        print(f"undisturbed: {usual:.1f} s", flush=True)
        rng, killed = random.Random(arguments.seed), {"driver": 0, "worker": 0}
        while True:
            driver = _start(arguments, place / "killed")
            while sum(killed.values()) < arguments.kills:
                victim = rng.choice(("driver", "worker"))
                try:
                    driver.wait(rng.uniform(0.03, 0.3) * usual)
                    break
                except subprocess.TimeoutExpired:
                    workers = _children(driver.pid)
                    if victim == "worker":
                        if workers:
                            os.kill(rng.choice(workers), signal.SIGKILL)
                            killed["worker"] += 1
                        continue
                    killed["driver"] += 1
                    driver.kill()
                    driver.wait()
                    break
            code = _wait(driver)
            if code == 0 and sum(killed.values()) >= arguments.kills:
                break
            if code == 0:  # it came through: begin anew, and go on killing
                _compare(arguments.verb, place)
                shutil.rmtree(place / "killed")
        _compare(arguments.verb, place)
        print(f"killed {killed['driver']} drivers and {killed['worker']} workers: no difference")


def _start(arguments: argparse.Namespace, out: Path) -> subprocess.Popen[bytes]:
    verb = [arguments.verb, "tabletop_six", "--grasps-per-object", str(arguments.grasps)]
    where = ["-o", str(out), "--mode", arguments.mode]
    if arguments.verb == "reach":
        where = ["--plans", str(out)]
    options = ["--workers", str(arguments.workers), "--quiet"]
    program = "from burg_drake.apps.cli import main; raise SystemExit(main())"
    return subprocess.Popen(
        [sys.executable, "-c", program, *verb, *where, *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _wait(process: subprocess.Popen[bytes]) -> int:
    try:
        return process.wait(SLOWEST)
    finally:
        process.kill()


def _children(pid: int) -> list[int]:
    try:
        texts = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:
        return []
    return sorted(int(child) for text in texts for child in text.split())


def _compare(verb: str, place: Path) -> None:
    whole, killed = (_content(verb, place / name) for name in ("undisturbed", "killed"))
    different = [name for name in {*whole, *killed} if whole.get(name) != killed.get(name)]
    hidden = [path.name for path in (place / "killed").iterdir() if path.name.startswith(".")]
    if different or hidden:
        raise SystemExit(f"they differ: {sorted(different)}; left behind: {hidden}")
    print(f"the same {len(whole)} {'rows' if verb == 'evaluate' else 'files'}", flush=True)


def _content(verb: str, folder: Path) -> Content:
    """What must be the same."""
    if verb == "reach":
        files = (path for path in folder.iterdir() if path.name != "journal.jsonl")
        return {path.name: path.read_bytes() for path in files if not path.name.startswith(".")}
    with (folder / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        row["id"]: {name: cell for name, cell in row.items() if not name.startswith("cpu_")}
        for row in rows
    }


if __name__ == "__main__":
    main()
