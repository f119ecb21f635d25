"""The cache of compiled kernels between runs: its folders, and files that survive crashes.

Numba's own cache needs a writable folder, trusts every byte in it, and lets two processes that
compile the same kernel for different types write to one file.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import stat
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[2]
_DIGEST_BYTES = hashlib.sha256().digest_size
_STALE_SECONDS = 3600.0  # no process is still writing a file of that age


@cache
def kernel_folders() -> tuple[Path, ...]:
    """Folders to read compiled kernels from; the first is written to; () where none can be.

    In order: NUMBA_CACHE_DIR, the package's own __pycache__, the user's folder for caches, a
    private one among temporary files. A package that cannot be written to is still read: its
    installer may have run it once.
    """
    own = PACKAGE / "__pycache__"
    passed: tuple[Path, ...] = ()
    for find in (_asked_for, lambda: own, _users_own, _temporary):
        with suppress(OSError):
            folder = find()
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                tempfile.TemporaryFile(dir=folder).close()
                return (folder, *passed)
        passed = (own,) if find is not _asked_for else ()
    return ()


def kernels_are_kept() -> bool:
    """Whether there are compiled kernels of an earlier run."""
    return any(next(folder.glob("*.nbi"), None) is not None for folder in kernel_folders()[:2])


def _asked_for() -> Path | None:
    place = os.environ.get("NUMBA_CACHE_DIR")
    return Path(place).absolute() / _name() if place else None


def _users_own() -> Path | None:
    home = Path(os.path.expanduser("~"))
    if sys.platform == "win32":
        place = Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
    elif sys.platform == "darwin":
        place = home / "Library" / "Caches"
    else:
        place = Path(os.environ.get("XDG_CACHE_HOME", home / ".cache"))
    return place / "mien" / _name() if place.is_absolute() else None


def _temporary() -> Path | None:
    """A folder of the user's alone: code is loaded from it, so nobody else may write to it."""
    if sys.platform == "win32":
        return Path(tempfile.gettempdir()) / _name()  # within the user's own folders
    folder = Path(tempfile.gettempdir()) / f"{_name()}-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    return folder if private and found.st_uid == os.getuid() else None


def _name() -> str:
    """A folder name of this installation, so that others do not share it."""
    return f"mien-{hashlib.sha256(os.fsencode(PACKAGE)).hexdigest()[:16]}"


@dataclass(frozen=True)
class KernelFiles:
    """The machine code of one kernel: an index of signatures, and a file for each.

    Each file begins with a digest of its name, the kernel's source and the rest of the file. Files
    that are damaged, of an earlier source or of another version are deleted and count as missing.

    Attributes:
        folder: that holds them.
        base: the beginning of their names, the kernel's own.
        stamp: changes with the source and with versions.
        dump: serializes for pickle.
    """

    folder: Path
    base: str
    stamp: bytes
    dump: Callable[[Any], bytes]

    def load(self, key: Any) -> Any:
        """The data saved for this key, or None."""
        name = self._load_index().get(key)
        return None if name is None else self._read(self.folder / name)

    def save(self, key: Any, data: Any) -> None:
        """Save data, which is not None. Raises: OSError."""
        # A name of its own: two processes may be doing this at once.
        name = f"{self.base}.{uuid.uuid4().hex[:16]}.nbc"
        self._write(self.folder / name, data)
        self._write(self._index, {**self._load_index(), key: name})
        for path in self._stale_files():
            path.unlink(missing_ok=True)

    def clear(self) -> None:
        """Delete everything. Raises: OSError."""
        self._write(self._index, {})

    @property
    def _index(self) -> Path:
        return self.folder / f"{self.base}.nbi"

    def _load_index(self) -> dict[Any, str]:
        return self._read(self._index) or {}

    def _stale_files(self) -> Iterator[Path]:
        """Files of processes that died, and those that no index names any more."""
        used = {self._index.name, *self._load_index().values()}
        for path in self.folder.glob(f"{self.base}.*"):
            if path.name not in used and time.time() - path.stat().st_mtime > _STALE_SECONDS:
                yield path

    def _read(self, path: Path) -> Any:
        try:
            content = path.read_bytes()
        except OSError:
            return None
        digest, rest = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if digest == self._digest(path, rest):
            return pickle.loads(rest)
        with suppress(OSError):
            path.unlink()
        return None

    def _write(self, path: Path, data: Any) -> None:
        rest = self.dump(data)
        temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}.tmp")
        try:
            temporary.write_bytes(self._digest(path, rest) + rest)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)

    def _digest(self, path: Path, rest: bytes) -> bytes:
        return hashlib.sha256(b"\0".join((self.stamp, path.name.encode(), rest))).digest()
