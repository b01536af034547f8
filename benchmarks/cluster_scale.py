"""A simulated cluster of many workers that sleep: what does it cost, and where is it full?

    python benchmarks/cluster_scale.py [--workers N] [--grasps N] [--seconds S ...]

The scheduler is a process of its own and so is the driver; all workers share a third one, and in
place of a child with Drake they sleep for as long as a grasp takes on average (`--seconds`). What
is sent is what is sent otherwise, and verdicts have the size of real ones. It prints, for each
time, how much longer it took than the workers slept, the CPU time of scheduler and driver a chunk,
the bytes a grasp there and back, and at how many workers the busier of the two would be busy all
the time if all chunks were whole. CPU times hold on a busy machine, too; how long it took does not.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import pickle
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "evaluation"))
from known_judge import KnownJudge, Make

from burg_drake.core import start_worker
from burg_drake.evaluation import (
    LOOPBACK,
    NO_DASHBOARD,
    Candidate,
    ChunkSettings,
    Job,
    JudgeRecipe,
    LocalNodes,
    WorkerLimits,
    connect_cluster,
    judge_grasp,
)
from burg_drake.evaluation.cluster import worker_tasks

IDLE = 10.0
"""For so long the scheduler is watched with nothing to do [s]."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=100)
    parser.add_argument("--grasps", type=int, default=96, help="a worker (default: %(default)s)")
    parser.add_argument("--seconds", type=float, nargs="+", default=[1.0, 0.3, 0.1, 0.03])
    arguments = parser.parse_args()
    sizes()
    nodes = LocalNodes(0)
    sleepers, connection = start_worker("cluster_scale")
    try:
        with connect_cluster(nodes.address) as executor:
            connection.send((nodes.address, arguments.workers))
            while executor.workers < arguments.workers:
                time.sleep(0.5)
            idle = idle_share(nodes.scheduler.pid)
            print(f"idle, the scheduler uses {100 * idle:.1f} % of a processor", flush=True)
            for seconds in arguments.seconds:
                measure(executor, nodes.scheduler.pid, idle, arguments, seconds)
    finally:
        sleepers.kill()
        nodes.close()


def idle_share(scheduler: int) -> float:
    """CPU time of the scheduler a second, with nothing to do but to hear of its workers."""
    begin, cpu = time.monotonic(), cpu_time(scheduler)
    time.sleep(IDLE)
    return (cpu_time(scheduler) - cpu) / (time.monotonic() - begin)


def measure(
    executor: Any, scheduler: int, idle: float, arguments: argparse.Namespace, seconds: float
) -> None:
    """Prints what one run costs.

    Args:
        executor: on the cluster.
        scheduler: its process.
        idle: see `idle_share`.
        arguments: of the command.
        seconds: that a grasp takes.
    """
    count = arguments.workers * arguments.grasps
    grasps = [Candidate(f"cube-{k:06d}", "cube", np.eye(4)) for k in range(count)]
    job = Job("sleep", Make(KnownJudge(pause=seconds)), grasps)
    begin, cpu = time.monotonic(), (cpu_time(scheduler), cpu_time(os.getpid()))
    judged = 0
    original = remote_chunks(executor)
    for _ in executor.judge([job]):
        judged += 1
    took = time.monotonic() - begin
    chunks = remote_chunks(executor) - original
    used = [
        cpu_time(pid) - before for pid, before in zip((scheduler, os.getpid()), cpu, strict=True)
    ]
    used[0] = max(0.0, used[0] - idle * took)
    ideal = seconds * arguments.grasps
    # with whole chunks, and what idle workers cost besides
    each = [
        u / chunks / (ChunkSettings.max_grasps * seconds) for u in used
    ]  # of a processor, a worker
    full = min(1.0 / (each[0] + idle / arguments.workers), 1.0 / each[1])
    print(
        f"{seconds:g} s a grasp: {judged} grasps in {chunks} chunks, {took:.1f} s for {ideal:.1f} s"
        f" a worker; CPU time of the scheduler {used[0]:.2f} s ({1e3 * used[0] / chunks:.1f} ms a"
        f" chunk), of the driver {used[1]:.2f} s ({1e3 * used[1] / chunks:.1f} ms a chunk);"
        f" with chunks of {ChunkSettings.max_grasps} grasps full at {full:,.0f} workers",
        flush=True,
    )


def remote_chunks(executor: Any) -> int:
    """Chunks that the workers have judged so far."""
    told = executor.client.run(_judged_here)
    return next(iter(told.values()), 0)  # they share a process


_judged = 0


def _judged_here() -> int:
    return sys.modules["cluster_scale"]._judged


def sizes() -> None:
    """Prints bytes a grasp, as Dask pickles them."""
    rng = np.random.default_rng(0)
    grasps = tuple(
        Candidate(f"cube-{k:06d}", "cube", rng.random((4, 4)))
        for k in range(ChunkSettings.max_grasps)
    )
    recipe = JudgeRecipe(pickle.dumps(Make(KnownJudge())))

    def size_with(grasps: tuple[Candidate, ...]) -> int:
        run, limits = "burg-drake-" + "0" * 32, WorkerLimits()
        return len(pickle.dumps(worker_tasks.GraspChunk(run, "", recipe, grasps, limits)))

    empty, there = size_with(()), size_with(grasps)
    back = len(pickle.dumps(worker_tasks.ChunkAnswers(answers(grasps))))
    print(
        f"a chunk of {ChunkSettings.max_grasps} grasps: {there} bytes there"
        f" ({empty} without grasps), {back} bytes back;"
        f" {there / ChunkSettings.max_grasps:.0f} and"
        f" {back / ChunkSettings.max_grasps:.0f} a grasp",
        flush=True,
    )


def answers(grasps: tuple[Candidate, ...]) -> list[tuple[int, Any]]:
    """Verdicts of the size of real ones."""
    judge = KnownJudge()
    return [(k, judge_grasp(judge, grasp)) for k, grasp in enumerate(grasps)]


def cpu_time(pid: int) -> float:
    """CPU time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main_of_sleepers(handle: int) -> None:
    """Runs workers that sleep."""
    import dask
    from distributed import Worker

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    # what each of many workers would do for itself takes most of the time of their one process
    dask.config.set({"distributed.worker.profile.enabled": False})
    dask.config.set({"distributed.admin.system-monitor.interval": "30s"})
    connection = Connection(handle)
    scheduler, count = connection.recv()

    def judge(self: Any, job: Job, limits: WorkerLimits) -> worker_tasks.ChunkAnswers:
        global _judged
        _judged += 1
        seconds: float = pickle.loads(job.make_judge.make_judge).judge.pause  # type: ignore[attr-defined]
        time.sleep(seconds * len(job.candidates))
        return worker_tasks.ChunkAnswers(answers(tuple(job.candidates)))

    worker_tasks.Supervisor.judge = judge  # type: ignore[method-assign]

    async def run() -> None:
        options = {"nthreads": 1, "memory_limit": 0, "host": LOOPBACK, **NO_DASHBOARD}
        workers = [Worker(scheduler, **options) for _ in range(count)]
        for worker in workers:
            await worker
        await asyncio.gather(*(worker.finished() for worker in workers))

    asyncio.run(run())


if __name__ == "__main__":
    main()
else:
    main = main_of_sleepers  # type: ignore[assignment]
