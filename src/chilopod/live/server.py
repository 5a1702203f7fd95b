"""The page: a server for browsers, the one thread that owns the walk, and the process that computes beside it."""

from __future__ import annotations

import contextlib
import io
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from chilopod.analysis.parameters import ALL, K1
from chilopod.engine import Status, engine_named
from chilopod.errors import in_words
from chilopod.extras import needs
from chilopod.live import wishes
from chilopod.live.body import Placed, flat_places
from chilopod.live.challenges import CHALLENGES, Challenge
from chilopod.live.ports import free_port
from chilopod.live.presets import OWN, PRESETS, preset_of, query, read
from chilopod.live.session import Session
from chilopod.live.state import Seen, but_springs
from chilopod.live.theory import Beside, Growth, Theory
from chilopod.live.words import sentences
from chilopod.robot import Robot

needs("viser", extra="live")

import viser  # noqa: E402  (there, as has just been seen)

from chilopod.live.controls import Controls  # noqa: E402
from chilopod.live.gate import Gate, at_server, notify  # noqa: E402
from chilopod.live.plots import from_above  # noqa: E402
from chilopod.live.recordings import Recordings  # noqa: E402
from chilopod.live.scene import View, floor_place  # noqa: E402

_FRAME = 1.0 / 25.0  # s; with more, a browser without a graphics card falls behind, and answers later
_SOONEST = 0.01  # s from one frame to the next that a wish brings on
_BEHIND = 0.1  # s that may be made up for
_PLOTS = 0.25  # s from one drawing of the plots and sentences to the next
_LOOKS_AGAIN = 2.0  # s after a picture in which a browser without WebGL asks for the next one
_LATELY = 25  # frames over which the present speed of the walk is measured
_PANEL = 340  # px
_ALONE = 0.1  # s from one look to the next while no browser watches


