"""Digest of everything that the code of a class can reach, which changes with any part of it.

The search goes over objects, from a class through its bases, attributes, functions, closures, default values and the
globals that functions name. Installed code (Python, packages, chilopod) is described by name and version, user code
down to its instructions and constants. Names made at run time escape this search: therefore every user module also
counts as a whole, with all user modules that it imports. Objects of kinds outside the table below are refused.
"""

from __future__ import annotations

import builtins
import copyreg
import dataclasses
import dis
import enum
import functools
import hashlib
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib import import_module, metadata
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    FunctionType,
    GetSetDescriptorType,
    MappingProxyType,
    MemberDescriptorType,
    MethodType,
    ModuleType,
)
from typing import Any

import numpy as np

from chilopod.engine.named import path_of
from chilopod.errors import in_words
from chilopod.trials.chance import BY_NAME, by_chance, chance_in

Parts = Iterator[tuple[str, object]]

_ATOMS = (type(None), bool, int, float, complex, str, bytes, bytearray, range, slice, type(...), type(NotImplemented))
# The compiler may make one object or several with equal contents.
_VALUES = (tuple, frozenset, CodeType)
_GIVEN_NAMES = (
    "dict weakref doc firstlineno static_attributes annotations annotations_cache annotate_func slotnames "
    "dataclass_fields dataclass_params orig_bases parameters"
)
_GIVEN = {"_abc_impl", *(f"__{name}__" for name in _GIVEN_NAMES.split())}
_MADE = frozenset(f"_{name}_" for name in ("member_names", "member_map", "value2member_map", "unhashable_values"))
_WRITTEN = frozenset(
    f"__{name}__" for name in ("init", "repr", "eq", "hash", "setattr", "delattr", "replace", "lt", "le", "gt", "ge")
)
_IMPORT = dis.opmap["IMPORT_NAME"]
_HIDING = frozenset(f"__{name}__" for name in ("reduce", "reduce_ex", "getstate", "getnewargs", "getnewargs_ex"))
_CODE = (
    *("code", "consts", "exceptiontable", "names", "varnames", "freevars", "cellvars", "flags", "name", "argcount"),
    *("posonlyargcount", "kwonlyargcount"),
)
_FIELD = ("name", "default", "default_factory", "init", "compare", "kw_only", "metadata")


class UnknownKindError(Exception):
    """An object cannot be described; the message names it and the path to it."""


