"""What chilopod uses of numba, llvmlite, dask, MuJoCo and typer that new versions may change: what broke, by name.

Each stands in one module of ours, which is where to mend it; pyproject.toml caps the versions that were tried.
"""

import inspect
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import chilopod
from chilopod.numba_internals import ABOVE

PACKAGE = Path(chilopod.__file__).parent
INTERNALS = {
    "numba.core.caching": {"numba_internals.py": ("CompileResultCacheImpl", "FunctionCache", "IndexDataCacheFile")},
    "numba.core.typeconv": {"numba_internals.py": ("Conversion",)},
    "numba.core.typing": {"numba_internals.py": ("signature",)},
    "numba.core": {"numba_internals.py": ("cgutils", "event")},
    "llvmlite": {"numba_internals.py": ("binding", "ir"), "processor.py": ("binding",)},
    "mujoco.batch": {"twin/cycle_map.py": ("Batch",), "twin/scanner.py": ("Batch",), "twin/walk.py": ("Batch",)},
    "typer.core": {"cli/commands.py": ("TyperCommand", "TyperGroup", "TyperOption")},
}
"""Of each module of others, the files of ours that may import from it, and what."""
METHODS = {
    "numba.core.caching:FunctionCache": ("load_overload", "save_overload", "cache_path"),
    "numba.core.caching:IndexDataCacheFile": ("_save_data", "_save_index", "_load_index"),
    "numba.core.caching:CompileResultCacheImpl": ("locator", "filename_base"),
    "numba.core.dispatcher:Dispatcher": ("enable_caching", "stats"),
    "numba.core.cgutils": ("alloca_once", "create_struct_proxy", "for_range", "for_range_slice", "unpack_tuple"),
    "distributed:LocalCluster": ("sync", "close"),
    "distributed:Nanny": ("close",),
    "mujoco.batch:Batch": (),
    "typer.core:TyperCommand": ("invoke", "parse_args", "format_help"),
    "typer.core:TyperGroup": ("resolve_command",),
}
"""Of what they have, what is called or replaced."""
ARGUMENTS = {
    "llvmlite.ir:IRBuilder.gep": "source_etype",
    "llvmlite.ir:IRBuilder.load": "typ",
    "numba.core.caching:IndexDataCacheFile": "source_stamp",
}


def found(name):
    module, _, rest = name.partition(":")
    value = import_module(module)
    for part in filter(None, rest.split(".")):
        value = getattr(value, part)
    return value


@pytest.mark.parametrize("module", INTERNALS)
def test_internals_are_imported_where_they_belong(module):
    pattern = re.compile(rf"^\s*(?:from|import) {re.escape(module)}(?: import (.+)|$)", re.MULTILINE)
    seen = {}
    for path in PACKAGE.rglob("*.py"):
        for names in pattern.findall(path.read_text(encoding="utf-8")):
            seen[path.relative_to(PACKAGE).as_posix()] = tuple(names.split(", "))
    assert seen == INTERNALS[module]
    for name in {name for names in seen.values() for name in names}:
        assert hasattr(import_module(module), name) or import_module(f"{module}.{name}"), f"{module} has no {name}"


def test_there_are_no_others():
    inside = r"numba\.core|llvmlite|mujoco\.batch|typer\.(?:core|_)|xarray\."
    used = re.compile(rf"^\s*(?:from|import) ((?:{inside})[\w.]*)", re.MULTILINE)
    texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")]
    assert {name for text in texts for name in used.findall(text)} == {*INTERNALS}


@pytest.mark.parametrize("name", METHODS)
def test_they_have_what_is_used(name):
    pytest.importorskip(name.partition(":")[0].partition(".")[0])
    missing = [each for each in METHODS[name] if not hasattr(found(name), each)]
    assert not missing, f"{name} has no {', '.join(missing)} any more"


@pytest.mark.parametrize("name", ARGUMENTS)
def test_they_take_what_is_given(name):
    assert ARGUMENTS[name] in inspect.signature(found(name)).parameters, f"{name} takes no {ARGUMENTS[name]} any more"


def test_versions_with_internals_are_capped():
    project = tomllib.loads((PACKAGE.parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["cluster"]]
    for package in ("numba", "mujoco-core", "typer", "distributed"):
        (range_of,) = [each for each in wanted if re.match(rf"{package}\W", each)]
        assert "<" in range_of


def test_what_is_above_compiles_nothing():
    """Its changes do not count for compiled code; that nothing compiled imports it hold the contracts of layers."""
    for name in ABOVE:
        assert (PACKAGE / name / "__init__.py").is_file(), name
        for path in (PACKAGE / name).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            assert not re.search(r"chilopod\.compiled|\bnjit\b|from numba|numba\.extending", text), path
    contracts = (PACKAGE.parent.parent / "pyproject.toml").read_text(encoding="utf-8")
    layers = tomllib.loads(contracts)["tool"]["importlinter"]["contracts"][0]["layers"]
    planar = next(i for i, layer in enumerate(layers) if "planar" in layer)
    assert {*ABOVE} <= {each for layer in layers[: planar + 1] for each in re.findall(r"\w+", layer)} - {"planar"}
