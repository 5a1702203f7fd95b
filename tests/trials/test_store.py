"""A folder of trials: what is read back is what was asked, whatever has happened to the files."""

import dataclasses
import errno
import os
import shutil

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.errors import OutputError
from chilopod.steering import LegYawController, Target
from chilopod.trials import Store, Trial, run

ROBOT, WHOLE = load_robot("aoi2022-planar"), load_robot("aoi2022")
BASE = Trial(ROBOT, 1.0, 3, target=Target(0.7, 1.3), controller=LegYawController(), rate=20.0, forces=True)


@pytest.fixture
def store(tmp_path):
    told = []
    store = Store(tmp_path / "trials", told.append)
    store.told = told
    return store


@pytest.fixture(scope="module")
def record():
    return run([BASE])[0]


def kept(store, record):
    store.write(BASE, record)
    return store.folder / BASE.file_name


def names(store):
    return sorted(path.name for path in store.folder.iterdir())


def same(one, other):
    return one.equals(other) and one.attrs == other.attrs and all(one[n].attrs == other[n].attrs for n in one.variables)


@pytest.mark.parametrize(
    "trial",
    [
        BASE,
        Trial(ROBOT, 0.5),
        Trial(WHOLE.set_from_text(["springs.adjustable[0]=true"]), 0.5, engine="twin", forces=True, poses=True),
    ],
)
def test_what_is_read_is_what_was_written(store, trial):
    (walked,) = run([trial])
    store.write(trial, walked)
    store.sync()
    found = store.read(trial)
    assert same(walked, found)
    assert set(walked.dims) == set(found.dims)
    with xr.open_dataset(store.folder / trial.file_name, engine="scipy") as opened:
        assert opened.position.attrs["units"] == "m"
        assert opened.status.item() == "walked"
    assert store.told == []


def test_what_is_not_there_is_none(store):
    assert store.read(BASE) is None
    assert store.told == []


def damaged(content):
    half = len(content) // 2
    at = content.index(b"joint_angle")
    return {
        "cut": content[:half],
        "empty": b"",
        "nonsense": b"no record",
        "zeroed": content[:half] + bytes(len(content) - half),
        "zeroed first": bytes(half) + content[half:],
        "longer": content + b"x",
        "renamed variable": content[:at] + b"joint_anglo" + content[at + 11 :],
        "another checksum": content[:-1] + (b"0" if content[-1:] != b"0" else b"1"),
    }


@pytest.mark.parametrize("how", damaged(b"joint_angle" * 9))
def test_a_damaged_file_is_moved_aside(store, record, how):
    path = kept(store, record)
    content = damaged(path.read_bytes())[how]
    path.write_bytes(content)
    assert store.read(BASE) is None
    assert names(store) == [f"{path.name}.aside"]
    assert (store.folder / f"{path.name}.aside").read_bytes() == content
    (line,) = store.told
    assert "damaged or was edited" in line
    assert f"{path.name}.aside" in line


def test_no_flipped_bit_goes_unnoticed(store, record):
    path = kept(store, record)
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    # All over the file, and densely where its structure is described: there a flip may ask for all memory there is.
    for at in [*range(0, 3000, 7), *rng.integers(0, len(whole), 200)]:
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(flipped)
        assert store.read(BASE) is None, at
        for aside in store.folder.glob("*.aside*"):
            aside.unlink()
    path.write_bytes(whole)
    assert same(store.read(BASE), record)


def test_a_file_edited_with_xarray_is_not_taken_for_a_record(store, record):
    path = kept(store, record)
    data = xr.load_dataset(path, engine="scipy")
    data["heading"] = data.heading + 1.0
    data.to_netcdf(path, engine="scipy", format="NETCDF3_64BIT")
    assert store.read(BASE) is None
    assert len(store.told) == 1


def test_a_file_copied_over_another_is_walked_again(tmp_path):
    trials = [dataclasses.replace(BASE, seed=seed) for seed in range(3)]
    walked = run(trials, tmp_path)
    files = [tmp_path / trial.file_name for trial in trials]
    whole = [file.read_bytes() for file in files]
    when = files[0].stat().st_mtime_ns
    shutil.copy(files[0], files[1])
    files[2].write_bytes(b"")
    again = run(trials, tmp_path)
    assert all(same(one, other) for one, other in zip(walked, again, strict=True))
    assert [file.read_bytes() for file in files] == whole
    assert files[0].stat().st_mtime_ns == when
    assert len(list(tmp_path.glob("*.aside"))) == 2
    # Once more with nothing wrong: nothing is told, nothing moves.
    assert all(same(one, other) for one, other in zip(walked, run(trials, tmp_path), strict=True))
    assert len(list(tmp_path.iterdir())) == 5


def test_nothing_that_was_aside_is_lost(store, record):
    for content in (b"1", b"22", b"333"):
        path = kept(store, record)
        path.write_bytes(content)
        assert store.read(BASE) is None
    assert sorted(file.read_bytes() for file in store.folder.iterdir()) == [b"1", b"22", b"333"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_what_is_no_file_does_not_keep_anybody_waiting(store, record):
    path = store.folder / BASE.file_name
    path.parent.mkdir()
    os.mkfifo(path)
    assert store.read(BASE) is None
    path.mkdir()
    assert store.read(BASE) is None
    kept(store, record)
    assert same(store.read(BASE), record)
    assert all("cannot be read" in line for line in store.told)


def test_a_link_is_followed_and_itself_moved_aside(store, record, tmp_path):
    path = kept(store, record)
    elsewhere = path.rename(tmp_path / "elsewhere.nc")
    path.symlink_to(elsewhere)
    assert same(store.read(BASE), record)
    elsewhere.write_bytes(b"mine")
    assert store.read(BASE) is None
    assert elsewhere.read_bytes() == b"mine"
    path.symlink_to(tmp_path / "nowhere")
    assert store.read(BASE) is None
    assert "is a link to a missing file" in store.told[-1]
    assert names(store) == [f"{path.name}.aside", f"{path.name}.aside2"]


def test_of_a_huge_file_only_the_front_is_read(store, record):
    path = kept(store, record)
    for _ in range(2):  # first one that begins as it should, then one of nothing
        os.truncate(path, 2**40)
        assert store.read(BASE) is None
        path.touch()
    assert all("damaged" in line for line in store.told)
    assert len(store.told) == 2


def test_what_this_process_cannot_read_for_a_moment_stays(store, record, monkeypatch):
    path = kept(store, record)
    with monkeypatch.context() as patched:
        patched.setattr(os, "open", lambda *_: (_ for _ in ()).throw(OSError(errno.EMFILE, "too many open files")))
        with pytest.raises(OutputError, match="too many open files"):
            store.read(BASE)
    assert names(store) == [path.name]
    assert same(store.read(BASE), record)


def test_a_record_of_another_trial_is_not_written(store, record):
    with pytest.raises(OutputError, match="must belong to this trial"):
        store.write(dataclasses.replace(BASE, seed=4), record)
    assert not store.folder.exists()


def test_by_default_one_line_goes_to_the_log(tmp_path, record, caplog):
    store = Store(tmp_path)
    kept(store, record).write_bytes(b"")
    assert store.read(BASE) is None
    assert [each.levelname for each in caplog.records if each.name != "chilopod"] == ["WARNING"]
    assert caplog.records[0].name == "chilopod.trials.store"
