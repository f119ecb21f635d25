"""Expressions a second from points to image, beside peers. Run: python -m benchmarks.synthesize"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numba
import numpy as np

from benchmarks.stages import load_average
from benchmarks.synthesize_peers import mixed_by_numpy, opencv_warp, skimage_warp
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array
from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.synthesis.composition.composer import Composer
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.inference.coefficients import coefficients

SIZE, EXAMPLES, CORES = (600, 800), 10, 2
MANY, LARGE = (10, 20, 40, 80), (1080, 1920)
ROUNDS, FRAMES = 15, 1000
SKIP = 1 / 256

Task = Callable[[int], object]


def main() -> int:
    """Measure all and write the tables."""
    cv2.setNumThreads(CORES)
    numba.set_num_threads(min(CORES, numba.config.NUMBA_NUM_THREADS))
    load = load_average()
    parts = [*beside_peers(load), *growth(), memory()]
    write_results("synthesize", "Speed of synthesis", parts)
    return 0


def beside_peers(load: str) -> list[str]:
    """mien's steps, peers' and a plain copy, all in turn, round after round."""
    examples, frames = scene(EXAMPLES, SIZE)
    mixtures = [coefficients(examples, points) for points in frames]
    moved, lookups = moved_bytes(examples, mixtures)
    tasks = mien_tasks(examples, frames, mixtures) | {
        "one photo warped by OpenCV, triangle by triangle": lambda k: opencv_warp(
            examples, frames[k % len(frames)]
        ),
        "ten aligned photos mixed by numpy": mixed_by_numpy(examples, mixtures[0]),
        "the bytes that must move, copied by one core": copy_of(moved, 1),
        f"the same, copied by {CORES} cores": copy_of(moved, CORES),
    }
    try:
        tasks["one photo warped by skimage"] = skimage_warp(examples, frames[0])
    except ImportError:
        print("skimage's row is left out: pip install scikit-image", file=sys.stderr)
    times = in_rounds(tasks, ROUNDS)
    first, _, drawn = list(times.values())[:3]
    rows = [
        (name, t.median, t.fastest, t.work, 1e3 / t.fastest, t.fastest / first.fastest)
        for name, t in times.items()
    ]
    (width, height), names = SIZE, examples.subregions.names
    about = (
        f"{width}x{height} px, {EXAMPLES} examples, {len(names)} subregions, "
        f"{len(examples.layout.names)} points, {CORES} threads. All in turn, {ROUNDS} rounds: the "
        "median, the fastest and, of the round that had least, the work: the time for which all "
        "cores together were busy. Beside other programs, work says most. Load when it began: "
        f"{load}; 0 on a machine of one's own."
    )
    bytes_about = (
        f"What must move, {moved / 1e6:.1f} MB: 4 bytes of each of the {lookups / 1e6:.2f} million "
        "texels (one a pixel and photo that counts there), 4 that say which subregions a pixel "
        "of the face lies in, one for each that fades there, and the neutral photo to the image. "
        f"A texel takes a core {1e6 * drawn.work / lookups:.1f} ns, all included."
    )
    header = ("what", "ms, median", "fastest", "work, ms", "a second, fastest", "times mien's")
    return [about, markdown_table(header, rows), bytes_about]


def growth() -> list[str]:
    """More examples, more pixels."""
    rows = []
    for count, size in [*((count, SIZE) for count in MANY), (EXAMPLES, LARGE)]:
        examples, frames = scene(count, size)
        mixtures = [coefficients(examples, points) for points in frames]
        _, lookups = moved_bytes(examples, mixtures)
        times = in_rounds(mien_tasks(examples, frames, mixtures), 7)
        whole, shared, drawn = times.values()
        pixels = f"{size[0]}x{size[1]}"
        work = [t.work for t in (whole, shared, drawn)]
        rows.append((pixels, count, lookups / 1e6, whole.median, whole.fastest, *work))
    parts = ("ms, median", "fastest", "work, ms", "of it, shares", "image")
    header = ("px", "examples", "million texels", *parts)
    return ["Growth:", markdown_table(header, rows)]


def memory() -> str:
    """Of the process, over many frames."""
    examples, frames = scene(EXAMPLES, SIZE)
    whole = next(iter(mien_tasks(examples, frames, []).values()))
    held = []
    for k in range(FRAMES):
        whole(k)
        if k in (FRAMES // 10, FRAMES - 1):
            held.append(resident_mb())
    return (
        f"Memory after {FRAMES // 10} frames: {held[0]:.0f} MB, all of the process; "
        f"after {FRAMES}: {held[1]:.0f} MB."
    )


def mien_tasks(examples: ExampleSet, frames: list[Array], mixtures: list[Array]) -> dict[str, Task]:
    """From points to image, and its two steps."""
    composer, count = Composer(examples, skip=SKIP), len(frames)
    out = np.empty_like(examples.neutral.photo)

    def whole(k: int) -> object:
        points = frames[k % count]
        return composer.render(points, coefficients(examples, points), out=out)

    return {
        "mien, points to image": whole,
        "of this, shares": lambda k: coefficients(examples, frames[k % count]),
        "of this, image": lambda k: composer.render(
            frames[k % count], mixtures[k % count], out=out
        ),
    }


def scene(count: int, size: tuple[int, int]) -> tuple[ExampleSet, list[Array]]:
    """Expressions of a made-up face, and points between them."""
    layout, rng = load_feature_layout(), np.random.default_rng(0)
    width, height = size
    base = (layout.template - layout.template.mean(0)) * 0.75 * width + [width / 2, height / 2]
    # Displacements that vary smoothly over the face, as expressions do.
    waves = np.sin(base * 600 / width @ rng.normal(0, 0.01, (2, 8)) + rng.uniform(0, 6, 8))
    moves = waves @ rng.normal(0, 4 * width / 600, (count, 8, 2))
    places = base + np.concatenate([np.zeros((1, *base.shape)), moves[1:]])
    photos = []
    for _ in range(count):
        noise = rng.integers(0, 256, (height, width, 3), np.uint8)
        photos.append(np.asarray(cv2.GaussianBlur(noise, (0, 0), 2), np.uint8))
    pairs = enumerate(zip(photos, places, strict=True))
    examples = tuple(Example(f"example {i}", photo, p, "") for i, (photo, p) in pairs)
    subregions = default_subregions(layout, base, size)
    mixes = rng.dirichlet(np.full(count, 3 / count), 20)
    jitter = rng.normal(0, 0.5, (len(mixes), *base.shape))
    frames = list(np.tensordot(mixes, places, 1) + jitter)
    return ExampleSet(layout, examples, 0, places, subregions), frames


@dataclass(frozen=True)
class Times:
    """ms of the median round and the fastest, and of all cores' work in the one with least."""

    median: float
    fastest: float
    work: float


