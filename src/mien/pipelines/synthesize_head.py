"""`mien synthesize` of a head: an expression from points in space, or from the face of a photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.feature_points import FeatureLayout
from mien.capture.images.photos import load_photo
from mien.errors import InputError
from mien.head import Head
from mien.io.examples.weights_json import save_coefficients
from mien.io.files.image import save_image
from mien.io.head.head_folder import load_head
from mien.io.landmarks.points_json import load_points_json
from mien.pipelines.head_in_photo import find_head
from mien.pipelines.synthesize_target import check_request
from mien.progress import Progress, no_progress
from mien.render.picture import HeadRenderer
from mien.synthesis.heads.synthesizer import HeadSynthesis, HeadSynthesizer
from mien.synthesis.synthesizer import SynthesisOptions

__all__ = ["HULL_TOLERANCE_MM", "HeadView", "SynthesizedHeadPicture", "synthesize_head"]

READING, FINDING, DRAWING = "Reading the head", "Finding the face", "Drawing"

HULL_TOLERANCE_MM = 2.0
"""By so much a subregion may leave the hull of the expressions without a note."""
_MAX_DISTANCE_MM = 80.0
"""No jaw opens so far: points farther from those at rest are not in head space."""


@dataclass(frozen=True)
class HeadView:
    """The view of a head.

    Attributes:
        yaw: radians, as docs/reference/conventions.md says.
        pitch: radians, as docs/reference/conventions.md says.
        size: width and height, px.
        background: sRGB; transparent unless given.
    """

    yaw: float = 0.0
    pitch: float = 0.0
    size: tuple[int, int] = (800, 1000)
    background: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class SynthesizedHeadPicture:
    """An expression that was drawn.

    Attributes:
        size: width and height of the picture, px.
        synthesis: the face and its coefficients.
        hull_mm: of each subregion, as `HeadSynthesis.hull_mm`.
        notes: what the user should know.
    """

    size: tuple[int, int]
    synthesis: HeadSynthesis
    hull_mm: dict[str, float]
    notes: tuple[str, ...]


def synthesize_head(
    folder: str | Path,
    output: str | Path,
    *,
    points: str | Path | None = None,
    photo: str | Path | None = None,
    weights: str | Path | None = None,
    options: SynthesisOptions | None = None,
    warp: bool = True,
    view: HeadView | None = None,
    progress: Progress | None = None,
) -> SynthesizedHeadPicture:
    """Make an expression of a head and write a picture of it.

    Args:
        folder: of the head.
        output: .png or .jpg.
        points: a file of feature points, mm, head space; or
        photo: a file of one of the same person, whose face has the expression; the head is drawn
            over that face.
        weights: W.json to write, which expressions made which subregion.
        options: as for `HeadSynthesizer`.
        warp: as for `HeadSynthesizer`.
        view: of `points`; a photo has its own.
        progress: called with the stage, steps done and their total.

    Raises:
        InputError: neither or both of points and photo, a place that cannot be written, points that
            are not in head space.
        FileFormatError: as `load_head`, `load_points_json`.
        EstimationError: no face in the photo that this head fits.
    """
    report = progress or no_progress
    check_request(folder, points, photo, output, weights)
    report(READING, 0, 0)
    head = load_head(folder)
    report(READING, 1, 1)
    if photo is not None:
        report(FINDING, 0, 0)
        drawn = _draw_over_photo(head, photo, options, warp)
        report(FINDING, 1, 1)
    else:
        assert points is not None
        report(DRAWING, 0, 0)
        drawn = _draw_from_points(head, points, options, warp, view or HeadView())
        report(DRAWING, 1, 1)
    save_image(output, drawn.picture)
    if weights is not None:
        _write_weights(weights, drawn.synthesizer, head, drawn.synthesis)
    names = drawn.synthesizer.subregions.names
    hull_mm = dict(zip(names, drawn.synthesis.hull_mm.tolist(), strict=True))
    height, width = drawn.picture.shape[:2]
    notes = (*drawn.notes, *_hull_notes(hull_mm))
    return SynthesizedHeadPicture((width, height), drawn.synthesis, hull_mm, notes)


@dataclass(frozen=True)
class _Drawing:
    synthesizer: HeadSynthesizer
    synthesis: HeadSynthesis
    picture: Array
    notes: tuple[str, ...] = ()


def _draw_from_points(
    head: Head,
    path: str | Path,
    options: SynthesisOptions | None,
    warp: bool,
    view: HeadView,
) -> _Drawing:
    synthesizer = HeadSynthesizer(head, options, warp=warp)
    known, positions = _read_points(path, synthesizer.layout)
    _check_points(path, synthesizer, known, positions)
    synthesis = synthesizer.synthesize(synthesizer.complete(known, positions))
    renderer = HeadRenderer(head, rig=synthesizer.rig)
    camera = renderer.camera(view.yaw, view.pitch, size=view.size)
    picture = renderer.draw_posed(synthesis.face, camera, background=view.background)
    return _Drawing(synthesizer, synthesis, picture)


def _draw_over_photo(
    head: Head, path: str | Path, options: SynthesisOptions | None, warp: bool
) -> _Drawing:
    photo = load_photo(path)
    found = find_head(head, photo)
    notes = [f"{photo.name}: {note}" for note in photo.notes]
    synthesizer = HeadSynthesizer(head, options, warp=warp, rig=found.rig)
    synthesis = synthesizer.synthesize(found.points)
    renderer = HeadRenderer(head, rig=synthesizer.rig)
    picture = renderer.draw_posed(synthesis.face, found.camera, background=photo.pixels)
    return _Drawing(synthesizer, synthesis, picture, (*notes, *found.notes))


def _read_points(
    path: str | Path, layout: FeatureLayout
) -> tuple[Int[Array, " k"], Float[Array, "k 3"]]:
    suffix = Path(path).suffix
    if suffix.lower() != ".json":
        raise InputError(path, "a .json of points in space", suffix or "no suffix")
    named = load_points_json(path, layout, axes=3)
    return np.array([layout.index(name) for name in named]), np.array(list(named.values()))


def _check_points(
    path: str | Path, synthesizer: HeadSynthesizer, known: Int[Array, " k"], positions: Array
) -> None:
    """Refuse points that are far from the face, or on its other side.

    Raises:
        InputError: bad input.
    """
    layout, rest = synthesizer.layout, synthesizer.examples[0]
    distances = np.linalg.norm(positions - rest[known], axis=1)
    mirrored = np.linalg.norm(positions - rest[layout.mirror[known]], axis=1)
    if (mirrored**2).sum() < (distances**2).sum():
        expected = "right and left as the subject has them, x to the subject's left"
        raise InputError(path, expected, "points that fit the face only when mirrored")
    if distances.max() > _MAX_DISTANCE_MM:
        worst = int(distances.argmax())
        position = ", ".join(f"{number:g}" for number in positions[worst])
        expected = "mm in the head's own space, near the face"
        raise InputError(path, expected, f"{layout.names[known[worst]]} at {position}")


def _write_weights(
    path: str | Path, synthesizer: HeadSynthesizer, head: Head, synthesis: HeadSynthesis
) -> None:
    names = synthesizer.rig.names
    photos = [", ".join(view.photo for view in head.expressions[name].views) for name in names]
    save_coefficients(
        path,
        layout=synthesizer.layout.name,
        sources=dict(zip(names, photos, strict=True)),
        subregions=synthesizer.subregions.names,
        coefficients=synthesis.coefficients,
        hull={"hull_mm": synthesis.hull_mm},
    )


def _hull_notes(hull_mm: dict[str, float]) -> tuple[str, ...]:
    parts = [
        f"{name.replace('_', ' ')} by {mm:.1f} mm"
        for name, mm in sorted(hull_mm.items(), key=lambda item: -item[1])
        if mm > HULL_TOLERANCE_MM
    ]
    return (f"beyond what the expressions show: {', '.join(parts)}",) if parts else ()
