"""The server of the lab's page, by real requests; and killed, as a process of its own."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from burg_drake.apps import (
    LAB_PAGE_FILES,
    MAX_PAGE_CONNECTIONS,
    LabServer,
    _load_or_create_secret as kept_secret,
)
from burg_drake.core import BrowserToken, RealOutcome
from burg_drake.experiment import (
    LabBook,
    PictureCache,
    TrialBook,
    TriedRuns,
    journal_path,
    load_trials,
    read_entries,
)
from tests.experiment.pages.conftest import made as made, trials as trials
from tests.hang_guard import HANG_GUARD

TIME = "2026-05-05T10:02:11+02:00"


@pytest.fixture
def server(trials: Path) -> Iterator[LabServer]:
    """Without pictures, which have tests of their own."""
    runs = TriedRuns(trials)
    server = LabServer(LabBook(runs), PictureCache(runs), port=0)
    server.start()
    yield server
    server.close()


def request(
    port: int, method: str, path: str, body: str | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of an answer; `_` in names of headers stands for `-`."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=HANG_GUARD)
    try:
        given = {key.replace("_", "-"): value for key, value in headers.items()}
        connection.request(method, path, body, given)
        answer = connection.getresponse()
        found = {name.title(): value for name, value in answer.headers.items()}
        return answer.status, found, answer.read()
    finally:
        connection.close()


def read(port: int, path: str) -> Any:
    code, _, answer = request(port, "GET", path)
    assert code == 200, answer
    return json.loads(answer)


def post(port: int, path: str, body: object, **headers: str) -> tuple[int, dict[str, Any]]:
    text = body if isinstance(body, str) else json.dumps(body)
    kind = {"Content_Type": "application/json"} | headers
    code, _, answer = request(port, "POST", path, text, **kind)
    return code, json.loads(answer)


def entry(port: int, number: int, outcome: str | None, **more: object) -> dict[str, object]:
    """As the page makes it."""
    found = read(port, "/states")
    state = next(e["state"] for e in found["entries"] if e["number"] == number)
    known = {"plan": found["plan"], "number": number, "replaces": state, "outcome": outcome}
    return known | {"time": TIME, "operator": "AB", "note": "", "width_mm": None} | more


def test_an_entry_is_in_the_file_when_it_is_acknowledged(server: LabServer, trials: Path) -> None:
    port = server.server_address[1]
    code, answer = post(port, "/entry", entry(port, 2, "slipped", note="nass ☂", width_mm=7))
    assert code == 200 and answer["entry"]["label"] == "slipped"
    trial = load_trials(trials).trial(2)
    assert (trial.outcome, trial.note, trial.operator) == (RealOutcome.SLIPPED, "nass ☂", "AB")
    states = read(port, "/states")
    assert request(port, "GET", f"/states?after={states['version']}")[0] == 204
    TrialBook(trials).record(3, outcome="lifted")  # by another program
    seen = read(port, f"/states?after={states['version']}")["entries"]
    assert [e["outcome"] for e in seen[:3]] == [None, "slipped", "lifted"]


BAD: list[tuple[dict[str, object], int, str]] = [
    ({"outcome": "lifte"}, 400, "there is no outcome 'lifte'"),
    ({"outcome": 3}, 400, "outcome must be a str"),
    ({"number": True}, 400, "number must be a int"),
    ({"number": 99}, 422, "99"),
    ({"colour": "red"}, 400, "an entry has no 'colour'"),
    ({"note": "x" * 2001}, 400, "note has 2001 characters"),
    ({"note": "a\x00b"}, 400, "no text"),
    ({"note": "\ud800"}, 400, "no text"),
    ({"time": "2026-05-05T10:02:11"}, 400, "with its zone"),
    ({"width_mm": -1}, 400, "width_mm must be from 0"),
    ({"width_mm": 1e300}, 400, "width_mm must be from 0"),
    ({"plan": "another"}, 409, "another trials file"),
    ({"replaces": "other"}, 409, "was changed by someone else: it now has nothing"),
]


def test_bad_entries(server: LabServer, trials: Path) -> None:
    port, before = server.server_address[1], trials.read_text()
    good = entry(port, 1, "lifted")
    for change, code, message in BAD:
        found, answer = post(port, "/entry", good | change)
        assert found == code and message in answer["error"], change
    assert trials.read_text() == before


def test_other_sites_and_broken_requests_are_refused(server: LabServer, trials: Path) -> None:
    port, before = server.server_address[1], trials.read_text()
    good = entry(port, 1, "lifted")
    assert post(port, "/entry", good, Origin="http://evil.example")[0] == 403
    assert post(port, "/entry", good, Host="evil.example")[0] == 403
    assert post(port, "/entry", good, Sec_Fetch_Site="cross-site")[0] == 403
    assert post(port, "/entry", good, Content_Type="text/plain")[0] == 415
    assert post(port, "/entry", "{")[0] == 400 and post(port, "/entry", "[1]")[0] == 400
    assert post(port, "/entry", '{"number": NaN}')[0] == 400
    assert post(port, "/entry", "x" * 20_000)[0] == 400
    assert post(port, "/check", {"number": 1, "keep": True})[0] == 404  # no camera
    for path in ("/secret", "/picture/grasp/99.jpg", "/picture/../x.jpg", "/picture/x/1.jpg"):
        assert request(port, "GET", path)[0] == 404
    assert request(port, "GET", "/states", Origin="http://evil.example")[0] == 403
    assert trials.read_text() == before
    for path in LAB_PAGE_FILES:
        code, headers, body = request(port, "GET", path)
        policy = headers["Content-Security-Policy"]
        assert code == 200 and body
        assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy
    own = f"http://127.0.0.1:{port}"
    assert post(port, "/entry", good, Origin=own, Sec_Fetch_Site="same-origin")[0] == 200


def test_other_machines_need_the_token(trials: Path) -> None:
    runs = TriedRuns(trials)
    server = LabServer(LabBook(runs), PictureCache(runs), host="0.0.0.0", port=0, secret="s" * 40)
    server.start()
    try:
        port = server.server_address[1]
        came: list[str] = []
        server.on_admitted = came.append
        for path in ("/", "/?token=x", "/plan", "/states", "/page.js"):
            assert request(port, "GET", path)[0] == 403
        address = server.url
        path = address[address.index("/?") :]
        code, headers, _ = request(port, "GET", path)
        assert code == 200 and came == ["127.0.0.1"] and server.url != address
        cookie, *rules = headers["Set-Cookie"].split("; ")
        assert {"HttpOnly", "SameSite=Strict"} <= set(rules)
        assert request(port, "GET", path)[0] == 403  # it was for one browser
        assert request(port, "GET", "/states", Cookie=cookie)[0] == 200
        assert request(port, "GET", "/states", Cookie=cookie[:-1])[0] == 403
    finally:
        server.close()


@contextlib.contextmanager
def served_to_all(trials: Path) -> Iterator[LabServer]:
    """To browsers that have the token."""
    runs = TriedRuns(trials)
    server = LabServer(LabBook(runs), PictureCache(runs), host="0.0.0.0", port=0, secret="s" * 40)
    server.start()
    try:
        yield server
    finally:
        server.close()


HEAD = b"GET /states HTTP/1.1\r\nHost: localhost\r\n"


def test_slow_connections_lock_nobody_out(trials: Path) -> None:
    """Neither those that are there first, nor those that come and go all the time."""
    with served_to_all(trials) as server, contextlib.ExitStack() as stack:
        port = server.server_address[1]
        cookie = f"burg_drake_{port}={'s' * 40}"
        tablet = http.client.HTTPConnection("127.0.0.1", port, timeout=HANG_GUARD)
        stack.callback(tablet.close)
        for _ in range(3):
            for _ in range(MAX_PAGE_CONNECTIONS + 2):
                slow = socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD)
                stack.callback(slow.close)
                slow.sendall(HEAD[:20])
            tablet.request("GET", "/states", headers={"Cookie": cookie})  # stays connected
            assert tablet.getresponse().read().startswith(b"{")
            assert request(port, "GET", "/states", Cookie=cookie)[0] == 200


@pytest.mark.parametrize("sent", [b"", HEAD[:10], HEAD, b"body"])
def test_a_request_has_to_be_whole_in_time(
    server: LabServer, monkeypatch: pytest.MonkeyPatch, sent: bytes
) -> None:
    """Whatever comes meanwhile, byte by byte; after an answer a connection may rest for longer."""
    port = server.server_address[1]
    if sent == b"body":
        head = HEAD.replace(b"GET /states", b"POST /entry") + b"Content-Type: application/json\r\n"
        sent = head + b"Content-Length: 9999\r\n\r\n"
    kept = http.client.HTTPConnection("127.0.0.1", port, timeout=HANG_GUARD)
    kept.request("GET", "/states")
    assert kept.getresponse().read()
    used = kept.sock
    monkeypatch.setattr("burg_drake.apps.page_server.REQUEST_TIMEOUT", 0.3)
    rest = b"X-Slow: " if sent == HEAD else b""
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD) as slow:
        slow.sendall(sent + rest)
        ended = threading.Event()
        threading.Thread(target=_drip, args=(slow, ended, bool(sent)), daemon=True).start()
        with contextlib.suppress(ConnectionError):  # closed while bytes were on their way
            assert slow.recv(1) == b""
        ended.set()
    kept.request("GET", "/states")  # it has rested for longer than a request may take
    assert kept.getresponse().read() and kept.sock is used
    kept.close()


def test_a_second_request_has_to_be_whole_in_time(
    server: LabServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Although its connection was admitted before."""
    monkeypatch.setattr("burg_drake.apps.page_server.REQUEST_TIMEOUT", 0.3)
    port = server.server_address[1]
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD) as used:
        used.sendall(HEAD + b"\r\n")
        answer = used.recv(1 << 16)
        assert answer.startswith(b"HTTP/1.1 200")
        used.sendall(b"GET / HT")
        while answer:  # the rest of the first answer, then the end
            answer = used.recv(1 << 16)


