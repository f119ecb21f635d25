from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from mien.cli.progress import terminal_progress
from mien.numeric.kernels.cache import kernel_folders


def test_bars_are_drawn_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal_progress(quiet=False) as progress:
        progress("Finding faces", 0, 2)
        progress("Finding faces", 2, 2)
        progress("Thinking", 0, 0)
    seen = capsys.readouterr()
    assert seen.out == ""
    assert "Finding faces" in seen.err
    assert "Thinking" in seen.err


def test_frames_a_second_of_stages_counted_in_frames(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal_progress(quiet=False, counted=("Tracking",)) as progress:
        for done in range(60, 101):
            progress("Tracking", done, 100)
            progress("Thinking", done, 100)
            time.sleep(0.002)
    tracking, thinking = capsys.readouterr().err.strip().splitlines()[-2:]
    found = re.fullmatch(r"Tracking .* left 0:00:00 ([\d.]+) frames/s\s*", tracking)
    assert found, tracking
    assert float(found[1]) < 600, "the frames that an earlier run had done do not count"
    assert "frames/s" not in thinking


def test_quiet_draws_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal_progress(quiet=True) as progress:
        progress("Finding faces", 1, 2)
    assert capsys.readouterr() == ("", "")


def test_nothing_to_do_draws_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal_progress(quiet=False):
        pass
    assert capsys.readouterr() == ("", "")


def test_an_error_ends_the_bars(capsys: pytest.CaptureFixture[str]) -> None:
    def fail() -> None:
        with terminal_progress(quiet=False) as progress:
            progress("Finding faces", 1, 2)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert capsys.readouterr().err.endswith("\n")


def test_the_first_run_says_that_it_compiles(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def said() -> str:
        kernel_folders.cache_clear()
        with terminal_progress(quiet=False) as progress:
            progress("Stage", 1, 1)
        return " ".join(capsys.readouterr().err.split())

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert "First run: compiling" in said()
    (folder,) = tmp_path.iterdir()
    (folder / "kernel.nbi").touch()
    assert "ompiling" not in said()
    monkeypatch.setattr("mien.numeric.kernels.cache.kernel_folders", lambda: ())
    with terminal_progress(quiet=False) as progress:
        progress("Stage", 1, 1)
    assert "NUMBA_CACHE_DIR may name one." in " ".join(capsys.readouterr().err.split())
    kernel_folders.cache_clear()
