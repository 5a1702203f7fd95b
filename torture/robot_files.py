"""Robot files with everything wrong that can be: values, units, types, keys, encodings, sizes, nesting."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from importlib import resources
from random import Random
from typing import Any

from in_process import Place, called, snapshot
from outcomes import FoundFault, Kind, Outcome, judged, strict_json
from values import GOOD, NUMBERS, TEXTS, UNITS, in_si

PRESETS = ("aoi2022-planar", "aoi2022")
_LINE = re.compile(r"^([^#\s=\[][^=\n]*?) = ([^\n]*)$", re.M)
_VERBS = {
    ("robot", "show", "robot.toml", "--json"): 40,
    ("robot", "check", "robot.toml"): 30,
    ("robot", "show", "robot.toml"): 6,
    ("robot", "check", "robot.toml", "--json"): 4,
    ("stability", "robot.toml", "--json"): 10,
    ("walk", "robot.toml", "--duration", "0.2 s", "--json"): 8,
    ("robot", "new", "new.toml", "--preset", "robot.toml"): 3,
    ("robot", "export", "robot.toml", "--out", "x.xml"): 2,
    ("walk", "robot.toml", "--duration", "0.02 s", "--engine", "twin", "--json"): 1,
}


# What may be said of a file as a whole.
_OF_ALL = ("is not valid TOML", "is not a text file", "the file is empty", "too large", "too deeply", "dots in a key")


class RobotFiles:
    """Presets, mutated once to four times, shown, checked, walked, analysed."""

    name = "robot-files"
    per_minute = 1200

    def __init__(self, quick: bool = False) -> None:
        self._verbs = {verb: often for verb, often in _VERBS.items() if verb[0] == "robot" or not quick}

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One mutated file and one command."""
        preset = chance.choice((PRESETS[0], *PRESETS))
        content = (resources.files("chilopod") / "robots" / f"{preset}.toml").read_bytes()
        for _ in range(chance.choice((1, 1, 1, 2, 4))):
            content = mutated(content, chance)
        (place.here / "robot.toml").write_bytes(content)
        (command,) = chance.choices(tuple(self._verbs), tuple(self._verbs.values()))
        place.tried.write_text(f"chilopod {' '.join(command)}")
        before = snapshot(place.root)
        ending = called(command, place)
        kind = judged(ending, before, snapshot(place.root), named=_OF_ALL, interrupted=place.interrupted.exists())
        if kind is Kind.ENDED and "--json" in command:
            found = strict_json(ending.out)
            if command[1] == "show":
                compare(tomllib.loads(content.decode("utf-8-sig")), found["parameters"])
        return Outcome(kind, ending.err.strip()[-200:])


def compare(table: dict[str, Any], shown: dict[str, Any]) -> None:
    """Make sure that all numbers of a file are those that are shown."""
    for section in ("body", "springs", "legs", "gait", "ground", "twin"):
        for key, value in table.get(section, {}).items():
            if isinstance(value, list):
                asked = {f"{section}.{key}[{index}]": each for index, each in enumerate(value)}
            else:
                asked = {path: value for path in shown if path.partition("[")[0] == f"{section}.{key}"}
                if not asked:
                    raise FoundFault(Kind.WRONG, f"{section}.{key} is ignored")
            for path, each in asked.items():
                right = in_si(each)
                if path not in shown:
                    raise FoundFault(Kind.WRONG, f"{path} is ignored")
                if right is not None and abs(shown[path]["value_si"] - right) > 4e-15 * abs(right):
                    raise FoundFault(Kind.WRONG, f"{path} = {each!r} is read as {shown[path]['value_si']!r}")


def mutated(content: bytes, chance: Random) -> bytes:
    """The content of a file with one thing wrong."""
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return chance.choice(_ON_BYTES)(content, chance)
    if len(content) > 100_000 or chance.random() < 0.2:
        return chance.choice(_ON_BYTES)(content, chance)
    return chance.choice(_ON_TEXT)(text, chance).encode(errors="surrogatepass")


def any_toml(chance: Random, deep: int = 0) -> str:
    """Any value as TOML, right or wrong."""
    how = chance.randrange(12 if deep < 3 else 8)
    if how < 3:
        return f'"{chance.choice(NUMBERS[:25])} {chance.choice(UNITS[:20])}"'
    if how == 3:
        return chance.choice(NUMBERS)
    if how == 4:
        return f'"{chance.choice(chance.choice(tuple(GOOD.values())))}"'
    if how == 5:
        text = chance.choice(TEXTS).replace("\\", "\\\\").replace('"', '\\"')
        return f'"{text}"'
    if how == 6:
        return chance.choice(
            ("true", "false", "2026-01-01", "07:32:00", "1979-05-27T07:32:00Z", "[]", "{}", '""', "''")
        )
    if how == 7:
        return chance.choice(("0x1F", "0o7", "0b1", "1_0", "+1", "'6'", "6.0", "6", "007", "1e3", ".5", "5.", "-0.0"))
    if how < 10:
        return f"[{', '.join(any_toml(chance, deep + 1) for _ in range(chance.randrange(7)))}]"
    if how == 10:
        return f"{{a = {any_toml(chance, deep + 1)}}}"
    return "[" * 40 + "]" * 40


def _line(text: str, chance: Random) -> re.Match[str] | None:
    found = list(_LINE.finditer(text))
    return chance.choice(found) if found else None


def _changed_line(change: Callable[[str, str, Random], str]) -> Callable[[str, Random], str]:
    """A mutation of one ``key = value``."""

    def mutation(text: str, chance: Random) -> str:
        line = _line(text, chance)
        return text if line is None else text[: line.start()] + change(line[1], line[2], chance) + text[line.end() :]

    return mutation