def test_a_body_in_chunks_is_refused(server: LabServer) -> None:
    head = HEAD.replace(b"GET /states", b"POST /entry") + b"Content-Type: application/json\r\n"
    port = server.server_address[1]
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD) as sender:
        sender.sendall(head + b"Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n")
        sender.sendall(b"2\r\n{}\r\n0\r\n\r\n")
        assert sender.recv(1 << 16).startswith(b"HTTP/1.1 400")


def test_a_client_that_leaves_is_no_error(
    server: LabServer, caplog: pytest.LogCaptureFixture
) -> None:
    head = HEAD.replace(b"GET /states", b"POST /entry") + b"Content-Type: application/json\r\n"
    port = server.server_address[1]
    with socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD) as leaving:
        leaving.sendall(head + b"Content-Length: 99\r\n\r\n{")
    assert request(port, "GET", "/states")[0] == 200
    assert not caplog.records


def _drip(slow: socket.socket, ended: threading.Event, is_sending: bool) -> None:
    """A byte every now and then."""
    while is_sending and not ended.wait(0.05):
        with contextlib.suppress(OSError):
            slow.sendall(b"x")


def test_an_address_has_its_share_of_the_connections(
    trials: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half of them, in its last connections; one of IPv6 with its network; this machine has all."""
    came_from: dict[int, tuple[str, int]] = {}  # by port
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(served_to_all(trials))

        monkeypatch.setattr(
            "uvicorn.protocols.http.h11_impl.get_remote_addr",
            lambda transport: came_from[transport.get_extra_info("peername")[1]],
        )

        def come(address: str) -> socket.socket:
            ours = stack.enter_context(socket.socket())
            ours.settimeout(HANG_GUARD)
            ours.bind(("127.0.0.1", 0))
            port = ours.getsockname()[1]
            came_from[port] = (address, port)
            ours.connect(("127.0.0.1", server.server_address[1]))
            return ours

        ours = [come("192.0.2.1") for _ in range(MAX_PAGE_CONNECTIONS // 2 + 3)]
        assert [connection.recv(1) for connection in ours[:3]] == [b""] * 3
        others = [come("192.0.2.2"), come("2001:db8::1"), come("::ffff:127.0.0.1")]
        for number in range(MAX_PAGE_CONNECTIONS):
            come(f"2001:db8::{number:x}")
        for connection in (*ours[-8:], others[0], others[2]):  # are served still
            connection.sendall(HEAD + b"\r\n")
            assert connection.recv(100).startswith(b"HTTP/1.1 403")
        assert others[1].recv(1) == b""


def test_a_token_that_is_no_text_is_a_wrong_one(trials: Path) -> None:
    with served_to_all(trials) as server:
        port = server.server_address[1]
        bad = ((b"/?token=\xe4", b"", 400), (b"/?token=%ff", b"", 403), (b"/", b"\xe4\xff", 403))
        for path, cookie, code in bad:
            head = b"GET %s HTTP/1.1\r\nHost: localhost\r\nCookie: burg_drake_%d=%s\r\n\r\n"
            with socket.create_connection(("127.0.0.1", port), timeout=HANG_GUARD) as connection:
                connection.sendall(head % (path, port, cookie))
                assert connection.recv(100).startswith(b"HTTP/1.1 %d" % code)
    token = BrowserToken("name", "s" * 40)
    assert not token.use("\udce4") and not token.admits("name=\udce4") and not token.use("ä")


def test_the_secret_is_kept_also_after_one_that_was_never_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BURG_DRAKE_CACHE", str(tmp_path))
    (tmp_path / "lab_plan.secret").touch()  # by a process that was killed
    secret = kept_secret("plan")
    assert secret is not None and len(secret) >= 24 and kept_secret("plan") == secret
    assert kept_secret("other") != secret
    assert [path.stat().st_mode & 0o777 for path in tmp_path.glob("*.secret")] == [0o600] * 2
    assert len(list(tmp_path.iterdir())) == 2


def start(trials: Path, port: int) -> subprocess.Popen[str]:
    """The program itself, once it serves."""
    words = [sys.executable, "-m", "burg_drake.apps.cli", "trials", "serve", str(trials)]
    process = subprocess.Popen(
        [*words, "--port", str(port)], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    assert re.search(rf"7 trials: open http://127.0.0.1:{port}/", line), line
    return process


def kill(process: subprocess.Popen[str]) -> None:
    os.kill(process.pid, signal.SIGKILL)
    process.wait(HANG_GUARD)
    if process.stdout is not None:
        process.stdout.close()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@pytest.mark.thorough
def test_no_entry_is_lost_or_doubled_when_the_server_is_killed(trials: Path) -> None:
    port = free_port()
    process = start(trials, port)
    sent = {n: entry(port, n, outcome) for n, outcome in ((1, "lifted"), (2, "slipped"))}
    assert post(port, "/entry", sent[1])[0] == 200
    unanswered = threading.Thread(target=_careless, args=(port, sent[2]))
    unanswered.start()
    kill(process)  # somewhere in the middle of the second entry
    unanswered.join(HANG_GUARD)
    assert load_trials(trials).trial(1).outcome is RealOutcome.LIFTED
    server = serve_again(trials, port)
    try:
        clients = [threading.Thread(target=post, args=(port, "/entry", e)) for e in sent.values()]
        for client in clients:
            client.start()
        for client in clients:
            client.join(HANG_GUARD)
        outcomes = [t.outcome for t in load_trials(trials).trials[:3]]
        assert outcomes == [RealOutcome.LIFTED, RealOutcome.SLIPPED, None]
        told = [e.number for e in read_entries(journal_path(trials)) if e.before != e.after]
        assert sorted(set(told)) == [1, 2] and told.count(1) == 1
    finally:
        server.close()


def serve_again(trials: Path, port: int) -> LabServer:
    """The program started again, in this process."""
    runs = TriedRuns(trials)
    server = LabServer(LabBook(runs), PictureCache(runs), port=port)
    server.start()
    return server


def _careless(port: int, body: dict[str, object]) -> None:
    """Sends, and does not mind what comes of it."""
    with contextlib.suppress(OSError, http.client.HTTPException, ValueError):
        post(port, "/entry", body)
