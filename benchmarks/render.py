"""Frames a second of mixed textures, beside OpenGL in passes. Run: python -m benchmarks.render"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import render_gl
from benchmarks.stages import load_average
from benchmarks.table import markdown_table, write_results

SIZES = ((600, 800), (1920, 1080))
TEXTURES = (1, 2, 4, 8)
CORES = 2
LONG = 1000


@dataclass(frozen=True)
class RenderTiming:
    """Measurements of one program.

    Attributes:
        fps: over all frames.
        best_fps: of the fastest tenth, when nothing else ran.
        cpu_ms: of all threads, a frame.
        peak_mb: of resident memory.
        growth_mb: from the first frames to the last.
    """

    fps: float
    best_fps: float
    cpu_ms: float
    frames: int
    peak_mb: float
    growth_mb: float


def draw(
    module: str,
    size: tuple[int, int],
    textures: int,
    picture: Path,
    *,
    texels: int = 2048,
    frames: int = 0,
) -> RenderTiming:
    """For some seconds, or at least so many frames, in a process of its own.

    Raises:
        CalledProcessError: it failed.
    """
    values = map(str, (*size, textures, texels, frames, picture))
    command = [sys.executable, "-m", f"benchmarks.{module}", *values]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=root, text=True)
    drawn = RenderTiming(**json.loads(done.stdout.splitlines()[-1]))
    print(f"{module} {size} {textures}: {drawn}", file=sys.stderr)
    return drawn


def difference(ours: Path, theirs: Path) -> tuple[float, float, float]:
    """Grey levels between two pictures where both are opaque: mean, 99.9th percentile, greatest."""
    first, second = (np.load(path).astype(int) for path in (ours, theirs))
    whole = (first[..., 3] == 255) & (second[..., 3] == 255)
    off = np.abs(first - second)[whole][:, :3]
    return float(off.mean()), float(np.percentile(off, 99.9)), float(off.max())


HEADER = (
    "",
    "frames/s: mien",
    "OpenGL",
    "mien / OpenGL",
    "fastest tenth: mien",
    "OpenGL",
    "CPU ms a frame: mien",
    "OpenGL",
    "OpenGL / mien",
    "peak MiB: mien",
    "OpenGL",
    "pictures differ: mean",
    "99.9 %",
    "greatest",
)


def compare(work: Path, textures: Sequence[int]) -> str:
    """Both programs at both sizes, by number of textures."""
    rows = []
    for size in SIZES:
        for count in textures:
            ours, theirs = work / "mien.npy", work / "gl.npy"
            mien = draw("render_mien", size, count, ours)
            name = f"{size[0]}x{size[1]}, {count} texture{'s' * (count > 1)}"
            if not render_gl.is_installed():
                pairs = ((mien.fps, "-", "-"), (mien.best_fps, "-"), (mien.cpu_ms, "-", "-"))
                rows.append([name, *itertools.chain(*pairs), mien.peak_mb, *"----"])
                continue
            peer = draw("render_gl", size, count, theirs)
            figures = (mien.fps, peer.fps, mien.fps / peer.fps, mien.best_fps, peer.best_fps)
            costs = (mien.cpu_ms, peer.cpu_ms, peer.cpu_ms / mien.cpu_ms)
            memory = (mien.peak_mb, peer.peak_mb)
            rows.append([name, *figures, *costs, *memory, *difference(ours, theirs)])
    return markdown_table(HEADER, rows)


def growth_with_frames(work: Path) -> str:
    """mien's memory over many frames."""
    rows = []
    for size in SIZES:
        drawn = draw("render_mien", size, 4, work / "picture.npy", frames=LONG)
        rows.append([f"{size[0]}x{size[1]}", drawn.frames, drawn.peak_mb, drawn.growth_mb])
    header = ("mien, 4 textures", "frames", "peak MiB", "growth, MiB")
    return markdown_table(header, rows)


def growth_with_texels(work: Path) -> str:
    """mien with larger textures."""
    rows = []
    for texels in (1024, 2048, 4096):
        drawn = draw("render_mien", SIZES[0], 4, work / "picture.npy", texels=texels)
        rows.append([f"{texels}x{texels}", drawn.cpu_ms, drawn.fps, drawn.best_fps, drawn.peak_mb])
    header = (
        "mien, 600x800, 4 textures of",
        "CPU ms a frame",
        "frames/s",
        "fastest tenth",
        "peak MiB",
    )
    return markdown_table(header, rows)


INTRO = (
    "The generic head at a quarter turn with synthetic textures of 2048x2048; mouth, eyes and "
    "forehead change their mixture and the jaw moves in every frame. Four samples a pixel, "
    "straight alpha, read as a numpy array. OpenGL: one pass a texture on {gl}, added up in half "
    "floats, driven by moderngl. Each in a process of its own on {cores} cores. Load average "
    "before the start {before}, at the end {after}: with other work on the cores, the fastest "
    "tenth of the frames and the CPU time of all threads tell more than the mean. Differences in "
    "grey levels, where both pictures are opaque; the greatest are where triangles meet, as the "
    "two have their four samples at other places in a pixel. The benchmark's own scene takes part "
    "of the memory."
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measures and prints; without --quick writes results/render.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.render", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="4 textures; nothing is written")
    quick = parser.parse_args(arguments).quick
    # The processes started here inherit it.
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
    before = load_average()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        draw("render_mien", SIZES[0], 2, work / "picture.npy")
        parts = [compare(work, (4,) if quick else TEXTURES)]
        if not quick:
            parts += [growth_with_frames(work), growth_with_texels(work)]
    cores = len(os.sched_getaffinity(0))
    gl = render_gl.version() if render_gl.is_installed() else "moderngl is not installed"
    intro = INTRO.format(gl=gl, cores=cores, before=before, after=load_average())
    if quick:
        print("\n\n".join([intro, *parts]))
    else:
        write_results("render", "Mixed textures, frames a second", [intro, *parts])


if __name__ == "__main__":
    main()
