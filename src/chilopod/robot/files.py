"""Robot files as tables: search, safe reading and writing of TOML."""

from __future__ import annotations

import datetime
import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from chilopod.errors import ChilopodError, RobotFileError, nearest_name
from chilopod.text_file import read_text
from chilopod.units import Description

Described = TypeVar("Described", bound=Description)

_PRESETS: Final = Path(__file__).parent.parent / "robots"
_MOST_DOTS: Final = 200
_BETWEEN_KEYS: Final = re.compile(r"[\n=,\[\]{}]")
_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")


class Table(Mapping[str, Any]):
    """An immutable, hashable TOML table; lists within are tuples, tables within are Tables."""

    def __init__(self, items: Mapping[str, Any] | None = None) -> None:
        self._items = {str(key): _frozen(value) for key, value in (items or {}).items()}

    def __getitem__(self, key: str) -> Any:
        return self._items[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(frozenset(self._items.items()))

    def __repr__(self) -> str:
        return f"Table({self._items!r})"


def presets() -> list[str]:
    """Return the names of the robots that come with chilopod."""
    return sorted(path.stem for path in _PRESETS.glob("*.toml"))


def read_table(robot: str | Path) -> tuple[dict[str, Any], str]:
    """Read a robot file, or a preset by its name: the table of the file, not yet validated, and its name in messages.
    Write ``./name`` for a file with the name of a preset. RobotFileError if that is missing, or is not valid TOML."""
    if not isinstance(robot, str | Path):
        raise RobotFileError("must be a preset or the path of a robot file", field="robot", value=robot)
    source, path = str(robot), Path(robot)
    names = presets()
    if source in names:
        path = _PRESETS / f"{source}.toml"
    try:
        missing = not (source and path.exists())
    except OSError:
        missing = False  # reading it raises the reason
    if missing and (isinstance(robot, Path) or len(path.parts) > 1 or path.suffix):
        raise RobotFileError("no such file", source=source, nearest=nearest_name(source, names))
    if missing:
        allowed, nearest = f"a robot file or one of the presets {', '.join(names)}", nearest_name(source, names)
        raise RobotFileError("must be a preset or an existing file", value=source, allowed=allowed, nearest=nearest)
    return parsed(read_text(path, "robot file", RobotFileError), source), source


def described(cls: type[Described], table: Mapping[str, Any], source: str) -> Described:
    """Make a description of a table; RobotFileError names the source, the key and the fault of an invalid one."""
    try:
        return cls(**table)
    except ChilopodError as error:
        named = {name: getattr(error, name) for name in ("field", "value", "allowed", "nearest")}
        raise RobotFileError(error.problem, **named, source=source) from None
    except RecursionError:
        raise RobotFileError("is nested too deeply", source=source) from None


def parsed(text: str, source: str | None = None) -> dict[str, Any]:
    """Read TOML text from any source; RobotFileError if it is not valid, or would take very long to read."""
    # The time of Python's reader grows with the square of the number of parts of one key. Between two of
    # these characters there is a key at most, or part of a text; and no text of a robot is that long.
    dots = max(between.count(".") for between in _BETWEEN_KEYS.split(text))
    if dots > _MOST_DOTS:
        raise RobotFileError(f"has {dots} dots in a key or a text", allowed=f"up to {_MOST_DOTS}", source=source)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise RobotFileError("is nested too deeply", source=source) from None
    except ValueError as error:  # TOMLDecodeError, and integers of more digits than Python converts
        raise RobotFileError(f"is not valid TOML: {error}", source=source) from None


def to_toml(table: Mapping[str, Any]) -> str:
    """Write a table as TOML text that reads back to equal values; None values are left out."""
    return "\n".join(_lines(table, ())).strip() + "\n"


def _frozen(value: Any) -> Any:
    if isinstance(value, str):  # the most common, and whether it is a Mapping takes long to find out
        return value
    if isinstance(value, Mapping):
        return Table(value)
    if isinstance(value, list | tuple):
        return tuple(_frozen(item) for item in value)
    return value


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    # In TOML whatever follows a [header] belongs to it, so a table's own values come before its sub-tables.
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping) and value is not None}
    nested = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    if path and (plain or not nested):
        yield f"\n[{'.'.join(_key(part) for part in path)}]"
    for key, value in plain.items():
        yield f"{_key(key)} = {_value(value)}"
    for key, value in nested.items():
        yield from _lines(value, (*path, key))


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, int):
        # Python reads hexadecimal of any length, but neither reads nor writes decimals of more than 4300 digits.
        return hex(value) if value >= 2**63 else str(value)
    return repr(value)


def _text(text: str) -> str:
    # JSON's escapes are TOML's, but TOML also forbids a bare DEL.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
