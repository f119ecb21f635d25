"""Temporary files beside results, and what is left of them by runs that were killed.

The name of one holds which run made it (a hash of the machine's name, the process), so that a run
removes what killed ones left, and nothing of those that still write.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
import time
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Literal

Kind = Literal["tmp", "old"]
"""A result that is being written; an old folder that is moved aside while the new one moves in."""

FOREIGN_RUN_DAYS = 1.0
"""Whether a process of another machine is still running cannot be found out: a file of its that has
not changed for so long is taken for a leftover."""

_NAME = re.compile(
    r"\.mien-(?P<target>[0-9a-f]{8})-(?P<host>[0-9a-f]{8})-(?P<pid>\d+)-[0-9a-f]{8}"
    r"\.(?P<kind>tmp|old)"
)
_CLOCK_SLACK = 2.0  # seconds by which file times and process times may differ

_own: set[str] = set()
_cleaned: set[Path] = set()


def temporary_beside(target: Path, kind: Kind) -> Path:
    """A free name in the target's folder. It is short, as the target's may be as long as can be."""
    token = secrets.token_hex(4)
    name = f".mien-{_hash(target.name)}-{_hash(socket.gethostname())}-{os.getpid()}-{token}.{kind}"
    _own.add(name)
    return target.with_name(name)


def remove_leftovers(folder: Path) -> None:
    """Remove the temporary files of killed runs in a folder, once a run."""
    if folder in _cleaned:
        return
    _cleaned.add(folder)
    for path, match in _temporary_files(folder):
        if match["kind"] == "tmp" and _has_ended(path, match):
            _remove(path)


def finish_replacement(target: Path) -> None:
    """Finish the replacement of a folder by a run that was killed in the middle of it.

    The old folder, which was moved aside, comes back unless the new one has moved in; then it is
    removed.
    """
    for path, match in _temporary_files(target.parent):
        aside = match["kind"] == "old" and match["target"] == _hash(target.name)
        if aside and _has_ended(path, match):
            if target.exists():
                _remove(path)
            else:
                with suppress(OSError):
                    path.rename(target)


def _temporary_files(folder: Path) -> list[tuple[Path, re.Match[str]]]:
    with suppress(OSError):
        matches = [(folder / name, _NAME.fullmatch(name)) for name in os.listdir(folder)]
        return [(path, match) for path, match in matches if match]
    return []


def _has_ended(path: Path, match: re.Match[str]) -> bool:
    """Whether the run that made this file has ended; when in doubt, it has not."""
    try:
        touched = path.lstat().st_mtime
    except OSError:
        return False
    if match["host"] != _hash(socket.gethostname()):
        return time.time() - touched > FOREIGN_RUN_DAYS * 86_400
    pid = int(match["pid"])
    if pid == os.getpid():
        return path.name not in _own
    import psutil

    try:
        # The process that has the number now may be a younger one.
        return bool(psutil.Process(pid).create_time() > touched + _CLOCK_SLACK)
    except psutil.NoSuchProcess:
        return True
    except psutil.Error:
        return False


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _hash(text: str) -> str:
    return sha256(os.fsencode(text)).hexdigest()[:8]