class Reach:
    """Digest of everything that can be reached from the objects passed to :meth:`see`, in order; ``own`` is a top-level
    package that counts as user code even if installed. ``chance`` is the first source of chance found, see
    :mod:`chilopod.trials.chance`; empty if there is none."""

    def __init__(self, own: str = "") -> None:
        self._own, self.chance = own, ""
        self._hash = hashlib.sha256()
        self._seen: dict[int, int] = {}
        self._alive: list[object] = []  # so that no other object gets the address of one that was seen

    @property
    def digest(self) -> str:
        """Digest of all objects so far."""
        return self._hash.hexdigest()[:16]

    def see(self, value: object, path: str) -> None:
        """Add an object, reached by ``path``, and everything that can be reached from it, or raise UnknownKindError."""
        try:
            self._see(value, path)
        except UnknownKindError:
            raise
        except Exception as error:  # foreign objects may raise anything on access
            raise UnknownKindError(f"{path}: {in_words(error)}") from None

    def _see(self, value: Any, path: str) -> None:
        kind = type(value)
        if kind in _ATOMS:
            return self._put(kind.__name__, hex(value) if isinstance(value, int) else repr(value))
        if named := self._named(value):
            self._found_chance(path, "" if isinstance(value, ModuleType) else by_chance(value))
            return self._put("named", named)
        if kind not in _VALUES:
            if id(value) in self._seen:
                return self._put("seen", self._seen[id(value)])
            self._seen[id(value)] = len(self._seen)
            self._alive.append(value)
        self._put(kind.__module__, kind.__qualname__)
        if kind in (set, frozenset):
            return self._put(*sorted(self._apart(each, path) for each in value))
        for label, part in self._parts(value, kind, path):
            self._put(label)
            self._see(part, path + label)
        return self._put("end")

    def _apart(self, value: object, path: str) -> str:
        other = Reach(self._own)
        other.see(value, f"{path}{{}}")
        return other.digest

    def _found_chance(self, path: str, chance: str) -> None:
        if chance == BY_NAME:
            raise UnknownKindError(f"{path}: {chance}")
        self.chance = self.chance or (chance and f"{path}: {chance}")

    def _put(self, *words: object) -> None:
        self._hash.update(repr(words).encode())

    def _parts(self, value: Any, kind: type, path: str) -> Parts:
        """Parts of an object, each with its path."""
        if kind is FunctionType:
            return self._function(value, path)
        if isinstance(value, ModuleType):
            return self._module(value, path)
        if isinstance(value, type):
            return self._class(value)
        if kind is np.ndarray and not value.dtype.hasobject:
            return iter([(".dtype", str(value.dtype.descr)), (".shape", value.shape), ("[...]", value.tobytes())])
        if isinstance(value, enum.Enum):
            return _attributes("_name_", "_value_", "__class__")(value)
        if isinstance(getattr(value, "py_func", None), FunctionType):  # as numba keeps it
            return _attributes("py_func", "targetoptions")(value)
        return _KINDS[kind](value) if kind in _KINDS else self._instance(value, kind, path)

    def _instance(self, value: Any, kind: type, path: str) -> Parts:
        """State that pickle would keep, for classes with a complete pickle."""
        own = [vars(each) for each in kind.__mro__ if self._is_own(each.__module__)]
        hiding = [each[how] for each in own for how in each.keys() & _HIDING]
        hides = any(self._is_own(getattr(each, "__globals__", {}).get("__name__", "")) for each in hiding)
        found: Any = None
        with suppress(Exception):
            reduce = copyreg.dispatch_table.get(kind)
            found = None if hides else reduce(value) if reduce else value.__reduce_ex__(4)
        if not isinstance(found, tuple):
            raise UnknownKindError(f"{path}: an object of type {kind.__qualname__}")
        for part in (kind, *found[:3], *(list(each) for each in found[3:5] if each is not None)):
            yield "", part
        if isinstance(value, np.ndarray):  # pickle leaves out what a subclass adds
            yield ".__dict__", getattr(value, "__dict__", None)

    def _function(self, function: FunctionType, path: str) -> Parts:
        if function.__globals__.get("__name__") == "functools" and hasattr(function, "registry"):
            yield ".registry", function.registry  # of singledispatch, without its cache
            return
        yield from _attributes("__code__", "__defaults__", "__kwdefaults__", "__closure__", "__dict__")(function)
        space = function.__globals__
        if self._is_own(space.get("__name__", "")):
            imported = self._imported(function.__code__, space)
            known = {**vars(builtins), **space, **imported}
            cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
            inner = {name: _content(cell) for name, cell in cells}
            self._found_chance(path, chance_in(function.__code__, {**known, **inner}))
            yield from self._reached(_named_in(function.__code__) | imported.keys(), known, "", set())
            home = sys.modules.get(space.get("__name__", ""))
            if home is not None and vars(home) is space:
                yield ".__module__", home

    def _reached(self, names: set[str], space: Mapping[str, object], prefix: str, inside: set[int]) -> Parts:
        """Objects that the names may refer to, for user modules also their attributes."""
        for name in sorted(names & space.keys()):
            value = space[name]
            if isinstance(value, ModuleType) or not by_chance(value):  # a mere name may stand for an attribute
                yield f" -> {prefix}{name}", value
            if isinstance(value, ModuleType) and id(value) not in inside and self._is_own(value.__name__):
                yield from self._reached(names, vars(value), f"{prefix}{name}.", inside | {id(value)})

    def _module(self, module: ModuleType, path: str) -> Parts:
        """Text of a user module, its own lookup of attributes, and all user modules that it imports."""
        file = getattr(module, "__file__", None)
        if file is None and hasattr(module, "__path__"):
            return
        if file is None:
            raise UnknownKindError(f"{path}: a module without a file")
        content = Path(file).read_bytes()
        code = _compiled(content) if file.endswith(".py") else None
        yield "", content if code is None else code
        # No name leads to these two, and they may import more.
        yield ".__getattr__", vars(module).get("__getattr__")
        yield ".__class__", type(module)
        outer = module.__name__.rpartition(".")[0]
        found = self._imported(code, vars(module), nested=False) if code else {}
        for name, each in sorted({**found, outer: sys.modules.get(outer)}.items()):
            if each is not None and self._is_own(each.__name__):
                yield f" -> {name}", each

    def _class(self, kind: type) -> Parts:
        yield ".__module__", path_of(kind)
        yield from _attributes("__class__", "__bases__")(kind)
        yield "", sys.modules.get(kind.__module__)
        fields = vars(kind).get("__dataclass_fields__", {})
        for each in fields.values():
            yield from _attributes(*_FIELD)(each)
        yield " (dataclass)", repr(vars(kind).get("__dataclass_params__"))
        if issubclass(kind, enum.Enum):
            yield ".__members__", kind.__members__
        skipped = _GIVEN | _MADE if issubclass(kind, enum.Enum) else _GIVEN
        for name, part in sorted(vars(kind).items()):
            # What dataclass writes follows from the fields.
            written = name in _WRITTEN and getattr(getattr(part, "__code__", None), "co_filename", "") == "<string>"
            if name not in skipped and not (fields and written):
                yield f".{name}", part

    def _imported(self, code: CodeType, space: Mapping[str, Any], nested: bool = True) -> dict[str, ModuleType | None]:
        """Modules that code imports when it runs, imported now; None for a missing module."""
        found: dict[str, ModuleType | None] = {}
        for each in code.co_consts if nested else ():
            found |= self._imported(each, space) if isinstance(each, CodeType) else {}
        if _IMPORT not in code.co_code[::2]:
            return found
        constants: list[Any] = []
        for each in dis.get_instructions(code):
            constants += [each.argval] if each.opname == "LOAD_CONST" else []
            if each.opname == "IMPORT_NAME":
                level, wanted = constants[-2], constants[-1] or ()
                name = "." * level + each.argval
                found[each.argval] = module = _module_named(name, space)
                for part in wanted if module and self._is_own(module.__name__) else ():
                    inner = vars(module).get(part) or _module_named(name + "." * bool(each.argval) + part, space)
                    found |= {part: inner} if isinstance(inner, ModuleType) else {}
        return found

    def _named(self, value: Any) -> str:
        """Name and version of an object that an installed package exports under its own name; empty otherwise."""
        module: Any
        name: Any
        if isinstance(value, ModuleType):
            module, name = value.__name__, ""
        elif isinstance(value, np.ufunc):
            module, name = "numpy" if hasattr(np, value.__name__) else "scipy.special", value.__name__
        elif callable(value) and not self._is_own(type(value).__module__):
            name = getattr(value, "__qualname__", None)
            # A wrapper has the module of the wrapped function.
            module = getattr(value, "__globals__", {}).get("__name__", getattr(value, "__module__", None))
        else:
            return ""
        if not isinstance(module, str) or not isinstance(name, str) or self._is_own(module):
            return ""
        found: Any = sys.modules.get(module)
        for part in filter(None, name.split(".")):
            found = getattr(found, part, None)
        return f"{module}:{name} of {_brought_by(module)}" if found is value else ""

    def _is_own(self, module: str) -> bool:
        return module.partition(".")[0] == self._own or not _brought_by(module)


