"""Files of arrays, whole, damaged and made to do harm."""

from __future__ import annotations

import io
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from memory import peak_bytes
from mien.errors import FileFormatError, InputError
from mien.limits import MAX_ARRAY_BYTES, MAX_ARRAYS
from mien.reading.npz import ArrayFile

GEOMETRIES = np.arange(600.0).reshape(50, 6, 2)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "statistics.npz"
    np.savez_compressed(path, geometries=GEOMETRIES)
    return path


def geometries(path: Path) -> np.ndarray:
    with ArrayFile(path) as arrays:
        return arrays.numbers("geometries", (None, 6, 2))


def test_arrays_come_back(path: Path) -> None:
    np.testing.assert_array_equal(geometries(path), GEOMETRIES)
    np.savez(path, geometries=np.asfortranarray(GEOMETRIES.astype(">f4")))
    np.testing.assert_array_equal(geometries(path), GEOMETRIES)
    with (
        ArrayFile(path) as arrays,
        pytest.raises(FileFormatError, match=r"statistics\.npz: fades: missing"),
    ):
        arrays.numbers("fades", (None,))


def test_what_is_no_archive_is_refused(path: Path, tmp_path: Path) -> None:
    with path.open("wb") as stream:
        np.save(stream, GEOMETRIES)
    with pytest.raises(FileFormatError, match=r"statistics\.npz: expected an \.npz file, found a"):
        ArrayFile(path)
    with pytest.raises(FileFormatError, match=r"none\.npz: there is no such file"):
        ArrayFile(tmp_path / "none.npz")
    with pytest.raises(InputError, match=r"expected a readable file, got File name too long"):
        ArrayFile(tmp_path / ("x" * 300) / "none.npz")  # A place that cannot be looked into.
    with pytest.raises(InputError, match=r"expected a readable file, got a folder"):
        ArrayFile(tmp_path)


def test_changed_bytes_are_refused_or_harmless(path: Path) -> None:
    """Damage anywhere: in the archive's headers, in numpy's, in what is compressed."""
    whole, rng = path.read_bytes(), np.random.default_rng(3)
    told = 0
    for _ in range(1000):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            geometries(path)
        except FileFormatError:
            told += 1
    assert told > 500


@pytest.mark.parametrize(
    ("array", "problem"),
    [
        (GEOMETRIES.astype(complex), "expected numbers, found complex128"),
        (GEOMETRIES.astype(str), "expected numbers, found <U"),
        (GEOMETRIES.astype(object), "expected numbers, found object"),
        (GEOMETRIES.astype("m8[s]"), r"expected numbers, found timedelta64\[s\]"),
        (GEOMETRIES > 3, "expected numbers, found bool"),
        (GEOMETRIES.astype([("x", "f8")]), r"expected numbers, found \[\("),
        (GEOMETRIES[:, :5], r"expected shape \(any, 6, 2\), found \(50, 5, 2\)"),
        (GEOMETRIES[0], r"expected shape \(any, 6, 2\), found \(6, 2\)"),
        (np.where(GEOMETRIES == 7, np.nan, 0), "expected finite numbers, found nan"),
        (np.where(GEOMETRIES == 7, -np.inf, 0), "expected finite numbers, found -inf"),
        (
            np.where(GEOMETRIES == 7, -1e30, 0),
            r"expected numbers from -1e\+09 to 1e\+09, found -1e",
        ),
    ],
)
def test_other_kinds_of_numbers_are_refused(path: Path, array: np.ndarray, problem: str) -> None:
    np.savez(path, geometries=array)
    with pytest.raises(FileFormatError, match=rf"statistics\.npz: geometries: {problem}"):
        geometries(path)


@pytest.mark.parametrize("kind", ["u1", "i2", "f2", "f4", "f8", ">i4"])
def test_whole_numbers_of_any_kind_are_the_same(path: Path, kind: str) -> None:
    np.savez(path, triangles=np.arange(12).reshape(4, 3).astype(kind))
    with ArrayFile(path) as arrays:
        found = arrays.whole("triangles", (None, 3), below=12)
    np.testing.assert_array_equal(found, np.arange(12).reshape(4, 3))
    assert found.dtype == np.int64


@pytest.mark.parametrize("wrong", [0.5, -1.0, 12.0, 2.0**32, 1e300, np.nan, np.inf])
def test_no_index_is_cut_off_wrapped_or_out_of_range(path: Path, wrong: float) -> None:
    triangles = np.arange(12.0).reshape(4, 3)
    triangles[2, 1] = wrong
    np.savez(path, triangles=triangles)
    with (
        ArrayFile(path) as arrays,
        pytest.raises(FileFormatError, match=r"triangles: expected whole numbers from 0 to 11, f"),
    ):
        arrays.whole("triangles", (None, 3), below=12)


def write_claiming(path: Path, shape: tuple[int, ...], data: bytes) -> None:
    """An array whose header claims a shape that the data does not have."""
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("geometries.npy", stream.getvalue() + data)


def test_a_header_that_states_other_sizes_is_refused(path: Path) -> None:
    write_claiming(path, (10**12 // 12, 6, 2), b"")
    with pytest.raises(FileFormatError, match=r"geometries: expected at most 512 MiB, found 7629"):
        geometries(path)
    write_claiming(path, (10, 6, 2), bytes(100))
    with pytest.raises(FileFormatError, match="geometries: another length than it states"):
        geometries(path)
    write_claiming(path, (-10, 6, 2), bytes(960))
    with pytest.raises(FileFormatError, match=r"geometries: not a readable \.npz file"):
        geometries(path)


def test_an_array_that_is_not_read_is_never_unpacked(path: Path) -> None:
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open("extra.npy", "w", force_zip64=True) as stream,
    ):
        for _ in range(1 << 10):
            stream.write(bytes(1 << 20))
    before, start = peak_bytes(), time.perf_counter()
    np.testing.assert_array_equal(geometries(path), GEOMETRIES)
    with (
        ArrayFile(path) as arrays,
        pytest.raises(FileFormatError, match=r"extra: (not a readable|expected at most)"),
    ):
        arrays.numbers("extra", (None,))
    assert time.perf_counter() - start < 1
    assert peak_bytes() - before < MAX_ARRAY_BYTES / 10


def test_an_array_that_unpacks_to_more_than_it_states_is_refused(path: Path) -> None:
    write_claiming(path, (10, 6, 2), bytes(1 << 28))
    start = time.perf_counter()
    with pytest.raises(FileFormatError, match="geometries: another length than it states"):
        geometries(path)
    assert time.perf_counter() - start < 1


def test_an_archive_of_very_many_arrays_is_refused(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(MAX_ARRAYS + 1):
            archive.writestr(f"a{number}.npy", b"")
    with pytest.raises(FileFormatError, match=r"not a readable \.npz file \(more than 10000 arr"):
        ArrayFile(path)


def test_an_array_of_one_name_twice_is_refused(path: Path) -> None:
    with (
        pytest.warns(UserWarning, match="Duplicate name"),
        zipfile.ZipFile(path, "a") as archive,
    ):
        archive.writestr("geometries.npy", b"")
    with pytest.raises(FileFormatError, match="a name appears twice"):
        ArrayFile(path)
