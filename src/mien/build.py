"""From photos to a head: the whole way, as one function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.capture.annotations import save_annotations
from mien.capture.source import Capture, load_capture
from mien.errors import EstimationError
from mien.formats.atomic import atomic_folder
from mien.formats.head_folder import check_head_place, is_head_folder, write_head
from mien.formats.video import write_video
from mien.model.fit import Fit, FitOptions, fit_views
from mien.model.head import ATLAS, CYLINDER, NEUTRAL, Expression, FittedView, Head
from mien.render.picture import turntable_frames
from mien.report import ReportInput, render_report
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.extract import Texture, extract_texture
from mien.texture.fill import Fill
from mien.texture.surface import SurfaceMap

Progress = Callable[[str, int, int], None]
"""Told the stage, the steps done and their total."""

SOLVING = "Solving cameras and shape"
TURNTABLE = "turntable.mp4"


@dataclass(frozen=True)
class BuildOptions:
    """How a head is built.

    Attributes:
        fit: how cameras and shape are found.
        fill: "pyramid" or "grow": how texture that no photo shows is filled.
        texture_size: side of the atlas in px; the cylinder is always 2048x1024.
        face: which face where a photo shows several.
        frames: how many frames to pick from a video.
    """

    fit: FitOptions = field(default_factory=FitOptions)
    fill: Fill = "pyramid"
    texture_size: int = 2048
    face: int | None = None
    frames: int = 7


@dataclass(frozen=True)
class Build:
    """A head and how it came about, for those who want to look closer.

    Attributes:
        head: the result. capture: the photos with landmarks and marks. fits: by expression.
        coverage: (H, W) summed weights of the photos in the neutral atlas.
    """

    head: Head
    capture: Capture
    fits: dict[str, Fit]
    coverage: Float[Array, "h w"]

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
        return (*self.capture.notes, *left_out, *fitted)


def build_head(
    source: str | Path,
    *,
    options: BuildOptions | None = None,
    progress: Progress | None = None,
) -> Build:
    """A textured head from a folder of photos, one photo, or a video.

    Raises: InputError, FileFormatError: the source. EstimationError: no photo fits.
    """
    options = options or BuildOptions()
    tell = progress or (lambda stage, done, total: None)
    generic = load_generic_head()
    capture = load_capture(
        source,
        face=options.face,
        frames=options.frames,
        progress=lambda done, total: tell("Finding faces", done, total),
    )
    capture = _named_by_expression(capture)
    if NEUTRAL not in capture.expressions:
        raise EstimationError(f"{source}: there is no folder called {NEUTRAL} among its folders")
    fits: dict[str, Fit] = {}
    count = len(capture.expressions)
    for number, (name, views) in enumerate(capture.expressions.items()):
        tell(SOLVING, number, count)

        def solving(done: int, total: int, number: int = number) -> None:
            tell(SOLVING, number * total + done, count * total)

        fits[name] = fit_views(views, generic, options.fit, progress=solving)
    tell(SOLVING, count, count)
    head = _head(capture, fits, generic)
    textures, coverage = _extract_textures(head, capture, options, tell)
    return Build(replace(head, textures=textures), capture, fits, coverage)


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


def _head(capture: Capture, fits: dict[str, Fit], generic: GenericHead) -> Head:
    neutral = fits[NEUTRAL]
    return Head(
        subject=capture.name,
        mesh=generic.mesh.with_vertices(neutral.vertices),
        expressions={name: _expression(name, fit) for name, fit in fits.items()},
        uncertainty_mm=neutral.uncertainty_mm,
        unit_names=generic.unit_names,
        unit_offsets=generic.unit_offsets,
        left_out={photo: why for fit in fits.values() for photo, why in fit.left_out.items()},
    )


def _expression(name: str, fit: Fit) -> Expression:
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
    return Expression(fit.vertices, views, ATLAS if name == NEUTRAL else name)


def _extract_textures(
    head: Head, capture: Capture, options: BuildOptions, tell: Progress
) -> tuple[dict[str, UInt8[Array, "h w 3"]], Float[Array, "h w"]]:
    """An atlas for every expression, neutral's cylinder (P02 sec. 5.2.2), neutral's coverage."""
    stage, total = "Extracting textures", len(head.expressions) + 1
    tell(stage, 0, total)
    textures: dict[str, Texture] = {}
    side = options.texture_size
    for name, expression in head.expressions.items():
        atlas = atlas_surface(head.expression_mesh(name), width=side, height=side)
        textures[expression.texture] = _extract(head, capture, name, atlas, options.fill)
        tell(stage, len(textures), total)
    around = cylinder_surface(head.mesh, fit_cylinder(head.mesh), parts=("skin",))
    textures[CYLINDER] = _extract(head, capture, NEUTRAL, around, options.fill)
    tell(stage, total, total)
    pixels = {name: texture.pixels for name, texture in textures.items()}
    return pixels, textures[ATLAS].coverage


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

    Raises: as build_head; InputError: the place holds something that is no head folder, or cannot
        be written. Whatever was there stays until the new folder is whole.
    """
    tell = progress or (lambda stage, done, total: None)
    check_head_place(folder)
    result = build_head(source, options=options, progress=progress)
    stage = "Writing the head"
    with atomic_folder(folder, replaces=is_head_folder) as place:
        tell(stage, 0, 3)
        photos = _photos(result.capture)
        used = [(view.photo, photos[view.photo]) for view in result.head.views]
        write_head(result.head, place, photos=used)
        for view in result.capture.views:
            if view.annotations:
                file = (place / "annotations" / view.photo.name).with_suffix(".json")
                save_annotations(file, view.photo, view.annotations)
        tell(stage, 1, 3)
        write_video(place / TURNTABLE, turntable_frames(result.head), fps=24)
        tell(stage, 2, 3)
        report = ReportInput(
            result.head, photos, result.fits, result.coverage, result.notes, TURNTABLE
        )
        (place / "report.html").write_text(render_report(report), encoding="utf-8")
        tell(stage, 3, 3)
    return result