def _dict_parts(values: Mapping[Any, object]) -> Parts:
    for key, value in values.items():
        yield " (key)", key
        yield f"[{key!r:.40}]" if isinstance(key, str | int | float) else "[...]", value


def _attributes(*names: str) -> Callable[[Any], Parts]:
    return lambda value: ((f".{name}", getattr(value, name)) for name in names)


def _item_parts(values: Iterable[object]) -> Parts:
    return ((f"[{index}]", each) for index, each in enumerate(values))


_SLOT = _attributes("__objclass__", "__name__")
_KINDS: dict[type, Callable[[Any], Parts]] = {
    tuple: _item_parts,
    list: _item_parts,
    dict: _dict_parts,
    MappingProxyType: _dict_parts,
    CodeType: _attributes(*(f"co_{name}" for name in _CODE)),
    CellType: _attributes("cell_contents"),
    MethodType: _attributes("__func__", "__self__"),
    BuiltinFunctionType: _attributes("__name__", "__self__"),
    property: _attributes("fget", "fset", "fdel"),
    classmethod: _attributes("__func__"),
    staticmethod: _attributes("__func__"),
    np.vectorize: _attributes("pyfunc", "otypes", "excluded", "signature"),
    functools.cached_property: _attributes("func"),
    functools.singledispatchmethod: _attributes("dispatcher", "func"),  # without its cache
    type(lru_cache(lambda: 0)): _attributes("__wrapped__"),
    MemberDescriptorType: _SLOT,
    GetSetDescriptorType: _SLOT,
    type(str.join): _SLOT,
    type(object.__init__): _SLOT,
    type("".__str__): _attributes("__self__", "__name__"),
}


def _content(cell: CellType) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # nothing yet
        return None


def _named_in(code: CodeType) -> set[str]:
    """Names that code looks up, and texts in it that may be names."""
    names = {*code.co_names, *(each for each in code.co_consts if isinstance(each, str) and each.isidentifier())}
    return names.union(*(_named_in(each) for each in code.co_consts if isinstance(each, CodeType)))


def _module_named(name: str, space: Mapping[str, Any]) -> ModuleType | None:
    try:
        return import_module(name, space.get("__package__"))
    except Exception:  # a foreign module may raise anything
        return None


@lru_cache(maxsize=256)
def _compiled(content: bytes) -> CodeType | None:
    """Code object of a text; None if the text is not valid Python."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return compile(content, "", "exec", dont_inherit=True)
        except (SyntaxError, ValueError):
            return None


def _brought_by(module: str) -> str:
    """Name and version of the package of an installed module; empty for user modules."""
    top = module.partition(".")[0]
    if top in ("chilopod", "__main__"):
        return top if top == "chilopod" else ""
    file = getattr(sys.modules.get(module, sys.modules.get(top)), "__file__", None)
    return _package_of(top, file)


@lru_cache(maxsize=4096)
def _package_of(top: str, file: str | None) -> str:
    place = Path(file or dataclasses.__file__)
    if {"site-packages", "dist-packages"} & {*place.parts}:
        try:
            return f"{top} {metadata.version(top)}"
        except metadata.PackageNotFoundError:
            version = getattr(sys.modules[top], "__version__", "")
            return f"{top} {version}" if version else ""
    inside = top in sys.stdlib_module_names and place.is_relative_to(Path(dataclasses.__file__).parent)
    return "Python {}.{}".format(*sys.version_info) if inside else ""
