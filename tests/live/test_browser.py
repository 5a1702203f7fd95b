"""The live page in a real browser: Chromium without a window that draws without a graphics card."""

import io
import re
import shutil
import socket
import time
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from scipy import ndimage

from chilopod.analysis.parameters import stiffness
from chilopod.live import Live, wishes
from chilopod.robot import load_robot

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here to open the live page in"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]

PATIENCE = 120_000  # ms, on a busy machine
SOFTWARE_WEBGL = "--enable-unsafe-swiftshader"
SELDOM = """window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 200);
window.cancelAnimationFrame = clearTimeout;"""
READY = "Straight and stable"


@pytest.fixture(scope="module")
def chromium():
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[SOFTWARE_WEBGL])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def running():
    page = Live(load_robot("aoi2022-planar"), port=0)
    yield page
    page.close()


@pytest.fixture
def live(running):
    """The page as it is at first."""
    settings = wishes.Spring(None, stiffness(41.0)), wishes.Set("friction", 1.0), wishes.Set("speed", 2.0)
    for each in (*settings, wishes.Pause(False), wishes.Reset(1)):
        running.wish(each)
    yield running
    if running.failure is not None:
        raise running.failure


@pytest.fixture(scope="module")
def page(chromium, running):
    with visit(chromium, running) as page:
        yield page


@pytest.fixture
def opened(page, live):
    """One page for all tests, as a user would have it."""
    return page


@contextmanager
def visit(chromium, live, width=800, height=500, query=""):
    # Few pixels and few pictures a second, since the processor draws them.
    page = chromium.new_page(viewport={"width": width, "height": height}, device_scale_factor=0.25)
    page.set_default_timeout(PATIENCE)
    page.add_init_script(SELDOM)
    page.asked = []
    page.on("request", lambda request: page.asked.append(request.url))
    try:
        page.goto(f"{live.address}/{query}")
        page.get_by_text("first spring", exact=True).first.wait_for()
        yield page
    finally:
        page.close()


def type_into(page, label, text):
    field = page.locator(f"xpath=//*[normalize-space(text())='{label}']/following::input[@type='text'][1]")
    field.fill(text)
    field.press("Enter")
    field.evaluate("each => each.blur()")
    return field


def read(page, words):
    """Wait until the page says so, and give the whole paragraph, which may go again at once."""
    return page.wait_for_selector(f"text=/{words}/").inner_text()


def walked(page):
    return int(re.search(r"(\d+) s, seed", page.locator("body").inner_text())[1])


def test_two_browsers_a_reload_and_a_close(request, chromium, live):
    """The first test, since it stands while nobody looks: the other tests leave their page open."""
    with visit(chromium, live) as one, visit(chromium, live) as other:
        read(one, READY)
        type_into(one, "first spring", "30")
        read(other, "its first spring, 30 N")
        before = walked(other)
        other.reload()
        read(other, "its first spring, 30 N")
        assert walked(other) >= before
    time.sleep(1.0)
    stood, frames = live.seen.time, live.frames
    time.sleep(1.0)
    assert live.seen.time == stood  # while nobody looks
    assert live.frames == frames
    again = request.getfixturevalue("page")
    read(again, "its first spring, 30 N")
    assert walked(again) >= int(stood)


def test_a_spring_below_the_pitchfork_bends_it_to_the_radius_of_the_branch(opened):
    read(opened, READY)
    type_into(opened, "speed", "10")
    type_into(opened, "first spring", "9")
    said = read(opened, "Settled on a curve of .* the branch of curved walks has")
    walk, branch = (float(each) for each in re.findall(r"(\d+\.\d+) m", said)[:2])
    assert walk == pytest.approx(branch, rel=0.1)
    assert all(re.match(r"(http://(localhost|127\.0\.0\.1)[:/]|data:|blob:)", url) for url in opened.asked)


def test_a_click_on_the_floor_is_walked_to(opened):
    read(opened, READY)
    type_into(opened, "speed", "5")
    opened.mouse.click(420, 400)
    read(opened, "On its way to the target")
    read(opened, "arrived after")


def joint_in(page):
    """Where on the page a yaw joint stands still: the largest purple spot below notifications and beside words."""
    found = before = None
    while found is None or found != before:
        before = found
        page.wait_for_timeout(500)
        shown = Image.open(io.BytesIO(page.screenshot(scale="css"))).convert("RGB")
        red, green, blue = np.asarray(shown, float).transpose(2, 0, 1)
        purple = (red > 1.2 * green) & (red > 1.1 * blue) & (blue > 1.1 * green) & (red > 120.0)
        purple[:200] = purple[:, 920:] = False
        spots, count = ndimage.label(purple)
        sizes = ndimage.sum_labels(purple, spots, np.arange(1, count + 1))
        found = tuple(ndimage.center_of_mass(purple, spots, 1 + np.argmax(sizes))) if count else None
    return found[::-1]


