"""The HTTP server of `burg-drake trials serve`, the page on which trials are recorded."""

from __future__ import annotations

import ipaddress
import math
from collections.abc import Callable
from datetime import datetime
from http import HTTPStatus
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from burg_drake import core
from burg_drake.apps.page_server import (
    PageServer,
    file_routes,
    get_route,
    json_response,
    parse_picture_number,
    post_route,
    request_header,
)
from burg_drake.experiment import (
    LabBook,
    LabCamera,
    LabEntry,
    PictureCache,
    TrialChanged,
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
        body: JSON object of the request.
        plan: plan of the served trials file.

    Raises:
        RequestError: a field is unknown, missing or invalid, or the plan is another one.
    """
    for name, value in body.items():
        if name not in ENTRY_FIELDS:
            raise _bad_request(
                f"an entry has no {core.quote_value(name)}; it has {', '.join(ENTRY_FIELDS)}"
            )
        if value is not None and not _has_type(ENTRY_FIELDS[name], value):
            raise _bad_request(
                f"{name} must be a {ENTRY_FIELDS[name].__name__}, not {core.quote_value(value)}"
            )
        if isinstance(value, str):
            _require_line(name, value)
    for name in ("plan", "number", "replaces", "time"):
        if body.get(name) is None:
            raise _bad_request(f"an entry needs {name}")
    if body["plan"] != plan:
        raise core.RequestError(HTTPStatus.CONFLICT, "this entry is of another trials file")
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
    """The `number` of the trial in a request.

    Raises:
        RequestError: it is missing or invalid.
    """
    number = body.get("number")
    if not _has_type(int, number):
        raise _bad_request(f"number must be that of a trial, not {core.quote_value(number)}")
    return int(body["number"])


def _has_type(kind: type, value: Any) -> bool:
    if isinstance(value, bool):
        return False
    return isinstance(value, (int, float) if kind is float else kind)


def _require_line(name: str, value: str) -> None:
    """Refuses text that is too long, or has lone surrogates or control characters."""
    max_lengths = {"note": 2000, "operator": 100}  # Characters. Other fields have at most 64.
    max_length = max_lengths.get(name, 64)
    if len(value) > max_length:
        raise _bad_request(f"{name} has {len(value)} characters; at most {max_length}")
    if any(0xD800 <= ord(c) < 0xE000 or (ord(c) < 32 and c not in "\n\t") for c in value):
        raise _bad_request(f"{name} has characters that are no text")


def _parse_outcome(value: str | None) -> core.RealOutcome | None:
    if value is None:
        return None
    try:
        return parse_real_outcome(value)
    except core.BurgError as error:
        raise _bad_request(str(error)) from error


def _parse_time(value: str) -> str:
    try:
        moment = datetime.fromisoformat(value)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise _bad_request(f"time {core.quote_value(value)} is not a date and time with its zone")
    return moment.isoformat(timespec="seconds")


def _parse_width(value: float | None) -> float | None:
    max_width_mm = 10_000.0
    if value is None:
        return None
    if not math.isfinite(value) or not 0.0 <= value <= max_width_mm:
        raise _bad_request(
            f"width_mm must be from 0 to {max_width_mm:g}, not {core.quote_value(value)}"
        )
    return float(value)


def _bad_request(message: str) -> core.RequestError:
    return core.RequestError(HTTPStatus.BAD_REQUEST, message)


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
        pictures: pictures of the trials.
        camera: camera over the board, if there is one.
        host: address to listen on; only this machine can reach the default.
        port: port to listen on; the first free one from `first_port` on if None, any if 0.
        secret: secret for the cookies of browsers on other machines, so that the cookies stay valid
            after a restart; a new one if None.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port = 7300
    policy = (
        "default-src 'self'; img-src 'self' blob: data:; object-src 'none';"
        " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    refused_code = HTTPStatus.UNPROCESSABLE_ENTITY

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
        plan = plan_data(lab) | {"camera": camera is not None}
        routes = [
            *file_routes("lab_page", LAB_PAGE_FILES),
            get_route("/plan", lambda request: json_response(plan)),
            get_route("/states", self._states),
            get_route("/picture/{name:path}", self._picture),
            get_route("/frame.jpg", self._frame),
            get_route("/camera", lambda request: json_response(self._camera().status())),
            post_route("/entry", self._enter),
            post_route("/watch", self._watch),
            post_route("/check", self._check),
        ]
        super().__init__(routes, host=host, port=port)
        bound, number = self.server_address[:2]
        local = ipaddress.ip_address(str(bound)).is_loopback
        self.token = None if local else core.BrowserToken(f"burg_drake_{number}", secret)
        self.on_admitted: Callable[[str], None] = lambda peer: None

    @property
    def url(self) -> str:
        """Address of the page for the next browser; with a token for one browser if other machines
        can reach the page."""
        return super().url if self.token is None else f"{super().url}?token={self.token.token}"

    def admit(self, request: Request) -> str:
        """Accepts a request for this machine with a valid cookie or token."""
        super().admit(request)
        if self.token is None or self.token.admits(request_header(request, "Cookie") or ""):
            return ""
        given = request.query_params.get("token", "")
        if request.scope["path"] != "/" or not self.token.use(given):
            raise core.RequestError(
                HTTPStatus.FORBIDDEN,
                "open this page by the address with a token that burg-drake printed last; each"
                " address works in one browser",
            )
        self.on_admitted(request.scope["client"][0])
        return self.token.set_cookie

    def _answer_refusal(self, request: Request, error: Exception) -> Response:
        """The answer to a refused action; if the trial was recorded before, with that entry."""
        if isinstance(error, TrialChanged):
            answer = {"error": str(error), "entry": entry_data(error.trial)}
            return json_response(answer, HTTPStatus.CONFLICT)
        return super()._answer_refusal(request, error)

    def _states(self, request: Request) -> Response:
        found = entry_states(self.lab)
        if "version" in found and found["version"] == request.query_params.get("after"):
            return Response(status_code=HTTPStatus.NO_CONTENT)
        return json_response(found)

    def _picture(self, request: Request) -> Response:
        rendering_timeout = 20.0  # Seconds that the request waits for a picture.
        name = request.path_params["name"].removesuffix(".jpg")
        picture = self.pictures.get(name, rendering_timeout)
        if picture is None:
            fault = self.pictures.fault or f"there is no picture {name[:100]}"
            raise core.RequestError(HTTPStatus.NOT_FOUND, fault)
        headers = {"Cache-Control": "private, max-age=86400"}
        return Response(picture, headers=headers, media_type="image/jpeg")

    def _frame(self, request: Request) -> Response:
        frame_timeout = 1.0  # Seconds that the request waits for a newer frame.
        after, epoch = (parse_picture_number(request, name) for name in ("after", "epoch"))
        found = self._camera().next_picture(epoch, after, frame_timeout)
        if found is None:
            return Response(status_code=HTTPStatus.NO_CONTENT)
        epoch, picture = found
        headers = {"X-Picture": str(picture.number), "X-Epoch": str(epoch)}
        return Response(picture.jpeg, headers=headers, media_type="image/jpeg")

    def _enter(self, body: dict[str, Any]) -> dict[str, Any]:
        return {"entry": entry_data(self.lab.enter(parse_lab_entry(body, self.lab.plan_hash)))}

    def _watch(self, body: dict[str, Any]) -> dict[str, Any]:
        self._camera().watch(parse_trial_number(body))
        return {}

    def _check(self, body: dict[str, Any]) -> dict[str, Any]:
        if not isinstance(body.get("keep"), bool):
            raise core.RequestError(HTTPStatus.BAD_REQUEST, '"keep" must be true or false')
        self._camera().check(parse_trial_number(body), keep=body["keep"])
        return {}

    def _camera(self) -> LabCamera:
        if self.camera is None:
            raise core.RequestError(HTTPStatus.NOT_FOUND, "there is no camera; start with --camera")
        return self.camera
