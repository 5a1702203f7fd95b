"""Controllers that are edited in one place: their trials are others then, or are not kept, and never the old ones."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

from chilopod.robot import load_robot
from chilopod.trials import Trial
from in_process import Place
from outcomes import FoundFault, Kind, Outcome

_HEAD = """
import enum, functools, importlib, operator, types
from collections import OrderedDict, namedtuple
from dataclasses import dataclass, field
import numpy as np
from chilopod.engine import Command, Event
"""
_CLASS = """
@dataclass(frozen=True)
class Own({bases}):
{body}
    def events(self, gait):
        return [Event("now", 0.0, 0.1)]
    def act(self, event, seen):
        return Command(leg_yaw=[[{yaw}, 0.0]])
"""
PLACES: dict[str, tuple[str, str, str]] = {
    # What stands in the module, what in the class, and where the yaw comes from; V is what is edited.
    "literal": ("", "", "V"),
    "complex literal": ("", "", "(1j * Vj).real"),
    "bytes literal": ("", "", "float(b'V')"),
    "text literal": ("", "", "float('V')"),
    "tuple literal": ("", "", "(1, (2, V))[1][1]"),
    "frozenset literal": ("", "", "0.1 if 0.2 in {0.3, V} else 0.2 if V in {0.3, V} and V > 0.25 else 0.3"),
    "slice of an array": ("", "", "np.arange(100.0)[int(100 * V)] / 100"),
    "comprehension": ("", "", "sum([k * V for k in range(2)])"),
    "class constant": ("", "GAIN = V", "self.GAIN"),
    "class list": ("", "GAINS = [V, 0.3]", "self.GAINS[0]"),
    "class dictionary": ("", "GAINS = {'a': V}", "self.GAINS['a']"),
    "class proxy": ("", "GAINS = types.MappingProxyType({'a': V})", "self.GAINS['a']"),
    "class array": ("", "GAINS = np.array([V, 0.3])", "self.GAINS[0]"),
    "object array": ("", "GAINS = np.array([V, 'a', None], dtype=object)", "self.GAINS[0]"),
    "structured array": ("", "GAINS = np.array([(V, 1)], dtype=[('a', float), ('b', int)])", "self.GAINS['a'][0]"),
    "class set": ("", "GAINS = {V}", "next(iter(self.GAINS))"),
    "class complex": ("", "GAIN = Vj", "self.GAIN.imag"),
    "ordered dictionary": ("", "GAINS = OrderedDict(a=V)", "self.GAINS['a']"),
    "inner class": ("", "class Inner:\n        GAIN = V", "self.Inner.GAIN"),
    "inner method": ("", "class Inner:\n        def gain(self):\n            return V", "self.Inner().gain()"),
    "instance": ("class Gains:\n    def __init__(self): self.a = V\nGAINS = Gains()", "", "GAINS.a"),
    "slots": ("class Gains:\n    __slots__ = 'a'\nGAINS = Gains()\nGAINS.a = V", "", "GAINS.a"),
    "list of one's own": ("class Gains(list): pass\nGAINS = Gains([V])", "", "GAINS[0]"),
    "hidden state": (
        "class Gains:\n    def __init__(self): self.a = V\n    def __getstate__(self): return {}\nGAINS = Gains()",
        "",
        "GAINS.a",
    ),
    "named tuple": ("Gains = namedtuple('Gains', 'a b')\nGAINS = Gains(V, 1)", "", "GAINS.a"),
    "made from text": (
        "exec('@dataclass(frozen=True)\\nclass Gains:\\n  def a(self): return V')\nGAINS = Gains()",
        "",
        "GAINS.a()",
    ),
    "enum": ("class Gain(enum.Enum):\n    A = V", "", "Gain.A.value"),
    "ufunc": ("F = np.sin if V < 0.25 else np.cos", "", "float(F(1.0))"),
    "ufunc of one's own": ("F = np.frompyfunc(lambda x: V * x, 1, 1)", "", "float(F(1.0))"),
    "builtin": ("F = min if V < 0.25 else max", "", "F(0.1, 0.2)"),
    "method of an object": ("F = [V].__getitem__", "", "F(0)"),
    "getter": ("F = operator.itemgetter(int(10 * V))", "", "F([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])"),
    "vectorize": ("F = np.vectorize(lambda x: V * x)", "", "float(F(1.0))"),
    "lru_cache": ("@functools.lru_cache\ndef f(x): return V * x", "", "f(1.0)"),
    "cached property": ("", "@functools.cached_property\n    def gain(self): return V", "self.gain"),
    "property": ("", "@property\n    def gain(self): return V", "self.gain"),
    "static method": ("", "@staticmethod\n    def gain(): return V", "self.gain()"),
    "class method": ("", "@classmethod\n    def gain(cls): return V", "self.gain()"),
    "partial": ("F = functools.partial(max, V)", "", "F(0.0)"),
    "partialmethod": ("", "def g(self, x): return x\n    gain = functools.partialmethod(g, V)", "self.gain()"),
    "singledispatch": (
        "@functools.singledispatch\ndef f(x): return 0.0\n@f.register\ndef _(x: float): return V * x",
        "",
        "f(1.0)",
    ),
    "singledispatchmethod": (
        "",
        "@functools.singledispatchmethod\n    def f(self, x): return 0.0\n    @f.register\n"
        "    def _(self, x: float): return V * x",
        "self.f(1.0)",
    ),
    "default": ("def f(x=V): return x", "", "f()"),
    "default list": ("def f(x=[V]): return x[0]", "", "f()"),
    "keyword default": ("def f(*, x={'a': V}): return x['a']", "", "f()"),
    "attribute of a function": ("def f(): return f.gain\nf.gain = V", "", "f()"),
    "closure": ("def made(gain):\n    def f(): return gain\n    return f\nF = made(V)", "", "F()"),
    "closure over a list": ("def made(*gain):\n    def f(): return gain[0][0]\n    return f\nF = made([V])", "", "F()"),
    "lambda": ("F = lambda: V", "", "F()"),
    "decorated": (
        "def doubled(f):\n    @functools.wraps(f)\n    def g(): return f() * V\n    return g\n"
        "@doubled\ndef f(): return 1.0",
        "",
        "f()",
    ),
    "decorated as another's": ("F = functools.wraps(np.sum)(lambda: V)", "", "F()"),
    "generator": ("def f():\n    yield V", "", "next(f())"),
    "global": ("GAIN = V", "", "GAIN"),
    "global of a global": ("GAIN = V\ndef f(): return GAIN\ndef g(): return f()", "", "g()"),
    "global by name": ("GAIN = V", "", "globals()['GA' + 'IN']"),
    "attribute by name": ("", "GAIN = V", "getattr(self, 'GA' + 'IN')"),
    "evaluated": ("GAIN = V", "", "eval('GAI' + 'N')"),
    "descriptor": (
        "class Gain:\n    def __init__(self, a): self.a = a\n    def __get__(self, one, kind): return self.a",
        "gain = Gain(V)",
        "self.gain",
    ),
    "__getattr__": (
        "",
        "def __getattr__(self, name):\n        if name == 'gain': return V\n        raise AttributeError",
        "self.gain",
    ),
    "after it was made": ("", "def __post_init__(self): object.__setattr__(self, '_gain', V)", "self._gain"),
    "default of a field": ("", "gain: float = V", "self.gain"),
    "factory of a field": ("", "gain: tuple = field(default_factory=lambda: (V,))", "self.gain[0]"),
    "base class": ("class Base:\n    GAIN = V", "BASE", "self.GAIN"),
    "base of a base": ("class Root:\n    def f(self): return V\nclass Base(Root): pass", "BASE", "self.f()"),
    "metaclass": (
        "class Meta(type):\n    @property\n    def gain(cls): return V\nclass Base(metaclass=Meta): pass",
        "BASE",
        "type(self).gain",
    ),
    "helper": ("from own_helper import gain", "", "gain()"),
    "helper module": ("import own_helper", "", "own_helper.gain()"),
    "imported inside": ("", "", "__import_inside()"),
    "helper by name": ("import own_helper", "", "getattr(own_helper, 'GA' + 'IN')"),
    "helper of a helper": ("import own_helper", "", "own_helper.second()"),
    "lookup of a module": ("import own_lazy", "", "own_lazy.gain"),
    "class of a module": ("import own_classed", "", "own_classed.gain"),
    "package": ("import own_package.deep as deep", "", "deep.GAIN"),
    "imported by name": ("", "", "importlib.import_module('own_' + 'helper').GAIN"),
    "state of a generator": ("F = np.random.default_rng(int(100 * V))", "", "F.random()"),
}
_HELPER = "import own_second\nGAIN = V\ndef gain(): return GAIN\ndef second(): return own_second.GAIN\n"
_ROBOT = load_robot("aoi2022-planar")
_LAZY = "def __getattr__(name):\n    from own_second import GAIN\n    return GAIN\n"
_CLASSED = """
import sys, types
class Own(types.ModuleType):
    @property
    def gain(self):
        from own_second import GAIN
        return GAIN
