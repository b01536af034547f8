"""What the door lets through to viser, from a browser and from programs that are no page."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import viser
from viser._messages import FileTransferStartUpload, Message, ShareUrlRequest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from burg_drake.ui import (
    MAX_ALL_UPLOADS_BYTES,
    MAX_MESSAGE_BYTES,
    MAX_UPLOAD_BYTES,
    MESSAGE_BURST,
    MESSAGE_RATE,
    ServedPage,
    guarded_viser,
    serve_page,
)
from tests.hang_guard import HANG_GUARD
from tests.ui.page_client import CAMERA, coming_in, send, unpacked


@pytest.fixture(scope="module")
def door() -> Iterator[ServedPage]:
    with serve_page(port=0) as door:
        yield door


@pytest.fixture(scope="module")
def button(door: ServedPage) -> viser.GuiUploadButtonHandle:
    return door.server.gui.add_upload_button("Load a photo")


@pytest.fixture
def client(door: ServedPage) -> Iterator[ClientConnection]:
    """A program that came in as a page does; it may send anything."""
    with coming_in(door) as client:
        send(client, "ViewerCameraMessage", **CAMERA)
        yield client


def announce(client: ClientConnection, button: viser.GuiUploadButtonHandle, **fields: Any) -> None:
    usual = {
        "source_component_uuid": button._impl.uuid,
        "transfer_uuid": "a",
        "filename": "photo.png",
        "mime_type": "image/png",
        "size_bytes": 10,
        "part_count": 1,
    }
    send(client, "FileTransferStartUpload", **usual | fields)


def part(
    client: ClientConnection, button: viser.GuiUploadButtonHandle, content: bytes, **fields: Any
) -> None:
    usual = {"source_component_uuid": button._impl.uuid, "transfer_uuid": "a", "part_index": 0}
    send(client, "FileTransferPart", **usual | fields, content=content)


def closed(client: ClientConnection) -> tuple[int, str]:
    """Code and reason by which the door closes the connection."""
    with pytest.raises(ConnectionClosed) as caught:
        while True:
            client.recv(timeout=HANG_GUARD)
    assert caught.value.rcvd is not None
    return caught.value.rcvd.code, caught.value.rcvd.reason


@pytest.mark.thorough
def test_a_browser_uploads_what_is_small_enough(
    door: ServedPage, button, page, tmp_path: Path
) -> None:
    arrived = threading.Event()
    button.on_upload(lambda event: arrived.set())
    photo, film = tmp_path / "photo.png", tmp_path / "film.png"
    photo.write_bytes(bytes(range(256)) * 4000)
    with film.open("wb") as file:
        file.truncate(MAX_UPLOAD_BYTES + 1)
    page.goto(door.url)
    page.get_by_role("button", name="Load a photo").wait_for()
    page.set_input_files("input[type=file]", film)
    page.get_by_role("alert").get_by_text("film.png was not sent: it has 32.0 MiB").wait_for()
    page.get_by_role("button", name="Close").click()
    assert page.get_by_text("film.png").count() == 0
    page.set_input_files("input[type=file]", photo)
    assert arrived.wait(HANG_GUARD)
    assert button.value.name == "photo.png" and button.value.content == photo.read_bytes()
    assert door.server.gui._current_file_upload_states == {}


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"size_bytes": MAX_UPLOAD_BYTES + 1, "part_count": 100}, "bytes is refused"),
        ({"size_bytes": -1, "part_count": 1}, "bytes is refused"),
        ({"size_bytes": 10, "part_count": 1 << 40}, "parts is refused"),
        ({"size_bytes": 10, "part_count": 0}, "parts is refused"),
        ({"size_bytes": 10, "part_count": -1}, "parts is refused"),
        ({"filename": "../photo.png"}, "file name is not allowed"),
        ({"filename": "/etc/passwd"}, "file name is not allowed"),
        ({"filename": "..\\photo.png"}, "file name is not allowed"),
        ({"filename": ".."}, "file name is not allowed"),
        ({"filename": "a" * 256}, "file name is not allowed"),
    ],
)
def test_a_file_that_no_page_sends_is_refused_before_it_comes(
    door: ServedPage, button, client: ClientConnection, fields: dict[str, Any], reason: str
) -> None:
    announce(client, button, **fields)
    code, said = closed(client)
    assert code == 1008 and reason in said
    assert door.server.gui._current_file_upload_states == {}


def test_more_than_was_announced_is_refused(button, client: ClientConnection) -> None:
    announce(client, button)
    part(client, button, bytes(11))
    assert closed(client) == (1008, "a file is larger than announced")


def test_many_files_at_once_are_bounded(button, client: ClientConnection) -> None:
    for k in range(MAX_ALL_UPLOADS_BYTES // MAX_UPLOAD_BYTES + 1):
        announce(client, button, transfer_uuid=str(k), size_bytes=MAX_UPLOAD_BYTES, part_count=64)
    assert closed(client) == (1008, "the files uploaded at once are too large")


def test_who_goes_away_leaves_nothing_behind(door: ServedPage, button) -> None:
    with coming_in(door) as client:  # viser would keep the parts of those who show no camera
        announce(client, button)
        assert closed(client)[0] == 1008
    for key in ("b", "c", "d"):  # more than may be on their way at once
        with coming_in(door) as client:
            send(client, "ViewerCameraMessage", **CAMERA)
            announce(client, button, transfer_uuid=key, size_bytes=MAX_UPLOAD_BYTES, part_count=64)
            part(client, button, bytes(1000), transfer_uuid=key)
            wait_for(client, key)
    end = time.monotonic() + HANG_GUARD
    while door.server.gui._current_file_upload_states:  # the server hears of it in a moment
        assert time.monotonic() < end
        time.sleep(0.01)


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What a terminal would show where nobody has set up logging."""
    return [
        record.getMessage()
        for record in caplog.records
        if record.levelno >= logging.WARNING and record.name != guarded_viser.__name__
    ]


