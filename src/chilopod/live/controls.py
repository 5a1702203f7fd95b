"""Controls of the page: sliders, buttons and keys. Each only leaves a wish."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from functools import partial
from html import escape
from itertools import groupby, zip_longest
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
import viser

from chilopod.engine import Status
from chilopod.live import wishes
from chilopod.live.challenges import CHALLENGES, Challenge
from chilopod.live.plots import Pitchfork, Plots
from chilopod.live.presets import PRESETS
from chilopod.live.recordings import Recordings
from chilopod.live.scene import View
from chilopod.live.session import Session
from chilopod.live.sliders import Slider
from chilopod.live.state import Seen, Settings
from chilopod.steering import ON_THE_WAY
from chilopod.steering.target import FARTHEST

_PULL = 0.5  # rad by which a key or button pulls a joint, held by its spring
_A_LENGTH = 2.0  # rad of pull where a joint is dragged aside by the length of a module
_TURN = 15.0  # deg of bearing, at a key

_ANSWERS = 3  # buttons for answers to a challenge
_NO_CHALLENGE, _ONE_CYCLE, _ANEW = "none", "One cycle", "Begin anew"

_KEYS: Final = (
    ("Z, X", "first spring softer, stiffer"),
    ("shift Z, X", "all springs softer, stiffer"),
    ("F, G", "floor more, less slippery; with shift: steps shorter, longer"),
    ("space, N", "pause or go on; one gait cycle"),
    ("page up, page down", "faster, slower"),
    ("R", "begin anew with the next seed"),
    ("B, V", "turn the target's bearing left, right"),
    ("T, L", "go to the target; let go of it"),
    ("Y", "next strategy"),
    ("1 to 9, J, K", "choose a joint; pull it left, right for half a second"),
    ("C", "begin or end a recording"),
    ("M", "follow the robot, or not"),
    ("H, Esc", "this help; close it"),
)
HELP = "| key | effect |\n|---|---|\n" + "\n".join(f"| {key} | {what} |" for key, what in _KEYS)


class Controls:
    """Controls of a page with a title. ``later`` has what the page does, when it has time, with the name of another
    preset, the name of a challenge, and an answer to it."""

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        title: str,
        view: View,
        recordings: Recordings,
        later: Sequence[Callable[[str], None]],
        preset: str,
    ) -> None:
        self._put, self._settings, self._seen = session.box.put, session.settings, session.seen()
        self._file, self._rows, self._view, self._recordings = session.file, session.sliders, view, recordings
        choose, challenge, answer = later
        self._helped: WeakKeyDictionary[viser.ClientHandle, Any] = WeakKeyDictionary()
        self._moved = ""  # name of the slider that somebody moved last
        gui = server.gui
        gui.add_markdown(
            f"**{title}**. Soften the **first spring** until it bends, **click the floor**, **drag a joint** (purple). "
            "**H**: keys."
        )
        self.words = gui.add_markdown("")
        self._task = gui.add_markdown("", visible=False)
        self._answers: list[Any] = [gui.add_button("-", visible=False) for _ in range(_ANSWERS)]
        for button in self._answers:
            button.on_click(lambda event: answer(event.target.label))
        self.pitchfork = Pitchfork(gui, next(iter(self._rows.values())).limits[1])
        self._sliders: dict[str, Any] = {}
        for folder, rows in groupby(self._rows.values(), lambda row: row.folder):
            with gui.add_folder(folder, expand_by_default=False) if folder else nullcontext():
                for row in rows:
                    self._add_slider(gui, row)
        self._walking(gui)
        hint = "Robots and floors to choose"
        robots: Any = gui.add_dropdown("robot", list(PRESETS), initial_value=preset, hint=hint)
        robots.on_update(lambda _: choose(robots.value))
        names, hint = [_NO_CHALLENGE, *CHALLENGES], "A task, and a check of what you did"
        challenges: Any = gui.add_dropdown("challenge", names, initial_value=_NO_CHALLENGE, hint=hint)
        challenges.on_update(lambda _: challenge(challenges.value))
        self._targets(gui)
        self._joints(gui)
        self.plots = Plots(gui, self._file.body.modules - 1)
        self._recording(gui)
        self._link = gui.add_html("")
        self._keys(gui)

    def reflect(self, settings: Settings, seen: Seen) -> None:
        """Show the present settings after a wish or the walk itself has changed them.

        A slider that somebody drags is not sent its value back, because it would jump.
        """
        before, self._settings, self._seen = self._settings, settings, seen
        if settings == before:
            return
        changed = (row for row in self._rows.values() if row.read(settings) != row.read(before))
        self._show((row for row in changed if row.name != self._moved), settings)
        self._walks.options = _walking_options(settings.paused)
        self._record.label = "End the recording (C)" if settings.recording else "Record (C)"
        self._seed.value = settings.seed
        if settings.strategy != before.strategy:
            self._strategy.value = settings.strategy

    def put_back(self, now: Settings) -> None:
        """Show the present value of every control, after a wish was refused or came from elsewhere."""
        self._show(self._rows.values(), now)
        self._seed.value, self._strategy.value = now.seed, now.strategy

    def _show(self, rows: Iterable[Slider], now: Settings) -> None:
        for row in rows:
            self._sliders[row.name].value = row.at_page(row.read(now))

    def show_link(self, address: str) -> None:
        """Show the address that leads to the present settings."""
        text = escape(address, quote=True)
        content = f'<div class="chilopod-link">{text} <button type="button" data-copy="{text}">Copy</button></div>'
        if self._link.content != content:
            self._link.content = content

    def show_challenge(self, challenge: Challenge | None) -> None:
        """Show a challenge, what came of it so far, and its answers."""
        content = challenge.task if challenge else ""
        if challenge and challenge.said:
            content += f"\n\n**{challenge.said}**"
        if self._task.content != content:
            self._task.content, self._task.visible = content, bool(content)
        answers = challenge.answers if challenge and challenge.asks else ()
        for button, answer in zip_longest(self._answers, answers):
            if button.visible != bool(answer):
                button.label, button.visible = answer or button.label, bool(answer)

    def fail(self, why: str) -> None:
        """Say that nothing goes on here."""
        self.words.content = f"**This page has failed**: {why}"

    # -- parts of the panel

    def _add_slider(self, gui: viser.GuiApi, row: Slider) -> None:
        (low, high), value = map(row.at_page, row.limits), row.at_page(row.read(self._settings))
        slider: Any = gui.add_slider(row.label, low, high, row.step, value, hint=row.hint)
        # An update without a client comes from :meth:`_show`.
        slider.on_update(lambda event: self._wish(row) if event.client else None)
        self._sliders[row.name] = slider

    def _wish(self, row: Slider) -> None:
        """Leave the wish that goes with the present place of a slider."""
        self._moved = row.name
        self._put(wishes.Set(row.name, row.from_page(self._sliders[row.name].value)))

    def _walking(self, gui: viser.GuiApi) -> None:
        hint = "Keys: space, N, R (with the next seed)"
        self._walks: Any = gui.add_button_group("walk", _walking_options(self._settings.paused), hint=hint)
        self._walks.on_click(lambda _: self._walk(self._walks.value))
        hint, largest = "Seed of the start and of the nudges", wishes.LARGEST_SEED
        self._seed: Any = gui.add_number("seed", self._settings.seed, min=0, max=largest, step=1, hint=hint)

    def _targets(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Target", expand_by_default=False):
            names, hint = list(ON_THE_WAY), "Way of steering to the target"
            self._strategy: Any = gui.add_dropdown("strategy", names, initial_value=self._settings.strategy, hint=hint)
            self._strategy.on_update(lambda _: self._put(wishes.Steering(self._strategy.value)))
            hint = "Angle of the target from the heading, left positive, deg"
            self._bearing: Any = gui.add_number("bearing", 45.0, min=-360.0, max=360.0, step=5.0, hint=hint)
            hint = "Distance of the target from module 1, m"
            self._distance = gui.add_number("distance", 1.3, min=0.0, max=FARTHEST, step=0.1, hint=hint)
            gui.add_button("Go there (T)").on_click(lambda _: self._go())
            gui.add_button("Let go (L)").on_click(lambda _: self._put(wishes.Target(None)))

    def _joints(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Pull a joint", expand_by_default=False):
            joints = [str(joint) for joint in range(1, self._file.body.modules)]
            self._joint: Any = gui.add_dropdown("joint", joints, initial_value=joints[0])
            for name, way in (("Left (J)", 1.0), ("Right (K)", -1.0)):
                gui.add_button(name).on_click(partial(self._pull, way))

    def _recording(self, gui: viser.GuiApi) -> None:
        self._record = gui.add_button("Record (C)", hint="Recording as a netCDF file, and as a page that plays it")
        self._record.on_click(self._toggle_record)
        self._follow: Any = gui.add_checkbox("follow the robot (M)", True)
        self._follow.on_update(lambda _: setattr(self._view, "follow", self._follow.value))

    def _keys(self, gui: viser.GuiApi) -> None:
        def key(label: str, hotkey: Any, do: Callable[..., object], *to: object, shift: bool = False) -> None:
            command = gui.add_command(label, hotkey=hotkey, modifier="shift" if shift else None)
            command.on_trigger(partial(_do, do, *to))

        for row in self._rows.values():
            for (hotkey, label), factor in zip(row.keys, (1.0 / row.factor, row.factor), strict=False):
                key(label, hotkey, self._scale, row, factor, shift=row.shift)
        key("Pause, or go on", "space", self._walk, "")
        key("One gait cycle", "N", self._put, wishes.Step(1.0))
        key("Begin anew with the next seed", "R", self._next_seed)
        key("Target further left", "B", self._turn, _TURN)
        key("Target further right", "V", self._turn, -_TURN)
        key("Go to the target", "T", self._go)
        key("Let go of the target", "L", self._put, wishes.Target(None))
        key("Next strategy", "Y", self._next_strategy)
        for joint in self._joint.options[:9]:
            key(f"Joint {joint}", joint, setattr, self._joint, "value", joint)
        key("Pull the joint left", "J", self._pull, 1.0)
        key("Pull the joint right", "K", self._pull, -1.0)
        key("Follow the robot, or not", "M", lambda: setattr(self._follow, "value", not self._follow.value))
        gui.add_command("Record", hotkey="C").on_trigger(self._toggle_record)
        gui.add_command("Help", hotkey="H").on_trigger(self._help)

    # -- what they do

    async def drag(self, event: Any) -> None:
        """Pull a joint that is dragged aside until it is let go."""
        joint = event.instance_index
        if joint is None:
            return
        w, _, _, z = self._view.pins.batched_wxyzs[joint].tolist()  # a pin stands upright
        (x0, y0, _), (x1, y1, _) = event.start_position, event.end_position
        angle = 2.0 * math.atan2(z, w)
        aside = math.cos(angle) * (y1 - y0) - math.sin(angle) * (x1 - x0)
        share = 0.0 if event.phase == "end" else _A_LENGTH * aside / self._file.module_length
        self._put(wishes.Pull(joint, share * self._file.springs.stiffness[joint]))

    def _pull(self, way: float, _: object = None) -> None:
        joint = int(self._joint.value) - 1
        self._put(wishes.Pull(joint, way * _PULL * self._file.springs.stiffness[joint], self._file.gait.period))

    def _walk(self, what: str) -> None:
        if what == _ONE_CYCLE:
            self._put(wishes.Step(1.0))
        elif what == _ANEW:
            self._put(wishes.Reset(self._seed.value))
        else:
            self._put(wishes.Pause(not self._settings.paused))

    def _scale(self, row: Slider, factor: float) -> None:
        slider = self._sliders[row.name]
        slider.value = float(np.clip(slider.value * factor, slider.min, slider.max))
        self._wish(row)

    def _next_seed(self) -> None:
        self._put(wishes.Reset((self._settings.seed + 1) % (wishes.LARGEST_SEED + 1)))

    def _turn(self, angle: float) -> None:
        self._bearing.value = (self._bearing.value + angle + 180.0) % 360.0 - 180.0

    def _go(self) -> None:
        if self._seen.status is not Status.WALKED:  # it has no place; the page says what to press
            return
        x, y, heading = self._seen.pose
        way, distance = heading + math.radians(self._bearing.value), self._distance.value
        self._put(wishes.Target((float(x + distance * np.cos(way)), float(y + distance * np.sin(way)))))

    def _next_strategy(self) -> None:
        names = list(self._strategy.options)
        self._strategy.value = names[(names.index(self._strategy.value) + 1) % len(names)]

    async def _help(self, event: viser.CommandEvent) -> None:
        """Show the keys to the browser that asked, or hide them; the page's own script lets Escape press Close."""
        if event.client is None:
            return
        before = self._helped.pop(event.client, None)
        if before is not None and not before.closed:
            before.close()
            return
        gui = event.client.gui
        with gui.add_modal("Keys") as modal:
            gui.add_markdown(HELP)
            gui.add_button("Close").on_click(lambda _: None if modal.closed else modal.close())
        self._helped[event.client] = modal

    def _toggle_record(self, event: Any) -> None:
        self._recordings.wanted_by = event.client
        self._put(wishes.Record(not self._settings.recording))


def _walking_options(paused: bool) -> tuple[str, ...]:
    return "Go on" if paused else "Pause", _ONE_CYCLE, _ANEW


async def _do(do: Callable[..., object], *to: object) -> None:
    """Action of a key, in the server's thread, which alone may change the page."""
    do(*to[:-1])  # the last is the event of the key
