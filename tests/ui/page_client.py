"""A page without a browser: it sends the messages of viser's page, and keeps the shown content.

It costs next to nothing where a real browser draws every frame in software.
"""

from __future__ import annotations

import threading
from types import TracebackType
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from burg_drake.ui import ServedPage
from tests.hang_guard import HANG_GUARD, until

POSING = ("SetSceneNodeVisibilityMessage", "SetPositionMessage", "SetOrientationMessage")
CAMERA_FIELDS = {
    "SetCameraPositionMessage": ("position", "position"),
    "SetCameraLookAtMessage": ("look_at", "look_at"),
    "SetCameraUpDirectionMessage": ("position", "up_direction"),
    "SetCameraFovMessage": ("fov", "fov"),
}
"""By the messages that set one: what it is called there, and in what pages report."""
CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 1.0),
    "fov": 1.0,
    "near": 0.01,
    "far": 10.0,
    "image_height": 480,
    "image_width": 640,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 1.0, 0.0),
}


def coming_in(door: ServedPage) -> ClientConnection:
    """A connection like that of a page."""
    return connect(
        f"ws://127.0.0.1:{door.port}/",
        origin=Origin(f"http://127.0.0.1:{door.port}"),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        compression=None,
    )


def send(connection: ClientConnection, kind: str, **fields: Any) -> None:
    """Sends a message of viser's."""
    connection.send(msgspec.msgpack.encode({"type": kind, **fields}))


def unpacked(raw: str | bytes) -> bytes:
    """Decodes a message of viser from MessagePack."""
    assert isinstance(raw, bytes)
    size = int.from_bytes(raw[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(raw[16 : 16 + size])


class PageClient:
    """An open page.

    Args:
        door: of the page.

    Attributes:
        nodes: properties of what is in the scene, by its name; `visible` and `position` as well.
        told: titles and lines of notifications, and titles of dialogs.
        notes: notifications that have not been taken away.
        first_view: position of the camera that the server wants pages to begin with.
        camera: as it was last set or reported.
    """

    def __init__(self, door: ServedPage) -> None:
        self.nodes: dict[str, dict[str, Any]] = {}
        self.told: list[str] = []
        self.notes: dict[str, str] = {}
        self.first_view: list[float] = []
        self.camera: dict[str, Any] = dict(CAMERA)
        self._controls: dict[str, dict[str, Any]] = {}
        self._commands: dict[tuple[str, str | None], str] = {}
        self._complete = threading.Event()
        before = set(door.server.get_clients())
        self._connection = coming_in(door)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        self.report_camera()
        assert self._complete.wait(HANG_GUARD)
        until(lambda: set(door.server.get_clients()) - before, "the server knows the page")

    def __enter__(self) -> PageClient:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._connection.close()
        self._thread.join(HANG_GUARD)

    def report_camera(self, **changes: Any) -> None:
        """Reports the camera, as after a movement or a change of the window's size."""
        self.camera.update(changes)
        send(self._connection, "ViewerCameraMessage", **self.camera)

    def value(self, folder: str, label: str) -> Any:
        """The value of a field in a folder."""
        return self._control(folder, label)["value"]

    def options(self, folder: str, label: str) -> list[str]:
        """The choices of a field."""
        return list(self._control(folder, label)["options"])

    def shown(self, folder: str, label: str) -> bool:
        """Whether a field is visible."""
        return bool(self._control(folder, label)["visible"])

    def text(self, folder: str) -> str:
        """The HTML of a folder."""
        inside = [c for c in list(self._controls.values()) if self._folder(c) == folder]
        return "".join(control.get("content", "") for control in inside)

    def give(self, folder: str, label: str, value: Any) -> None:
        """Chooses or types a value."""
        control = self._control(folder, label)
        control["value"] = value
        send(self._connection, "GuiUpdateMessage", uuid=control["uuid"], updates={"value": value})

    def click(self, folder: str, label: str) -> None:
        """Presses a button."""
        self.give(folder, label, True)

    def press(self, key: str, modifier: str | None = None) -> None:
        """Presses a key, by its name in viser."""
        send(self._connection, "CommandTriggerMessage", uuid=self._commands[key, modifier])

    def upload(self, folder: str, label: str, name: str, content: bytes) -> None:
        """Uploads a file with a button."""
        ids = {
            "source_component_uuid": self._control(folder, label)["uuid"],
            "transfer_uuid": name,
        }
        send(
            self._connection,
            "FileTransferStartUpload",
            **ids,
            filename=name,
            mime_type="image/png",
            size_bytes=len(content),
            part_count=1,
        )
        send(self._connection, "FileTransferPart", **ids, part_index=0, content=content)

    def drag_handles(self, name: str, phase: str, **pose: Any) -> None:
        """Drags transform controls: `Start`, `Update` with `wxyz` and `position`, `End`."""
        kind = "" if phase == "Update" else "Drag"
        send(self._connection, f"TransformControls{kind}{phase}Message", name=name, **pose)

    def _control(self, folder: str, label: str) -> dict[str, Any]:
        found = [
            control
            for control in list(self._controls.values())
            if control.get("label") == label and self._folder(control) == folder
        ]
        assert len(found) == 1, f"{len(found)} controls {label!r} in {folder!r}"
        return found[0]

    def _folder(self, control: dict[str, Any]) -> str:
        """The name of the folder around a control; skips folders without a name."""
        around = self._controls.get(control.get("container_uuid", ""), {})
        if not around:
            return ""
        return str(around.get("label") or self._folder(around))

    def _listen(self) -> None:
        try:
            for raw in self._connection:
                for message in msgspec.msgpack.decode(unpacked(raw))["messages"]:
                    self._take(message)
        except ConnectionClosed:
            pass

    def _take(self, message: dict[str, Any]) -> None:
        kind, name = message["type"], message.get("name", "")
        if kind == "ReplayDoneMessage":
            self._complete.set()
        elif kind == "SetCameraPositionMessage" and message["initial"]:
            self.first_view = list(message["position"])
        elif kind in CAMERA_FIELDS and not message["initial"]:
            given, field = CAMERA_FIELDS[kind]
            self.camera[field] = message[given]
        elif kind == "NotificationShowMessage":
            props = message["props"]
            self.notes[message["uuid"]] = f"{props['title']}: {props['body']}"
            self.told.append(self.notes[message["uuid"]])
        elif kind == "RemoveNotificationMessage":
            self.notes.pop(message["uuid"], None)
        elif kind == "GuiModalMessage":
            self.told.append(message["title"])
        elif kind == "RegisterCommandMessage":
            props = message["props"]
            self._commands[props["hotkey"], props["modifier"]] = message["uuid"]
        elif kind == "GuiUpdateMessage":
            self._controls[message["uuid"]].update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self._controls.pop(message["uuid"], None)
        elif kind == "RemoveSceneNodeMessage":
            self.nodes.pop(name, None)
        elif kind == "SceneNodeUpdateMessage":
            self.nodes[name].update(message["updates"])
        elif kind in POSING:
            self.nodes.setdefault(name, {}).update(message)
        elif kind.startswith("Gui") and "uuid" in message:
            self._controls[message["uuid"]] = {**message, **message.get("props", {})}
        elif name and "props" in message:
            self.nodes[name] = dict(message["props"])
