"""Access to the page: viser's server behind a check of every request and message, and ways to reach its browsers.

viser alone answers every request, and sets any attribute that a message names. It listens by ``websockets``; here it
does so by ours, which asks a :class:`Gate` first. All that is used of viser beside its documented interface is in this
module.
"""

from __future__ import annotations

import asyncio
import base64
import dataclasses
import gzip
import hashlib
import hmac
import ipaddress
import logging
import math
import re
import reprlib
import secrets
import socket
import threading
from collections.abc import Callable
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import msgspec
import viser
import websockets
import zstandard
from viser import _messages
from viser.infra import _infra
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_LARGEST = 16_384  # bytes of a message; those of viser's client have a few hundred
_RATE = 200.0  # messages a second from one browser; one that drags sends 60
_AT_ONCE = 1.0  # s of messages that may come at once
_MOST = 250  # browsers
_FARTHEST = 1e16  # in any unit, of any number; seeds go up to 9e15
_LONGEST = 200  # characters of any text
_LOADING = 60.0  # s from the request of a page to the first word of its scripts
_LOG = logging.getLogger("chilopod.live")
_PATCHING = threading.Lock()
_HOST = re.compile(r"([a-z0-9._-]+|\[[0-9a-f:.]+\])(:\d+)?", re.IGNORECASE)
_KINDS: dict[str, Any] = {  # all messages that a browser may send
    f"{name}Message": getattr(_messages, f"{name}Message")
    for name in ("ViewerCamera", "ScenePointer", "SceneNodeDrag", "GuiUpdate", "CommandTrigger")
}
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Gate:
    """Checks of every request and message at an address (`host`); ``refused`` counts those that failed.

    A browser says by Host which name it looked up, and by Origin which page sends it. On this machine's own addresses
    Host is one of their names, so that a name that leads here later is refused (DNS rebinding), and Origin is the page
    itself; a handshake without Origin comes from no browser, and is refused. Other programs can send any header: at
    other addresses, or with `token`, they need a token. It comes with the link, and stays in a cookie.
    """

    def __init__(self, host: str, token: bool = False) -> None:
        self._host, self._local = host, _is_local(host)
        self._token = None if self._local and not token else secrets.token_urlsafe(24)
        self.refused = 0
        self.pictures: Callable[[], bytes] | None = None  #: SVG of the walk for a browser without WebGL
        self._serves, self._asked = False, (-math.inf, "", False)
        self._viser: viser.ViserServer | None = None

    def link(self, port: int) -> str:
        """Link to the page, with the token if one is wanted."""
        everywhere = self._host in ("0.0.0.0", "::")
        host = "localhost" if self._local else socket.gethostname() if everywhere else self._host
        address = f"http://{f'[{host}]' if ':' in host else host}:{port}"
        return address if self._token is None else f"{address}/?token={self._token}"

    def asked(self) -> tuple[str, bool]:
        """Settings in the address of a page that has just been opened, once, and True if a person opened it there and
        not another web site."""
        (time, query, by_hand), self._asked = self._asked, (-math.inf, "", False)
        return (query, by_hand) if monotonic() - time < _LOADING else ("", False)

    def open(self, port: int) -> viser.ViserServer:
        """Listen at a free port; not at all with a viser that listens in another way, and would ask nobody."""
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
        self._viser = server
        return server

    def _serve(self, handler: Any, *where: Any, process_request: Any, **how: Any) -> Any:
        self._serves = True
        logger = logging.Logger("chilopod.live")
        logger.addFilter(self._unread)
        how |= {"max_size": _LARGEST, "create_connection": partial(_Guarded, self), "logger": logger}
        return serve(handler, *where, process_request=partial(self._answer, process_request), **how)

    # -- requests

    def _unread(self, record: logging.LogRecord) -> bool:
        """False for the report of a request that websockets cannot read, such as a POST: it is refused, and counts."""
        if record.getMessage() != "opening handshake failed":
            return True
        error = record.exc_info[1] if record.exc_info else None
        if not isinstance(error and error.__cause__, EOFError):  # of a browser that opened a connection for later
            self._refuse("a request that is not one for a page")
        return False

    def _answer(self, answer: Any, connection: ServerConnection, request: Request) -> Response | None:
        host = _only(request.headers.get_all("Host")) or ""
        why = self._unwelcome(connection, request, host)
        response: Response | None
        if why:
            self._refuse(f"a request {why}")
            response, host = connection.respond(403, f"chilopod live refuses a request {why}.\n"), ""
        else:
            try:
                response = self._own(request) or answer(connection, request)
            except (ValueError, OSError, LookupError):  # a path or a header that is none
                response = connection.respond(400, "chilopod live cannot read this request.\n")
        if response is not None:
            response.headers.update(_HEADERS, **{"Content-Security-Policy": _policy(host)})
            if self._token is not None and not why:
                cookie = f"{_cookie(connection)}={self._token}"
                response.headers["Set-Cookie"] = f"{cookie}; HttpOnly; SameSite=Strict; Path=/"
        return response

    def _own(self, request: Request) -> Response | None:
        """Answer of our own: the page with what viser's lacks, and pictures of the walk."""
        path, _, query = request.path.partition("?")
        if request.headers.get("Upgrade") or path not in ("/", "/index.html", "/picture.svg"):
            return None
        if path == "/picture.svg":
            body, kind = self.pictures() if self.pictures else b"", "image/svg+xml"
        else:
            body, kind = _page(), "text/html; charset=utf-8"
            site, to = (request.headers.get(f"Sec-Fetch-{each}") for each in ("Site", "Dest"))
            if to == "document" or self._token is not None:  # not a picture or a script of another page
                self._asked = monotonic(), query, site in ("none", "same-origin") or self._token is not None
        packed = "gzip" in request.headers.get("Accept-Encoding", "")
        told = {"Content-Type": kind, "Content-Encoding": "gzip" if packed else "identity"}
        body = (_packed() if path != "/picture.svg" else gzip.compress(body, 1)) if packed else body
        return Response(200, "OK", Headers({**told, "Content-Length": str(len(body))}), body)

    def _unwelcome(self, connection: ServerConnection, request: Request, host: str) -> str | None:
        """Reason to refuse a request."""
        headers, origin = request.headers, _only(request.headers.get_all("Origin"))
        if not _HOST.fullmatch(host) or (self._local and host.lower() not in self._names(connection)):
            return f"for another host than this page's, {ascii(host)[:80]}"
        if origin not in (None, f"http://{host}"):
            return f"from another page, {ascii(origin)[:80]}"
        if self._token is not None and not self._has_token(connection, request):
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
        try:
            shown = parse_qs(urlsplit(request.path).query, max_num_fields=20).get("token", [])
            for cookie in ";".join(request.headers.get_all("Cookie")).split(";"):
                name, _, value = cookie.strip().partition("=")
                shown += [value] if name == _cookie(connection) else []
            return any(hmac.compare_digest(each.encode(), str(self._token).encode()) for each in shown)
        except ValueError:  # a path or a text that is none
            return False

    def _refuse(self, what: str) -> None:
        self.refused += 1
        if self.refused == 1:
            _LOG.warning("the page refused %s; what else it refuses is only counted", what)

    # -- messages

    def message(self, connection: _Guarded, raw: Any) -> bytes | None:
        """Checked part of a message, written down anew for viser to read; None if it is refused."""
        read: Any = None
        try:
            read = msgspec.msgpack.decode(raw)
            kind = _KINDS[read["type"]]
            fields = {"type", *(each.name for each in dataclasses.fields(kind))}
            # Types are those that viser gives; any float is one of them.
            known = fields.issuperset(read) and _bounded(read)
            offered = known and self._offers(connection, msgspec.convert(read, kind))
        except (ValueError, TypeError, LookupError, RecursionError):
            offered = False
        if offered is False:
            self._refuse(f"a message that it does not offer, {reprlib.repr(read)!a}")
        return msgspec.msgpack.encode(read) if offered else None

    def _offers(self, connection: _Guarded, message: Any) -> bool | None:
        """True if the page has the element that a message names; None for a number out of range, as on the way."""
        server = self._viser
        assert server is not None
        there = list(server._websock_server._live_connections.items())
        here = server.get_clients().get(next((number for number, each in there if each is connection), -1))
        scopes = [server.gui] if here is None else [server.gui, here.gui]
        connection.introduced |= isinstance(message, _messages.ViewerCameraMessage)
        if not connection.introduced:  # viser would move elements in all browsers, and tell nobody here
            return False
        match message:
            case _messages.ScenePointerMessage(event_type=event, ray_origin=start, ray_direction=ray, screen_pos=at):
                return event == "click" and start is not None and ray is not None and len(at) == 1
            case _messages.SceneNodeDragMessage(name=name, instance_index=part):
                node: Any = server.scene.get_handle_by_name(name)
                return bool(node and node._impl.drag_cb) and part in range(len(node.batched_positions))
            case _messages.GuiUpdateMessage(uuid=uuid, updates=updates):
                handles = [scope._gui_input_handle_from_uuid.get(uuid) for scope in scopes]
                takes = (_takes(each, updates["value"]) for each in handles if each)
                return [*updates] == ["value"] and next(takes, False)
            case _messages.CommandTriggerMessage(uuid=uuid):
                keys = [scope._command_handle_from_uuid.get(uuid) for scope in scopes]
                return any(key and not key.disabled for key in keys)
        return isinstance(message, _messages.ViewerCameraMessage)


