"""Results appear whole or not at all.

Everything is written under a temporary name beside its place and renamed at the end, so that a
run that fails or is killed leaves what was there before.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mien.errors import InputError

# Failures of the place that is written to; any other is the caller's own and passes through.
_PLACE_ERRORS = {
    errno.EACCES,
    errno.EDQUOT,
    errno.EEXIST,
    errno.EFBIG,
    errno.ENAMETOOLONG,
    errno.ENOSPC,
    errno.ENOTDIR,
    errno.EPERM,
    errno.EROFS,
}


class _NothingWritten(Exception):
    """Leaves what is in a place as it was."""


@contextmanager
def atomic_file(path: str | Path) -> Iterator[Path]:
    """A path to write to, which takes the place of `path` when the block ends without an error.

    Folders above are made. The temporary name has another suffix: say the format when writing.

    Raises: InputError: a folder or a device is in the way, the place cannot be written.
    """
    target = _target(path)
    if target.exists() and not target.is_file():
        raise InputError(path, "a file's name", "a folder" if target.is_dir() else "a device")
    with _placing(path, target):
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = _beside(target, "tmp")
        try:
            temporary.touch(exist_ok=False)
            yield temporary
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)


def check_file_place(path: str | Path) -> None:
    """Refuse, before any work is done, a place that `atomic_file` could not take.

    Folders above are made. Raises: InputError: as atomic_file.
    """
    with suppress(_NothingWritten), atomic_file(path):
        raise _NothingWritten


def check_files_apart(written: Iterable[str | Path], read: Iterable[str | Path] = ()) -> None:
    """Refuse to write over what is read, and two results to one place.

    Raises: InputError: names the place.
    """
    taken = {Path(path).resolve() for path in read}
    for path in written:
        if Path(path).resolve() in taken:
            raise InputError(path, "a place of its own", "a file that is read or written as well")
        taken.add(Path(path).resolve())


@contextmanager
def atomic_folder(path: str | Path, *, replaces: Callable[[Path], bool]) -> Iterator[Path]:
    """A new folder that takes the place of `path` when the block ends without an error.

    The old folder is moved aside, the new one moved in, the old one deleted. A process killed
    between the two moves leaves the old one beside its place, as `.NAME.*.old`.

    Args:
        path: the folder; those above it are made.
        replaces: says of a folder already there whether it may be replaced. An empty one may.
    Raises: InputError: as check_folder_place; the place cannot be written.
    """
    check_folder_place(path, replaces=replaces)
    target = _target(path)
    with _placing(path, target):
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = _beside(target, "tmp")
        try:
            temporary.mkdir()
            yield temporary
            _swap(temporary, target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def check_folder_place(path: str | Path, *, replaces: Callable[[Path], bool]) -> None:
    """Refuse, before any work is done, a place that `atomic_folder` could not take.

    Raises: InputError: a file is in the way, or a folder that holds something else.
    """
    target = _target(path)
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(path, "a folder's name", "a file of that name")
    if any(target.iterdir()) and not replaces(target):
        raise InputError(
            path, "a new folder or one made by mien", "a folder with other things in it"
        )


def _swap(new: Path, target: Path) -> None:
    if not target.exists():
        new.rename(target)
        return
    old = _beside(target, "old")
    target.rename(old)
    try:
        new.rename(target)
    except BaseException:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _target(path: str | Path) -> Path:
    """Where a link leads: the link stays and what it names is replaced."""
    return Path(os.path.realpath(path))


def _beside(target: Path, suffix: str) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.{suffix}")


@contextmanager
def _placing(path: str | Path, target: Path) -> Iterator[None]:
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
