"""Identification of constants that are hard to measure, from the results of a robot's walks."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.tasks.identify.check import SelfTest, self_test
    from chilopod.tasks.identify.data import TEMPLATES, BaseSeries, CriticalMode, RecordedWalks, load_data
    from chilopod.tasks.identify.measurements import Measurement, NextMeasurements, next_measurements
    from chilopod.tasks.identify.planar import Identification, identify_planar
    from chilopod.tasks.identify.trajectories import RecordedIdentification, identify_recorded
    from chilopod.tasks.identify.twin import TwinIdentification, identify_twin
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "data": ("TEMPLATES", "BaseSeries", "CriticalMode", "RecordedWalks", "load_data"),
            "measurements": ("Measurement", "NextMeasurements", "next_measurements"),
            "planar": ("Identification", "identify_planar"),
            "trajectories": ("RecordedIdentification", "identify_recorded"),
            "check": ("SelfTest", "self_test"),
            "twin": ("TwinIdentification", "identify_twin"),
        },
    )

__all__ = [
    "TEMPLATES",
    "BaseSeries",
    "CriticalMode",
    "Identification",
    "Measurement",
    "NextMeasurements",
    "RecordedIdentification",
    "RecordedWalks",
    "SelfTest",
    "TwinIdentification",
    "identify_planar",
    "identify_recorded",
    "identify_twin",
    "load_data",
    "next_measurements",
    "self_test",
]