def in_rounds(tasks: Mapping[str, Task], rounds: int) -> dict[str, Times]:
    """Each task in turn, again and again: the machine's speed varies."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in tasks}
    for task in tasks.values():
        # Kernels are compiled.
        task(0)
    for round_ in range(rounds):
        for name, task in tasks.items():
            once = timed(task, round_, 1)[0]
            # Short tasks are repeated, for the resolution of the clock.
            times[name].append(timed(task, round_, min(max(int(30 / once), 1), 20)))
    result = {}
    for name, pairs in times.items():
        wall, work = zip(*pairs, strict=True)
        result[name] = Times(statistics.median(wall), min(wall), min(work))
    return result


def timed(task: Task, start: int, repeats: int) -> tuple[float, float]:
    """ms that a run takes by the clock, and by the cores' work."""
    clock, work = time.perf_counter(), time.process_time()
    for k in range(start, start + repeats):
        task(k)
    clock, work = time.perf_counter() - clock, time.process_time() - work
    return 1e3 * clock / repeats, 1e3 * work / repeats


def moved_bytes(examples: ExampleSet, mixtures: list[Array]) -> tuple[float, float]:
    """Bytes that a mean frame reads and writes at least; texels among them.

    Computed in the standard image, which here has the neutral face's points.
    """
    fades = examples.subregions.fades
    whole, around = fades.sum(2), np.zeros(fades.shape[:2], np.uint8)
    frame = examples.layout.frame(examples.neutral.points)
    cv2.fillPoly(around, [np.asarray(np.round(frame), np.int32)], 1)
    counted = np.mean([((fades @ (np.abs(row) > SKIP)) > 0).sum() for row in mixtures])
    # Around the subregions, and where they fade out, one more: neutral.
    lookups = float(counted + ((around > 0) & (whole < 1 - 1e-6)).sum())
    blends = (fades > 0).sum(2)
    looked_up = 4 * (around > 0).sum() + blends[blends > 1].sum()
    return 4 * lookups + float(looked_up) + 2 * examples.neutral.photo.nbytes, lookups


def copy_of(moved: float, threads: int) -> Task:
    """A copy that reads and writes so many bytes, of memory too large for caches."""
    size = int(moved) // 2 // threads
    source = np.ones((16, threads, size), np.uint8)
    target = np.ones_like(source)
    pool = ThreadPoolExecutor(threads)

    def copy(k: int) -> object:
        to, of = target[k % 16], source[k % 16]
        others = [pool.submit(np.copyto, to[n], of[n]) for n in range(1, threads)]
        np.copyto(to[0], of[0])
        return [other.result() for other in others]

    return copy


def resident_mb() -> float:
    """MB that this process holds now; NaN where the system does not tell."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * 4096 / 1e6 if status.exists() else float("nan")


if __name__ == "__main__":
    sys.exit(main())
