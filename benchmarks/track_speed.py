"""Frames a second of whole commands, beside MediaPipe. Run: python -m benchmarks.track_speed"""

from __future__ import annotations

import argparse
import itertools
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.scan import DATA
from benchmarks.stages import load_average
from benchmarks.table import markdown_table, write_results
from benchmarks.track_scenes import with_expressions
from mien.arrays import Array, UInt8
from mien.capture.video.video import Video
from mien.io.files.video import save_video
from mien.io.head.head_folder import load_head, save_head

CORES, RUNS, LONG = 2, 3, 10_000
SIZES = {"300x300": (300, 300), "1920x1080": (1920, 1080)}
FRAMES = {"300x300": 900, "1920x1080": 450}
CLIP = DATA / "videos" / "driving_d10.mp4"
_ROOT = Path(__file__).parents[1]
_LOOK_SECONDS = 0.25


@dataclass(frozen=True)
class Ran:
    """A command from its start to its end.

    Attributes:
        seconds: altogether.
        cpu: of all its threads together.
        memory: (N, 2) seconds since the start, and MiB that it held then.
    """

    seconds: float
    cpu: float
    memory: Array

    @property
    def peak_mb(self) -> float:
        """MiB at most, as far as was looked."""
        return float(self.memory[:, 1].max())

    @property
    def growth_mb(self) -> float:
        """MiB from the second tenth of the run to the last."""
        at, held = self.memory.T
        share = at / self.seconds
        early, late = (held[(share >= first) & (share < first + 0.1)] for first in (0.1, 0.9))
        return float(np.median(late) - np.median(early))


