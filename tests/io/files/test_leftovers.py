"""What dead runs left goes, what living ones write stays."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mien.io.files import leftovers
from mien.io.files.atomic import atomic_file, atomic_folder
from mien.io.files.leftovers import FOREIGN_RUN_DAYS, finish_replacement, temporary_beside
from mien.io.head.head_folder import load_head

KILLED = """
import os, signal, sys
from pathlib import Path
from mien.io.files.atomic import atomic_file, atomic_folder
place = Path(sys.argv[1])
if sys.argv[2] == "file":
    with atomic_file(place) as temporary:
        temporary.write_bytes(bytes(100_000))
        os.kill(os.getpid(), signal.SIGKILL)
with atomic_folder(place, replaces=lambda folder: True) as temporary:
    (temporary / "inside").mkdir()
    (temporary / "inside" / "part").write_bytes(bytes(100_000))
    if sys.argv[2] == "between":
        rename = Path.rename
        def dies_at_the_second(source, target):
            if source.suffix == ".tmp":
                os.kill(os.getpid(), signal.SIGKILL)
            return rename(source, target)
        Path.rename = dies_at_the_second
    else:
        os.kill(os.getpid(), signal.SIGKILL)
"""


def kill_a_run(place: Path, moment: str) -> None:
    """A process that is killed while it writes; what it leaves stays."""
    subprocess.run([sys.executable, "-c", KILLED, str(place), moment], check=False)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def always(folder: Path) -> bool:
    return True


@pytest.fixture(autouse=True)
def as_in_a_new_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leftovers, "_cleaned", set())


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
@pytest.mark.parametrize("moment", ["file", "folder"])
def test_the_next_run_removes_what_a_killed_one_left(tmp_path: Path, moment: str) -> None:
    for _ in range(3):
        kill_a_run(tmp_path / "result", moment)
        # Each has removed what the one before it left.
        assert len(names(tmp_path)) == 1
    with atomic_file(tmp_path / "another") as temporary:
        temporary.write_text("whole")
    assert names(tmp_path) == ["another"]


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
def test_a_folder_moved_aside_by_a_killed_run_round_trips(tmp_path: Path) -> None:
    place = tmp_path / "head"
    place.mkdir()
    (place / "head.json").write_text("old")
    kill_a_run(place, "between")
    assert "head" not in names(tmp_path), "or the moment was another one"
    with pytest.raises(Exception, match=r"head\.json"):  # it is no head, but there again
        load_head(place)
    assert (place / "head.json").read_text() == "old"
    with atomic_folder(place, replaces=always) as temporary:
        (temporary / "new").write_text("")
    assert names(tmp_path) == ["head"]
    assert names(place) == ["new"]


def test_of_two_the_one_in_place_counts(tmp_path: Path) -> None:
    aside = temporary_beside(tmp_path / "head", "old")
    for folder in (aside, tmp_path / "head"):
        folder.mkdir()
    (tmp_path / "head" / "new").write_text("")
    leftovers._own.clear()
    finish_replacement(tmp_path / "other")
    assert aside.exists(), "another folder's"
    finish_replacement(tmp_path / "head")
    assert names(tmp_path) == ["head"]
    assert names(tmp_path / "head") == ["new"]


def test_temporary_files_of_running_processes_stay(tmp_path: Path) -> None:
    with atomic_file(tmp_path / "mine") as own:
        leftovers._cleaned.clear()
        # The parent process runs this test, so it is alive.
        others = tmp_path / own.name.replace(f"-{os.getpid()}-", f"-{os.getppid()}-")
        others.write_text("half")
        with atomic_file(tmp_path / "more"):
            assert own.exists()
            assert others.exists()
    assert names(tmp_path) == sorted(["mine", "more", others.name])


def test_a_number_that_another_process_has_by_now(tmp_path: Path) -> None:
    left = temporary_beside(tmp_path / "x", "tmp")
    left = tmp_path / left.name.replace(f"-{os.getpid()}-", f"-{os.getppid()}-")
    left.write_text("half")
    long_ago = time.time() - 1e6  # before that process began
    os.utime(left, (long_ago, long_ago))
    with atomic_file(tmp_path / "y"):
        assert not left.exists()


def test_of_other_machines_after_a_day(tmp_path: Path) -> None:
    _, target, _, pid, _ = temporary_beside(tmp_path / "x", "tmp").name.split("-")
    new, old = (tmp_path / f".mien-{target}-00000000-{pid}-0000000{i}.tmp" for i in (1, 2))
    for path in (new, old):
        path.write_text("half")
    past = time.time() - 1.1 * FOREIGN_RUN_DAYS * 86_400
    os.utime(old, (past, past))
    with atomic_file(tmp_path / "y"):
        assert new.exists()
        assert not old.exists()


def test_files_of_similar_names_stay(tmp_path: Path) -> None:
    others = [".mien-notes.tmp", ".mien-files.json", ".head.1a2b3c4d.tmp"]
    for name in others:
        (tmp_path / name).write_text("mine")
    with atomic_file(tmp_path / "y"):
        pass
    assert names(tmp_path) == sorted([*others, "y"])


def test_names_as_long_as_names_can_be(tmp_path: Path) -> None:
    for name in ("n" * 245, "ü" * 127):
        with atomic_file(tmp_path / name) as temporary:
            temporary.write_text("whole")
        assert (tmp_path / name).read_text() == "whole"
    with atomic_folder(tmp_path / ("f" * 250), replaces=always) as temporary:
        (temporary / "a").write_text("")
    assert names(tmp_path / ("f" * 250)) == ["a"]
