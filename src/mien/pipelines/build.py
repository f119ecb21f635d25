"""From photos to a textured head with expressions: `build_head`, and its folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.capture.annotations import save_annotations
from mien.capture.folder import photo_files
from mien.capture.photo_sorting import sort_by_expression, sorting_notes
from mien.capture.source import Capture, CapturedView, load_capture
from mien.errors import EstimationError
from mien.head import ATLAS, NEUTRAL, Expression, FittedView, Head
from mien.io.files.manifest import kept_notes
from mien.io.files.video import save_video
from mien.io.head.head_folder import check_head_place, head_place, write_head
from mien.pipelines.head_textures import texture_head
from mien.progress import Progress, StepProgress, no_progress, stage_progress
from mien.reconstruction.expression.fit import fit_expression
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.fit import FitOptions, fit_views
from mien.reconstruction.result import ExpressionFit, Fit, NeutralFit
from mien.reconstruction.shared_skin import find_other_people
from mien.render.picture import turntable_frames
from mien.report import ReportInput, render_report
from mien.rig.contacts.lips import close_lips
from mien.rig.deformer import Contacts, fit_units
from mien.rig.gaze import with_turned_eyes
from mien.rig.regions import default_masks
from mien.texture.fill import Fill

SOLVING = "Solving cameras and shape"
REPORTING = "Writing the report"
TURNTABLE = "turntable.mp4"
_NEGLIGIBLE = 0.01
"""A unit with less weight has no part in an expression."""


@dataclass(frozen=True)
class BuildOptions:
    """How a head is built.

    Attributes:
        fit: how cameras and shape are found.
        fill: "pyramid" or "grow": how texture that no photo shows is filled.
        texture_size: side of the atlas in px; the cylinder is always 2048x1024.
        face: which face where a photo shows several.
        frames: how many frames of the face at rest to pick from a video.
        expressions: how many other expressions to pick from a video; None takes what differs, 0
            neutral alone, also of a folder of photos that show different ones.
    """

    fit: FitOptions = field(default_factory=FitOptions)
    fill: Fill = "pyramid"
    texture_size: int = 2048
    face: int | None = None
    frames: int = 7
    expressions: int | None = None


@dataclass(frozen=True)
class Build:
    """A head and how it came about, for those who want to look closer.

    Attributes:
        head: the result.
        capture: the photos with landmarks and marks.
        fits: by expression.
        coverage: (H, W) summed weights of the photos in the neutral atlas.
        kept: notes on what the folder held that mien had not written.
    """

    head: Head
    capture: Capture
    fits: dict[str, Fit]
    coverage: Float[Array, "h w"]
    kept: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, in the order in which it was noticed."""
        several = len(self.fits) > 1
        fitted = [
            f"{name}: {note}" if several else note
            for name, fit in self.fits.items()
            for note in fit.notes
        ]
        left_out = [f"{photo} was left out: {why}" for photo, why in self.head.left_out.items()]
        return (*self.capture.notes, *left_out, *fitted, *self.kept)


def build_head(
    source: str | Path,
    *,
    options: BuildOptions | None = None,
    progress: Progress | None = None,
) -> Build:
    """A textured head from a folder of photos, one photo or a video of a person.

    Args:
        source: photos of the face at rest; or a folder with a folder of photos for each expression,
            one of them called "neutral"; or a video.
        options: how; the defaults unless given.
        progress: called with the stage, steps done and their total.

    Returns:
        The head (`Build.head`), what it was made from, and notes for the user.

    Raises:
        InputError: nothing at `source` that can be read, or no photo in it.
        FileFormatError: a photo, a video or an annotation file is damaged.
        EstimationError: no photo fits.
    """
    options, progress = options or BuildOptions(), progress or no_progress
    _check_neutral(Path(source))
    generic = load_generic_head()
    capture = _load_capture(source, options, stage_progress(progress, "Finding faces"))
    solving = stage_progress(progress, SOLVING)
    neutral, known = _fit_neutral(capture, generic, options.fit, solving)
    capture = _with_turned_over(capture, neutral)
    expressions, notes = _fit_expressions(capture, known, solving)
    fits: dict[str, Fit] = {NEUTRAL: neutral, **expressions}
    capture = replace(
        capture,
        expressions={name: capture.expressions[name] for name in fits},
        notes=(*capture.notes, *notes),
    )
    head, coverage = texture_head(
        _untextured_head(capture.name, neutral, expressions, known),
        _photos(capture),
        size=options.texture_size,
        fill=options.fill,
        progress=stage_progress(progress, "Extracting textures"),
    )
    return Build(head, capture, fits, coverage)


