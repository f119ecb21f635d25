"""Results appear whole or not at all, and nothing that was there is lost.

Everything is written under a temporary name beside its place, brought to the disk, and renamed at
the end, so that a run that fails or is killed leaves what was there before.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from mien.errors import InputError
from mien.io.files.leftovers import finish_replacement, remove_leftovers, temporary_beside
from mien.io.files.manifest import (
    Snapshot,
    keep_late_files,
    keep_user_files,
    load_manifest,
    save_manifest,
)
from mien.reading.names import check_path

# Failures of the place that is written to; others are the caller's and pass through.
_PLACE_ERRORS = {
    errno.EACCES,
    errno.EDQUOT,
    errno.EEXIST,
    errno.EFBIG,
    errno.ELOOP,
    errno.ENAMETOOLONG,
    errno.ENOSPC,
    errno.ENOTDIR,
    errno.ENOTEMPTY,
    errno.EPERM,
    errno.EROFS,
}


_NO_SYNC = {errno.EACCES, errno.EPERM, errno.EINVAL, errno.ENOTSUP, errno.EROFS}
"""Of files and folders that cannot be synced, as opposed to a disk that fails."""


@contextmanager
def atomic_file(path: str | Path) -> Iterator[Path]:
    """A path to write to, which takes the place of `path` when the block ends without an error.

    Folders above are made. The temporary name has another suffix: say the format when writing.

    Raises:
        InputError: a folder or a device is in the way, the place cannot be written.
    """
    target = _target(path)
    with _place_errors(path, target):
        _check_no_folder(path, target)
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(target.parent)
        temporary = temporary_beside(target, "tmp")
        try:
            temporary.touch(exist_ok=False)
            yield temporary
            _to_disk(temporary)
            temporary.replace(target)
            _to_disk(target.parent)
        finally:
            temporary.unlink(missing_ok=True)


def check_file_place(path: str | Path) -> None:
    """Refuse, before any work is done, a place that `atomic_file` could not take.

    Raises:
        InputError: as atomic_file.
    """
    target = _target(path)
    with _place_errors(path, target):
        _check_no_folder(path, target)
        _try_to_write(target)


def check_files_apart(written: Iterable[str | Path], read: Iterable[str | Path] = ()) -> None:
    """Refuse to write over what is read, and two results to one place.

    Args:
        written: files that a run writes.
        read: files that it reads; of a folder all that mien wrote there by its manifest
            (mien.io.files.manifest), all that is there where it has none.

    Raises:
        InputError: names the place.
    """
    taken = [Path(path) for path in read]
    for path in map(Path, written):
        for other in taken:
            if _is_same(path, other):
                found = "a file that is read or written as well"
                raise InputError(path, "a place of its own", found)
            if _is_part_of(path, other):
                raise InputError(path, "a place of its own", f"a file of {other}, which is read")
        taken.append(path)


def check_side_file(path: str | Path, main: str | Path) -> None:
    """Refuse to write over somebody's file that has the name of one written beside a result.

    Args:
        path: the file beside the result; its name follows from the result's.
        main: the result; where it is there already, the file beside it is its own.

    Raises:
        InputError: names both.
    """
    if os.path.lexists(path) and not os.path.lexists(main):
        raise InputError(path, f"a free place for what goes beside {main}", "another file there")


@contextmanager
def atomic_folder(
    path: str | Path,
    *,
    replaces: Callable[[Path], bool],
    read: Iterable[str | Path] = (),
    editable: Collection[str] | None = None,
) -> Iterator[Path]:
    """A new folder that takes the place of `path` when the block ends without an error.

    The old folder is moved aside, the new one moved in, the old one deleted; where a process is
    killed between the two moves, the next that reads or writes the folder moves the old one back.

    Args:
        path: the folder; those above it are made.
        replaces: whether a folder that is already there may be replaced. An empty one always may.
        read: what the run reads, which must not lie in the folder.
        editable: given, what mien did not write into the old folder is kept in the new one
            (io.files.manifest): files at these paths, which people are meant to change, in their
            places.

    Raises:
        InputError: as check_folder_place; the place cannot be written.
    """
    check_folder_place(path, replaces=replaces, read=read)
    target = _target(path)
    with _place_errors(path, target):
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(target.parent)
        temporary = temporary_beside(target, "tmp")
        try:
            temporary.mkdir()
            yield temporary
            # What came there in the meantime must not be lost either.
            check_folder_place(path, replaces=replaces, read=read)
            before: Snapshot | None = None
            if editable is not None:
                save_manifest(temporary)
                before = keep_user_files(target, temporary, editable=editable)
            _tree_to_disk(temporary)
            _swap(temporary, target, before)
            _to_disk(target.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def check_folder_place(
    path: str | Path, *, replaces: Callable[[Path], bool], read: Iterable[str | Path] = ()
) -> None:
    """Refuse, before any work is done, a place that `atomic_folder` could not take.

    Raises:
        InputError: a file is in the way, a folder that holds something else or what is read.
    """
    target = _target(path)
    finish_replacement(target)
    with _place_errors(path, target):
        if not target.exists():
            _try_to_write(target)
            return
        if not target.is_dir():
            raise InputError(path, "a folder's name", "a file of that name")
        if any(target.iterdir()) and not replaces(target):
            raise InputError(
                path, "a new folder or one made by mien", "a folder with other things in it"
            )
        for source in (link for given in read for link in _with_links(Path(given))):
            if _target(source).is_relative_to(target):
                found = f"one with {source}" if _target(source) != target else "what is read"
                raise InputError(path, "a folder that nothing is read from", found)
        _try_to_write(target)


def _with_links(source: Path) -> Iterator[Path]:
    """What is read, and the links in it, as deep as photos lie."""
    yield source
    for pattern in ("*", "*/*"):
        yield from (path for path in source.glob(pattern) if path.is_symlink())


def _check_no_folder(path: str | Path, target: Path) -> None:
    if target.exists() and not target.is_file():
        raise InputError(path, "a file's name", "a folder" if target.is_dir() else "a device")


def _try_to_write(target: Path) -> None:
    """Make a file beside it, or where the folders above it would be made, and remove it again."""
    above = next(folder for folder in target.parents if folder.exists())
    trial = temporary_beside(above / target.name, "tmp")
    try:
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise OSError(error.errno, os.strerror(error.errno or 0), str(target)) from error


def _swap(new: Path, target: Path, before: Snapshot | None) -> None:
    """Move the new folder in.

    Args:
        new: the new folder.
        target: its place, and the old one's.
        before: of the old folder; given, what has come there since is kept.
    """
    if not target.exists():
        new.rename(target)
        return
    old = temporary_beside(target, "old")
    target.rename(old)
    try:
        new.rename(target)
    except BaseException:
        old.rename(target)
        raise
    if before is not None:
        keep_late_files(old, target, before)
    shutil.rmtree(old, ignore_errors=True)


def _target(path: str | Path) -> Path:
    """Where a link leads: the link stays and what it names is replaced."""
    return Path(os.path.realpath(check_path("output", path, "where a result goes")))


def _is_same(one: Path, other: Path) -> bool:
    """One file, be it by links or by names that the disk takes for one."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return _target(one) == _target(other)


