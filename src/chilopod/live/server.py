"""The page: a server for browsers, the one thread that owns the walk, and the process that computes beside it."""

from __future__ import annotations

import asyncio
import contextlib
import io
import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from concurrent import futures
from functools import partial
from typing import Any

import xarray as xr

from chilopod.engine import engine_named
from chilopod.errors import ChilopodError, in_words
from chilopod.extras import needs
from chilopod.live import wishes
from chilopod.live.body import Body, FlatBody, Placed
from chilopod.live.challenges import CHALLENGES, Challenge
from chilopod.live.pictures import from_above
from chilopod.live.ports import free_port
from chilopod.live.presets import OWN, PRESETS, preset_of, query, read
from chilopod.live.session import SPEED, Session
from chilopod.live.state import Settings, but_springs
from chilopod.live.theory import Beside, Growth, Theory
from chilopod.live.words import sentences
from chilopod.netcdf import netcdf
from chilopod.robot import Robot

needs("viser", extra="live")

import viser  # noqa: E402  (there, as has just been seen)

from chilopod.live.controls import Calls, Controls  # noqa: E402
from chilopod.live.gate import Gate  # noqa: E402
from chilopod.live.scene import View, floor_place  # noqa: E402

_FRAME = 1.0 / 25.0  # s; with more, a browser without a graphics card falls behind, and answers later
_SOONEST = 0.01  # s from one frame to the next that a wish brings on
_BEHIND = 0.1  # s that may be made up for
_PLOTS = 0.25  # s from one drawing of the plots and sentences to the next
_LOOKS_AGAIN = 2.0  # s after a picture in which a browser without WebGL asks for the next one
_PANEL = 340  # px
_ALONE = 0.1  # s from one look to the next while no browser watches


