"""Damaged files for every reader, for as long as one likes: `tests/fuzzing` without its bounds.

    python -m benchmarks.fuzz --minutes 10 --seed 1 --only grasps mesh

Each batch of files is read in a process of its own with limits of memory and CPU time, so that
crashes, hangs and bombs are found as well as wrong errors. Files that a reader fails on are kept,
with the seeds that make them; of failures that say the same, the first one is.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random

from tests.fuzzing.damage import damaged
from tests.fuzzing.readers import READERS, Reader, failure

BATCH = 400
"""Files that one process reads."""
MEMORY = 6 << 30
"""Bytes of address space that a process may have; reading needs up to 3 GiB."""
SECONDS = 120
"""Of CPU time for a batch."""


def main() -> int:
    """Fuzzes until the time is over; 1 if a reader failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=[""], help="readers whose names begin so")
    parser.add_argument("--failures", type=Path, default=Path("runs/fuzz"), help="where to keep")
    parser.add_argument("--batch", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.batch:
        name, seed, folder = arguments.batch
        return _read_batch(_called(name), int(seed), Path(folder))
    chosen = [r for r in READERS if r.name.startswith(tuple(arguments.only))]
    counts: Counter[str] = Counter()
    known: dict[tuple[str, str], int] = {}
    end, seed = time.monotonic() + 60.0 * arguments.minutes, arguments.seed
    while time.monotonic() < end:
        for reader in chosen:
            if time.monotonic() < end:
                _run_batch(reader, seed, arguments.failures, counts, known)
        seed += 1
    for reader in chosen:
        wrong = sum(n for (name, _), n in known.items() if name == reader.name)
        print(f"{reader.name:22} {counts[reader.name]:8} files {wrong:6} failures")
    return 1 if known else 0


def _called(name: str) -> Reader:
    return next(reader for reader in READERS if reader.name == name)


def _run_batch(
    reader: Reader,
    seed: int,
    kept: Path,
    counts: Counter[str],
    known: dict[tuple[str, str], int],
) -> None:
    """Reads a batch in a process of its own and prints what is new."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "benchmarks.fuzz"]
        command += ["--batch", reader.name, str(seed), folder]
        done = subprocess.run(command, capture_output=True, text=True, preexec_fn=_limit)
        lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        counts[reader.name] += lines[-1]["read"] if lines else 0
        failures = [line for line in lines if "what" in line]
        if done.returncode:
            last = (done.stderr.strip().splitlines() or [""])[-1]
            failures.append({"what": f"process ended with {done.returncode}: {last}", "file": None})
        for found in failures:
            kind = re.sub(r"[\d/]+|'[^']*'|\"[^\"]*\"", "*", found["what"])[:80]
            known[reader.name, kind] = known.get((reader.name, kind), 0) + 1
            if known[reader.name, kind] == 1:
                kept.mkdir(parents=True, exist_ok=True)
                name = f"{reader.name.replace(' ', '_')}-{seed}-{len(known)}-{reader.file}"
                source = Path(found["file"] or Path(folder) / reader.file)
                if source.exists():
                    shutil.copyfile(source, kept / name)
                print(f"{reader.name}, seed {seed}: {found['what']}\n  {kept / name}", flush=True)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))


def _read_batch(reader: Reader, seed: int, folder: Path) -> int:
    """Reads `BATCH` damaged files; prints failures and how many were read, as lines of JSON."""
    path, random = folder / reader.file, Random(f"{reader.name} {seed}")
    reader.make(path)
    content = path.read_bytes()
    for k in range(BATCH):
        path.write_bytes(damaged(content, reader.kind, random, folder))
        began = time.process_time()
        what = failure(reader, path)
        spent = time.process_time() - began
        if what is None and spent > 10.0:
            what = f"took {spent:.0f} s"
        if what is not None:
            copy = shutil.copyfile(path, folder / f"failure_{k}")
            print(json.dumps({"what": what, "file": str(copy)}), flush=True)
        if k % 10 == 9:
            print(json.dumps({"read": k + 1}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
