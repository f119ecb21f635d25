"""Temporary files beside results: their names, and what dead runs left of them.

A name tells the run that made it (a hash of the machine's name, the process), so that a run removes
what dead ones left and nothing of those that still write.
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
"""A result that is being written; a folder that is moved aside while its successor moves in."""

DAYS_OF_OTHERS = 1.0
"""Whether a process of another machine lives cannot be asked: what it has left untouched for so
long is a dead run's."""

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
    """Remove the temporary files of dead runs in a folder, once a run."""
    if folder in _cleaned:
        return
    _cleaned.add(folder)
    for path, match in _temporary_in(folder):
        if match["kind"] == "tmp" and _is_dead(path, match):
            _remove(path)


def put_back(target: Path) -> None:
    """Finish what a run began that died while it replaced this folder.

    One that was moved aside comes back where its successor has not moved in, and is removed where
    it has.
    """
    for path, match in _temporary_in(target.parent):
        aside = match["kind"] == "old" and match["target"] == _hash(target.name)
        if aside and _is_dead(path, match):
            if target.exists():
                _remove(path)
            else:
                with suppress(OSError):
                    path.rename(target)


def _temporary_in(folder: Path) -> list[tuple[Path, re.Match[str]]]:
    with suppress(OSError):
        matches = [(folder / name, _NAME.fullmatch(name)) for name in os.listdir(folder)]
        return [(path, match) for path, match in matches if match]
    return []


def _is_dead(path: Path, match: re.Match[str]) -> bool:
    """Whether the run that made this file is over; when in doubt, it is not."""
    try:
        touched = path.lstat().st_mtime
    except OSError:
        return False
    if match["host"] != _hash(socket.gethostname()):
        return time.time() - touched > DAYS_OF_OTHERS * 86_400
    pid = int(match["pid"])
    if pid == os.getpid():
        return path.name not in _own
    import psutil

    try:
        # A younger process has but inherited the number.
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
