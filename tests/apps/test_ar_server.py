"""The live view's server, by real requests."""

from __future__ import annotations

import http.client
import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.apps import LIVE_VIEW_FILES, MAX_REFUSALS, ViewServer
from burg_drake.cameras import (
    EventLog,
    FrameProcessor,
    LiveSession,
    ViewActions,
    load_snapshot,
    read_poses,
    silence_opencv,
)
from burg_drake.core import InvalidInputError
from burg_drake.scene import load_scene
from tests.apps.ar_views import CAMERA, X_SC, Camera, photo
from tests.hang_guard import HANG_GUARD, until


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewServer]:
    six = load_scene("tabletop_six")
    two = replace(six, document=replace(six.document, instances=six.document.instances[:2]))
    session = FrameProcessor(two, CAMERA)
    live = LiveSession(session, Camera(photo()), events=EventLog())
    server = ViewServer(live, ViewActions(live, tmp_path_factory.mktemp("shots")), port=0)
    live.start()
    server.start()
    until(lambda: live.picture)
    yield server
    live.close()
    server.close()


def request(
    server: ViewServer, method: str, path: str, body: str | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of an answer; `_` in names of headers stands for `-`."""
    connection = http.client.HTTPConnection(
        "127.0.0.1", server.server_address[1], timeout=HANG_GUARD
    )
    try:
        given = {key.replace("_", "-"): value for key, value in headers.items()}
        connection.request(method, path, body, given)
        answer = connection.getresponse()
        found = {name.title(): value for name, value in answer.headers.items()}
        return answer.status, found, answer.read()
    finally:
        connection.close()


def post(server: ViewServer, path: str, **body: Any) -> tuple[int, dict[str, Any]]:
    code, _, answer = request(
        server, "POST", path, json.dumps(body), Content_Type="application/json"
    )
    return code, json.loads(answer)


def status(server: ViewServer, after: int = 0) -> dict[str, Any]:
    code, _, body = request(server, "GET", f"/status?after={after}")
    assert code == 200
    return json.loads(body)


def decoded(jpeg: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image)[..., ::-1]


def test_page_needs_nothing_from_elsewhere(server: ViewServer) -> None:
    for path, (_, kind) in LIVE_VIEW_FILES.items():
        code, headers, body = request(server, "GET", path)
        assert code == 200 and headers["Content-Type"] == kind
        assert "default-src 'self'" in headers["Content-Security-Policy"]
        text = body.decode()
        assert "http://" not in text and "https://" not in text


def test_page_has_what_its_script_looks_for() -> None:
    from importlib.resources import files as package_files

    folder = package_files("burg_drake.apps") / "live_page"
    script, page = ((folder / name).read_text() for name in ("page.js", "page.html"))
    wanted = {part.split('"')[0] for part in script.split('$("')[1:]}
    assert len(wanted) > 20
    assert all(f'id="{name}"' in page for name in wanted)


@pytest.mark.thorough
def test_pictures_follow_one_another(server: ViewServer) -> None:
    code, headers, jpeg = request(server, "GET", "/frame.jpg")
    until(lambda: request(server, "GET", "/frame.jpg")[0] == 200)
    code, headers, jpeg = request(server, "GET", "/frame.jpg")
    assert code == 200 and headers["Content-Type"] == "image/jpeg"
    assert decoded(jpeg).shape == photo().shape
    number = int(headers["X-Picture"])
    code, headers, _ = request(server, "GET", f"/frame.jpg?after={number}")
    assert code == 200 and int(headers["X-Picture"]) > number
    assert request(server, "GET", f"/frame.jpg?after={10**9}")[0] == 204
    assert request(server, "GET", "/frame.jpg?after=now")[0] == 400


def test_stream_is_one_that_opencv_reads(server: ViewServer) -> None:
    with silence_opencv():
        capture = cv2.VideoCapture(f"{server.url}stream.mjpg")
    pictures = [capture.read() for _ in range(3)]
    capture.release()  # goes away in the middle; the server does not mind
    for good, picture in pictures:
        assert good
        drawn = np.asarray(picture, dtype=float)[..., ::-1]
        assert drawn.shape == photo().shape
        assert np.median(np.abs(drawn - photo())) < 6  # most of it is the photo


def test_status_says_what_is_seen(server: ViewServer) -> None:
    until(lambda: status(server)["picture"])
    found = status(server)
    assert found["scene"]["name"] == "tabletop_six" and len(found["scene"]["objects"]) == 2
    assert found["source"] == {"name": "camera 7", "live": True, "state": "running", "fault": ""}
    picture = found["picture"]
    assert picture["valid"] and picture["markers"] == picture["of_markers"] == 54
    found_line = re.match(r"54 of 54 markers, camera within ([\d.]+) mm", picture["line"])
    assert found_line and 0.1 < float(found_line[1]) < 2.0
    assert np.allclose(picture["p_SC_mm"], [300.0, 210.0, 600.0], atol=1.0)
    assert set(picture["milliseconds"]) == {"pose", "overlay", "jpeg"}
    last = found["events"][-1]["number"]
    assert status(server, last)["events"] == []


def test_settings(server: ViewServer) -> None:
    assert post(server, "/settings", guide="mug", opacity=0.25) == (200, {})
    settings = status(server)["settings"]
    assert settings["guide"] == "mug" and settings["opacity"] == 0.25
    until(lambda: (server.live.picture or pytest.fail()).settings.guide == "mug")
    code, answer = post(server, "/settings", guide="cup")
    assert code == 409 and "has no instance 'cup'" in answer["error"]
    code, answer = post(server, "/settings", opacity=2)
    assert code == 409 and "not a number from 0 to 1" in answer["error"]
    for opacity in (0, 0.45, 1, 0.25):  # JavaScript knows no 0.0
        assert post(server, "/settings", opacity=opacity) == (200, {})
    for body in (
        {"self": 1},
        {"names": "yes"},
        {"opacity": True},
        {"colour": "red"},
        {"opacity": 10**99},
    ):
        assert post(server, "/settings", **body)[0] == 409
    assert status(server)["settings"]["opacity"] == 0.25
    assert post(server, "/settings", guide="", opacity=0.45)[0] == 200


def test_snapshot_and_recording(server: ViewServer) -> None:
    until(lambda: server.live.picture)
    code, answer = post(server, "/snapshot")
    assert code == 200
    assert np.array_equal(load_snapshot(answer["path"]).image, photo())
    code, answer = post(server, "/record", on=True)
    assert code == 200
    assert post(server, "/record", on=True)[0] == 409
    until(lambda: (status(server)["recording"] or {}).get("seconds"))
    until(lambda: (server.actions.recording or pytest.fail()).pictures >= 3)
    assert post(server, "/record", on=False) == (200, answer)
    capture = cv2.VideoCapture(answer["path"])
    poses = read_poses(Path(answer["path"]).with_suffix(".csv"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) >= len(poses.frames) >= 3
    assert np.allclose(poses.X_SC[:, :3, 3], X_SC[:3, 3], atol=1e-3)
    assert post(server, "/record", on=False) == (200, {"path": None})
    assert post(server, "/record", on="yes")[0] == 400


def test_placement_check_comes_with_the_status(server: ViewServer) -> None:
    until(lambda: server.live.picture)
    assert post(server, "/check") == (200, {})
    placement = until(lambda: status(server)["placement"])
    assert set(placement["objects"]) == set(status(server)["scene"]["objects"])
    assert not any(
        row["within"] and row["status"] == "measured" for row in placement["objects"].values()
    )  # the board is empty


@pytest.mark.parametrize(
    ("method", "path", "headers", "code"),
    [
        ("GET", "/status", {"Host": "evil.example"}, 403),
        ("GET", "/frame.jpg", {"Host": "evil.example:7100"}, 403),
        ("GET", "/status", {"Host": "localhost:7100"}, 200),
        ("GET", "/status", {"X_Forwarded_For": "192.0.2.1"}, 200),
        ("GET", "/status", {"Sec_Fetch_Site": "cross-site"}, 403),
        ("POST", "/snapshot", {"Origin": "http://evil.example"}, 403),
        ("POST", "/snapshot", {"Origin": "null"}, 403),
        ("POST", "/snapshot", {"Content_Type": "text/plain"}, 415),
        ("POST", "/settings", {"Content_Type": "application/json"}, 400),
        ("GET", "/../server.py", {}, 404),
        ("GET", "/%2e%2e/server.py", {}, 404),
        ("GET", "/page.html", {}, 404),
        ("GET", "//etc/passwd", {}, 404),
        ("PUT", "/settings", {}, 501),
    ],
)
def test_refusals(
    server: ViewServer, method: str, path: str, headers: dict[str, str], code: int
) -> None:
    assert (
        request(server, method, path, "not json" if method == "POST" else None, **headers)[0]
        == code
    )


LONG = "9" * 5000
TYPE = "Content-Type: application/json\r\n"


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("GET /status HTTP/1.1\r\nHost: [::1\r\n\r\n", 403),
        ("GET http://[::1 HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (f"GET /status?after={LONG} HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (f"POST /check HTTP/1.1\r\nHost: localhost\r\n{TYPE}Content-Length: {LONG}\r\n\r\n", 400),
        (
            f"POST /check HTTP/1.1\r\nHost: localhost\r\n{TYPE}Content-Length: 9900\r\n\r\n"
            + "[" * 9900,
            400,
        ),
    ],
    ids=["host", "address", "number", "length", "nested"],
)
def test_malformed_requests_are_answered(
    server: ViewServer, capfd: pytest.CaptureFixture[str], text: str, code: int
) -> None:
    with socket.create_connection(server.server_address[:2], timeout=HANG_GUARD) as connection:
        connection.sendall(text.encode())
        assert connection.recv(100).startswith(f"HTTP/1.1 {code} ".encode())
    assert status(server)["source"]["state"] == "running"
    assert capfd.readouterr().err == ""


def test_more_connections_than_are_served_are_told_why(server: ViewServer) -> None:
    small = ViewServer(server.live, server.actions, port=0, connections=2)
    small.start()
    held = [http.client.HTTPConnection(*small.server_address[:2], timeout=HANG_GUARD) for _ in "ab"]
    try:
        for connection in held:
            connection.request("GET", "/status")
            assert connection.getresponse().read()
        for path in ("/", "/frame.jpg", "/status"):
            code, _, body = request(small, "GET", path)
            assert code == 503
            assert json.loads(body)["error"].startswith("2 connections are open, the most that")
        held[0].request("GET", "/status")  # those that were there first go on
        assert held[0].getresponse().status == 200
        held[0].close()
        until(lambda: request(small, "GET", "/status")[0] == 200)
    finally:
        for connection in held:
            connection.close()
        small.close()


def test_a_flood_of_connections_takes_no_threads(server: ViewServer) -> None:
    """Connections without a request make room for the next ones."""
    small = ViewServer(server.live, server.actions, port=0, connections=1)
    small.start()
    before = threading.active_count()
    flood = [
        socket.create_connection(small.server_address[:2], timeout=HANG_GUARD)
        for _ in range(MAX_REFUSALS + 4)
    ]
    try:
        assert [connection.recv(1) for connection in flood[:-1]] == [b""] * (len(flood) - 1)
        assert threading.active_count() <= before + 1 + MAX_REFUSALS
        flood[-1].sendall(b"GET /status HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert flood[-1].recv(100).startswith(b"HTTP/1.1 200")
    finally:
        for connection in flood:
            connection.close()
        small.close()
    until(lambda: threading.active_count() <= before)


def test_clients_that_go_away_leave_no_trace(
    server: ViewServer, capfd: pytest.CaptureFixture[str]
) -> None:
    for _ in range(3):
        with socket.create_connection(server.server_address[:2]) as connection:
            connection.sendall(b"GET /stream.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert connection.recv(100).startswith(b"HTTP/1.1 200")
            linger = b"\1\0\0\0\0\0\0\0"  # reset, without a farewell
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    time.sleep(0.3)
    assert status(server)["source"]["state"] == "running"
    assert capfd.readouterr().err == ""


def test_a_taken_port(server: ViewServer) -> None:
    port = server.server_address[1]
    with pytest.raises(InvalidInputError, match=f"port {port} of 127.0.0.1 is in use"):
        ViewServer(server.live, server.actions, port=port)
    with pytest.raises(InvalidInputError, match=r"cannot be served on 192\.0\.2\.1"):
        ViewServer(server.live, server.actions, host="192.0.2.1")
    first = ViewServer(server.live, server.actions)
    second = ViewServer(server.live, server.actions)
    assert first.server_address[1] != second.server_address[1]
    first.close()
    second.close()
