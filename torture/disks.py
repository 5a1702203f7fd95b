"""Places that cannot be written, or not to the end: files are whole or not there, and one line says why."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

from in_process import Place, called, snapshot
from outcomes import FoundFault, Kind, Outcome, judged
from studies import BRANCH, PLANAR, Whole, content, put, whole

_TURN = ("turn", "aoi2022-planar", "--target", "45 deg, 1.3 m", "--k1", "10 N*mm/deg", "--duration", "1 s")
_SPRING = ("--parameter", "springs.stiffness[0]", "--between", "11 N*mm/deg", "13 N*mm/deg")
_BEGIN = (*BRANCH[:-1], "--points", "2", "--out", "kept")
_RESUME = (*BRANCH[:-1], "--points", "1", "--resume", "kept")
_COMMANDS = {
    ("stability", "aoi2022-planar", "--out", "kept"): 2,
    ("bifurcation", "aoi2022-planar", *_SPRING, "--out", "kept"): 1,
    (*PLANAR[:-1], "--out", "kept/x.nc"): 4,
    (*PLANAR[:-1], "--trials", "kept"): 4,
    (*PLANAR[:-1], "--trials", "kept", "--out", "kept/x.nc", "--forces"): 2,
    _BEGIN: 2,
    _RESUME: 2,
    (*_TURN, "--out", "kept"): 2,
    ("robot", "new", "new.toml"): 2,
    ("robot", "export", "aoi2022", "--out", "x.xml"): 1,
}
_NAMED = ("kept", "new.toml", "x.xml", "/tmp: ")  # folders and files are as good as fields
_SIZE = 64 << 20  # bytes of a disk of our own
_NEW_NAMESPACE, _READ_ONLY, _REMOUNT, _PRIVATE = 0x20000, 1, 32, (1 << 14) | (1 << 18)


class Disks:
    """A command that writes, where something is wrong with where it writes."""

    name = "disk"
    per_minute = 120

    def __init__(self) -> None:
        self._disk: Path | None = None
        self._asked = False

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One command."""
        (command,) = chance.choices(tuple(_COMMANDS), tuple(_COMMANDS.values()))
        begun = whole(place, *_BEGIN) if command == _RESUME else None
        study = whole(place, *command, begun=begun)
        way = chance.choice((_full, _full, _full, _small_files, _read_only, _deleted, _in_the_way, _in_the_way))
        if way in (_full, _read_only):
            place = self._on_disk(place) or place
        exists = chance.random() < 0.7
        if exists:
            (place.here / "kept").mkdir(parents=True)
        if begun:
            put(begun.files, place.here)
        force = ("--force",) if way is _in_the_way and chance.random() < 0.5 and "--trials" not in command else ()
        told = f"chilopod {' '.join((*command, *force))} with {way.__name__[1:]}"
        with way(chance, place, study) as (words, meanwhile):
            place.tried.write_text(f"{told} {words}")
            before, there = snapshot(place.root), content(place.here)
            ending = called((*command, *force), place, meanwhile)
            after = snapshot(place.root)
        stopped, right = place.interrupted.exists(), study.ending.out
        kind = judged(ending, before, after, named=_NAMED, interrupted=stopped, stays=False, printed=right)
        if kind is Kind.ENDED and way is not _deleted and ending.out != study.ending.out:
            raise FoundFault(Kind.WRONG, "another result")
        now = content(place.here)
        for name, each in content(place.home).items():
            if each not in study.files.values():
                raise FoundFault(Kind.LEFT, f"{name} is kept elsewhere, but not whole")
        for name, each in now.items():
            if each not in (study.files.get(name), there.get(name)) and name.removeprefix("kept/") not in ending.err:
                raise FoundFault(Kind.LEFT, f"{name} is not whole")
        missing = [name for name in study.files if name not in now]
        if kind is Kind.ENDED and missing and way is not _deleted and "trials run but are not kept" not in ending.err:
            raise FoundFault(Kind.REPEATED, f"{missing[0]} is not there")
        others = [name for name, each in before.items() if after.get(name) != each]
        gone = [name for name in others if not _may_change(name, before, command, kind)]
        if gone and way is not _deleted:
            raise FoundFault(Kind.LEFT, f"{gone[0]} was there, and is gone or another")
        new = [name for name in after if name not in before and after[name] == stat.S_IFDIR]
        folders = [name for name in new if not any(each.startswith(f"{name}/") for each in after)]
        if kind is Kind.REFUSED and folders:
            raise FoundFault(Kind.LEFT, f"the new folder {folders[0]} is empty: {ending.err[-200:]}")
        return Outcome(kind, ending.err.strip()[-200:])

    def _on_disk(self, place: Place) -> Place | None:
        """The place on a small disk of its own, which only this process sees and which ends with it; if we may."""
        if not self._asked:
            self._asked = True
            self._disk = _mounted(place.root.parent / "disk")
        if self._disk is None:
            return None
        _remount(self._disk, 0)
        for each in self._disk.iterdir():
            shutil.rmtree(each) if each.is_dir() and not each.is_symlink() else each.unlink()
        there = Place(self._disk / "case", place.out, place.err)
        there.here.mkdir(parents=True)
        there.tmp.mkdir()
        there.home.mkdir()
        return there


