"""Pages of the site that are generated at every build: the Python reference, the commands, the keys of a robot file.

They say what docstrings, commands and models of the robot say, so nothing here has to follow when these change.
"""

from __future__ import annotations

import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from sphinx.pycode import ModuleAnalyzer

import chilopod
from chilopod import units
from chilopod.cli import app
from chilopod.robot import Robot, load_robot, presets
from chilopod.robot.parameters import SECTIONS
from chilopod.units import Description, Flag, Quantity, quantities

_COMMANDS_INTRODUCTION = """What the commands have in common stands in :doc:`the command line </docs/command-line>`.
This page is made from the commands themselves; it says what ``--help`` says."""
FOR_ENGINES = ("chilopod.engine.arguments", "chilopod.engine.saved", "chilopod.record")
_SHORT = 60
_KEYS_INTRODUCTION = """How a robot file is written stands in :doc:`the robot file </docs/robot-file>`. This page is
made from what reads it: every key with its unit and range, and what the presets have there and where they have it from.
A key of ``[gait]`` is ``gait.…`` in ``--set`` and in ``[provenance]``."""


def write(folder: Path) -> None:
    """Write all pages that have changed; a page of what is no longer there goes."""
    pages = {f"{package}.rst": api_page(package) for package in packages()}
    pages |= {"commands.rst": commands_page(), "robot-keys.rst": robot_keys_page()}
    folder.mkdir(exist_ok=True)
    for gone in {path.name for path in folder.iterdir()} - set(pages):
        (folder / gone).unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


@cache
def packages() -> list[str]:
    """Public packages, those that say what they export, and modules that an engine of one's own needs."""
    inner = (each.name for each in pkgutil.walk_packages(chilopod.__path__, "chilopod.") if each.ispkg)
    public = [name for name in ("chilopod", *inner) if hasattr(import_module(name), "__all__")]
    return sorted([*public, *FOR_ENGINES])


@cache
def homes() -> dict[int, str]:
    """Where each public object is described: the innermost package that exports it, by the object's id."""
    return {id(getattr(import_module(name), export)): name for name in packages() for export in exports(name)}


def exports(package: str) -> list[str]:
    """What a package exports, without its version; of a module, what it defines."""
    module = import_module(package)
    if hasattr(module, "__all__"):
        return [name for name in module.__all__ if not name.startswith("__")]
    return [name for name, value in vars(module).items() if _is_own(name, value, package)]


def _is_own(name: str, value: object, module: str) -> bool:
    return not name.startswith("_") and getattr(value, "__module__", None) == module


def public_name(target: str) -> str | None:
    """How a dotted name is called where it is described; itself where it is not, None if there is no such thing."""
    described = homes()
    if "." not in target:
        inner = [each for name, each in sys.modules.items() if name.startswith("chilopod.") and target in vars(each)]
        return public_name(f"{inner[0].__name__}.{target}") if inner else None
    try:
        found = pkgutil.resolve_name(target)
    except (AttributeError, ImportError, ValueError):
        return None
    home = described.get(id(found))
    return f"{home}.{target.rpartition('.')[2]}" if home else target


def api_page(package: str) -> str:
    """The reference of a package: a table of all that it exports, and then one after the other."""
    module, described = import_module(package), homes()
    lines = [*_heading(f"``{package}``", "="), f".. automodule:: {package}", ""]
    lines += [f".. currentmodule:: {package}", "", ".. autosummary::", "   :nosignatures:", ""]
    for name in exports(package):
        if isinstance(getattr(module, name), type) or inspect.isroutine(getattr(module, name)):
            home = described[id(getattr(module, name))].removeprefix(package).removeprefix(".")
            lines += [f"   ~{home}.{name}" if home else f"   {name}"]
    for name in exports(package):
        if described[id(getattr(module, name))] == package:
            lines += ["", *_entry(name, getattr(module, name))]
    return "\n".join(lines) + "\n"


def _entry(name: str, value: object) -> list[str]:
    if isinstance(value, type):
        kind = "exception" if issubclass(value, BaseException) else "class"
        return [f".. auto{kind}:: {name}", "   :members:", "   :exclude-members: model_config"]  # that of pydantic
    if inspect.isroutine(value):
        return [f".. autofunction:: {name}"]
    shown = repr(value)
    lines = [f".. data:: {name}", *([f"   :value: {shown}"] if len(shown) < _SHORT else [])]
    return [*lines, "", *(f"   {line}" for line in _words_of(name, value))]


def _words_of(name: str, value: object) -> Sequence[str]:
    """What is said of a constant, where it is defined."""
    for module in [each for home, each in sorted(sys.modules.items()) if home.startswith("chilopod.")]:
        if vars(module).get(name) is value and module.__file__ and not hasattr(module, "__path__"):
            words = ModuleAnalyzer.for_module(module.__name__).find_attr_docs().get(("", name))
            if words:
                return words
    return []


