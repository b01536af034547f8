"""The HTTP server of `burg-drake trials serve`, the page on which trials are recorded."""

from __future__ import annotations

import ipaddress
import json
import math
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import partial
from http import HTTPStatus
from typing import Any

from burg_drake.apps.page_server import (
    Handler,
    PageHandler,
    PageServer,
    parse_address,
    parse_picture_number,
)
from burg_drake.core import (
    BrowserToken,
    BurgError,
    RealOutcome,
    RequestError,
    quote_value,
    require_local_host,
)
from burg_drake.experiment import (
    EntryConflict,
    LabBook,
    LabCamera,
    LabEntry,
    PictureCache,
    entry_data,
    entry_states,
    parse_real_outcome,
    plan_data,
)

ENTRY_FIELDS = {
    "plan": str,
    "number": int,
    "replaces": str,
    "outcome": str,
    "time": str,
    "operator": str,
    "note": str,
    "width_mm": float,
}
"""Fields of an entry, and their types."""


def parse_lab_entry(body: dict[str, Any], plan: str) -> LabEntry:
    """The entry in the body of a request.

    Args:
        body: what was sent.
        plan: of the trials file that is served.

    Raises:
        RequestError: a field is unknown, missing, or no such value; another plan.
    """
    for name, value in body.items():
        if name not in ENTRY_FIELDS:
            raise _bad_request(
                f"an entry has no {quote_value(name)}; it has {', '.join(ENTRY_FIELDS)}"
            )
        if value is not None and not _has_type(ENTRY_FIELDS[name], value):
            raise _bad_request(
                f"{name} must be a {ENTRY_FIELDS[name].__name__}, not {quote_value(value)}"
            )
        if isinstance(value, str):
            _require_line(name, value)
    for name in ("plan", "number", "replaces", "time"):
        if body.get(name) is None:
            raise _bad_request(f"an entry needs {name}")
    if body["plan"] != plan:
        raise RequestError(HTTPStatus.CONFLICT, "this entry is of another trials file")
    return LabEntry(
        number=body["number"],
        replaces=body["replaces"],
        outcome=_parse_outcome(body.get("outcome")),
        time=_parse_time(body["time"]),
        operator=(body.get("operator") or "").strip(),
        note=(body.get("note") or "").strip(),
        width_mm=_parse_width(body.get("width_mm")),
    )


def parse_trial_number(body: dict[str, Any]) -> int:
    """`number` of a request that is about a trial.

    Raises:
        RequestError: there is none.
    """
    number = body.get("number")
    if not _has_type(int, number):
        raise _bad_request(f"number must be that of a trial, not {quote_value(number)}")
    return int(body["number"])


def _has_type(kind: type, value: Any) -> bool:
    if isinstance(value, bool):
        return False
    return isinstance(value, (int, float) if kind is float else kind)


def _require_line(name: str, value: str) -> None:
    """Refuses what is too long, and what is not a text: parts of characters, control characters."""
    max_lengths = {"note": 2000, "operator": 100}  # Characters. Other fields have at most 64.
    most = max_lengths.get(name, 64)
    if len(value) > most:
        raise _bad_request(f"{name} has {len(value)} characters; at most {most}")
    if any(0xD800 <= ord(c) < 0xE000 or (ord(c) < 32 and c not in "\n\t") for c in value):
        raise _bad_request(f"{name} has characters that are no text")


def _parse_outcome(value: str | None) -> RealOutcome | None:
    if value is None:
        return None
    try:
        return parse_real_outcome(value)
    except BurgError as error:
        raise _bad_request(str(error)) from error


def _parse_time(value: str) -> str:
    try:
        moment = datetime.fromisoformat(value)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise _bad_request(f"time {quote_value(value)} is not a date and time with its zone")
    return moment.isoformat(timespec="seconds")


def _parse_width(value: float | None) -> float | None:
    max_width_mm = 10_000.0
    if value is None:
        return None
    if not math.isfinite(value) or not 0.0 <= value <= max_width_mm:
        raise _bad_request(f"width_mm must be from 0 to {max_width_mm:g}, not {quote_value(value)}")
    return float(value)


def _bad_request(message: str) -> RequestError:
    return RequestError(HTTPStatus.BAD_REQUEST, message)


LAB_PAGE_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    **{
        f"/{name}": (name, "text/javascript; charset=utf-8")
        for name in ("page.js", "outbox.js", "troubles.js", "entering.js", "list.js", "camera.js")
    },
}
"""File name and content type of the lab page's files, by path."""


