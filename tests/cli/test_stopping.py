"""A run that is stopped, whenever and however, says nothing and leaves what was there."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from terminal import Built

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are others there")


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """A suite in the background ignores Ctrl-C, and so would the runs that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def started(*arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "mien", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_while_it_writes(stop: signal.Signals, built: Built, tmp_path: Path) -> None:
    """Something is there and is half-way replaced: the old one stays, and nothing beside it."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.mp4").write_bytes(b"old")
    take = tmp_path / "take.json"
    take.write_text('{"format": "mien timeline", "version": 1, "duration": 600, "fps": 60}')
    run = started("animate", take, "--head", built.folder, "-o", tmp_path / "out" / "a.mp4")
    while len(contents(tmp_path / "out")) == 1:
        assert run.poll() is None
        time.sleep(0.02)
    run.send_signal(stop)
    _, err = run.communicate()
    assert run.returncode == 130
    assert "Traceback" not in err
    assert contents(tmp_path / "out") == {"a.mp4": b"old"}


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_in_its_first_moments(stop: signal.Signals, tmp_path: Path) -> None:
    """While mien's own modules load, too. Python itself takes some 20 ms to start before them.

    Where the stop falls into source text that a library executes (a named tuple's or a data
    class's), Python 3.11 ends by SIGINT although the interrupt was caught: a shell says 130 to
    both.
    """
    for delay in (0.06, 0.1, 0.2):
        run = started("build", tmp_path / "absent", "-o", tmp_path / "head")
        time.sleep(delay)
        run.send_signal(stop)
        out, err = run.communicate()
        assert out == ""
        assert "Traceback" not in err or "mien/__main__.py" not in err
        assert run.returncode in (130, -signal.SIGINT, -stop, 2)
    assert list(tmp_path.iterdir()) == []


def test_what_is_to_be_ignored_is_ignored(tmp_path: Path) -> None:
    """As under nohup: Ctrl-C in the terminal does not reach a run that was told not to care."""
    script = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    script += "import os; os.kill(os.getpid(), signal.SIGINT) or 0; "
    script += "from mien.__main__ import main; sys.exit(main())"
    run = subprocess.run(
        [
            sys.executable,
            "-c",
            script,
            "build",
            str(tmp_path / "absent"),
            "-o",
            str(tmp_path / "h"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 2
    assert "expected a photo, a video or a folder" in run.stderr
