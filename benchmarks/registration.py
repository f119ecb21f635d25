"""How near heads and cameras come to the truth without hand marks.

Run: python -m benchmarks.registration [--quick] [--scenes FOLDER]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.outcome import Outcome, cameras_by_stem, outcome_of, without_marks
from benchmarks.rendered import SCENES, TRUTH, write_scene
from benchmarks.same_point import (
    Calibration,
    behind_pixels,
    calibration,
    same_vertices,
    seen_face,
)
from benchmarks.scan import DATA, Scan, SurfaceError, load_scan
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array, Float
from mien.assets.generic import GenericHead, load_generic_head
from mien.capture.source import CapturedView, load_capture
from mien.errors import EstimationError
from mien.reconstruction.fit import FitOptions, NeutralFit, fit_views

WINDOW = 4
QUICK = ("James, 2 photos", "james-5", "person-1")


@dataclass(frozen=True)
class Case:
    """Photos to fit a head to.

    Attributes:
        title: of the row.
        folder: of the scan and its cameras.
        photos: their folder.
        stems: of the photos to use; None for all.
    """

    title: str
    folder: Path
    photos: Path
    stems: frozenset[str] | None = None


@dataclass(frozen=True)
class Result:
    """A fit and its errors.

    Attributes:
        same: distances to the same surface point, of the fitted and the generic head.
        generic_same: as `same`.
        calibration: None where the truth has no vertices.
        used: photos in the fit, and those there were.
        total: photos in the fit, and those there were.
        seconds: of the fit alone.
    """

    outcome: Outcome
    same: SurfaceError
    generic_same: SurfaceError
    calibration: Calibration | None
    used: int
    total: int
    seconds: float


def cases(scenes: Path, *, quick: bool = False) -> list[Case]:
    """The real photos, Emily's windows of four neighbouring views, and the rendered scenes."""
    emily = DATA / "emily"
    renders = emily / "renders_mentalray"
    found = [
        Case("James, 2 photos", DATA / "james", DATA / "james"),
        Case("Emily, 7 views", emily, renders),
        *(
            Case(f"Emily, {' '.join(window)}", emily, renders, frozenset(window))
            for window in windows(load_scan(emily))
        ),
        *(Case(name, scenes / name, scenes / name) for name in SCENES),
    ]
    return [case for case in found if case.title in QUICK] if quick else found


def windows(scan: Scan, size: int = WINDOW) -> Iterator[tuple[str, ...]]:
    """Names of neighbouring photos, from the subject's right to the left."""

    def yaw(name: str) -> float:
        x, _, z = scan.cameras[name].center - scan.surface.centroid
        return float(np.arctan2(x, z))

    names = sorted(scan.cameras, key=yaw)
    for first in range(len(names) - size + 1):
        yield tuple(names[first : first + size])


def measure(case: Case, generic: GenericHead) -> Result:
    """Fits and compares. Raises: EstimationError: no head fits."""
    scan = load_scan(case.folder)
    views = _views(case)
    start = time.perf_counter()
    fit = fit_views(views, generic, FitOptions())
    seconds = time.perf_counter() - start
    outcome = outcome_of(fit, scan, generic)
    truth = _true_vertices(case.folder)
    same, generic_same = _same_point(fit, outcome, scan, generic, truth)
    bounds = None
    if truth is not None:
        face = seen_face(truth, generic, scan.cameras)
        bounds = calibration(fit.vertices, fit.uncertainty_mm, truth, face, generic)
    used = len(fit.photos)
    return Result(outcome, same, generic_same, bounds, used, len(views), seconds)


def _same_point(
    fit: NeutralFit,
    outcome: Outcome,
    scan: Scan,
    generic: GenericHead,
    truth: Float[Array, "v 3"] | None,
) -> tuple[SurfaceError, SurfaceError]:
    """Of the fitted head and of the generic one."""
    heads = (fit.vertices, outcome.unfitted)
    if truth is None:
        cameras = cameras_by_stem(fit)
        fitted, unfitted = (behind_pixels(head, generic, cameras, scan) for head in heads)
    else:
        face = seen_face(truth, generic, scan.cameras)
        fitted, unfitted = (same_vertices(head, truth, face) for head in heads)
    return fitted, unfitted


def _views(case: Case) -> tuple[CapturedView, ...]:
    views = without_marks(_capture(case.photos))
    return tuple(view for view in views if case.stems is None or view.photo.stem in case.stems)


@cache
def _capture(photos: Path) -> tuple[CapturedView, ...]:
    return load_capture(photos).views


