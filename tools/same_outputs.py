"""Whether two versions of mien make the same files: run before and after a change of structure.

    python -m tools.same_outputs make BEFORE --photos DIR --clip CLIP [--tree OLD_CHECKOUT]
    python -m tools.same_outputs make AFTER --photos DIR --clip CLIP
    python -m tools.same_outputs compare BEFORE AFTER

`make` runs every command that writes something, each on what the ones before it made, twice: a run
that compiles kernels rounds otherwise than one that loads them. `compare` prints a Markdown table,
a row a result: files that are the same to the byte, files whose content is the same (frames of
videos, values of arrays and tables), and by how much the others differ.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mien.arrays import Array

TIMELINE = {
    "format": "mien timeline",
    "version": 1,
    "duration": 2.0,
    "fps": 15,
    "size": [480, 600],
    "tracks": {
        "head": {"yaw": [[0, -25], [1, 25], [2, -25]]},
        "units": {"jawOpen": [[0, 0], [0.7, 0.6], [2, 0]], "mouthSmileLeft": [[0, 0], [1.5, 0.8]]},
    },
    "layers": [{"name": "eyes", "generator": "blink", "period": 1, "seed": 3}],
}
POINTS = "points.json"
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")


def commands(folder: Path, photos: Path, clip: Path) -> Iterator[tuple[str, list[str]]]:
    """Every command with its output; paths are relative to the folder that it runs in."""
    photo = str(min(photos.glob("*.[jp][pn]*g")))
    render = ["--yaw", "20", "--unit", "jawOpen=0.5", "--gaze", "10,-5"]
    overlay = ["--overlay", "overlay.mp4", "--plots", "plots"]
    yield "demo", ["demo", "-o", "demo"]
    yield "build photos", ["build", str(photos), "-o", "photos_head"]
    yield "build one photo", ["build", photo, "-o", "photo_head"]
    yield "build clip", ["build", str(clip), "-o", "clip_head"]
    yield "render", ["render", "photos_head", "-o", "render.png", *render]
    for suffix in ("glb", "obj", "usdz"):
        yield f"export .{suffix}", ["export", "clip_head", "-o", f"export_{suffix}/head.{suffix}"]
    track = ["track", str(clip), "--head", "clip_head", "-o", "track/track.csv"]
    yield "track", [*track, *overlay]
    for kind in ("live-link", "openface"):
        yield f"track --{kind}", [*track[:-1], f"{kind}/t.csv", f"--{kind}", f"{kind}/out.csv"]
    yield "examples", ["examples", str(clip), "-o", "examples", "--count", "24"]
    frame = str(min((folder / "clip_head" / "photos").rglob("*.png")).relative_to(folder))
    synthesize = ["synthesize", "examples", "--photo", frame, "--weights", "synthesize/w.json"]
    synthesize += ["--save-points", f"synthesize/{POINTS}"]
    yield "synthesize --photo", [*synthesize, "-o", "synthesize/photo.png"]
    points = ["--points", f"synthesize/{POINTS}"]
    yield "synthesize --points", ["synthesize", "examples", *points, "-o", "points/points.png"]
    yield "synthesize --paper", ["synthesize", "examples", *points, "--paper", "-o", "paper/p.png"]
    yield (
        "synthesize head",
        ["synthesize", "clip_head", "--photo", frame, "-o", "synthesize_head/photo.png"],
    )
    for suffix in ("mp4", "glb", "csv"):
        animate = ["animate", "take.json", "--head", "photos_head"]
        yield f"animate .{suffix}", [*animate, "-o", f"animate_{suffix}/take.{suffix}"]
    animate = ["animate", "track/track.csv", "--head", "clip_head", "--size", "320x400"]
    yield "animate track", [*animate, "-o", "animate_track/take.mp4"]


def make(folder: Path, photos: Path, clip: Path, tree: Path) -> None:
    """Run everything with the mien of this checkout; a command that fails leaves its message."""
    with tempfile.TemporaryDirectory() as first:
        run_all(Path(first), photos, clip, tree)
    folder.mkdir(parents=True)
    run_all(folder, photos, clip, tree)


def run_all(folder: Path, photos: Path, clip: Path, tree: Path) -> None:
    """Every command once, its output into the folder."""
    (folder / "take.json").write_text(json.dumps(TIMELINE))
    (folder / "printed").mkdir()
    environment = os.environ | {"PYTHONPATH": str(tree / "src")}
    for name, arguments in commands(folder, photos, clip):
        for word in arguments:
            if "/" in word and not word.startswith("/"):
                (folder / word).parent.mkdir(exist_ok=True)
        began = time.perf_counter()
        command = [sys.executable, "-m", "mien", *arguments]
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        printed = f"{run.returncode}\n{run.stdout}\n{run.stderr}"
        (folder / "printed" / f"{name.replace(' ', '_')}.txt").write_text(printed)
        print(f"{name}: {run.returncode}, {time.perf_counter() - began:.0f} s", flush=True)


@dataclass
class Row:
    """How the files of one command compare.

    Attributes:
        same_bytes: how many files are the same to the byte.
        same_content: how many files differ in bytes and hold the same.
        differences: file and how it differs.
    """

    same_bytes: int = 0
    same_content: int = 0
    differences: list[str] = field(default_factory=list)


def compare(before: Path, after: Path) -> dict[str, Row]:
    """By the first folder or file name of each result."""
    rows: dict[str, Row] = {}
    paths = {p.relative_to(f) for f in (before, after) for p in f.rglob("*") if p.is_file()}
    for path in sorted(paths):
        row = rows.setdefault(path.parts[0], Row())
        pair = before / path, after / path
        if not all(file.exists() for file in pair):
            row.differences.append(f"{path}: only {'after' if pair[1].exists() else 'before'}")
        elif pair[0].read_bytes() == pair[1].read_bytes():
            row.same_bytes += 1
        else:
            difference = content_difference(*pair)
            if difference:
                row.differences.append(f"{path}: {difference}")
            else:
                row.same_content += 1
    return rows


def content_difference(before: Path, after: Path) -> str:
    """How two files of a kind differ; "" if what they hold is the same."""
    if before.suffix in (".png", ".jpg"):
        return array_difference(pixels(before), pixels(after), "levels")
    if before.suffix == ".npz":
        with np.load(before) as old, np.load(after) as new:
            if set(old) != set(new):
                return "other arrays"
            found = [(name, array_difference(old[name], new[name], "")) for name in old]
        return "; ".join(f"{name} {difference}" for name, difference in found if difference)
    if before.suffix in (".mp4", ".webm"):
        return array_difference(frames(before), frames(after), "levels")
    if before.suffix in (".glb", ".usdz"):
        return "bytes"
    return text_difference(before.read_text(), after.read_text())


def array_difference(before: Array, after: Array, unit: str) -> str:
    """The largest difference of two arrays."""
    if before.shape != after.shape or before.dtype != after.dtype:
        return f"{before.dtype} {before.shape} became {after.dtype} {after.shape}"
    if np.array_equal(before, after):
        return ""
    if before.dtype.kind not in "fiu":
        return "other values"
    largest = np.nanmax(np.abs(before.astype(float) - after.astype(float)))
    return f"up to {largest:.2g} {unit}".strip()


def text_difference(before: str, after: str) -> str:
    """By how much numbers of two texts differ, or that their words do; seconds and paths count."""
    if NUMBER.sub("#", before) != NUMBER.sub("#", after):
        return "other words"
    pairs = zip(NUMBER.findall(before), NUMBER.findall(after), strict=True)
    gaps = [abs(float(a) - float(b)) / max(1.0, abs(float(a))) for a, b in pairs]
    return f"numbers up to {max(gaps):.2g}" if max(gaps) else ""


def pixels(path: Path) -> Array:
    """(h, w, c) uint8."""
    from PIL import Image

    return np.asarray(Image.open(path))


def frames(path: Path) -> Array:
    """(n, h, w, 3) uint8."""
    import av

    with av.open(path) as container:
        return np.stack([f.to_ndarray(format="rgb24") for f in container.decode(video=0)])


def table(rows: dict[str, Row]) -> str:
    """Markdown."""
    lines = ["| result | same bytes | same content | different |", "|---|---:|---:|---|"]
    for name, row in rows.items():
        rest = "; ".join(row.differences[:4]) + (" …" if len(row.differences) > 4 else "")
        lines.append(f"| {name} | {row.same_bytes} | {row.same_content} | {rest} |")
    return "\n".join(lines)


def main() -> None:
    """Parse, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("make")
    making.add_argument("folder", type=Path)
    making.add_argument("--photos", type=Path, required=True)
    making.add_argument("--clip", type=Path, required=True)
    making.add_argument("--tree", type=Path, default=Path(__file__).parents[1])
    comparing = verbs.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.verb == "make":
        make(given.folder, given.photos.resolve(), given.clip.resolve(), given.tree.resolve())
    else:
        print(table(compare(given.before, given.after)))


if __name__ == "__main__":
    main()
