"""chilopod: many-legged robots that turn by bifurcation.

>>> import chilopod
>>> chilopod.load_robot("aoi2022-planar").gait.period
0.6
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chilopod.errors import (
        AnalysisError,
        ChilopodError,
        OutputError,
        ParameterError,
        RobotFileError,
        UnitError,
    )
    from chilopod.gait import Gait
    from chilopod.ground import Ground
    from chilopod.robot import Robot, load_robot

    __version__: str

__all__ = [
    "AnalysisError",
    "ChilopodError",
    "Gait",
    "Ground",
    "OutputError",
    "ParameterError",
    "Robot",
    "RobotFileError",
    "UnitError",
    "__version__",
    "load_robot",
]

_HOMES = {
    "AnalysisError": "chilopod.errors",
    "ChilopodError": "chilopod.errors",
    "Gait": "chilopod.gait",
    "Ground": "chilopod.ground",
    "OutputError": "chilopod.errors",
    "ParameterError": "chilopod.errors",
    "Robot": "chilopod.robot",
    "RobotFileError": "chilopod.errors",
    "UnitError": "chilopod.errors",
    "load_robot": "chilopod.robot",
}


def __getattr__(name: str) -> Any:
    # numpy, pydantic and importlib.metadata are loaded on first use: --help imports this package but none of them.
    if name == "__version__":
        value: Any = import_module("importlib.metadata").version("chilopod")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