def _check_neutral(source: Path) -> None:
    """Refuse folders of expressions without one for the face at rest, before any work is done."""
    if source.is_dir() and NEUTRAL not in photo_files(source):
        raise EstimationError(f"{source}: there is no folder called {NEUTRAL} among its folders")


def _load_capture(source: str | Path, options: BuildOptions, progress: StepProgress) -> Capture:
    capture = load_capture(
        source,
        face=options.face,
        frames=options.frames,
        expressions=options.expressions,
        progress=progress,
    )
    if NEUTRAL not in capture.expressions:
        raise EstimationError(f"{source}: no photo in {NEUTRAL} shows a face that can be used")
    if list(capture.expressions) != [NEUTRAL]:
        return _named_by_expression(capture)
    return _sorted(capture, options.expressions != 0)


def _sorted(capture: Capture, others: bool) -> Capture:
    """Photos from life in one folder: those of other expressions are no part of neutral."""
    found = sort_by_expression(capture.expressions[NEUTRAL])
    notes = (*capture.notes, *sorting_notes(found, kept=others))
    return replace(capture, expressions=found if others else {NEUTRAL: found[NEUTRAL]}, notes=notes)


def _fit_neutral(
    capture: Capture, generic: GenericHead, options: FitOptions, progress: StepProgress
) -> tuple[NeutralFit, KnownHead]:
    """The face at rest, its lips closed, and what the expressions are fitted with."""
    progress(0, len(capture.expressions))
    views = capture.expressions[NEUTRAL]
    fit = fit_views(views, generic, options, progress=_part(0, capture, progress))
    fit = replace(fit, vertices=close_lips(generic, fit.vertices))
    turned = {view.photo.name: view for view in fit.turned_over}
    views = tuple(turned.get(view.photo.name, view) for view in views)
    views = tuple(view for view in views if view.photo.name in fit.photos)
    cameras = [fit.photos[view.photo.name].camera for view in views]
    units = fit_units(generic, fit.vertices)
    return fit, KnownHead(views, cameras, fit.vertices, units.astype(np.float64), generic)


def _with_turned_over(capture: Capture, neutral: NeutralFit) -> Capture:
    """The capture with mirrored photos as their cameras see them."""
    turned = {view.photo.name: view for view in neutral.turned_over}
    views = tuple(turned.get(view.photo.name, view) for view in capture.expressions[NEUTRAL])
    return replace(capture, expressions={**capture.expressions, NEUTRAL: views})


def _fit_expressions(
    capture: Capture, known: KnownHead, progress: StepProgress
) -> tuple[dict[str, ExpressionFit], list[str]]:
    """Every expression but neutral; notes on those that cannot be fitted and are left out."""
    contacts = Contacts.of(known.generic, known.vertices)
    fits, notes = {}, []
    for number, (name, views) in enumerate(capture.expressions.items()):
        if name == NEUTRAL:
            continue
        try:
            fit = fit_expression(views, known, progress=_part(number, capture, progress))
        except EstimationError as error:
            notes.append(f"{name}: left out: {error}")
            continue
        fits[name] = replace(fit, vertices=contacts.resolve(fit.vertices))
        notes += _strangers(views, fit, known)
    progress(len(capture.expressions), len(capture.expressions))
    return fits, notes


def _strangers(
    views: Sequence[CapturedView], fit: ExpressionFit, known: KnownHead
) -> tuple[str, ...]:
    """Notes on photos of an expression that hardly show the person; frames of one clip do."""
    first, camera = known.views[0], known.cameras[0]
    used = [view for view in views if view.photo.name in fit.photos]
    pairs = [
        ((first, view), (camera, fit.photos[view.photo.name].camera))
        for view in used
        if view.photo.path != first.photo.path
    ]
    return tuple(
        note
        for pair, cameras in pairs
        for note in find_other_people(pair, cameras, known.vertices, known.generic)
    )


