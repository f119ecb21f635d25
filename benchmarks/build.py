"""How long a build takes, beside eos-py. Run: python -m benchmarks.build"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import build_eos, build_mien
from benchmarks.build_photos import LARGE, SMALL
from benchmarks.stages import Run, load_average, run_measured
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.numeric.similarity import estimate_similarity

EMILY = Path(__file__).parents[2] / "shared/data/emily/renders_mentalray"
EMILY_VIEWS = (2, 3, 4, 5, 7)
GROWTH = (2, 5, 10, 20)
WRITING = "Writing the head"
TO_FILE = (
    "start",
    "Finding faces",
    "Solving cameras and shape",
    "Extracting textures",
    "Exporting",
)


@dataclass(frozen=True)
class Result:
    """Both builds of one folder of photos.

    Attributes:
        mien: how long and how large; eos is None where it is not installed.
        eos: how long and how large; eos is None where it is not installed.
        rms_px: reprojection error of the landmarks, by whose head.
        surface_mm: median distance of the face from the head in the photos, by whose; none where
            that head is not known.
    """

    mien: Run
    eos: Run | None
    rms_px: dict[str, float]
    surface_mm: dict[str, float]


def compare(
    photos: Path, work: Path, truth: Float[Array, "v 3"] | None, *, warm_up_eos: bool = True
) -> Result:
    """Builds from these photos with mien, then with eos from the landmarks that mien found.

    Args:
        work: a folder to be made, for everything that is written.
        truth: (V, 3) mm of the head in the photos, where it is known.
        warm_up_eos: with a run that does not count before.
    """
    work.mkdir()
    mien = run_measured("benchmarks.build_mien", [photos, work])
    eos = None
    if build_eos.is_installed():
        build_eos.save_model(work / build_eos.MODEL)
        eos = run_measured("benchmarks.build_eos", [work], warm_up=warm_up_eos)
    landmarks = np.load(work / build_mien.LANDMARKS)
    rms, surface = {}, {}
    for name, run, file in (
        ("mien", mien, build_mien.RESULT),
        ("eos", eos, build_eos.RESULT),
    ):
        if run is None:
            continue
        with np.load(work / file) as found:
            for key in ("projected", "projected_mean"):
                if key in found:
                    off = (found[key] - landmarks["points"])[landmarks["used"]]
                    rms[name + key.removeprefix("projected")] = _rms(off)
            if truth is not None:
                surface[name] = _surface_error(found["vertices"], truth)
    return Result(mien, eos, rms, surface)


def _rms(offsets: Float[Array, "n 2"]) -> float:
    return float(np.sqrt((offsets**2).sum(axis=1).mean()))


def _surface_error(vertices: Float[Array, "v 3"], truth: Float[Array, "v 3"]) -> float:
    """Median distance in mm of the face's vertices from the true ones, after a similarity."""
    face = load_generic_head().regions["face"] > 0.5
    found = estimate_similarity(vertices[face].astype(np.float64), truth[face])
    return float(np.median(np.linalg.norm(found(vertices[face]) - truth[face], axis=1)))


ROWS = (
    ("start, imports", ("start",), ("start",)),
    ("photos, landmarks", ("Finding faces",), ("load",)),
    ("cameras and shape", ("Solving cameras and shape",), ("fit",)),
    ("texture", ("Extracting textures",), ("texture", "combine")),
    ("writing `.glb` / `.obj`", ("Exporting",), ("write",)),
)


def table(result: Result) -> str:
    """Seconds by stage, memory and errors, mien beside eos."""
    mien, eos, rms, surface = result.mien, result.eos, result.rms_px, result.surface_mm
    rows = [_row(name, _seconds(mien, ours), _seconds(eos, theirs)) for name, ours, theirs in ROWS]
    total = _seconds(mien, TO_FILE)
    peer = _seconds(eos, eos.seconds) if eos else None
    finding = mien.seconds["Finding faces"]
    rows += [
        _row("**photos to `.glb` / `.obj`, s**", total, peer),
        _row(
            "with mien's time for landmarks on both sides", total, peer + finding if peer else None
        ),
        _row("head folder, turntable, report", mien.seconds[WRITING], None),
        _row("**peak memory, MiB**", mien.peak_mb, eos.peak_mb if eos else None),
        _row("landmarks off, one head, RMS px", rms["mien"], rms.get("eos_mean")),
        _row("landmarks off, each photo its own head, RMS px", None, rms.get("eos")),
    ]
    if surface:
        rows.append(_row("face off the true head, median mm", surface["mien"], surface.get("eos")))
    peer_name = "eos-py" if eos else "eos-py (not installed)"
    return markdown_table(["", "mien", peer_name, "mien / eos"], rows)


def _seconds(run: Run | None, stages: Iterable[str]) -> float | None:
    return None if run is None else sum(run.seconds[stage] for stage in stages)


def _row(name: str, ours: float | None, theirs: float | None) -> list[object]:
    """Both figures and the ratio of ours to theirs."""
    ratio = "-" if ours is None or theirs is None else ours / theirs
    return [name, *("-" if value is None else value for value in (ours, theirs)), ratio]


def growth(photos: Path, work: Path) -> str:
    """Seconds and memory by number of photos."""
    rows = []
    for count in GROWTH:
        folder = work / f"growth{count}"
        folder.mkdir()
        run = run_measured("benchmarks.build_mien", [photos / f"small{count}", folder])
        stages = [run.seconds[stage] for stage in TO_FILE[1:4]]
        rows.append([count, *stages, _seconds(run, TO_FILE), run.peak_mb])
    header = ["photos", "landmarks, s", "cameras and shape", "texture", "photos to `.glb`"]
    return markdown_table([*header, "peak memory, MiB"], rows)


def render_photos(folder: Path) -> None:
    """In a process of its own, as all that needs memory."""
    plans = {f"small{count}": (count, SMALL) for count in GROWTH} | {"large5": (5, LARGE)}
    command = [sys.executable, "-m", "benchmarks.build_photos", str(folder), json.dumps(plans)]
    subprocess.run(command, check=True)


INTRO = (
    "Each program in a process of its own, after a run that does not count, which compiles and "
    "fills caches (but for eos-py on large photos, benchmarks/README.md). {cores} cores; load "
    "average before the start {before}, at the end {after}. Photos: James's head as mien builds "
    "it, seen by cameras at yaw -40 to 40 degrees, as JPEGs of quality 92. eos-py gets mien's "
    "generic head and identity basis as its morphable model, and the landmarks that mien found, "
    "at the same places. What is comparable and what is not: benchmarks/README.md."
)


def main() -> None:
    """Measures everything and writes results/build.md."""
    before = load_average()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        render_photos(work)
        truth = np.load(work / "truth.npy")
        parts = [
            "## Five photos of 1200x1500 px",
            table(compare(work / "small5", work / "a", truth)),
            "## Five photos of 3000x4000 px",
            table(compare(work / "large5", work / "b", truth, warm_up_eos=False)),
        ]
        if EMILY.is_dir():
            (work / "emily").mkdir()
            for number in EMILY_VIEWS:
                shutil.copy(EMILY / f"view{number}.jpg", work / "emily")
            parts.append("## Five renders of a light-stage scan, 1080x1620 px")
            parts.append(table(compare(work / "emily", work / "c", None)))
        parts += ["## Growth (mien, 1200x1500 px)", growth(work, work)]
    intro = INTRO.format(cores=os.cpu_count(), before=before, after=load_average())
    write_results("build", "Photos to a head", [intro, *parts])


if __name__ == "__main__":
    main()