sys.modules[__name__].__class__ = Own
"""
_BESIDE = {"helper": _HELPER, "second": "GAIN = V\n", "lazy": _LAZY, "classed": _CLASSED}


class EditedControllers:
    """One number of a controller, somewhere in what its code reaches; the controller is imported anew."""

    name = "edited-controllers"
    per_minute = 600

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One edit."""
        where = chance.choice(tuple(PLACES))
        one, other = (repr(round(each / 100, 2)) for each in chance.sample(range(10, 60), 2))
        place.tried.write_text(f"{where}: {one} becomes {other}")
        return edited(where, one, other, place.here)


def edited(where: str, one: str, other: str, folder: Path) -> Outcome:
    """What comes of an edit of a controller, in one of :data:`PLACES`.

    Raises
    ------
    FoundFault
        If nobody notices.
    """
    found = [_described(where, value, folder) for value in (one, one, other)]
    (before, why, yaw), (again, _, _), (after, _, changed) = found
    if yaw == changed:
        return Outcome(Kind.ENDED, "an edit that changes nothing")
    if why:
        return Outcome(Kind.REFUSED, why)
    if before != again:
        raise FoundFault(Kind.REPEATED, f"{where}: the same controller is another")
    if before == after:
        raise FoundFault(Kind.WRONG, f"{where}: the edited controller is the old one")
    return Outcome(Kind.ENDED)


