"""The file that planners copy: files, messages, programs and servers without burg_drake."""

from __future__ import annotations

import ast
import os
import signal
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection, serve

from burg_drake.benchmark import Observation, burg_planner
from tests.benchmark.planner_programs import (
    ANSWERS,
    COPIED,
    command,
    observation,
    same,
    served,
    write_program,
)
from tests.hang_guard import HANG_GUARD


def through_file(arrays: dict[str, Any], folder: Path) -> dict[str, Any]:
    burg_planner.write_arrays(folder / "arrays.npz", arrays)
    return burg_planner.read_arrays(folder / "arrays.npz")


def through_message(arrays: dict[str, Any], folder: Path) -> dict[str, Any]:
    return burg_planner.unpack_message(burg_planner.pack_message(arrays))


WAYS = pytest.mark.parametrize("way", [through_file, through_message])


@WAYS
def test_arrays_arrive_to_the_bit(way: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    found = way(ANSWERS, tmp_path)
    assert found.keys() == ANSWERS.keys()
    for name, value in ANSWERS.items():
        assert same(found[name], value), name
    found["score"][0] = 7.0  # planners may work in place


@WAYS
def test_an_observation_arrives_to_the_bit(
    way: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    sent = observation(target=3)
    found = Observation.from_arrays(way(sent.arrays(), tmp_path))
    assert found.arrays().keys() == sent.arrays().keys()
    for name, value in sent.arrays().items():
        assert same(found.arrays()[name], value), name
    assert found.hand == sent.hand
    depth_only = {k: v for k, v in sent.arrays().items() if k not in ("color", "target")}
    found = Observation.from_arrays(way(depth_only, tmp_path))
    assert found.color is None and found.target is None


@WAYS
@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([[1.0], [1.0, 2.0]], "score cannot be made an array"),
        ({"a": 1}, "score is dict"),
        (["a", "b"], "score is list"),
        (np.array([1j]), "score is ndarray"),
        (object(), "score is object"),
    ],
)
def test_what_is_no_number_is_not_sent(
    way: Callable[..., dict[str, Any]], value: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(TypeError, match=message):
        way({"score": value}, tmp_path)


@WAYS
def test_lists_and_numbers_of_numpy_are_sent(
    way: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    sent = {"score": [1, 2.5], "time": np.float32(0.5), "count": np.int64(3), "is": np.True_}
    found = way(sent, tmp_path)
    assert same(found.pop("score"), np.array([1.0, 2.5]))
    assert found == {"time": 0.5, "count": 3, "is": True}
    assert [type(value) for value in found.values()] == [float, int, bool]


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "answer.npz"
    with pytest.raises(FileNotFoundError):
        burg_planner.read_arrays(path)
    burg_planner.write_arrays(path, ANSWERS)
    whole = path.read_bytes()
    objects = tmp_path / "objects.npz"
    np.savez(objects, X_CG=np.array([{}], dtype=object))
    single = tmp_path / "single.npy"
    np.save(single, np.eye(4))
    flipped = bytearray(whole)
    flipped[whole.index(ANSWERS["X_CG"].tobytes()) + 5] ^= 0xFF
    contents = (b"", b"nonsense", whole[:100], whole[:-30], flipped, objects.read_bytes())
    for content in (*contents, single.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"answer\.npz is not a file of arrays"):
            burg_planner.read_arrays(path)


def array_map(dtype: Any = "<f8", shape: Any = (2,), data: Any = bytes(16)) -> dict[str, Any]:
    return {"dtype": dtype, "shape": shape, "data": data}


@pytest.mark.parametrize(
    "value",
    [
        array_map(shape=[3]),
        array_map(shape=[-1]),
        array_map(shape=[2**62, 2**62]),
        array_map(shape=[1, 2.0]),
        array_map(shape=[1] * 40 + [2]),
        array_map(shape=2),
        array_map(shape=[True, 2]),
        array_map(data=bytes(15)),
        array_map(data="text"),
        array_map(data=None),
        array_map(dtype="O"),
        array_map(dtype="|O"),
        array_map(dtype="<U4"),
        array_map(dtype="<f8,<f8", data=bytes(32)),
        array_map(dtype="(1000000000,)f8"),
        array_map(dtype="<f3"),
        array_map(dtype=["<f8"]),
        array_map(dtype="<M8"),
        {"of": {"a": "map"}, "and": {}},
        [[], [[1]]],
        ["text"],
        msgpack.ExtType(5, b"x"),
        msgpack.Timestamp(1),
    ],
    ids=str,
)
def test_arrays_that_are_none_are_refused(value: Any) -> None:
    with pytest.raises(ValueError, match="the message cannot be read"):
        burg_planner.unpack_message(msgpack.packb({"X_CG": value}))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        burg_planner.pack_message(ANSWERS)[:-3],
        burg_planner.pack_message(ANSWERS) + b"\0",
        b"\x81\xa1a" * 1000,
        b"\xdf\xff\xff\xff\xff",
        b"\x81\xa1a\xc6\xff\xff\xff\xff",
        msgpack.packb({5: 1}),
        msgpack.packb([1, 2]),
        msgpack.packb(1.0),
        msgpack.packb({f"entry_{k}": 0 for k in range(1000)}),
        "text",
    ],
)
def test_messages_that_are_none_are_refused(data: Any) -> None:
    with pytest.raises(ValueError, match="the message"):
        burg_planner.unpack_message(data)


