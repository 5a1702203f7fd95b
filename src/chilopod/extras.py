"""Optional packages, which are installed as extras (``pip install "chilopod[live]"``)."""

from __future__ import annotations

from importlib import import_module

from chilopod.errors import ExtraError, briefly


def needs(package: str, *, extra: str) -> None:
    """Check that an optional package is installed, before it is imported.

    Raises ExtraError if the package, named as it is imported, is not installed or cannot be imported; the error names
    the chilopod extra that installs it.
    """
    try:
        import_module(package)
    except ImportError as error:
        absent = isinstance(error, ModuleNotFoundError) and error.name == package
        problem = "is not installed" if absent else f"cannot be imported: {briefly(error)}"
        raise ExtraError(f'{package} {problem}; to mend it: pip install "chilopod[{extra}]"') from error
