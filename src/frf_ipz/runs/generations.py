"""The results of a folder as generations: one is current, and another becomes so in one step.

::

    DIR/.frf_ipz/current            the number of the current generation
    DIR/.frf_ipz/generations/7/     all files of it, whole, never changed again; 0 is what was there before the first
    DIR/.frf_ipz/placing-8/         while generation 8 takes its place: new files, ready, and the old ones

A commit goes in four steps, under the lock of the folder:

1. Generation 8 is written whole beside generation 7, and synced. What has not changed is linked, not copied, where the
   file system has links.
2. The files that users open (`DIR/run.json`, `DIR/poles.parquet`, ...) are replaced one by one. Each old one is kept
   in `placing-8/old`. Where one cannot be replaced, because another program has it open or the process is told to
   stop, the others are taken back: the folder is byte for byte as it was.
3. The number in `current` is replaced: from here on the new results count, and before it the old ones did.
4. Generation 7 and `placing-8` are removed.

Whoever reads (`current_folder`) reads the files of the current generation, so old or new, whole; it needs no lock and
no permission to write. Where a process is killed, the next command finds `placing-8`: with `current` at 7 it takes the
files that users open back, with `current` at 8 it only clears up.

Nothing is removed but what stands in `DIR/.frf_ipz`, and files of `DIR` that are, byte for byte, those of a generation.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.input_files import digest_file, read_text
from frf_ipz.output_files import (
    BESIDE,
    cannot_write,
    link_or_copy,
    move,
    remove_litter,
    replacing,
    sync,
    sync_folder,
    to_its_end,
    write_text,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

HIDDEN = ".frf_ipz"
POINTER = "current"
GENERATIONS = "generations"
PLACING = "placing-"
READY, OLD = "new", "old"
NUMBER = re.compile(r"[0-9]{1,18}")


def current_folder(path: Path) -> Path:
    """Give the folder where the results of a run are whole.

    Parameters
    ----------
    path : Path
        The run's folder.

    Returns
    -------
    Path
        That of the current generation; the run's folder itself where there is none, because an older version has
        written it or it was copied without what is hidden.
    """
    number = _current_number(path)
    while number is not None:
        folder = _generation(path, number)
        if folder.is_dir():
            return folder
        latest = _current_number(path)  # it may have been replaced this very moment
        number = None if latest == number else latest
    return path


def stamp(path: Path) -> str:
    """Tell results from others: another text whenever the folder holds others.

    Parameters
    ----------
    path : Path
        The run's folder.

    Returns
    -------
    str
        Empty where there are none.
    """
    folder = current_folder(path)
    try:
        return f"{folder.name}-{(folder / 'run.json').stat().st_mtime_ns}"
    except OSError:
        return ""


@dataclass(kw_only=True, eq=False)
class Generations:
    """The generations of one folder, for the process that holds its lock.

    Parameters
    ----------
    path : Path
        The run's folder.
    current : Path
        Where its results are whole; the folder itself where there is no generation.
    number : int
        Of the generation to come.
    staging : Path
        Where its files are written.
    """

    path: Path
    current: Path = field(init=False)
    number: int = field(init=False)
    staging: Path = field(init=False)

    def __post_init__(self) -> None:
        """Clear up what a killed process has left, and make room for a new generation."""
        require_own_folder(self.path)
        number = _current_number(self.path)
        for beside in (self.path / HIDDEN).glob(f"{BESIDE}*"):  # who holds the lock is the only one to write there
            beside.unlink()
        remove_litter(self.path)
        self._clear_up(number)
        self.current = current_folder(self.path)
        self.number = 1 if number is None else number + 1
        self.staging = _generation(self.path, self.number)
        try:
            self.staging.mkdir(parents=True)
        except BaseException:
            self.abandon()
            raise

    def adopt(self, names: Iterable[str]) -> None:
        """Make a generation of what an older version has left, or of nothing, so that one is always current.

        Parameters
        ----------
        names : iterable of str
            Files of results that an older version has left.
        """
        if self.current != self.path:
            return
        adopted = _generation(self.path, 0)
        adopted.mkdir()
        for name in names:
            if (self.path / name).is_file():
                (adopted / name).parent.mkdir(exist_ok=True)
                link_or_copy(self.path / name, adopted / name)
        _sync_tree(adopted)
        write_text(self.path / HIDDEN / POINTER, "0\n")
        self.current = adopted

    def out_of_place(self) -> list[str]:
        """List files that users open and that are not what the current generation has of them.

        Returns
        -------
        list of str
            Those that somebody has changed or removed.
        """
        return [name for name in _files(self.current) if not _is_same(self.path / name, self.current / name)]

    def keep(self, names: Iterable[str]) -> None:
        """Take files of the current generation over into the new one.

        Parameters
        ----------
        names : iterable of str
            Those that are there and have not been written anew.
        """
        for name in names:
            if (self.current / name).is_file() and not (self.staging / name).exists():
                _make_room(self.staging / name)
                link_or_copy(self.current / name, self.staging / name)

    def commit(self) -> None:
        """Let the new generation take the place of the current one.

        Raises
        ------
        InputError, OSError
            If a file cannot be replaced: then all are as they were.
        """
        _sync_tree(self.staging)
        placing = self.path / HIDDEN / f"{PLACING}{self.number}"
        names = _files(self.staging)
        changed = [name for name in names if not _is_same(self.path / name, self.staging / name)]
        abandoned = sorted(set(_files(self.current)) - set(names))
        try:
            for name in (*changed, *abandoned):
                _make_room(placing / OLD / name)
            for name in changed:
                _make_room(self.path / name)
                _make_room(placing / READY / name)
                _make_ready(self.staging / name, placing / READY / name)
            for name in changed:
                with _naming(self.path / name):
                    _set_aside(self.path / name, placing / OLD / name)
                    move(placing / READY / name, self.path / name)
            for name in abandoned:  # it would tell of an older result
                if _is_same(self.path / name, self.current / name):
                    with _naming(self.path / name):
                        move(self.path / name, placing / OLD / name)
            for folder in {(self.path / name).parent for name in (*changed, *abandoned)}:
                sync_folder(folder)
            write_text(self.path / HIDDEN / POINTER, f"{self.number}\n")
        except BaseException:
            if _current_number(self.path) == self.number:  # a signal came when all was in its place
                to_its_end(lambda: self._clear_up(self.number))
            else:
                self._take_back(placing, self.staging)
                _remove(placing)
            raise
        to_its_end(lambda: self._clear_up(self.number))

    def abandon(self) -> None:
        """Remove what was written for a generation that did not come about."""
        if _current_number(self.path) != self.number:
            to_its_end(lambda: _remove(self.staging))

    def _clear_up(self, number: int | None) -> None:
        """Remove all that is not current; what a killed process has placed of it is taken back before."""
        hidden = self.path / HIDDEN
        for placing in sorted(hidden.glob(f"{PLACING}*")):
            placed = placing.name.removeprefix(PLACING)
            if placed != str(number) and NUMBER.fullmatch(placed):
                self.current = current_folder(self.path)
                self._take_back(placing, _generation(self.path, int(placed)))
            _remove(placing)
        for generation in (hidden / GENERATIONS).glob("*"):
            if generation.name != str(number):
                _remove(generation)

    def _take_back(self, placing: Path, placed: Path) -> None:
        """Put the old files back, and remove new ones that had none before them."""
        for name in _files(placing / OLD):
            if not _is_same(self.path / name, placing / OLD / name):  # else it has not been replaced
                move(placing / OLD / name, self.path / name)
        known = set() if self.current == self.path else set(_files(self.current))
        for name in _files(placed):
            waits = (placing / READY / name).exists()
            if name not in known and not waits and _is_same(self.path / name, placed / name):
                (self.path / name).unlink()
        for folder in {(self.path / name).parent for name in _files(placed)}:
            with suppress(OSError):  # made for the new files; stays where it holds anything
                folder.rmdir() if folder != self.path else None


def forget_empty(path: Path) -> None:
    """Remove what is kept of a folder in which there have never been results.

    Parameters
    ----------
    path : Path
        The run's folder.

    Raises
    ------
    OSError
        If anything is kept, which stays.
    """
    hidden = path / HIDDEN
    for folder in (_generation(path, 0), hidden / GENERATIONS):
        with suppress(FileNotFoundError):
            folder.rmdir()
    (hidden / POINTER).unlink(missing_ok=True)


def require_own_folder(path: Path) -> None:
    """Refuse a folder in which a link leads elsewhere, where the program would write and remove.

    Parameters
    ----------
    path : Path
        The run's folder.

    Raises
    ------
    InputError
        If there is such a link.
    """
    for folder in (path / HIDDEN, path / HIDDEN / GENERATIONS, path / "stages"):
        if folder.is_symlink():
            raise InputError(f"{folder}: is a link to elsewhere, and the program writes there; remove the link")


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the file that the user knows where it cannot be replaced."""
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error) from None


