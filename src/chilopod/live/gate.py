"""Who may open the page: viser's server, behind a look at every request and every message.

viser answers whoever asks, and does whatever a message says. It listens by ``websockets``; here it does so by ours,
which asks a :class:`Gate` first. What is used of viser beside its documented interface is in this module and in
``offers``.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import ipaddress
import logging
import re
import secrets
import socket
import threading
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
import websockets
import zstandard
from viser.infra import _infra
from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from chilopod.live.offers import LARGEST, Refused, accepted

_RATE = 200.0  # messages a second from one browser; one that drags sends 60
_AT_ONCE = 1.0  # s of messages that may come at once
_MOST = 250  # browsers
_LOG = logging.getLogger("chilopod.live")
_PATCHING = threading.Lock()
_HOST = re.compile(r"[A-Za-z0-9._-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?")
_DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"  # viser's 88

_Answer = Callable[[ServerConnection, Request], Response | None]


class Gate:
    """What is asked of everybody who comes.

    A browser says by Host which name it looked up, and by Origin which page sends it. On this machine's own addresses
    Host is one of their names, so that a name that leads here later is refused (DNS rebinding), and Origin is the page
    itself. A program can say what it likes; against programs of others a token helps, which other addresses always
    want. It comes with the link, and stays in a cookie. A handshake without Origin comes from no browser, and is
    refused everywhere.

    Parameters
    ----------
    host
        Address to listen at.
    token
        Whether a token is wanted at this machine's own addresses too.

    Attributes
    ----------
    token
        Token that is wanted; None: none.
    refused
        Number of requests and messages that were refused.
    """

    def __init__(self, host: str, token: bool = False) -> None:
        self._host, self._local = host, is_local(host)
        self.token = None if self._local and not token else secrets.token_urlsafe(24)
        self.refused = 0
        self._viser: viser.ViserServer | None = None
        self._serves = False

    def link(self, port: int) -> str:
        """Link to the page, with the token if one is wanted."""
        everywhere = self._host in ("0.0.0.0", "::")
        host = "localhost" if self._local else socket.gethostname() if everywhere else self._host
        address = f"http://{f'[{host}]' if ':' in host else host}:{port}"
        return address if self.token is None else f"{address}/?token={self.token}"

    def open(self, port: int) -> viser.ViserServer:
        """Start the server.

        Parameters
        ----------
        port
            Port to listen at, which is free.

        Raises
        ------
        RuntimeError
            If this version of viser listens in another way, and nothing would be asked of anybody.
        """
        ours = SimpleNamespace(asyncio=SimpleNamespace(server=SimpleNamespace(serve=self._serve)))
        ours.exceptions, ours.datastructures = websockets.exceptions, websockets.datastructures
        with _PATCHING:
            names = vars(_infra)
            theirs, names["websockets"] = names["websockets"], ours
            try:
                server = viser.ViserServer(host=self._host, port=port, label="chilopod live", verbose=False)
            finally:
                names["websockets"] = theirs
        if not self._serves:
            server.stop()
            raise RuntimeError(f"the page cannot be guarded with viser {viser.__version__}")
        # Of what viser can do for anybody who asks: put the page on the internet by way of somebody else's server.
        server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        self._viser = server
        return server

    def _serve(self, handler: Any, *where: Any, process_request: _Answer, **how: Any) -> Any:
        self._serves = True
        how |= {"max_size": LARGEST, "create_connection": partial(_Guarded, self)}
        return serve(handler, *where, process_request=partial(self._request, process_request), **how)

    def message(self, connection: ServerConnection, raw: object) -> bytes | None:
        """A message as viser may read it; None if it is refused."""
        if self._viser is None:
            return None
        there = self._viser._websock_server._live_connections.items()
        client = next((number for number, each in list(there) if each is connection), None)
        try:
            return accepted(raw, self._viser, client)
        except Refused as why:
            self._refuse(str(why))
            return None

    # -- requests
    # ---------------------------------------------------------------------------------------------------------------

    def _request(self, answer: _Answer, connection: ServerConnection, request: Request) -> Response | None:
        why = self._unwelcome(connection, request)
        if why:
            self._refuse(f"a request {why}")
            return _with_headers(connection.respond(403, f"chilopod live refuses a request {why}.\n"), "")
        try:
            response = answer(connection, request)
        except (ValueError, OSError, LookupError):  # a path or a header that is none
            response = connection.respond(400, "chilopod live cannot read this request.\n")
        if response is not None:
            response = _with_headers(response, request.headers["Host"])
            if self.token is not None:
                cookie = f"{_cookie(connection)}={self.token}"
                response.headers["Set-Cookie"] = f"{cookie}; HttpOnly; SameSite=Strict; Path=/"
        return response

    def _unwelcome(self, connection: ServerConnection, request: Request) -> str | None:
        """Why somebody may not come in."""
        headers = request.headers
        host, origin = (_only(headers.get_all(name)) for name in ("Host", "Origin"))
        if not host or not _HOST.fullmatch(host) or (self._local and host.lower() not in self._names(connection)):
            return f"for another host than this page's, {_shown(host)}"
        if origin not in (None, f"http://{host}"):
            return f"from another page, {_shown(origin)}"
        if self.token is not None and not self._has_token(connection, request):
            return "without the token: open the link that chilopod printed"
        if "websocket" not in ",".join(headers.get_all("Upgrade")).lower():
            return None
        if origin is None:
            return "that does not say from which page it comes"
        if headers.get_all("Sec-WebSocket-Protocol") != [f"viser-v{viser.__version__}"]:
            return "from another version of the page: reload it"
        crowd = self._viser is None or len(self._viser._websock_server._live_connections) >= _MOST
        return "while there are too many browsers" if crowd else None

    def _names(self, connection: ServerConnection) -> set[str]:
        port = connection.local_address[1]
        own = f"[{self._host}]" if ":" in self._host else self._host
        names = {"127.0.0.1", "localhost", "[::1]", own.lower()}
        return {f"{name}:{port}" for name in names} | (names if port == 80 else set())

    def _has_token(self, connection: ServerConnection, request: Request) -> bool:
        assert self.token is not None
        try:
            shown = parse_qs(urlsplit(request.path).query, max_num_fields=20).get("token", [])
        except ValueError:
            return False
        for cookie in ";".join(request.headers.get_all("Cookie")).split(";"):
            name, _, value = cookie.strip().partition("=")
            shown += [value] if name == _cookie(connection) else []
        return any(hmac.compare_digest(each.encode(), self.token.encode()) for each in shown)

    def _refuse(self, what: str) -> None:
        self.refused += 1
        if self.refused == 1:
            _LOG.warning("the page refused %s; what else it refuses is only counted", what)


class _Guarded(ServerConnection):
    """A browser's connection that gives viser nothing but what the gate lets through, and not too fast."""

    def __init__(self, gate: Gate, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._gate, self._due = gate, 0.0

    async def recv(self, *args: Any, **more: Any) -> Any:
        while True:
            raw = await super().recv(*args, **more)
            now = self.loop.time()
            self._due = max(self._due + 1.0 / _RATE, now - _AT_ONCE)
            if self._due > now:
                await asyncio.sleep(self._due - now)
            message = self._gate.message(self, raw)
            if message is not None:
                return message


def is_local(host: str) -> bool:
    """Whether an address is this machine's own, which nobody else reaches."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cookie(connection: ServerConnection) -> str:
    return f"chilopod-{connection.local_address[1]}"  # cookies are those of all ports


def _only(values: list[str]) -> str | None:
    """The value of a header; an empty one, which nothing is, if there are several."""
    return values[0] if len(values) == 1 else "" if values else None


def _shown(value: str | None) -> str:
    return ascii((value or "")[:80])


def _with_headers(response: Response, host: str) -> Response:
    """An answer that nobody frames, reads from elsewhere, or loads anything else with."""
    scripts = " ".join(f"'sha256-{each}'" for each in _script_hashes()) or "'unsafe-inline'"
    policy = {
        "default-src": "'none'",
        "script-src": f"{scripts} 'wasm-unsafe-eval' blob:",
        "worker-src": "blob:",
        "style-src": "'unsafe-inline'",  # its parts are placed by styles
        "img-src": "'self' data: blob:",
        "font-src": "data:",
        "connect-src": f"'self' data: blob: ws://{host}" if host else "'none'",
        **dict.fromkeys(("base-uri", "form-action", "frame-ancestors"), "'none'"),
    }
    response.headers["Content-Security-Policy"] = "; ".join(f"{name} {value}" for name, value in policy.items())
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["X-Frame-Options"] = "DENY"
    response.headers["Referrer-Policy"] = "no-referrer"
    response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
    response.headers["Cross-Origin-Opener-Policy"] = "same-origin"
    response.headers["Cache-Control"] = "no-store"
    return response


@cache
def _script_hashes() -> tuple[str, ...]:
    """Hashes of viser's two scripts: one that unpacks, and what it unpacks; none where the page is made otherwise."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(encoding="utf-8")
    scripts = re.findall(r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', page, re.DOTALL)
    if len(scripts) != 1 or page.count("<script") != 1:
        return ()
    packed, styles, code, unpacking = scripts[0]
    try:
        content = zstandard.ZstdDecompressor().decompress(_bytes(packed), int(styles) + int(code))
    except (ValueError, zstandard.ZstdError):
        return ()
    both = unpacking.encode(), content[int(styles) :]
    return tuple(base64.b64encode(hashlib.sha256(each).digest()).decode() for each in both)


def _bytes(text: str) -> bytes:
    """What viser writes as five digits to the base 88 for every four bytes."""
    found, left = bytearray(), -len(text) % 5
    for start in range(0, len(text), 5):
        number = 0
        for digit in text[start : start + 5]:
            number = 88 * number + _DIGITS.index(digit)
        length = 4 if start + 5 <= len(text) else 4 - left
        found += (number % 256**length).to_bytes(length, "big")
    return bytes(found)
