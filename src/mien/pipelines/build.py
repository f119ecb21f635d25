"""From photos to a head: the whole way, as one function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.capture.annotations import save_annotations
from mien.capture.folder import photo_files
from mien.capture.source import Capture, load_capture
from mien.errors import EstimationError
from mien.head import ATLAS, CYLINDER, NEUTRAL, Expression, FittedView, Head
from mien.io.files.manifest import kept_notes
from mien.io.files.video import save_video
from mien.io.head.head_folder import check_head_place, head_place, write_head
from mien.progress import Progress, StepProgress, no_progress, stage_progress
from mien.reconstruction.expression.fit import ExpressionFit, fit_expression
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.fit import Fit, FitOptions, fit_views
from mien.render.picture import turntable_frames
from mien.report import ReportInput, render_report
from mien.rig.contacts.lips import close_lips
from mien.rig.deformer import Contacts, fit_units
from mien.rig.expression_textures import ExpressionPhotos, extract_expression_textures
from mien.rig.gaze import with_turned_eyes
from mien.rig.regions import default_masks
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.extract import Texture, extract_texture
from mien.texture.fill import Fill
from mien.texture.surface import SurfaceMap

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
            neutral alone.
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
    fits: dict[str, Fit | ExpressionFit]
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
    options = options or BuildOptions()
    tell = progress or no_progress
    _check_neutral(Path(source))
    generic = load_generic_head()
    capture = load_capture(
        source,
        face=options.face,
        frames=options.frames,
        expressions=options.expressions,
        progress=stage_progress(tell, "Finding faces"),
    )
    capture = _named_by_expression(capture)
    if NEUTRAL not in capture.expressions:
        raise EstimationError(f"{source}: no photo in {NEUTRAL} shows a face that can be used")
    capture, fits, units = _fit_all(capture, generic, options, tell)
    head = _head(capture, fits, units, generic)
    head, coverage = _with_textures(head, capture, options, tell)
    return Build(head, capture, fits, coverage)


def _check_neutral(source: Path) -> None:
    """Refuse folders of expressions without one for the face at rest, before any work is done."""
    if source.is_dir() and NEUTRAL not in photo_files(source):
        raise EstimationError(f"{source}: there is no folder called {NEUTRAL} among its folders")


def _fit_all(
    capture: Capture, generic: GenericHead, options: BuildOptions, tell: Progress
) -> tuple[Capture, dict[str, Fit | ExpressionFit], Float[Array, "52 v 3"]]:
    """Neutral by itself, then each expression with neutral and its face units as what is known;

    gives the units, too.

    An expression that cannot be fitted is left out of the capture, with a note.
    """
    count = len(capture.expressions)

    def part(number: int) -> StepProgress:
        return lambda done, total: tell(SOLVING, number * total + done, count * total)

    tell(SOLVING, 0, count)
    neutral = fit_views(capture.expressions[NEUTRAL], generic, options.fit, progress=part(0))
    neutral = replace(neutral, vertices=close_lips(generic, neutral.vertices))
    fits: dict[str, Fit | ExpressionFit] = {NEUTRAL: neutral}
    views = [view for view in capture.expressions[NEUTRAL] if view.photo.name in neutral.photos]
    cameras = [neutral.photos[view.photo.name].camera for view in views]
    units = fit_units(generic, neutral.vertices)
    known = KnownHead(views, cameras, neutral.vertices, units.astype(np.float64), generic)
    contacts = Contacts.of(generic, neutral.vertices)
    notes = []
    for number, (name, shown) in enumerate(capture.expressions.items()):
        if name == NEUTRAL:
            continue
        try:
            fit = fit_expression(shown, known, progress=part(number))
        except EstimationError as error:
            notes.append(f"{name}: left out: {error}")
            continue
        fits[name] = replace(fit, vertices=contacts.resolve(fit.vertices))
    tell(SOLVING, count, count)
    fitted = {name: capture.expressions[name] for name in fits}
    return replace(capture, expressions=fitted, notes=(*capture.notes, *notes)), fits, units


def _named_by_expression(capture: Capture) -> Capture:
    """Where there are expression folders, photos are EXPRESSION/PHOTO: names may repeat in them."""
    if list(capture.expressions) == [NEUTRAL]:
        return capture
    expressions = {
        name: tuple(
            replace(view, photo=replace(view.photo, name=f"{name}/{view.photo.name}"))
            for view in views
        )
        for name, views in capture.expressions.items()
    }
    return replace(capture, expressions=expressions)


def _head(
    capture: Capture,
    fits: Mapping[str, Fit | ExpressionFit],
    units: Float[Array, "52 v 3"],
    generic: GenericHead,
) -> Head:
    neutral = fits[NEUTRAL]
    assert isinstance(neutral, Fit)
    return Head(
        subject=capture.name,
        mesh=generic.mesh.with_vertices(neutral.vertices),
        expressions={name: _expression(name, fit, generic) for name, fit in fits.items()},
        uncertainty_mm=neutral.uncertainty_mm,
        unit_names=generic.unit_names,
        unit_offsets=units,
        regions=default_masks(generic),
        left_out={photo: why for fit in fits.values() for photo, why in fit.left_out.items()},
    )


def _expression(name: str, fit: Fit | ExpressionFit, generic: GenericHead) -> Expression:
    views = tuple(
        FittedView(
            photo=photo,
            camera=item.camera,
            rms_px=item.rms_px,
            points_used=item.points_used,
            distrusted={mark.name: mark.verdict for mark in item.marks if mark.verdict},
        )
        for photo, item in fit.photos.items()
    )
    if isinstance(fit, Fit):
        return Expression(fit.vertices, views, ATLAS)
    weights = zip(generic.unit_names, fit.units.tolist(), strict=True)
    units = {unit: weight for unit, weight in weights if weight > _NEGLIGIBLE}
    vertices = with_turned_eyes(fit.vertices, fit.gaze, generic)
    return Expression(vertices, views, name, units, fit.gaze)


def _with_textures(
    head: Head, capture: Capture, options: BuildOptions, tell: Progress
) -> tuple[Head, Float[Array, "h w"]]:
    """The head with an atlas for every expression and neutral's cylinder, and

    neutral's coverage.

    Source:
        [Pighin 2002] sec. 5.2.2.
    """
    stage, total, side = "Extracting textures", 3, options.texture_size
    tell(stage, 0, total)
    atlas = atlas_surface(head.mesh, width=side, height=side)
    base = _extract(head, capture, NEUTRAL, atlas, options.fill)
    tell(stage, 1, total)
    photos = _photos(capture)
    photographed = {
        name: ExpressionPhotos(
            item.vertices,
            [view.camera for view in item.views],
            [photos[view.photo] for view in item.views],
        )
        for name, item in head.expressions.items()
    }
    looks = extract_expression_textures(head.mesh, photographed, base.pixels, load_generic_head())
    tell(stage, 2, total)
    around = cylinder_surface(head.mesh, fit_cylinder(head.mesh), parts=("skin",))
    cylinder = _extract(head, capture, NEUTRAL, around, options.fill)
    tell(stage, 3, total)
    textures = {head.expressions[name].texture: pixels for name, pixels in looks.textures.items()}
    textures[CYLINDER] = cylinder.pixels
    gains = looks.gains | {NEUTRAL: base.gains}
    expressions = {
        name: replace(item, views=_with_gains(item.views, gains[name]))
        for name, item in head.expressions.items()
    }
    head = replace(head, expressions=expressions, textures=textures, shading=looks.shading)
    return head, base.coverage


def _with_gains(views: Sequence[FittedView], gains: Float[Array, "k 3"]) -> tuple[FittedView, ...]:
    return tuple(replace(view, gains=own) for view, own in zip(views, gains, strict=True))


def _extract(head: Head, capture: Capture, name: str, surface: SurfaceMap, fill: Fill) -> Texture:
    generic = load_generic_head()
    photos = _photos(capture)
    views = head.expressions[name].views
    return extract_texture(
        head.expression_mesh(name),
        [view.camera for view in views],
        [photos[view.photo] for view in views],
        surface=surface,
        fill=fill,
        mirror=generic.mirror,
        regions=generic.regions,
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
        as build_head; InputError: the place holds something that is no head folder, or cannot be
            written. Whatever was there stays until the new folder is whole.
    """
    tell = progress or no_progress
    check_head_place(folder, read=[source])
    result = build_head(source, options=options, progress=progress)
    stage = "Writing the head"
    with head_place(folder, read=[source]) as place:
        tell(stage, 0, 2)
        photos = _photos(result.capture)
        used = [(view.photo, photos[view.photo]) for view in result.head.views]
        write_head(result.head, place, photos=used)
        for view in result.capture.views:
            if view.annotations:
                file = (place / "annotations" / view.photo.name).with_suffix(".json")
                save_annotations(file, view.photo, view.annotations)
        tell(stage, 1, 2)
        save_video(place / TURNTABLE, turntable_frames(result.head), fps=24)
        tell(stage, 2, 2)
        report = ReportInput(
            result.head, photos, result.fits, result.coverage, result.notes, TURNTABLE
        )
        page = render_report(report, progress=stage_progress(tell, REPORTING))
        (place / "report.html").write_text(page, encoding="utf-8")
    return replace(result, kept=kept_notes(Path(folder)))