def _described(where: str, value: str, folder: Path) -> tuple[str, str, float]:
    """The name of a trial, why it is not kept, and what the controller does."""
    module, body, yaw = PLACES[where]
    bases, body = ("Base", "") if body == "BASE" else ("", body)
    inside = "import own_helper; return Command(leg_yaw=[[own_helper.gain(), 0.0]])"
    text = _HEAD + module + _CLASS.format(bases=bases, body=f"    {body}", yaw=yaw)
    text = text.replace("return Command(leg_yaw=[[__import_inside(), 0.0]])", inside)
    (folder / "own_package").mkdir(parents=True, exist_ok=True)
    (folder / "own_package" / "__init__.py").write_text("")
    files = {"own_controller.py": text} | {f"own_{name}.py": beside for name, beside in _BESIDE.items()}
    for name, content in {**files, "own_package/deep.py": "GAIN = V\n"}.items():
        (folder / name).write_text(content.replace("V", value))
    with _imported(folder) as own:
        trial = Trial(_ROBOT, 1.0, controller=own.Own())
        name, why = trial.file_name, trial.code[1]
        return name, why, float(own.Own().act(None, None).leg_yaw[0][0])


class _imported:
    """The modules in a folder, imported anew and forgotten at the end."""

    def __init__(self, folder: Path) -> None:
        self._folder = str(folder)

    def __enter__(self) -> Any:
        self._forget()
        sys.path.insert(0, self._folder)
        sys.path_importer_cache.clear()
        self._bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
        module: ModuleType = importlib.import_module("own_controller")
        return module

    def __exit__(self, *error: object) -> None:
        sys.dont_write_bytecode = self._bytecode
        sys.path.remove(self._folder)
        self._forget()

    def _forget(self) -> None:
        for name in [each for each in sys.modules if each.partition("_")[0] == "own"]:
            del sys.modules[name]
