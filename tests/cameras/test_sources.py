"""Sources of frames: files, videos, real devices (a stream of this machine), simulated cameras."""

from __future__ import annotations

import http.server
import io
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as PilImage

from burg_drake.cameras import (
    CameraLost,
    DeviceSource,
    FrameSource,
    Image,
    SimulatedSource,
    VideoSource,
    camera_intrinsics,
    open_device,
    open_source,
    read_image,
    silence_opencv,
    source_opening,
    write_image,
)
from burg_drake.core import Array, InvalidInputError, UnknownNameError, make_pose
from burg_drake.scene import load_scene
from burg_drake.station import load_station
from tests.hang_guard import HANG_GUARD


def picture(number: int = 0, size: tuple[int, int] = (64, 48)) -> Image:
    """Plain colour that tells the number, red at the left edge."""
    image = np.full((size[1], size[0], 3), (40, 20 * number % 256, 200), dtype=np.uint8)
    image[:, :8] = (250, 0, 0)
    return image


def number_of(image: Image) -> int:
    return round(float(image[:, 20:, 1].mean()) / 20.0)


def write_video(path: Path, frames: int = 10, codec: str = "MJPG") -> Path:
    with silence_opencv():
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 25.0, (64, 48))
    for number in range(frames):
        writer.write(picture(number)[..., ::-1])
    writer.release()
    return path


# --- image files -----------------------------------------------------------------------------


def test_an_image_is_read_in_rgb(tmp_path: Path) -> None:
    PilImage.fromarray(picture(3)).save(tmp_path / "a.png")
    with open_source(tmp_path / "a.png") as source:
        assert source.size == (64, 48) and not source.live
        frame = source.read()
        assert frame is not None and frame.name == "a.png" and frame.depth is None
        assert np.array_equal(frame.image, picture(3))
        assert source.read() is None


@pytest.mark.parametrize("orientation", range(1, 9))
def test_pixels_stay_as_the_sensor_has_them(tmp_path: Path, orientation: int) -> None:
    exif = PilImage.Exif()
    exif[0x0112] = orientation
    path = tmp_path / "turned.jpg"
    PilImage.fromarray(picture()).save(path, exif=exif, quality=95)
    image = read_image(path)
    assert image.shape == (48, 64, 3)
    assert image[:, :6, 0].min() > 200 and image[:, :6, 2].max() < 60  # red is still on the left


def test_other_kinds_of_images_become_rgb(tmp_path: Path) -> None:
    gray = np.tile(np.arange(64, dtype=np.uint8), (48, 1))
    PilImage.fromarray(gray).save(tmp_path / "gray.png")
    cv2.imwrite(str(tmp_path / "deep.png"), gray.astype(np.uint16) * 256)
    rgba = np.dstack([picture(2), np.full((48, 64), 7, dtype=np.uint8)])
    PilImage.fromarray(rgba).save(tmp_path / "clear.png")
    for name in ("gray.png", "deep.png"):
        assert np.array_equal(read_image(tmp_path / name), np.dstack([gray] * 3))
    assert np.array_equal(read_image(tmp_path / "clear.png"), picture(2))