def _true_vertices(folder: Path) -> Float[Array, "v 3"] | None:
    path = folder / TRUTH
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as stored:
        return stored["vertices"]


SURFACE_HEADER = (
    "mm",
    "same point: median",
    "mean",
    "95th pct",
    "unfitted: median",
    "mean",
    "95th pct",
    "nearest point: median",
    "mean",
    "95th pct",
    "unfitted: median",
    "mean",
    "95th pct",
)
CAMERA_HEADER = (
    "",
    "photos used",
    "turn, deg off: median",
    "worst",
    "focal length, % off: median",
    "worst",
    "seconds",
)
BOUNDS_HEADER = ("% of vertices within 2 x uncertainty", "face, seen", "all skin")


def surface_table(results: dict[str, Result]) -> str:
    """Distances of heads, and of the generic head, from the truth."""
    rows = []
    for title, result in results.items():
        outcome = result.outcome
        errors = (
            result.same,
            result.generic_same,
            outcome.fitted.after,
            outcome.generic.after,
        )
        rows.append([title, *(f"{x:.2f}" for e in errors for x in (e.median, e.mean, e.p95))])
    return markdown_table(SURFACE_HEADER, rows)


def camera_table(results: dict[str, Result]) -> str:
    """Errors of the cameras, and what the fit took."""
    rows = []
    for title, result in results.items():
        degrees, focal = result.outcome.degrees, 100 * np.array(result.outcome.focal)
        turns = [f"{f(degrees):.2f}" if degrees else "-" for f in (np.median, np.max)]
        lengths = [f"{f(focal):.1f}" for f in (np.median, np.max)]
        used = f"{result.used} of {result.total}"
        rows.append([title, used, *turns, *lengths, f"{result.seconds:.1f}"])
    return markdown_table(CAMERA_HEADER, rows)


def bounds_table(results: dict[str, Result]) -> str:
    """Whether the uncertainties are honest: 95 % is what they promise."""
    rows = [
        [title, f"{100 * bounds.face:.0f}", f"{100 * bounds.skin:.0f}"]
        for title, result in results.items()
        if (bounds := result.calibration) is not None
    ]
    return markdown_table(BOUNDS_HEADER, rows)


INTRO = (
    "`fit_views` on photos without hand marks. Rendered scenes have exactly known shapes and "
    "cameras: a scan textured by its photos (`james`, `emily`), or somebody who never lived on "
    "mien's own mesh (`person`). `degraded`: exposures from 0.75 to 1.2, white balance within 7 %, "
    "noise of 3 grey levels; `expression`: one photo of five smiles with an open mouth."
)
SURFACE = (
    "Distances over the face, after a similarity. Same point: on scans what lies behind the same "
    "pixel of every photo, through the fitted camera and through the true one; on persons the same "
    "vertex. Nearest point: as in docs/notes/accuracy.md, after ICP. The generic head, not fitted, "
    "is measured beside it in the same way."
)
CAMERAS = (
    "Turn: of every photo from the first, against the true one. Seconds: of the fit, without "
    "finding landmarks, on 2 cores."
)
BOUNDS = (
    "The fit says how far each vertex may be off (`uncertainty_mm`). How often twice that holds:"
)


def run(scenes: Path, *, quick: bool = False) -> tuple[dict[str, Result], list[str]]:
    """Results by title, and one line for every case that no head fits."""
    generic, results, failed = load_generic_head(), {}, []
    for case in cases(scenes, quick=quick):
        if case.title in SCENES and not (case.folder / "cameras_opencv.json").is_file():
            write_scene(case.folder, SCENES[case.title])
        try:
            results[case.title] = result = measure(case, generic)
        except EstimationError as error:
            failed.append(f"{case.title}: {error}")
            continue
        print(f"{case.title}: {result.same} / {result.outcome.fitted}", file=sys.stderr)
    return results, failed


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures and prints; without --quick writes results/registration.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.registration", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="three cases, and nothing is written")
    parser.add_argument("--scenes", type=Path, help="where rendered scenes are kept or put")
    asked = parser.parse_args(arguments)
    if not DATA.is_dir():
        print(
            f"error: {DATA}: expected the scans and their cameras, found nothing", file=sys.stderr
        )
        return 2
    with tempfile.TemporaryDirectory() as temporary:
        results, failed = run(asked.scenes or Path(temporary), quick=asked.quick)
    parts = [INTRO, SURFACE, surface_table(results), CAMERAS, camera_table(results)]
    parts += [BOUNDS, bounds_table(results), *failed]
    if asked.quick:
        print("\n\n".join(parts))
    else:
        write_results("registration", "Dense registration against the truth", parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
