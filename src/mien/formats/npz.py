"""Arrays from .npz files, whose complaints name the file and the array."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError

import numpy as np

from mien.arrays import Array
from mien.errors import FileFormatError

_DAMAGED = (
    OSError,
    ValueError,
    EOFError,
    zipfile.BadZipFile,
    zlib.error,
    TokenError,
    NotImplementedError,
    RuntimeError,
)
"""What numpy and zipfile raise for changed bytes; the last two for kinds of compression and locks
that they do not know."""


class NamedArrays(dict[str, Array]):
    """Arrays by name that says which file lacks one."""

    def __init__(self, path: Path, arrays: Mapping[str, Array]) -> None:
        super().__init__(arrays)
        self.path = path

    def __missing__(self, key: str) -> Array:
        raise FileFormatError(self.path, "missing", key)


def read_arrays(path: Path) -> NamedArrays:
    """All arrays of a file, by name; nothing is unpickled.

    Raises: FileFormatError: missing, not such a file; later, for an array that it lacks.
    """
    try:
        # Opened here: numpy leaves the file open when it is no archive.
        with path.open("rb") as stream:
            file = np.load(stream, allow_pickle=False)
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise FileFormatError(path, "expected an .npz file, found a single array")
            with file:
                return NamedArrays(path, {name: file[name] for name in file.files})
    except FileNotFoundError:
        raise FileFormatError(path, "there is no such file") from None
    except _DAMAGED as error:
        raise FileFormatError(path, f"not a readable .npz file ({error})") from None