def wait_for(client: ClientConnection, key: str) -> None:
    """Waits until viser has taken a part of this file."""
    taken = msgspec.msgpack.encode("transfer_uuid") + msgspec.msgpack.encode(key)
    while taken not in unpacked(client.recv(timeout=HANG_GUARD)):
        pass


def test_new_pages_hear_of_no_old_uploads(
    door: ServedPage, button, client: ClientConnection
) -> None:
    announce(client, button, transfer_uuid="old")
    part(client, button, bytes(10), transfer_uuid="old")
    wait_for(client, "old")
    with coming_in(door) as other:
        replay = b""
        while b"ReplayDoneMessage" not in replay:
            replay += unpacked(other.recv(timeout=HANG_GUARD))
        assert b"Load a photo" in replay and b"FileTransferPartAck" not in replay


@pytest.mark.thorough
def test_a_flood_is_paced(
    door: ServedPage, button, client: ClientConnection, caplog: pytest.LogCaptureFixture
) -> None:
    begun = time.monotonic()
    for _ in range(int(MESSAGE_BURST + MESSAGE_RATE)):
        send(client, "ShareUrlRequest")
    with coming_in(door) as other:  # meanwhile others get on
        send(other, "ViewerCameraMessage", **CAMERA)
        announce(other, button, transfer_uuid="quick")
        part(other, button, bytes(10), transfer_uuid="quick")
        wait_for(other, "quick")
    announce(client, button, transfer_uuid="late")
    part(client, button, bytes(10), transfer_uuid="late")
    wait_for(client, "late")
    assert time.monotonic() - begun > 0.9  # a second's worth more than what may come at once
    assert told(caplog) == []


def test_nobody_opens_a_public_tunnel(door: ServedPage, button, client: ClientConnection) -> None:
    asked: list[Message] = []
    for kind in (ShareUrlRequest, FileTransferStartUpload):
        door.server._websock_server.register_handler(kind, lambda _, message: asked.append(message))
    send(client, "ShareUrlRequest")
    announce(client, button, transfer_uuid="e")
    part(client, button, bytes(10), transfer_uuid="e")
    wait_for(client, "e")
    assert [type(message) for message in asked] == [FileTransferStartUpload]
    assert door.server._share_tunnel is None


def test_values_of_another_type_change_nothing(
    door: ServedPage, button, client: ClientConnection, caplog: pytest.LogCaptureFixture
) -> None:
    slider = door.server.gui.add_slider("Length", 0.0, 1.0, 0.1, 0.5)
    for value in ("x", None, {}, []):
        send(client, "GuiUpdateMessage", uuid=slider._impl.uuid, updates={"value": value})
    announce(client, button, transfer_uuid="f")
    part(client, button, bytes(10), transfer_uuid="f")
    wait_for(client, "f")
    assert slider.value == 0.5
    assert told(caplog) == []


def test_errors_of_a_page_are_told(
    door: ServedPage, client: ClientConnection, caplog: pytest.LogCaptureFixture
) -> None:
    slider = door.server.gui.add_slider("Width", 0.0, 1.0, 0.1, 0.5)

    @slider.on_update
    async def _(event: object) -> None:
        raise ZeroDivisionError("of the page")

    send(client, "GuiUpdateMessage", uuid=slider._impl.uuid, updates={"value": 0.25})
    end = time.monotonic() + HANG_GUARD
    while not told(caplog):
        assert time.monotonic() < end
        time.sleep(0.01)
    assert "ZeroDivisionError: of the page" in caplog.text


def test_only_values_of_controls_are_set(door: ServedPage, client: ClientConnection) -> None:
    slider = door.server.gui.add_slider("Size", 0.0, 1.0, 0.1, 0.5)
    send(client, "GuiUpdateMessage", uuid=slider._impl.uuid, updates={"update_cb": []})
    assert closed(client) == (1008, "only values of controls can be set")


@pytest.mark.parametrize(
    ("raw", "code"),
    [
        ("text", 1003),
        (b"", 1007),
        (b"\xc1", 1007),
        (b"\x91" * 100_000, 1007),
        (msgspec.msgpack.encode({"type": 1}), 1007),
        (msgspec.msgpack.encode({"type": "FileTransferPart", "content": [1]}), 1007),
        (bytes(MAX_MESSAGE_BYTES + 1), 1009),
    ],
    ids=["text", "empty", "invalid", "nested", "type", "content", "large"],
)
def test_malformed_messages_end_the_connection_quietly(
    client: ClientConnection, caplog: pytest.LogCaptureFixture, raw: str | bytes, code: int
) -> None:
    client.send(raw)
    assert closed(client)[0] == code
    assert told(caplog) == []
