"""A real local cluster of Dask, and what happens when parts of it fail."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_judge import CrashingJudge, KnownJudge, Make, MakeAndTell, expected, refuse

import burg_drake
from burg_drake.core import ClusterError, InvalidInputError, Outcome, start_worker
from burg_drake.evaluation import Candidate, Job, JobFailed, WorkerLimits
from burg_drake.scene import Scene
from burg_drake.station import Station

distributed = pytest.importorskip("distributed", reason="the cluster needs burg-drake[dask]")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

from burg_drake.evaluation import (  # noqa: E402
    NO_DASHBOARD,
    ClusterWorkers,
    DaskExecutor,
    LocalNodes,
    code_hash,
    connect_cluster,
    deciding_versions,
    make_bundle,
    require_same_versions,
    send_bundle,
    threads_by_address,
)
from tests.hang_guard import HANG_GUARD, until  # noqa: E402

LIMITS = WorkerLimits(cpu=0.25)


class Cluster:
    """Two workers, and an executor on them."""

    def __init__(self) -> None:
        self.nodes = LocalNodes(2)
        self.client = distributed.Client(
            self.nodes.address, set_as_default=False, timeout=HANG_GUARD
        )
        self.executor = DaskExecutor(self.client, LIMITS, self.nodes.restart_workers)

    @property
    def workers(self) -> dict[str, int]:
        """Those that the scheduler has."""
        return threads_by_address(self.client)

    def close(self) -> None:
        self.client.close(timeout=2)
        self.nodes.close()


@pytest.fixture(scope="module")
def clusters() -> Iterator[list[Cluster]]:
    made: list[Cluster] = []
    yield made
    for cluster in made:
        cluster.close()


@pytest.fixture
def cluster(clusters: list[Cluster], monkeypatch: pytest.MonkeyPatch) -> Cluster:
    """One for all tests; a new one if its scheduler has been killed."""
    monkeypatch.setattr("burg_drake.evaluation.cluster.dispatch.WORKER_POLL_INTERVAL", 0.2)
    if not clusters or clusters[-1].nodes.scheduler.poll() is not None:
        clusters.append(Cluster())
    return clusters[-1]


def grasps(n: int, scene: str = "cube") -> list[Candidate]:
    return [Candidate(f"{scene}-{i:04d}", scene, np.eye(4)) for i in range(n)]


def outcomes(answers: list[Any]) -> dict[str, Outcome]:
    assert len({grasp.id for _, grasp, _ in answers}) == len(answers)
    return {grasp.id: verdict.outcome for _, grasp, verdict in answers}


def executed(n: int) -> list[str]:
    """Ids of the first grasps that are executed."""
    return [c.id for c in grasps(200) if expected(c.id).value.startswith("lifted")][:n]


def test_jobs_are_judged_as_they_are_here(cluster: Cluster, tmp_path: Path) -> None:
    log = tmp_path / "built"
    jobs = [
        Job(name, MakeAndTell(KnownJudge(), log, name), grasps(n, name))
        for name, n in (("a", 70), ("empty", 0), ("b", 9))
    ]
    found = outcomes(list(cluster.executor.judge(jobs)))
    assert found == {g.id: expected(g.id) for job in jobs for g in job.candidates}
    built = [line.split() for line in log.read_text().splitlines()]
    assert len({tuple(line) for line in built}) == len(built)  # once a child
    assert len({process for _, process in built}) == 2


@pytest.mark.thorough
def test_faults_cost_only_the_grasps_that_cause_them(cluster: Cluster) -> None:
    kinds = ("segfault", "killed", "spin", "memory")
    how = dict(zip(executed(len(kinds)), kinds, strict=True))
    judge = CrashingJudge(how=tuple(how.items()))
    answers = list(cluster.executor.judge([Job("job", Make(judge), grasps(40))]))
    failed = dict.fromkeys(how, Outcome.SIMULATION_FAILED)
    assert outcomes(answers) == {g.id: expected(g.id) for g in grasps(40)} | failed
    reasons = {g.id: v.reason for _, g, v in answers if g.id in how}
    assert [reasons[id] for id in how] == [
        "the worker process was killed by SIGSEGV",
        "the worker process was killed from outside by SIGKILL",
        "took longer than 0.25 s of CPU time",
        "MemoryError",
    ]
    interrupted = [grasp.id for _, grasp, verdict in answers if verdict.interrupted]
    assert [how[id] for id in interrupted] == ["killed"]  # as if memory had run out


@pytest.mark.thorough
def test_a_bad_job_does_not_end_the_others(cluster: Cluster) -> None:
    jobs = [Job("bad", refuse, grasps(1, "bad")), Job("good", Make(KnownJudge()), grasps(5))]
    failed: list[JobFailed] = []
    found = outcomes(list(cluster.executor.judge(jobs, failed.append)))
    assert found == {g.id: expected(g.id) for g in grasps(5)}
    assert [(f.job.key, str(f.error)) for f in failed] == [("bad", "no such model")]
    with pytest.raises(InvalidInputError, match="no such model"):
        list(cluster.executor.judge(jobs[:1]))


@pytest.mark.thorough
def test_lost_workers_cost_nothing_but_a_grasp_at_which_several_are_lost(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.evaluation.cluster.jobs.ChunkSettings.max_losses", 2)
    (guilty,) = executed(1)
    judge = CrashingJudge(how=((guilty, "parent"),), pause=0.01)
    answers = list(cluster.executor.judge([Job("job", Make(judge), grasps(60))]))
    failed = {guilty: Outcome.SIMULATION_FAILED}
    assert outcomes(answers) == {g.id: expected(g.id) for g in grasps(60)} | failed
    verdict = next(v for _, g, v in answers if g.id == guilty)
    assert verdict.interrupted
    assert (
        verdict.reason
        == "2 workers of the cluster were lost while working on it, one after the other"
    )


@pytest.mark.thorough
def test_leaving_early_ends_the_children(cluster: Cluster, tmp_path: Path) -> None:
    log = tmp_path / "built"
    job = Job("job", MakeAndTell(KnownJudge(pause=0.05), log, "job"), grasps(400))
    judged = cluster.executor.judge([job])
    next(judged)
    children = [int(line.split()[1]) for line in log.read_text().splitlines()]
    assert children
    judged.close()
    until(lambda: not any(map(is_alive, children)))


def test_other_versions_are_refused(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker whose release of the package differs in one comment."""
    package = Path(burg_drake.__file__).parent
    shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("*.pyc"))
    with (tmp_path / package.name / "core/provenance.py").open("a") as file:
        file.write("# another release\n")
    with monkeypatch.context() as patch:
        patch.syspath_prepend(tmp_path)
        node, connection = start_worker("burg_drake.evaluation.cluster.node")
    try:
        connection.send(cluster.nodes.address)
        address = connection.recv()
        other = rf"^worker {address} has code of burg_drake \w{{12}} \(here \w{{12}}\); results"
        with pytest.raises(ClusterError, match=other):
            list(cluster.executor.judge([Job("job", Make(KnownJudge()), grasps(3))]))
    finally:
        node.kill()
        node.wait()
        connection.close()
    until(lambda: address not in cluster.workers)


