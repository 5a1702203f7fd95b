"""Processes that use one folder share the work; claims decide who walks, never what comes out."""

import dataclasses
import errno
import os
import shutil
import sys
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from chilopod import load_robot
from chilopod.errors import OutputError
from chilopod.trials import Store, Trial, batch, claims, run

BASE = Trial(load_robot("aoi2022-planar"), 0.5, rate=20.0)
TRIALS = [dataclasses.replace(BASE, seed=seed) for seed in range(4)]
NAMES = [trial.file_name for trial in TRIALS]


@pytest.fixture
def walked_here(monkeypatch):
    """The seeds of what is walked in this test."""
    seeds, walked = [], batch.walked
    monkeypatch.setattr(batch, "walked", lambda trials: seeds.extend(each.seed for each in trials) or walked(trials))
    return seeds


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def test_who_has_a_claim_has_it_alone_and_the_last_one_leaves_nothing(tmp_path):
    store = Store(tmp_path)
    with store.claims() as one:
        with store.claims() as other:
            assert one.take(NAMES[0])
            assert one.take(NAMES[0])
            assert not other.take(NAMES[0])
            assert other.take(NAMES[1])
            one.release(NAMES[0])
            assert other.take(NAMES[0])
        assert files(tmp_path) == [claims.NAME]
        assert not claims.nobody_in(tmp_path)
        assert one.take(NAMES[1])  # what the other had went with him
    assert files(tmp_path) == []
    assert claims.nobody_in(tmp_path)


@pytest.mark.parametrize("brought", [True, False])
def test_what_another_walks_is_waited_for_at_the_end(tmp_path, walked_here, brought):
    store, told, stack = Store(tmp_path), [], ExitStack()
    assert stack.enter_context(store.claims()).take(NAMES[1])

    def progress(part, words):
        told.append(words)
        if "another process" in words:
            if brought:
                store.write(TRIALS[1], run([TRIALS[1]])[0])
                walked_here.remove(1)
            stack.close()

    records = run(TRIALS, tmp_path, progress)
    assert walked_here == ([0, 2, 3] if brought else [0, 2, 3, 1])
    assert "3 of 4 trials, 1 walked by another process" in told
    assert all(one.identical(other) for one, other in zip(records, run(TRIALS), strict=True))
    assert files(tmp_path) == sorted(NAMES)


def test_nobody_is_waited_for_without_end(tmp_path, walked_here, monkeypatch):
    monkeypatch.setattr(sys.modules["chilopod.trials.run"], "_PATIENCE", 0.0)
    with Store(tmp_path).claims() as other:
        assert other.take(NAMES[2])
        run(TRIALS, tmp_path)
    assert walked_here == [0, 1, 3, 2]
    assert files(tmp_path) == sorted(NAMES)


def test_an_interruption_leaves_no_claim(tmp_path):
    def interrupted(part, words):
        if part > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(TRIALS, tmp_path, interrupted)
    assert files(tmp_path) == sorted(NAMES)


def test_trials_that_a_full_disk_does_not_keep_are_given_all_the_same(tmp_path, walked_here, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", full)
        records = run(TRIALS, tmp_path)
        assert files(tmp_path) == []
    assert [each.getMessage() for each in caplog.records if each.name == "chilopod.trials.store"] == [
        f"{tmp_path}: trials run but are not kept: cannot be written (No space left on device)"
    ]
    again = run(TRIALS, tmp_path)
    assert walked_here == 2 * [0, 1, 2, 3]
    assert all(one.identical(other) for one, other in zip(records, again, strict=True))


def test_a_later_study_that_lacks_room_is_given_all_the_same(tmp_path, monkeypatch, caplog):
    """A command that runs several studies would lose what the first one came to."""
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=0))
    for _ in range(2):  # what this process did before does not count
        with pytest.raises(OutputError, match=r"takes .* or more, and there is room for 0 bytes$"):
            run(TRIALS[:1], tmp_path)
    monkeypatch.undo()
    run(TRIALS[:1], tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=0))
    records = run(TRIALS[:2], tmp_path)
    assert [record.attrs["trial"] for record in records] == [trial.text for trial in TRIALS[:2]]
    assert files(tmp_path) == NAMES[:1]
    (said,) = [each.getMessage() for each in caplog.records if each.name == "chilopod.trials.store"]
    assert said == f"{tmp_path}: trials run but are not kept: there is no room"


def test_where_there_are_no_locks_nobody_shares(tmp_path, monkeypatch):
    def refused(*_):
        raise OSError(errno.ENOLCK, "no locks here")

    monkeypatch.setattr(claims, "_locked", refused)
    with Store(tmp_path).claims() as one, Store(tmp_path).claims() as other:
        assert one.take(NAMES[0])
        assert other.take(NAMES[0])
        one.release(NAMES[0])
        assert files(tmp_path) == []


def test_what_a_killed_process_left_is_removed_by_the_next_who_is_alone(tmp_path):
    half, foreign = tmp_path / ".chilopod-trial-x", tmp_path / ".chilopod-x"
    for path in (half, foreign, tmp_path / claims.NAME):
        path.touch()
    run(TRIALS[:1], tmp_path)
    assert files(tmp_path) == sorted([foreign.name, NAMES[0]])
    with Store(tmp_path).claims():
        half.touch()
        run(TRIALS[:2], tmp_path)
        assert half.exists()
