"""The door, by real requests and a real browser."""

from __future__ import annotations

import http.client
import socket
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import viser

from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.ui import ServedPage, admission, require_guarded, serve_page
from tests.hang_guard import HANG_GUARD

HANDSHAKE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw==",
    "Sec-WebSocket-Protocol": "viser-v1.1.1",
}


@pytest.fixture(scope="module")
def door() -> Iterator[ServedPage]:
    with serve_page(port=0) as door:
        door.server.gui.add_markdown("Nothing here yet.")
        yield door


@pytest.fixture
def open_to_all() -> Iterator[ServedPage]:
    """A door that other machines can reach."""
    with serve_page("0.0.0.0", port=0) as door:
        door.server.gui.add_markdown("Nothing here yet.")
        yield door


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[str]:
    """Address of another web site: another port is another origin."""
    (tmp_path / "index.html").write_text("<title>Elsewhere</title>")
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/"
        server.shutdown()


def answer(
    door: ServedPage, path: str = "/", *headers: tuple[str, str], host: str | None = "127.0.0.1"
) -> tuple[int, dict[str, str], str]:
    """Status, headers and text of the answer to a request that is sent as it is given."""
    connection = http.client.HTTPConnection("127.0.0.1", door.port, timeout=HANG_GUARD)
    try:
        connection.putrequest("GET", path, skip_host=True)
        if host is not None:
            connection.putheader("Host", host.replace("PORT", str(door.port)))
        for name, value in headers:
            connection.putheader(name, value.replace("PORT", str(door.port)))
        connection.endheaders()
        response = connection.getresponse()
        text = "" if response.status == 101 else response.read().decode()
        return response.status, dict(response.headers), text
    finally:
        connection.close()


@pytest.mark.thorough
def test_the_page_opens_in_a_browser(door: ServedPage, page) -> None:
    page.goto(f"{door.url}?websocket=ws://127.0.0.1:9/&darkMode")  # a trap, and an option of viser
    page.get_by_text("Nothing here yet.").wait_for()
    assert page.url == f"{door.url}?darkMode="
    assert page.title() == "burg_drake"
    assert page.get_by_role("alert").get_by_text("WebGL 2 is missing").count() == 0


@pytest.mark.parametrize("upgrade", [False, True], ids=["page", "websocket"])
@pytest.mark.parametrize(
    ("host", "headers", "code"),
    [
        ("127.0.0.1:PORT", {"Origin": "http://127.0.0.1:PORT"}, 200),
        ("localhost:PORT", {"Origin": "http://localhost:PORT"}, 200),
        ("localhost:PORT", {"Origin": "http://127.0.0.1:PORT"}, 403),
        ("127.0.0.1:PORT", {"Origin": "http://127.0.0.1:3000"}, 403),
        ("127.0.0.1:PORT", {"Origin": "https://127.0.0.1:PORT"}, 403),
        ("127.0.0.1:PORT", {"Origin": "http://evil.example"}, 403),
        ("127.0.0.1:PORT", {"Origin": "null"}, 403),
        ("evil.example:PORT", {"Origin": "http://evil.example:PORT"}, 403),
        ("evil.example", {}, 403),
        ("evil@127.0.0.1", {"Origin": "http://evil@127.0.0.1"}, 403),
        ("", {}, 403),
    ],
)
def test_only_pages_of_this_machine_come_in(
    door: ServedPage, host: str, headers: dict[str, str], code: int, upgrade: bool
) -> None:
    handshake = HANDSHAKE if upgrade else {}
    found = answer(door, "/", *{**headers, **handshake}.items(), host=host)[0]
    assert found == (101 if upgrade and code == 200 else code)


def test_what_is_neither_page_nor_browser_is_refused(door: ServedPage) -> None:
    own = ("Origin", "http://127.0.0.1")
    assert answer(door, "/", *HANDSHAKE.items())[0] == 403  # no browser leaves out the origin
    assert answer(door, "/other", own, *HANDSHAKE.items())[0] == 404
    assert answer(door, "/", ("Sec-Fetch-Site", "cross-site"))[0] == 200  # a link to the page
    assert answer(door, "/", own, ("Origin", "http://evil.example"))[0] == 400
    assert answer(door, host=None)[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        "/../index.html",
        "/%2e%2e/%2e%2e/_viser.py",
        "/..%2f..%2f_viser.py",
        "/..\\..\\_viser.py",
        "//etc/passwd",
        "/index.html",
        "/index.html?token=1",
    ],
)
def test_there_is_one_page_and_no_files(door: ServedPage, path: str) -> None:
    assert answer(door, path)[0] == 404


def test_answers_forbid_frames_and_other_places(door: ServedPage) -> None:
    for path in ("/", "/other"):
        _, headers, _ = answer(door, path)
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "Server" not in headers


CONNECT = """address => new Promise(done => {
    const socket = new WebSocket(address, ["viser-v1.1.1"]);
    socket.onopen = () => done("open");
    socket.onerror = () => done("refused");
})"""


def test_a_page_of_another_site_cannot_connect(door: ServedPage, page, elsewhere: str) -> None:
    page.goto(elsewhere)
    address = f"127.0.0.1:{door.port}"
    assert page.evaluate(CONNECT, f"ws://{address}/") == "refused"
    fetch = "url => fetch(url, {mode: 'no-cors'}).then(() => 'open', () => 'refused')"
    assert page.evaluate(fetch, f"http://{address}/") == "refused"


