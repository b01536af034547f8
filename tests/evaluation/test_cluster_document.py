"""What --cluster takes, and what it refuses, before Dask is even looked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import BurgError, ClusterError, DocumentError, InvalidInputError
from burg_drake.evaluation import (
    ClusterDocument,
    jobqueue_parameters,
    read_cluster,
    require_safe_address,
)


def document(folder: Path, text: str) -> str:
    path = folder / "cluster.yaml"
    path.write_text(f"version: 1\n{text}")
    return str(path)


def test_short_forms() -> None:
    assert read_cluster("local:4") == 4
    found = read_cluster("tls://head.example.org:8786")
    assert isinstance(found, ClusterDocument)
    assert found.address == "tls://head.example.org:8786"
    for text, message in (
        ("local:0", "local:0 has no workers; give local:1 or more"),
        (
            "head:8786",
            "'head:8786' is not a cluster; give local:N, tls://HOST:PORT or a cluster.yaml",
        ),
        ("http://head", "'http://head' is not an address of a scheduler; write tls://HOST:PORT"),
        (
            "tls://head:99999",
            "tls://head:99999: there is no port 99999; ports go from 1 to 65535",
        ),
        ("missing.yaml", "missing.yaml does not exist"),
    ):
        with pytest.raises(BurgError) as refused:
            read_cluster(text)
        assert str(refused.value) == message


@pytest.mark.parametrize("host", ["10.0.0.1", "head.example.org", "[2001:db8::1]", "0.0.0.0"])
def test_plain_tcp_beyond_this_machine_is_refused(host: str) -> None:
    with pytest.raises(ClusterError, match="is not encrypted"):
        require_safe_address(f"tcp://{host}:8786")
    require_safe_address(f"tls://{host}:8786")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "localhost", "[::1]"])
def test_plain_tcp_on_this_machine_is_taken(host: str) -> None:
    require_safe_address(f"tcp://{host}:8786")


def test_files_are_found_beside_the_document(tmp_path: Path) -> None:
    for name in ("ca", "cert", "key"):
        (tmp_path / f"{name}.pem").touch()
    tls = "tls: {ca: ca.pem, cert: cert.pem, key: key.pem}\n"
    found = read_cluster(document(tmp_path, f"address: tls://head:8786\n{tls}"))
    assert isinstance(found, ClusterDocument) and found.tls is not None
    assert found.tls.key == str(tmp_path / "key.pem")
    with pytest.raises(DocumentError, match=r"address is tcp://127.0.0.1:1, but tls files"):
        read_cluster(document(tmp_path, f"address: tcp://127.0.0.1:1\n{tls}"))


def test_a_batch_system(tmp_path: Path) -> None:
    queue = "jobqueue: {kind: slurm, workers: 8, memory: 32GB, directives: [--qos=low]}\n"
    found = read_cluster(document(tmp_path, f"{queue}adapt: {{maximum: 40}}\n"))
    assert isinstance(found, ClusterDocument)
    assert found.jobqueue is not None
    told = jobqueue_parameters(found.jobqueue)
    assert (told["cores"], told["processes"], told["memory"]) == (8, 8, "32GB")
    assert told["protocol"] == "tls://"
    assert told["job_extra_directives"] == ["--qos=low"]
    assert "walltime" not in told
    for text, message in (
        (queue, "give either scale or adapt with a jobqueue"),
        (f"{queue}address: tls://a:1\nscale: 2\n", "give either address or jobqueue"),
        (
            "address: tls://a:1\nscale: 2\n",
            "scale and adapt belong to a jobqueue, which is missing",
        ),
        (f"{queue}scale: 0\n", "scale is 0; give 1 or more"),
        (f"{queue}adapt: {{minimum: 3, maximum: 2}}\n", "adapt from 3 to 2 jobs"),
        (queue.replace("slurm", "slrum"), "slurm"),
        (queue.replace("memory", "memori"), "memory"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            read_cluster(document(tmp_path, text))
