"""Results are written whole or not at all, replace only what they may, and are never lost."""

import errno
import os
import socket
from pathlib import Path

import pytest

from chilopod.errors import OutputError
from chilopod.output import check_files, check_folder, check_room, keep, spool, write_all, write_atomic


@pytest.fixture
def full_disk(monkeypatch):
    """Let nothing be written any more but in one folder."""

    def fill(spared):
        real = os.replace

        def replace(source, target):
            if Path(target).parent != spared:
                raise OSError(errno.ENOSPC, "No space left on device")
            real(source, target)

        monkeypatch.setattr(os, "replace", replace)

    return fill


def test_writes_text_bytes_and_open_files(tmp_path):
    assert write_atomic(tmp_path / "a", "µ").read_text(encoding="utf-8") == "µ"
    assert write_atomic(tmp_path / "a", b"\xff").read_bytes() == b"\xff"
    with spool(tmp_path / "new" / "b") as file, open(tmp_path / "a", "rb") as other:
        assert os.listdir(tmp_path) == ["a"]
        file.write(b"spooled")
        file.flush()
        assert write_atomic(tmp_path / "new" / "b", file).read_bytes() == b"spooled"
        assert write_atomic(tmp_path / "new" / "c", other).read_bytes() == b"\xff"
    plain = tmp_path / "plain"
    plain.touch()
    modes = {path.stat().st_mode for path in (plain, *(tmp_path / each for each in ("a", "new/b", "new/c")))}
    assert len(modes) == 1
    assert sorted(os.listdir(tmp_path / "new")) == ["b", "c"]


def test_keeps_what_may_not_be_replaced(tmp_path):
    write_atomic(tmp_path / "a", "old")
    with pytest.raises(OutputError, match="exists"):
        write_atomic(tmp_path / "a", "new", replace=False)
    assert (tmp_path / "a").read_text() == "old"


def test_only_regular_files_are_replaced(tmp_path):
    (tmp_path / "a").write_text("old")
    (tmp_path / "link").symlink_to("a")
    (tmp_path / "dangling").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe")
    os.mkdir(tmp_path / "folder")
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(str(tmp_path / "socket"))
    others = [tmp_path / each for each in ("link", "dangling", "pipe", "folder", "socket")]
    for path in [*others, "/dev/null", "/dev/stdout"]:
        before = os.lstat(path)
        for write in (lambda path: write_atomic(path, "new"), lambda path: check_files([path], replace=True)):
            with pytest.raises(OutputError, match=r"is not a regular file|is a link|is a folder"):
                write(path)
        assert os.lstat(path).st_ino == before.st_ino
    listening.close()
    assert (tmp_path / "a").read_text() == "old"


def test_leaves_nothing_behind_when_it_fails(tmp_path):
    write_atomic(tmp_path / "a", "old")
    for path in (tmp_path / "a", tmp_path / "new" / "folder" / "a"):
        with pytest.raises(OutputError, match="surrogates"):
            write_atomic(path, "\ud800")
    assert os.listdir(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == "old"


def test_names_what_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file" / "x", tmp_path / "a\0b", tmp_path / "new" / ("x" * 300)):
        for write in (lambda path: write_atomic(path, "x"), lambda path: check_files([path])):
            with pytest.raises(OutputError, match=str(tmp_path)):
                write(path)
    assert os.listdir(tmp_path) == ["file"]


def test_folders_are_looked_at_and_not_made(tmp_path):
    assert check_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "x", "/proc/nowhere", tmp_path / "new" / ("x" * 300) / "y"):
        with pytest.raises(OutputError, match=r"file: must be a folder|cannot be written"):
            check_folder(path)
    assert os.listdir(tmp_path) == ["file"]


def test_what_cannot_be_written_where_it_should_go_is_kept_elsewhere(tmp_path, monkeypatch, full_disk):
    there, here = tmp_path / "there", tmp_path / "here"
    here.mkdir()
    (here / "a.nc").write_text("mine")
    monkeypatch.chdir(here)
    write_atomic(there / "b.nc", "old")
    # Somebody else's file appeared meanwhile.
    with pytest.raises(OutputError, match=r"b\.nc: exists.*kept instead: .*there/b-2\.nc$"):
        write_all([(there / "a.nc", "first"), (there / "b.nc", "new")], replace=False)
    assert [(there / name).read_text() for name in ("a.nc", "b.nc", "b-2.nc")] == ["first", "old", "new"]
    full_disk(here)
    with pytest.raises(OutputError, match=r"a\.nc: cannot be written \(No space.*instead: .*/here/a-2\.nc, .*/b\.nc$"):
        write_all([(there / "a.nc", "1"), (there / "b.nc", "2")])
    assert [(here / name).read_text() for name in ("a.nc", "a-2.nc", "b.nc")] == ["mine", "1", "2"]
    full_disk(None)
    with pytest.raises(OutputError, match=r"a\.nc: cannot be written \(No space.*no other place could be written$"):
        write_all([(there / "a.nc", "1")])
    assert sorted(os.listdir(there)) == ["a.nc", "b-2.nc", "b.nc"]


def test_what_is_kept_nowhere_is_named(tmp_path, monkeypatch, full_disk):
    there, here = tmp_path / "there", tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    full_disk(here)
    real = os.replace  # which writes here only

    def without_room_for_large_files(source, target):
        if Path(source).stat().st_size > 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)

    monkeypatch.setattr(os, "replace", without_room_for_large_files)
    files = [(there / "a.nc", "12"), (there / "b.nc", "1"), (there / "c.nc", "12"), (here / "d.nc", "1")]
    with pytest.raises(
        OutputError, match=r"kept instead: .*/here/b\.nc; lost: .*/there/a\.nc, .*/there/c\.nc$"
    ) as lost:
        write_all(files)
    assert lost.value.written == [here / "d.nc"]


def test_a_file_of_progress_stops_nothing_and_is_missed_once(tmp_path, monkeypatch, full_disk, caplog):
    files = [tmp_path / "new" / each for each in ("a", "b")]
    said = f"{files[0].parent}: results are not kept: cannot be written (No space left on device)"
    full_disk(None)
    for file in files:
        keep(file, "1", "results")
    assert ([each.getMessage() for each in caplog.records], os.listdir(tmp_path)) == ([said], [])
    monkeypatch.undo()  # there is room again
    keep(files[0], "1", "results")
    assert files[0].read_text() == "1"
    full_disk(None)
    keep(files[1], "1", "results")
    assert [each.getMessage() for each in caplog.records] == [said, said]


def test_what_does_not_fit_is_said_before_it_is_computed(tmp_path):
    check_room(tmp_path / "new" / "a.nc", 1e3)
    with pytest.raises(OutputError, match=r"a\.nc: takes 1e\+03 PB or more, and there is room for .* [kMGT]B$"):
        check_room(tmp_path / "new" / "a.nc", 1e18)
    assert not (tmp_path / "new").exists()
