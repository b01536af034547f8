"""`burg-drake ar`: a real server and real requests; scripts, their words and exit codes."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.apps.ar_viewer.server import PAGES, ViewServer
from burg_drake.apps.cli import main
from burg_drake.cameras.event_log import EventLog
from burg_drake.cameras.frame_source import Frame, FrameSource
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.intrinsics_file import save_intrinsics
from burg_drake.cameras.live_session import LiveSession
from burg_drake.cameras.recording import read_poses
from burg_drake.cameras.session import Session
from burg_drake.cameras.snapshot import load_snapshot
from burg_drake.cameras.synthetic import board_image
from burg_drake.cameras.view_actions import ViewActions
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import make_pose
from burg_drake.scene.scene import load_scene

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.3, 0.21, 0.6))
TIMEOUT = 30.0
TWO = """\
version: 1
name: two
library: household
instances:
  - {object: box, X_SO: {translation: [0.47, 0.12, 0.0], rpy_deg: [0, 0, 75]}}
  - {object: bowl, X_SO: {translation: [0.2, 0.25, 0.0]}}
"""


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    return board_image(load_scene("tabletop_six").board, CAMERA, X_SC)


@pytest.fixture(scope="module")
def files(image: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a photo of the board, one without it, a video and intrinsics."""
    folder = tmp_path_factory.mktemp("ar")
    save_intrinsics(CAMERA, folder / "camera.yaml")
    cv2.imwrite(str(folder / "photo.png"), image[..., ::-1])
    cv2.imwrite(str(folder / "floor.png"), np.full((240, 320, 3), 90, np.uint8))
    video = cv2.VideoWriter(
        str(folder / "video.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240)
    )
    for _ in range(4):
        video.write(np.ascontiguousarray(image[..., ::-1]))
    video.release()
    return folder


class Camera(FrameSource):
    """The same image 20 times a second."""

    def __init__(self, image: np.ndarray) -> None:
        self.name, self.live, self.size, self.image = "camera 7", True, (320, 240), image
        self._closed, self._time = threading.Event(), 0.0

    def read(self) -> Frame | None:
        if self._closed.wait(0.05):
            return None
        self._time += 0.05
        return Frame(self.image, None, self._time, self.name)

    def close(self) -> None:
        self._closed.set()


@pytest.fixture(scope="module")
def server(image: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewServer]:
    session = Session(load_scene("tabletop_six"), CAMERA)
    live = LiveSession(session, Camera(image), events=EventLog())
    server = ViewServer(live, ViewActions(live, tmp_path_factory.mktemp("shots")), port=0)
    live.start()
    server.start()
    yield server
    live.close()
    server.close()


def request(
    server: ViewServer, method: str, path: str, body: str | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of an answer; `_` in names of headers stands for `-`."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=TIMEOUT)
    try:
        given = {key.replace("_", "-"): value for key, value in headers.items()}
        connection.request(method, path, body, given)
        answer = connection.getresponse()
        return answer.status, dict(answer.headers), answer.read()
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


def until(condition: Callable[[], Any]) -> Any:
    end = time.monotonic() + TIMEOUT
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


def decoded(jpeg: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image)[..., ::-1]


# --- Server


def test_page_needs_nothing_from_elsewhere(server: ViewServer) -> None:
    for path, (_, kind) in PAGES.items():
        code, headers, body = request(server, "GET", path)
        assert code == 200 and headers["Content-Type"] == kind
        assert "default-src 'self'" in headers["Content-Security-Policy"]
        text = body.decode()
        assert "http://" not in text and "https://" not in text


def test_page_has_what_its_script_looks_for() -> None:
    from importlib.resources import files as package_files

    folder = package_files("burg_drake.apps.ar_viewer")
    script, page = ((folder / name).read_text() for name in ("page.js", "page.html"))
    wanted = {part.split('"')[0] for part in script.split('$("')[1:]}
    assert len(wanted) > 20
    assert all(f'id="{name}"' in page for name in wanted)


def test_pictures_follow_one_another(server: ViewServer, image: np.ndarray) -> None:
    code, headers, jpeg = request(server, "GET", "/frame.jpg")
    until(lambda: request(server, "GET", "/frame.jpg")[0] == 200)
    code, headers, jpeg = request(server, "GET", "/frame.jpg")
    assert code == 200 and headers["Content-Type"] == "image/jpeg"
    assert decoded(jpeg).shape == image.shape
    number = int(headers["X-Picture"])
    code, headers, _ = request(server, "GET", f"/frame.jpg?after={number}")
    assert code == 200 and int(headers["X-Picture"]) > number
    assert request(server, "GET", f"/frame.jpg?after={10**9}")[0] == 204
    assert request(server, "GET", "/frame.jpg?after=now")[0] == 400


def test_stream_is_one_that_opencv_reads(server: ViewServer, image: np.ndarray) -> None:
    capture = cv2.VideoCapture(f"{server.url}stream.mjpg")
    pictures = [capture.read() for _ in range(3)]
    capture.release()  # goes away in the middle; the server does not mind
    for good, picture in pictures:
        assert good
        drawn = np.asarray(picture, dtype=float)[..., ::-1]
        assert drawn.shape == image.shape
        assert np.median(np.abs(drawn - image)) < 6  # most of it is the photo


def test_status_says_what_is_seen(server: ViewServer) -> None:
    until(lambda: status(server)["picture"])
    found = status(server)
    assert found["scene"]["name"] == "tabletop_six" and len(found["scene"]["objects"]) == 6
    assert found["source"] == {"name": "camera 7", "live": True, "state": "running", "fault": ""}
    picture = found["picture"]
    assert picture["valid"] and picture["markers"] == picture["of_markers"] == 54
    assert picture["line"].startswith("54 of 54 markers, camera within 0.")
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
    assert code == 409 and "has no 'cup'" in answer["error"]
    code, answer = post(server, "/settings", opacity=2)
    assert code == 409 and "not a number from 0 to 1" in answer["error"]
    for body in ({"self": 1}, {"names": "yes"}, {"opacity": True}, {"colour": "red"}):
        assert post(server, "/settings", **body)[0] == 409
    assert status(server)["settings"]["opacity"] == 0.25
    assert post(server, "/settings", guide="", opacity=0.45)[0] == 200


def test_snapshot_and_recording(server: ViewServer, image: np.ndarray) -> None:
    until(lambda: server.live.picture)
    code, answer = post(server, "/snapshot")
    assert code == 200
    assert np.array_equal(load_snapshot(answer["path"]).image, image)
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
    with pytest.raises(InvalidInputError, match=f"port {port} of 127.0.0.1 is taken"):
        ViewServer(server.live, server.actions, port=port)
    with pytest.raises(InvalidInputError, match=r"cannot be served on 192\.0\.2\.1"):
        ViewServer(server.live, server.actions, host="192.0.2.1")
    first = ViewServer(server.live, server.actions)
    second = ViewServer(server.live, server.actions)
    assert first.server_address[1] != second.server_address[1]
    first.server_close()
    second.server_close()


# --- Command


def run(files: Path, *arguments: str) -> int:
    return main(["ar", "tabletop_six", "--intrinsics", str(files / "camera.yaml"), *arguments])


def test_script_with_a_photo(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shot = tmp_path / "shot"
    photo = str(files / "photo.png")
    assert run(files, "--camera", photo, "--no-browser", "--snapshot", str(shot)) == 0
    out = capsys.readouterr().out
    assert "photo.png: 54 of 54 markers, camera within" in out
    # What was saved can be looked at again, and says the same.
    again = ["ar", "tabletop_six", "--camera", str(shot / "image.png"), "--no-browser"]
    again += ["--intrinsics", str(shot / "intrinsics.yaml"), "--snapshot", str(tmp_path / "again")]
    assert main(again) == 0
    first, second = (load_snapshot(folder).document.board for folder in (shot, tmp_path / "again"))
    assert first.X_SC == second.X_SC and first.markers == second.markers
    assert run(files, "--camera", photo, "--no-browser", "--snapshot", str(shot)) == 2
    assert "exists; give a snapshot a new name" in capsys.readouterr().err


def test_script_with_a_video(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    video, take = str(files / "video.avi"), tmp_path / "take.mp4"
    code = run(files, "--camera", video, "--no-browser", "--record", str(take), "--plain")
    captured = capsys.readouterr()
    assert code == 0 and "4 of 4 frames gave a pose" in captured.out
    assert f"recorded {take}, 0.2 s" in captured.err
    assert {path.name for path in tmp_path.iterdir()} == {
        "take.mp4",
        "take_plain.mp4",
        "take.csv",
        "take.yaml",
    }


def test_script_without_a_pose(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor = str(files / "floor.png")
    assert run(files, "--camera", floor, "--no-browser", "--check") == 1
    err = capsys.readouterr().err
    assert "burg-drake: no frame gave a pose: " in err and "marker" in err


def test_view_serves_for_a_while(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = run(files, "--camera", str(files / "photo.png"), "--seconds", "0.5")
    out = capsys.readouterr().out
    assert code == 0 and "tabletop_six over " in out and "open http://127.0.0.1:7" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--camera", "{}/none.mp4"], "there is no"),
        (["--camera", "{}/photo.png", "--record", "a.gif"], "a recording is .mp4 or .avi"),
        (["--camera", "{}/photo.png", "--snapshot", "{}"], "exists; give a snapshot a new name"),
        (["--camera", "99"], "camera 99 does not open"),
    ],
)
def test_bad_input(
    files: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    code = run(files, "--no-browser", *(word.format(files) for word in arguments))
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert code == 2 and message in err


def test_intrinsics_are_needed_and_must_fit(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = str(files / "photo.png")
    assert main(["ar", "tabletop_six", "--camera", photo, "--no-browser"]) == 2
    assert "needs --intrinsics FILE" in capsys.readouterr().err
    other = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
    save_intrinsics(other, tmp_path / "k.yaml")
    code = main(["ar", "tabletop_six", "--camera", photo, "--intrinsics", str(tmp_path / "k.yaml")])
    assert code == 2
    assert "320 x 240 pixels, the intrinsics are of 640 x 480" in capsys.readouterr().err


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_the_end_finishes_the_recording(files: Path, tmp_path: Path, how: signal.Signals) -> None:
    take = tmp_path / "take.mp4"
    command = [sys.executable, "-m", "burg_drake.apps.cli", "ar", "tabletop_six"]
    command += ["--camera", str(files / "video.avi"), "--intrinsics", str(files / "camera.yaml")]
    process = subprocess.Popen(
        [*command, "--record", str(take)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "54 of 54" in line:
            break
    process.send_signal(how)
    _, rest = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, rest
    assert "Traceback" not in rest and f"recorded {take}" in rest
    assert cv2.VideoCapture(str(take)).read()[0]
    assert len(read_poses(take.with_suffix(".csv")).times) >= 1


def test_simulated_camera_from_end_to_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All stands as the scene says, so that nothing is off."""
    (tmp_path / "two.yaml").write_text(TWO)
    command = [
        "ar",
        str(tmp_path / "two.yaml"),
        "--camera",
        "sim:panda_tabletop/board",
        "--no-browser",
    ]
    command += ["--frames", "1", "--check", "--snapshot", str(tmp_path / "s")]
    code = main(command)
    out = capsys.readouterr().out
    assert code == 0
    snapshot = load_snapshot(tmp_path / "s")
    assert snapshot.depth is not None and snapshot.document.placement is not None
    placed = snapshot.document.placement.instances.values()
    assert [p.status for p in placed] == ["measured", "measured"]
    assert max(np.hypot(*p.displacement) for p in placed if p.displacement) < 1e-3
    assert out.count("; placed") == 2