Way = Iterator[tuple[str, Callable[[], None] | None]]  # what is wrong, and what happens meanwhile


@contextlib.contextmanager
def _full(chance: Random, place: Place, study: Whole) -> Way:
    """The disk, with temporary files, is full but for some pages; where it is the machine's own, files end early."""
    disk = place.root.parent
    if not disk.is_mount():
        with _small_files(chance, place, study) as told:
            yield told
        return
    pages = int(2.0 ** chance.uniform(0.0, 9.0)) - 1
    space = os.statvfs(disk)
    with (disk / "filler").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, space.f_bavail - pages) * space.f_bsize)
    yield f"but for {pages} pages", None


@contextlib.contextmanager
def _small_files(chance: Random, place: Place, study: Whole) -> Way:
    most = int(2.0 ** chance.uniform(12.0, 17.0))
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, former[1]))
    try:
        yield f"of {most} bytes", None
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)


@contextlib.contextmanager
def _read_only(chance: Random, place: Place, study: Whole) -> Way:
    disk, folder = place.root.parent, place.here / "kept"
    if disk.is_mount():
        _remount(disk, _READ_ONLY)
    elif folder.exists():
        folder.chmod(0o555)
    else:
        place.here.chmod(0o555)
    try:
        yield "", None
    finally:
        if disk.is_mount():
            _remount(disk, 0)
        else:
            (folder if folder.exists() else place.here).chmod(0o755)


@contextlib.contextmanager
def _deleted(chance: Random, place: Place, study: Whole) -> Way:
    after = chance.random() * study.seconds

    def delete() -> None:
        time.sleep(after)
        shutil.rmtree(place.here / "kept", ignore_errors=True)

    yield f"after {after:.3f} s", delete


@contextlib.contextmanager
def _in_the_way(chance: Random, place: Place, study: Whole) -> Way:
    """Something has the name of a file."""
    path = place.here / chance.choice(sorted(study.files))
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    how = chance.choice(("file", "folder", "pipe", "dangling link", "link", "device"))
    if how == "file":
        path.write_text("precious")
    elif how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how == "dangling link":
        path.symlink_to("nowhere")
    elif how == "link":
        (place.here / "other").write_text("precious")
        path.symlink_to(place.here / "other")
    else:
        try:
            os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
        except OSError:  # only root may
            os.mkfifo(path)
    yield f"{how} {path.name}", None


def _may_change(name: str, before: dict[str, object], command: tuple[str, ...], kind: Kind) -> bool:
    """Whether something that was there may be another now: what is gone on with, what has the name of a trial, which is
    set aside, and files where it is allowed."""
    about = before[name]
    if not isinstance(about, tuple):  # a folder
        return True
    if "--trials" in command and "kept/" in name:
        return True
    return stat.S_ISREG(about[0]) and (kind is Kind.ENDED or command == _RESUME)


def _mounted(path: Path) -> Path | None:
    path.mkdir()
    system = ctypes.CDLL(None, use_errno=True)
    if getattr(system, "unshare", None) is None or system.unshare(_NEW_NAMESPACE):
        return None
    system.mount(b"none", b"/", None, _PRIVATE, None)
    if system.mount(b"tmpfs", bytes(path), b"tmpfs", 0, f"size={_SIZE}".encode()):
        return None
    return path


def _remount(path: Path, how: int) -> None:
    ctypes.CDLL(None).mount(b"tmpfs", bytes(path), b"tmpfs", _REMOUNT | how, f"size={_SIZE}".encode())
