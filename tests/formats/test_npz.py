"""Files of arrays, whole and damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mien.errors import FileFormatError
from mien.formats.npz import read_arrays

GEOMETRIES = np.arange(600.0).reshape(50, 6, 2)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "statistics.npz"
    np.savez_compressed(path, geometries=GEOMETRIES)
    return path


def test_arrays_come_back(path: Path) -> None:
    arrays = read_arrays(path)
    np.testing.assert_array_equal(arrays["geometries"], GEOMETRIES)
    with pytest.raises(FileFormatError, match=r"statistics\.npz: fades: missing"):
        arrays["fades"]


def test_a_single_array_is_no_archive(path: Path) -> None:
    with path.open("wb") as stream:
        np.save(stream, GEOMETRIES)
    with pytest.raises(FileFormatError, match=r"statistics\.npz: expected an \.npz file, found a"):
        read_arrays(path)


def test_changed_bytes_are_told_of_or_harmless(path: Path) -> None:
    """Damage anywhere: in the archive's headers, in numpy's, in what is compressed."""
    whole, rng = path.read_bytes(), np.random.default_rng(3)
    told = 0
    for _ in range(1000):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_arrays(path)
        except FileFormatError:
            told += 1
    assert told > 500
