"""Clients of the live page that are not it: messages that it does not offer, and requests of other web sites."""

from __future__ import annotations

import math
import re
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

import msgspec
import viser
from viser import _messages
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from chilopod.live import Live, wishes
from chilopod.robot import load_robot
from in_process import Place
from outcomes import FoundFault, Kind, Outcome

_PATIENCE = 20.0  # s until a message is answered, on a busy machine
_REQUESTS = 0.02  # of all attacks
_CONTROLS = 0.01  # of all attacks: what the page does offer
_PINS = "/world/pin"
_NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e300, 2**64 - 1, -(2**63), 1e17)
_NO_VALUES = (*_NUMBERS, None, [], [1.0], {}, {"value": 1.0}, b"x", "x" * 5000, "nothing of the kind")
_ATTRIBUTES = (
    *(
        "removed",
        "visible",
        "disabled",
        "label",
        "hint",
        "order",
        "min",
        "max",
        "step",
        "precision",
        "options",
        "props",
    ),
    *(
        "update_cb",
        "sync_cb",
        "is_button",
        "uuid",
        "parent_container_id",
        "gui_api",
        "__class__",
        "__dict__",
        "",
        "Value",
    ),
)
_CAMERA: dict[str, Any] = {
    **{"type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 1.0, 1.0]},
    **{"fov": 1.0, "near": 0.1, "far": 100.0, "image_height": 600, "image_width": 800},
    **{"look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0]},
}
_CLICK: dict[str, Any] = {
    **{"type": "ScenePointerMessage", "event_type": "click", "ray_origin": [0.0, 0.0, 2.0]},
    **{"ray_direction": [0.5, 0.0, -1.0], "screen_pos": [[0.5, 0.5]], "modifier": None},
}
_DRAG: dict[str, Any] = {
    **{"type": "SceneNodeDragMessage", "phase": "start", "name": _PINS, "instance_index": 0, "button": "left"},
    **{"start_position": [0.0, 0.0, 0.0], "start_screen_pos": [0.5, 0.5], "end_position": [1.0, 1.0, 0.0]},
    **{"end_screen_pos": [0.6, 0.6], "modifier": None, "owner": ""},
}
_OTHERS = sorted({each.__name__ for each in _messages.Message.get_subclasses()})
_NONE = 10**6  # no element has so many


class LiveClients:
    """Messages and requests that come from anywhere but the page, to a server of this process; it lives, and nothing
    moves.

    Parameters
    ----------
    live
        A page; None: one of its own.
    """

    name = "live-clients"
    per_minute = 4000

    def __init__(self, live: Live | None = None) -> None:
        self._given = live
        self._socket: ClientConnection | None = None
        self._before: tuple[object, ...] | None = None

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One message or request."""
        live = self._live()
        before = self._before or self._seen(), sorted(place.here.iterdir())
        if chance.random() < _REQUESTS:
            words, answered = self._request(chance)
            place.tried.write_text(words)
            said = answered()
            if not re.match(r"HTTP/1\.1 4\d\d |$", said):
                raise FoundFault(Kind.WRONG, f"answered: {said[:60]!r}")
        elif chance.random() < _CONTROLS:
            place.tried.write_text("a slider that is moved by its page")
            self._before = None
            self._move(chance)
            return Outcome(Kind.ENDED)
        else:
            raw = self._message(chance)
            place.tried.write_text(repr(raw)[:300])
            self._send(raw)
        if live.failure is not None:
            raise FoundFault(Kind.CRASH, f"the page has ended: {live.failure!r}")
        after = self._seen(), sorted(place.here.iterdir())
        self._before = None  # should it have moved
        if after != before:
            raise FoundFault(Kind.WRONG, f"moved: {_difference(before, after)}")
        self._before = after[0]
        return Outcome(Kind.REFUSED)

    def close(self) -> None:
        """Hang up."""
        if self._socket is not None:
            self._socket.close()

    # -- the page
    # ---------------------------------------------------------------------------------------------------------------

    def _live(self) -> Live:
        if self._given is None:
            self._given = Live(load_robot("aoi2022-planar"), port=0)
        live = self._given
        if not live.session.settings.paused:
            live.wish(wishes.Pause(True))
            _until(lambda: live.session.settings.paused, "the page does not pause")
            time.sleep(0.2)  # a frame that was under way
        return live

    def _client(self) -> ClientConnection:
        """A browser's connection, as the page itself opens it; what it is sent is thrown away."""
        if self._socket is not None and not _closed(self._socket):
            return self._socket
        port = self._port
        where: dict[str, Any] = {"origin": f"http://127.0.0.1:{port}", "subprotocols": [f"viser-v{viser.__version__}"]}
        self._socket = connect(f"ws://127.0.0.1:{port}", **where, compression=None, max_size=None, close_timeout=0.1)
        self._socket.send(msgspec.msgpack.encode(_CAMERA))
        return self._socket

    @property
    def _port(self) -> int:
        return int(self._live().address.rpartition(":")[2])

    @property
    def _handles(self) -> dict[str, Any]:
        return self._live().server.gui._gui_input_handle_from_uuid

    def _seen(self) -> tuple[object, ...]:
        """All that a message may not move."""
        live = self._live()
        elements = {
            uuid: (each._impl.value, each._impl.removed, dict(vars(each._impl.props)), len(each._impl.update_cb))
            for uuid, each in self._handles.items()
        }
        return live.session.settings, live.seen.time, live.seen.target, live.seen.pulled.tolist(), elements

    def _send(self, raw: bytes | str) -> None:
        client, gate = self._client(), self._live().gate
        before = gate.refused
        with suppress(ConnectionClosed):
            client.send(raw)
        _until(lambda: gate.refused > before or _closed(client), "let through")

    def _move(self, chance: Random) -> None:
        client, gate = self._client(), self._live().gate
        uuid, slider = next(item for item in self._handles.items() if item[1].label == "friction")
        before, refused = slider.value, gate.refused
        for value in (chance.choice((0.5, 0.75, 1.5)), before):
            update = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
            client.send(msgspec.msgpack.encode(update))
            _until(lambda value=value: self._live()._session.settings.friction == value, "the page itself is refused")
        if gate.refused != refused:
            raise FoundFault(Kind.WRONG, "the page itself is refused")

    # -- attacks
    # ---------------------------------------------------------------------------------------------------------------

    def _message(self, chance: Random) -> bytes | str:
        uuid = chance.choice([*self._handles])
        bad: Any = chance.choice(_NO_VALUES)
        match chance.randrange(12):
            case 0:
                return chance.randbytes(chance.choice((0, 1, 7, 100, 5000)))
            case 1:
                whole = msgspec.msgpack.encode(chance.choice((_CAMERA, _CLICK, _DRAG)))
                return whole[: chance.randrange(len(whole))]
            case 2:
                return _text(chance)
            case 3:
                deep = chance.choice((b"\x91", b"\x81\xa1a", b"\xdd\xff\xff\xff\xff")) * chance.choice(
                    (1, 300, 900, 3000)
                )
                return deep + chance.choice((b"", b"\xc0"))
            case 4:
                return b"\xc4" + chance.randbytes(chance.choice((20_000, 300_000)))
            case 5 | 6:
                updates = {chance.choice(_ATTRIBUTES): chance.choice((*_NO_VALUES, True, 0))}
                if chance.random() < 0.3:
                    updates["value"] = self._handles[uuid].value
                return _packed({"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates})
            case 7 | 8:
                wrong = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": bad}}
                if chance.random() < 0.3:
                    wrong = {**wrong, "uuid": chance.choice(("", "x", 5, None, "nothing", "x" * 9999)), "extra": bad}
                return _packed(wrong)
            case 9:
                return _packed(self._of_another_type(chance, uuid, bad))
            case _:
                good = dict(chance.choice((_CAMERA, _CLICK, _DRAG)))
                return _packed(_spoilt(chance, good, bad))

    def _of_another_type(self, chance: Random, uuid: str, bad: Any) -> dict[str, Any]:
        upload = {"source_component_uuid": uuid, "transfer_uuid": "t", "filename": "../x", "mime_type": "text/plain"}
        sizes = {"part_count": chance.choice((0, 1, 2**40)), "size_bytes": 0, "part_index": 0, "content": b"x"}
        offered = ("ViewerCameraMessage", "ScenePointerMessage", "SceneNodeDragMessage", "GuiUpdateMessage")
        kind = chance.choice([name for name in _OTHERS if name not in offered] + [*_UPLOADS] * 10)
        fields = {"uuid": uuid, "name": _PINS, "owner": "", "source": "alert(1)", "frequency": 10.0, "value": bad}
        if chance.random() < 0.5 or kind == "CommandTriggerMessage":
            fields["uuid"] = "nothing"
        return {"type": kind, **chance.choice(({}, fields, {**upload, **sizes}, {**fields, **upload, **sizes}))}

    def _request(self, chance: Random) -> tuple[str, Callable[[], str]]:
        port = self._port
        own, other = f"localhost:{port}", f"http://evil.example:{port}"
        hosts = [
            *(
                "evil.example",
                f"evil.example:{port}",
                f"127.0.0.1.evil.example:{port}",
                "localhost",
                f"localhost:{port - 1}",
            ),
            *(
                "",
                f"0.0.0.0:{port}",
                f"user@{own}",
                f"{own}, {own}",
                f"localhost.:{port}",
                f"[::]:{port}",
                f"2130706433:{port}",
            ),
        ]
        origins = [
            *(
                "http://evil.example",
                other,
                "null",
                f"https://{own}",
                f"http://localhost:{port + 1}",
                f"http://{own}.evil",
            ),
            *(
                f"http://127.0.0.1:{port}",
                f"http://{own}/",
                f"file://{own}",
                "http://localhost",
                f"http://evil@{own}",
                " ",
            ),
        ]
        socketed, foreign = chance.random() < 0.6, chance.random() < 0.5
        lines = [f"Host: {chance.choice(hosts) if foreign else own}"]
        if foreign and chance.random() < 0.2:
            lines = chance.choice(([], [*lines, f"Host: {own}"]))
        if not foreign and (not socketed or chance.random() < 0.8):
            lines += [f"Origin: {chance.choice(origins)}"]
            lines += chance.choice(([], [], [f"Origin: http://{own}"]))
        elif foreign:
            lines += chance.choice(([], ["Origin: http://" + lines[0][6:] if lines else "Origin: null"]))
        if socketed:
            lines += ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
            lines += [
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
            ]
        path = chance.choice(("/", "/index.html", "/../../etc/passwd", "/?token=x", "/%00", "//evil.example/"))
        text = "\r\n".join((f"GET {path} HTTP/1.1", *lines, "", ""))
        return text, lambda: _answer(port, text)


_UPLOADS = (
    "FileTransferStartUpload",
    "FileTransferPart",
    "GuiButtonHoldMessage",
    "ShareUrlRequest",
    "GuiFormDirtyMessage",
)


def _text(chance: Random) -> str:
    return chance.choice(("", "{}", '{"type": "GuiUpdateMessage"}', "x" * 3000))


def _packed(message: object) -> bytes:
    return msgspec.msgpack.encode(message)


def _spoilt(chance: Random, good: dict[str, Any], bad: Any) -> dict[str, Any]:
    """A message with one thing wrong."""
    fields = [name for name in good if name not in ("type", "owner", "modifier")]
    field = chance.choice(fields)
    match chance.randrange(4):
        case 0:
            del good[field]
        case 1:
            good[f"{field} "] = bad
        case 2 if isinstance(good[field], list):
            number: Any = chance.choice((*_NUMBERS[:4], None, "1", [], b""))
            good[field] = [*good[field][1:], number]
        case _:
            good[field] = [*good[field], *good[field]] if isinstance(good[field], list) else _other(chance, field, bad)
    return good


def _other(chance: Random, field: str, bad: Any) -> Any:
    if field == "instance_index":
        return chance.choice((-1, _NONE, None, 1.5, "0"))
    if isinstance(_CAMERA.get(field), int | float):
        return chance.choice((math.nan, math.inf, 1e308, None, "1", [1.0]))
    return chance.choice(("rect-select", "/", "/world", "../x", 5, None, [], bad))


def _answer(port: int, text: str) -> str:
    """The first line of an answer; nothing where there is none."""
    with socket.create_connection(("127.0.0.1", port), timeout=_PATIENCE) as there, suppress(ConnectionError):
        there.sendall(text.encode())
        return there.recv(200).decode(errors="replace").partition("\r\n")[0]
    return ""


def _closed(client: ClientConnection) -> bool:
    """Whether nothing more comes from the page; what has come is thrown away."""
    try:
        while True:
            client.recv(timeout=0)
    except TimeoutError:
        return False
    except ConnectionClosed:
        return True


def _until(done: Callable[[], bool], otherwise: str) -> None:
    end = time.monotonic() + _PATIENCE
    while not done():
        if time.monotonic() > end:
            raise FoundFault(Kind.WRONG, otherwise)
        time.sleep(0.0005)


def _difference(before: Any, after: Any) -> str:
    for one, other in zip(before[0], after[0], strict=True):
        if one != other:
            return f"{str(one)[:150]} to {str(other)[:150]}"
    return f"files, {before[1]} to {after[1]}"