def commands_page() -> str:
    """Every command with its arguments and options."""
    lines = [*_heading("All commands", "="), _COMMANDS_INTRODUCTION]
    for words, command in _commands("chilopod", typer.main.get_command(app)):
        context = typer.Context(command, info_name=words)
        command.get_help(context)  # completes the choices of its options
        usage = command.get_usage(context).partition(": ")[2]
        lines += ["", *_heading(f"``{words}``", "-"), f".. program:: {words}", "", ".. code-block:: text", ""]
        lines += [f"   {usage}", "", _escaped(inspect.cleandoc(command.help or ""))]
        if command.epilog:
            example = command.epilog.rpartition("\n")[2].strip()
            lines += ["", "For example:", "", ".. code-block:: sh", "", f"   {example}"]
        for parameter in command.get_params(context):
            if (record := parameter.get_help_record(context)) is None:
                continue
            flags = parameter.metavar if parameter.param_type_name == "argument" else record[0]
            lines += ["", f".. option:: {flags}", "", f"   {_escaped(record[1])}"]
    return "\n".join(lines) + "\n"


def _commands(words: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield words, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from _commands(f"{words} {name}", inner)


def robot_keys_page() -> str:
    """Every key of a robot file: what it is, its unit and range, and what the presets have there."""
    robots = {name: load_robot(name) for name in sorted(presets())}
    lines = [*_heading("Keys of the robot file", "="), _KEYS_INTRODUCTION]
    for section, model in SECTIONS.items():
        lines += ["", *_heading(f"``[{section}]``", "-"), (model.__doc__ or "").strip().partition("\n")[0]]
        said = attributes(model)
        for key, quantity in quantities(model).items():
            path = f"{section}.{key}"
            lines += ["", f".. robotkey:: {path}", "", f"   {said[key]}", ""]
            lines += [f"   * {text}" for text in (*_facts(quantity), *_of_presets(path, robots))]
    return "\n".join(lines) + "\n"


def attributes(model: type[Description]) -> dict[str, str]:
    """What the docstring of a part of the robot says of each of its fields."""
    _, _, section = inspect.cleandoc(model.__doc__ or "").partition("Attributes\n----------\n")
    told = re.findall(r"^(\w+)\n((?:    .*\n)+)", apart(section.partition("\n\n")[0] + "\n"), re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in told}


def apart(docstring: str) -> str:
    """A docstring in which fields that are told of together, ``stance, swing``, are told of one after the other."""
    return re.sub(
        r"^(\w+(?:, \w+)+)\n((?:    .*\n)+)",
        lambda told: "".join(f"{name}\n{told[2]}" for name in told[1].split(", ")),
        docstring,
        flags=re.MULTILINE,
    )


def _facts(quantity: Quantity) -> Iterator[str]:
    if isinstance(quantity, Flag):
        yield "true or false"
    elif quantity.integer:
        yield f"a whole number, {quantity.at_least:g} to {quantity.at_most:g}"
    else:
        inside = f" ({_escaped(quantity.si)} inside)" if quantity.si not in ("", quantity.display) else ""
        unit = (
            f"in {_escaped(quantity.display)} or another unit of its kind{inside}" if quantity.display else "a number"
        )
        limited = (quantity.at_least, quantity.at_most) != _RANGE
        yield unit + (f", {_escaped(_range(quantity))}" if limited else ", more than 0")
    if quantity.each:
        yield "one value for each joint, front to rear; a single one stands for all"
    if quantity.optional:
        yield "may be left out"


_RANGE = (Quantity("", "").at_least, Quantity("", "").at_most)


def _range(quantity: Quantity) -> str:
    low, high = (units.format(end, quantity.display, digits=6) for end in (quantity.at_least, quantity.at_most))
    if quantity.at_most == _RANGE[1]:
        return f"{low} or more" if quantity.at_least == 0.0 else "of either sign"
    return f"up to {high}" if quantity.at_least == _RANGE[0] else f"{low} to {high}"


def _of_presets(path: str, robots: dict[str, Robot]) -> Iterator[str]:
    alike: dict[str, list[str]] = {}
    for name, robot in robots.items():
        paths = [each for each in robot.parameters() if each.partition("[")[0] == path]
        values = [units.format(robot.get(each), robot.unit_of(each), digits=6) for each in paths]
        told = [robot.provenance_of(each) for each in paths] or [robot.provenance_of(path)]
        shown = ", ".join(values if len(set(values)) > 1 else values[:1])
        sources = "; ".join(dict.fromkeys(text for text in told if text))
        if shown or sources:
            text = f"{shown or 'left out'} ({sources})" if sources else shown
            alike.setdefault(text, []).append(f"``{name}``")
    for text, names in alike.items():
        yield f"{', '.join(names)}: {_escaped(text)}"


def _heading(text: str, underline: str) -> list[str]:
    return [text, underline * len(text), ""]


def _escaped(text: str) -> str:
    """Plain text as reStructuredText; what stands between backticks stays code."""
    parts = text.split("`")
    return "``".join(
        re.sub(r"([*|_\\])", r"\\\1", part) if index % 2 == 0 else part for index, part in enumerate(parts)
    )