class LabServer(PageServer):
    """Serves trials until it is closed.

    Args:
        lab: the trials.
        pictures: of the trials.
        camera: over the board, if there is one.
        host: address to listen on; only this machine can reach the default.
        port: to listen on; the first free one from `first_port` on if None, any if 0.
        secret: of the cookie of browsers on other machines, for one that outlives the process; a
            new one if None.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port = 7300
    poll = 0.05

    def __init__(
        self,
        lab: LabBook,
        pictures: PictureCache,
        camera: LabCamera | None = None,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        secret: str | None = None,
    ) -> None:
        self.lab, self.pictures, self.camera = lab, pictures, camera
        self.plan = json.dumps(plan_data(lab) | {"camera": camera is not None}).encode()
        super().__init__(LabHandler, host=host, port=port)
        bound, number = self.server_address[:2]
        local = ipaddress.ip_address(str(bound)).is_loopback
        self.token = None if local else BrowserToken(f"burg_drake_{number}", secret)
        self.on_admitted: Callable[[str], None] = lambda peer: None

    @property
    def url(self) -> str:
        """Address of the page for the next browser; with a token, good for one alone, if other
        machines can reach it."""
        return super().url if self.token is None else f"{super().url}?token={self.token.token}"


class LabHandler(PageHandler):
    """Answers one connection's requests."""

    server: LabServer
    folder = "lab_page"
    pages = LAB_PAGE_FILES
    policy = "default-src 'self'; img-src 'self' blob: data:; object-src 'none';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    refused_code = HTTPStatus.UNPROCESSABLE_ENTITY

    def do_GET(self) -> None:
        """Pages, pictures, what was entered."""
        self.answer(
            {
                "/plan": self._send_plan,
                "/states": self._send_states,
                "/frame.jpg": self._send_frame,
                "/camera": self._send_camera,
            }
        )

    def do_POST(self) -> None:
        """Entries and actions."""
        self.answer({"/entry": self._enter, "/watch": self._watch, "/check": self._check})

    def admitted(self) -> tuple[str, dict[str, str]]:
        """This machine is meant, and the browser was admitted or brings the token."""
        path, query = parse_address(self.path)
        require_local_host(self._header, served=self.server.host, is_page=path == "/")
        self._require_browser(path, query)
        return path, query

    def find(self, routes: Mapping[str, Handler], path: str) -> Handler:
        """Pictures have addresses of their own."""
        if self.command == "GET" and path.startswith("/picture/"):
            name = path.removeprefix("/picture/").removesuffix(".jpg")
            return partial(self._send_picture, name)
        return super().find(routes, path)

    def refusal(self, error: BurgError) -> tuple[Any, HTTPStatus]:
        """An entry that another one came before is answered with that one."""
        if isinstance(error, EntryConflict):
            answer = {"error": str(error), "entry": entry_data(error.trial)}
            return answer, HTTPStatus.CONFLICT
        return super().refusal(error)

    def _header(self, name: str) -> str | None:
        """A header; given twice it would mean one thing here and another thing there."""
        values = self.headers.get_all(name, [])
        if len(values) > 1:
            raise RequestError(HTTPStatus.BAD_REQUEST, f"{name} is given twice")
        return values[0] if values else None

    def _require_browser(self, path: str, query: dict[str, str]) -> None:
        """Lets in who was admitted, or brings the token."""
        message = (
            "open this page by the address with a token that burg-drake printed last; each"
            " address works in one browser"
        )
        token, self.new_cookie = self.server.token, ""
        if token is None or token.admits(self._header("Cookie") or ""):
            return
        if path != "/" or not token.use(query.get("token", "")):
            raise RequestError(HTTPStatus.FORBIDDEN, message)
        self.new_cookie = token.set_cookie
        self.server.on_admitted(str(self.client_address[0]))

    def _send_plan(self, query: dict[str, str]) -> None:
        self.send(HTTPStatus.OK, "application/json", self.server.plan)

    def _send_states(self, query: dict[str, str]) -> None:
        found = entry_states(self.server.lab)
        if "version" in found and found["version"] == query.get("after"):
            self.send(HTTPStatus.NO_CONTENT)
        else:
            self.send_json(found)

    def _send_picture(self, name: str, query: dict[str, str]) -> None:
        rendering_timeout = 20.0  # Seconds that the request waits for a picture.
        picture = self.server.pictures.get(name, rendering_timeout)
        if picture is None:
            fault = self.server.pictures.fault or f"there is no picture {name[:100]}"
            raise RequestError(HTTPStatus.NOT_FOUND, fault)
        self.send(HTTPStatus.OK, "image/jpeg", picture, {"Cache-Control": "private, max-age=86400"})

    def _send_frame(self, query: dict[str, str]) -> None:
        frame_timeout = 1.0  # Seconds that the request waits for a newer frame.
        after = parse_picture_number(query)
        epoch = parse_picture_number({"after": query.get("epoch", "0")})
        found = self._camera().next_picture(epoch, after, frame_timeout)
        if found is None:
            self.send(HTTPStatus.NO_CONTENT)
            return
        epoch, picture = found
        headers = {"X-Picture": str(picture.number), "X-Epoch": str(epoch)}
        self.send(HTTPStatus.OK, "image/jpeg", picture.jpeg, headers)

    def _send_camera(self, query: dict[str, str]) -> None:
        self.send_json(self._camera().status())

    def _enter(self, body: dict[str, Any]) -> None:
        entry = parse_lab_entry(body, self.server.lab.plan)
        self.send_json({"entry": entry_data(self.server.lab.enter(entry))})

    def _watch(self, body: dict[str, Any]) -> None:
        self._camera().watch(parse_trial_number(body))
        self.send_json({})

    def _check(self, body: dict[str, Any]) -> None:
        if not isinstance(body.get("keep"), bool):
            raise RequestError(HTTPStatus.BAD_REQUEST, '"keep" must be true or false')
        self._camera().check(parse_trial_number(body), keep=body["keep"])
        self.send_json({})

    def _camera(self) -> LabCamera:
        if self.server.camera is None:
            raise RequestError(HTTPStatus.NOT_FOUND, "there is no camera; start with --camera")
        return self.server.camera