def test_all_that_decides_about_verdicts_is_compared(tmp_path: Path) -> None:
    """The second engine, and the curves that confidences come from."""
    package = tmp_path / "burg_drake"
    shutil.copytree(Path(burg_drake.__file__).parent, package)
    ours = deciding_versions()
    assert code_hash(package) == ours["code of burg_drake"]
    with (package / "simulation/calibration.json").open("a") as file:
        file.write("\n")
    assert code_hash(package) != ours["code of burg_drake"]
    require_same_versions({"tcp://a": ours})
    with pytest.raises(ClusterError, match=rf"tcp://a has mujoco 1 \(here {ours['mujoco']}\)"):
        require_same_versions({"tcp://a": {**ours, "mujoco": "1"}})


def test_a_worker_that_can_be_reached_from_elsewhere_is_refused(cluster: Cluster) -> None:
    async def start() -> Any:
        beyond = {"contact_address": "tcp://203.0.113.9:40000", "host": "127.0.0.1"}
        return await distributed.Worker(cluster.nodes.address, nthreads=1, **beyond, **NO_DASHBOARD)

    worker = cluster.client.sync(start)
    try:
        with pytest.raises(ClusterError, match=r"^worker tcp://203.0.113.9:40000 is not encrypted"):
            list(cluster.executor.judge([Job("job", Make(KnownJudge()), grasps(3))]))
    finally:
        cluster.client.sync(worker.close)
    until(lambda: "tcp://203.0.113.9:40000" not in cluster.workers)


