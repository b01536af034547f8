"""Functions that are called on the workers of a local cluster of Dask, and what fails meanwhile."""

from __future__ import annotations

import hashlib
import io
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from known_work import FILE, Known, square

import burg_drake
from burg_drake.core import BurgError, ClusterError, InvalidInputError, start_worker
from burg_drake.evaluation import Bundle, DaskExecutor, connect_cluster, map_on_cluster

distributed = pytest.importorskip("distributed", reason="the cluster needs burg-drake[dask]")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

from burg_drake.evaluation import (  # noqa: E402
    ClusterCall,
    LocalNodes,
    run_task,
    send_bundle,
    threads_by_address,
)
from tests.hang_guard import HANG_GUARD, until  # noqa: E402


@pytest.fixture(scope="module")
def nodes() -> Iterator[LocalNodes]:
    """Two workers."""
    made = LocalNodes(2)
    yield made
    made.close()


@pytest.fixture
def executor(nodes: LocalNodes, monkeypatch: pytest.MonkeyPatch) -> Iterator[DaskExecutor]:
    monkeypatch.setattr("burg_drake.evaluation.cluster.dispatch.WORKER_POLL_INTERVAL", 0.2)
    client = distributed.Client(nodes.address, set_as_default=False, timeout=HANG_GUARD)
    nodes.restart_workers()  # those that another test has killed
    until(lambda: len(threads_by_address(client)) == 2)
    yield DaskExecutor(client, maintain=nodes.restart_workers)
    client.close(timeout=2)


def bundle(text: str = "known") -> Bundle:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(zipfile.ZipInfo(FILE), text)
    return Bundle(hashlib.sha256(buffer.getvalue()).hexdigest(), buffer.getvalue(), "", "", "")


def same(work: Known) -> Known:
    return work


def squares(executor: DaskExecutor, work: list[Known], **changes: Any) -> dict[int, Any]:
    """Outcomes by the work's number, each of which comes once."""
    how = {"bundle": bundle(), "pack": same, **changes}
    found = list(map_on_cluster(executor, square, work, **how))
    assert len({one.number for one, _ in found}) == len(found)
    return {one.number: str(made) if isinstance(made, BurgError) else made for one, made in found}


def test_results_are_those_of_the_function(executor: DaskExecutor, tmp_path: Path) -> None:
    log = tmp_path / "log"
    text = str(tmp_path)  # of a bundle that no machine has
    work = [Known(k, pause=0.02, log=log) for k in range(12)]
    found = squares(executor, work, bundle=bundle(text))
    assert found == {k: (k * k, text) for k in range(12)}
    lines = [line.split() for line in log.read_text().splitlines()]
    assert sorted(int(number) for number, _ in lines) == list(range(12))
    assert len({process for _, process in lines}) == 2  # one child for each worker, which stays
    assert squares(executor, []) == {}


def test_faults_cost_only_the_work_that_causes_them(executor: DaskExecutor) -> None:
    faults = {1: "refuse", 2: "raise", 4: "segfault"}

    def pack(work: Known) -> Known:
        if work.number == 5:
            raise InvalidInputError("5 does not travel")
        return work

    work = [Known(k, faults.get(k, "")) for k in range(8)]
    assert squares(executor, work, pack=pack) == {
        **{k: (k * k, "known") for k in (0, 3, 6, 7)},
        1: "no square of 1",
        2: "ZeroDivisionError: by nothing",
        4: "the worker process was killed by SIGSEGV",
        5: "5 does not travel",
    }


def test_work_of_a_lost_worker_is_done_by_others(executor: DaskExecutor, tmp_path: Path) -> None:
    log = tmp_path / "log"
    work = [Known(k, "once" if k == 1 else "", log=log) for k in range(6)]
    assert squares(executor, work) == {k: (k * k, "known") for k in range(6)}
    begun = sorted(int(line.split()[0]) for line in log.read_text().splitlines())
    assert begun == [0, 1, 1, 2, 3, 4, 5]