class Live:
    """A page with a walking robot, which stands still while no browser watches.

    Parameters
    ----------
    robot, engine, seed, strategy
        As for :class:`chilopod.live.Session`.
    host, port
        Address and port to listen at; 0 for any port that is free. At other addresses than this machine's own a browser
        needs the token in :attr:`address`.
    token
        True if a browser needs a token on this machine too.
    kept
        Function of the name of a recording and its two files, netCDF and HTML, besides the download in the browser; its
        errors are shown at the page.

    Attributes
    ----------
    address
        Link to open in a browser, with the token if one is needed.
    gate
        Checks of requests and messages; counts those that it refused.
    undelivered
        Names and files of recordings that neither ``kept`` nor a browser took.
    seen, frames, busy
        The last frame, the number of frames that were shown, and the time for which the walk's thread worked, s.
    failure
        Error that ended the thread, if one did.

    Raises
    ------
    ParameterError
        If the port is in use or there is no such address, or the engine cannot walk such a robot.
    ExtraError
        If viser is not installed.
    """

    def __init__(
        self,
        robot: Robot,
        engine: str = "planar",
        *,
        seed: int = 1,
        strategy: str = "variable",
        host: str = "127.0.0.1",
        port: int = 8080,
        token: bool = False,
        kept: Callable[[str, bytes, str], None] | None = None,
    ) -> None:
        self._session = Session(robot, engine, seed=seed, strategy=strategy)
        self.seen = self._session.seen()
        self._body = _body(robot, engine)
        self._kept, self._recordings = kept, 0
        self.undelivered: list[tuple[str, bytes, str]] = []
        # Drawing a replay of minutes takes a moment, and the walk goes on.
        self._drawing = futures.ThreadPoolExecutor(1, thread_name_prefix="chilopod recordings")
        self._handing_out: list[futures.Future[None]] = []
        self._over, self._ended = threading.Event(), threading.Event()
        self._theory = Theory()
        self._growth: Growth | None = None
        self._wants_record: viser.ClientHandle | None = None
        self.frames, self.busy, self._wished = 0, 0.0, False
        self.gate = Gate(host, token)
        free = free_port(host, port)
        with _quiet():
            self._server = self.gate.open(free)
        self._preset, self._own = OWN, (robot, engine)
        self._challenge: Challenge | None = None
        self._errands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._looked = -math.inf  # time of the last picture for a browser without WebGL
        self._beside = Beside(engine)
        try:
            self._server.gui.configure_theme(show_share_button=False, show_logo=False)
            self._server.gui.set_panel_label("chilopod live")
            self._server.scene.on_click()(self._clicked)
            self._server.on_client_connect(self._greet)
            self.gate.pictures = self._picture
            self._compile(robot, engine)
            self._furnish()
        except BaseException:
            self.close()
            raise
        self.address = self.gate.link(self._server.get_port())
        self._link = self.address.partition("/?")[0]
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="chilopod walk", daemon=True)
        self._thread.start()

    def _compile(self, robot: Robot, engine: str) -> None:
        """Walk the first steps ever, which are compiled, before anybody wants to see them; and say so."""
        note = self._server.gui.add_markdown(f"**Compiling** {robot.name}, once on this machine: up to half a minute.")
        Session(robot, engine).walk_on(1.5 * robot.gait.period)
        note.remove()

    def _furnish(self) -> None:
        """Everything of a page that is made for its robot."""
        server, seen, session = self._server, self.seen, self._session
        title = f"{seen.robot.name}, {seen.robot.body.modules} modules, {session.engine}"
        self._view = View(server, self._body.places(seen), session.file)
        later = (
            lambda word, do=do: self._errand(partial(do, word))
            for do in (self._choose, self._begin_challenge, self._answer)
        )
        calls = Calls(self._follow, self._recorder, *later)
        self._controls = Controls(server, session, title, self._preset, calls)
        self._plots, self._pitchfork = self._controls.plots, self._controls.pitchfork
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(_PANEL)
        for client in server.get_clients().values():
            self._view.fit(client.camera)
        self._view.pins.on_drag("left")(self._dragged)

    def wish(self, wish: wishes.Wish) -> None:
        """Leave a wish, from any thread, as the page does."""
        self._session.box.put(wish)
        self._wished = True

    def wait(self, seconds: float | None = None) -> None:
        """Wait for the given time, or until the thread of the walk fails; then raise its error."""
        end = math.inf if seconds is None else time.monotonic() + seconds
        # Not by joining the thread: Ctrl-C within a join that has a limit leaves a thread that counts as ended.
        while not self._ended.wait(min(0.5, max(0.0, end - time.monotonic()))) and time.monotonic() < end:
            pass
        if self.failure is not None:
            raise self.failure

    def close(self) -> None:
        """End the walk, the server and all processes; a recording under way is kept."""
        self._over.set()
        try:
            if hasattr(self, "_thread"):
                self._session.box.wake()
                self._ended.wait()
                self._session.stop_recording()
                self._keep()
                futures.wait(self._handing_out)
        finally:
            self._drawing.shutdown()
            self._beside.close()
            with _quiet():
                self._server.stop()

    # -- the thread of the walk

    def _run(self) -> None:
        try:
            self._walk()
        except BaseException as error:
            self.failure = error
            self._at_server(partial(self._controls.fail, in_words(error)))
        finally:
            self._ended.set()

    def _walk(self) -> None:
        last, plotted, walked = time.perf_counter(), -math.inf, _Rate()
        self._ask()
        while not self._over.wait(max(0.0, last + _SOONEST - time.perf_counter())):
            self._session.box.wait(max(0.0, last + _FRAME - time.perf_counter()))
            now = time.perf_counter()
            passed, last = min(now - last, _BEHIND), now
            watched = bool(self._server.get_clients()) or now - self._looked < _LOOKS_AGAIN
            self._run_errands()
            session = self._session
            if self._obey():
                plotted = -math.inf
            settings = session.settings
            if watched and not settings.paused:
                session.walk_on(passed * settings.speed)
            seen = self.seen = session.seen()
            walked.add(now, seen.time)
            if self._challenge:
                self._challenge.look(seen)
            self._plots.add(seen)
            self._at_server(partial(self._show, self._body.places(seen), now - plotted > _PLOTS, walked.value))
            if now - plotted > _PLOTS:
                plotted = now
            self.frames += watched
            self._keep()
            self.busy += time.perf_counter() - now
            if not watched:
                self._over.wait(_ALONE)

    def _at_server(self, do: Callable[[], None]) -> None:
        """Let the thread of the server do something, and wait for it.

        viser wakes those who send to browsers by an event of asyncio, which no other thread may touch: with two
        browsers it fails now and then.
        """

        async def done() -> None:
            do()

        asyncio.run_coroutine_threadsafe(done(), self._server.get_event_loop()).result()

    def _show(self, placed: Mapping[str, Placed], all_of_it: bool, rate: float) -> None:
        """A frame, whose parts appear at once; not in every one of them text and curves."""
        with self._server.atomic():
            self._view.show(placed, self.seen)
            self._controls.reflect(self._session.settings, self.seen)
            if all_of_it:
                self._controls.words.content = self._words(rate)
                self._plots.show()
                self._pitchfork.show(self.seen, self._shown())
                self._controls.show_challenge(self._challenge)
                self._controls.show_link(f"{self._link}/?{self._query()}")

    def _obey(self) -> bool:
        """Grant wishes and take answers; True if there was a wish."""
        session, before = self._session, self._session.settings
        wished, self._wished = self._wished, False
        obeyed = session.obey()
        if obeyed:
            if session.settings.robot != before.robot:
                self._ask(before.robot)
            if session.seen().time < self.seen.time:
                for each in (self._view, self._plots, self._pitchfork):
                    each.forget()
        messages = session.messages()
        for sentence in messages:
            self._at_server(partial(self._notify, sentence))
        if messages or wished:
            self._at_server(partial(self._controls.put_back, session.settings))
        for answer in self._beside.answers():
            if isinstance(answer, Theory):
                self._theory = answer
                session.law = answer.law
            else:
                self._growth = answer
        return obeyed

    def _notify(self, sentence: str) -> None:
        for client in self._server.get_clients().values():
            client.add_notification("chilopod", sentence, auto_close_seconds=8.0)

    def _ask(self, before: Robot | None = None) -> None:
        """Ask for the unknown theory of the present robot."""
        robot = self._session.settings.robot
        if engine_named(self._session.engine).traits.exact:
            self._beside.ask_growth(robot)
        # The theory is of any first spring.
        parts = [(each.springs.stiffness[1:], *but_springs(each)) for each in (robot, before) if each is not None]
        if before is None or parts[0] != parts[1]:
            self._theory = Theory(remark="computing the pitchfork", computing=True)
            self._session.law = None
            self._beside.ask(robot)

    def _shown(self) -> Theory:
        """Theory as far as a challenge allows."""
        hidden = self._challenge is not None and self._challenge.hides and not self._challenge.done
        return Theory(remark="hidden until you have found it", computing=True) if hidden else self._theory

    def _words(self, rate: float) -> str:
        session, seen, shown = self._session, self.seen, self._shown()
        words = sentences(seen, session.settings, shown, self._growth if shown is self._theory else None)
        settings = session.settings
        slow = "" if settings.paused or rate > 0.8 * settings.speed else f", as fast as it goes: {rate:.1f} times"
        recording = ", recording" if settings.recording else ""
        return f"{' '.join(words)}\n\n{seen.time:.0f} s, seed {settings.seed}{slow}{recording}"

    # -- presets, challenges and addresses, in the thread of the walk

    def _errand(self, do: Callable[[], None]) -> None:
        self._errands.put(do)
        self._session.box.wake()

    def _run_errands(self) -> None:
        while not self._errands.empty():
            self._errands.get()()

    def _choose(self, name: str) -> None:
        """Another robot, or the same with the settings of a preset; the page is made anew for it."""
        preset, before = PRESETS[name], self._session
        robot, engine = (preset.load(), preset.engine) if preset.robot else self._own
        before.stop_recording()
        self._keep()
        strategy, seed = before.settings.strategy, before.settings.seed
        self._preset, self._challenge = name, None
        self._at_server(self._clear)
        self._compile(robot, engine)
        self._session = Session(robot, engine, seed=seed, strategy=strategy)
        self._session.box = before.box
        self.seen, self._body = self._session.seen(), _body(robot, engine)
        self._at_server(self._furnish)
        if engine != before.engine:
            self._beside.close()
            self._beside = Beside(engine)
        for wish in read(preset.settings, self._session.sliders)[0]:
            self.wish(wish)
        self._ask()

    def _clear(self) -> None:
        self._server.gui.reset()
        self._server.scene.reset()

    def _query(self) -> str:
        """Part of an address that leads to the present settings."""
        file = Settings(self._session.file, 1.0, "", SPEED, False, 0, False)
        return query(self._session.settings, file, self._session.sliders, self._preset)

    def _open_address(self, asked: str, by_hand: bool) -> None:
        """Grant what an address asks for; not if another web site led there."""
        if not by_hand:
            told, _ = read(asked, self._session.sliders)
            if told:
                self._at_server(partial(self._notify, "Another page led here: press Enter in the address to apply it."))
            return
        preset = preset_of(asked)
        if preset is not None and preset != self._preset:
            self._choose(preset)
        told, wrong = read(asked, self._session.sliders)
        for wish in told:
            self.wish(wish)
        if wrong:
            self._at_server(partial(self._notify, wrong))

    def _begin_challenge(self, name: str) -> None:
        kind = CHALLENGES.get(name)
        self._challenge = kind() if kind else None
        first = self._challenge.begin(self.seen) if self._challenge else wishes.Target(None)
        if first is not None:
            self.wish(first)

    def _answer(self, given: str) -> None:
        if self._challenge:
            self._challenge.answer(given, self.seen, self._theory)

    def _picture(self) -> bytes:
        """Picture of the walk for a browser without WebGL; settings of its address hold from the next one on."""
        self._looked = time.perf_counter()
        asked, by_hand = self.gate.asked()
        if asked:
            self._errand(partial(self._open_address, asked, by_hand))
        seen = self.seen
        return from_above(self._body.places(seen), seen.robot.body.length, self._words(math.inf))

    # -- recordings

    def _recorder(self, client: viser.ClientHandle | None) -> None:
        self._wants_record = client

    def _keep(self) -> None:
        for record in self._session.records():
            self._recordings += 1
            name = f"chilopod-live-{self._recordings}"
            self._handing_out = [each for each in self._handing_out if not each.done()]
            self._handing_out.append(self._drawing.submit(self._hand_out, name, record, self._wants_record))

    def _hand_out(self, name: str, record: xr.Dataset, to: viser.ClientHandle | None) -> None:
        from chilopod.show import replay

        content = netcdf(record)
        page = replay(record, titles=["the robot"], heading="A walk recorded at the live page").html
        if self._kept is not None:
            try:
                self._kept(name, content, page)
            except ChilopodError as error:
                self._at_server(partial(self._notify, str(error)))
        elif self._over.is_set() or not self._server.get_clients():
            self.undelivered.append((name, content, page))
        self._at_server(partial(self._send, name, content, page, to))

    def _send(self, name: str, content: bytes, page: str, to: viser.ClientHandle | None) -> None:
        clients = self._server.get_clients()
        if to is not None and to.client_id in clients:
            clients = {to.client_id: to}
        for client in clients.values():
            client.send_file_download(f"{name}.nc", content, save_immediately=True)
            client.send_file_download(f"{name}.html", page.encode(), save_immediately=True)

    async def _greet(self, client: viser.ClientHandle) -> None:
        """Fit the picture into a browser's window, obey its address, and give it what waits for one."""
        self._view.fit(client.camera)
        asked, by_hand = self.gate.asked()
        if asked:
            self._errand(partial(self._open_address, asked, by_hand))
        await self._send_undelivered(client)

    async def _send_undelivered(self, client: viser.ClientHandle) -> None:
        """Give a browser the recordings that ended while none was connected."""
        while self.undelivered and not self._over.is_set():
            self._send(*self.undelivered.pop(0), client)

    # -- what browsers do in the picture; these only leave wishes

    def _follow(self, follow: bool) -> None:
        self._view.follow = follow

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        place = floor_place(self._view.origin, event.ray_origin, event.ray_direction)
        if place is not None:
            self._session.box.put(wishes.Target(place))

    async def _dragged(self, event: Any) -> None:
        if event.instance_index is None:
            return
        pin = self._view.pins.batched_wxyzs[event.instance_index]
        angle = 2.0 * math.atan2(float(pin[3]), float(pin[0]))  # a pin stands upright
        left = -math.sin(angle), math.cos(angle)
        way = [end - start for start, end in zip(event.start_position, event.end_position, strict=True)]
        aside = left[0] * way[0] + left[1] * way[1]
        self._controls.drag(event.instance_index, aside, event.phase == "end")


class _Rate:
    """Seconds walked in a second of the clock, lately."""

    def __init__(self) -> None:
        self.value = 0.0
        self._since: tuple[float, float] | None = None

    def add(self, now: float, walked: float) -> None:
        if self._since is None or walked < self._since[1]:
            self._since = now, walked
        elif now - self._since[0] > 1.0:
            self.value = (walked - self._since[1]) / (now - self._since[0])
            self._since = now, walked


def _body(robot: Robot, engine: str) -> Body:
    if not engine_named(engine).traits.poses or robot.twin is None:
        return FlatBody()
    from chilopod.live.body_3d import SolidBody

    return SolidBody(robot)


def _quiet() -> contextlib.AbstractContextManager[object]:
    """Silence of viser, which would print where it listens and that it ends."""
    return contextlib.redirect_stdout(io.StringIO())
