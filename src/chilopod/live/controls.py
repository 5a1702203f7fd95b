"""Controls of the page: what can be dragged, pressed and typed. Each leaves a wish and does nothing itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
import viser

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT, stiffness
from chilopod.live import wishes
from chilopod.live.session import Session
from chilopod.live.state import FRICTIONS, SPEEDS, STRIDES, Seen, Settings
from chilopod.steering import ON_THE_WAY
from chilopod.steering.target import FARTHEST

_SOFTEST, _STIFFEST = 0.05, 1.5  # of the stiffest spring of the file
_FACTOR = 1.1  # of a value, at a key
_PULL = 0.5  # rad by which a key or button pulls a joint, held by its spring
_A_LENGTH = 2.0  # rad of pull where a joint is dragged aside by the length of a module
_TURN = 15.0  # deg of bearing, at a key
_CM = 100.0

_KEYS: Final = (
    ("Z, X", "first spring softer, stiffer"),
    ("shift Z, X", "all springs softer, stiffer"),
    ("F, G", "floor less, more slippery; with shift: steps shorter, longer"),
    ("space, N", "pause or go on; one gait cycle"),
    ("page up, page down", "faster, slower"),
    ("R", "begin anew with the next seed"),
    ("B, V", "turn the target's bearing left, right"),
    ("T, L", "go to the target; let go of it"),
    ("Y", "next strategy"),
    ("1 to 9, J, K", "choose a joint; pull it left, right for half a second"),
    ("C", "begin or end a recording"),
    ("M", "follow the robot, or not"),
    ("H", "this help"),
)
HELP = "| key | |\n|---|---|\n" + "\n".join(f"| {key} | {what} |" for key, what in _KEYS)


class Controls:
    """The controls of a page.

    Parameters
    ----------
    server
        Server of the page.
    session
        Session that takes the wishes; nothing else of it is changed.
    title
        Name of the robot.
    on_follow
        Called with whether the picture is to follow the robot.
    on_record
        Called with the browser that wants a recording to begin or end.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        title: str,
        on_follow: Callable[[bool], None],
        on_record: Callable[[viser.ClientHandle | None], None],
    ) -> None:
        self._server, self._put, self._settings = server, session.box.put, session.settings
        self._file, self._on_record = session.file, on_record
        self._seen: Seen = session.seen()
        self._helped: WeakKeyDictionary[viser.ClientHandle, Any] = WeakKeyDictionary()
        gui = server.gui
        gui.add_markdown(
            f"**{title}**\n\nDrag the **first spring** below the pitchfork and watch it bend. **Click the floor**: it "
            "goes there. **Drag a joint** (orange). Press **H** for keys."
        )
        self.words = gui.add_markdown("")
        self._springs(gui)
        self._walking(gui)
        self._targets(gui)
        self._joints(gui)
        self._recording(gui, on_follow)
        self._keys(gui)

    def reflect(self, settings: Settings, seen: Seen) -> None:
        """Let the controls show how everything is set, where a wish was refused or the walk itself changed it."""
        before, self._settings, self._seen = self._settings, settings, seen
        if settings == before:
            return
        self._pause.label = "Go on (space)" if settings.paused else "Pause (space)"
        self._record.label = "End the recording (C)" if settings.recording else "Record (C)"
        self._seed.value = settings.seed

    def put_back(self, now: Settings) -> None:
        """Let everything that can be set show how it is set, where a wish was refused or came from elsewhere.

        What a browser sets is not set again for it as a rule: a slider that is being dragged would jump back.
        """
        for joint, slider in enumerate(self._each):
            slider.value = units.from_si(now.robot.springs.stiffness[joint], PAPER_UNIT)
        self._friction.value, self._stride.value = now.friction, now.stride * _CM
        self._speed.value, self._seed.value, self._strategy.value = now.speed, now.seed, now.strategy

    def fail(self, why: str) -> None:
        """Say that nothing goes on here."""
        self.words.content = f"**This page has failed**: {why}"

    # -- parts of the panel
    # ---------------------------------------------------------------------------------------------------------------

    def _springs(self, gui: viser.GuiApi) -> None:
        own = self._file.springs
        values = [units.from_si(each, PAPER_UNIT) for each in own.stiffness]
        low = _SOFTEST * max(values) if own.softest is None else units.from_si(min(own.softest), PAPER_UNIT)
        high = _STIFFEST * max(values) if own.stiffest is None else units.from_si(max(own.stiffest), PAPER_UNIT)
        step = float(f"{(high - low) / 400.0:.1g}")

        def spring(name: str, value: float, joint: int | None, hint: str) -> Any:
            slider = gui.add_slider(name, round(low, 6), round(high, 6), step, value, hint=hint)
            slider.on_update(lambda _: self._put(wishes.Spring(joint, stiffness(slider.value))))
            return slider

        first = spring("first spring", values[0], 0, "Of the joint behind module 1, the paper's k1, N·mm/deg.")
        self._all: Any = gui.add_slider(
            "all springs", round(low, 6), round(high, 6), step, float(np.mean(values)), hint="All alike, N·mm/deg."
        )
        with gui.add_folder("Each spring (N·mm/deg)", expand_by_default=False):
            rest = [
                spring(f"spring {joint + 1}", value, joint, f"Of the joint behind module {joint + 1}.")
                for joint, value in enumerate(values)
                if joint > 0
            ]
        self._each = [first, *rest]

        @self._all.on_update
        async def _(_: Any) -> None:
            for slider in self._each:
                slider.value = self._all.value

    def _walking(self, gui: viser.GuiApi) -> None:
        own = self._file.gait.stride * _CM
        self._friction: Any = gui.add_slider(
            "friction", *FRICTIONS, 0.05, 1.0, hint="Of the floor, times what the robot file has."
        )
        self._friction.on_update(lambda _: self._put(wishes.Friction(self._friction.value)))
        low, high = (round(part * own, 6) for part in STRIDES)
        self._stride: Any = gui.add_slider("stride", low, high, round(own / 60.0, 6), own, hint="Of every step, cm.")
        self._stride.on_update(lambda _: self._put(wishes.Stride(self._stride.value / _CM)))
        self._speed: Any = gui.add_slider("speed", *SPEEDS, 0.5, self._settings.speed, hint="Times real time.")
        self._speed.on_update(lambda _: self._put(wishes.Speed(self._speed.value)))
        self._pause = gui.add_button("Pause (space)")
        self._pause.on_click(lambda _: self._toggle_pause())
        gui.add_button("One gait cycle (N)").on_click(lambda _: self._put(wishes.Step(1.0)))
        self._seed: Any = gui.add_number(
            "seed", self._settings.seed, min=0, max=wishes.LARGEST_SEED, step=1, hint="Of the start and of the nudges."
        )
        gui.add_button("Begin anew (R)").on_click(lambda _: self._put(wishes.Reset(self._seed.value)))

    def _targets(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Target", expand_by_default=False):
            self._strategy: Any = gui.add_dropdown(
                "strategy",
                list(ON_THE_WAY),
                initial_value=self._settings.strategy,
                hint="How it goes there.",
            )
            self._strategy.on_update(lambda _: self._put(wishes.Steering(self._strategy.value)))
            self._bearing: Any = gui.add_number(
                "bearing", 45.0, min=-360.0, max=360.0, step=5.0, hint="From where it heads, left positive, deg."
            )
            self._distance = gui.add_number("distance", 1.3, min=0.0, max=FARTHEST, step=0.1, hint="From module 1, m.")
            gui.add_button("Go there (T)").on_click(lambda _: self._go())
            gui.add_button("Let go (L)").on_click(lambda _: self._put(wishes.Target(None)))

    def _joints(self, gui: viser.GuiApi) -> None:
        joints = [str(joint + 1) for joint in range(len(self._each))]
        with gui.add_folder("Pull a joint", expand_by_default=False):
            self._joint: Any = gui.add_dropdown("joint", joints, initial_value="1")
            for name, way in (("Left (J)", 1.0), ("Right (K)", -1.0)):
                gui.add_button(name).on_click(partial(self._pull, way))

    def _recording(self, gui: viser.GuiApi, on_follow: Callable[[bool], None]) -> None:
        self._record = gui.add_button("Record (C)", hint="As netCDF, and as a page that plays it.")
        self._record.on_click(lambda event: self._toggle_record(event.client))
        self._follow: Any = gui.add_checkbox("follow the robot (M)", True)
        self._follow.on_update(lambda _: on_follow(self._follow.value))

    def _keys(self, gui: viser.GuiApi) -> None:
        def key(label: str, hotkey: Any, do: Callable[..., object], *to: object, shift: bool = False) -> None:
            command = gui.add_command(label, hotkey=hotkey, modifier="shift" if shift else None)
            command.on_trigger(partial(_do, do, *to))

        for hotkey, factor, how in (("Z", 1.0 / _FACTOR, "softer"), ("X", _FACTOR, "stiffer")):
            key(f"First spring {how}", hotkey, _scale, self._each[0], factor)
            key(f"All springs {how}", hotkey, _scale, self._all, factor, shift=True)
        for hotkey, factor, floor, steps in (("F", 1.0 / _FACTOR, "more", "Shorter"), ("G", _FACTOR, "less", "Longer")):
            key(f"Floor {floor} slippery", hotkey, _scale, self._friction, factor)
            key(f"{steps} steps", hotkey, _scale, self._stride, factor, shift=True)
        key("Pause, or go on", "space", self._toggle_pause)
        key("One gait cycle", "N", self._put, wishes.Step(1.0))
        key("Faster", "pageup", _scale, self._speed, 2.0)
        key("Slower", "pagedown", _scale, self._speed, 0.5)
        key("Begin anew with the next seed", "R", self._next_seed)
        key("Target further left", "B", self._turn, _TURN)
        key("Target further right", "V", self._turn, -_TURN)
        key("Go to the target", "T", self._go)
        key("Let go of the target", "L", self._put, wishes.Target(None))
        key("Next strategy", "Y", self._next_strategy)
        for joint in range(min(9, len(self._each))):
            key(f"Joint {joint + 1}", str(joint + 1), setattr, self._joint, "value", str(joint + 1))
        key("Pull the joint left", "J", self._pull, 1.0)
        key("Pull the joint right", "K", self._pull, -1.0)
        key("Follow the robot, or not", "M", self._toggle_follow)
        gui.add_command("Record", hotkey="C").on_trigger(lambda event: self._toggle_record(event.client))
        gui.add_command("Help", hotkey="H").on_trigger(self._help)

    # -- what they do
    # ---------------------------------------------------------------------------------------------------------------

    def drag(self, joint: int, aside: float, ended: bool) -> None:
        """Pull a joint that is dragged aside, m to the left, until it is let go."""
        share = 0.0 if ended else _A_LENGTH * aside / self._file.module_length
        self._put(wishes.Pull(joint, share * self._file.springs.stiffness[joint]))

    def _pull(self, way: float, _: object = None) -> None:
        joint = int(self._joint.value) - 1
        self._put(wishes.Pull(joint, way * _PULL * self._file.springs.stiffness[joint], self._file.gait.period))

    def _toggle_pause(self) -> None:
        self._put(wishes.Pause(not self._settings.paused))

    def _toggle_follow(self) -> None:
        self._follow.value = not self._follow.value

    def _next_seed(self) -> None:
        self._put(wishes.Reset((self._settings.seed + 1) % (wishes.LARGEST_SEED + 1)))

    def _turn(self, angle: float) -> None:
        self._bearing.value = (self._bearing.value + angle + 180.0) % 360.0 - 180.0

    def _go(self) -> None:
        x, y, heading = self._seen.pose
        way, distance = heading + math.radians(self._bearing.value), self._distance.value
        self._put(wishes.Target((float(x + distance * np.cos(way)), float(y + distance * np.sin(way)))))

    def _next_strategy(self) -> None:
        names = list(self._strategy.options)
        self._strategy.value = names[(names.index(self._strategy.value) + 1) % len(names)]

    async def _help(self, event: viser.CommandEvent) -> None:
        """Show the keys to the browser that asked, or hide them; Escape does not reach viser's windows."""
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

    def _toggle_record(self, client: viser.ClientHandle | None) -> None:
        self._on_record(client)
        self._put(wishes.Record(not self._settings.recording))


async def _do(do: Callable[..., object], *to: object) -> None:
    """Action of a key; by the thread of the server, as no other may change what browsers show."""
    do(*to[:-1])  # the last is the event of the key


def _scale(slider: Any, factor: float) -> None:
    slider.value = float(np.clip(slider.value * factor, slider.min, slider.max))
