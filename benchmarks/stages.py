"""Stages of a run, each with its seconds, and the peak memory of the process they ran in."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Stages:
    """A stopwatch with laps by name."""

    seconds: dict[str, float] = field(default_factory=dict)
    _last: float = field(default_factory=time.perf_counter)

    def lap(self, name: str) -> None:
        """What passed since the last lap (or the start) belongs to this stage."""
        now = time.perf_counter()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now


@dataclass(frozen=True)
class Run:
    """What a process of its own measured.

    Attributes:
        seconds: by stage, "start" first: the interpreter and its imports.
        peak_mb: of resident memory, in MiB.
    """

    seconds: dict[str, float]
    peak_mb: float


def report(stages: Stages, peak: float) -> None:
    """Ends a measured process: prints what `run_measured` reads."""
    print(json.dumps({"seconds": stages.seconds, "peak_mb": peak}))


def peak_mb() -> float:
    """MiB that this process has held at most.

    Where there is one, the kernel's mark of this very program: `ru_maxrss` begins with that of the
    process that started it.
    """
    status = Path("/proc/self/status")
    if status.exists():
        lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
        return int(lines["VmHWM"].split()[0]) / 1024
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def run_measured(module: str, arguments: Sequence[object], *, warm_up: bool = True) -> Run:
    """What `python -m module arguments` measures, run once before for what compiles and is cached.

    Raises:
        CalledProcessError: it failed; what it said is on stderr.
    """
    command = [sys.executable, "-m", module, *map(str, arguments)]
    for _ in range(2 if warm_up else 1):
        begun = time.perf_counter()
        done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=_ROOT, text=True)
        whole = time.perf_counter() - begun
        print(f"{module} {arguments[0]}: {whole:.1f} s", file=sys.stderr)
    found = json.loads(done.stdout.splitlines()[-1])
    inside = found["seconds"]
    return Run({"start": whole - sum(inside.values())} | inside, found["peak_mb"])


_ROOT = Path(__file__).parents[1]


def load_average() -> str:
    """Processes that ran or waited to, over the last minute."""
    return f"{os.getloadavg()[0]:.1f}"
