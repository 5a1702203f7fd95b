"""Results are written whole or not at all."""

import os

import pytest

from chilopod.errors import OutputError
from chilopod.output import prepare_folder, write_atomic


def test_writes_text_and_bytes(tmp_path):
    assert write_atomic(tmp_path / "a", "µ").read_text(encoding="utf-8") == "µ"
    assert write_atomic(tmp_path / "a", b"\xff").read_bytes() == b"\xff"
    assert os.listdir(tmp_path) == ["a"]
    plain = tmp_path / "plain"
    plain.touch()
    assert (tmp_path / "a").stat().st_mode == plain.stat().st_mode


def test_keeps_what_may_not_be_replaced(tmp_path):
    write_atomic(tmp_path / "a", "old")
    with pytest.raises(OutputError, match="exists"):
        write_atomic(tmp_path / "a", "new", replace=False)
    assert (tmp_path / "a").read_text() == "old"


def test_leaves_nothing_behind_when_it_fails(tmp_path):
    write_atomic(tmp_path / "a", "old")
    with pytest.raises(OutputError, match="surrogates"):
        write_atomic(tmp_path / "a", "\ud800")
    assert os.listdir(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == "old"


def test_names_what_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "no" / "file", tmp_path / "file" / "x", tmp_path / "a\0b"):
        with pytest.raises(OutputError, match=str(tmp_path)):
            write_atomic(path, "x")


def test_prepares_folders(tmp_path):
    assert prepare_folder(tmp_path / "a" / "b").is_dir()
    assert os.listdir(tmp_path / "a" / "b") == []
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "x", "/proc/nowhere"):
        with pytest.raises(OutputError, match="cannot be written"):
            prepare_folder(path)