def test_a_written_image_reads_back(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", picture(5))
    assert np.array_equal(read_image(tmp_path / "a.png"), picture(5))
    with pytest.raises(InvalidInputError, match=r"cannot write .*a\.xyz: .*\.png or \.jpg"):
        write_image(tmp_path / "a.xyz", picture())


def broken_files(folder: Path) -> list[tuple[Path, str]]:
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    found = []
    for name, content in (("png", "PNG"), ("jpg", "JPEG")):
        stream = io.BytesIO()
        PilImage.fromarray(noise).save(stream, content)
        path = folder / f"half.{name}"
        path.write_bytes(stream.getvalue()[: len(stream.getvalue()) // 2])
        found.append((path, "cannot be read as an image"))
    (folder / "empty.png").write_bytes(b"")
    (folder / "text.png").write_text("no image")
    found += [
        (folder / "empty.png", r"is empty \(0 bytes\)"),
        (folder / "text.png", "cannot be read as an image"),
    ]
    return [*found, (folder / "gone.png", "No such file"), (folder, "it is a folder")]


def test_what_is_no_image_is_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for path, reason in broken_files(tmp_path):
        with pytest.raises(InvalidInputError, match=reason) as raised:
            read_image(path)
        assert str(path) in str(raised.value) and "\n" not in str(raised.value)
    assert capfd.readouterr().err == ""  # nor does OpenCV add lines of its own


def test_folder_and_pattern_are_sequences_in_order_of_numbers(tmp_path: Path) -> None:
    for number in (1, 2, 9, 10, 11):
        write_image(tmp_path / f"view{number}.png", picture(number))
    (tmp_path / "notes.txt").write_text("not looked at")
    for reference in (str(tmp_path), str(tmp_path / "view*.png")):
        frames = list(open_source(reference))
        assert [number_of(f.image) for f in frames] == [1, 2, 9, 10, 11]
        assert [f.time for f in frames] == [0.0, 1.0, 2.0, 3.0, 4.0]
    some = open_source([tmp_path / "view9.png", tmp_path / "view1.png"])
    assert [number_of(f.image) for f in some] == [9, 1]


def test_a_broken_image_of_several_is_one_error(tmp_path: Path) -> None:
    write_image(tmp_path / "1.png", picture(1))
    (tmp_path / "2.png").write_bytes(b"\x89PNG")
    write_image(tmp_path / "3.png", picture(3))
    source = open_source(tmp_path)
    assert number_of(source.read().image) == 1  # type: ignore[union-attr]
    with pytest.raises(InvalidInputError, match=r"2\.png"):
        source.read()
    assert number_of(source.read().image) == 3  # type: ignore[union-attr]
    assert source.read() is None


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("nowhere.png", "nowhere.png does not exist; give an image or video file, a folder"),
        ("nowhere*.png", "no image files match 'nowhere*.png'"),
        ("", "the camera is an empty text"),
        (".", "has no images"),
    ],
)
def test_what_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidInputError) as raised:
        open_source(reference)
    assert message in str(raised.value)


# --- video files -----------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "MJPG"), ("a.mp4", "mp4v")])
def test_a_video_gives_all_frames_and_their_times(tmp_path: Path, name: str, codec: str) -> None:
    source = open_source(write_video(tmp_path / name, codec=codec))
    assert source.size == (64, 48) and source.fps == 25.0 and not source.live
    frames = list(source)
    assert [number_of(f.image) for f in frames] == list(range(10))
    assert np.allclose([f.time for f in frames], np.arange(10) / 25.0)
    assert frames[3].name == f"{name}, frame 3"
    assert frames[3].image[:, :6, 0].min() > 200  # red, not blue


def starts_of_frames(data: bytes | bytearray) -> list[int]:
    """Where the JPEGs of an MJPG video begin."""
    return [k for k in range(len(data) - 2) if data[k : k + 3] == b"\xff\xd8\xff"]


