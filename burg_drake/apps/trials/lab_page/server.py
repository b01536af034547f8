"""Serves the page of the lab to browsers.

    GET  /                    the page, with its style sheet and scripts
    GET  /plan                JSON: trials in their order, outcomes; does not change
    GET  /states              JSON: what was entered so far; with ?after=VERSION 204 if it is that
    GET  /picture/NAME.jpg    grasp/NUMBER, above/BLOCK or front/BLOCK, kept by browsers
    GET  /frame.jpg           the newest picture of the camera; with ?epoch=E&after=N another one
    GET  /camera              JSON, see `LabCamera.status`
    POST /entry               an entry, see `entry_requests`; it is on the disk when this answers
    POST /watch               {"number": 3}: the camera looks at the scene of that trial
    POST /check               {"number": 3, "keep": true}: begins a placement check

Other web sites that the browser has open can neither see nor do anything here: requests must name
this machine as their host (which stops DNS rebinding), and what acts must come from this page.
Where other machines can reach the page, a browser needs the token of the printed address, once.
"""

from __future__ import annotations

import ipaddress
import json
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from typing import Any

from burg_drake.apps.trials.lab_page.entry_requests import lab_entry, trial_number
from burg_drake.apps.web import Handler, PageHandler, PageServer, address, picture_number
from burg_drake.core import LOCALHOST, BrowserToken, BurgError, RequestError, require_local_host
from burg_drake.experiment.pages import (
    EntryConflict,
    LabBook,
    LabCamera,
    PictureCache,
    entry_data,
    plan_data,
    states,
)

FIRST_PORT = 7300
"""Without a port the first free one from here on; those of the setup page begin at 7200."""
PATIENCE = 1.0
"""How long a request for a picture of the camera waits for a newer one [s]."""
RENDERING = 20.0
"""How long a request for a picture of a grasp waits until it is made [s]."""
POLL = 0.05
"""Between two looks of whether to stop serving [s]."""
SCRIPTS = ("page.js", "outbox.js", "troubles.js", "entering.js", "list.js", "camera.js")
PAGES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    **{f"/{name}": (name, "text/javascript; charset=utf-8") for name in SCRIPTS},
}
POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; object-src 'none';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
KEPT = "private, max-age=86400"
"""Of pictures of grasps, whose addresses name the plan."""
NO_TOKEN = (
    "open this page by the address with a token that burg-drake printed last; each address works"
    " in one browser"
)


class LabServer(PageServer):
    """Serves trials until it is closed.

    Args:
        lab: the trials.
        pictures: of the trials.
        camera: over the board, if there is one.
        host: address to listen on; only this machine can reach the default.
        port: to listen on; the first free one from `FIRST_PORT` on if None, any if 0.
        secret: of the cookie of browsers on other machines, for one that outlives the process; a
            new one if None.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port = FIRST_PORT
    poll = POLL

    def __init__(
        self,
        lab: LabBook,
        pictures: PictureCache,
        camera: LabCamera | None = None,
        *,
        host: str = LOCALHOST,
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
    package = "burg_drake.apps.trials.lab_page"
    pages = PAGES
    policy = POLICY
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
        path, query = address(self.path)
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
        token, self.new_cookie = self.server.token, ""
        if token is None or token.admits(self._header("Cookie") or ""):
            return
        if path != "/" or not token.use(query.get("token", "")):
            raise RequestError(HTTPStatus.FORBIDDEN, NO_TOKEN)
        self.new_cookie = token.set_cookie
        self.server.on_admitted(str(self.client_address[0]))

    def _send_plan(self, query: dict[str, str]) -> None:
        self.send(HTTPStatus.OK, "application/json", self.server.plan)

    def _send_states(self, query: dict[str, str]) -> None:
        found = states(self.server.lab)
        if "version" in found and found["version"] == query.get("after"):
            self.send(HTTPStatus.NO_CONTENT)
        else:
            self.send_json(found)

    def _send_picture(self, name: str, query: dict[str, str]) -> None:
        picture = self.server.pictures.get(name, RENDERING)
        if picture is None:
            fault = self.server.pictures.fault or f"there is no picture {name[:100]}"
            raise RequestError(HTTPStatus.NOT_FOUND, fault)
        self.send(HTTPStatus.OK, "image/jpeg", picture, {"Cache-Control": KEPT})

    def _send_frame(self, query: dict[str, str]) -> None:
        after = picture_number(query)
        epoch = picture_number({"after": query.get("epoch", "0")})
        found = self._camera().next_picture(epoch, after, PATIENCE)
        if found is None:
            self.send(HTTPStatus.NO_CONTENT)
            return
        epoch, picture = found
        headers = {"X-Picture": str(picture.number), "X-Epoch": str(epoch)}
        self.send(HTTPStatus.OK, "image/jpeg", picture.jpeg, headers)

    def _send_camera(self, query: dict[str, str]) -> None:
        self.send_json(self._camera().status())

    def _enter(self, body: dict[str, Any]) -> None:
        entry = lab_entry(body, self.server.lab.plan)
        self.send_json({"entry": entry_data(self.server.lab.enter(entry))})

    def _watch(self, body: dict[str, Any]) -> None:
        self._camera().watch(trial_number(body))
        self.send_json({})

    def _check(self, body: dict[str, Any]) -> None:
        if not isinstance(body.get("keep"), bool):
            raise RequestError(HTTPStatus.BAD_REQUEST, '"keep" must be true or false')
        self._camera().check(trial_number(body), keep=body["keep"])
        self.send_json({})

    def _camera(self) -> LabCamera:
        if self.server.camera is None:
            raise RequestError(HTTPStatus.NOT_FOUND, "there is no camera; start with --camera")
        return self.server.camera