class Live:
    """A page with a walking robot, which stands still while no browser watches.

    The robot is that of a :class:`chilopod.live.Session`. The page listens at a host and a port, 0 for any port that is
    free; at other addresses than this machine's own a browser needs the token in ``address``, the link to open, and
    with ``token`` on this machine too. ``kept`` is a function of the name of a recording and its two files, netCDF and
    HTML, besides the download in the browser; its errors are shown at the page.

    ``gate`` has checks that count what they refused, and ``undelivered`` names and files of recordings that neither
    ``kept`` nor a browser took. ``seen`` is the last frame, ``frames`` the number of frames that were shown, ``busy``
    the time for which the walk's thread worked, s, and ``failure`` the error that ended it, if one did.

    Raises ParameterError if the port is in use or there is no such address, or the engine cannot walk such a robot;
    ExtraError if viser is not installed.
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
        self.session = Session(robot, engine, seed=seed, strategy=strategy)
        self.seen, self._places = self.session.seen(), _places(robot, engine)
        self.preset, self._own = OWN, (robot, engine)
        self._theory = Theory()
        self._growth: Growth | None = None
        self._challenge: Challenge | None = None
        self._errands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._looked = -math.inf  # time of the last picture for a browser without WebGL
        self.frames, self.busy, self._wished = 0, 0.0, False
        self._over, self._ended = threading.Event(), threading.Event()
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="chilopod walk", daemon=True)
        self.gate = Gate(host, token)
        free = free_port(host, port)
        with _quiet():
            self.server = self.gate.open(free)
        self.recordings = Recordings(self.server, kept)
        self.undelivered = self.recordings.undelivered
        self._beside = Beside(engine)
        try:
            self.server.gui.configure_theme(show_share_button=False, show_logo=False)
            self.server.gui.set_panel_label("chilopod live")
            self.gate.pictures = self._picture
            self.address = self.gate.link(self.server.get_port())
            self.listens()
            self._compile(robot, engine)
            self._furnish()
            self.server.scene.on_click()(self._clicked)
            self.server.on_client_connect(self._greet)  # also those who came while it compiled
        except BaseException:
            self.close()
            raise
        self._thread.start()

    def listens(self) -> None:
        """Called when the page answers at its address, before the first walk is compiled; does nothing here."""

    def _compile(self, robot: Robot, engine: str) -> None:
        """Walk the first steps ever, which are compiled, before anybody wants to see them; and say so."""
        note = self.server.gui.add_markdown(f"**Compiling** {robot.name}, once on this machine: up to half a minute.")
        Session(robot, engine).walk_on(1.5 * robot.gait.period)
        note.remove()

    def _furnish(self) -> None:
        """Everything of a page that is made for its robot."""
        server, robot = self.server, self.seen.robot
        self.view = View(server, self._places(self.seen), self.session.file)
        title = f"{robot.name}, {robot.body.modules} modules, {self.session.engine}"
        later = [partial(self.errand, do) for do in (self.choose, self.begin_challenge, self.answer)]
        self._controls = Controls(server, self.session, title, self.view, self.recordings, later, self.preset)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(_PANEL)
        for client in server.get_clients().values():
            self.view.fit(client.camera)
        self.view.pins.on_drag("left")(self._controls.drag)

    def wish(self, wish: wishes.Wish) -> None:
        """Leave a wish, from any thread, as the page does; a ParameterError if a slider cannot be set so."""
        if isinstance(wish, wishes.Set):
            self.session.checked(wish)
        self.session.box.put(wish)
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
        self.recordings.over = True
        try:
            if self._thread.ident is not None:
                self.session.box.wake()
                self._ended.wait()
                self.session.stop_recording()
                self._keep()
        finally:
            self.recordings.close()
            self._beside.close()
            with _quiet():
                self.server.stop()

    def errand(self, do: Callable[[str], None], word: str) -> None:
        """Leave a word for a function that the thread of the walk calls."""
        self._errands.put(partial(do, word))
        self.session.box.wake()

    # -- the thread of the walk

    def _run(self) -> None:
        try:
            self._walk()
        except BaseException as error:
            self.failure = error
            at_server(self.server, partial(self._controls.fail, in_words(error)))
        finally:
            self._ended.set()

    def _walk(self) -> None:
        last, plotted = time.perf_counter(), -math.inf
        lately: deque[tuple[float, float]] = deque(maxlen=_LATELY)  # times of the clock and of the walk
        self._ask()
        while not self._over.wait(max(0.0, last + _SOONEST - time.perf_counter())):
            self.session.box.wait(max(0.0, last + _FRAME - time.perf_counter()))
            now = time.perf_counter()
            passed, last = min(now - last, _BEHIND), now
            watched = bool(self.server.get_clients()) or now - self._looked < _LOOKS_AGAIN
            while not self._errands.empty():
                self._errands.get()()
            session = self.session
            if self._obey():
                plotted = -math.inf
            settings = session.settings
            if watched and not settings.paused:
                session.walk_on(passed * settings.speed)
            seen = self.seen = session.seen()
            if lately and seen.time < lately[-1][1]:
                lately.clear()
            lately.append((now, seen.time))
            then, before = lately[0]
            rate = (seen.time - before) / (now - then) if len(lately) == _LATELY else math.inf
            if self._challenge:
                self._challenge.look(seen)
            self._controls.plots.add(seen)
            at_server(self.server, partial(self._show, self._places(seen), now - plotted > _PLOTS, rate))
            if now - plotted > _PLOTS:
                plotted = now
            self.frames += watched
            self._keep()
            self.busy += time.perf_counter() - now
            if not watched:
                self._over.wait(_ALONE)

    def _show(self, placed: Mapping[str, Placed], all_of_it: bool, rate: float) -> None:
        """A frame, whose parts appear at once; not in every one of them text and curves."""
        with self.server.atomic():
            self.view.show(placed, self.seen)
            self._controls.reflect(self.session.settings, self.seen)
            if all_of_it:
                self._controls.words.content = self._words(rate)
                self._controls.plots.show()
                self._controls.pitchfork.show(self.seen, self._shown())
                self._controls.show_challenge(self._challenge)
                self._controls.show_link(f"{self.address.partition('/?')[0]}/?{self._query()}")

    def _obey(self) -> bool:
        """Grant wishes and take answers; True if there was a wish."""
        session, before = self.session, self.session.settings
        wished, self._wished = self._wished, False
        obeyed = session.obey()
        if obeyed:
            if session.settings.robot != before.robot:
                self._ask(before.robot)
            if session.seen().time < self.seen.time:
                for each in (self.view, self._controls.plots, self._controls.pitchfork):
                    each.forget()
        messages = session.messages()
        for sentence in messages:
            notify(self.server, sentence)
        if messages or wished:
            at_server(self.server, partial(self._controls.put_back, session.settings))
        for answer in self._beside.answers():
            if isinstance(answer, Theory):
                self._theory = answer
                session.law = answer.law
            else:
                self._growth = answer
        return obeyed

    def _ask(self, before: Robot | None = None) -> None:
        """Ask for the unknown theory of the present robot."""
        robot = self.session.settings.robot
        if engine_named(self.session.engine).traits.exact:
            self._beside.ask(robot)
        # The theory is of any first spring.
        parts = [(each.springs.stiffness[1:], *but_springs(each)) for each in (robot, before) if each is not None]
        if before is None or parts[0] != parts[1]:
            self._theory = Theory(remark="computing the pitchfork", computing=True)
            self.session.law = None
            self._beside.ask(robot, self.session.sliders[K1].limits)

    def _shown(self) -> Theory:
        """Theory as far as a challenge allows."""
        hidden = self._challenge is not None and self._challenge.hides and not self._challenge.done
        return Theory(remark="hidden until you have found it", computing=True) if hidden else self._theory

    def _words(self, rate: float) -> str:
        session, seen, shown = self.session, self.seen, self._shown()
        words = sentences(seen, session.settings, shown, self._growth if shown is self._theory else None)
        settings = session.settings
        slow = rate < 0.8 * settings.speed and not settings.paused and seen.status is Status.WALKED
        paced = f", as fast as it goes: {rate:.1f} times" if slow else ""
        recording = ", recording" if settings.recording else ""
        return f"{' '.join(words)}\n\n{seen.time:.0f} s, seed {settings.seed}{paced}{recording}"

    # -- presets, challenges and addresses, in the thread of the walk

    def choose(self, name: str) -> None:
        """Another robot, or the same with the settings of a preset; the page is made anew for it."""
        preset, before = PRESETS[name], self.session
        robot, engine = (preset.load(), preset.engine) if preset.robot else self._own
        before.stop_recording()
        self._keep()
        self.preset, self._challenge = name, None
        for part in (self.server.gui, self.server.scene):
            at_server(self.server, part.reset)
        self._compile(robot, engine)
        self.session = Session(robot, engine, seed=before.settings.seed, strategy=before.first.strategy)
        self.session.settings = replace(self.session.settings, strategy=before.settings.strategy)
        self.session.box = before.box
        self.seen, self._places = self.session.seen(), _places(robot, engine)
        at_server(self.server, self._furnish)
        if engine != before.engine:
            self._beside.close()
            self._beside = Beside(engine)
        for wish in read(preset.settings, self.session.sliders)[0]:
            self.wish(wish)
        self._ask()

    def begin_challenge(self, name: str) -> None:
        """Begin a challenge, or none of this name."""
        kind = CHALLENGES.get(name)
        self._challenge = kind() if kind else None
        first = self._challenge.begin(self.seen) if self._challenge else wishes.Target(None)
        if first is not None:
            self.wish(first)

    def answer(self, given: str) -> None:
        """Judge an answer to the challenge."""
        if self._challenge:
            self._challenge.answer(given, self.seen, self._theory)

    def _query(self) -> str:
        """Part of an address that leads to the present settings."""
        return query(self.session.settings, self.session.first, self.session.sliders, self.preset)

    def _open_address(self, by_hand: bool, asked: str) -> None:
        """Grant what an address asks for; not if another web site led there."""
        if not by_hand:
            if read(asked, self.session.sliders)[0]:
                notify(self.server, "Another page led here: press Enter in the address to apply it.", None)
            return
        preset = preset_of(asked)
        if preset is not None and preset != self.preset:
            self.choose(preset)
        session, (told, wrong) = self.session, read(asked, self.session.sliders)
        if told or preset is not None:  # what an address leaves out is as in the file and its preset
            rows = (row for row in session.sliders.values() if row.name != ALL)
            file = [wishes.Set(row.name, row.read(session.first)) for row in rows]
            steering = wishes.Steering(session.first.strategy)
            told = [*file, steering, *read(PRESETS[self.preset].settings, session.sliders)[0], *told]
        for wish in told:
            self.wish(wish)
        if wrong:
            notify(self.server, wrong, None)

    def _take_address(self) -> None:
        """Open the address of a page that has just been loaded."""
        asked, by_hand = self.gate.asked()
        if asked:
            self.errand(partial(self._open_address, by_hand), asked)

    def _keep(self) -> None:
        for record in self.session.records():
            self.recordings.add(record)

    # -- what browsers do

    def _picture(self) -> bytes:
        """Picture of the walk for a browser without WebGL; settings of its address hold from the next one on."""
        self._looked = time.perf_counter()
        self._take_address()
        return from_above(self._places(self.seen), self.seen.robot.body.length, self._words(math.inf))

    async def _greet(self, client: viser.ClientHandle) -> None:
        """Fit the picture into a browser's window, obey its address, and give it what waits for one."""
        self.view.fit(client.camera)
        self._take_address()
        await self.recordings.greet(client)

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        place = floor_place(self.view.origin, event.ray_origin, event.ray_direction)
        if place is not None:
            self.session.box.put(wishes.Target(place))


def _places(robot: Robot, engine: str) -> Callable[[Seen], Mapping[str, Placed]]:
    """Function that has the positions of a robot's parts, by kind."""
    if not engine_named(engine).traits.poses or robot.twin is None:
        return flat_places
    from chilopod.live.body_3d import SolidBody

    return SolidBody(robot).places


def _quiet() -> contextlib.AbstractContextManager[object]:
    """Silence of viser, which would print where it listens and that it ends."""
    return contextlib.redirect_stdout(io.StringIO())