def _generation(path: Path, number: int) -> Path:
    return path / HIDDEN / GENERATIONS / str(number)


def _current_number(path: Path) -> int | None:
    try:
        text = read_text(path / HIDDEN / POINTER).strip()
    except FileFormatError:
        return None
    return int(text) if NUMBER.fullmatch(text) else None


def _files(folder: Path) -> list[str]:
    """Files in a folder and in those below it, by their names from there."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if not _is_folder(path))


def _make_room(path: Path) -> None:
    """Make the folder of a file, where there is none."""
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True)


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _is_same(path: Path, other: Path) -> bool:
    """Tell whether two files have the same content, or are one."""
    try:
        first, second = path.lstat(), other.lstat()
    except OSError:
        return False
    if os.path.samestat(first, second):
        return True
    is_plain = path.is_file() and not path.is_symlink()
    return is_plain and first.st_size == second.st_size and digest_file(path) == digest_file(other)


def _make_ready(source: Path, target: Path) -> None:
    if source.suffix == ".json":  # what people edit: in place, which would change the generation too
        with replacing(target) as beside:
            shutil.copyfile(source, beside)
    else:
        link_or_copy(source, target)


def _set_aside(path: Path, target: Path) -> None:
    """Keep a file that is about to be replaced, if there is one."""
    if not os.path.lexists(path):
        return
    if _is_folder(path):
        raise IsADirectoryError(errno.EISDIR, f"{path.name} is a folder there", str(path))
    try:
        os.link(path, target, follow_symlinks=False)
    except (OSError, NotImplementedError):
        move(path, target)


def _sync_tree(folder: Path) -> None:
    for name in _files(folder):
        if (folder / name).stat().st_nlink == 1:  # what has another name has been synced under that
            sync(folder / name)
    for part in (folder, *filter(_is_folder, folder.rglob("*")), folder.parent, folder.parent.parent):
        sync_folder(part)


def _remove(folder: Path) -> None:
    """Remove a folder that the program has made; what another program holds open goes with the next command."""
    if not folder.is_symlink():
        shutil.rmtree(folder, ignore_errors=True)
