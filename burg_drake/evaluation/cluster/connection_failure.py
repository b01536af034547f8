"""Why a scheduler is not reached: Dask itself mostly says that something took too long."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

CONNECT_TIMEOUT = 2.0
"""Seconds to wait for somebody to listen."""


def unreached_reason(where: object, error: BaseException) -> str:
    """A reason in one line.

    Args:
        where: the address that was tried; of anything else no more is known than the error says.
        error: of Dask.
    """
    words = _innermost(error)
    if not isinstance(where, str):
        return words
    parts = urlsplit(where)
    try:
        socket.create_connection(
            (parts.hostname or "", parts.port or 0), timeout=CONNECT_TIMEOUT
        ).close()
    except ConnectionRefusedError:
        return "nobody listens there (connection refused)"
    except socket.gaierror:
        return f"there is no machine with the name {parts.hostname}"
    except TimeoutError:
        return "the machine does not answer; is it off, or does a firewall block the connection?"
    except OSError as refused:
        return refused.strerror or words
    return (
        "something listens there, but does not answer like a scheduler with "
        f"{parts.scheme}:// ({words})"
    )


def _innermost(error: BaseException) -> str:
    """Of an error and its causes the innermost one that has words."""
    words = type(error).__name__
    cause: BaseException | None = error
    while cause is not None:
        words = " ".join(str(cause).split()) or words
        cause = cause.__cause__
    return words
