"""Chromium without a window, driven by its DevTools protocol over a pipe."""

import fcntl
import itertools
import json
import os
import select
import shutil
import subprocess
import time

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE = 120.0  # s, on a busy machine


class Browser:
    """One page, and everything that went on in it: ``events`` by name."""

    def __init__(self, folder) -> None:
        (theirs, self._out), (self._in, their_out) = os.pipe(), os.pipe()
        # The browser reads 3 and writes 4; first out of the way of these numbers.
        high = [fcntl.fcntl(each, fcntl.F_DUPFD, 10) for each in (theirs, their_out)]

        def connect() -> None:
            for number, each in enumerate(high, 3):
                os.dup2(each, number)

        flags = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")
        self._process = subprocess.Popen(
            [CHROMIUM, *flags, f"--user-data-dir={folder}", "--remote-debugging-pipe", "--window-size=1200,900"],
            preexec_fn=connect,
            pass_fds=(3, 4),
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        for each in (theirs, their_out, *high):
            os.close(each)
        self._numbers, self._read, self._session = itertools.count(1), b"", None
        self.events: list[tuple[str, dict]] = []
        target = self("Target.createTarget", url="about:blank")["targetId"]
        self._session = self("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def __call__(self, method: str, **parameters):
        """What a command of the protocol returns."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while (answer := self._message()).get("id") != number:
            pass
        assert "error" not in answer, answer
        return answer["result"]

    def open(self, path) -> None:
        """Go to a file, and wait until all of it has been loaded."""
        self.events.clear()
        self("Page.navigate", url=path.as_uri())
        while not self.named("Page.loadEventFired"):
            self._message()

    def run(self, script: str):
        """The value of an expression in the page, awaited."""
        done = self("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def named(self, name: str) -> list[dict]:
        """What was told of a kind of event since the page was opened."""
        return [what for kind, what in self.events if kind == name]

    def complaints(self) -> list[dict]:
        """Errors, and what the page itself warns of; the browser warns of drawing without a graphics card."""
        said = [what for what in self.named("Runtime.consoleAPICalled") if what["type"] in ("error", "warning")]
        logged = [what for what in self.named("Log.entryAdded") if what["entry"]["level"] == "error"]
        return said + logged + self.named("Runtime.exceptionThrown")

    def nameless(self) -> list[str]:
        """Roles of what can be reached by the keyboard, or is a picture, and has no name for a screen reader."""
        nodes = self("Accessibility.getFullAXTree")["nodes"]
        used = [each for each in nodes if not each["ignored"] and each["role"]["value"] != "RootWebArea"]
        reached = [
            each
            for each in used
            if each["role"]["value"] in ("image", "img")
            or any(p["name"] == "focusable" for p in each.get("properties", ()))
        ]
        return [each["role"]["value"] for each in reached if not each.get("name", {}).get("value", "").strip()]

    def requested(self) -> list[str]:
        """Addresses of everything that was asked for."""
        return [what["request"]["url"] for what in self.named("Network.requestWillBeSent")]

    def _message(self) -> dict:
        end = time.monotonic() + PATIENCE
        while b"\0" not in self._read:
            assert select.select([self._in], [], [], max(0.0, end - time.monotonic()))[0], "the browser is silent"
            part = os.read(self._in, 1 << 20)
            assert part, "the browser went away"
            self._read += part
        first, _, self._read = self._read.partition(b"\0")
        message = json.loads(first)
        if "method" in message:
            self.events.append((message["method"], message["params"]))
        return message
