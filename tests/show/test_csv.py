"""Datasets as text."""

import io

import numpy as np
import pandas as pd
import xarray as xr

from chilopod.show.files import csv


def tables(data):
    notes, *_ = text = csv(data).split("\n\n")
    assert notes.startswith("#") == bool(data.attrs)
    return [pd.read_csv(io.StringIO(each), comment="#") for each in text]


def test_variables_of_different_points_have_a_table_each():
    """A line for every pair of points of eight maps would be more than any memory holds."""
    maps = {f"map{i}": ((f"y{i}", f"x{i}"), np.arange(97.0 * 49.0).reshape(97, 49)) for i in range(8)}
    found = tables(xr.Dataset({**maps, "at": ("curve", [1.0, 2.0])}, attrs={"robot": "any"}))
    assert [len(each) for each in found] == [97 * 49] * 8 + [2]
    assert list(found[3].columns) == ["y3", "x3", "map3"]
    assert list(found[3].map3) == list(range(97 * 49))


def test_variables_that_share_points_share_a_table():
    data = xr.Dataset(
        {
            "criterion": ("spring", [0.5, 0.25], {"units": "m"}),
            "angle": (("spring", "joint"), [[1.0, 2.0], [3.0, 4.0]]),
            "weight": ("joint", [5.0, 6.0]),
        },
        coords={"spring": ("spring", [10.0, 20.0], {"units": "N*mm/deg"}), "joint": [1, 2]},
    )
    (found,) = tables(data)
    assert list(found.columns) == ["spring [N*mm/deg]", "joint", "criterion [m]", "angle", "weight"]
    assert found.values.tolist() == [[10, 1, 0.5, 1, 5], [10, 2, 0.5, 2, 6], [20, 1, 0.25, 3, 5], [20, 2, 0.25, 4, 6]]