class _Guarded(ServerConnection):
    """Connection of a browser that passes only checked messages to viser, at a limited rate."""

    def __init__(self, gate: Gate, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._gate, self._due = gate, 0.0
        self.introduced = False  #: True once it has sent its camera

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


def at_server(server: viser.ViserServer, do: Callable[[], None]) -> None:
    """Let the thread of the server do something, and wait for it.

    viser wakes those who send to browsers by an event of asyncio, which no other thread may touch: with two browsers it
    fails now and then.
    """

    async def done() -> None:
        do()

    asyncio.run_coroutine_threadsafe(done(), server.get_event_loop()).result()


def notify(server: viser.ViserServer, sentence: str, seconds: float | None = 8.0) -> None:
    """Show a sentence to all browsers, for some seconds or until it is closed by hand (None)."""

    def show() -> None:
        for client in server.get_clients().values():
            client.add_notification("chilopod", sentence, auto_close_seconds=seconds)

    at_server(server, show)


def _bounded(value: Any) -> bool:
    """True if all numbers are finite and no text is long."""
    if isinstance(value, dict):
        return _bounded([*value.keys(), *value.values()])
    if isinstance(value, list):
        return all(map(_bounded, value))
    if isinstance(value, str):
        return len(value) <= _LONGEST
    return value is None or abs(value) <= _FARTHEST


def _takes(handle: Any, value: Any) -> bool | None:
    """True if an element can be set to a value by hand, None if it takes numbers but not this one."""
    if handle.disabled or not handle.visible:
        return False
    if isinstance(handle, viser.GuiCheckboxHandle):
        return isinstance(value, bool)
    if isinstance(handle, viser.GuiButtonHandle):
        return value is True
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return value in handle.options
    if not isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle) or None in (handle.min, handle.max):
        return False
    is_number = isinstance(value, int if isinstance(handle.value, int) else int | float) and not isinstance(value, bool)
    return (handle.min <= value <= handle.max or None) if is_number else False


