"""Presets of the page, and the settings that an address such as ``?k1=8&seed=2`` can name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import parse_qsl, urlencode

from chilopod.analysis.map_axes import with_modules
from chilopod.analysis.parameters import ALL
from chilopod.errors import ParameterError, nearest_name
from chilopod.live import wishes
from chilopod.live.sliders import Slider
from chilopod.live.state import Settings, as_seed, as_within
from chilopod.robot import Robot, load_robot
from chilopod.steering import ON_THE_WAY, strategy_named

_OTHERS: Final = ("token", "darkMode")  # parts of an address that are no settings
_MOST, _LONGEST, _SAID = 60, 40, 5  # parts of an address, characters of a name or value, mistakes named


@dataclass(frozen=True)
class Preset:
    """A robot of the page with settings as an address has them."""

    name: str
    robot: str = ""  #: one of the presets of robot files, empty for the robot of the page
    engine: str = "planar"
    modules: int = 0  #: number of modules of the same size, 0 for that of the file
    settings: str = ""

    def load(self) -> Robot:
        """The robot."""
        robot = load_robot(self.robot)
        return with_modules(robot, self.modules) if self.modules else robot


OWN: Final = "as started"
PRESETS: Final = {
    preset.name: preset
    for preset in (
        Preset(OWN),
        Preset("paper, planar", "aoi2022-planar"),
        Preset("paper, whole robot", "aoi2022", "twin"),
        Preset("ten modules", "aoi2022-planar", modules=10),
        Preset("slippery floor", "aoi2022-planar", settings="friction=0.4"),
        Preset("uniform soft springs", "aoi2022-planar", settings="k=6"),
    )
}


def query(settings: Settings, file: Settings, sliders: Mapping[str, Slider], preset: str) -> str:
    """Part of an address that leads to the present settings from those of the file."""
    changed = (row for row in sliders.values() if row.name != ALL and row.read(settings) != row.read(file))
    parts = {row.key: f"{row.at_page(row.read(settings)):g}" for row in changed}
    steering = {} if settings.strategy == file.strategy else {"strategy": settings.strategy}
    return urlencode({**({} if preset == OWN else {"robot": preset}), **parts, "seed": settings.seed, **steering})


def preset_of(asked: str) -> str | None:
    """Name of the preset in an address, None without one or for one that is not there."""
    name = dict(_pairs(asked)).get("robot")
    return name if name in PRESETS else None


def read(asked: str, sliders: Mapping[str, Slider]) -> tuple[list[wishes.Wish], str]:
    """Wishes of an address, and a line on what in it is no setting or out of range, else an empty one."""
    found, wrong, keys = dict[str, wishes.Wish](), list[str](), {row.key: row for row in sliders.values()}
    allowed = (*keys, "seed", "strategy", "robot")
    known: str | None = ", ".join(allowed)
    for key, text in _pairs(asked):
        try:
            if key in keys:
                found[key] = _set(keys[key], text)
            elif key == "seed":
                found[key] = wishes.Reset(as_seed(_number(key, text)))
            elif key == "strategy":
                found[key] = wishes.Steering(strategy_named(text, ON_THE_WAY).name)
            elif key == "robot" and text not in PRESETS:
                raise ParameterError("must be a preset", field=key, value=text, allowed=", ".join(map(repr, PRESETS)))
            elif key != "robot" and key not in _OTHERS:
                near, told, known = nearest_name(key, allowed), known, None  # the list is said once
                raise ParameterError("must be a setting", field=key, value=text, allowed=told, nearest=near)
        except ParameterError as error:
            wrong.append(str(error))
    # The walk begins anew with everything else as it is asked for.
    asked_for = sorted(found.values(), key=lambda wish: isinstance(wish, wishes.Reset))
    more = [f"and {len(wrong) - _SAID} more"] if len(wrong) > _SAID else []
    return asked_for, f"In the address: {'; '.join([*wrong[:_SAID], *more])}" if wrong else ""


def _pairs(asked: str) -> list[tuple[str, str]]:
    try:
        return [(key[:_LONGEST], text[:_LONGEST]) for key, text in parse_qsl(asked, True, max_num_fields=_MOST)]
    except ValueError:
        return []


def _set(row: Slider, text: str) -> wishes.Set:
    low, high = map(row.at_page, row.limits)
    return wishes.Set(row.name, row.from_page(as_within(row.key, _number(row.key, text), (low, high), row.unit)))


def _number(key: str, text: str) -> float:
    try:
        number = float(text)
        return int(number) if number == int(number) else number
    except (ValueError, OverflowError):
        raise ParameterError("must be a number", field=key, value=text) from None