def test_broken_frames_of_a_video_are_left_out(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.avi", 12)
    data = bytearray(path.read_bytes())
    for _ in range(2):
        start = starts_of_frames(data)[4]  # of what is left
        data[start : start + 200] = bytes(200)
    path.write_bytes(data)
    source = VideoSource(path)
    frames = list(source)
    assert [number_of(f.image) for f in frames] == [0, 1, 2, 3, *range(6, 12)]
    assert source.broken == 2 and frames[4].time == 6 / 25.0


def test_a_cut_off_video_ends_earlier(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.avi", 12)
    data = path.read_bytes()
    path.write_bytes(data[: starts_of_frames(data)[7] + 50])
    assert [number_of(f.image) for f in open_source(path)] == list(range(7))


def test_what_is_no_video_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.mp4").write_text("not a video")
    (tmp_path / "b.mp4").write_bytes(b"")
    for name in ("a.mp4", "b.mp4"):
        with pytest.raises(InvalidInputError, match=f"{name} is empty"):
            open_source(tmp_path / name)
    assert capfd.readouterr().err == ""


# --- cameras ---------------------------------------------------------------------------------


class Streamer(http.server.ThreadingHTTPServer):
    """A network camera: sends JPEG images over HTTP until it is stopped."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, port: int = 0, size: tuple[int, int] = (64, 48)) -> None:
        super().__init__(("127.0.0.1", port), Stream)
        self.image_size, self.plugged_in, self.number = size, True, 0
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/stream.mjpg"

    def unplug(self) -> None:
        self.plugged_in = False
        self.shutdown()
        self.server_close()


class Stream(http.server.BaseHTTPRequestHandler):
    server: Streamer

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        try:
            while self.server.plugged_in:
                self.server.number = (self.server.number + 1) % 10
                image = picture(self.server.number, self.server.image_size)
                jpeg = cv2.imencode(".jpg", image[..., ::-1])[1].tobytes()
                head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                self.wfile.write(head.encode() + jpeg + b"\r\n")
                time.sleep(0.01)
        except OSError:
            pass

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A source that waits less than for real cameras."""
    monkeypatch.setattr(source_opening, "FRAME_TIMEOUT", 0.3)
    monkeypatch.setattr(source_opening, "MIN_REOPEN_INTERVAL", 0.05)
    monkeypatch.setattr(source_opening, "MAX_REOPEN_INTERVAL", 0.2)


@pytest.fixture
def streamer(impatient: None) -> Iterator[Streamer]:
    server = Streamer()
    yield server
    server.unplug()


def until_lost(source: FrameSource) -> CameraLost:
    for _ in range(2000):
        try:
            source.read()
        except CameraLost as error:
            return error
    raise AssertionError("the camera is not lost")


@pytest.mark.thorough
def test_a_lost_camera_comes_back(streamer: Streamer) -> None:
    port = streamer.server_port
    with open_source(streamer.address) as source:
        assert source.live and source.size == (64, 48)
        times = [source.read().time for _ in range(5)]  # type: ignore[union-attr]
        assert times == sorted(times) and len(set(times)) == 5
        streamer.unplug()
        lost = until_lost(source)
        assert "gives no images any more (unplugged?); waiting for it" in str(lost)
        assert "\n" not in str(lost)
        spent = time.process_time()
        with pytest.raises(CameraLost):
            source.read()
        assert time.process_time() - spent < 0.5  # it waited, and did not spin
        again = Streamer(port)
        frame = next(iter(source))
        assert frame.image.shape == (48, 64, 3) and frame.time > times[-1]
        again.unplug()


@pytest.mark.thorough
def test_a_camera_that_comes_back_with_other_images_stays_lost(streamer: Streamer) -> None:
    port = streamer.server_port
    with open_source(streamer.address) as source:
        streamer.unplug()
        until_lost(source)
        other = Streamer(port, (32, 24))
        for _ in range(200):
            with pytest.raises(CameraLost) as raised:
                source.read()
            if "now has" in str(raised.value):
                break
        assert str(raised.value).endswith("now has 32 x 24 pixels, not 64 x 48; waiting for it")
        other.unplug()


def test_closing_wakes_who_waits_for_a_camera(streamer: Streamer) -> None:
    source = open_source(streamer.address)
    streamer.unplug()
    until_lost(source)
    found: list[object] = []

    def read() -> None:
        try:
            found.append(source.read())
        except CameraLost as error:
            found.append(error)

    reader = threading.Thread(target=read)
    reader.start()
    time.sleep(0.1)
    source.close()
    reader.join(HANG_GUARD)
    assert found == [None] and source.read() is None


def test_a_slow_reader_sees_the_newest_image(streamer: Streamer) -> None:
    with open_source(streamer.address) as source:
        source.read()
        begun = time.monotonic()
        time.sleep(0.5)
        slept = time.monotonic() - begun
        first, second = source.read(), source.read()
        assert first is not None and second is not None
        assert second.time - first.time < 0.8 * slept  # not as old as that


def test_a_vanished_device_is_lost_and_a_new_one_found(tmp_path: Path, impatient: None) -> None:
    """VideoCapture treats a file as it does a device: images, then none, then it cannot open."""
    path = write_video(tmp_path / "device.avi", 3)
    hidden = tmp_path / "unplugged.avi"

    def open_capture() -> cv2.VideoCapture | None:
        with silence_opencv():
            capture = cv2.VideoCapture(str(path))
        return capture if capture.isOpened() else None

    with DeviceSource("camera 0", open_capture) as source:
        path.rename(hidden)
        assert str(until_lost(source)).startswith("camera 0 gives no images any more")
        hidden.rename(path)
        assert next(iter(source)).name == "camera 0"


def test_a_camera_that_does_not_open(capfd: pytest.CaptureFixture[str]) -> None:
    for reference, question in (
        ("99", "is it plugged in"),
        ("/dev/video99", "is it plugged in"),
        ("http://127.0.0.1:9/none.mjpg", "is the address right"),
    ):
        with pytest.raises(InvalidInputError, match=f"does not open; {question}") as raised:
            open_source(reference)
        assert reference in str(raised.value)
    assert capfd.readouterr().err == ""


def test_a_size_that_a_camera_does_not_have(streamer: Streamer) -> None:
    with pytest.raises(InvalidInputError, match="gives 64 x 48 pixels instead of 1280 x 720"):
        open_device(streamer.address, (1280, 720))


# --- simulated cameras -----------------------------------------------------------------------


def test_depth_of_a_simulated_camera_is_that_of_the_board() -> None:
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    camera = station.camera("board")
    X_WC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.45, 0.0, 0.5))

    def moving(moment: float) -> Array:
        return camera.X_WC.matrix() if moment == 0.0 else X_WC

    with SimulatedSource(scene, station, X_WC=moving, fps=20.0, live=False) as source:
        assert source.size == (640, 480) and source.name == "sim:panda_tabletop/board"
        for expected in (camera.X_WC.matrix(), X_WC):
            frame = source.read()
            assert frame is not None and frame.depth is not None
            assert frame.image.shape == (480, 640, 3) and frame.image.std() > 10.0
            pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1)
            k = camera_intrinsics(camera)
            rays = np.concatenate([(pixels - k.center) / k.focal, np.ones((480, 640, 1))], axis=-1)
            depth = -expected[2, 3] / (rays @ expected[:3, :3].T)[..., 2]
            on_board = np.abs(frame.depth - depth) < 2e-4
            assert on_board.mean() > 0.3  # the rest are objects and what lies beside the table
        assert frame.time == 0.05
    assert source.read() is None


def test_a_simulated_camera_needs_its_scene_and_name() -> None:
    scene = load_scene("tabletop_six")
    with pytest.raises(InvalidInputError, match="is a simulated camera, which needs a scene"):
        open_source("sim:panda_tabletop/board")
    with pytest.raises(UnknownNameError, match=r"has no camera 'boards'.*did you mean 'board'"):
        open_source("sim:panda_tabletop/boards", scene=scene)
    with pytest.raises(UnknownNameError, match=r"panda_tabletob.* does not exist"):
        open_source("sim:panda_tabletob", scene=scene)
    for name in ("nowhere/board", "nowhere"):
        with pytest.raises(UnknownNameError) as raised:
            open_source(f"sim:{name}", scene=scene)
        start = f"station of sim:{name}: station nowhere does not exist; known: "
        assert str(raised.value).startswith(start)