@pytest.mark.thorough
def test_work_at_which_several_workers_are_lost_is_given_up(
    executor: DaskExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.evaluation.cluster.jobs.ChunkSettings.max_losses", 2)
    found = squares(executor, [Known(k, "parent" if k == 1 else "") for k in range(4)])
    assert found == {
        **{k: (k * k, "known") for k in (0, 2, 3)},
        1: "2 workers of the cluster were lost while working on it, one after the other",
    }


@pytest.mark.thorough
def test_leaving_early_ends_the_children(executor: DaskExecutor, tmp_path: Path) -> None:
    log = tmp_path / "log"
    work = [Known(0, log=log), Known(1, pause=60.0, log=log)]
    made = map_on_cluster(executor, square, work, bundle(), same)
    assert next(made) == (work[0], (0, "known"))
    until(lambda: len(log.read_text().splitlines()) == 2)
    made.close()
    children = [int(line.split()[1]) for line in log.read_text().splitlines()]
    until(lambda: not any(map(is_alive, children)))


@pytest.mark.thorough
def test_children_without_work_end(
    nodes: LocalNodes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when their driver was killed: nobody ends the run. The worker is a thread of this process,
    so that it sees the shorter time."""
    monkeypatch.setattr("burg_drake.evaluation.cluster.worker_tasks.CHILD_IDLE_TIMEOUT", 0.3)
    monkeypatch.setattr("burg_drake.evaluation.cluster.dispatch.Dispatch.end", lambda _: None)
    log = tmp_path / "log"
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as made,
        distributed.Client(made, set_as_default=False) as client,
    ):
        assert squares(DaskExecutor(client), [Known(3, log=log)]) == {3: (9, "known")}
        (child,) = (int(line.split()[1]) for line in log.read_text().splitlines())
        until(lambda: not is_alive(child))


@pytest.mark.thorough
def test_other_versions_are_refused(
    executor: DaskExecutor, nodes: LocalNodes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = Path(burg_drake.__file__).parent
    shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("*.pyc"))
    with (tmp_path / package.name / "core/provenance.py").open("a") as file:
        file.write("# another release\n")
    with monkeypatch.context() as patch:
        patch.syspath_prepend(tmp_path)
        node, connection = start_worker("burg_drake.evaluation.cluster.node")
    try:
        connection.send(nodes.address)
        address = connection.recv()
        other = rf"^worker {address} has code of burg_drake \w{{12}} \(here \w{{12}}\); results"
        with pytest.raises(ClusterError, match=other):
            squares(executor, [Known(1)])
    finally:
        node.kill()
        node.wait()
        connection.close()
    until(lambda: address not in threads_by_address(executor.client))


@pytest.mark.thorough
def test_a_bundle_that_never_arrives_is_told_of(
    executor: DaskExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = bundle("this one is unpacked, and another one is asked for")
    monkeypatch.setattr(
        "burg_drake.evaluation.cluster.dispatch.send_bundle",
        lambda client, _, *how: send_bundle(client, other, *how),
    )
    lost = r"^worker \S+ did not receive the files that its work needs: its files are not there"
    with pytest.raises(ClusterError, match=lost):
        squares(executor, [Known(1)], bundle=bundle("never"))


@pytest.mark.thorough
def test_a_scheduler_that_dies_is_said_in_one_line() -> None:
    nodes = LocalNodes(1)
    lost = r"^the scheduler at tcp://127\S+ does not answer any more"
    try:
        with (
            connect_cluster(nodes.address) as executor,
            pytest.raises(ClusterError, match=lost),
        ):
            work = [Known(k, pause=0.2) for k in range(50)]
            for _ in map_on_cluster(executor, square, work, bundle(), same):
                nodes.scheduler.kill()
                nodes.scheduler.wait()
    finally:
        nodes.close()


def test_a_call_without_its_run_is_not_made(executor: DaskExecutor) -> None:
    """Its driver has ended the run while the call was on its way."""
    assert squares(executor, [Known(1)]) == {1: (1, "known")}  # the bundle is there
    call = ClusterCall("a run that is over", bundle().name, b"")
    answers = [
        executor.client.submit(run_task, call, pure=False, workers=[address]).result(
            timeout=HANG_GUARD
        )
        for address in threads_by_address(executor.client)
    ]
    assert any(answer.ended for answer in answers)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
