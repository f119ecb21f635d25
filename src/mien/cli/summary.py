"""Summary of a finished build."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mien.pipelines.build import Build


def summary_json(result: Build, folder: Path) -> dict[str, Any]:
    """For `--json`."""
    verdict = result.head.verdict
    return {
        "head": str(folder),
        "report": str(folder / "report.html"),
        "expressions": {
            name: [
                {
                    "photo": view.photo,
                    "focal_px": round(view.camera.focal_px, 2),
                    "rms_px": round(view.rms_px, 4),
                    "points_used": view.points_used,
                    "distrusted": view.outliers,
                }
                for view in expression.views
            ]
            for name, expression in result.head.expressions.items()
        },
        "left_out": result.head.left_out,
        "grade": verdict.grade if verdict else None,
        "reasons": list(verdict.reasons) if verdict else [],
        "notes": list(result.notes),
    }


def summary_text(result: Build, folder: Path) -> str:
    """For a person."""
    lines = [
        f"  {view.photo}: {view.points_used} points, off by {view.rms_px:.1f} px (RMS)"
        for view in result.head.views
    ]
    if len(result.head.expressions) > 1:
        lines.insert(0, f"  expressions: {', '.join(result.head.expressions)}")
    if result.head.verdict is not None:
        lines.append(f"  grade: {result.head.verdict}")
    lines += [f"  note: {note}" for note in result.notes]
    return "\n".join(
        [
            f"{folder}: a head from {len(result.head.views)} photos",
            *lines,
            f"  look at {folder / 'report.html'}",
        ]
    )
