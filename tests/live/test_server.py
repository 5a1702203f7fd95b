"""The server of the live page, without a browser: what it serves, who may open it, and that recordings are kept."""

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
import viser
import xarray as xr
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import in_process
import live_clients
import outcomes
import workers
from chilopod import process
from chilopod.cli import main
from chilopod.engine import Status
from chilopod.errors import ParameterError
from chilopod.live import Live, Session, gate, wishes
from chilopod.live.controls import HELP
from chilopod.live.scene import floor_place
from chilopod.robot import load_robot

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:websockets", "ignore::DeprecationWarning:viser")

PLANAR = load_robot("aoi2022-planar")
PROTOCOL = f"viser-v{viser.__version__}"


class Nobody:
    """Who computes beside the page; here nobody."""

    def __init__(self, engine):
        pass

    def ask(self, robot, springs=None):
        pass

    def answers(self):
        return []

    def close(self):
        pass


@pytest.fixture(scope="module")
def page():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chilopod.live.server.Beside", Nobody)
        live = Live(PLANAR, port=0)
        yield live
        live.close()


@pytest.fixture(scope="module")
def attacks(page):
    made = live_clients.LiveClients(page)
    yield made
    made.close()


def attacked(attacks, folder, count):
    """What came of so many attacks by clients, and what got through."""
    tried = [workers.attempt(attacks, 13, case, in_process.new_place(folder)) for case in range(count)]
    return {each.kind for each in tried}, [each.said for each in tried if each.kind not in outcomes.FINE]


def port_of(page):
    return int(page.address.rpartition(":")[2])


def fetched(page):
    with urllib.request.urlopen(page.address, timeout=30.0) as answer:
        return answer.status, answer.read()


def test_serves_the_page_to_this_machine_only(page):
    status, content = fetched(page)
    assert status == 200
    assert b"<html" in content
    assert page.frames == 0  # nobody watches
    with socket.socket() as here:
        here.settimeout(10.0)
        here.connect(("127.0.0.1", port_of(page)))
        assert here.getpeername()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\x00\xff" * 4000,
        b"GET / HTTP/1.1\r\n\r\n",
        b"POST /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: eA==\r\n\r\n",
    ],
    ids=["bytes", "bare", "path", "handshake"],
)
def test_who_sends_nonsense_harms_nobody(page, nonsense):
    with socket.create_connection(("127.0.0.1", port_of(page)), timeout=10.0) as there, contextlib.suppress(OSError):
        there.sendall(nonsense)
        there.settimeout(1.0)
        there.recv(1 << 16)
    assert fetched(page)[0] == 200
    assert page.failure is None


def test_the_address_is_there_before_the_first_walk_is_compiled(monkeypatch, capsys):
    """Compiling takes half a minute; with --port 0 nobody else knows where."""
    told = []

    def compiled(live, robot, engine):
        told.append((capsys.readouterr().out, fetched(live)[0]))
        raise ParameterError("enough")

    monkeypatch.setattr(Live, "_compile", compiled)
    monkeypatch.setattr("chilopod.live.server.Beside", Nobody)
    assert main(["live", "--port", "0"]) == 2
    ((out, status),) = told
    assert re.fullmatch(r"aoi2022-planar walks at http://localhost:\d+ \(Ctrl-C ends it\)\n", out)
    assert status == 200


