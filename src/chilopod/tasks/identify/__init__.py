"""Identification of constants that are hard to measure, from the results of a robot's walks."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.tasks.identify.check import SelfTest as SelfTest
    from chilopod.tasks.identify.check import self_test as self_test
    from chilopod.tasks.identify.data import TEMPLATES as TEMPLATES
    from chilopod.tasks.identify.data import BaseSeries as BaseSeries
    from chilopod.tasks.identify.data import CriticalMode as CriticalMode
    from chilopod.tasks.identify.data import RecordedWalks as RecordedWalks
    from chilopod.tasks.identify.data import load_data as load_data
    from chilopod.tasks.identify.measurements import Measurement as Measurement
    from chilopod.tasks.identify.measurements import NextMeasurements as NextMeasurements
    from chilopod.tasks.identify.measurements import next_measurements as next_measurements
    from chilopod.tasks.identify.planar import Identification as Identification
    from chilopod.tasks.identify.planar import identify_planar as identify_planar
    from chilopod.tasks.identify.trajectories import RecordedIdentification as RecordedIdentification
    from chilopod.tasks.identify.trajectories import identify_recorded as identify_recorded
    from chilopod.tasks.identify.twin import TwinIdentification as TwinIdentification
    from chilopod.tasks.identify.twin import identify_twin as identify_twin
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
