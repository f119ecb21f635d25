"""How near fitted heads come to scans. Run: python -m benchmarks.accuracy [james|emily|all]"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.error_map import save_error_map
from benchmarks.outcome import Outcome, outcome_of, without_marks
from benchmarks.scan import DATA, Scan, SurfaceError, load_scan
from benchmarks.table import markdown_table, write_results
from mien.assets.generic import GenericHead, load_generic_head
from mien.capture.source import load_capture
from mien.reconstruction.fit import FitOptions, fit_views

IMAGES = Path(__file__).parents[1] / "docs" / "images"


@dataclass(frozen=True)
class Case:
    """A way to fit one person.

    Attributes:
        title: of the row.
        person: folder of the scan.
        photos: folder of the photos.
        annotated: with the hand annotations beside the photos.
        adjust: with the joint adjustment; without it, [Pighin 2002]'s own way.
        dense: with the photos registered by all the skin that they share.
    """

    title: str
    person: str
    photos: Path
    annotated: bool = False
    adjust: bool = True
    dense: bool = True


_JAMES = Path(__file__).parents[1] / "src" / "mien" / "assets" / "data" / "james"
_EMILY = DATA / "emily" / "renders_mentalray"
CASES = (
    Case("James, 2 photos, hand annotations", "james", _JAMES, annotated=True),
    Case(
        "the same, `--no-adjust` ([Pighin 2002]'s own way)",
        "james",
        _JAMES,
        annotated=True,
        adjust=False,
    ),
    Case("James, nothing marked", "james", _JAMES),
    Case("the same, landmarks only (`--no-dense`)", "james", _JAMES, dense=False),
    Case("Emily, 7 photos, nothing marked", "emily", _EMILY),
    Case("Emily, landmarks only (`--no-dense`)", "emily", _EMILY, dense=False),
)


def measure(case: Case, scan: Scan, generic: GenericHead) -> Outcome:
    """Fits a head and lays it, and the generic head for comparison, on the scan."""
    views = load_capture(case.photos).views
    if not case.annotated:
        views = without_marks(views)
    return outcome_of(
        fit_views(views, generic, FitOptions(adjust=case.adjust, dense=case.dense)), scan, generic
    )


HEADER = (
    "",
    "median mm",
    "mean",
    "95th pct",
    "unfitted head: median",
    "mean",
    "95th pct",
    "turn between photos, deg off",
    "focal length, % off",
)
BEFORE_HEADER = ("before ICP", *HEADER[1:7])


def table(found: dict[str, Outcome]) -> str:
    """Errors after ICP, and those of the cameras (medians over the photos)."""
    rows = [
        [
            title,
            *_distances(outcome.fitted.after, outcome.generic.after),
            f"{np.median(outcome.degrees):.1f}",
            f"{100 * np.median(outcome.focal):.0f}",
        ]
        for title, outcome in found.items()
    ]
    return markdown_table(HEADER, rows)


def table_before(found: dict[str, Outcome]) -> str:
    """Errors where points that share a pixel put the heads."""
    rows = [
        [title, *_distances(outcome.fitted.before, outcome.generic.before)]
        for title, outcome in found.items()
    ]
    return markdown_table(BEFORE_HEADER, rows)


def _distances(*errors: SurfaceError) -> list[str]:
    return [f"{x:.2f}" for error in errors for x in (error.median, error.mean, error.p95)]


def run(people: Sequence[str]) -> dict[str, Outcome]:
    """Every case of these people, by title."""
    generic = load_generic_head()
    found: dict[str, Outcome] = {}
    for person in people:
        scan = load_scan(DATA / person)
        for case in CASES:
            if case.person != person:
                continue
            outcome = measure(case, scan, generic)
            found[case.title] = outcome
            if case is CASES[0]:
                attached = generic.landmark_positions(outcome.vertices)[generic.landmark_attached]
                heads = {
                    "fitted": (outcome.vertices, outcome.fitted.T_scan_head),
                    "generic head, not fitted": (outcome.unfitted, outcome.generic.T_scan_head),
                }
                save_error_map(
                    IMAGES / "accuracy-james.png", generic.mesh, heads, scan, near=attached
                )
    return found


INTRO = (
    "Distance from the face of the fitted head, as the photos see it, to the nearest point of a "
    "scan of the same person, in mm, after ICP by a similarity (the worst 5 % are dropped while "
    "aligning, none here). The unfitted generic head is measured at the same places of its mesh "
    "in the same way. Camera errors are medians over the photos. How and why: "
    "docs/notes/accuracy.md."
)
BEFORE = (
    "ICP flatters: it slides a head to where it fits. This is before it, with the similarity that "
    "fits points behind the same pixels of the most frontal photo:"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints, and with `all` writes results/accuracy.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("who", nargs="?", default="all", choices=("james", "emily", "all"))
    who = parser.parse_args(arguments).who
    people = ("james", "emily") if who == "all" else (who,)
    missing = [person for person in people if not (DATA / person).is_dir()]
    if missing:
        print(
            f"error: {DATA / missing[0]}: expected the scan and its cameras, found nothing",
            file=sys.stderr,
        )
        return 2
    found = run(people)
    parts = [INTRO, table(found), BEFORE, table_before(found)]
    if who == "all":
        write_results("accuracy", "Surface against scans", parts)
    else:
        print("\n\n".join(parts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
