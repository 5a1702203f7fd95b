"""Everything that the code of a controller can reach is part of what a trial is, or the trial is not kept."""

import importlib
import os
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

import pytest

from chilopod import load_robot
from chilopod.engine import Command, Event
from chilopod.trials import Trial, run

sys.path.append(str(Path(__file__).parents[2] / "torture"))
edits = importlib.import_module("edited_controllers")
PLANAR = load_robot("aoi2022-planar")
REFUSED = {"hidden state", "ufunc of one's own", "imported by name", "state of a generator"}
BY_NAME = {"global by name", "attribute by name", "evaluated", "helper by name"}


@pytest.mark.parametrize("where", edits.PLACES)
def test_an_edit_anywhere_makes_another_trial_or_none_that_is_kept(where, tmp_path):
    outcome = edits.edited(where, "0.2", "0.3", tmp_path)
    assert outcome.kind is (edits.Kind.REFUSED if where in REFUSED else edits.Kind.ENDED)
    assert outcome.said == "" or outcome.kind is edits.Kind.REFUSED


@pytest.mark.parametrize("where", sorted(edits.PLACES.keys() - REFUSED - BY_NAME))
def test_it_is_seen_in_objects_too_whatever_files_say_by_now(where, tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.trials.reach.Reach._module", lambda *_: iter(()))
    assert edits.edited(where, "0.2", "0.3", tmp_path).said == ""