def _is_part_of(path: Path, folder: Path) -> bool:
    """Whether a file is one that mien wrote in a folder that is read."""
    inside, above = _target(path), _target(folder)
    if not (above.is_dir() and inside.is_relative_to(above)):
        return False
    manifest = load_manifest(above)
    return inside.exists() if manifest is None else _name_in(inside, above) in manifest.files


def _name_in(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()


def _tree_to_disk(folder: Path) -> None:
    for top, _, names in os.walk(folder):
        for name in names:
            _to_disk(Path(top, name))
        _to_disk(Path(top))


def _to_disk(path: Path) -> None:
    """Write to the disk what is still in memory: a power cut must leave no empty file.

    Not every system can do that for folders, or for files of others that are linked in.
    """
    kind = path.lstat().st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
        return
    try:
        handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise


@contextmanager
def _place_errors(path: str | Path, target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in _PLACE_ERRORS or not _concerns(target, error.filename):
            raise
        reason = os.strerror(error.errno)
        raise InputError(path, "a place that can be written to", reason) from error


def _concerns(target: Path, file: str | bytes | int | None) -> bool:
    """Whether a failure at this file is one of writing the target: at it, above it or beside it."""
    if not isinstance(file, str):
        return True
    return target.is_relative_to(file) or Path(file).is_relative_to(target.parent)