def test_a_joint_that_is_dragged_bends_and_springs_back(opened, live):
    opened.set_viewport_size({"width": 1280, "height": 800})
    read(opened, READY)
    live.wish(wishes.Pause(True))
    read(opened, "Paused")
    x, y = joint_in(opened)
    opened.mouse.move(x, y)
    opened.mouse.down()
    opened.mouse.move(x + 20.0, y + 20.0, steps=4)
    live.wish(wishes.Pause(False))
    read(opened, r"Joint \d is pulled aside, and it walks on, bent")
    assert np.abs(live.seen.joint_angles).max() > 0.1
    opened.mouse.up()
    live.wish(wishes.Set("speed", 10.0))
    read(opened, READY)
    opened.set_viewport_size({"width": 800, "height": 500})


def test_keys_do_what_controls_do(opened, live):
    read(opened, READY)
    refused = live.gate.refused
    opened.locator("body").press("h")
    read(opened, "first spring softer, stiffer")
    opened.locator("body").press("h")
    opened.get_by_text("first spring softer, stiffer").wait_for(state="hidden")
    opened.locator("body").press("h")
    read(opened, "first spring softer, stiffer")
    opened.keyboard.press("Escape")
    opened.get_by_text("first spring softer, stiffer").wait_for(state="hidden")
    opened.locator("body").press("z")
    read(opened, r"its first spring, 37\.3 N")
    opened.locator("body").press("Space")
    read(opened, "Paused")
    opened.locator("body").press("t")
    read(opened, r"On its way to the target, 1\.[23]\d m off")
    opened.locator("body").press("l")
    assert live.gate.refused == refused  # the page itself gets through


def test_the_address_sets_the_walk_and_says_what_of_it_is_wrong(chromium, live):
    with visit(chromium, live, query="?k1=9&seed=3&friction=77") as page:
        read(page, r"In the address: friction = 77")
        page.wait_for_timeout(9000.0)  # longer than other notifications stay
        read(page, r"In the address: friction = 77")
        read(page, r"first spring, 9 N")
        read(page, r"s, seed 3")
        link = page.locator("[data-copy]").get_attribute("data-copy")
        assert link == f"{live.address}/?k1=9&seed=3"


def test_nothing_covers_the_robot(opened):
    for width, height in ((390, 800), (1280, 800), (800, 500)):
        opened.set_viewport_size({"width": width, "height": height})
        end, covered = time.monotonic() + PATIENCE / 1000.0, True
        while covered and time.monotonic() < end:  # until the page has its new layout
            time.sleep(0.1)
            canvas = opened.locator("canvas[data-engine]").bounding_box()
            words = opened.get_by_text("Soften the").bounding_box()
            right, low = canvas["x"] + canvas["width"] - 1, canvas["y"] + canvas["height"] - 1
            covered = not (canvas["height"] > 100.0 and 300.0 < canvas["width"] <= width)
            covered |= words["x"] < right and words["y"] < low
        assert not covered, (width, canvas, words)


def test_nonsense_in_a_field_is_refused_in_a_line(opened):
    read(opened, READY)
    field = type_into(opened, "first spring", "NaN")
    assert field.input_value() != "NaN"
    type_into(opened, "friction", "1e9")
    type_into(opened, "seed", "-4")
    time.sleep(1.0)
    read(opened, READY)


def test_typing_a_number_is_not_refused(opened, live):
    """On the way to 30 the first spring is 3, and on the way to 12 it is 1, below its range."""
    read(opened, READY)
    before = live.gate.refused
    field = type_into(opened, "first spring", "41")
    for text in ("12", "30"):
        field.press("Control+a")
        field.press_sequentially(text, delay=50)
        field.press("Enter")
        read(opened, f"its first spring, {text} N")
    assert live.gate.refused == before


def test_who_does_not_read_holds_up_nobody(opened, live):
    """A client that has said hello and never takes anything off the line."""
    read(opened, READY)
    port = int(live.address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port)) as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        slow.sendall(
            f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nOrigin: http://localhost:{port}\r\n".encode()
            + b"Upgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            b"Sec-WebSocket-Protocol: " + protocol(opened) + b"\r\n\r\n"
        )
        assert b"101 Switching Protocols" in slow.recv(200)
        before = walked(opened)
        type_into(opened, "speed", "10")
        end = time.monotonic() + 30.0
        while walked(opened) <= before + 20:
            assert time.monotonic() < end
            opened.wait_for_timeout(100)


def protocol(page):
    """That this version of viser speaks."""
    import viser

    return f"viser-v{viser.__version__}".encode()


def test_a_recording_comes_as_two_files(opened, tmp_path):
    read(opened, READY)
    type_into(opened, "speed", "5")
    opened.get_by_role("button", name="Record (C)").click()
    read(opened, ", recording")
    files = []
    opened.on("download", lambda each: files.append(each))
    time.sleep(1.0)
    opened.get_by_role("button", name="End the recording (C)").click()
    while len(files) < 2:
        opened.wait_for_timeout(100)
    paths = {each.suggested_filename: tmp_path / each.suggested_filename for each in files}
    for each in files:
        each.save_as(paths[each.suggested_filename])
    record = xr.load_dataset(paths["chilopod-live-1.nc"])
    assert record.sizes["time"] > 10
    assert "</html>" in paths["chilopod-live-1.html"].read_text(encoding="utf-8")
