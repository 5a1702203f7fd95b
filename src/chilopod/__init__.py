"""chilopod: many-legged robots that turn by bifurcation.

>>> import chilopod
>>> chilopod.load_robot("aoi2022-planar").gait.period
0.6
"""

from importlib import import_module

from chilopod.lazy import exports

TYPE_CHECKING = False  # that of typing, which takes longer to load than all this
if TYPE_CHECKING:
    from chilopod.errors import AnalysisError, ChilopodError, OutputError, ParameterError, RobotFileError, UnitError
    from chilopod.gait import Gait
    from chilopod.ground import Ground
    from chilopod.robot import Robot, load_robot

    __version__: str
else:
    _load, __dir__ = exports(
        __name__,
        {
            "errors": (
                "AnalysisError",
                "ChilopodError",
                "OutputError",
                "ParameterError",
                "RobotFileError",
                "UnitError",
            ),
            "gait": ("Gait",),
            "ground": ("Ground",),
            "robot": ("Robot", "load_robot"),
        },
    )

    def __getattr__(name):
        # numpy, pydantic and importlib.metadata are loaded on first use: --help imports this package but none of them.
        if name != "__version__":
            return _load(name)
        release = import_module("importlib.metadata").version("chilopod")
        checkout = import_module("chilopod.sources").checkout()
        value = globals()[name] = f"{release}+{checkout}" if checkout else release
        return value


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
