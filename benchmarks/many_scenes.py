"""How long it takes to open, summarise, watch and merge a run over many scenes.

The run is synthetic: scenes that differ in one pose, random grasps, random verdicts with the
margins of real ones; it is written by the program's own writers, without reports and tables.

    python benchmarks/many_scenes.py --scenes 1000 --grasps 1000 --merge -o /tmp/many
"""

from __future__ import annotations

import argparse
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from burg_drake.core import GraspSet, MarginNames, Outcome, Verdict
from burg_drake.evaluation import (
    JOURNAL_FILE,
    Campaign,
    Candidates,
    EvaluationSettings,
    PartWriter,
    RunRequest,
    SceneState,
    SceneStates,
    Shard,
    campaign_document,
    create_run,
    encode_verdict,
    load_campaign,
    read_scenes,
    run_hash,
    save_campaign,
)
from burg_drake.scene import Scene, load_scene
from burg_drake.station import load_station

T = TypeVar("T")
OUTCOMES = (Outcome.LIFTED, Outcome.SLIPPED, Outcome.COLLISION_TABLE, Outcome.LIFT_LINE)


def scenes_of(count: int) -> list[Scene]:
    """Scenes that differ in the place of the first object."""
    scene = load_scene("tabletop_six")
    first, *others = scene.document.instances
    found = []
    for k in range(count):
        x, y, z = first.X_SO.translation
        moved = replace(first, X_SO=replace(first.X_SO, translation=(x + 1e-5 * k, y, z)))
        document = replace(scene.document, name=f"scene_{k:05d}", instances=(moved, *others))
        found.append(Scene(document, scene.library, scene.path))
    return found


def grasps_of(scene: Scene, count: int, rng: np.random.Generator) -> Candidates:
    """Random poses on the objects of a scene."""
    q = rng.standard_normal((count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    X = np.zeros((count, 4, 4))
    X[:, :3, :3] = np.moveaxis(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        ),
        2,
        0,
    )
    X[:, :3, 3], X[:, 3, 3] = rng.normal(0, 0.03, (count, 3)), 1
    names = list(scene.instances)
    instance = np.array(sorted(names[k % len(names)] for k in range(count)))
    objects = np.array([scene.instances[name].object for name in instance])
    return Candidates(GraspSet.create(X, object=objects, width=0.04), instance)


def write(folder: Path, scenes: int, grasps: int, shard: Shard | None) -> Campaign:
    """Writes a run, or the share of it that a shard has."""
    station = load_station("panda_tabletop")
    settings = EvaluationSettings(mode="reach", grasps_per_object=grasps // 6, shard=shard)
    request = RunRequest.of(station, settings)
    loaded = scenes_of(scenes)
    found = read_scenes(loaded)
    folder.mkdir(parents=True)
    campaign = save_campaign(Campaign(folder, campaign_document(found, request)))
    by_name = dict(zip((entry.name for entry in found.entries), loaded, strict=True))
    scene_states = SceneStates(folder)
    writer = PartWriter(campaign)
    for name in campaign.names:
        rng = np.random.default_rng(int(name[-5:]))
        scene = by_name[name]
        run_folder = campaign.folder(name)
        document = replace(request, shard=None).document(run_folder, scene)
        candidates = grasps_of(scene, grasps, rng)
        counts = dict.fromkeys((i.object for i in scene.instances.values()), grasps // 6)
        told = replace(
            document.grasps, count=grasps, objects=counts, content=candidates.content, cpu=5.0
        )
        document = replace(document, grasps=told)
        document = replace(document, hash=run_hash(document))
        run = create_run(run_folder, document, scene, station, candidates)
        names = list(scene.instances)
        lines = [encode_verdict(id, verdict(rng, names)) for id in candidates.id]
        (run_folder / JOURNAL_FILE).write_bytes(b"".join(lines))
        size = sum(map(len, lines))
        state = SceneState(scene=name, state="done", run=document.hash, grasps=grasps, mine=grasps)
        scene_states.note(replace(state, sampling=5.0, size=size))
        writer.add_rows(name, run)
    writer.close()
    return load_campaign(folder)


def verdict(rng: np.random.Generator, names: list[str]) -> Verdict:
    """A random verdict."""
    outcome = OUTCOMES[rng.integers(len(OUTCOMES))]
    values = rng.random(len(MarginNames.all) + 20)
    executed = outcome in (Outcome.LIFTED, Outcome.SLIPPED)
    return Verdict(
        outcome,
        outcome.stage,
        blocker="" if executed else "table",
        margins=dict(zip(MarginNames.all, values.tolist(), strict=False)),
        displacements=dict(zip(names, values.tolist(), strict=False)) if executed else {},
        q_grasp=tuple(values[-7:].tolist()) if executed else (),
        q_pregrasp=tuple(values[-14:-7].tolist()) if executed else (),
        cpu={outcome.stage: float(values[0])},
    )


def timed(what: str, work: Callable[[], T]) -> T:
    """Does something and prints how long it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{what}: {wall:.2f} s, {cpu:.2f} s CPU, peak {peak:.2f} GiB", flush=True)
    return found


def ask(folder: Path) -> None:
    """What a fresh process is asked for."""
    from burg_drake.evaluation import read_results, summarize

    campaign = timed("open", lambda: load_campaign(folder))
    summary = timed("summarise", lambda: summarize(campaign))
    print(f"{summary.total.judged:,} grasps in {len(summary.scenes):,} scenes")
    timed("outcome", lambda: read_results(folder, ["outcome"]))
    timed("status", lambda: __import__("burg_drake").read_status(folder))
    timed("frame of 6 columns", lambda: campaign.frame(["id", "outcome", "slip", "x", "y", "z"]))


def main() -> None:
    """Writes the run if it is not there, and asks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--grasps", type=int, default=1000)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--ask", action="store_true", help="of the run that is there")
    parser.add_argument("--merge", action="store_true", help="of two shards, too")
    arguments = parser.parse_args()
    whole = arguments.output / "whole"
    if arguments.ask:
        ask(whole)
        return
    if not whole.exists():
        size = arguments.scenes, arguments.grasps
        timed("write", lambda: write(whole, *size, None))
        for k in (1, 2) if arguments.merge else ():
            write(arguments.output / f"shard{k}", *size, Shard(k, 2))
    journals = sum(path.stat().st_size for path in whole.glob("scenes/*/journal.jsonl"))
    parts = sum(path.stat().st_size for path in (whole / "parts").iterdir())
    print(f"journals {journals / 2**20:,.0f} MiB, parts {parts / 2**20:,.0f} MiB")
    command = [sys.executable, __file__, "--ask", "-o", str(arguments.output)]
    subprocess.run(command, check=True)
    if not arguments.merge:
        return
    from burg_drake.evaluation import merge_runs

    merged = arguments.output / "merged"
    shutil.rmtree(merged, ignore_errors=True)
    shards = [arguments.output / f"shard{k}" for k in (1, 2)]
    timed("merge of 2 shards", lambda: merge_runs(shards, merged))


if __name__ == "__main__":
    main()