def test_a_scheduler_that_can_be_reached_from_elsewhere_is_refused(cluster: Cluster) -> None:
    async def start() -> Any:
        return await distributed.Scheduler(host="0.0.0.0", port=0, **NO_DASHBOARD)

    scheduler = cluster.client.sync(start)
    try:
        if scheduler.address.startswith("tcp://127."):
            pytest.skip("this machine has no other address")
        listens = rf"^the scheduler listens at {scheduler.address} is not encrypted"
        dialled = f"tcp://127.0.0.1:{scheduler.port}"
        with pytest.raises(ClusterError, match=listens), connect_cluster(dialled):
            pass
    finally:
        cluster.client.sync(scheduler.close)


DRIVER = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
import numpy as np
from known_judge import KnownJudge, MakeAndTell
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.cluster.dask_executor import connect_cluster
from burg_drake.evaluation.executor import Job
grasps = [Candidate(str(k), "cube", np.eye(4)) for k in range(400)]
with connect_cluster("local:1") as executor:
    job = Job("job", MakeAndTell(KnownJudge(pause=0.05), Path({log!r}), "job"), grasps)
    for answer in executor.judge([job]):
        print(answer[1].id, flush=True)
"""


@pytest.mark.thorough
@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="looks for processes in /proc")
def test_a_killed_driver_leaves_nothing_behind(tmp_path: Path) -> None:
    log = tmp_path / "built"
    program = DRIVER.format(tests=str(Path(__file__).parent), log=str(log))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as driver:
        assert driver.stdout is not None
        assert driver.stdout.readline()
        nodes = Path(f"/proc/{driver.pid}/task/{driver.pid}/children").read_text().split()
        children = [line.split()[1] for line in log.read_text().splitlines()]
        processes = [int(pid) for pid in (*nodes, *children)]
        assert len(nodes) == 2
        driver.send_signal(signal.SIGKILL)
    until(lambda: not any(map(is_alive, processes)))


@pytest.mark.thorough
def test_a_scheduler_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("burg_drake.evaluation.cluster.dask_executor.SCHEDULER_TIMEOUT", 1.0)
    reached = "^no Dask scheduler answered at tcp://127.0.0.1:9 within 1 s: nobody listens there"
    with pytest.raises(ClusterError, match=reached), connect_cluster("tcp://127.0.0.1:9"):
        pass


@pytest.mark.thorough
def test_a_scheduler_that_dies_is_said_in_one_line(
    cluster: Cluster, scene: Scene, station: Station
) -> None:
    nodes = cluster.nodes
    job = Job("job", Make(KnownJudge(pause=0.05)), grasps(200))
    answers = []
    lost = r"^the scheduler at tcp://127\S+ does not answer any more"
    with connect_cluster(nodes.address) as executor, connect_cluster(nodes.address) as other:
        with pytest.raises(ClusterError, match=lost):
            for answer in executor.judge([job]):
                answers.append(answer)
                nodes.scheduler.kill()
                nodes.scheduler.wait()
        other.client.rpc.timeout = 0.2
        with pytest.raises(ClusterError, match=lost):
            bundle = make_bundle(scene, station)
            send_bundle(other.client, bundle, "the scene", Counter(), ["tcp://127.0.0.1:9"])
    assert answers


@pytest.mark.thorough
def test_a_scheduler_that_dies_at_the_start_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After the first look at the workers."""
    nodes = LocalNodes(0)
    look = ClusterWorkers.update

    def look_and_kill(self: ClusterWorkers) -> list[Any]:
        lost = look(self)
        self._client.rpc.timeout = 0.2
        nodes.scheduler.kill()
        nodes.scheduler.wait()
        return lost

    monkeypatch.setattr(ClusterWorkers, "update", look_and_kill)
    try:
        lost = r"^the scheduler at tcp://127\S+ does not answer any more"
        with pytest.raises(ClusterError, match=lost), connect_cluster(nodes.address) as executor:
            list(executor.judge([Job("job", Make(KnownJudge()), grasps(3))]))
    finally:
        nodes.close()


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