def _misspelt(name: str, chance: Random) -> str:
    at = chance.randrange(len(name))
    return chance.choice(
        (
            name[:at] + name[at + 1 :] or "x",
            name[:at] + chance.choice("aeiou_-.\"' []") + name[at:],
            name.upper(),
            name[::-1],
        )
    )


def _section(text: str, chance: Random) -> str:
    found = list(re.finditer(r"^\[([^\]\n]*)\]", text, re.M))
    if not found:
        return text
    at = chance.choice(found)
    new = chance.choice(
        (
            f"[[{at[1]}]]",
            f"[{_misspelt(at[1] or 'x', chance)}]",
            "",
            f"[{at[1]}.{at[1]}]",
            f"[{at[1]}]\n[{at[1]}]",
            "[]",
            "[a.b.c]",
            "[body]",
        )
    )
    return text[: at.start()] + new + text[at.end() :]


def _other_number(key: str, value: str, chance: Random) -> str:
    unit = re.search(r'"[-+\d.e]* ?([^"]*)"', value)
    return f'{key} = "{chance.choice(NUMBERS)} {unit[1] if unit else ""}"'


_ON_TEXT: tuple[Callable[[str, Random], str], ...] = (
    _changed_line(lambda key, value, chance: f"{key} = {any_toml(chance)}"),
    _changed_line(lambda key, value, chance: f"{key} = {any_toml(chance)}"),
    _changed_line(_other_number),
    _changed_line(_other_number),
    _changed_line(_other_number),
    _changed_line(lambda key, value, chance: ""),
    _changed_line(lambda key, value, chance: f"{key} = {value}\n{key} = {value}"),
    _changed_line(lambda key, value, chance: f"{_misspelt(key, chance)} = {value}"),
    _changed_line(lambda key, value, chance: f"{key}.{chance.choice(('x', 'value', key))} = {value}"),
    _changed_line(lambda key, value, chance: f"{key} = {{value = {value}}}"),
    _changed_line(lambda key, value, chance: f"{key} = [{value}]"),
    _changed_line(
        lambda key, value, chance: f"{key} = {value}\n{chance.choice(('x', key + '2', 'mass'))} = {any_toml(chance)}"
    ),
    _changed_line(lambda key, value, chance: f"{key} = {value}"[: chance.randrange(1, 60)]),
    _section,
    lambda text, chance: chance.choice(("stiffness = 3\n", "[body]\n", "[x]\n", "body = 3\n", "a.b = 1\n")) + text,
    lambda text, chance: (
        text + chance.choice(("\n[body]\n", "\nx", "\n[[twin]]\n", "\n[twin]\n", f"\nx = {any_toml(chance)}\n"))
    ),
    lambda text, chance: text.replace(
        "[springs]", f"[springs]\nadjustable = {any_toml(chance)}\nrate = {any_toml(chance)}", 1
    ),
    lambda text, chance: text.replace(
        "modules = 6", f"modules = {chance.choice((1, 2, 3, 5, 7, 12, 999, 1000, 1001, 6.0, -6))}", 1
    ),
)


def _flipped(content: bytes, chance: Random) -> bytes:
    bits = bytearray(content)
    for _ in range(chance.randrange(1, 6) if bits else 0):
        bits[chance.randrange(len(bits))] ^= 1 << chance.randrange(8)
    return bytes(bits)


def _inserted(content: bytes, chance: Random) -> bytes:
    at = chance.randrange(len(content) + 1)
    new = chance.choice(
        (
            b"\0",
            b"\xff",
            b"\xfe\xff",
            b"\r",
            b"\x7f",
            b"\xc3",
            b"\xed\xa0\x80",
            b'"""',
            b"'''",
            b"\n\n",
            bytes(1000),
            b"#",
        )
    )
    return content[:at] + new + content[at:]


def _nested(content: bytes, chance: Random) -> bytes:
    deep = chance.choice((10, 100, 1000, 5000, 50_000, 400_000))
    return (
        content
        + b"\n"
        + chance.choice(
            (
                b"x = " + b"[" * deep + b"]" * deep,
                b"x = " + b"{a=" * min(deep, 50_000) + b"1" + b"}" * min(deep, 50_000),
                b"a" + b".a" * deep + b" = 1",
                b"[a" + b".a" * deep + b"]",
                b"x = " + b"9" * deep,
                b'x = "' + b"y" * deep + b'"',
                b"y" * deep + b" = 1",
                b"\n".join(b"k%d = 1" % k for k in range(min(deep, 50_000))),
            )
        )
    )


_ON_BYTES: tuple[Callable[[bytes, Random], bytes], ...] = (
    _flipped,
    _flipped,
    _inserted,
    _inserted,
    _nested,
    lambda content, chance: content[: chance.randrange(len(content) + 1)],
    lambda content, chance: content[chance.randrange(len(content) + 1) :],
    lambda content, chance: content.replace(b"\n", chance.choice((b"\r\n", b"\r", b"\0", b"", b"\n\n"))),
    lambda content, chance: b"\xef\xbb\xbf" + content,
    lambda content, chance: content.decode("latin-1").encode(chance.choice(("utf-16", "utf-16-le", "utf-32", "cp500"))),
    lambda content, chance: chance.choice((b"", b" \n", b"\0", b"#", b"\x1f\x8b\x08", b"\x89HDF\r\n\x1a\n", b"name")),
    lambda content, chance: content * chance.choice((2, 3, 300)),
    lambda content, chance: content + b"#" * chance.choice((1, 900_000, 2_000_000)),
)