def test_a_port_in_use_is_one_line(page, capsys):
    port = port_of(page)
    with pytest.raises(ParameterError, match=f"port = {port}: .*in use"):
        Live(PLANAR, port=port)
    assert main(["live", "--port", str(port)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert f"--port = {port}" in said.err


@pytest.mark.parametrize(
    ("argv", "part"),
    [
        (["live", "--port", "70000"], "--port = 70000"),
        (["live", "--duration", "-1 s"], "--duration = '-1 s': must be a time to walk"),
        (["live", "--out", "/dev/null"], "/dev/null/chilopod-live-1.nc: --out: cannot be written"),
        (["live", "--seed", "18446744073709551615"], "--seed"),
        (["live", "--host", "256.1.1.1"], "--host = '256.1.1.1': must be an address"),
        (["live", "--host", "8.8.8.8", "--port", "0"], "--host = '8.8.8.8': must be an address"),
        (["live", "--engine", "twin"], "[twin]"),
        (["live", "--engine", "twn"], "did you mean"),
        (["live", "--strategy", "leg-jaw"], "did you mean 'leg-yaw'"),
        (["live", "aoi2023"], "aoi2022"),
    ],
)
def test_bad_input_is_one_line(argv, part, capsys):
    assert main(argv) == 2
    said = capsys.readouterr().err
    assert part in said
    assert said.count("\n") == 1


def test_what_is_there_is_not_replaced_by_recordings(tmp_path, capsys):
    (tmp_path / "chilopod-live-7.html").touch()
    assert main(["live", "--out", str(tmp_path)]) == 2
    assert "only replaced with --force" in capsys.readouterr().err


def test_bad_options_are_refused_before_anything_heavy_is_loaded():
    """Not after the twenty seconds that the first walk takes."""
    script = """
import sys
from chilopod.cli import main
for options in (["--duration", "-1 s"], ["--port", "70000"], ["--out", "/dev/null"]):
    assert main(["live", *options]) == 2
print(*[name for name in ("numba", "viser", "xarray") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_a_ray_of_sight_meets_the_floor():
    assert floor_place((1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.5, 0.25, -1.0)) == (0.0, 0.5)
    assert floor_place((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.5, 0.25, 0.1)) is None


def test_the_docs_have_all_keys():
    assert HELP in (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")


# -- who may open the page
# ---------------------------------------------------------------------------------------------------------------------


def test_clients_that_are_not_the_page_get_nowhere(attacks, tmp_path):
    kinds, through = attacked(attacks, tmp_path, 150)
    assert through == []
    assert outcomes.Kind.REFUSED in kinds


@pytest.mark.parametrize(
    ("name", "planted"),
    [("_unwelcome", lambda *_: None), ("_offers", lambda *_: True), ("message", lambda self, connection, raw: raw)],
)
def test_the_attacks_find_a_gate_that_is_open(attacks, tmp_path, monkeypatch, name, planted):
    monkeypatch.setattr(gate.Gate, name, planted)
    monkeypatch.setattr(live_clients, "_PATIENCE", 0.3)
    monkeypatch.setattr(live_clients, "_REQUESTS", 1.0 if name == "_unwelcome" else 0.0)
    assert attacked(attacks, tmp_path, 8)[1] != []


def test_what_is_used_of_viser_is_still_there(page):
    """Names of viser that are not documented; where one is gone or another, :mod:`chilopod.live.gate` has to follow."""
    server = page.server
    assert isinstance(server._websock_server._live_connections, dict)
    assert len(server.gui._gui_input_handle_from_uuid) > 20
    assert len(server.gui._command_handle_from_uuid) > 20
    assert server.scene.get_handle_by_name("/world/pin")._impl.drag_cb
    handles = server.gui._gui_input_handle_from_uuid.values()
    slider = next(each for each in handles if isinstance(each, viser.GuiSliderHandle))
    assert (slider.disabled, slider.visible) == (False, True)
    for good in (live_clients._CAMERA, live_clients._CLICK, live_clients._DRAG):
        assert msgspec.convert(good, gate._KINDS[good["type"]])
    assert gate._scripts().count("'sha256-") == 3  # not 'unsafe-inline'
    assert b"<title>chilopod live</title>" in gate._page()
    assert b"Viser client" not in gate._page()


def test_a_viser_that_listens_in_another_way_is_not_used(monkeypatch):
    class Other(viser.ViserServer):
        def __init__(self, **how):
            gate._infra.websockets.asyncio.server.serve = gate.serve  # as if it found it elsewhere
            super().__init__(**how)

    monkeypatch.setattr(gate.viser, "ViserServer", Other)
    with pytest.raises(RuntimeError, match="cannot be guarded"):
        gate.Gate("127.0.0.1").open(0)


def test_an_answer_is_for_no_frame_and_for_no_other_page(page):
    with urllib.request.urlopen(page.address, timeout=30.0) as answer:
        headers = answer.headers
    policy = headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in policy
    assert f"connect-src 'self' data: blob: ws://localhost:{port_of(page)};" in policy
    assert "unsafe" not in policy.partition("style-src")[0].replace("'wasm-unsafe-eval'", "")
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"


def asked(page, query, **headers):
    """What the gate takes from the address of a request."""
    told = {f"Sec-Fetch-{name}": value for name, value in headers.items()}
    request = urllib.request.Request(f"{page.address}/?{query}", headers=told)
    with urllib.request.urlopen(request, timeout=30.0):
        return page.gate.asked()


def test_an_address_is_obeyed_only_if_a_person_opened_it(page, monkeypatch):
    assert asked(page, "k1=8", Site="none", Dest="document") == ("k1=8", True)
    assert asked(page, "k1=8", Site="cross-site", Dest="document") == ("k1=8", False)
    assert asked(page, "k1=8", Site="cross-site", Dest="image") == ("", False)
    assert asked(page, "k1=8") == ("", False)
    monkeypatch.setattr(page.gate, "asked", lambda: ("k1=8", False))  # from another web site
    page._take_address()
    time.sleep(0.5)
    assert page.session.settings.robot == PLANAR.override("springs.adjustable", True)


def test_a_browser_without_webgl_has_pictures(page):
    with urllib.request.urlopen(f"{page.address}/picture.svg", timeout=30.0) as answer:
        assert answer.headers["Content-Type"] == "image/svg+xml"
        drawn = answer.read().decode()
    assert drawn.count("<rect") == 6 + 12 + 1  # modules, feet, ground
    assert "seed 1" in drawn


def test_another_preset_is_another_robot(page):
    page.errand(page.choose, "ten modules")
    end = time.monotonic() + 60.0
    while page.seen.robot.body.modules != 10:
        assert time.monotonic() < end
        assert page.failure is None
        time.sleep(0.05)
    page.errand(page.choose, "uniform soft springs")
    while page._controls._sliders["springs.stiffness"].value != 6.0:
        assert time.monotonic() < end
        time.sleep(0.05)
    page.errand(page.choose, "as started")
    while not page._query().startswith("seed="):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_an_address_sets_the_whole_walk(page):
    """Sliders and the strategy that it leaves out are as at the start."""
    for asked in ("k3=8&friction=0.5&seed=1&strategy=leg-yaw", "k1=8&seed=2"):
        page.errand(partial(page._open_address, True), asked)
        end = time.monotonic() + 10.0
        while page._query() != asked or page._controls._strategy.value != page.session.settings.strategy:
            assert time.monotonic() < end, page._query()
            assert page.failure is None
            time.sleep(0.02)
    page.errand(partial(page._open_address, True), "seed=1")


def test_a_browser_that_nobody_knows_yet_moves_no_slider(page):
    """Before its first word about its camera viser would move it in all browsers, and the robot would not follow."""
    port, refused = port_of(page), page.gate.refused
    slider = page._controls._sliders["friction"]
    uuid, before = slider._impl.uuid, slider.value
    at = {"origin": f"http://localhost:{port}", "subprotocols": [PROTOCOL]}
    move = msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 0.5}})
    with connect(f"ws://localhost:{port}", **at, compression=None, max_size=None, close_timeout=0.1) as client:
        client.send(move)
        end = time.monotonic() + 10.0
        while page.gate.refused == refused and time.monotonic() < end:
            time.sleep(0.01)
        assert (page.gate.refused, slider.value) == (refused + 1, before)
        client.send(msgspec.msgpack.encode(live_clients._CAMERA))
        client.send(move)
        while slider.value != 0.5:
            assert time.monotonic() < end, (page.gate.refused - refused, page.server.get_clients())
            time.sleep(0.01)
    page.wish(wishes.Set("friction", before))


def test_a_number_that_is_being_typed_is_no_attack(page, caplog):
    """On the way to 12 the first spring is 1, below its range."""
    port, before, spring = port_of(page), page.gate.refused, page._controls._sliders["springs.stiffness[0]"]
    seed, taken = page._controls._seed, []
    at = {"origin": f"http://localhost:{port}", "subprotocols": [PROTOCOL]}
    with (
        connect(f"ws://localhost:{port}", **at, compression=None, max_size=None, close_timeout=0.1) as client,
        pytest.MonkeyPatch.context() as patch,
    ):
        client.send(msgspec.msgpack.encode(live_clients._CAMERA))
        patch.setattr(spring._impl, "update_cb", [lambda event: taken.append(event.target.value)])
        patch.setattr(page.gate, "refused", 0)
        for handle, value in ((spring, 1), (spring, 999.0), (seed, -3), (spring, 12), (spring, 1e17)):
            update = {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": value}}
            client.send(msgspec.msgpack.encode(update))
        end = time.monotonic() + 10.0
        while not (taken and page.gate.refused) and time.monotonic() < end:
            time.sleep(0.01)
        assert (taken, page.gate.refused, seed.value) == ([12], 1, 1)
    (said,) = [each.getMessage() for each in caplog.records if each.name == "chilopod.live"]
    assert "GuiUpdateMessage" in said
    assert "a message that it does not offer" in said
    page.gate.refused = before
    page.wish(wishes.Spring(0, PLANAR.springs.stiffness[0]))


def test_a_flood_of_messages_is_slowed_down(page):
    port, before, begun = port_of(page), page.gate.refused, time.monotonic()
    at = {"origin": f"http://localhost:{port}", "subprotocols": [PROTOCOL]}
    with connect(f"ws://localhost:{port}", **at, compression=None, max_size=None) as client:
        for _ in range(300):
            client.send(b"x")
        while page.gate.refused < before + 300:
            time.sleep(0.01)
    assert time.monotonic() - begun > 90 / gate._RATE  # all but those that may come at once


@pytest.mark.parametrize(
    ("asked", "part"),
    [
        (wishes.Set("frictoin", 1.0), "did you mean 'friction'"),
        (wishes.Spring(9, 0.5), r"slider = 'springs.stiffness\[9\]': must be a slider"),
        (wishes.Spring(0, -1.0), r"springs.stiffness\[0\] = -1.0: is out of range"),
        (wishes.Spring(0, float("nan")), "must be a finite number"),
    ],
)
def test_a_slider_that_cannot_be_set_is_an_error_in_python(page, asked, part):
    with pytest.raises(ParameterError, match=part):
        page.wish(asked)


def test_a_robot_that_has_stopped_is_not_sent_to_a_place(page, monkeypatch):
    """It has none, and the page says to press R."""
    put, controls = [], page._controls
    monkeypatch.setattr(controls, "_put", put.append)
    monkeypatch.setattr(controls, "_seen", replace(page.seen, status=Status.OUT_OF_RANGE, pose=np.full(3, np.nan)))
    controls._go()
    assert put == []
    monkeypatch.setattr(controls, "_seen", page.seen)
    controls._go()
    assert [type(each) for each in put] == [wishes.Target]


def test_the_largest_seed_reaches_later_browsers(page):
    """One that no message can hold ended every connection that was made after it."""
    for seed in (2**64 - 1, 1e30, 10**400, wishes.LARGEST_SEED):
        page.wish(wishes.Reset(seed))
        time.sleep(0.3)
    assert page.session.settings.seed == wishes.LARGEST_SEED
    sent = list(page.server._websock_server._broadcast_buffer.message_from_id.values())
    assert msgspec.msgpack.encode([each.as_serializable_dict([]) for each in sent])
    page.wish(wishes.Reset(1))


def test_requests_that_are_none_for_a_page_are_counted_without_a_traceback(page, capfd):
    port, refused = page.server.get_port(), page.gate.refused
    for sent in (b"POST / HTTP/1.1\r\nHost: x\r\n\r\n", b"", b"GET /" + b"a" * 9000 + b" HTTP/1.1\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", port), timeout=30.0) as client:
            client.sendall(sent)
            client.shutdown(socket.SHUT_WR)
            with contextlib.suppress(ConnectionResetError):
                while client.recv(4096):
                    pass
    end = time.monotonic() + 30.0
    while page.gate.refused < refused + 2 and time.monotonic() < end:
        time.sleep(0.05)
    assert page.gate.refused == refused + 2  # not the connection that asked for nothing
    assert "Traceback" not in capfd.readouterr().err


def test_other_addresses_want_the_token_of_the_link():
    entry = gate.Gate("0.0.0.0")
    server = entry.open(0)
    try:
        port = server.get_port()
        page, token = f"http://127.0.0.1:{port}/", entry.link(port).partition("?")[2]
        for refused in (page, f"{page}?token=", f"{page}?token=x", f"{page}?{token}x"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(refused, timeout=30.0)
        with urllib.request.urlopen(f"{page}?{token}", timeout=30.0) as answer:
            cookie = answer.headers["Set-Cookie"]
        assert cookie.endswith("; HttpOnly; SameSite=Strict; Path=/")
        told = {"additional_headers": {"Cookie": cookie.partition(";")[0]}}
        where = {"uri": f"ws://127.0.0.1:{port}", "subprotocols": [PROTOCOL]}
        connect(**where, **told, origin=page[:-1]).close()
        for refused in ({"origin": page[:-1]}, {**told, "origin": "http://evil.example"}, told):
            with pytest.raises(InvalidStatus, match="403"):
                connect(**where, **refused)
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("host", "link"),
    [
        ("127.0.0.1", r"http://localhost:80"),
        ("::1", r"http://localhost:80"),
        ("192.0.2.7", r"http://192\.0\.2\.7:80/\?token=[\w-]{32}"),
        ("2001:db8::7", r"http://\[2001:db8::7\]:80/\?token=[\w-]{32}"),
    ],
)
def test_a_link_has_a_token_where_others_reach_it(host, link):
    assert re.fullmatch(link, gate.Gate(host).link(80))


# -- recordings
# ---------------------------------------------------------------------------------------------------------------------


def test_recordings_end_where_there_is_no_room(monkeypatch):
    monkeypatch.setattr("chilopod.live.session._MOST_RECORDS", 2)
    session = Session(PLANAR)
    session.box.put(wishes.Record(True))
    for stride in (0.02, 0.03, 0.02, 0.03):
        session.box.put(wishes.Set("gait.stride", stride))
        session.obey()
        session.walk_on(1.3)
    assert len(session.records()) == 2
    assert not session.settings.recording
    assert "room for no more than the 2" in " ".join(session.messages())


def test_what_no_browser_took_is_there_for_the_next(page):
    sent = []
    browser = SimpleNamespace(
        client_id=-1, send_file_download=lambda name, content, save_immediately: sent.append((name, content))
    )
    page.undelivered.append(("kept", b"record", "page"))
    page.server._connected_clients[-1] = browser
    try:
        asyncio.run(page.recordings.greet(browser))
    finally:
        del page.server._connected_clients[-1]
    assert sent == [("kept.nc", b"record"), ("kept.html", b"page")]
    assert page.undelivered == []


@pytest.mark.parametrize(
    ("number", "options", "folder"),
    [(signal.SIGINT, [], "."), (signal.SIGTERM, ["--out", "kept"], "kept"), (signal.SIGHUP, [], ".")],
)
def test_a_recording_outlives_whoever_ends_the_page(number, options, folder, tmp_path, monkeypatch, capsys):
    """Nobody watches, so that there is no browser to take it either."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("chilopod.live.server.Beside", Nobody)
    wait, pages = Live.wait, []

    def end(page):
        while page.seen.time < 1.0:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    def recorded(page, seconds):
        pages.append(page)
        page.wish(wishes.Record(True))
        page.wish(wishes.Step(4.0))
        threading.Thread(target=end, args=(page,)).start()
        wait(page, seconds)

    monkeypatch.setattr(Live, "wait", recorded)
    monkeypatch.setattr(process, "_pressed", [])  # the handler is that of the command line's own process
    former = {each: signal.signal(each, process._interrupted) for each in (number,)}
    try:
        assert main(["live", "--port", "0", *options]) == 130
    finally:
        for each, handler in former.items():
            signal.signal(each, handler)
    assert xr.load_dataset(tmp_path / folder / "chilopod-live-1.nc").sizes["time"] > 10
    assert "</html>" in (tmp_path / folder / "chilopod-live-1.html").read_text(encoding="utf-8")
    assert capsys.readouterr().err.count("wrote ") == 2
    assert not pages[0]._thread.is_alive()
