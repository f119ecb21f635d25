"""`report.html`: one file that contains its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import head_angles_deg
from mien.head import Head
from mien.progress import StepProgress, no_step_progress
from mien.reconstruction.result import Fit, Mark, PhotoFit
from mien.reconstruction.shape.deformation import eye_centers
from mien.report.expressions import count_expressions, expression_rows
from mien.report.pictures import (
    UNCERTAINTY_LIMITS_MM,
    coverage_pictures,
    overlay_picture,
    preview_pictures,
    uncertainty_pictures,
)


@dataclass(frozen=True)
class ReportInput:
    """Contents of a report.

    Attributes:
        head: the result.
        photos: (h, w, 3) pixels by photo name.
        fits: by expression, with every observation and its residual.
        coverage: (H, W) summed texture weights in the atlas; 0 where no photo shows the texel.
        notes: for the user.
        turntable: a video beside the report, or "".
    """

    head: Head
    photos: Mapping[str, UInt8[Array, "h w 3"]]
    fits: Mapping[str, Fit]
    coverage: Float[Array, "h w"]
    notes: tuple[str, ...] = ()
    turntable: str = ""


def render_report(data: ReportInput, *, progress: StepProgress = no_step_progress) -> str:
    """The page's HTML.

    Args:
        data: contents.
        progress: called with the steps done and their total.
    """
    from jinja2 import Environment, PackageLoader

    total = count_expressions(data.head) + 1
    progress(0, total)
    expressions = expression_rows(data.head, data.photos, lambda done: progress(done, total))
    page = Environment(loader=PackageLoader("mien.report", "."), autoescape=True)
    left, right = eye_centers(data.head.mesh)
    text = page.get_template("report.html.j2").render(
        title=f"{data.head.subject}: report of the build",
        version=data.head.generator.removeprefix("mien "),
        vertices=f"{len(data.head.mesh.vertices):,}",
        interpupillary_mm=float(np.linalg.norm(left - right)),
        notes=data.notes,
        verdict=data.head.verdict,
        previews=preview_pictures(data.head),
        coverage=coverage_pictures(data.head, data.coverage),
        uncertainty=uncertainty_pictures(data.head),
        uncertainty_limits_mm=UNCERTAINTY_LIMITS_MM,
        photos=[
            _photo(data.head, name, fit.vertices, photo, data.photos[name])
            for fit in data.fits.values()
            for name, photo in fit.photos.items()
        ],
        turntable=data.turntable,
        expressions=expressions,
    )
    progress(total, total)
    return text


def _photo(
    head: Head,
    name: str,
    vertices: Float[Array, "v 3"],
    fit: PhotoFit,
    pixels: UInt8[Array, "h w 3"],
) -> dict[str, Any]:
    yaw, pitch, roll = head_angles_deg(fit.camera)
    return {
        "name": name,
        "width": fit.camera.width,
        "height": fit.camera.height,
        "focal_px": fit.camera.focal_px,
        "yaw": yaw,
        "pitch": pitch,
        "roll": roll,
        "distance_mm": float(np.linalg.norm(fit.camera.center)),
        "points_used": fit.points_used,
        "rms_px": fit.rms_px,
        "overlay": overlay_picture(head.mesh.with_vertices(vertices), fit, pixels),
        "residuals": [_residual(mark) for mark in fit.marks],
    }


def _residual(mark: Mark) -> dict[str, Any]:
    return {
        "name": mark.name,
        "x": float(mark.image_point[0]),
        "y": float(mark.image_point[1]),
        "residual_px": mark.distance_px,
        "trusted": not mark.rejection,
        "verdict": mark.rejection or ("by hand" if mark.by_hand else "detected"),
    }
