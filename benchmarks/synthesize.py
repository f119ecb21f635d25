"""Expressions a second from points to image, beside peers. Run: python -m benchmarks.synthesize"""

from __future__ import annotations

import importlib
import statistics
import sys
import time
from collections.abc import Callable

import cv2
import numba
import numpy as np

from benchmarks.stages import load_average
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array
from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.synthesis.coefficients import coefficients
from mien.synthesis.compose import Composer
from mien.synthesis.examples import Example, ExampleSet

WIDTH, HEIGHT, EXAMPLES, CORES = 600, 800, 10, 2


def main() -> int:
    """Measure all and write the table."""
    cv2.setNumThreads(CORES)
    numba.set_num_threads(min(CORES, numba.config.NUMBA_NUM_THREADS))
    examples, frames = scene()
    composer, out = Composer(examples), np.empty((HEIGHT, WIDTH, 3), np.uint8)
    shares = [coefficients(examples, points) for points in frames]
    count = len(frames)

    def whole(k: int) -> object:
        points = frames[k % count]
        return composer.render(points, coefficients(examples, points), out=out)

    tasks: list[tuple[str, Callable[[int], object], int]] = [
        ("mien, points to image", whole, 60),
        ("of this, shares", lambda k: coefficients(examples, frames[k % count]), 60),
        ("of this, image", lambda k: composer.render(frames[k % count], shares[k % count]), 60),
        ("one image warped by OpenCV, triangle by triangle",
         lambda k: opencv_warp(examples, frames[k % count]), 10),
        ("ten aligned images mixed by numpy", mixed_by_numpy(examples, shares[0]), 3),
    ]  # fmt: skip
    try:
        tasks.append(("one image warped by skimage", skimage_warp(examples, frames[0]), 2))
    except ImportError:
        print("skimage's row is left out: pip install scikit-image", file=sys.stderr)
    rows = [(name, milliseconds(task, runs)) for name, task, runs in tasks]
    bandwidth = copied_bytes_a_second()
    moved = moved_bytes(examples, shares)
    rows.append(("the bytes that must move, copied", 1e3 * moved / bandwidth))
    first = rows[0][1]
    table = [(name, time_ms, 1e3 / time_ms, time_ms / first) for name, time_ms in rows]
    about = (
        f"{WIDTH}x{HEIGHT} px, {EXAMPLES} examples, {len(examples.subregions.names)} subregions, "
        f"{len(examples.layout.names)} points, {CORES} threads; medians. {moved / 1e6:.1f} MB must "
        f"move, at {bandwidth / 1e9:.1f} GB/s copied. Load when it began: {load_average()}."
    )
    header = ("what", "ms", "a second", "times mien's")
    write_results("synthesize", "Speed of synthesis", [about, markdown_table(header, table)])
    return 0


def scene() -> tuple[ExampleSet, list[Array]]:
    """Ten expressions of a made-up face, and points between them."""
    layout, rng = load_feature_layout(), np.random.default_rng(0)
    base = (layout.template - layout.template.mean(0)) * 0.75 * WIDTH + [WIDTH / 2, HEIGHT / 2]
    # Displacements that vary smoothly over the face, as expressions do.
    waves = np.sin(base @ rng.normal(0, 0.01, (2, 8)) + rng.uniform(0, 6, 8))
    moves = waves @ rng.normal(0, 4, (EXAMPLES, 8, 2))
    places = base + np.concatenate([np.zeros((1, *base.shape)), moves[1:]])
    noise = rng.integers(0, 256, (EXAMPLES, HEIGHT, WIDTH, 3), np.uint8)
    photos = [np.asarray(cv2.GaussianBlur(picture, (0, 0), 2), np.uint8) for picture in noise]
    pairs = enumerate(zip(photos, places, strict=True))
    examples = tuple(Example(f"example {i}", photo, p, "") for i, (photo, p) in pairs)
    subregions = default_subregions(layout, base, (WIDTH, HEIGHT))
    mixes = rng.dirichlet(np.full(EXAMPLES, 0.3), 20)
    jitter = rng.normal(0, 0.5, (len(mixes), *base.shape))
    frames = list(np.tensordot(mixes, places, 1) + jitter)
    return ExampleSet(layout, examples, 0, places, subregions), frames


def milliseconds(task: Callable[[int], object], runs: int) -> float:
    """The median time of a run, the first one left out."""
    task(0)
    times = []
    for run in range(runs):
        start = time.perf_counter()
        task(run)
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def opencv_warp(examples: ExampleSet, points: Array) -> Array:
    """The usual loop: each triangle's box warped, and copied where the triangle is."""
    layout, photo = examples.layout, examples.neutral.photo
    source = np.concatenate([examples.neutral.points, layout.frame(examples.neutral.points)])
    target = np.concatenate([points, layout.frame(points)])
    out: Array = photo.copy()
    for triangle in layout.triangles:
        there, here = np.float32(source[triangle]), np.float32(target[triangle])
        low = np.maximum(np.floor(here.min(0)).astype(int), 0)
        high = np.minimum(np.ceil(here.max(0)).astype(int), [WIDTH, HEIGHT])
        if (high <= low).any():
            continue
        size = (int(high[0] - low[0]), int(high[1] - low[1]))
        affine = cv2.getAffineTransform(there, np.float32(here - low))
        warped = cv2.warpAffine(photo, affine, size, borderMode=cv2.BORDER_REPLICATE)
        mask = np.zeros(size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, np.int32(np.round(here - low)), 1)
        box = out[low[1] : high[1], low[0] : high[0]]
        box[mask > 0] = warped[mask > 0]
    return out


def mixed_by_numpy(examples: ExampleSet, shares: Array) -> Callable[[int], object]:
    """Eq. (6) and (7) over aligned images, without any warp."""
    images = np.stack([example.photo for example in examples.examples]).astype(np.float32)
    fades, weights = examples.subregions.fades, shares.astype(np.float32)
    return lambda _: np.einsum("hwm,mhwc->hwc", fades @ weights, images).astype(np.uint8)


def skimage_warp(examples: ExampleSet, points: Array) -> Callable[[int], object]:
    """PiecewiseAffineTransform, estimated and applied. Raises: ImportError: it is not installed."""
    transform = importlib.import_module("skimage.transform")
    source, photo = examples.neutral.points, examples.neutral.photo

    def warp(_: int) -> object:
        motion = transform.PiecewiseAffineTransform.from_estimate(points, source)
        return transform.warp(photo, motion)

    return warp


def moved_bytes(examples: ExampleSet, shares: list[Array]) -> float:
    """Bytes that a mean frame reads and writes at least: photos that count, labels, the image."""
    fades = examples.subregions.fades
    used = np.mean([((fades @ (row > 1 / 256)) > 0).sum() for row in shares])
    # Texels of 4 bytes, a label of 2 for each pixel of the face; the neutral photo to the image.
    return float(4 * used + 2 * (fades.sum(2) > 0).sum() + 6 * WIDTH * HEIGHT)


def copied_bytes_a_second() -> float:
    """Bytes read and written a second by a copy of 256 MB in one thread."""
    source = np.ones(256 << 20, np.uint8)
    target = np.empty_like(source)
    return 2 * source.nbytes / (milliseconds(lambda _: np.copyto(target, source), 5) / 1e3)


if __name__ == "__main__":
    sys.exit(main())
