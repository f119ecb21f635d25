"""Compiled kernels are kept where a folder can be written; their files are verified."""

from __future__ import annotations

import os
import pickle
import stat
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mien.numeric.kernels import cache as kernel_files
from mien.numeric.kernels.cache import KernelFiles, kernel_folders, kernels_are_kept


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package, a home and a folder for temporary files of this test's own."""
    for name in ("package", "home", "temporary"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(kernel_files, "PACKAGE", tmp_path / "package")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    for variable in ("HOME", "USERPROFILE", "LOCALAPPDATA"):
        monkeypatch.setenv(variable, str(tmp_path / "home"))
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    kernel_folders.cache_clear()
    yield tmp_path
    kernel_folders.cache_clear()


def closed(folder: Path) -> None:
    """Put a file where the folder was: nothing can be made in it, not even by root."""
    folder.rmdir()
    folder.touch()


def found_from(places: Path) -> list[str]:
    kernel_folders.cache_clear()
    return [folder.relative_to(places).parts[0] for folder in kernel_folders()]


def test_the_package_itself_is_the_usual_place(places: Path) -> None:
    assert found_from(places) == ["package"]


def test_a_package_that_cannot_be_written_to_is_read(places: Path) -> None:
    (places / "package" / "__pycache__").touch()
    assert found_from(places) == ["home", "package"]
    closed_home = places / "home"
    for folder in sorted(closed_home.rglob("*"), reverse=True):
        folder.rmdir()
    closed(closed_home)
    assert found_from(places) == ["temporary", "package"]
    for folder in (places / "temporary").iterdir():
        folder.rmdir()
    closed(places / "temporary")
    assert found_from(places) == []
    assert not kernels_are_kept()


def test_numba_cache_dir_comes_first_and_alone(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(places / "asked"))
    assert found_from(places) == ["asked"]


def test_numba_cache_dir_that_is_a_file_is_passed_over(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (places / "asked").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(places / "asked"))
    assert found_from(places) == ["package"]


@pytest.mark.skipif(os.name == "nt", reason="temporary files are each user's own there")
@pytest.mark.parametrize("trap", ["open to others", "a link"])
def test_temporary_folders_that_others_could_fill_are_not_used(places: Path, trap: str) -> None:
    (places / "package" / "__pycache__").touch()
    closed(places / "home")
    (folder,) = (path for path in _temporary_folders(places) if path.is_dir())
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    if trap == "a link":
        folder.rename(places / "elsewhere")
        folder.symlink_to(places / "elsewhere")
    else:
        folder.chmod(0o755)
    assert found_from(places) == []


def _temporary_folders(places: Path) -> Iterator[Path]:
    assert found_from(places) == ["temporary", "package"]
    return (places / "temporary").iterdir()


@pytest.fixture
def files(tmp_path: Path) -> KernelFiles:
    return KernelFiles(tmp_path, "kernel-1", b"stamp", pickle.dumps)


def test_what_is_saved_is_loaded_by_its_key(files: KernelFiles) -> None:
    assert files.load("int") is None
    files.save("int", [1])
    files.save("float", [2.0])
    assert (files.load("int"), files.load("float"), files.load("bool")) == ([1], [2.0], None)
    files.clear()
    assert files.load("int") is None


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["empty", "half", "one byte", "longer", "another's"])
def test_damaged_files_are_thrown_away(files: KernelFiles, suffix: str, damage: str) -> None:
    files.save("int", list(range(100)))
    (path,) = files.folder.glob(f"*.{suffix}")
    content = path.read_bytes()
    middle = len(content) // 2
    replace(files, base="kernel-2").save("int", "of another kernel")
    (foreign,) = files.folder.glob(f"kernel-2*.{suffix}")
    path.write_bytes(
        {
            "empty": b"",
            "half": content[:middle],
            "one byte": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
            "longer": content + b"\0",
            "another's": foreign.read_bytes(),
        }[damage]
    )
    assert files.load("int") is None
    assert not path.exists()
    files.save("int", "anew")
    assert files.load("int") == "anew"


def test_files_of_another_source_are_never_unpickled(
    files: KernelFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.save("int", 1)
    changed = replace(files, stamp=b"changed")
    with monkeypatch.context() as patch:
        patch.setattr("pickle.loads", pytest.fail)
        assert changed.load("int") is None
    changed.save("int", 2)
    assert changed.load("int") == 2


def test_two_processes_at_once_keep_their_own(files: KernelFiles) -> None:
    """Each reads the index before the other has written it."""
    index = files.folder / "kernel-1.nbi"
    files.save("int", "for int")
    earlier = index.read_bytes()
    index.unlink()
    files.save("float", "for float")
    assert files.load("float") == "for float"
    index.write_bytes(earlier)
    assert (files.load("int"), files.load("float")) == ("for int", None)


def test_a_process_that_dies_leaves_the_former_file(
    files: KernelFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.save("int", 1)

    def die(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", die)
    with pytest.raises(KeyboardInterrupt):
        files.save("int", 2)
    monkeypatch.undo()
    assert files.load("int") == 1
    assert not list(files.folder.glob("*.tmp"))


def test_what_dead_processes_left_is_removed_once_it_is_old(files: KernelFiles) -> None:
    dead = files.folder / "kernel-1.abc.nbc.abc.tmp"
    living = files.folder / "kernel-1.def.nbc.def.tmp"
    other = files.folder / "kernel-12.nbi"
    for path in (dead, living, other):
        path.touch()
    for path in (dead, other):
        os.utime(path, (1e9, 1e9))
    files.save("int", 1)
    assert not dead.exists()
    assert living.exists()
    assert other.exists()