@pytest.mark.thorough
def test_a_page_of_another_site_can_connect_to_viser_itself(page, elsewhere: str) -> None:
    """A canary: if viser refuses that one day, less of the door is needed."""
    server = viser.ViserServer(host="127.0.0.1", port=7400, verbose=False)
    try:
        page.goto(elsewhere)
        assert page.evaluate(CONNECT, f"ws://127.0.0.1:{server.get_port()}/") == "open"
        with pytest.raises(MissingDependencyError, match="was not opened, because other web sites"):
            require_guarded("127.0.0.1", server.get_port())
    finally:
        server.stop()


def test_a_door_that_lets_others_in_does_not_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admission, "require_local_host", lambda *headers, **served: None)
    threads = threading.active_count()
    with pytest.raises(MissingDependencyError, match="was not opened, because other web sites"):
        serve_page(port=7449)
    assert threading.active_count() == threads
    with socket.create_server(("127.0.0.1", 7449)):
        pass


@pytest.mark.thorough
def test_a_token_opens_the_page_in_one_browser(open_to_all: ServedPage, page, browser) -> None:
    door = open_to_all
    admitted: list[str] = []
    door.admission.on_admitted = admitted.append
    token = door.url.partition("?token=")[2]
    assert len(token) >= 32
    here = f"http://127.0.0.1:{door.port}/"
    page.goto(f"{here}?token={token}")
    page.get_by_text("Nothing here yet.").wait_for()
    assert page.url == here and admitted == ["127.0.0.1"]
    page.reload()
    page.get_by_text("Nothing here yet.").wait_for()
    assert page.evaluate("document.cookie") == ""  # no script sees it
    assert page.context.cookies()[0]["sameSite"] == "Strict"
    code, _, text = answer(door, f"/?token={token}")
    assert code == 403 and "by the address with a token" in text
    code, headers, _ = answer(door, door.url[door.url.index("/?") :])  # the next browser's
    assert code == 200 and len(admitted) == 2
    assert "HttpOnly" in headers["Set-Cookie"] and "SameSite=Strict" in headers["Set-Cookie"]
    own = ("Origin", "http://127.0.0.1")
    others = 'theme="dark; mode"; a={"b": 1, "c"}'  # those of other programs on this machine
    cookie = ("Cookie", f"{others}; {headers['Set-Cookie'].partition(';')[0]}")
    assert answer(door, "/", own, cookie, *HANDSHAKE.items())[0] == 101


def test_without_a_token_nothing_opens(open_to_all: ServedPage) -> None:
    own = ("Origin", "http://127.0.0.1")
    name = f"burg_drake_{open_to_all.port}"
    for cookie in ("", f"{name}=", f"{name}=x", "=;;", f"{name}={open_to_all.admission.token}"):
        given = () if cookie == "" else (("Cookie", cookie),)
        assert answer(open_to_all, "/", *given)[0] == 403
        assert answer(open_to_all, "/", own, *given, *HANDSHAKE.items())[0] == 403
    for query in ("?token=", "?token=x", "?token=%C3%A4", "?token"):
        assert answer(open_to_all, f"/{query}")[0] == 403


def test_a_token_that_is_no_text_is_a_wrong_one(open_to_all: ServedPage) -> None:
    for path, cookie in ((b"/?token=\xe4", b""), (b"/", b"\xe4")):
        head = b"GET %s HTTP/1.1\r\nHost: localhost\r\nCookie: burg_drake_%d=%s\r\n\r\n"
        with socket.create_connection(
            ("127.0.0.1", open_to_all.port), timeout=HANG_GUARD
        ) as connection:
            connection.sendall(head % (path, open_to_all.port, cookie))
            assert connection.recv(100).startswith(b"HTTP/1.1 403")


def test_browsers_are_counted(door: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admission, "MAX_CONNECTIONS", 0)
    own = ("Origin", "http://127.0.0.1")
    code, _, text = answer(door, "/", own, *HANDSHAKE.items())
    assert code == 503 and "too many browsers" in text


def test_a_port_that_is_taken_is_named(door: ServedPage) -> None:
    with pytest.raises(InvalidInputError, match=f"port {door.port} of 127.0.0.1 is in use"):
        serve_page(port=door.port)
    with pytest.raises(InvalidInputError, match=r"cannot be served on 192\.0\.2\.1"):
        serve_page("192.0.2.1")
    with serve_page() as first, serve_page() as second:
        assert 7200 <= first.port < second.port < 7250


def test_the_terminal_stays_clean(capfd: pytest.CaptureFixture[str]) -> None:
    with serve_page(port=0) as door:
        own = ("Origin", "http://127.0.0.1")
        old = {**HANDSHAKE, "Sec-WebSocket-Protocol": "viser-v0.1"}
        assert answer(door, "/", own, *old.items())[0] == 101
        assert answer(door, "/", own, *HANDSHAKE.items())[0] == 101  # goes without a farewell
        assert answer(door, "/", host="evil.example")[0] == 403
    assert capfd.readouterr() == ("", "")


@pytest.mark.thorough
def test_a_browser_without_webgl_is_told(door: ServedPage, playwright, chromium: str) -> None:
    browser = playwright.chromium.launch(
        executable_path=chromium, args=["--no-sandbox", "--disable-3d-apis"]
    )
    page = browser.new_page()
    page.goto(door.url)
    page.get_by_role("alert").get_by_text("WebGL 2 is missing").wait_for()
    assert page.get_by_text("Nothing is lost").is_visible()
    browser.close()


@pytest.mark.thorough
def test_a_browser_without_scripts_is_told(door: ServedPage, browser) -> None:
    with browser.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(door.url)
        assert "needs JavaScript" in page.locator("noscript").inner_text()
        assert page.locator("noscript").is_visible()
