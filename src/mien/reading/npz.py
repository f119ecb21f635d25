"""Arrays from .npz files, by name: checked before they are unpacked.

Only arrays that are asked for are unpacked, and only if type, shape and size are those expected.
"""

from __future__ import annotations

import math
import struct
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import IO, Self

import numpy as np

from mien.arrays import Array, Float, Int
from mien.errors import FileFormatError, one_line
from mien.limits import LARGEST, MAX_ARRAY_BYTES, MAX_ARRAYS, MAX_ARRAYS_BYTES, MIB
from mien.reading.files import check_size, is_missing

_DAMAGED = (
    OSError,
    ValueError,
    EOFError,
    SyntaxError,
    RecursionError,
    MemoryError,
    OverflowError,
    KeyError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    TokenError,
    NotImplementedError,
    RuntimeError,
)
"""What numpy and zipfile raise for damaged bytes; the last two for unknown kinds of compression and
encryption."""

_END = struct.Struct("<4s4H2LH")
_END_64 = b"PK\x06\x07"
_ENTRY = 46
"""Bytes of an entry of the archive's directory, at least."""

Shape = tuple[int | None, ...]


class ArrayFile:
    """An .npz file whose arrays are read one by one; closed at the end of its `with` block.

    Every method raises FileFormatError, which names the file and the array: none of that name,
    another kind, shape or size than expected, a number out of range, damage.
    """

    def __init__(self, path: str | Path) -> None:
        """Raises: FileFormatError: missing, not such a file."""
        self.path = Path(path)
        self._taken = 0
        # Only a missing file is a FileFormatError: check_size has another error for folders.
        if is_missing(self.path):
            raise FileFormatError(self.path, "there is no such file")
        check_size(self.path, 2 * MAX_ARRAYS_BYTES)
        try:
            with self.path.open("rb") as stream:
                _check_directory(self.path, stream)
            self._archive = zipfile.ZipFile(self.path)
            names = self._archive.namelist()
        except _DAMAGED as error:
            raise FileFormatError(
                self.path, f"not a readable .npz file ({_summary(error)})"
            ) from None
        self._names = frozenset(name.removesuffix(".npy") for name in names)
        if len(self._names) < len(names):
            self._archive.close()
            raise FileFormatError(self.path, "not a readable .npz file (a name appears twice)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._archive.close()

    def numbers(self, name: str, shape: Shape, *, most: float = LARGEST) -> Float[Array, ...]:
        """Real numbers as float64, finite, from -most to most.

        Args:
            name: of the array.
            shape: one entry an axis; None accepts any length.
            most: the largest absolute value.
        """
        found = self._read(name, shape, "fiu", "numbers")
        right = (found >= -most) & (found <= most)
        if not right.all():
            bad = found[~right][0]
            kind = f"numbers from {-most:g} to {most:g}" if np.isfinite(bad) else "finite numbers"
            raise FileFormatError(self.path, f"expected {kind}, found {bad:g}", name)
        return found.astype(np.float64, copy=False)

    def whole(self, name: str, shape: Shape, *, below: int) -> Int[Array, ...]:
        """Whole numbers from 0 and below a limit, as int64; of any type that holds them exactly."""
        found = self._read(name, shape, "fiu", "whole numbers")
        # Compared before they are cast, which would wrap or cut them off.
        wrong = ~((found >= 0) & (found < below))
        if found.dtype.kind == "f":
            wrong |= found != np.floor(found)
        if wrong.any():
            expected = f"expected whole numbers from 0 to {below - 1}"
            raise FileFormatError(self.path, f"{expected}, found {found[wrong][0]:g}", name)
        return found.astype(np.int64)

    def texts(self, name: str) -> tuple[str, ...]:
        """A list of texts."""
        try:
            return tuple(self._read(name, (None,), "U", "texts").tolist())
        except ValueError as error:  # What is no character.
            raise FileFormatError(self.path, _summary(error), name) from None

    def _read(self, name: str, shape: Shape, kinds: str, what: str) -> Array:
        if name not in self._names:
            raise FileFormatError(self.path, "missing", name)
        try:
            entry = self._archive.getinfo(f"{name}.npy")
            with self._archive.open(entry) as stream:
                dtype, found, transposed = _header(stream)
                if dtype.hasobject or dtype.kind not in kinds:
                    raise FileFormatError(self.path, f"expected {what}, found {dtype}", name)
                if not _fits(found, shape):
                    problem = f"expected shape {_shape_text(shape)}, found {_shape_text(found)}"
                    raise FileFormatError(self.path, problem, name)
                size = math.prod(found) * dtype.itemsize
                self._count(name, size, entry.file_size)
                data = stream.read(size)
                if len(data) != size or stream.read(1):
                    raise FileFormatError(self.path, "another length than it states", name)
        except _DAMAGED as error:
            problem = f"not a readable .npz file ({_summary(error)})"
            raise FileFormatError(self.path, problem, name) from None
        array: Array = np.frombuffer(data, dtype)
        if dtype.kind == "f" and dtype.itemsize < 4:
            # The limits that numbers are compared with are beyond those of half precision.
            array = array.astype(np.float64)
        return array.reshape(found[::-1]).T if transposed else array.reshape(found)

    def _count(self, name: str, size: int, stored: int) -> None:
        """Refuse what is too large before it is unpacked."""
        self._taken += size
        most = min(MAX_ARRAY_BYTES, MAX_ARRAYS_BYTES - self._taken + size)
        if max(size, stored) > most:
            problem = f"expected at most {most / MIB:g} MiB, found {max(size, stored) / MIB:.1f}"
            raise FileFormatError(self.path, problem, name)


def _check_directory(path: Path, stream: IO[bytes]) -> None:
    """Refuse an archive of so many entries that listing them would take long.

    Raises:
        FileFormatError: a single array.
        ValueError: no archive, too many entries.
    """
    if stream.read(6) == b"\x93NUMPY":
        raise FileFormatError(path, "expected an .npz file, found a single array")
    length = stream.seek(0, 2)
    stream.seek(max(0, length - (1 << 16) - _END.size))
    tail = stream.read()
    place = tail.rfind(b"PK\x05\x06")
    if place < 0 or len(tail) - place < _END.size:
        raise ValueError("no archive, or cut off")
    *_, entries, size, _, _ = _END.unpack_from(tail, place)
    if entries > MAX_ARRAYS or size > MAX_ARRAYS * 2 * _ENTRY or _END_64 in tail[:place][-20:]:
        raise ValueError(f"more than {MAX_ARRAYS} arrays")


def _header(stream: IO[bytes]) -> tuple[np.dtype, tuple[int, ...], bool]:
    """Type, shape, and whether the first axis varies fastest. Raises: ValueError and the like."""
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, transposed, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, transposed, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise ValueError(f"an array of version {version}")
    if not all(type(length) is int and length >= 0 for length in shape):
        raise ValueError("an array of negative length")
    return dtype, shape, transposed


def _fits(found: tuple[int, ...], shape: Shape) -> bool:
    return len(found) == len(shape) and all(
        expected is None or length == expected
        for length, expected in zip(found, shape, strict=True)
    )


def _shape_text(shape: Shape) -> str:
    return f"({', '.join('any' if length is None else str(length) for length in shape)})"


def _summary(error: BaseException) -> str:
    return one_line(error)[:80] or type(error).__name__
