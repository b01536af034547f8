"""What browsers send: read, or refused with a word why. Nothing here trusts the sender."""

from __future__ import annotations

from email.message import Message
from http import HTTPStatus
from io import BufferedIOBase
from typing import Any
from urllib.parse import parse_qs, urlsplit

from burg_drake.core import RequestError
from burg_drake.core.documents import parse_json

LONGEST_BODY = 10_000
LONGEST_NUMBER = 12
"""Digits; far more than pictures are counted, far fewer than Python refuses to convert."""


def address(target: str) -> tuple[str, dict[str, str]]:
    """Path and query of what is asked for; of a repeated field the last value.

    Raises:
        RequestError: it is not an address.
    """
    try:
        url = urlsplit(target)
        return url.path, {key: values[-1] for key, values in parse_qs(url.query).items()}
    except ValueError as error:
        raise RequestError(HTTPStatus.BAD_REQUEST, f"no address: {error}") from error


def json_body(headers: Message, stream: BufferedIOBase) -> dict[str, Any]:
    """The JSON object of a POST; a form of another site cannot send that type.

    Raises:
        RequestError: another type, too long, or no JSON object.
    """
    if headers.get_content_type() != "application/json":
        raise RequestError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send application/json")
    length = headers.get("Content-Length", "")
    if not _is_number(length) or int(length) > LONGEST_BODY:
        raise RequestError(HTTPStatus.BAD_REQUEST, "send a short body with its length")
    try:
        body = parse_json(stream.read(int(length)).decode(), "the body")
    except ValueError as error:
        raise RequestError(HTTPStatus.BAD_REQUEST, f"no JSON: {error}") from error
    if not isinstance(body, dict):
        raise RequestError(HTTPStatus.BAD_REQUEST, "send a JSON object")
    return body


def picture_number(query: dict[str, str]) -> int:
    """`after=N`; 0 without.

    Raises:
        RequestError: no number, or one that no picture has.
    """
    text = query.get("after", "0")
    if not _is_number(text):
        raise RequestError(HTTPStatus.BAD_REQUEST, f"after={text[:50]} is not a picture's number")
    return int(text)


def _is_number(text: str) -> bool:
    return text.isdecimal() and len(text) <= LONGEST_NUMBER