def _is_local(host: str) -> bool:
    """True for an address that only this machine reaches."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cookie(connection: ServerConnection) -> str:
    return f"chilopod-{connection.local_address[1]}"  # cookies are those of all ports


def _only(values: list[str]) -> str | None:
    """The value of a header; an empty one, which nothing is, if there are several."""
    return values[0] if len(values) == 1 else "" if values else None


def _policy(host: str) -> str:
    """Content policy of a page: viser's two scripts and ours, nothing from elsewhere, no frame of another site."""
    return (
        f"default-src 'none'; script-src {_scripts()} 'wasm-unsafe-eval'; worker-src blob:; "
        "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; "
        f"connect-src 'self' data: blob: {f'ws://{host}' if host else ''}; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


@cache
def _page() -> bytes:
    """Viser's page with our styles and our script in front of its own."""
    ours = f"<style>{_file('page.css')}</style><script>{_file('page.js')}</script><title>chilopod live</title>"
    return _index().replace("<title>Viser</title>", ours).replace('"Viser client"', '"Robot that walks"').encode()


@cache
def _packed() -> bytes:
    return gzip.compress(_page())


def _file(name: str) -> str:
    return files("chilopod.live").joinpath(name).read_text(encoding="utf-8")


def _index() -> str:
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(encoding="utf-8")


@cache
def _scripts() -> str:
    """Hashes of viser's two scripts, one that unpacks, and the unpacked one (from five digits of 88 for four bytes),
    and of ours."""
    page = _index()
    digits = {digit: place for place, digit in enumerate(sorted({*map(chr, range(33, 127))} - {*"\"&'<>`"}))}
    packed = bytearray()
    try:
        pattern = r'<script data-p="([^"]*)" data-ss="(\d+)"[^>]*>(.*?)</script>'
        ((text, styles, unpacking),) = re.findall(pattern, page, re.DOTALL)
        for start in range(0, len(text), 5):
            number, five = 0, text[start : start + 5]
            for digit in five:
                number = 88 * number + digits[digit]
            packed += number.to_bytes(5, "big")[1 - len(five) :]
        code = zstandard.ZstdDecompressor().decompress(packed)[int(styles) :]
    except (ValueError, LookupError, zstandard.ZstdError):
        return "'unsafe-inline'"  # the page is made otherwise
    hashes = (hashlib.sha256(each).digest() for each in (unpacking.encode(), code, _file("page.js").encode()))
    return " ".join(f"'sha256-{base64.b64encode(each).decode()}'" for each in hashes)