@pytest.mark.parametrize("many", [b"\x80", b"\x90", b"\x91\x90", b"\x81\xa0\x80"])
def test_small_parts_do_not_fill_the_memory(many: bytes) -> None:
    """A few megabytes of empty maps and lists would take a hundred times as much."""
    import tracemalloc

    parts = b"\xdd" + struct.pack(">I", 1 << 20) + many * (1 << 20)
    nested = msgpack.packb([0] * 8)[:1] + (msgpack.packb([0] * 8)[:1] + many * 8) * 8
    for data in (b"\x81\xa1a" + parts, b"\x81\xa1a" + nested):
        tracemalloc.start()
        with pytest.raises(ValueError):
            burg_planner.unpack_message(data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2 * len(data) + 100_000


def test_an_answer_gets_time_and_observation() -> None:
    def plan(asked: Observation) -> dict[str, Any]:
        time.sleep(0.05)
        return {"X_CG": np.zeros((0, 4, 4)), "score": None}

    answer = burg_planner.answer_observation(plan, observation(7))
    assert answer.keys() == {"X_CG", "time", "observation"}
    assert 0.05 <= answer["time"] < 5.0 and answer["observation"].endswith("7")
    own = burg_planner.answer_observation(
        lambda _: {"time": 0.25, "observation": "x"}, observation()
    )
    assert own == {"time": 0.25, "observation": "x"}
    with pytest.raises(TypeError, match="the planner returned list, not a dict with grasps"):
        burg_planner.answer_observation(lambda _: [], observation())  # type: ignore[arg-type, return-value]


def test_an_error_names_the_line_of_the_planner() -> None:
    def plan(asked: Observation) -> dict[str, Any]:
        return {"X_CG": np.linalg.inv(np.zeros((3, 3)))}

    with pytest.raises(np.linalg.LinAlgError) as raised:
        burg_planner.answer_observation(plan, observation())
    line = plan.__code__.co_firstlineno + 1
    text = f"LinAlgError: Singular matrix ({Path(__file__).name}:{line})"
    assert burg_planner.describe_error(raised.value) == text
    assert burg_planner.describe_error(ValueError("two\nlines")) == "ValueError: two lines"


def test_the_copied_file_runs_in_old_environments() -> None:
    """Planners of this field need Pythons from 3.8 on, without other packages."""
    tree = ast.parse(COPIED.read_text(encoding="utf-8"), feature_version=(3, 8))
    names = {
        alias.name for node in tree.body if isinstance(node, ast.Import) for alias in node.names
    } | {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
    standard = {"argparse", "hashlib", "io", "json", "math", "queue", "re", "socket", "sys"}
    standard |= {"threading", "time", "traceback", "dataclasses", "pathlib", "typing"}
    assert names == standard | {"__future__", "importlib.metadata", "numpy"}
    assert "kw_only" not in COPIED.read_text(encoding="utf-8")  # of dataclasses, from 3.10 on


def test_a_program_answers_by_files(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    files = [str(tmp_path / "in.npz"), str(tmp_path / "out.npz")]
    asked = observation()
    burg_planner.write_arrays(files[0], asked.arrays())
    subprocess.run([*command(path), *files], check=True, timeout=HANG_GUARD)
    answer = burg_planner.read_arrays(files[1])
    modules = answer["modules"].split()
    assert "burg_planner" in modules
    assert not {"burg_drake", "msgpack", "websockets"} & set(modules)
    for name, value in asked.arrays().items():
        assert same(answer[f"seen_{name}"], value), name
    assert answer["observation"] == asked.id and "width" not in answer

    for wrong in ([], files[:1], [*files, "--port", "1"], [*files, "third"]):
        done = subprocess.run([*command(path), *wrong], capture_output=True, text=True)
        assert done.returncode == 2 and "give --port, or the file of an observation" in done.stderr


def test_a_server_answers_to_the_bit(tmp_path: Path) -> None:
    asked = observation()
    with served(write_program(tmp_path)) as (url, process):
        with burg_planner.RemotePlanner(url) as planner:
            assert planner.name == "my_planner"
            answer = planner.plan(asked)
            assert "burg_drake" not in answer["modules"].split()
            for name, value in asked.arrays().items():
                assert same(answer[f"seen_{name}"], value), name
            assert answer["observation"] == asked.id and "width" not in answer
            for target, error in (
                (1, r"ValueError: no object at all \(my_planner.py:7\)"),
                (4, "TypeError: the planner returned NoneType, not a dict with grasps"),
            ):
                with pytest.raises(RuntimeError, match=error):
                    planner.plan(observation(target))
            assert planner.plan(asked)["pid"] == answer["pid"] == process.pid
        assert "no object\nat all" in (tmp_path / "stderr.txt").read_text()


def test_what_clients_do_does_not_harm_others(tmp_path: Path) -> None:
    """Texts, nonsense, leaving before the answer, several at once, pages of web sites."""
    with served(write_program(tmp_path)) as (url, _), burg_planner.RemotePlanner(url) as planner:
        with connect(url, compression=None) as rude:
            rude.recv()
            for message, error in (
                ("text", "ValueError: the message is a text; msgpack is expected"),
                (b"\xc1", "ValueError: the message cannot be read"),
                (burg_planner.pack_message({"hand": "{}"}), "KeyError: 'id'"),
                (burg_planner.pack_message({"hand": "[", "id": "x"}), "JSONDecodeError"),
            ):
                rude.send(message)
                assert burg_planner.unpack_message(rude.recv(HANG_GUARD))["error"].startswith(error)
        for _ in range(3):  # leave before the answer
            with connect(url, compression=None, close_timeout=0.0) as hasty:
                hasty.recv()
                hasty.send(burg_planner.pack_message(observation(5).arrays()))
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, origin="http://somewhere.example")  # type: ignore[arg-type]
        with burg_planner.RemotePlanner(url) as other:
            answers: list[dict[str, Any]] = []
            thread = threading.Thread(target=lambda: answers.append(other.plan(observation(5))))
            thread.start()
            assert planner.plan(observation())["observation"] == observation().id
            thread.join(HANG_GUARD)
            assert answers[0]["observation"] == observation(5).id


@pytest.mark.parametrize("target", [0, 3], ids=["idle", "at work"])
def test_an_interrupt_ends_a_server(target: int, tmp_path: Path) -> None:
    """Even while a client is connected, and while the planner works."""
    with served(write_program(tmp_path)) as (url, process), connect(url) as client:
        client.recv()
        if target:
            client.send(burg_planner.pack_message(observation(target).arrays()))
            time.sleep(0.3)
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(HANG_GUARD) == 130
        assert time.monotonic() - begun < 20.0
        assert (tmp_path / "stderr.txt").read_text() == ""


def test_a_port_in_use_is_one_line(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = subprocess.run(
            [*command(path), "--port", str(port)],
            capture_output=True,
            text=True,
            timeout=HANG_GUARD,
        )
    assert done.returncode == 1
    assert done.stderr.startswith(f"cannot listen on port {port} of 127.0.0.1: Address already in")
    assert done.stderr.count("\n") == 1


@contextmanager
def misbehaving(talk: Callable[[ServerConnection], None], **options: Any) -> Iterator[str]:
    """A server in this process whose connections are handled by a function; its address."""
    with serve(talk, "127.0.0.1", 0, **options) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"


GREETING = burg_planner.pack_message(
    {
        "protocol": burg_planner.PROTOCOL_NAME,
        "version": burg_planner.PROTOCOL_VERSION,
        "name": "bad",
    }
)


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ("hello", "the message is a text"),
        (
            burg_planner.pack_message({"protocol": "chat"}),
            "is not a planner: it sends no 'burg_drake.planner'",
        ),
        (
            burg_planner.pack_message({"protocol": burg_planner.PROTOCOL_NAME, "version": 99}),
            "has version 99 of the protocol, this is 1; copy burg_planner.py again",
        ),
        (b"\xc1", "the message cannot be read"),
    ],
)
def test_servers_of_something_else_are_refused(greeting: str | bytes, message: str) -> None:
    with (
        misbehaving(lambda client: client.send(greeting)) as url,
        pytest.raises(ValueError, match=message),
    ):
        burg_planner.RemotePlanner(url)


@pytest.mark.parametrize("said", [b"", b"HTTP/1.1 200 OK\r\n\r\n", b"SSH-2.0-OpenSSH\r\n"])
def test_servers_without_websockets_are_refused(said: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def accept() -> None:
            client, _ = listener.accept()
            client.recv(4096)
            client.sendall(said)
            client.close()

        threading.Thread(target=accept, daemon=True).start()
        url = f"ws://127.0.0.1:{listener.getsockname()[1]}"
        with pytest.raises((ValueError, OSError)):
            burg_planner.RemotePlanner(url)


@pytest.mark.parametrize("url", ["ws://", "ws://host:port", "http://127.0.0.1:9000"])
def test_addresses_that_are_none_are_refused(url: str) -> None:
    with pytest.raises(ValueError):
        burg_planner.RemotePlanner(url)


def test_answers_of_bad_servers_are_errors() -> None:
    """A text, nonsense, too much, the end; after each, the planner can be asked again."""
    replies: list[str | bytes | None] = [
        "text",
        b"\xc1",
        bytes(burg_planner.MAX_ANSWER_BYTES + 1),
        None,
        burg_planner.pack_message({"error": "it hurts"}),
        burg_planner.pack_message({"X_CG": np.eye(4)[None]}),
    ]

    def talk(client: ServerConnection) -> None:
        client.send(GREETING)
        for _ in client:
            reply = replies.pop(0)
            if reply is None:
                break
            client.send(reply)

    with misbehaving(talk, max_size=None) as url, burg_planner.RemotePlanner(url, 10.0) as planner:
        for kind, message in (
            (ValueError, "the message is a text"),
            (ValueError, "the message cannot be read"),
            (OSError, "the planner closed the connection: .*1009"),
            (OSError, "the planner closed the connection"),
            (RuntimeError, "it hurts"),
        ):
            with pytest.raises(kind, match=message):
                planner.plan(observation())
        assert same(planner.plan(observation())["X_CG"], np.eye(4)[None])


def test_a_late_answer_is_not_that_to_the_next_observation() -> None:
    waits = [1.0, 0.0]

    def talk(client: ServerConnection) -> None:
        client.send(GREETING)
        for data in client:
            asked = burg_planner.unpack_message(data)
            time.sleep(waits.pop(0))
            client.send(burg_planner.pack_message({"observation": asked["id"]}))

    with misbehaving(talk) as url, burg_planner.RemotePlanner(url, 0.3) as planner:
        with pytest.raises(TimeoutError, match=r"no answer within 0\.3 s"):
            planner.plan(observation(1))
        planner.timeout = HANG_GUARD
        assert planner.plan(observation(2))["observation"] == observation(2).id


def test_an_interrupted_question_has_no_answer(tmp_path: Path) -> None:
    with (
        served(write_program(tmp_path)) as (url, _),
        burg_planner.RemotePlanner(url) as planner,
    ):
        threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT]).start()
        with pytest.raises(KeyboardInterrupt):
            planner.plan(observation(5))
        assert planner.plan(observation())["observation"] == observation().id


def test_a_server_that_has_stopped_is_left(tmp_path: Path) -> None:
    """More is sent than the buffers of the system take, so that sending does not end either."""
    large = replace(observation(), depth=np.zeros((4000, 4000), np.float32))
    with (
        served(write_program(tmp_path)) as (url, process),
        burg_planner.RemotePlanner(url, 0.5) as planner,
    ):
        process.send_signal(signal.SIGSTOP)
        begun = time.monotonic()
        with pytest.raises(TimeoutError, match=r"no answer within 0\.5 s"):
            planner.plan(large)
        assert time.monotonic() - begun < 10.0
        process.send_signal(signal.SIGCONT)
        planner.timeout = HANG_GUARD
        assert planner.plan(observation())["pid"] == process.pid


def test_a_planner_may_keep_python_busy(tmp_path: Path) -> None:
    """Pings that get no answer end a connection; `websockets` sends them by default."""
    with served(write_program(tmp_path)) as (url, _), burg_planner.RemotePlanner(url) as planner:
        assert planner._socket.ping_interval is None