def _part(number: int, capture: Capture, progress: StepProgress) -> StepProgress:
    """Progress of one expression as progress of all."""
    count = len(capture.expressions)
    return lambda done, total: progress(number * total + done, count * total)


def _named_by_expression(capture: Capture) -> Capture:
    """Of expression folders and clips: photos are EXPRESSION/PHOTO, as names may repeat."""
    expressions = {
        name: tuple(
            replace(view, photo=replace(view.photo, name=f"{name}/{view.photo.name}"))
            for view in views
        )
        for name, views in capture.expressions.items()
    }
    return replace(capture, expressions=expressions)


def _untextured_head(
    subject: str, neutral: NeutralFit, expressions: Mapping[str, ExpressionFit], known: KnownHead
) -> Head:
    generic = known.generic
    left_out = dict(neutral.left_out)
    for fit in expressions.values():
        left_out |= fit.left_out
    return Head(
        subject=subject,
        mesh=generic.mesh.with_vertices(neutral.vertices),
        expressions={
            NEUTRAL: Expression(neutral.vertices, _fitted_views(neutral), ATLAS),
            **{name: _expression(name, fit, generic) for name, fit in expressions.items()},
        },
        uncertainty_mm=neutral.uncertainty_mm,
        unit_names=generic.unit_names,
        unit_offsets=known.units,
        regions=default_masks(generic),
        left_out=left_out,
        verdict=neutral.verdict,
    )


def _expression(name: str, fit: ExpressionFit, generic: GenericHead) -> Expression:
    weights = zip(generic.unit_names, fit.units.tolist(), strict=True)
    units = {unit: weight for unit, weight in weights if weight > _NEGLIGIBLE}
    vertices = with_turned_eyes(fit.vertices, fit.gaze, generic)
    return Expression(vertices, _fitted_views(fit), name, units, fit.gaze)


def _fitted_views(fit: Fit) -> tuple[FittedView, ...]:
    return tuple(
        FittedView(
            photo=photo,
            camera=item.camera,
            rms_px=item.rms_px,
            points_used=item.points_used,
            outliers={mark.name: mark.rejection for mark in item.marks if mark.rejection},
        )
        for photo, item in fit.photos.items()
    )


def _photos(capture: Capture) -> dict[str, UInt8[Array, "h w 3"]]:
    return {view.photo.name: view.photo.pixels for view in capture.views}


def build_head_folder(
    source: str | Path,
    folder: str | Path,
    *,
    options: BuildOptions | None = None,
    progress: Progress | None = None,
) -> Build:
    """As build_head, and written as a head folder with its report and a turntable video.

    Args:
        source: as for build_head.
        folder: to write; a head folder that is there is replaced.
        options: as for build_head.
        progress: as for build_head.

    Raises:
        InputError: as build_head; the place holds something that is no head folder, or cannot be
            written. Whatever was there stays until the new folder is whole.
        EstimationError: as build_head.
    """
    report_progress = progress or no_progress
    check_head_place(folder, read=[source])
    result = build_head(source, options=options, progress=progress)
    stage = "Writing the head"
    with head_place(folder, read=[source]) as place:
        report_progress(stage, 0, 2)
        photos = _photos(result.capture)
        used = [(view.photo, photos[view.photo]) for view in result.head.views]
        write_head(result.head, place, photos=used)
        for view in result.capture.views:
            if view.annotations:
                file = (place / "annotations" / view.photo.name).with_suffix(".json")
                save_annotations(file, view.photo, view.annotations)
        report_progress(stage, 1, 2)
        save_video(place / TURNTABLE, turntable_frames(result.head), fps=24)
        report_progress(stage, 2, 2)
        report = ReportInput(
            result.head, photos, result.fits, result.coverage, result.notes, TURNTABLE
        )
        page = render_report(report, progress=stage_progress(report_progress, REPORTING))
        (place / "report.html").write_text(page, encoding="utf-8")
    return replace(result, kept=kept_notes(Path(folder)))
