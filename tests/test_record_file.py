"""Records of many walks, written as they come: the same file as if all had been there at once."""

import errno
import os

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot, output
from chilopod.errors import OutputError
from chilopod.record_file import RecordFile
from chilopod.trials import Disturbance, Trial, run, together

ROBOT = load_robot("aoi2022-planar")


@pytest.fixture(scope="module")
def records():
    return run([Trial(ROBOT, 1.0, seed, disturbance=Disturbance(), rate=20.0, forces=True) for seed in range(4)])


def test_in_any_order_it_is_the_record_of_all(records, tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.record_file._LONGEST", 8)  # several chunks in time
    path = tmp_path / "new" / "walks.nc"
    with RecordFile(path, len(records)) as file:
        for index in (2, 0, 3, 1):
            file.add(index, records[index])
        assert os.listdir(tmp_path) == []
        assert file.write(replace=False) == [path]
    xr.testing.assert_identical(xr.load_dataset(path, engine="h5netcdf"), together(records))


def test_where_it_may_not_be_written_it_is_kept(records, tmp_path):
    path = tmp_path / "walks.nc"
    with RecordFile(path, 1) as file:
        file.add(0, records[0])
        path.write_text("precious")
        with pytest.raises(OutputError, match=r"exists.*kept instead: .*walks-2\.nc$"):
            file.write(replace=False)
    assert path.read_text() == "precious"
    assert xr.load_dataset(tmp_path / "walks-2.nc", engine="h5netcdf").sizes["robot"] == 1


@pytest.mark.parametrize("first", [0, 1, 3])
def test_a_disk_that_fills_up_stops_no_walk(records, tmp_path, monkeypatch, first):
    """HDF5 would die of it, at its first write or at a later one."""
    path, real = tmp_path / "walks.nc", os.write
    written = []

    def write(handle, content):
        if len(written) >= first:
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(content)
        return real(handle, content)

    monkeypatch.setattr(os, "write", write)
    with RecordFile(path, len(records)) as file:
        for index, record in enumerate(records):
            file.add(index, record)
        with pytest.raises(OutputError, match=r"walks\.nc: cannot be written \(No space left on device\)$"):
            file.write(replace=False)
    assert os.listdir(tmp_path) == []


def test_where_its_disk_is_full_it_is_kept_in_the_current_folder(records, tmp_path, monkeypatch):
    there, here, real = tmp_path / "there", tmp_path / "here", output.tempfile.TemporaryFile
    there.mkdir(), here.mkdir()
    monkeypatch.chdir(here)

    def full(*args, dir, **how):
        if dir == there:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(*args, dir=dir, **how)

    monkeypatch.setattr(output.tempfile, "TemporaryFile", full)
    monkeypatch.setattr(os, "replace", lambda *to: full(dir=to[1].parent).close() or os.rename(*to))
    with RecordFile(there / "walks.nc", 1) as file:
        file.add(0, records[0])
        with pytest.raises(OutputError, match=r"there/walks\.nc: .* on device\); kept instead: .*/here/walks\.nc$"):
            file.write(replace=False)
    assert os.listdir(there) == []
    xr.testing.assert_identical(xr.load_dataset(here / "walks.nc", engine="h5netcdf"), records[0])


def test_without_room_there_is_none(records, tmp_path, monkeypatch):
    def refused(*_):
        raise OSError(errno.EFBIG, "File too large")

    monkeypatch.setattr(os, "posix_fallocate", refused)
    with RecordFile(tmp_path / "walks.nc", 2) as file:
        file.add(0, records[0])
        with pytest.raises(OutputError, match="File too large"):
            file.write(replace=False)
    with pytest.raises(OutputError, match="there is room for"):
        RecordFile(tmp_path / "walks.nc", 2, 1e18)


def test_left_without_a_word_it_leaves_nothing(records, tmp_path):
    with RecordFile(tmp_path / "walks.nc", 2) as file:
        file.add(0, records[0])
    assert os.listdir(tmp_path) == []
    assert np.isfinite(records[0].heading).all()
