"""A token that admits one browser to a page, and the cookie that it gets in the token's place.

For pages that other machines can reach. The first browser that brings the token uses it up; the
next one needs the token that takes its place.
"""

from __future__ import annotations

import hmac
import secrets
import threading

TOKEN_BYTES = 24


class BrowserToken:
    """Admits browsers; every method may be called from any thread.

    Args:
        cookie: name of the cookie.
        secret: its value; a new one if None.
    """

    def __init__(self, cookie: str, secret: str | None = None) -> None:
        self._cookie = cookie
        self._secret = secret or secrets.token_urlsafe(TOKEN_BYTES)
        self._lock = threading.Lock()
        self._token = secrets.token_urlsafe(TOKEN_BYTES)

    @property
    def token(self) -> str:
        """What the next browser has to bring."""
        with self._lock:
            return self._token

    def use(self, given: str) -> bool:
        """Whether a browser brings the token, which is used up then."""
        with self._lock:
            if not _equal(given, self._token):
                return False
            self._token = secrets.token_urlsafe(TOKEN_BYTES)
            return True

    @property
    def set_cookie(self) -> str:
        """Header by which an admitted browser gets the cookie."""
        return f"{self._cookie}={self._secret}; Path=/; HttpOnly; SameSite=Strict"

    def admits(self, cookies: str) -> bool:
        """Whether a browser with such a `Cookie` header was admitted."""
        given = (cookie.strip().partition("=") for cookie in cookies.split(";"))
        return any(name == self._cookie and _equal(value, self._secret) for name, _, value in given)


def _equal(given: str, expected: str) -> bool:
    """Compares in a time that tells nothing; what servers could not decode is no part of tokens."""
    return hmac.compare_digest(given.encode(errors="replace"), expected.encode())
