"""The server of the live page, without a browser."""

import contextlib
import socket
import urllib.request
from pathlib import Path

import pytest

from chilopod.cli import main
from chilopod.errors import ParameterError
from chilopod.live import Live
from chilopod.live.controls import HELP
from chilopod.live.scene import floor_place
from chilopod.robot import load_robot

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:websockets", "ignore::DeprecationWarning:viser")

PLANAR = load_robot("aoi2022-planar")


@pytest.fixture(scope="module")
def page():
    live = Live(PLANAR, port=0)
    yield live
    live.close()


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
        (["live", "--host", "256.1.1.1"], "--host = '256.1.1.1': is no address"),
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


def test_a_ray_of_sight_meets_the_floor():
    assert floor_place((1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.5, 0.25, -1.0)) == (0.0, 0.5)
    assert floor_place((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.5, 0.25, 0.1)) is None


def test_the_docs_have_all_keys():
    assert HELP in (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")
