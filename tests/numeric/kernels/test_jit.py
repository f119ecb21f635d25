"""Kernels are compiled once for all runs, and anew when anything in them changes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

INNER = """
from mien.numeric.kernels.jit import njit
STEP = 1
@njit(inline="always")
def inner(x):
    return x + STEP
"""
OUTER = """
from inner import inner
from mien.numeric.kernels.jit import njit
@njit(cache=True)
def outer(x):
    return 2 * inner(x)
print(outer(3), sum(outer.stats.cache_hits.values()))
"""


class Program:
    """A kernel that calls one of another module, each run in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.cache = folder, folder / "c"
        (folder / "inner.py").write_text(INNER)
        (folder / "outer.py").write_text(OUTER)

    def run(self, **options: object) -> tuple[str, str]:
        """What the kernel gave, and how often its machine code was found."""
        return finished(self.start(**options))

    def start(self, **options: object) -> subprocess.Popen[str]:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(self.cache)}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        program = [sys.executable, "-B", "outer.py"]
        return subprocess.Popen(
            program, **{"cwd": self.folder, "env": environment} | pipes | options
        )


def finished(process: subprocess.Popen[str]) -> tuple[str, str]:
    out, err = process.communicate()
    assert (process.returncode, err) == (0, "")
    result, hits = out.split()
    return result, hits


@pytest.fixture
def program(tmp_path: Path) -> Program:
    return Program(tmp_path)


def test_the_second_run_finds_the_first_ones(program: Program) -> None:
    assert program.run() == ("8", "0")
    assert program.run() == ("8", "1")


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("share", [0, 0.5])
def test_a_truncated_cache_is_compiled_anew(program: Program, suffix: str, share: float) -> None:
    program.run()
    files = list(program.cache.glob(f"*/*.{suffix}"))
    assert files
    for path in files:
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    assert program.run() == ("8", "0")
    assert program.run() == ("8", "1")


@pytest.mark.parametrize("change", ["return x + STEP * 2", "return x + STEP  # the same"])
def test_a_change_in_the_kernel_that_is_called_counts(program: Program, change: str) -> None:
    program.run()
    text = INNER.replace("return x + STEP", change)
    (program.folder / "inner.py").write_text(text)
    assert program.run() == ("10" if "2" in change else "8", "0")


def test_a_constant_from_elsewhere_counts(program: Program) -> None:
    (program.folder / "constants.py").write_text("STEP = 1")
    text = INNER.replace("STEP = 1", "from constants import STEP")
    (program.folder / "inner.py").write_text(text)
    assert program.run() == ("8", "0")
    (program.folder / "constants.py").write_text("STEP = 4")
    assert program.run() == ("14", "0")


def test_two_processes_at_once(program: Program) -> None:
    both = [program.start() for _ in range(2)]
    assert [finished(process)[0] for process in both] == ["8", "8"]
    assert program.run() == ("8", "1")


def test_without_any_place_to_keep_it(program: Program) -> None:
    """As in a container that is read-only, where HOME and TMPDIR lie where nothing can be made."""
    program.run()
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "TMPDIR", "NUMBA_CACHE_DIR"), os.devnull)
    closed = "from mien.numeric.kernels import cache as k; import pathlib, tempfile, sys; "
    closed += f"k.PACKAGE = pathlib.Path({os.devnull!r}); tempfile.tempdir = {os.devnull!r}; "
    closed += "sys.path.insert(0, '.'); import outer; print(k.kernel_folders())"
    done = subprocess.run(
        [sys.executable, "-B", "-c", closed],
        cwd=program.folder,
        env=os.environ | nowhere,
        capture_output=True,
        text=True,
    )
    assert (done.stdout.splitlines(), done.stderr) == (["8 0", "()"], "")


def test_every_kernel_is_compiled_by_it() -> None:
    source = Path(__file__).parents[3] / "src" / "mien"
    others = [
        path.name
        for path in source.rglob("*.py")
        if path.name != "jit.py" and "from numba import njit" in path.read_text(encoding="utf-8")
    ]
    assert others == []