def run(command: Sequence[object]) -> Ran:
    """Raises: CalledProcessError: it failed."""
    begun, used = time.perf_counter(), _cpu_of_children()
    memory = [(0.0, 0.0)]
    with subprocess.Popen(list(map(str, command)), cwd=_ROOT, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            memory.append((time.perf_counter() - begun, resident_mb(process.pid)))
            try:
                process.wait(_LOOK_SECONDS)
            except subprocess.TimeoutExpired:
                continue
    seconds = time.perf_counter() - begun
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    return Ran(seconds, _cpu_of_children() - used, np.array(memory))


def _cpu_of_children() -> float:
    """Seconds of those that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def resident_mb(process: int) -> float:
    """MiB that a process holds now; 0 where the kernel does not say."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0.0
    held = dict(line.split(":", 1) for line in lines if ":" in line).get("VmRSS", "0 kB")
    return int(held.split()[0]) / 1024


def ping_pong(path: Path, size: tuple[int, int], count: int) -> Iterator[UInt8[Array, "h w 3"]]:
    """So many frames of a clip, forward and backward in turn, so that nothing ever jumps.

    Square pictures are scaled; in wider ones the clip stands in the middle before a blur.
    """
    frames = [_fitted(frame.pixels(), size) for frame in Video(path).frames()]
    around = itertools.cycle([*frames, *frames[-2:0:-1]])
    return itertools.islice(around, count)


def _fitted(pixels: UInt8[Array, "h w 3"], size: tuple[int, int]) -> UInt8[Array, "h w 3"]:
    import cv2

    width, height = size
    inside = cv2.resize(pixels, (height, height), interpolation=cv2.INTER_AREA)
    if width == height:
        return inside
    picture: Array = cv2.resize(cv2.resize(pixels, (16, 9)), size, interpolation=cv2.INTER_CUBIC)
    left = (width - height) // 2
    picture[:, left : left + height] = inside
    return picture


def track_command(video: Path, head: Path, output: Path) -> list[object]:
    """`mien track`."""
    return [sys.executable, "-m", "mien", "track", video, "--head", head, "-o", output]


def peer_command(video: Path, output: Path) -> list[object]:
    """MediaPipe on the same frames."""
    return [sys.executable, "-m", "benchmarks.track_speed_peer", video, output]


HEADER = (
    "",
    "frames/s: mien",
    "MediaPipe",
    "time: mien / MediaPipe",
    "one frame alone, s: mien",
    "MediaPipe",
    "further frames, ms: mien",
    "MediaPipe",
    "mien / MediaPipe",
    "CPU ms each: mien",
    "MediaPipe",
    "peak MiB: mien",
    "MediaPipe",
)


def compare(work: Path, clip: Path, head: Path, *, runs: int) -> str:
    """Both programs at both sizes, in turn; medians."""
    rows = []
    for name, size in SIZES.items():
        count, fps = FRAMES[name], Video(clip).info().fps
        whole, one = work / f"{name}.mp4", work / f"{name}-one.mp4"
        save_video(whole, ping_pong(clip, size, count), fps)
        save_video(one, ping_pong(clip, size, 1), fps)
        found: dict[str, list[Ran]] = {}
        for _ in range(runs + 1):  # The first one compiles and fills the caches.
            for key, video in (("whole", whole), ("one", one)):
                ours = run(track_command(video, head, work / "track.csv"))
                theirs = run(peer_command(video, work / "peer.csv"))
                found.setdefault(f"mien {key}", []).append(ours)
                found.setdefault(f"peer {key}", []).append(theirs)
                print(f"{name} {key}: {ours.seconds:.2f} {theirs.seconds:.2f}", file=sys.stderr)
        seconds, cpu = (
            {
                key: statistics.median(getattr(ran, what) for ran in rans[1:])
                for key, rans in found.items()
            }
            for what in ("seconds", "cpu")
        )
        peaks = [max(ran.peak_mb for ran in found[f"{who} whole"][1:]) for who in ("mien", "peer")]
        each = _each(cpu, count)
        rows.append([name, *_figures(seconds, count), *each, *peaks])
    return markdown_table(HEADER, rows)


def _figures(seconds: dict[str, float], count: int) -> list[float]:
    mien, peer = seconds["mien whole"], seconds["peer whole"]
    each = _each(seconds, count)
    starts = [seconds["mien one"], seconds["peer one"]]
    return [count / mien, count / peer, mien / peer, *starts, *each, each[0] / each[1]]


def _each(seconds: dict[str, float], count: int) -> list[float]:
    """Milliseconds that a further frame takes, of mien and of its peer."""
    return [
        1000 * (seconds[f"{who} whole"] - seconds[f"{who} one"]) / (count - 1)
        for who in ("mien", "peer")
    ]


def memory_over(work: Path, clip: Path, head: Path, count: int) -> str:
    """What a long video takes."""
    video = work / "long.mp4"
    save_video(video, ping_pong(clip, SIZES["300x300"], count), Video(clip).info().fps)
    ran = run(track_command(video, head, work / "track.csv"))
    row = [f"300x300, {count} frames", ran.seconds, count / ran.seconds, ran.peak_mb, ran.growth_mb]
    header = ("mien", "s", "frames/s", "peak MiB", "MiB from the second tenth to the last")
    return markdown_table(header, [row])


INTRO = (
    "`mien track` from its start to its end, decoding and writing included, beside MediaPipe's "
    "face landmarker (video mode, blendshapes and pose) on the same file, decoded the same way. "
    "{clip}, played forward and backward; {names}; three regions. Medians of {runs} runs in "
    "processes of their own, the two programs in turn, on {cores} cores. A file of one frame tells "
    "what starting takes; further frames are the rest, in seconds that pass and in CPU time of all "
    "threads, which other work on the cores changes less. Load average before "
    "the start {before}, at the end {after}."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures and prints; without --quick writes results/track_speed.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.track_speed", description=__doc__)
    parser.add_argument("head", type=Path, help="a head folder with at least four expressions")
    parser.add_argument("--clip", type=Path, default=CLIP)
    parser.add_argument("--quick", action="store_true", help="one run; nothing is written")
    asked = parser.parse_args(arguments)
    # The processes started here inherit it.
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
    before = load_average()
    whole = load_head(asked.head)
    names = list(whole.expressions)[:4]
    runs = 1 if asked.quick else RUNS
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        save_head(with_expressions(whole, names), work / "head")
        parts = [compare(work, asked.clip, work / "head", runs=runs)]
        if not asked.quick:
            parts.append(memory_over(work, asked.clip, work / "head", LONG))
    intro = INTRO.format(
        clip=asked.clip.name,
        names=f"{len(names)} expressions",
        runs=runs,
        cores=len(os.sched_getaffinity(0)),
        before=before,
        after=load_average(),
    )
    if asked.quick:
        print("\n\n".join([intro, *parts]))
    else:
        write_results("track_speed", "Tracking, frames a second", [intro, *parts])
    return 0


if __name__ == "__main__":
    sys.exit(main())
